"""Time and error of all models, and of common methods for a response.

Writes `results/tradeoff.md`, `tradeoff.csv` (all designs), `tradeoff.png` (which model to use for
the fused-silica triple), `tradeoff_single.png`, ... (for other pendulums) and
`tradeoff_methods.png`. Run by `make tradeoff`.
"""

from __future__ import annotations

import csv
import io
import platform
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import scipy
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.export.solve import compute_zero_pole_gain
from suspension_cli.analyses.tradeoff.measure import (
    Measured,
    draw,
    format_time,
    measure,
    median_times,
)
from suspension_cli.design.derive import mirror
from suspension_cli.design.reader import read
from suspension_cli.drawing.curves import label_plainly, rule
from suspension_cli.drawing.labels import label_points
from suspension_cli.drawing.panels import COLUMN
from suspension_cli.drawing.style import (
    PALETTE,
    add_axes,
    house_style,
    new_figure,
    save,
    write_heading,
    write_text,
)
from suspension_cli.files.whole_files import write_bytes
from suspension_cli.linear import response, signals, statespace
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models.choice import percent
from suspension_cli.models.registry import STRING
from tests.support.paths import ROOT
from tools.stability import naive
from tools.stability.references import compare
from tools.stability.row import relative

DESIGNS = [
    *sorted((ROOT / "configs" / "husman2000").glob("*.toml")),
    *(ROOT / "configs" / f"{name}.toml" for name in ("double", "geo-silica-triple", "quadruple")),
]
CHARTS = {
    "husman2000-table1-case3": "tradeoff_single",
    "double": "tradeoff_double",
    "geo-silica-triple": "tradeoff",
    "quadruple": "tradeoff_quadruple",
}
"""Designs that the page shows, and the names of their pictures."""
COLUMNS = ["design", "question", "model", "error", "time", "best"]
"""Columns of `results/tradeoff.csv`."""
BAND = (0.1, 1000.0)
TIMED, CHECKED = 200, 25
"""Frequencies of a response whose time is measured, and at which its error is."""
METHODS: dict[str, Callable[[LinearSystem, Any, Signal, Signal], Any]] = {
    "pendsus: body by body": lambda model, at, into, out: response.solve(
        model, at, [into], [out]
    ).value[:, 0, 0],
    "dense solve": naive.dense,
    "modal sum": naive.modal_sum,
    "state space": lambda model, at, into, out: statespace.build(model, [into], [out]).at(at)[
        :, 0, 0
    ],
    "zpk": lambda model, at, into, out: compute_zero_pole_gain(
        statespace.build(model, [into], [out])
    ).at(at)[:, 0, 0],
}
"""Methods for a response, from the matrices of a model on."""


def compare_methods(design: Any) -> dict[str, tuple[float, float]]:
    """Measure time (s) and largest error of each method on the string model."""
    model = STRING.system(design)
    known = signals.bodies_with_signals(model)
    into = signals.parse_input("support.x", known)
    out = signals.parse_output(f"{mirror(design)}.x", known)
    few, many = (np.geomspace(*BAND, count) for count in (CHECKED, TIMED))
    exact = compare(model, few, [into], [out]).exact[:, 0, 0]
    errors = [relative(solve(model, few, into, out), exact).max() for solve in METHODS.values()]
    # a copy has none of the cached properties of the model
    works = [
        lambda solve=solve: solve(replace(model), many, into, out) for solve in METHODS.values()
    ]
    return dict(zip(METHODS, zip(median_times(works), errors, strict=True), strict=True))


def draw_methods(
    found: dict[str, dict[str, tuple[float, float]]], titles: dict[str, str]
) -> Figure:
    """Draw error against time of the methods, a chart per design."""
    head, pitch, high = 0.6, 2.1, 1.35
    with house_style():
        figure = new_figure(COLUMN, head + pitch * len(found))
        note = f"Response of the mirror, {TIMED} frequencies; errors against 50 digits."
        write_heading(figure, "Methods for a response: error against time", note)
        for n, (name, points) in enumerate(found.items()):
            write_text(figure, 0.1, head + n * pitch, titles[name], 8.5, bold=True)
            axes = add_axes(figure, 0.86, head + n * pitch + 0.22, COLUMN - 1.0, high)
            _draw_chart(axes, points)
    return figure


def _draw_chart(axes: Axes, points: dict[str, tuple[float, float]]) -> None:
    time, error = np.array(list(points.values())).T * [[1e3], [1.0]]
    shown = np.clip(error, 1e-16, 1.0)
    axes.set(xscale="log", yscale="log", ylim=(1e-17, 100), xlim=(time.min() / 2, time.max() * 6))
    axes.set(xlabel="processor time (ms)", ylabel="relative error")
    axes.set_yticks([1e-16, 1e-12, 1e-8, 1e-4, 1.0])
    rule(axes)
    label_plainly(axes.xaxis)
    axes.minorticks_off()
    colours = [PALETTE[0] if name.startswith("pendsus") else PALETTE[1] for name in points]
    for x, y, colour in zip(time, shown, colours, strict=True):
        axes.plot(x, y, "o", color=colour, ms=5)
    label_points(axes, list(zip(time, shown, strict=True)), list(points), colours, 7.8)


def table_of_all(found: dict[str, Measured]) -> str:
    """CSV of errors and times of all designs, see `COLUMNS`."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    for name, one in found.items():
        best = [answer.best for answer in one.answers]
        for entry in one.entries:
            if not entry.left_out:
                error = percent(entry.error) if entry.error else "reference"
                chosen = "best" if entry in best else ""
                writer.writerow(
                    [name, entry.question, entry.model, error, format_time(entry.time), chosen]
                )
    return stream.getvalue()


def document(methods: Any) -> str:
    """Format the page."""
    versions = (
        f"Python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}"
    )
    lines = [
        "# Speed against accuracy",
        "",
        f"`make tradeoff` in one run, on one thread ({platform.machine()}, {versions}): processor"
        " times, medians of samples that all models or methods take in turns. [What to use"
        " when](../docs/choosing.md#by-hand-speed-against-accuracy).",
        "",
        "## Models",
        "",
        "Largest error against the `violin` model, and processor time of one result, design or"
        " build. [tradeoff.csv](tradeoff.csv) has these, and all of the paper's designs, as"
        " numbers; `pendsus tradeoff DESIGN` measures any.",
        "",
    ]
    for name, file in CHARTS.items():
        lines += [f"![Which model to use for {name}]({file}.png)", ""]
    lines += [
        "## Methods for a response",
        "",
        "![Error of methods for a response against time](tradeoff_methods.png)",
        "",
        f"Largest error from {BAND[0]:g} to {BAND[1]:g} Hz, against 50 digits on the same matrices,"
        f" and time of a response at {TIMED} frequencies, from the matrices on. Body by body is the"
        " slowest. What it buys: its error stays below 1e-12 for any design, where a modal sum is"
        " wrong by 1e-4 (triple on silica) or useless (quadruple); unlike state space and zpk it"
        " takes losses and wires with mass; and it keeps exact zeros and tiny couplings, not shown"
        " here.",
        "",
        f"| {' | '.join(['design', *METHODS])} |",
        "|---|" + "---|" * len(METHODS),
    ]
    for name, points in methods.items():
        cells = [f"{error:.0e} · {format_time(time)}" for time, error in points.values()]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure all designs."""
    found, methods, titles = {}, {}, {}
    folder = ROOT / "results"
    for file in DESIGNS:
        source = read(file)
        name = source.design.design.name
        print(name, file=sys.stderr)
        found[name] = measure(source)
        if name in CHARTS:
            methods[name], titles[name] = compare_methods(source.design), source.title
            save(draw(found[name], source.title), folder / f"{CHARTS[name]}.png")
    save(draw_methods(methods, titles), folder / "tradeoff_methods.png")
    write_bytes(folder / "tradeoff.md", document(methods).encode())
    write_bytes(folder / "tradeoff.csv", table_of_all(found).encode())


if __name__ == "__main__":
    main()
