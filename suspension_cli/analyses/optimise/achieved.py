"""Quantities of goals computed by the ordinary analyses, independently of the search.

Modes are solved as in `pendsus modes`, responses as in `pendsus response`, tensions as in `pendsus
check`, each with the model that `auto` chooses for it unless another is requested.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.check import statics
from suspension_cli.analyses.modes import wire_modes
from suspension_cli.analyses.optimise import loads
from suspension_cli.analyses.optimise.loads import Part
from suspension_cli.analyses.optimise.mode_families import Families
from suspension_cli.analyses.optimise.objective import with_imperfections
from suspension_cli.analyses.optimise.quantities import (
    OfDepth,
    OfMode,
    OfPart,
    OfResponse,
    Quantity,
)
from suspension_cli.design import materials, reader
from suspension_cli.design.derive import com_positions
from suspension_cli.design.schema import Design
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import eigenmodes, response
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import auto, registry
from suspension_cli.models.quantity_of_interest import Frequencies, QuantityOfInterest, Transfer
from suspension_cli.models.registry import Choice
from suspension_cli.scene.arrays import Array, Index

if TYPE_CHECKING:
    from jaxtyping import Float, Int


@dataclass(frozen=True)
class Achieved:
    """Quantities of one design.

    Attributes
    ----------
    value : array
        In the units of the quantities; NaN for a mode that is unstable or cannot be followed.
    place : array
        Number of the mode that each refers to, from 0; -1 for other quantities.
    modes : Modes
    ranked : list of int arrays
        Numbers of the modes of each family, in ascending order of frequency.
    choice : Choice
        The model that solved the modes.
    bends : bool
        Whether wires bend in the model of any quantity.
    """

    value: Float[np.ndarray, " quantity"]
    place: Int[np.ndarray, " quantity"]
    modes: Modes
    ranked: list[Int[np.ndarray, " _"]]
    choice: Choice
    bends: bool


def evaluate(
    text: str,
    quantities: tuple[Quantity, ...],
    families: Families,
    level: str,
    tolerance: float,
    follow: Callable[[Modes, Array], Index],
) -> Achieved:
    """Compute quantities of a design.

    Parameters
    ----------
    text : str
        The design as TOML.
    quantities : tuple of Quantity
    families : Families
        Mode families of the starting design.
    level : str
        Name of a model, or ``auto``.
    tolerance : float
        Relative error that ``auto`` may leave.
    follow : callable
        Maps modes and their mass matrix to the number of the mode that each mode of the starting
        design has become, -1 where this is unknown.
    """
    design = reader.parse(text)
    choice, model = _choose_model(design, lambda _: Frequencies(), level, tolerance)
    bends = choice.model.bends_wires
    found = eigenmodes.solve(model)
    if choice.model.has_wire_mass:  # wire mass lowers all frequencies
        found = wire_modes.solve(model, float(np.nanmax(found.frequency)))
        found = found.select(found.order == 0)  # without violin modes
    ranked = families.ranked(found.energy)
    named = any(isinstance(item, OfMode) and item.number >= 0 for item in quantities)
    followed = follow(found, model.basis @ model.mass @ model.basis.T) if named else None
    value, place = np.empty(len(quantities)), np.full(len(quantities), -1)
    for n, item in enumerate(quantities):
        if isinstance(item, OfMode):
            place[n] = (
                _ranked(ranked[item.family], item.rank)
                if item.number < 0 or followed is None
                else followed[item.number]
            )
            value[n] = (
                np.nan
                if place[n] < 0
                else (found.top_fraction if item.fraction else found.frequency)[place[n]]
            )
        elif isinstance(item, OfResponse):
            value[n], bent = _response(design, item, level, tolerance)
            bends = bends or bent
        elif isinstance(item, OfPart):
            value[n] = _stress(design, item.part)
        else:
            value[n] = _depth(design, item)
    return Achieved(value, place, found, ranked, choice, bends)


def _ranked(places: Int[np.ndarray, " place"], rank: int) -> int:
    """Return the number of the mode of a rank in a family; -1 if there is none."""
    return int(places[rank]) if rank < len(places) else -1


def _choose_model(
    design: Design,
    make: Callable[[LinearSystem], QuantityOfInterest],
    level: str,
    tolerance: float,
) -> tuple[Choice, LinearSystem]:
    """Choose the requested model, or the one that `auto` finds, and build its system."""
    if level == registry.AUTO:
        decision = auto.decide(design, make, tolerance)
        return decision.choice, decision.model
    choice = registry.choose(design, level)
    return choice, choice.model.system(design)


def _response(design: Design, item: OfResponse, level: str, tolerance: float) -> tuple[float, bool]:
    """Magnitude of a response, SI, and whether wires bend in its model."""
    outputs = [item.ratio.over] + ([] if item.ratio.under is None else [item.ratio.under])
    inputs, frequency = [item.ratio.input], np.array([item.ratio.frequency])
    imperfect = with_imperfections(design, item.perturbation)
    choice, model = _choose_model(
        imperfect, lambda _: Transfer(inputs, outputs, frequency), level, tolerance
    )
    size = np.abs(response.solve(model, frequency, inputs, outputs).value[0, :, 0])
    found = float(size[0] if len(size) == 1 else size[0] / size[1] if size[0] else 0.0)
    return found, choice.model.bends_wires


def _stress(design: Design, part: Part) -> float:
    """Stress of a wire or blade in equilibrium, as a fraction of its tensile strength."""
    if part.blade:
        scene = expand(design)
        return float(loads.stress(design, scene, equilibrium.solve(scene).pose, part))
    pascal = statics.solve(design).wires[part.place].stress
    stage = next(stage for stage in design.stage if stage.name == part.stage)
    wire = stage.wires or stage.wire[part.member]
    own = [piece.material or wire.material for piece in wire.sections or ()] or [wire.material]
    strength = min(materials.resolve(design, name or "").tensile_strength or np.nan for name in own)
    return (np.nan if pascal is None else pascal) / strength


def _depth(design: Design, item: OfDepth) -> float:
    """Depth of the COM of a stage below the suspension point, m."""
    shift = next(body.shift for body in statics.solve(design).bodies if body.name == item.stage)
    return -(com_positions(design)[item.stage][2] + shift[2])
