"""Figure 3 of Husman et al. (2000): tilt against the separation 2s of the wires in x.

With wires alone and with cantilevers. Dashed: the two limits that the text names, from equations 10
to 14. At large s the term 4 k s^2 cos^2(Omega) / IY of A22 dominates and the frequency is
proportional to s; at s = 0 it is an eigenvalue of A that depends on d. Writes
`results/figure3.png` and `.md`. Run by `make fig3`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analyses.sweep import file as files
from suspension_cli.analyses.sweep.solve import ParameterSweep, evaluate_results
from suspension_cli.design.reader import read
from suspension_cli.drawing.style import INK, NOTE, PALE, PALETTE, house_style, new_figure, save
from suspension_cli.files.atomic import write_bytes
from suspension_cli.linear import named_results
from suspension_cli.models import closed_form
from suspension_cli.models.closed_form import FourWires
from suspension_cli.studies import mode_tracking
from suspension_cli.studies.axes import Axis
from tools.tables import PAPER, ROOT

POINTS = 301
CANTILEVERS = "stage.test.blades={{ count = 4, stiffness = {} }}"


@dataclass(frozen=True)
class Curve:
    """Frequency of one mode against one parameter of one design.

    Attributes
    ----------
    label : str
    wires : FourWires
        The design in the paper's symbols, the series of wire and cantilever as its k.
    value, frequency : (p,) arrays
        Of the parameter (SI) and of the mode, Hz.
    """

    label: str
    wires: FourWires
    value: Any
    frequency: Any


def curves(figure: str, path: str, value: Any, mode: str, level: str = "force") -> list[Curve]:
    """Compute the curves of a figure: wires alone, and wires with cantilevers."""
    result = []
    softness = PAPER["figure3"]["blade_stiffness"]
    for label, overrides in (
        ("wires", ()),
        ("wires + cantilevers", (CANTILEVERS.format(softness),)),
    ):
        source = read(ROOT / "configs" / "husman2000" / f"{figure}.toml", overrides)
        wires = closed_form.four_wires(read(source.file).design)
        if overrides:
            wires = replace(wires, k=1 / (1 / wires.k + 1 / softness))
        result.append(
            Curve(label, wires, value, follow_mode(source.text, path, value, mode, level))
        )
    return result


def follow_mode(text: str, path: str, value: Any, mode: str, level: str) -> Any:
    """Compute the frequency (p,) of one mode over a parameter, as `pendsus sweep` does."""
    job = ParameterSweep(
        text, (Axis(path, tuple(value.tolist())),), level, (named_results.Mode(mode, -1),)
    )
    number = named_results.labels(job.nominal).index(mode)
    points = job.compute(0, job.count)
    rank, _ = mode_tracking.follow(
        points["omega_squared"],
        points["shape"],
        points["status"] == 0,
        files.nearest_point(job),
        job.nominal_shape,
    )
    return evaluate_results(
        (named_results.Mode(mode, number),), points["omega_squared"], rank, None
    )[:, 0]


def linear(wires: FourWires, s: Any) -> Any:
    """Tilt frequency in the limit of large s, Hz: stretching alone, proportional to s."""
    return np.sqrt(4 * wires.k * s**2 * wires.cos**2 / wires.inertia[1]) / (2 * np.pi)


def constant(wires: FourWires) -> float:
    """Tilt frequency at s = 0, Hz: the eigenvalue of A that is mostly tilt."""
    values, vectors = np.linalg.eig(closed_form.longitudinal_tilt(replace(wires, s=0.0)))
    energy = np.array([wires.mass, wires.inertia[1]])[:, None] * vectors**2
    return float(np.sqrt(-values[np.argmax(energy[1] / energy.sum(0))]) / (2 * np.pi))


def solved() -> list[Curve]:
    """Compute both curves on the paper's axis of 2s."""
    low, high = PAPER["figure3"]["x_range"]
    return curves(
        "figure3", "stage.test.wires.s", np.geomspace(low, high, POINTS) / 2, "test pitch"
    )


def main() -> None:
    """Draw the figure and write its numbers."""
    printed = PAPER["figure3"]
    lines = [
        "# Figure 3",
        "",
        (
            "Tilt of a mass on four vertical wires 1 mm above its centre, against the separation"
            " 2s, from the sweep of `force`."
        ),
        "",
    ]
    lines += [
        (
            "| | k of one wire (N/m) | at 2s = 0.1 mm | 1 mm | 10 mm | 100 mm | linear limit at 100"
            " mm | constant limit |"
        ),
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    with house_style():
        figure = new_figure(4.6, 3.7)
        axes = figure.subplots()
        axes.set(
            xscale="log",
            yscale="log",
            xlim=printed["x_range"],
            ylim=printed["y_range"],
            xlabel="separation $2s$ (m)",
            ylabel="tilt frequency (Hz)",
        )
        first, _ = both = solved()
        for n, curve in enumerate(both):
            x = 2 * curve.value
            limit, level = linear(curve.wires, curve.value), constant(curve.wires)
            axes.plot(x, limit, color=NOTE, linestyle="--", linewidth=0.8)
            if n == 0:
                axes.axhline(level, color=NOTE, linestyle="--", linewidth=0.8)
            axes.plot(x, curve.frequency, color=PALETTE[n], linewidth=1.4)
            at = POINTS * (62, 84)[n] // 100
            axes.annotate(
                curve.label.replace("+ ", "+\n"),
                (x[at], curve.frequency[at]),
                xytext=(-6, 2),
                textcoords="offset points",
                ha="right",
                va="bottom",
                color=PALETTE[n],
            )
            sampled = np.interp(np.log([1e-4, 1e-3, 1e-2, 1e-1]), np.log(x), curve.frequency)
            cells = " | ".join(f"{f:#.4g}" for f in (*sampled, limit[-1], level))
            lines.append(f"| {curve.label} | {curve.wires.k:#.5g} | {cells} |")
        axes.annotate(
            "set by $d$",
            (1.3e-4, constant(first.wires)),
            xytext=(0, -3),
            textcoords="offset points",
            va="top",
            color=NOTE,
        )
        axes.annotate(
            r"$\propto s$",
            (4e-4, linear(first.wires, 2e-4)),
            xytext=(4, 0),
            textcoords="offset points",
            va="top",
            color=NOTE,
        )
        axes.grid(visible=True, color=PALE, linewidth=0.4)
        axes.tick_params(colors=INK)
        figure.tight_layout()
        (ROOT / "results").mkdir(exist_ok=True)
        save(figure, ROOT / "results" / "figure3.png")
    text = "\n".join(
        [
            *lines,
            "",
            "Frequencies in Hz. Dashed in the figure: the two limits, from equations 10 to 14.",
            "",
        ]
    )
    write_bytes(ROOT / "results" / "figure3.md", text.encode())
    print(text)


if __name__ == "__main__":
    main()
