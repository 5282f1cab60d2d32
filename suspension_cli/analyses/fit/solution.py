"""End of a search: values of all unknowns, with corrected channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.fit import start
from suspension_cli.analyses.fit.explanations import FACTOR, Correction
from suspension_cli.analyses.fit.least_squares import minimise
from suspension_cli.analyses.fit.problem import Problem
from suspension_cli.analyses.fit.result import is_unlikely

if TYPE_CHECKING:
    from suspension_cli.scene.arrays import Array

FACTOR_KNOWN = 0.5
"""Relative uncertainty of a gain that is off by a factor."""
ROUGH: dict[str, Any] = {"tolerance": 1e-5, "steps": 15, "held": True}
"""End of a search for transfer functions. In a misfit of narrow resonances chi^2 creeps along a
curved valley; only the best search goes on to its end."""


@dataclass(frozen=True)
class Solution:
    """End of a search: the problem with corrected channels, and its unknowns z."""

    problem: Problem
    z: Array
    chi_squared: float = np.inf
    corrections: tuple[Correction, ...] = ()

    @property
    def misfit(self) -> bool:
        """Whether so large a chi^2 is unlikely."""
        return is_unlikely(self.chi_squared, len(self.problem.residual(self.z)), len(self.z))

    def descend(self, z: Array, **how: Any) -> Solution:
        """Fit all values from z on."""
        z, chi_squared = minimise(self.problem, z, **how)
        return replace(self, z=z, chi_squared=chi_squared)

    def refine(self, how: dict[str, Any] = ROUGH) -> Solution:
        """Fit to the resonances, then all values."""
        if not self.problem.peaks:
            return self.descend(self.z)
        return self.descend(start.fit_resonances(self.problem, self.z), **how)

    def carry(self, problem: Problem, values: dict[str, float] | None = None) -> Solution:
        """Turn to another problem: unknowns keep their values but for those given.

        Unknowns that are new begin at their start.
        """
        known = dict(zip(self.problem.unknowns.name, self.z, strict=True)) | (values or {})
        names, first, *_ = problem.unknowns
        z = [known.get(name, value) for name, value in zip(names, first, strict=True)]
        return replace(self, problem=problem, z=np.array(z))

    def corrected(self, corrections: Sequence[Correction]) -> Solution:
        """Change channels; gains that are off by a factor are free."""
        channels = self.problem.channels
        for one in corrections:
            channels = one.apply(channels)
            if one.kind == FACTOR:
                wide = {"gain_uncertainty": FACTOR_KNOWN}
                channels = channels.with_transducer(one.side, one.channel[0], **wide)
        found = self.carry(replace(self.problem, channels=channels))
        return replace(found, corrections=tuple(corrections))


def best_of(ends: Sequence[Solution]) -> Solution:
    """Return the solution of least chi^2."""
    return min(ends, key=lambda end: end.chi_squared)
