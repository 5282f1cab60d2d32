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
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

import suspension_cli as sus
from suspension_cli.analyses import named_quantities
from suspension_cli.analyses.sweep.followed_modes import Follower, complete
from suspension_cli.analyses.sweep.parameter_sweep import ParameterSweep
from suspension_cli.design.reader import read
from suspension_cli.drawing.curves import rule
from suspension_cli.drawing.labels import label_ends, room_for
from suspension_cli.drawing.style import NOTE, PALETTE, house_style, new_figure, save, write_heading
from suspension_cli.files.whole_files import write_bytes
from suspension_cli.models import closed_form
from suspension_cli.models.closed_form import FourWires
from suspension_cli.quantities.nominal_results import find_results
from suspension_cli.studies.job import Axis
from tools.margins import set_margins
from tools.tables import PAPER, ROOT

POINTS = 301
AXES = "force model; axes as printed in the paper; dashed: its limits, equations 10 to 14"
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
    names = named_quantities.names_of(sus.parse(text))
    axis = Axis(path, tuple(value.tolist()))
    every = find_results([], names, text, level)
    [number] = [n for n, one in enumerate(every) if one.text == mode]
    job = ParameterSweep(text, (axis,), level, (every[number],))
    points = job.compute(0, job.count)
    rank, _ = Follower()(job, points)
    return complete(job, points, rank)[:, 0]


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


def draw(found: list[Curve]) -> Figure:
    """Draw both curves and their limits on the axes of the paper's figure."""
    printed = PAPER["figure3"]
    figure = new_figure(5.0, 3.9)
    write_heading(figure, "Tilt frequency against the separation of the wires in x", AXES)
    axes = figure.subplots()
    names = ["wires", "wires + cantilevers"]
    set_margins(figure, left=0.65, right=room_for(names), bottom=0.45)
    axes.set(
        xscale="log",
        yscale="log",
        xlim=printed["x_range"],
        ylim=printed["y_range"],
        xlabel="separation $2s$ (m)",
        ylabel="tilt frequency (Hz)",
    )
    rule(axes)
    for n, curve in enumerate(found):
        x, limit = 2 * curve.value, linear(curve.wires, curve.value)
        axes.plot(x, limit, color=NOTE, linestyle="--", linewidth=0.8)
        axes.plot(x, curve.frequency, color=PALETTE[n], linewidth=1.4)
    level = constant(found[0].wires)
    axes.axhline(level, color=NOTE, linestyle="--", linewidth=0.8)
    stiff, soft = found
    right = PAPER["figure3"]["x_range"][1]
    for text, place, shift, side in (
        (f"set by $d$: {level:.3g} Hz", (right, level), (-2, -4), "right"),
        ("$\\propto s$", (4.2e-4, linear(stiff.wires, 2.1e-4)), (3, 0), "left"),
        ("$\\propto s$", (4.2e-3, linear(soft.wires, 2.1e-3)), (3, 0), "left"),
    ):
        look = {"va": "top", "ha": side, "color": NOTE, "fontsize": 8}
        axes.annotate(text, place, shift, textcoords="offset points", **look)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    label_ends(
        axes,
        [
            (2 * curve.value, curve.frequency, curve.label, PALETTE[n])
            for n, curve in enumerate(found)
        ],
    )
    return figure


def main() -> None:
    """Draw the figure and write its numbers."""
    lines = [
        "# Figure 3",
        "",
        (
            "Tilt of a mass on four vertical wires 1 mm above its centre, against the separation"
            " 2s, from the sweep of `force`. As the paper says, it is constant for wires close"
            " together and proportional to their separation for wires far apart."
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
    found = solved()
    for curve in found:
        limit, level = linear(curve.wires, curve.value), constant(curve.wires)
        sampled = np.interp(
            np.log([1e-4, 1e-3, 1e-2, 1e-1]), np.log(2 * curve.value), curve.frequency
        )
        cells = " | ".join(f"{f:#.4g}" for f in (*sampled, limit[-1], level))
        lines.append(f"| {curve.label} | {curve.wires.k:#.5g} | {cells} |")
    with house_style():
        (ROOT / "results").mkdir(exist_ok=True)
        save(draw(found), ROOT / "results" / "figure3.png")
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
