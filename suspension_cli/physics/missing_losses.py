"""Losses that a material of a design lacks because the file does not give their constants.

A material that a design gives with a loss angle alone has no thermoelastic loss and no loss of its
surface. If its modulus and density are those of a built-in material, the size of what is missing
follows from the constants of that one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from suspension_cli.design import materials
from suspension_cli.design.materials import CONSTANTS, Bulk, Material, value_at
from suspension_cli.design.schema import Design
from suspension_cli.models.choice import percent
from suspension_cli.models.registry import Choice
from suspension_cli.physics.temperatures import list_uses

if TYPE_CHECKING:
    from suspension_cli.scene.arrays import Array

ALIKE = 0.05
"""Largest relative difference of modulus and of density between a material and a built-in one of
the same kind: alloys of steel differ by less, other materials by more."""
Results = Callable[[Design], "tuple[Array, str]"]
"""Results of a design, positive (at a few frequencies), and what they are."""


@dataclass(frozen=True)
class MissingLoss:
    """Losses that a material lacks.

    Attributes
    ----------
    material
        Its name.
    kinds
        ``surface``, ``thermoelastic``.
    keys
        Keys of [materials.NAME] that would give them.
    like
        Built-in material of the same modulus and density; "" if there is none.
    completed
        The material's table with the constants of that one; None without it.
    """

    material: str
    kinds: tuple[str, ...]
    keys: tuple[str, ...]
    like: str = ""
    completed: Material | None = None

    @property
    def words(self) -> str:
        """Which losses of which material."""
        return f"{' and '.join(self.kinds)} loss of {self.material}"


def find_missing_losses(design: Design) -> list[MissingLoss]:
    """Find the losses that the materials of wires, blades and links of a design lack.

    Of materials that have a loss of the bulk; `lossless` finds those without. A loss that the
    design turns off (``thermoelastic = false``, ``surface_depth = 0.0``) is not missing.
    """
    names = dict.fromkeys(use.material for use in list_uses(design) if use.bulk and use.stiffness)
    found = []
    for name in names:
        material = materials.look_up(design, name)
        loss = material.loss
        if name not in design.materials or loss is None or Bulk.of(material, None) is None:
            continue
        like = _find_alike(design, material)
        built_in = materials.BUILT_IN.get(like, Material())
        keys = [key for key in CONSTANTS if getattr(material, key) is None]
        given: dict[str, object] = {key: getattr(built_in, key) for key in keys}
        if loss.thermoelastic is False:
            keys = []
        kinds = ["thermoelastic"] if keys else []
        if keys and material.modulus_slope is None:
            given["modulus_slope"] = built_in.modulus_slope
        depth = _surface_depth(material, built_in)
        if depth:
            kinds = ["surface", *kinds]
            keys = ["loss.surface_depth", *keys]
            given["loss"] = msgspec.structs.replace(loss, surface_depth=depth)
            given["loss_angle"] = None
        if not kinds:
            continue
        known = bool(like) and None not in (given.get(key) for key in keys if "." not in key)
        completed = msgspec.structs.replace(design.materials[name], **given) if known else None
        found.append(MissingLoss(name, tuple(kinds), tuple(keys), like * known, completed))
    return found


def _find_alike(design: Design, material: Material) -> str:
    """Name the built-in material nearest in modulus and density; "" if none is `ALIKE`."""
    temperature = design.constants.temperature
    if material.youngs_modulus is None or material.density is None:
        return ""
    modulus = value_at(material.youngs_modulus, temperature)
    best = (ALIKE, "")
    for name, other in materials.BUILT_IN.items():
        assert other.youngs_modulus is not None and other.density is not None
        stiffness = abs(modulus / value_at(other.youngs_modulus, temperature) - 1)
        difference = max(stiffness, abs(material.density / other.density - 1))
        best = min(best, (difference, name))
    return best[1]


def _surface_depth(material: Material, built_in: Material) -> float:
    """Depth (m) that gives a material the surface loss of a built-in one; 0 if it lacks none."""
    own = material.loss
    other = built_in.loss
    if own is None or other is None or own.surface_depth is not None or not own.angle:
        return 0.0
    return (other.surface_depth or 0.0) * (other.angle or 0.0) / own.angle


@dataclass(frozen=True)
class Neglected:
    """What materials lack, beside the model.

    Attributes
    ----------
    choice
        The choice of model; what it neglects includes these losses.
    losses
        Which losses of which material, and how large they are.
    warnings
        The same with what to do, one line each.
    """

    choice: Choice
    losses: list[str]
    warnings: list[str]


def state_missing_losses(
    design: Design, choice: Choice, compute: Results, tolerance: float
) -> Neglected:
    """Add the losses that materials lack to what a choice of model neglects.

    `compute` gives the results of a design. Where a built-in material is like the one of the
    design, the results with its constants show how large the missing loss is; it is passed over if
    below the tolerance.
    """
    sizes = list[str]()
    warnings = list[str]()
    error = choice.error
    what = ""
    missing = find_missing_losses(design)
    before, _ = compute(design) if any(one.completed for one in missing) else (np.ones(1), "")
    for one in missing:
        if one.completed is None:
            size = "of unknown size"
            effect = "thermal noise is too low and Q too high"
        else:
            tables = design.materials | {one.material: one.completed}
            after, what = compute(msgspec.structs.replace(design, materials=tables))
            ratio = np.maximum(after / before, before / after)
            if not ratio.max() > 1 + tolerance:
                continue
            size = f"a factor of {ratio.max():.3g}"
            if ratio.max() < 2:
                size = percent(float(ratio.max()) - 1)
            effect = f"{size} in {what} with the values of {one.like}"
            error = max(error, float(ratio.max()) - 1)
        sizes.append(f"{one.words} ({size})")
        remedy = f"give {', '.join(one.keys)} in [materials.{one.material}]"
        if one.like not in ("", one.material):
            remedy += f', or take material = "{one.like}"'
        name = design.design.name
        warnings.append(f"{name}: the file does not give the {one.words}: {effect}; {remedy}")
    of_what = f" in {what}" * bool(what)
    return Neglected(_amended(choice, sizes, of_what, error), sizes, warnings)


def _amended(choice: Choice, found: list[str], of_what: str, error: float) -> Choice:
    """The choice with more that is neglected."""
    if not found:
        return choice
    why, _, rest = choice.reason.partition("; ")
    if not rest and choice.error != 0 and (omitted := " and ".join(choice.model.omits)):
        rest = f"neglected: {omitted}, of unknown effect"
    word = "and" if rest.startswith("neglected: ") else "neglected:"
    added = f"{word} {', '.join(found)}{of_what}"
    reason = "; ".join(filter(None, (why, rest, added)))
    error = math.nan if math.isnan(choice.error) else error
    return replace(choice, reason=reason, error=error)
