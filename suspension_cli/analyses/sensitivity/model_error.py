"""Error of derivatives in one model, against those in a more complete one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.analyses import model_choice
from suspension_cli.analyses.optimise.mode_families import has_wire_mass
from suspension_cli.analyses.sensitivity.solve import solve, solve_nominal
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.frequency_terms import WireTerm
from suspension_cli.linear.mode_pairing import body_overlap, pair_by_overlap
from suspension_cli.linear.named_results import Mode, Scalar
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.models.estimates import Estimates
from suspension_cli.models.quantity_of_interest import Differentiated
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Float

STEEPER = 10.0
"""Largest relative error of a derivative over the estimated error of the result: 2 to 4 for the
shipped chains, 3 to 10 for single stages on thick wires. Up to this bound, errors are computed."""


@dataclass(frozen=True)
class Derivatives(Differentiated):
    """Derivatives of several results.

    The error is the largest change of a derivative, per mm, mrad or %, over the largest derivative
    of the same result.
    """

    text: str

    effect: ClassVar[str] = "changes the derivatives"

    def _estimate(self, item: Scalar, physics: str, found: Modes, of: Estimates) -> Array:
        return STEEPER * super()._estimate(item, physics, found, of)

    def change(self, without: LinearSystem, refined: LinearSystem) -> tuple[float, str]:
        """Compute the largest error of the derivatives in a model, and its result."""
        levels = [_level(model) for model in (without, refined)]
        if levels[0] == levels[1]:  # a model without derivatives
            return super().change(without, refined)
        old, new = (self._per_step(level) for level in levels)
        names = [name for name in new if name in old]
        before, after = (np.array([part[name] for name in names]) for part in (old, new))
        # rigid and unstable modes have none
        size, wrong = (np.nan_to_num(np.abs(of)).max(axis=0) for of in (after, after - before))
        error = wrong / np.where(size > 0, size, 1.0)
        most = int(error.argmax())
        return float(error[most]), f"the derivatives of {self.scalars[most].text}"

    def _per_step(self, level: str) -> dict[str, Float[np.ndarray, " result"]]:
        """Changes of the results by number, with modes paired by shape."""
        model, found = solve_nominal(self.text, level)
        count = 6 * len(model.body)
        mass = model.mass[6 : 6 + count, 6 : 6 + count]
        places = pair_by_overlap(body_overlap(self.modes.shape, found.shape, mass))
        results = tuple(
            Mode(item.text, int(places[item.number])) if isinstance(item, Mode) else item
            for item in self.scalars
        )
        solved = solve(self.text, results, level)
        return dict(zip(solved.parameter, solved.per_step, strict=True))


def request(text: str, results: Sequence[str]) -> Callable[[LinearSystem], Derivatives]:
    """Return the quantity of interest: derivatives of named results."""
    named = model_choice.named_results(tuple(results))

    def of(system: LinearSystem) -> Derivatives:
        several = named(system)
        return Derivatives(several.scalars, several.modes, text)

    return of


def _level(model: LinearSystem) -> str:
    """Name of the model of a linear system, if it has derivatives."""
    if has_wire_mass(model):
        return registry.VIOLIN.name
    bends = any(isinstance(term, WireTerm) for term in model.terms)
    return (registry.BEAM if bends else registry.STRING).name
