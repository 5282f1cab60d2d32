"""Quantities of goals computed by the ordinary analyses, independently of the search.

Modes are solved as in `pendsus modes`, responses as in `pendsus response`, tensions as in `pendsus
check`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.check import statics
from suspension_cli.analyses.optimise import loads, mode_families
from suspension_cli.analyses.optimise.chosen_models import Models
from suspension_cli.analyses.optimise.loads import Part
from suspension_cli.analyses.optimise.mode_families import Families
from suspension_cli.analyses.optimise.objective import find_places
from suspension_cli.analyses.optimise.quantities import (
    OfDepth,
    OfMode,
    OfPart,
    OfResponse,
    Quantity,
    with_imperfections,
)
from suspension_cli.design import materials, reader
from suspension_cli.design.derive import com_positions
from suspension_cli.design.schema import Design
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import response
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Index

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
    """

    value: Float[np.ndarray, " quantity"]
    place: Int[np.ndarray, " quantity"]
    modes: Modes
    ranked: list[Int[np.ndarray, " _"]]


def evaluate(
    text: str,
    quantities: tuple[Quantity, ...],
    families: Families,
    models: Models,
    follow: Callable[[Modes, LinearSystem], Index],
) -> Achieved:
    """Compute quantities of a design.

    Parameters
    ----------
    text : str
        The design as TOML.
    quantities : tuple of Quantity
    families : Families
        Mode families of the starting design.
    models : Models
    follow : callable
        Maps modes and their system to the number of the mode that each mode of the starting design
        has become, -1 where this is unknown.
    """
    design = reader.parse(text)
    model = models.modes.model.system(design)
    found = mode_families.solve_modes(model)
    ranked = families.ranked(found.energy)
    place = np.array(find_places(quantities, ranked, lambda: follow(found, model)), dtype=int)

    def value(item: Quantity, place: int) -> float:
        if isinstance(item, OfMode):
            every = found.top_fraction if item.fraction else found.frequency
            return np.nan if place < 0 else float(every[place])
        if isinstance(item, OfResponse):
            return _response(design, item, models.of(item))
        return _stress(design, item.part) if isinstance(item, OfPart) else _depth(design, item)

    values = [value(item, n) for item, n in zip(quantities, place, strict=True)]
    return Achieved(np.array(values), place, found, ranked)


def _response(design: Design, item: OfResponse, level: str) -> float:
    """Magnitude of a response, SI."""
    model = registry.by_name(level).system(with_imperfections(design, item.perturbation))
    outputs = [item.ratio.over] + ([] if item.ratio.under is None else [item.ratio.under])
    found = response.solve(model, np.array([item.ratio.frequency]), [item.ratio.input], outputs)
    size = np.abs(found.value[0, :, 0])
    return float(size[0] if len(size) == 1 else size[0] / size[1] if size[0] else 0.0)


def _stress(design: Design, part: Part) -> float:
    """Stress of a wire or blade in equilibrium, as a fraction of its tensile strength."""
    if part.blade:
        scene = expand(design)
        return loads.stress(design, scene, equilibrium.solve(scene).pose, part).real
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
