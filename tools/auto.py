"""Error and cost of `auto` on random suspensions, against the violin model.

For each, modes or couplings are requested to a random tolerance; half of the suspensions are of
common kinds, half of unusual ones. Writes `results/auto.md` and `.png`. Run by `make auto`; a number
of suspensions may be given.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses import model_choice
from suspension_cli.analyses.tradeoff.picture import COLOUR
from suspension_cli.analyses.tradeoff.questions import Coupling, ModeFrequencies, Question
from suspension_cli.analyses.xcouple.solve import coupling_change
from suspension_cli.design.reader import Source
from suspension_cli.drawing.scales import label_plainly, rule
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALE,
    PALETTE,
    add_axes,
    format_raised,
    house_style,
    new_figure,
    save,
    with_opacity,
    write_text,
)
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.errors import InputError
from suspension_cli.files.atomic import write_bytes
from suspension_cli.models import registry
from suspension_cli.models.choice import percent
from suspension_cli.models.registry import Choice
from suspension_cli.studies.job import Axis
from tests.support.paths import ROOT
from tools.random_designs import random_source

SUSPENSIONS = 300
PROCESSES = 2
TOLERANCES = (1e-4, 1e-1)
QUANTITIES = ("modes", "couplings")
KINDS = {"common": True, "unusual": False}
REPETITIONS = 3
SLOW = 0.2
"""Seconds from which work is timed once."""
FLOOR = 1e-9
"""Errors below this are drawn here."""
LEVELS = ("string", "beam", "violin")
HEAD = """# What `auto` leaves out, and what that costs

{count} random suspensions (`tools/random_designs.py`): half of them common, one to four stages, with and without blades, wires of steel, tungsten, silica
and cord from rods to hairs, a quarter built imperfectly; and half unusual: light bodies on wires of up to 0.7 of their mass, one and two wires, wires that
cross, offset centres of mass, a recoil mass beside a mirror, masses that differ 300-fold, ribbons, tapers and thick ends. Each is for one
quantity, to a tolerance between 0.0001 and 0.1. The error is that against `violin`: of mode frequencies, paired by their shapes; of couplings in
205 imperfect builds, relative to the largest. Cost is the processor time of choosing and solving over that of always taking `violin`. For responses and
noise of one design `auto` takes the most complete model, and nothing is neglected.

![Errors of auto against the requested tolerances, the models that it took, and what they cost](auto.png)

For each random suspension one result was requested, with a tolerance for its error, and `auto` chose
the model. On the left every point is a suspension: below the line its error is within the tolerance.
On the right is what `auto` took, from the simplest model to the most complete (`violin`), and the
time of choosing and solving over that of always taking `violin`.

| quantity | suspensions | beyond the tolerance | largest error (tolerances) | cost: median, 95th percentile | models taken |
|---|---|---|---|---|---|
"""


@dataclass(frozen=True)
class Trial:
    """Result for one random suspension.

    `error` is relative, against the violin model; `cost` the processor time of `auto`, choice
    included, over that of the violin model, `best` that of the cheapest model within the tolerance.
    """

    kind: str
    seed: int
    quantity: str
    tolerance: float
    level: str
    error: float
    cost: float
    best: float


def run_one(job: tuple[str, int]) -> Trial:
    """Run `auto` and all models on a random suspension."""
    kind, seed = job
    rng = np.random.default_rng([78, seed])
    tolerance = float(np.exp(rng.uniform(*np.log(TOLERANCES))))
    quantity = QUANTITIES[seed % len(QUANTITIES)]
    while True:  # until there is an equilibrium in the violin model
        source = random_source(int(rng.integers(2**31)), common=KINDS[kind])
        question = ask(source, quantity, rng)
        costs: dict[str, float] = {}
        found: dict[str, Any] = {}
        for level in LEVELS:
            try:
                found[level], costs[level] = timed(question.solve, registry.by_name(level))
            except InputError:
                continue
        if "violin" in found:
            break
    (choice, result), cost = timed(solve_auto, question, tolerance)
    accurate = [
        costs[level]
        for level, values in found.items()
        if question.compare(values, found["violin"])[0] <= tolerance
    ]
    error, _ = question.compare(result, found["violin"])
    reference = costs["violin"]
    return Trial(
        kind, seed, quantity, tolerance, choice.level, error, cost / reference,
        min(accurate) / reference,
    )  # fmt: skip


def ask(source: Source, quantity: str, rng: np.random.Generator) -> Question:
    """Ask for the modes, or for couplings at a random frequency that leave all wires taut."""
    if quantity == "modes":
        return ModeFrequencies(source)
    question, wires = Coupling(source), expand(source.design).wires
    most = min(1e-3, 0.1 * float((wires.tension / wires.stiffness).min()))
    axes = Axis("k", tuple(np.linspace(0.9, 1.1, 41))), Axis("offset", tuple(np.linspace(-most, most, 5)))  # fmt: skip
    at = (float(np.exp(rng.uniform(*np.log([1.0, 100.0])))),)
    question.job = replace(question.job, axes=axes, question=replace(question.job.question, frequency=at))  # fmt: skip
    return question


def solve_auto(question: Question, tolerance: float) -> tuple[Choice, Any]:
    """Let `auto` choose the model, and solve."""
    if isinstance(question, Coupling):
        change = coupling_change(question.job)
        models = registry.SCENE_MODELS
        choice = model_choice.for_builds(question.source, "auto", models, change, tolerance)
    else:
        choice, _ = model_choice.for_modes(question.source, "auto", tolerance)
    return choice, question.solve(choice.model)


def timed(work: Any, *arguments: Any) -> tuple[Any, float]:
    """Return the result of some work and its shortest processor time, s."""
    result, best = work(*arguments), np.inf
    for _ in range(REPETITIONS):
        start = time.process_time()
        work(*arguments)
        best = min(best, time.process_time() - start)
        if best > SLOW:
            break
    return result, best


def row(name: str, part: list[Trial]) -> str:
    """Format one line of the table."""
    miss = np.array([one.error / one.tolerance for one in part])
    cost = np.quantile([one.cost for one in part], (0.5, 0.95))
    counted = Counter(one.level for one in part)
    models = ", ".join(f"`{level}` {counted[level]}" for level in LEVELS if counted[level])
    return (
        f"| {name} | {len(part)} | {(miss > 1).sum()} | {miss.max():.2g} |"
        f" {cost[0]:.2g}, {cost[1]:.2g} | {models} |"
    )


def report(found: list[Trial]) -> str:
    """Format the whole page."""
    rows = [
        row(f"{quantity}, {kind}", part)
        for quantity in QUANTITIES
        for kind in KINDS
        if (part := [one for one in found if (one.quantity, one.kind) == (quantity, kind)])
    ]
    bad = [one for one in found if one.error > one.tolerance]
    lines = [
        f"- {t.kind} {t.seed} ({t.quantity}, on `{t.level}`): error {t.error:.2g}, tolerance"
        f" {t.tolerance:.2g}"
        for t in bad
    ]
    missed = "Beyond the tolerance:" + ("\n\n" + "\n".join(lines) if lines else " no suspension.")
    table = "\n".join([*rows, row("**all**", found)])
    return HEAD.format(count=len(found)) + f"{table}\n\n{missed}\n"


def draw(found: list[Trial]) -> Figure:
    """Draw errors against tolerances, the models taken, and time per quantity."""
    kept = sum(one.error <= one.tolerance for one in found)
    with house_style():
        figure = new_figure(7.2, 4.35)
        title = (
            f"auto kept the requested tolerance in {kept:,} of {len(found):,} random suspensions"
        )
        write_text(figure, 0.1, 0.08, title, 10, bold=True)
        for left, top, text in (
            (0.1, 0.32, "Requested: modes or a coupling, and a tolerance for its error."),
            (0.1, 0.47, "The error is that against violin, the most complete model."),
            (3.9, 2.53, "Dot and bar: median, and 5 to 95 % of suspensions."),
            (3.9, 2.66, "Black line: median of the fastest model within the tolerance."),
        ):
            write_text(figure, left, top, text, 7, NOTE)
        for left, top, text in (
            (0.1, 0.82, "Was the error within the tolerance?"),
            (3.9, 0.82, "What did auto take? (% of suspensions)"),
            (3.9, 2.38, "What did it cost?"),
        ):
            write_text(figure, left, top, text, 8.5, bold=True)
        _draw_errors(add_axes(figure, 0.82, 1.1, 2.75, 2.75), found)
        models, times = (add_axes(figure, 4.72, *place) for place in ((1.1, 2.2, 0.92), (2.78, 2.2, 1.07)))  # fmt: skip
        for n, quantity in enumerate(QUANTITIES):
            some = [one for one in found if one.quantity == quantity]
            _draw_models(models, n, [one.level for one in some])
            _draw_times(times, n, some)
        for n, level in enumerate(LEVELS):
            models.text(36 * n, 1.85, f"■ {level}", fontsize=7.5, color=COLOUR[level])
        models.set(xlim=(0, 100), xticks=[])
        times.axvline(1.0, color=NOTE, linewidth=0.8, linestyle=(0, (4, 3)), zorder=0)
        times.set(xscale="log", xlabel="time over that of violin")
        label_plainly(times.xaxis)
        for axes in (models, times):
            axes.set(ylim=(1.55, -0.55))
            axes.set_yticks(range(len(QUANTITIES)), QUANTITIES)
            axes.tick_params(axis="y", length=0, labelsize=8)
            axes.spines["left"].set_visible(False)
        models.spines["bottom"].set_visible(False)
    return figure


def _draw_errors(axes: Axes, found: list[Trial]) -> None:
    """Draw a point per suspension, and the errors that are allowed."""
    low, high = TOLERANCES[0] / 1.3, TOLERANCES[1] * 1.3
    worst = max(high, *(one.error for one in found))
    axes.set(xscale="log", yscale="log", xlim=(low, high), ylim=(FLOOR / 4, 3 * worst))
    rule(axes)
    allowed = with_opacity(PALE, 0.28)
    axes.fill_between([low, high], [low, high], FLOOR / 4, color=allowed, linewidth=0, zorder=0)
    axes.plot([low, high], [low, high], color=INK, linewidth=0.9)
    for one in found:
        look = {"color": COLOUR[one.level], "markersize": 3.2, "markeredgewidth": 0, "alpha": 0.8}
        axes.plot(one.tolerance, max(one.error, FLOOR), "o", **look)
    axes.set(xlabel="requested tolerance", ylabel="error of the result")
    ticks = (1e-7, 1e-5, 1e-3, 1e-1)
    axes.set_yticks(
        [FLOOR, *ticks], ["none", *(f"{format_raised(100 * tick)} %" for tick in ticks)]
    )
    ticks = (1e-4, 1e-3, 1e-2, 1e-1)
    axes.set_xticks(ticks, [percent(tick) for tick in ticks])
    axes.minorticks_off()
    for text, up in (("too large", 0.99), ("allowed", 0.16)):
        axes.text(0.03, up, text, transform=axes.transAxes, va="top", fontsize=8, color=NOTE)


def _draw_models(axes: Axes, place: int, levels: list[str]) -> None:
    """Draw the fractions of the models that were taken."""
    start = 0.0
    for level in LEVELS:
        wide = 100 * levels.count(level) / max(len(levels), 1)
        axes.barh(place, wide, 0.72, start, color=COLOUR[level])
        if wide >= 9:
            look = {"ha": "center", "va": "center", "fontsize": 7, "color": "white"}
            axes.text(start + wide / 2, place, f"{wide:.0f}", **look)
        start += wide


def _draw_times(axes: Axes, place: int, some: list[Trial]) -> None:
    """Draw the median and the 90 % range of the time over that of violin."""
    low, middle, high = np.quantile([one.cost for one in some], (0.05, 0.5, 0.95))
    axes.plot([low, high], [place, place], color=PALETTE[0], linewidth=4, alpha=0.35)
    axes.plot(middle, place, "o", color=PALETTE[0], markersize=6)
    best = float(np.median([one.best for one in some]))
    axes.plot(best, place, "|", color=INK, markersize=10, markeredgewidth=1.4)


def main() -> None:
    """Run all trials, write the page and draw the chart."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else SUSPENSIONS
    jobs = [(kind, seed) for seed in range(count // len(KINDS)) for kind in KINDS]
    with ProcessPoolExecutor(PROCESSES) as pool:
        found = list(pool.map(run_one, jobs))
    write_bytes(ROOT / "results" / "auto.md", report(found).encode())
    save(draw(found), ROOT / "results" / "auto.png")
    print(report(found).partition("png)\n\n")[2])


if __name__ == "__main__":
    main()
