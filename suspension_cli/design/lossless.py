"""Wires, blades, springs and supports that dissipate nothing in a model, and so add nothing to its thermal noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design import materials
from suspension_cli.design.derive import blade_loss, blade_material
from suspension_cli.design.schema import Design, Spring, Stage
from suspension_cli.design.wires import Blade, BladeSet, Wire, WireSet

BENDING = ("beam", "violin")
"""Models in which wires bend, so that the losses of their materials act; the others know constant angles of the design alone."""


@dataclass(frozen=True)
class Lossless:
    """A part without loss.

    Attributes
    ----------
    part : str
        ``test.wires``, ``upper.blades``, ``marionette.springs``, ``support``; one wire (``bench.3``) or blade where the others have loss.
    material : tuple of str
        Its materials without bulk loss; none where the design names none.
    thermoelastic : bool
        Whether it has thermoelastic loss where it bends, and only lacks loss of the bulk.
    """

    part: str
    material: tuple[str, ...] = ()
    thermoelastic: bool = False


def without_loss(design: Design, level: str) -> list[Lossless]:
    """The parts of a design without loss of the bulk.

    Parameters
    ----------
    design : Design
    level : str
        The model, as in `models.fidelity.LEVELS`.

    Returns
    -------
    list of Lossless
        From top to bottom.
    """
    found: list[Lossless] = []
    if design.support is not None and not design.support.loss_angle and not any(getattr(design.support.damping, dof) for dof in DOFS):
        found.append(Lossless(SUPPORT))
    for stage in design.stage:
        blades = [stage.blades] if stage.blades is not None else stage.blade
        names = ["" if isinstance(blade, BladeSet) else blade.name for blade in blades]
        found += _gathered(stage, "blades", names, [_blade(design, blade, level) for blade in blades])
        wires = [stage.wires] if stage.wires is not None else stage.wire
        found += _gathered(stage, "wires", [str(n) for n, _ in enumerate(wires, 1)], [_wire(design, wire, level) for wire in wires])
        found += [Lossless(f"{stage.name}.springs")] if any(_spring(spring) for spring in stage.spring) else []
    return found


def _gathered(stage: Stage, word: str, names: list[str], lacking: Sequence[Lossless | None]) -> Iterator[Lossless]:
    """The parts of one kind of a stage: in one word where all lack the same."""
    if lacking and all(one is not None and one == lacking[0] for one in lacking):
        yield Lossless(f"{stage.name}.{word}", lacking[0].material, lacking[0].thermoelastic)  # type: ignore[union-attr]
        return
    for name, one in zip(names, lacking, strict=True):
        if one is not None:
            yield Lossless(f"{stage.name}.{name}", one.material, one.thermoelastic)


def _wire(design: Design, wire: WireSet | Wire, level: str) -> Lossless | None:
    pieces = wire.sections or ()
    names = tuple(sorted({name for name in (*(piece.material for piece in pieces), wire.material) if name is not None}))
    if level not in BENDING:
        return None if any(materials.constant_angle(design, name) for name in names) else Lossless("", names)
    lacking = tuple(name for name in names if not _bulk(design, name))
    return Lossless("", lacking, any(_warm(design, name) or _bulk(design, name) for name in names)) if lacking else None


def _blade(design: Design, blade: BladeSet | Blade, level: str) -> Lossless | None:
    name = blade_material(blade)
    given = () if name is None else (name,)
    if level not in BENDING:
        return None if blade_loss(design, blade) else Lossless("", given)
    bulk = blade.loss_angle if blade.loss_angle is not None else name is not None and _bulk(design, name)
    thick = blade.thickness is not None or blade.geometry is not None
    return None if bulk else Lossless("", given, name is not None and thick and _warm(design, name))


def _spring(spring: Spring) -> bool:
    """Whether a spring is elastic and dissipates nothing."""
    stiff, damped = (_nonzero(matrix) for matrix in (spring.stiffness, spring.damping))
    return stiff and not damped and not spring.loss_angle


def _nonzero(matrix: list[float | list[float]] | None) -> bool:
    return any(any(row) if isinstance(row, list) else bool(row) for row in matrix or ())


def _bulk(design: Design, name: str) -> bool:
    """Whether a material has a loss angle of the bulk."""
    loss = materials.resolve(design, name).loss
    return loss is not None and bool(loss.table is not None or loss.angle)


def _warm(design: Design, name: str) -> bool:
    """Whether a material has thermoelastic loss: all that it takes is known, and it is not switched off."""
    material = materials.resolve(design, name)
    needed = (material.density, material.thermal_expansion, material.specific_heat, material.thermal_conductivity)
    return None not in needed and material.thermal_expansion != 0 and not (material.loss is not None and material.loss.thermoelastic is False)
