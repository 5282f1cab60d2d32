"""Trials of interpolated maps: random sweeps of random designs, against every point solved.

    python -m tools.map_trials --trials 200

Each trial varies two random numbers of a design over random ranges. In every other trial the
frequency of a response is that of a mode at a random place of the map, so that a resonance crosses
it; others ask for responses at random frequencies, static rotations, tensions or modes. A line per
trial has the stated and the true error, which is the largest difference at all points.
"""

from __future__ import annotations

import argparse
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.analyses import named_quantities
from suspension_cli.analyses.sweep.parameter_sweep import ParameterSweep
from suspension_cli.design import reader
from suspension_cli.errors import InputError
from suspension_cli.linear import eigenmodes
from suspension_cli.quantities.nominal_results import find_results
from suspension_cli.studies import interpolated
from suspension_cli.studies.job import Axis, nominal_system
from tools.tables import ROOT

DESIGNS = (
    "husman2000/figure6",
    "husman2000/table1-case1",
    "husman2000/table1-case3",
    "husman2000/table2",
    "double",
    "imperfect",
    "triple-tolerance",
    "geo-silica-triple",
    "quadruple",
)
KEYS = ("l", "s", "t1", "t2", "d", "mass", "stiffness", "offset")
"""Numbers that are varied."""
SIDE = 36
"""Values of each number."""
HONEST = 3.0
"""Largest true error over the stated one."""


@dataclass(frozen=True)
class Outcome:
    """A trial: what was swept, and both errors; None if every point is solved by the program."""

    text: str
    resonant: bool
    stated: float | None = None
    true: float = 0.0

    @property
    def ratio(self) -> float:
        """True error over the stated one."""
        return 0.0 if self.true == 0 else self.true / max(self.stated or 0.0, 1e-300)


def numbers(table: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """List the numbers of a design that may be varied, by their dotted paths."""
    if isinstance(table, list):
        for one in table:
            if isinstance(one, dict) and "name" in one:
                yield from numbers(one, f"{path}.{one['name']}")
        return
    for key, value in table.items():
        inside = f"{path}.{key}".lstrip(".")
        if isinstance(value, dict) or (isinstance(value, list) and key == "stage"):
            yield from numbers(value, inside)
        elif key in KEYS and isinstance(value, float) and value:
            yield inside, value


def make(seed: int) -> tuple[ParameterSweep, bool]:
    """Make the sweep of a trial, and say whether a mode is to cross its frequency."""
    rng = np.random.default_rng(seed)
    resonant = seed % 2 == 1
    source = reader.read(ROOT / f"configs/{rng.choice(DESIGNS)}.toml")
    raw = tomllib.loads(source.text)
    given = [one for one in numbers(raw) if one[0].startswith("stage.")]
    axes = []
    for n in rng.choice(len(given), 2, replace=False).tolist():
        path, value = given[n]
        width = 10 ** rng.uniform(-2, -0.5)
        low, high = sorted((value * (1 - width), value * (1 + width)))
        spaced = np.geomspace if rng.random() < 0.3 and low > 0 else np.linspace
        axes.append(Axis(path, tuple(spaced(low, high, SIDE).tolist())))
    level = str(rng.choice(["string", "string", "string", "beam"]))
    bodies = [stage.name for stage in source.design.stage]
    body = bodies[-1]
    system = nominal_system(source.text, level)
    frequency = 10 ** rng.uniform(-0.5, 1.7)
    kind = rng.integers(2 if resonant else 5)
    if resonant:
        squared = eigenmodes.solve(system.constant).omega_squared
        frequency = float(np.sqrt(np.abs(rng.choice(squared))) / (2 * np.pi))
    asked = (
        f"{body}.x/support.x:{frequency!r}",
        f"{body}.pitch/{body}.x/support.x:{frequency!r}",
        f"{rng.choice(bodies)} static {rng.choice(['pitch', 'height', 'x'])}",
        f"tension {body} wires",
        f"{body} {rng.choice(['pitch', 'roll', 'yaw', 'longitudinal'])}",
    )[kind]
    names = named_quantities.names_of(source)
    results = find_results([asked], names, source.text, level)
    return ParameterSweep(source.text, tuple(axes), level, results), resonant


def run(seed: int) -> Outcome:
    """Interpolate the map of a trial, and solve all its points if that is accepted."""
    try:
        job, resonant = make(seed)
    except InputError as error:
        return Outcome(f"no such sweep: {error.faults[0].line('')}", seed % 2 == 1)
    axes = ", ".join(f"{one.name} {one.values[0]:.4g}:{one.values[-1]:.4g}" for one in job.axes)
    text = f"{job.design.design.name}, {job.level}, {axes}: {job.results[0].text}"
    found = interpolated.interpolated(job)
    if found is None:
        return Outcome(text, resonant)
    exact = job.compute(0, job.count)
    mine = found.compute(0, job.count)
    true = interpolated.largest_difference(job, exact, mine)
    return Outcome(text, resonant, found.error, true)


def main() -> None:
    """Run trials and print their errors."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=0, help="seed of the first trial")
    parser.add_argument("--trials", type=int, default=200)
    given = parser.parse_args()
    outcomes = []
    for seed in range(given.first, given.first + given.trials):
        one = run(seed)
        outcomes.append(one)
        errors = "every point solved"
        if one.stated is not None:
            errors = f"stated {one.stated:.0e}, true {one.true:.0e}, ratio {one.ratio:.2g}"
        print(f"{seed}: {errors}; {one.text}", flush=True)
    mapped = [one for one in outcomes if one.stated is not None]
    resonant = sum(one.resonant for one in mapped)
    print(f"{len(mapped)} of {len(outcomes)} interpolated, {resonant} with a resonance")
    if mapped:
        ratios = np.array([one.ratio for one in mapped])
        wrong = int((ratios > HONEST).sum())
        print(f"true over stated error: median {np.median(ratios):.2g}, largest {ratios.max():.2g}")
        print(f"{wrong} above {HONEST:g}; largest true error {max(one.true for one in mapped):.0e}")


if __name__ == "__main__":
    main()
