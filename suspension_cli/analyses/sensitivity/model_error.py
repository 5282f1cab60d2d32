"""Error of the derivatives of results on one model, against those on a more complete one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.analyses import model_choice
from suspension_cli.analyses.optimise.mode_families import has_wire_mass, solve_modes
from suspension_cli.analyses.sensitivity.solve import solve
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
"""Largest relative error of a derivative, over the estimated error of the result: 2 to 4 on the
shipped chains, 3 to 10 on single stages on thick wires. Within it, errors are computed."""


@dataclass(frozen=True)
class Derivatives(Differentiated):
    """Derivatives of several results, in the design of a text.

    The error is the largest change of a derivative, per mm, mrad or %, over the largest derivative
    of the same result.
    """

    text: str

    effect: ClassVar[str] = "changes the derivatives"

    def _estimate(self, item: Scalar, physics: str, found: Modes, of: Estimates) -> Array:
        return STEEPER * super()._estimate(item, physics, found, of)

    def change(self, without: LinearSystem, refined: LinearSystem) -> tuple[float, str]:
        """Compute the largest error of the derivatives in a model, and the result that has it."""
        levels = [_level(model) for model in (without, refined)]
        if levels[0] == levels[1]:  # a model without derivatives
            return super().change(without, refined)
        old, new = (
            self._per_step(model, level)
            for model, level in zip((without, refined), levels, strict=True)
        )
        names = [name for name in new if name in old]
        before, after = (np.array([part[name] for name in names]) for part in (old, new))
        with np.errstate(invalid="ignore", divide="ignore"):
            size = np.nanmax(np.abs(after), axis=0)
            error = np.nanmax(np.abs(after - before), axis=0) / np.where(size > 0, size, 1.0)
        most = int(np.nanargmax(error))
        return float(error[most]), f"the derivatives of {self.scalars[most].text}"

    def _per_step(self, model: LinearSystem, level: str) -> dict[str, Float[np.ndarray, " result"]]:
        """Changes of the results by number, with modes paired by their shapes."""
        found, count = solve_modes(model), 6 * len(model.body)
        mass = model.mass[6 : 6 + count, 6 : 6 + count]
        places = pair_by_overlap(body_overlap(self.modes.shape, found.shape, mass))
        results = tuple(
            Mode(item.text, int(places[item.number])) if isinstance(item, Mode) else item
            for item in self.scalars
        )
        solved = solve(self.text, results, level)
        return dict(zip(solved.parameter, solved.per_step, strict=True))


def request(text: str, results: Sequence[str]) -> Callable[[LinearSystem], Derivatives]:
    """Return the derivatives of named results as quantity of interest."""
    named = model_choice.named_results(tuple(results))

    def of(system: LinearSystem) -> Derivatives:
        several = named(system)
        return Derivatives(several.scalars, several.modes, text)

    return of


def _level(model: LinearSystem) -> str:
    """Name of the model with derivatives of a linear system."""
    if has_wire_mass(model):
        return registry.VIOLIN.name
    bends = any(isinstance(term, WireTerm) for term in model.terms)
    return (registry.BEAM if bends else registry.STRING).name
