"""One search of a fit of transfer functions: from starting values to the least chi^2 nearby."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.fit import resonances
from suspension_cli.analyses.fit.channels import Channels
from suspension_cli.analyses.fit.problem import Problem
from suspension_cli.analyses.fit.resonances import Peak
from suspension_cli.analyses.fit.result import is_unlikely
from suspension_cli.analyses.fit.wrong_channels import Correction

if TYPE_CHECKING:
    from suspension_cli.scene.arrays import Array

SOFTNESS = 0.2
"""Relative uncertainty of magnitudes in a search on their logarithms."""


@dataclass(frozen=True)
class Solution:
    """End of a search: the problem with corrected channels, and its unknowns z."""

    problem: Problem
    peaks: list[list[Peak]]
    z: Array
    chi_squared: float
    corrections: tuple[Correction, ...] = ()

    @property
    def freedom(self) -> int:
        """Degrees of freedom: residuals and priors less unknowns."""
        return len(self.problem.residual(self.z)) - len(self.z)

    @property
    def misfit(self) -> bool:
        """Whether so large a chi^2 is unlikely."""
        return is_unlikely(self.chi_squared, self.freedom)


def refine(begin: Solution, *, quick: bool = False) -> Solution:
    """Fit to the resonances, then to the complex values.

    In a misfit, the search is repeated without the first, then by way of the logarithms of
    magnitudes. A `quick` fit takes fewer steps and is not repeated.
    """
    problem = begin.problem
    how: dict[str, Any] = {"steps": 12, "tolerance": 1e-4} if quick else {"tolerance": 1e-10}

    def descend(z: Array) -> Solution:
        end, chi_squared = problem.minimise(z, problem.residual, problem.jacobian, **how)
        return replace(begin, z=end, chi_squared=chi_squared)

    def soften(z: Array) -> Array:
        return problem.minimise(
            z,
            lambda z: problem.residual(z, SOFTNESS),
            lambda z: problem.jacobian(z, SOFTNESS),
            tolerance=1e-4, steps=40,
        )[0]  # fmt: skip

    first = resonances.search(problem, begin.z, begin.peaks)
    found = descend(first)
    for start in () if quick else (lambda: begin.z, lambda: soften(first)):
        if found.misfit:
            found = min(found, descend(start()), key=lambda end: end.chi_squared)
    return found


def with_channels(found: Solution, made: Channels) -> Solution:
    """Change the channels; properties that become unknown begin at 0."""
    problem = found.problem.changed(channels=made)
    old = {item.name: value for item, value in found.problem.values(found.z).items()}
    own = [old.get(item.name, 0.0) for item in problem.nuisances]
    z = np.concatenate([found.z[: problem.count], own, found.z[found.problem.parts[2].start :]])
    return replace(found, problem=problem, z=z)
