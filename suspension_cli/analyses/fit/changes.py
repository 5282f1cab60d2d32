"""Measurements explained by changes of one or two numbers of a design.

One wrong part moves many resonances and zeros together. That change alone is easier to find than
the values of all uncertain numbers: few numbers have few minima. Numbers are ranked by three
estimates, and the best of each are fitted:

- the resonances: by how much a change of one number brings computed to measured frequencies, each
  difference counted by its logarithm where it is large, so that a peak of another mode matters
  little;
- the values: the decrease of chi^2 to first order;
- the fit of all numbers: the part of it that a change of one number alone explains, to first order.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.fit import start
from suspension_cli.analyses.fit.explanations import SingleChange
from suspension_cli.analyses.fit.least_squares import data_rows
from suspension_cli.analyses.fit.problem import Problem
from suspension_cli.analyses.fit.solution import Solution, best_of
from suspension_cli.errors import InputError
from suspension_cli.studies import derivatives, parameters

if TYPE_CHECKING:
    from suspension_cli.scene.arrays import Array

QUICK: dict[str, Any] = {"tolerance": 1e-4, "steps": 8, "held": True}
"""End of a search."""
REFITTED = 5
"""Most changes of one number that are fitted."""
FIRST = 2
"""Changes of one number to which a second one is added."""
SECOND = 4
"""Most second numbers for one of these."""
WORTH = 0.02
"""Fraction of the fit's decrease of chi^2 that a single change must reach to be reported."""
LEAST = 4.0
"""Least decrease of chi^2 of a change that is fitted."""
BUILT = 2e-3
"""Relative difference of frequencies that small errors of other numbers cause."""


@dataclass
class Changes:
    """Fits of the measurements with few numbers of the design changed, others as given.

    `given` are all numbers of the design, as the search starts; `wide` the problem in which all
    are free, with derivatives of the matrices of the design as given.
    """

    given: dict[str, float]
    wide: Problem
    done: dict[tuple[object, ...], Solution | None] = field(default_factory=dict)

    @staticmethod
    def of(problem: Problem) -> Changes:
        """List the numbers of the one design of a problem."""
        one = problem.experiment[0]
        given = {
            item.name: item.value
            for item in parameters.every(one.text, one.level)
            if not item.name.startswith("control.")
        }
        given |= dict(zip(one.free, problem.base, strict=True))
        wide = problem.restricted([*given], given)
        return Changes(given, wide.held(wide.unknowns.start))

    def fit(self, begin: Solution, names: Sequence[str] = ()) -> Solution | None:
        """Fit the measurements with some numbers free, from other values on; None if it fails.

        Numbers that `begin` does not vary begin as given.
        """
        key = (*sorted(names), begin.corrections)
        if key not in self.done:
            here = begin.carry(begin.problem.restricted(names, self.given))
            try:
                end = here.refine(QUICK)
                if end.chi_squared > begin.chi_squared:  # by a peak of another mode
                    end = best_of([end, here.descend(here.z, **QUICK)])
                self.done[key] = end
            except (InputError, np.linalg.LinAlgError):
                self.done[key] = None
        return self.done[key]

    def of_one(self, found: Solution) -> Iterator[Solution]:
        """Fit changes of single free numbers of a fit, the most promising first."""
        before = self.fit(found)
        if before is None:
            return
        begin = before.carry(found.problem.restricted((), self.given))
        orders = self._by_fit(found), self._by_resonances(before), self._by_values(before)
        for name in _merged(orders, found.problem.experiment[0].free, REFITTED):
            end = self.fit(begin, (name,))
            if end is not None:
                yield end

    def singles(self, found: Solution) -> list[Solution]:
        """Fit what changes of single numbers explain of a fit of all; add those fitted before."""
        ends = [self.fit(found, (name,)) for name in self._by_fit(found)[:REFITTED]]
        done = [
            end
            for (*names, corrections), end in self.done.items()
            if len(names) == 1 and corrections == found.corrections
        ]
        return list({id(end): end for end in [*ends, *done] if end is not None}.values())

    def of_two(self, found: Solution, singles: Sequence[Solution]) -> Iterator[Solution]:
        """Add changes of second free numbers to the best ones of one."""
        for first in sorted(singles, key=lambda end: end.chi_squared)[:FIRST]:
            names = first.problem.experiment[0].free
            others = [name for name in found.problem.experiment[0].free if name not in names]
            orders = self._by_resonances(first), self._by_values(first)
            for name in _merged(orders, others, SECOND):
                end = self.fit(first, (*names, name))
                if end is not None:
                    yield end

    @cached_property
    def _names(self) -> list[str]:
        return [*self.given]

    def _wide(self, found: Solution) -> tuple[Problem, Array]:
        """Free all numbers where a search ended; return that problem and all unknowns."""
        wide = replace(self.wide, channels=found.problem.channels)
        fitted = dict(zip(found.problem.unknowns.name, found.z, strict=True))
        return wide, found.carry(wide, self.given | fitted).z

    def _by_fit(self, found: Solution) -> list[str]:
        """Rank numbers by what a change of one explains of the fit of all."""
        wide, z = self._wide(found)
        slope = data_rows(wide, wide.jacobian(z))
        own = slope.T @ slope
        moved = z[: wide.count] - np.array([*self.given.values()])
        with np.errstate(divide="ignore", invalid="ignore"):
            gain = np.nan_to_num((own @ moved) ** 2 / np.diag(own))
        return self._ranked(gain, max(WORTH * float(moved @ own @ moved), LEAST))

    def _by_values(self, found: Solution) -> list[str]:
        """Rank numbers by the decrease of chi^2 to first order, others that are free fitted too."""
        wide, z = self._wide(found)
        free = np.isin(wide.unknowns.name, found.problem.unknowns.name)
        slope = wide.jacobian(z)
        off = wide.residual(z)
        basis = np.linalg.qr(slope[:, free] * wide.unknowns.scale[free])[0]
        rows = slope[:, : wide.count] - basis @ (basis.T @ slope[:, : wide.count])
        size = (rows**2).sum(0)
        with np.errstate(divide="ignore", invalid="ignore"):
            gain = np.nan_to_num((off @ rows) ** 2 / size)
        gain[free[: wide.count]] = 0.0
        return self._ranked(gain, LEAST)

    def _by_resonances(self, found: Solution) -> list[str]:
        """Rank numbers by how much a change of one brings computed to measured resonances."""
        wide, z = self._wide(found)
        one = wide.experiment[0]
        x = z[: wide.count]
        peaks = start.assign_peaks(wide, z)
        if not peaks:
            return []
        modes = one.plant(x).modes
        places = one.order(x)[[peak.mode for peak in peaks]]
        measured = np.array([peak.frequency for peak in peaks])
        doubt = np.hypot([peak.sigma for peak in peaks] / measured, BUILT)
        off = np.log(measured / modes.frequency[places]) / doubt
        rates = [
            derivatives.frequency_rates(modes, change.of_modes(modes))[places]
            for change in one.changes(x)
        ]
        slope = np.nan_to_num(np.array(rates)) / modes.frequency[places] / doubt
        gain = [_robust_gain(off, row) for row in slope]
        return self._ranked(np.array(gain), LEAST)

    def _ranked(self, gain: Array, least: float) -> list[str]:
        order = np.argsort(-gain, kind="stable")
        return [self._names[n] for n in order if gain[n] > least]


def _robust_gain(off: Array, slope: Array) -> float:
    """Decrease of the sum of ln(1 + r^2) of differences by the best change of one number."""
    live = slope != 0
    if not live.any():
        return 0.0
    steps = off[live] / slope[live]  # each makes one difference 0
    after = np.log1p((off - steps[:, None] * slope) ** 2).sum(1)
    return float(np.log1p(off**2).sum() - after.min())


def _merged(orders: Sequence[Sequence[str]], among: Sequence[str], count: int) -> list[str]:
    """Merge rankings of some names: the first of each, the second of each, ..."""
    wanted = [[name for name in order if name in among] for order in orders]
    turns = itertools.chain.from_iterable(itertools.zip_longest(*wanted))
    return list(dict.fromkeys(name for name in turns if name is not None))[:count]


def single_changes(changes: Changes, found: Solution) -> tuple[float, tuple[SingleChange, ...]]:
    """Describe the changes of one number that explain most, best first.

    Also returns chi^2 of the design as given, with only the other unknowns fitted.
    """
    before = changes.fit(found)
    if before is None:
        return np.nan, ()
    most = before.chi_squared - WORTH * max(before.chi_squared - found.chi_squared, 0.0)
    made = []
    for end in changes.singles(found):
        (name,) = end.problem.experiment[0].free
        first = changes.given[name]
        if end.chi_squared < most:
            made.append(SingleChange(name, first, end.z[0] - first, end.chi_squared))
    return before.chi_squared, tuple(sorted(made, key=lambda item: item.chi_squared))
