"""Figure 4 of Husman et al. (2000): rotation against the upper separation t1 of the wires in y.

With wires alone and with cantilevers. Writes `results/figure4.png` and `.md`. Run by `make fig4`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from suspension_cli.drawing.curves import rule
from suspension_cli.drawing.labels import label_ends, room_for
from suspension_cli.drawing.style import NOTE, PALETTE, house_style, new_figure, save, write_heading
from suspension_cli.files.whole_files import write_bytes
from suspension_cli.models import closed_form
from tools.figure3 import Curve, curves
from tools.margins import set_margins
from tools.tables import PAPER, ROOT

POINTS = 241
AXES = "force model; axes as printed in the paper"
PATH, MODE = "stage.test.wires.t1", "test yaw"


def solved(level: str = "force") -> list[Curve]:
    """Compute both curves on the paper's axis of t1."""
    return curves("figure4", PATH, np.linspace(*PAPER["figure4"]["x_range"], POINTS), MODE, level)


def equation_9(curve: Curve) -> np.ndarray:
    """Rotation frequency (p,) by equation 9 for the wires of a curve, Hz."""
    return np.sqrt(closed_form.rotation(replace(curve.wires, t1=curve.value))) / (2 * np.pi)


def draw(found: list[Curve]) -> Figure:
    """Draw both curves on the axes of the paper's figure."""
    printed = PAPER["figure4"]
    figure = new_figure(5.0, 3.9)
    write_heading(figure, "Rotation frequency against half the upper wire separation", AXES)
    axes = figure.subplots()
    set_margins(figure, left=0.55, right=room_for(["wires + cantilevers"]), bottom=0.45)
    axes.set(
        xlim=printed["x_range"],
        ylim=printed["y_range"],
        xlabel="$t_1$, half the upper separation of the wires in y (m)",
        ylabel="rotation frequency (Hz)",
    )
    rule(axes)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    bare, _ = found
    axes.axvline(printed["t2"], color=NOTE, linewidth=0.6, linestyle=(0, (1, 2)))
    for text, place, shift, look in (
        ("$t_1 = t_2$\nvertical", (printed["t2"], 8.9), (3, 0), {"ha": "left"}),
        (
            f"↑ to {bare.frequency[0]:.3g} Hz at $t_1 = 0$",
            (_leaves(bare), 8.9),
            (9, 0),
            {"ha": "left", "color": PALETTE[0]},
        ),
    ):
        axes.annotate(
            text,
            place,
            shift,
            textcoords="offset points",
            va="top",
            fontsize=8,
            **{"color": NOTE, **look},
        )
    for n, curve in enumerate(found):
        axes.plot(curve.value, curve.frequency, color=PALETTE[n], linewidth=1.4)
    label_ends(
        axes,
        [(curve.value, curve.frequency, curve.label, PALETTE[n]) for n, curve in enumerate(found)],
    )
    return figure


def _leaves(bare: Curve) -> float:
    """Value of t1 at which the curve of the wires alone leaves the printed axis, m."""
    high = PAPER["figure4"]["y_range"][1]
    half = POINTS // 2
    return float(np.interp(-high, -bare.frequency[:half], bare.value[:half]))


def main() -> None:
    """Draw the figure and write its numbers."""
    printed = PAPER["figure4"]
    found, general = solved(), solved("string")
    sampled = np.array([0.0, 0.03, 0.06, 0.095, 0.12])
    lines = [
        "# Figure 4",
        "",
        (
            "Rotation (yaw) against t1, half the upper separation of the wires in y, from the sweep"
            " of `force`; t2 = 95 mm, s = 30 mm. As the paper says, angled wires raise it, unless"
            " they hang from cantilevers: then it falls, for t1 below t2."
        ),
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
        (ROOT / "results").mkdir(exist_ok=True)
        save(draw(found), ROOT / "results" / "figure4.png")
    bare, soft = found
    leaves = _leaves(bare)
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
            "The lower curve takes cantilevers in series with the wires, as the paper's force model"
            " does. With tips that move vertically only (`string`)"
        ),
        (
            f"it begins at {general[1].frequency[0]:.4g} Hz instead of {soft.frequency[0]:.4g} Hz"
            " and still falls with the angle."
        ),
        "",
    ]
    text = "\n".join(lines)
    write_bytes(ROOT / "results" / "figure4.md", text.encode())
    print(text)


if __name__ == "__main__":
    main()
