"""What a design achieves of what goals ask, by the ordinary analyses alone: nothing here comes from the search.

Modes as `pendsus modes` solves them, responses as `pendsus response`, tensions as `pendsus check`, each on the rung that `auto` takes for it unless another is
asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.analysis import auto, modes, response, statics, wire_modes
from suspension_cli.analysis.asked import Asked, Frequencies, Transfer
from suspension_cli.analysis.modes import Modes
from suspension_cli.analysis.optimise import loads
from suspension_cli.analysis.optimise.families import Families
from suspension_cli.analysis.optimise.loads import Part
from suspension_cli.analysis.optimise.quantities import OfDepth, OfMode, OfPart, OfResponse, Quantity
from suspension_cli.analysis.optimise.valued import with_imperfections
from suspension_cli.design import materials, reader
from suspension_cli.design.derive import com_positions
from suspension_cli.design.scene import Array
from suspension_cli.design.schema import Design
from suspension_cli.mechanics import equilibrium
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.mechanics.nominal import expand
from suspension_cli.models import fidelity
from suspension_cli.models.fidelity import Choice


@dataclass(frozen=True)
class Achieved:
    """Quantities of one design.

    Attributes
    ----------
    value : (q,) array
        NaN for an unstable mode, and for one that cannot be followed to this design.
    place : (q,) int array
        The mode that each is about, from 0; -1 for other quantities.
    modes : Modes
    ranked : list of int arrays
        Places of each family's modes, in ascending order.
    choice : Choice
        The rung of the modes.
    """

    value: Array
    place: Any
    modes: Modes
    ranked: list[Any]
    choice: Choice


def of(text: str, quantities: tuple[Quantity, ...], families: Families, level: str, follow: Callable[[Modes, Array], Any]) -> Achieved:
    """Work out quantities of a design.

    Parameters
    ----------
    text : str
        The design as TOML.
    quantities : tuple of Quantity
    families : Families
        Of the design that quantities were named in.
    level : str
        Rung of the ladder of models, or ``auto``.
    follow : callable
        Which of some modes (with their mass matrix) each mode of the starting design has become; -1 where there is no telling.
    """
    design = reader.parse(text)
    choice, model = _built(design, lambda _: Frequencies(), level)
    found = modes.solve(model)
    if choice.level == "violin":
        found = _of_bodies(wire_modes.solve(model, float(np.nanmax(found.frequency))))  # the mass of wires lowers all frequencies
    ranked = families.ranked(found.energy)
    named = any(isinstance(item, OfMode) and item.number >= 0 for item in quantities)
    followed = follow(found, model.basis @ model.mass @ model.basis.T) if named else None
    value, place = np.empty(len(quantities)), np.full(len(quantities), -1)
    for n, item in enumerate(quantities):
        if isinstance(item, OfMode):
            place[n] = _ranked(ranked[item.family], item.rank) if item.number < 0 or followed is None else followed[item.number]
            value[n] = np.nan if place[n] < 0 else (found.top_share if item.share else found.frequency)[place[n]]
        elif isinstance(item, OfResponse):
            value[n] = _response(design, item, level)
        elif isinstance(item, OfPart):
            value[n] = _stress(design, item.part)
        else:
            value[n] = _depth(design, item)
    return Achieved(value, place, found, ranked, choice)


def _of_bodies(found: Modes) -> Modes:
    """The modes that are none of wires alone."""
    return found.some(found.order == 0)


def _ranked(places: Any, rank: int) -> int:
    """The place of a family's mode of some rank; -1 if there is none."""
    return int(places[rank]) if rank < len(places) else -1


def _built(design: Design, make: Callable[[LinearModel], Asked], level: str) -> tuple[Choice, LinearModel]:
    """The rung asked for, or that which `auto` takes, and its model."""
    if level == "auto":
        decision = auto.decide(design, make)
        return decision.choice, decision.model
    choice = fidelity.choose(design, level)
    return choice, fidelity.linear_model(design, choice.level)


def _response(design: Design, item: OfResponse, level: str) -> float:
    """Size of a response."""
    outputs = [item.ratio.over] + ([] if item.ratio.under is None else [item.ratio.under])
    inputs, frequency = [item.ratio.input], np.array([item.ratio.frequency])
    built = with_imperfections(design, item.perturbation)
    _, model = _built(built, lambda _: Transfer(inputs, outputs, frequency), level)
    size = np.abs(response.solve(model, frequency, inputs, outputs).value[0, :, 0])
    return float(size[0] if len(size) == 1 else size[0] / size[1] if size[0] else 0.0)


def _stress(design: Design, part: Part) -> float:
    """Stress of a wire or blade over what breaks it, from the loads of the static answer."""
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
    """How far below the suspension point a stage hangs, m."""
    shift = next(body.shift for body in statics.solve(design).bodies if body.name == item.stage)
    return -(com_positions(design)[item.stage][2] + shift[2])
