"""Figure 4 of Husman et al. (2000): rotation against the upper separation t1 of the wires in y.

With wires alone and with cantilevers. Writes `results/figure4.png` and `.md`. Run by `make fig4`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from suspension_cli.drawing.style import NOTE, PALE, PALETTE, house_style, new_figure, save
from suspension_cli.files.atomic import write_bytes
from suspension_cli.models import closed_form
from tools.figure3 import Curve, curves
from tools.tables import PAPER, ROOT

POINTS = 241
PATH, MODE = "stage.test.wires.t1", "test yaw"


def solved(level: str = "force") -> list[Curve]:
    """Compute both curves on the paper's axis of t1."""
    return curves("figure4", PATH, np.linspace(*PAPER["figure4"]["x_range"], POINTS), MODE, level)


def equation_9(curve: Curve) -> np.ndarray:
    """Rotation frequency (p,) by equation 9 for the wires of a curve, Hz."""
    return np.sqrt(closed_form.rotation(replace(curve.wires, t1=curve.value))) / (2 * np.pi)


def main() -> None:
    """Draw the figure and write its numbers."""
    printed = PAPER["figure4"]
    found, general = solved(), solved("string")
    sampled = np.array([0.0, 0.03, 0.06, 0.095, 0.12])
    lines = [
        "# Figure 4",
        "",
        "Rotation (yaw) against t1, from the sweep of `force`; t2 = 95 mm, s = 30 mm.",
        "",
    ]
    lines += [
        "| | " + " | ".join(f"t1 = {1e3 * t:.0f} mm" for t in sampled) + " |",
        "|---|" + "---:|" * len(sampled),
    ]
    lines += [
        f"| {curve.label} | "
        + " | ".join(f"{np.interp(t, curve.value, curve.frequency):#.4g}" for t in sampled)
        + " |"
        for curve in found
    ]
    with house_style():
        figure = new_figure(4.6, 3.7)
        axes = figure.subplots()
        axes.set(
            xlim=printed["x_range"],
            ylim=printed["y_range"],
            xlabel="upper separation of wires in y, $t_1$ (m)",
            ylabel="rotation frequency (Hz)",
        )
        axes.axvline(printed["t2"], color=NOTE, linewidth=0.6, linestyle=(0, (1, 2)))
        axes.annotate(
            "$t_1 = t_2$",
            (printed["t2"], 8.9),
            xytext=(3, 0),
            textcoords="offset points",
            va="top",
            color=NOTE,
        )
        for n, curve in enumerate(found):
            axes.plot(curve.value, curve.frequency, color=PALETTE[n], linewidth=1.4)
        axes.annotate(
            found[0].label,
            (0.052, np.interp(0.052, found[0].value, found[0].frequency)),
            xytext=(6, 2),
            textcoords="offset points",
            color=PALETTE[0],
        )
        axes.annotate(
            found[1].label,
            (0.02, 1.55),
            xytext=(0, -4),
            textcoords="offset points",
            va="top",
            color=PALETTE[1],
        )
        axes.grid(visible=True, color=PALE, linewidth=0.4)
        figure.tight_layout()
        (ROOT / "results").mkdir(exist_ok=True)
        save(figure, ROOT / "results" / "figure4.png")
    bare, soft = found
    leaves = float(
        np.interp(-printed["y_range"][1], -bare.frequency[: POINTS // 2], bare.value[: POINTS // 2])
    )
    half, thin = (
        float(equation_9(replace(bare, wires=changed))[0])
        for changed in (replace(bare.wires, s=0.015), replace(bare.wires, k=bare.wires.k / 4))
    )
    lines += [
        "",
        (
            "Frequencies in Hz. The wires alone leave the printed axis, which ends at"
            f" {printed['y_range'][1]:g} Hz, below t1 = {1e3 * leaves:.1f} mm; if 3 cm"
        ),
        (
            "were the whole separation 2s, or 198 µm the diameter, they would stay on it"
            f" ({half:.3g} and {thin:.3g} Hz at t1 = 0)."
        ),
        (
            "The lower curve takes cantilevers in series with the wires, along them, as the paper's"
            " force model does. With their tips as coordinates"
        ),
        (
            "of their own (`string`), which move vertically only, it begins at"
            f" {general[1].frequency[0]:.4g} Hz instead of {soft.frequency[0]:.4g} Hz"
        ),
        "and still falls with the angle.",
        "",
    ]
    text = "\n".join(lines)
    write_bytes(ROOT / "results" / "figure4.md", text.encode())
    print(text)


if __name__ == "__main__":
    main()
