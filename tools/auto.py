"""Error and cost of `auto` on 300 random suspensions, against the violin model.

For each, one quantity of interest to a random tolerance. Writes `results/auto.md` and `.png`. Run
by `make auto`.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator

import numpy as np

from suspension_cli.drawing.style import house_style, save
from suspension_cli.files.atomic import write_bytes
from suspension_cli.models.registry import LEVELS
from tools.choices import designs, quantities
from tools.choices.draw import draw
from tools.choices.trial import REPETITIONS, Trial, run_trial
from tools.tables import ROOT

SCENES = 300
TOLERANCES = (1e-4, 1e-1)
QUANTITIES = quantities.QUANTITIES
HEAD = """# What `auto` leaves out, and what that costs

{count} random suspensions (`tools/choices/designs.py`): one to four stages, with and without blades, wires from rods at 10 MPa to hairs at 3 GPa, of
two steels and fused silica, round and ribbons, half of them told by where they seem to bend, a quarter built imperfectly. Each is asked one thing, to a
tolerance between 0.0001 and 0.1. The error is that against `violin`: of mode frequencies, paired by their shapes; of responses and noise at {checked} of
{points} frequencies from 0.1 Hz to between 1 and 100 Hz, in size, or in frequency where that is nearer (beside a resonance); of couplings in the
{builds} builds of a sweep, of the largest. Cost is the time of deciding and solving over that of `violin`, in turns in one process on one thread,
medians of {turns}; beside it that of the cheapest rung that is right, as if its error were known and deciding cost nothing: less is not to be had
from these rungs.

![Error against tolerance, and cost](auto.png)

| asked | scenes | beyond the tolerance | largest error (tolerances) | cost: quartiles, **median** | errors known beforehand | `violin`, median | rungs taken |
|---|---|---|---|---|---|---|---|
"""


def trials() -> Iterator[Trial]:
    """Run all trials."""
    for seed in range(SCENES):
        rng = np.random.default_rng([78, seed])
        tolerance = float(np.exp(rng.uniform(*np.log(TOLERANCES))))
        quantity = list(QUANTITIES)[seed // 4 % len(QUANTITIES)]
        design = designs.random_design(seed)
        yield run_trial(
            seed,
            len(design.stage),
            quantity,
            tolerance,
            QUANTITIES[quantity](design, rng, tolerance),
        )
        if sys.stderr.isatty():
            print(f"\r{seed + 1}/{SCENES}", end="", file=sys.stderr, flush=True)


def row(name: str, part: list[Trial]) -> str:
    """Format one line of the table."""
    ratio = np.array([trial.error / trial.tolerance for trial in part])
    counted = Counter(trial.level for trial in part)
    models = ", ".join(f"`{level}` {counted[level]}" for level in LEVELS if counted[level])
    costs = [spread([getattr(trial, which) for trial in part]) for which in ("cost", "best")]
    top = f"{1e3 * np.median([trial.seconds for trial in part]):.2g} ms"
    return (
        f"| {name} | {len(part)} | {(ratio > 1).sum()} | {ratio.max():.2g} | {costs[0]} | {costs[1]}"
        f" | {top} | {models} |"
    )


def spread(values: list[float]) -> str:
    """Format the quartiles and the median."""
    low, middle, high = np.quantile(values, [0.25, 0.5, 0.75])
    return f"{low:.2g} to {high:.2g}, **{middle:.2g}**"


def failures(found: list[Trial]) -> str:
    """List the scenes beyond their tolerance, one per line."""
    bad = [one for one in found if one.error > one.tolerance]
    if not bad:
        return "No scene is beyond its tolerance."
    lines = [
        f"- scene {t.seed} ({t.stages} stages, {t.quantity}, on `{t.level}`): {t.error:.2g} for a"
        f" tolerance of {t.tolerance:.2g}"
        for t in bad
    ]
    return "Beyond the tolerance:\n\n" + "\n".join(lines)


def report(found: list[Trial]) -> str:
    """Format the whole page."""
    head = HEAD.format(
        count=len(found),
        checked=quantities.CHECKED,
        points=quantities.POINTS,
        builds=int(np.prod(quantities.BUILDS)),
        turns=REPETITIONS,
    )
    rows = [row(name, [trial for trial in found if trial.quantity == name]) for name in QUANTITIES]
    return head + "\n".join([*rows, row("**all**", found)]) + "\n\n" + failures(found) + "\n"


def main() -> None:
    """Run all trials, write the page and draw the chart."""
    found = list(trials())
    (ROOT / "results").mkdir(exist_ok=True)
    write_bytes(ROOT / "results" / "auto.md", report(found).encode())
    with house_style():
        save(draw(found), ROOT / "results" / "auto.png")
    print(report(found).partition("png)\n\n")[2])


if __name__ == "__main__":
    main()
