"""Error and cost of `auto` on random suspensions, against the violin model.

For each, one quantity of interest to a random tolerance; half of the suspensions are of common
kinds, half of unusual ones. Writes `results/auto.md` and `.png`. Run by `make auto`; a number of
suspensions may be given.
"""

from __future__ import annotations

import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from suspension_cli.drawing.style import house_style, save
from suspension_cli.files.atomic import write_bytes
from suspension_cli.models.registry import LEVELS
from tools.choices import designs, quantities
from tools.choices.draw import draw
from tools.choices.trial import REPETITIONS, Trial, run_trial
from tools.choices.unusual import unusual_design
from tools.tables import ROOT

SCENES = 1000
PROCESSES = 2
TOLERANCES = (1e-4, 1e-1)
QUANTITIES = quantities.QUANTITIES
GENERATORS = {"common": designs.random_design, "unusual": unusual_design}
ABOVE = 1.01
"""Error over its estimate from which the estimate counts as below it."""
LISTED = 40
"""Most lines in a list of scenes."""
HEAD = """# What `auto` leaves out, and what that costs

{count} random suspensions, half of them common (`tools/choices/designs.py`): one to four stages, with and without blades, wires from rods at 10 MPa to
hairs at 3 GPa, of two steels and fused silica, round and ribbons, half of them drawn to where they seem to bend, a quarter built imperfectly; and half
unusual (`tools/choices/unusual.py`): light bodies on wires of up to 0.7 of their mass, one and two wires, wires that cross, offset centres of mass, a recoil
mass beside a mirror, masses that differ 300-fold, ribbons, tapers and thick ends, lunar gravity, blades with and without tip mass. Each is for one
quantity, to a tolerance between 0.0001 and 0.1. The error is that against `violin`: of mode frequencies, paired by their shapes; of couplings in
the {builds} builds of a sweep, relative to the largest, in size, or beyond the tolerance in frequency where that is nearer. Cost is the processor time of choosing and solving over that of the cheapest model within the tolerance, as if
its error were known (the shortest of {turns}). An estimate counts as below the true error if it is by more than 1 %. For responses and noise of one design
`auto` takes the most complete model, and nothing is neglected.

![Errors of auto against the requested tolerances, the models that it took, and what they cost](auto.png)

For each random suspension one result was requested, with a tolerance for its error, and `auto` chose
the model. On the left every point is a suspension: below the line its error is within the tolerance.
On the right is what `auto` took, from the simplest model (`force`) to the most complete (`violin`),
and the time of choosing and solving over that of always taking `violin`.

| quantity | scenes | beyond the tolerance | largest error (tolerances) | estimates below the error | largest error (estimates) | cost: median, 95th percentile | models taken |
|---|---|---|---|---|---|---|---|
"""


def run_one(job: tuple[str, int]) -> Trial:
    """Run the trial of one random suspension of a generator."""
    generator, seed = job
    rng = np.random.default_rng([78, seed])
    tolerance = float(np.exp(rng.uniform(*np.log(TOLERANCES))))
    quantity = list(QUANTITIES)[seed // 4 % len(QUANTITIES)]
    design = GENERATORS[generator](seed)
    question = QUANTITIES[quantity](design, rng, tolerance)
    return run_trial(generator, seed, design, quantity, tolerance, question)


def run_trials(scenes: int) -> list[Trial]:
    """Run trials of all generators, half the number of `scenes` each."""
    jobs = [(name, seed) for seed in range(scenes // len(GENERATORS)) for name in GENERATORS]
    found = []
    with ProcessPoolExecutor(PROCESSES) as pool:
        for trial in pool.map(run_one, jobs):
            found.append(trial)
            if sys.stderr.isatty():
                print(f"\r{len(found)}/{len(jobs)}", end="", file=sys.stderr, flush=True)
    return found


def row(name: str, part: list[Trial]) -> str:
    """Format one line of the table."""
    miss, excess, cost = (
        np.array([getattr(one, which) for one in part]) for which in ("miss", "excess", "overhead")
    )
    counted = Counter(one.level for one in part)
    models = ", ".join(f"`{level}` {counted[level]}" for level in LEVELS if counted[level])
    return (
        f"| {name} | {len(part)} | {_fraction(miss > 1)} | {miss.max():.2g} |"
        f" {_fraction(excess > ABOVE)} | {excess.max():.2g} | {np.median(cost):.2f},"
        f" {np.quantile(cost, 0.95):.2f} | {models} |"
    )


def _fraction(which: np.ndarray) -> str:
    return f"{which.sum()} ({100 * which.mean():.1f} %)"


def failures(found: list[Trial]) -> str:
    """List the scenes beyond their tolerance, and those whose estimate is below the error."""
    result = []
    for title, key, limit in (
        ("Beyond the tolerance", "miss", 1.0),
        ("Estimates below the error", "excess", ABOVE),
    ):
        bad = sorted(
            (one for one in found if getattr(one, key) > limit), key=lambda one: -getattr(one, key)
        )
        lines = [
            f"- {t.generator} {t.seed} (`{t.design}`, {t.quantity}, on `{t.level}`): error"
            f" {t.error:.2g}, estimate {t.estimate:.2g}, tolerance {t.tolerance:.2g}"
            for t in bad[:LISTED]
        ]
        result.append(f"{title}:\n\n" + "\n".join(lines) if lines else f"{title}: no scene.")
    return "\n\n".join(result)


def report(found: list[Trial]) -> str:
    """Format the whole page."""
    head = HEAD.format(
        count=len(found),
        builds=int(np.prod(quantities.BUILDS)),
        turns=REPETITIONS,
    )
    rows = [
        row(f"{quantity}, {generator}", part)
        for quantity in QUANTITIES
        for generator in GENERATORS
        if (part := [t for t in found if (t.quantity, t.generator) == (quantity, generator)])
    ]
    return head + "\n".join([*rows, row("**all**", found)]) + "\n\n" + failures(found) + "\n"


def main() -> None:
    """Run all trials, write the page and draw the chart."""
    found = run_trials(int(sys.argv[1]) if len(sys.argv) > 1 else SCENES)
    (ROOT / "results").mkdir(exist_ok=True)
    write_bytes(ROOT / "results" / "auto.md", report(found).encode())
    with house_style():
        save(draw(found), ROOT / "results" / "auto.png")
    print(report(found).partition("png)\n\n")[2])


if __name__ == "__main__":
    main()
