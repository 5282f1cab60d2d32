"""Searches for the least chi^2 of a fit.

Where resonances are narrow chi^2 has many minima: a computed peak beside a measured one can only
cross it uphill. A search that ends in a misfit therefore starts again,

1. from the best change of one number of the design (`changes`), which moves its resonances
   together;
2. with channels compared again where the searches so far ended;
3. from the best changes of two numbers;
4. from the start of the fit without its resonances, and with more steps where the best one ended,

until the measurements are explained.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import msgspec

from suspension_cli.analyses.fit import start
from suspension_cli.analyses.fit.changes import Changes
from suspension_cli.analyses.fit.explanations import Correction
from suspension_cli.analyses.fit.solution import ROUGH, Solution, best_of

ROUNDS = 3
"""Most comparisons of channels."""
LONG: dict[str, Any] = ROUGH | {"steps": 40}
"""End of a search where nothing else explains a misfit."""


def search(begin: Solution) -> Solution:
    """Fit all measurements once, with wrong channels as they appear at the start."""
    return begin.corrected(start.guess_channels(begin.problem, begin.z)).refine()


@dataclass
class Search:
    """Searches from one start, `begin`, of which the best end so far is `found`."""

    begin: Solution
    found: Solution
    changes: Changes
    few: list[Solution] = field(default_factory=list)

    @staticmethod
    def of(begin: Solution, found: Solution) -> Search:
        """Go on from the end of a first search."""
        return Search(begin, found, Changes.of(begin.problem))

    def go_on(self) -> Solution:
        """Start again in all ways until the measurements are explained."""
        ways: tuple[Callable[[], None], ...] = (
            self._from_one_change,
            self._from_other_channels,
            self._from_two_changes,
            self._from_start,
        )
        for way in ways:
            if not self.found.misfit:
                break
            way()
        return self.found

    def _from_one_change(self) -> None:
        """Start from the best change of one number."""
        self.few = self._until_explained(self.changes.of_one(self.found))
        self._from_few(self.few)

    def _from_two_changes(self) -> None:
        """Start from the best changes of two numbers."""
        self._from_few(self._until_explained(self.changes.of_two(self.found, self.few)))

    def _from_other_channels(self) -> None:
        """Compare channels again where searches ended, and search with those that differ."""
        ends = [self.found, *sorted(self.few, key=lambda end: end.chi_squared)[:1]]
        tried = [_keys(self.found.corrections)]
        for _ in range(ROUNDS - 1):
            for end in ends:
                values = dict(zip(end.problem.unknowns.name, end.z, strict=True))
                now = self.begin.carry(self.begin.problem, values)
                wrong = start.guess_channels(self.begin.problem, now.z)
                if _keys(wrong) not in tried:
                    break
            else:
                return
            tried.append(_keys(wrong))
            ends = [self.begin.corrected(wrong).refine()]
            self.found = best_of([self.found, *ends])
            if not self.found.misfit:
                return

    def _from_start(self) -> None:
        """Start from the given values, and take more steps."""
        here = self.begin.corrected(self.found.corrections)
        self.found = best_of([self.found, here.descend(here.z, **ROUGH)])
        if self.found.misfit:
            self.found = self.found.descend(self.found.z, **LONG)

    def _until_explained(self, ends: Iterable[Solution]) -> list[Solution]:
        """Collect solutions until one explains the measurements."""
        made = []
        for end in ends:
            made.append(end)
            if not end.misfit:
                break
        return made

    def _from_few(self, ends: Sequence[Solution]) -> None:
        """Fit all numbers from the best of some solutions in which few are free."""
        if not ends:
            return
        few = best_of(ends)
        whole = few.carry(self.begin.corrected(few.corrections).problem)
        self.found = best_of([self.found, whole.descend(whole.z, **ROUGH)])
        if self.found.misfit:
            # small errors of all other numbers, too: these leave the resonances somewhat off
            names = few.problem.experiment[0].free
            free = [
                msgspec.structs.replace(one, prior=None, uncertainty=None)
                if one.name in names
                else one
                for one in whole.problem.free
            ]
            z = start.fit_resonances(replace(whole.problem, free=free), whole.z)
            self.found = best_of([self.found, whole.descend(z, **ROUGH)])


def _keys(corrections: Sequence[Correction]) -> set[object]:
    return {(one.kind, one.side, *one.channel) for one in corrections}
