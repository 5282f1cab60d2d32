"""Wires, blades, springs and supports without loss, which add no thermal noise."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design import materials
from suspension_cli.design.derive import blade_loss, blade_material, spring_loss
from suspension_cli.design.links import Link
from suspension_cli.design.losses.mechanism import Mechanism
from suspension_cli.design.losses.registry import mechanisms_of
from suspension_cli.design.schema import Design, Spring, Stage
from suspension_cli.design.wires import Blade, BladeSet, Wire, WireSet
from suspension_cli.models import registry
from suspension_cli.scene.links import link_loss

BENDING = tuple(model.name for model in registry.MODELS if model.bends_wires)
"""Models in which wires bend, with the losses of their materials."""


@dataclass(frozen=True)
class Lossless:
    """A part without bulk loss.

    Attributes
    ----------
    part : str
        ``test.wires``, ``upper.blades``, ``marionette.springs``, ``support``; a single wire
        (``bench.3``) or blade if others of its stage have loss.
    material : tuple of str
        Its materials without bulk loss; empty if the design names none.
    bending : tuple of str
        Its losses that act only in bending; empty if nothing dissipates.
    """

    part: str
    material: tuple[str, ...] = ()
    bending: tuple[str, ...] = ()


def find_lossless(design: Design, level: str) -> list[Lossless]:
    """Find the parts of a design without bulk loss in the model `level`, from top to bottom.

    Models in which wires bend use all losses of materials, others only constant loss angles given
    in the design.
    """
    found: list[Lossless] = []
    frame = design.support
    if frame and not frame.loss_angle and not any(getattr(frame.damping, dof) for dof in DOFS):
        found.append(Lossless(SUPPORT))
    for stage in design.stage:
        blades = [stage.blades] if stage.blades is not None else stage.blade
        names = ["" if isinstance(blade, BladeSet) else blade.name for blade in blades]
        lacking = [_check_blade(design, blade, level) for blade in blades]
        found += _merge_parts(stage, "blades", names, lacking)
        wires = [stage.wires] if stage.wires is not None else stage.wire
        lacking = [_check_wire(design, wire, level) for wire in wires]
        found += _merge_parts(stage, "wires", [str(n + 1) for n in range(len(wires))], lacking)
        if any(_is_lossless(design, spring, level) for spring in stage.spring):
            found.append(Lossless(f"{stage.name}.springs"))
        for name in ("inverted_pendulum", "filter"):
            part = getattr(stage, name)
            if part is not None and not part.loss_angle and part.q is None:
                found.append(Lossless(f"{stage.name}.{name}"))
    for link in design.link:
        if link.table is None and not _nonzero(link.damping):
            found += _check_link(design, link, level)
    return found


def _check_link(design: Design, link: Link, level: str) -> Iterator[Lossless]:
    """Yield a link without damping if it has no bulk loss."""
    label, strands = f"{link.name}.link", link.strands
    if link.loss_angle is not None or strands is None:
        if not link.loss_angle:
            yield Lossless(label)
    elif not registry.by_name(level).bends_wires:
        if not link_loss(design, link):
            yield Lossless(label, (strands.material,))
    elif not _bulk(losses := _losses(design, strands.material, None)):
        yield Lossless(label, (strands.material,), tuple(_in_bending(losses)))


def _merge_parts(
    stage: Stage, word: str, names: list[str], lacking: Sequence[Lossless | None]
) -> Iterator[Lossless]:
    """Merge parts of one kind of a stage if all lack the same."""
    first = lacking[0] if lacking else None
    if first is not None and all(one == first for one in lacking):
        yield replace(first, part=f"{stage.name}.{word}")
        return
    for name, one in zip(names, lacking, strict=True):
        if one is not None:
            yield replace(one, part=f"{stage.name}.{name}")


def _check_wire(design: Design, wire: WireSet | Wire, level: str) -> Lossless | None:
    """Return a wire, without its name, if it has no bulk loss."""
    given = {wire.material, *(piece.material for piece in wire.sections or ())}
    names = tuple(sorted(name for name in given if name is not None))
    if not registry.by_name(level).bends_wires:
        lossy = any(materials.constant_angle(design, name) for name in names)
        return None if lossy else Lossless("", names)
    losses = {name: _losses(design, name, wire) for name in names}
    lacking = tuple(name for name in names if not _bulk(losses[name]))
    if not lacking:
        return None
    bending = dict.fromkeys(own for name in names for own in _in_bending(losses[name]))
    if len(lacking) < len(names):
        bending = bending or {"other sections'": None}
    return Lossless("", lacking, tuple(bending))


def _check_blade(design: Design, blade: BladeSet | Blade, level: str) -> Lossless | None:
    """Return a blade, without its name, if it has no bulk loss."""
    name = blade_material(blade)
    given = () if name is None else (name,)
    if not registry.by_name(level).bends_wires:
        return None if blade_loss(design, blade) else Lossless("", given)
    losses = () if name is None else _losses(design, name, None)
    if blade.loss_angle or (blade.loss_angle is None and _bulk(losses)):
        return None
    thick = blade.thickness is not None or blade.geometry is not None
    return Lossless("", given, _in_bending(losses) if thick else ())


def _is_lossless(design: Design, spring: Spring, level: str) -> bool:
    """Whether a spring is elastic and dissipates nothing."""
    stiff, damped = (_nonzero(matrix) for matrix in (spring.stiffness, spring.damping))
    lossy = bool(spring_loss(design, spring))
    if spring.material is not None and registry.by_name(level).bends_wires:
        lossy = lossy or _bulk(_losses(design, spring.material, None))
    return stiff and not damped and not lossy


def _nonzero(matrix: list[float | list[float]] | None) -> bool:
    return any(any(row) if isinstance(row, list) else bool(row) for row in matrix or ())


def _bulk(losses: tuple[Mechanism, ...]) -> bool:
    """Whether a loss acts in every deformation."""
    return any(own.uniform for own in losses)


def _in_bending(losses: tuple[Mechanism, ...]) -> tuple[str, ...]:
    """Names of the losses that act only in bending."""
    return tuple(own.name for own in losses if not own.uniform and own.acts_unstrained)


def _losses(design: Design, name: str, wire: WireSet | Wire | None) -> tuple[Mechanism, ...]:
    return mechanisms_of(materials.resolve(design, name), wire)
