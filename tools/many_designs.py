"""Cost and error of many designs at once: maps, random builds, all shipped designs, growth.

Writes `results/tradeoff_many.png`, `tradeoff_growth.png`, `tradeoff_many.md` and
`tradeoff_designs.csv`. Run
by `make tradeoff`.
"""

from __future__ import annotations

import csv
import io
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import suspension_cli as sus
from bench.sweeps import BUILDS, RANDOM, SINGLE, TRIPLE, coupling_question, sweep
from suspension_cli.analyses.tolerance.solve import RandomBuilds
from suspension_cli.analyses.tradeoff.measure import (
    COLOUR,
    Question,
    ask,
    format_time,
    median_times,
)
from suspension_cli.analyses.xcouple.imperfect_builds import ImperfectBuilds
from suspension_cli.conventions import BUILDS_AT_ONCE
from suspension_cli.design.derive import mirror
from suspension_cli.design.reader import Source, parse, read
from suspension_cli.drawing.curves import label_plainly, rule
from suspension_cli.drawing.labels import label_points
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALE,
    PALETTE,
    RAISED,
    add_axes,
    house_style,
    new_figure,
    save,
    write_heading,
    write_text,
)
from suspension_cli.errors import InputError
from suspension_cli.files.whole_files import write_bytes
from suspension_cli.linear import eigenmodes, response, signals
from suspension_cli.models import registry
from suspension_cli.models.choice import percent
from suspension_cli.studies.chebyshev import Surface
from suspension_cli.studies.job import Axis
from tests.support.paths import ROOT
from tools.chebyshev_grid import surface_of

MILLION = 1_000_000
INTERVALS = (2, 4, 8, 16, 32)
"""Intervals between Chebyshev points along each axis of a map."""
COMPARED = 64
"""Random points of a map at which it is compared with full solutions."""
K = (0.6, 1.4)
OFFSET = (-2e-3, 2e-3)
"""Ranges of a map: factor on the stiffness of a wire, and offset of its end, m."""
ROUNDING = 1e-13
"""Errors of full solutions."""
CHAINS = (5, 10, 20, 50, 100)
"""Numbers of stages of a chain."""
FREQUENCIES = (100, 1_000, 10_000, 100_000)
POINTS = (1_000, 10_000, 100_000, MILLION)
RANDOM_BUILDS = (512, 2_048, 8_192, 32_768)
ALONE = 20
"""Designs of the loop that solves one at a time."""


@dataclass(frozen=True)
class MapCost:
    """What a map of a million points costs.

    Attributes
    ----------
    points
        Numbers of points that are solved.
    time
        Processor times of the whole map, s.
    error
        Largest differences from full solutions at random points, relative.
    full
        Processor time of a million full solutions, s, from that of some thousand.
    alone
        The same with one design at a time, from that of some twenty.
    """

    name: str
    points: list[int]
    time: list[float]
    error: list[float]
    full: float
    alone: float


def elapsed(work: Callable[[], Any]) -> float:
    """Measure the processor time of a function once, s."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def map_of(source: Any, points: int) -> ImperfectBuilds:
    """Builds over a square grid of k and offset of a wire."""
    side = round(points**0.5)
    axes = (
        Axis("k", tuple(np.linspace(*K, side))),
        Axis("offset", tuple(np.linspace(*OFFSET, side))),
    )
    return replace(sweep(source), axes=axes)


def evaluate(job: ImperfectBuilds, surface: Surface) -> None:
    """Evaluate a map at all its points, by rows."""
    first, second = (np.array(axis.values) for axis in job.axes)
    for start in range(0, len(first), 50):
        grid = surface.on_grid([first[start : start + 50], second])
        job.columns_of(grid.reshape(-1, grid.shape[-1]))


def measure_map(file: Any) -> MapCost:
    """Measure time and error of a map of a million points from few of them."""
    job = map_of(file, MILLION)
    rng = np.random.default_rng(3)
    k, offset = rng.uniform(*K, COMPARED), rng.uniform(*OFFSET, COMPARED)
    exact = job.compute_at({"k": k, "offset": offset})["ratio"]
    cost = MapCost(read(file).design.design.name, [], [], [], 0.0, 0.0)
    for intervals in INTERVALS:
        surface = surface_of(job.axes, job.sample, intervals)
        points = np.stack([k, offset], axis=1)
        mine = job.columns_of(surface.at(points))["ratio"]
        size = np.maximum(np.abs(exact), 1e-4 * np.abs(exact).max())
        cost.points.append(surface.points)
        cost.error.append(float((np.abs(mine - exact) / size).max()))
        cost.time.append(
            elapsed(lambda n=intervals: evaluate(job, surface_of(job.axes, job.sample, n)))
        )
    chunk = map_of(file, BUILDS)
    full = elapsed(lambda: chunk.compute(0, chunk.count)) / chunk.count
    alone = elapsed(lambda: [chunk.compute(n, n + 1) for n in range(ALONE)]) / ALONE
    return replace(cost, full=full * MILLION, alone=alone * MILLION)


@dataclass(frozen=True)
class Point:
    """Time (s) and relative error of the modes of one design in one model."""

    model: str
    time: float
    error: float
    automatic: bool


def measure_design(source: Source) -> list[Point]:
    """Measure the modes of a design in every model that is valid for it."""
    question = ask(source)[0]
    found: dict[str, Any] = {}
    for model in registry.MODELS:
        if model.unsuitable(source.design):
            continue
        try:
            found[model.name] = question.solve(model)
        except InputError:  # no stable equilibrium in this model
            continue
    works = [lambda name=name: question.solve(registry.by_name(name)) for name in found]
    assert question.choose is not None
    chosen = question.choose().level
    # with too many wire modes, `modes` leaves out wire mass and states what that changes
    taken_by_auto = chosen if chosen in found else list(found)[-1]
    exact = found[list(found)[-1]]
    return [
        Point(name, taken, _error(question, modes, exact), name == taken_by_auto)
        for (name, modes), taken in zip(found.items(), median_times(works), strict=True)
    ]


def _error(question: Question, modes: Any, exact: Any) -> float:
    return 0.0 if modes is exact else question.compare(modes, exact)[0]


def measure_start() -> float:
    """Measure the processor time of the program's start, s."""
    words = "import time; import suspension_cli.cli.main, numpy, scipy.linalg, h5py"
    line = f"{words}; print(time.process_time())"
    times = []
    for _ in range(3):
        done = subprocess.run(
            [sys.executable, "-c", line], check=True, capture_output=True, text=True
        )
        times.append(float(done.stdout))
    return min(times)


@dataclass(frozen=True)
class BuildsCost:
    """What the mean magnitude of a coupling of random builds costs.

    Attributes
    ----------
    builds
        Numbers of builds.
    time, error
        Processor times, s, and standard errors relative to the mean, with control variates.
    plain_time, plain_error
        Without.
    """

    builds: Sequence[int]
    time: list[float]
    error: list[float]
    plain_time: list[float]
    plain_error: list[float]


def measure_builds() -> BuildsCost:
    """Measure standard errors and times of random builds."""
    source = read(RANDOM)
    names = tuple(stage.name for stage in source.design.stage)
    cost = BuildsCost(RANDOM_BUILDS, [], [], [], [])
    for count in cost.builds:
        job = RandomBuilds(source.text, count, 7, coupling_question(names, 0), level="string")
        plain = elapsed(lambda job=job: solve_all(job))
        begin = time.process_time()
        found = sus.tolerance(str(RANDOM), builds=count, seed=7, fidelity="string").coupling
        cost.time.append(time.process_time() - begin)
        cost.error.append(found.error / found.mean)
        cost.plain_time.append(plain)
        cost.plain_error.append(found.deviation / count**0.5 / found.mean)
    return cost


def solve_all(job: Any) -> None:
    """Compute all builds or points of a job, in chunks."""
    for start in range(0, job.count, BUILDS_AT_ONCE):
        job.compute(start, min(start + BUILDS_AT_ONCE, job.count))


@dataclass(frozen=True)
class Growth:
    """Processor times, s, of work of several sizes."""

    name: str
    unit: str
    size: Sequence[int]
    time: list[float]

    @property
    def exponent(self) -> float:
        """Power of the size with which the time grows, over the last step."""
        return float(np.log(self.time[-1] / self.time[-2]) / np.log(self.size[-1] / self.size[-2]))


def chain(stages: int) -> str:
    """Write the design file of a chain of equal bodies, on two wires each."""
    text = ['[design]\nname = "chain"\n']
    for n in range(stages):
        radius = 2e-4 * (stages - n) ** 0.5  # equal stress
        text.append(
            f'[[stage]]\nname = "s{n}"\n'
            'body = { shape = "box", size = [0.2, 0.2, 0.1], mass = 10.0 }\n'
            "wires = { count = 4, l = 0.4, s = 0.04, t1 = 0.06, t2 = 0.06, d = 0.002,"
            f' material = "c70steel", radius = {radius!r} }}\n'
        )
    return "\n".join(text)


def measure_growth() -> list[Growth]:
    """Measure how the cost of work grows with its size."""
    source = read(RANDOM)
    names = tuple(stage.name for stage in source.design.stage)
    question = coupling_question(names, 0)
    lines = list[Growth]()

    def maps(count: int) -> Callable[[], Any]:
        job = map_of(TRIPLE, count)
        return lambda: evaluate(job, surface_of(job, 16))

    def every_point(count: int) -> Callable[[], Any]:
        job = map_of(TRIPLE, count)
        return lambda: solve_all(job)

    def random(count: int) -> Callable[[], Any]:
        job = RandomBuilds(source.text, count, 7, question, level="string")
        return lambda: solve_all(job)

    def modes(stages: int) -> Callable[[], Any]:
        design = parse(chain(stages))
        return lambda: eigenmodes.solve(registry.STRING.system(design))

    def spectrum(count: int) -> Callable[[], Any]:
        design = read(ROOT / "configs" / "quadruple.toml").design
        model = registry.VIOLIN.system(design)
        known = signals.bodies_with_signals(model)
        ends = (
            [signals.parse_input("support.x", known)],
            [signals.parse_output(f"{mirror(design)}.x", known)],
        )
        return lambda: response.solve(model, np.geomspace(0.1, 1000.0, count), *ends)

    for name, unit, sizes, make in (
        ("map, interpolated", "points", POINTS, maps),
        ("map, every point", "points", POINTS[:2], every_point),
        ("random builds", "builds", RANDOM_BUILDS, random),
        ("modes of a chain", "stages", CHAINS, modes),
        ("response", "frequencies", FREQUENCIES, spectrum),
    ):
        print(name, file=sys.stderr)
        lines.append(Growth(name, unit, sizes, [elapsed(make(size)) for size in sizes]))
    return lines


LEFT, RIGHT = 0.85, 4.45
"""Left edges of the panels of both columns, in."""
NARROW, WIDE, HIGH = 2.4, 6.0, 2.3
"""Widths and height of panels, in."""


def draw_many(
    maps: Sequence[MapCost], random: BuildsCost, designs: dict[str, list[Point]], start: float
) -> Figure:
    """Draw error against time: a map, and the modes of all shipped designs."""
    with house_style():
        figure = new_figure(7.0, 6.9)
        note = "Left is fast, down is accurate; processor times on one core."
        write_heading(figure, "Error against time", note)
        title = "A map of 1,000,000 points"
        said = "Some hundred solutions determine it; numbers: how many."
        _draw_maps(_panel(figure, LEFT, 0.6, NARROW, title, said), maps)
        title = "Random builds: mean of |coupling|"
        said = "Numbers: builds that are solved."
        _draw_builds(_panel(figure, RIGHT, 0.6, NARROW, title, said), random)
        title = "Mode frequencies of all shipped designs"
        said = "Circled: the model that auto takes. Dashed: the start of the program."
        axes = _panel(figure, LEFT, 3.8, WIDE, title, said)
        _draw_designs(axes, designs, start)
    return figure


def _panel(figure: Figure, left: float, top: float, width: float, title: str, said: str) -> Axes:
    write_text(figure, left - 0.7, top, title, 8.5, bold=True)
    write_text(figure, left - 0.7, top + 0.18, said, 7.5, NOTE)
    axes = add_axes(figure, left, top + 0.42, width, HIGH)
    axes.set(xscale="log", yscale="log", ylabel="relative error")
    rule(axes)
    return axes


def _draw_maps(axes: Axes, maps: Sequence[MapCost]) -> None:
    longest = max(one.alone for one in maps)
    axes.set(xlim=(0.03, longest * 4), ylim=(1e-16, 10), xlabel="processor time (s)")
    axes.set_yticks([1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 1.0])
    points, texts, colours = [], [], []
    for one, colour in zip(maps, PALETTE, strict=False):
        axes.plot(one.time, one.error, "o-", color=colour, ms=4, lw=1, label=one.name)
        axes.plot([one.full, one.alone], [ROUNDING] * 2, "s", color=colour, ms=4)
        points += list(zip(one.time, one.error, strict=True))
        texts += [f"{count:,}" for count in one.points]
        colours += [colour] * len(one.points)
    every = np.sqrt(maps[0].full * maps[1].full)
    alone = np.sqrt(maps[0].alone * maps[1].alone)
    for across, text in ((every, "every point"), (alone, "one design\nat a time")):
        axes.annotate(text, (across, 1e-12), fontsize=7.5, color=NOTE, ha="center")
    axes.legend(loc="upper right", fontsize=7.5, frameon=False, borderaxespad=0.1)
    label_points(axes, points, texts, colours)


def _draw_builds(axes: Axes, cost: BuildsCost) -> None:
    axes.set(xlabel="processor time (s)", ylabel="standard error, relative")
    points, texts, colours = [], [], []
    plain = ("solved builds alone", cost.plain_time, cost.plain_error)
    controlled = ("with control variates", cost.time, cost.error)
    for (name, across, up), colour in zip((plain, controlled), PALETTE, strict=False):
        axes.plot(across, up, "o-", color=colour, ms=4, lw=1, label=name)
        points += list(zip(across, up, strict=True))
        texts += [f"{count:,}" for count in cost.builds]
        colours += [colour] * len(cost.builds)
    low, high = axes.get_xlim()
    axes.set_xlim(low / 2, high * 4)
    axes.set_ylim(min(cost.error) / 3, max(cost.plain_error) * 10)
    axes.legend(loc="upper right", fontsize=7.5, frameon=False, borderaxespad=0.1)
    label_points(axes, points, texts, colours)


def _draw_designs(axes: Axes, designs: dict[str, list[Point]], start: float) -> None:
    every = [point for points in designs.values() for point in points]
    known = [point.error for point in every if point.error > 0]
    floor = 10 ** np.floor(np.log10(min(known)) - 1)
    times = [point.time for point in every]
    axes.set(xlim=(min(times) / 1.6, max(times) * 3), ylim=(floor / 3, 20))
    axes.set_xlabel("processor time (s)")
    decades = 10.0 ** np.arange(np.log10(floor) + 2, 1)
    axes.set_yticks([floor, *decades], ["reference", *map(percent, decades)])
    axes.minorticks_off()
    axes.axvline(start, color=NOTE, lw=0.8, ls=(0, (4, 2)))
    for points in designs.values():
        across = [point.time for point in points]
        up = [max(point.error, floor) for point in points]
        axes.plot(across, up, color=PALE, lw=0.5, zorder=1)
    for name, colour in COLOUR.items():
        own = [point for point in every if point.model == name]
        across = [point.time for point in own]
        up = [max(point.error, floor) for point in own]
        axes.plot(across, up, "o", color=colour, ms=3.5, label=name)
        taken = [n for n, point in enumerate(own) if point.automatic]
        circled = [[across[n] for n in taken], [up[n] for n in taken]]
        axes.plot(*circled, "o", mfc="none", mec=INK, mew=0.8, ms=7)
    axes.legend(loc="upper right", ncols=5, fontsize=7.5, frameon=False, borderaxespad=0)


def raised(exponent: float) -> str:
    """Write an exponent: 0.8 as small digits above the line."""
    return f"{exponent:.1f}".translate(RAISED).replace(".", "·")


def _along(line: Growth) -> list[tuple[float, float]]:
    """Points along a line, but not at its end."""
    size, taken = np.log(line.size), np.log(line.time)
    across = np.linspace(size[0], size[-1], 30)[:-3]
    return list(zip(np.exp(across), np.exp(np.interp(across, size, taken)), strict=True))


def draw_growth(lines: Sequence[Growth]) -> Figure:
    """Draw how times grow with the size of work, with the power of the last step."""
    with house_style():
        figure = new_figure(5.2, 3.7)
        note = "Processor time on one core; the power with which each grows at its end."
        write_heading(figure, "Growth of cost", note)
        axes = add_axes(figure, 0.75, 0.6, 4.25, 2.6)
        axes.set(xlim=(3, 1e9), ylim=(3e-3, 30))
        rule(axes)
        label_plainly(axes.yaxis)
        axes.set(xscale="log", xlabel="points, builds, stages or frequencies")
        axes.set_ylabel("processor time (s)")
        for line, colour in zip(lines, PALETTE, strict=False):
            axes.plot(line.size, line.time, "o-", color=colour, ms=3.5, lw=1.2)
        texts = [f"{line.name}: {line.unit}{raised(line.exponent)}" for line in lines]
        ends = [(line.size[-1], line.time[-1]) for line in lines]
        beside = [point for line in lines for point in _along(line)]  # labels keep off the lines
        blank = [""] * len(beside)
        label_points(
            axes, ends + beside, texts + blank, [*PALETTE[: len(lines)], *[INK] * len(blank)]
        )
    return figure


def document(
    maps: Sequence[MapCost],
    random: BuildsCost,
    growth: Sequence[Growth],
) -> str:
    """Format the page."""
    lines = [
        "# Many designs",
        "",
        "Made by `make tradeoff`, on one core; times are processor times.",
        "",
        "![Error against time of maps, random builds and all shipped designs](tradeoff_many.png)",
        "",
        "## A map of a million points",
        "",
        "Longitudinal over vertical motion at 50 Hz against stiffness and place of a wire; largest"
        f" difference from full solutions at {COMPARED} random points. In the second design a mode"
        " crosses the frequency within the map.",
        "",
        "| design | points solved: time, error | every point | one design at a time |",
        "|---|---|---|---|",
    ]
    for one in maps:
        solved = [
            f"{count:,}: {format_time(taken)}, {error:.0e}"
            for count, taken, error in zip(one.points, one.time, one.error, strict=True)
        ]
        full = f"{format_time(one.full)} | {format_time(one.alone)}"
        lines.append(f"| {one.name} | {'<br>'.join(solved)} | {full} |")
    lines += [
        "",
        "The last two columns are the times of some thousand points, and of some twenty designs, in"
        " proportion.",
        "",
        "## Random builds",
        "",
        "Standard error of the mean magnitude of the coupling of `triple-tolerance`, relative:",
        "",
        "| builds | solved builds alone | with control variates |",
        "|---|---|---|",
    ]
    for n, count in enumerate(random.builds):
        plain = f"{percent(random.plain_error[n])}, {format_time(random.plain_time[n])}"
        controlled = f"{percent(random.error[n])}, {format_time(random.time[n])}"
        lines.append(f"| {count:,} | {plain} | {controlled} |")
    lines += [
        "",
        "The time with control variates is that of a whole call, with the statistics of"
        " all modes and poses; the other that of the builds alone.",
        "",
        "## Growth of cost",
        "",
        "![Growth of cost with points, builds, stages and frequencies](tradeoff_growth.png)",
        "",
        "Power at the end: "
        + "; ".join(f"{line.name} ({line.unit}) {line.exponent:.1f}" for line in growth)
        + ".",
    ]
    lines += [
        "",
        "## Mode frequencies of all shipped designs",
        "",
        "Each model's largest error against the most complete one that lists its modes in seconds,"
        " with its time: [tradeoff_designs.csv](tradeoff_designs.csv). `auto` is within 0.1 % of"
        " that one in every design.",
    ]
    return "\n".join(lines) + "\n"


def table_of_designs(designs: dict[str, list[Point]]) -> str:
    """CSV of errors and times of the modes of all designs, and which model `auto` takes."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["design", "model", "error", "time", "auto"])
    for name, points in designs.items():
        for point in points:
            error = percent(point.error) if point.error else "reference"
            chosen = "auto" if point.automatic else ""
            writer.writerow([name, point.model, error, format_time(point.time), chosen])
    return stream.getvalue()


def main() -> None:
    """Measure and draw all."""
    folder = ROOT / "results"
    maps = [measure_map(file) for file in (SINGLE, TRIPLE)]
    random = measure_builds()
    designs: dict[str, list[Point]] = {}
    for file in sorted((ROOT / "configs").rglob("*.toml")):
        source = read(file)
        print(source.design.design.name, file=sys.stderr)
        designs[source.design.design.name] = measure_design(source)
    growth = measure_growth()
    save(draw_many(maps, random, designs, measure_start()), folder / "tradeoff_many.png")
    save(draw_growth(growth), folder / "tradeoff_growth.png")
    write_bytes(folder / "tradeoff_many.md", document(maps, random, growth).encode())
    write_bytes(folder / "tradeoff_designs.csv", table_of_designs(designs).encode())


if __name__ == "__main__":
    main()
