"""Wires, blades, springs and supports without loss, which add no thermal noise."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design import materials
from suspension_cli.design.materials import mechanisms_of
from suspension_cli.design.schema import Design, Stage
from suspension_cli.design.wires import AnyWire
from suspension_cli.models import registry

MOST_PARTS = 10
"""Most parts that a warning lists."""


@dataclass(frozen=True)
class Lossless:
    """A part without bulk loss.

    Attributes
    ----------
    part
        ``test.wires``, ``upper.blades``, ``marionette.springs``, ``support``; a single wire
        (``bench.3``) or blade if others of its stage have loss.
    material
        Its materials without bulk loss; empty if the design names none.
    bending
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
    return [one for one in _every_part(design, level) if one is not None]


def _every_part(design: Design, level: str) -> Iterator[Lossless | None]:
    """All parts of a design, None for each with loss."""
    frame = design.support
    if frame and not frame.loss_angle and not any(getattr(frame.damping, dof) for dof in DOFS):
        yield Lossless(SUPPORT)
    for stage in design.stage:
        yield from _merge_equal(stage, "blades", _blades(design, stage, level))
        yield from _merge_equal(stage, "wires", _wires(design, stage, level))
        if any(
            _part(design, level, "", spring.material, own=spring.loss_angle)
            for spring in stage.spring
            if _nonzero(spring.stiffness) and not _nonzero(spring.damping)
        ):
            yield Lossless(f"{stage.name}.springs")
        for name in ("inverted_pendulum", "filter"):
            part = getattr(stage, name)
            if part is not None and not part.loss_angle and part.q is None:
                yield Lossless(f"{stage.name}.{name}")
    for link in design.link:
        if link.table is None and not _nonzero(link.damping):
            material = link.strands.material if link.strands and link.loss_angle is None else None
            yield _part(design, level, f"{link.name}.link", material, own=link.loss_angle)


def _wires(design: Design, stage: Stage, level: str) -> Iterator[Lossless | None]:
    """List the wires of a stage without bulk loss, None for each of the others."""
    for number, wire in enumerate(stage.wire_tables, 1):
        names = [wire.material, *(piece.material for piece in wire.sections or ())]
        yield _part(design, level, f"{stage.name}.{number}", *names, wire=wire)


def _blades(design: Design, stage: Stage, level: str) -> Iterator[Lossless | None]:
    """List the blades of a stage without bulk loss, None for each of the others."""
    for blade in stage.blade_tables:
        name = f"{stage.name}.{getattr(blade, 'name', 'blades')}"
        found = _part(design, level, name, blade.made_of, own=blade.loss_angle)
        thick = blade.thickness is not None or blade.geometry is not None
        yield found if found is None or thick else replace(found, bending=())


def _merge_equal(
    stage: Stage, word: str, parts: Iterable[Lossless | None]
) -> list[Lossless | None]:
    """Merge the parts of one kind of a stage into one if all lack the same."""
    parts = [*parts]
    whole = [one and replace(one, part=f"{stage.name}.{word}") for one in parts]
    return whole[:1] if len(set(whole)) == 1 else parts


def _part(
    design: Design,
    level: str,
    part: str,
    *names: str | None,
    own: float | None = None,
    wire: AnyWire | None = None,
) -> Lossless | None:
    """Return a part of materials `names`, or of a loss angle `own`, if it has no bulk loss."""
    given = tuple(sorted({name for name in names if name is not None}))
    if own:
        return None
    if not registry.by_name(level).bends_wires:
        lossy = own is None and any(materials.constant_angle(design, name) for name in given)
        return None if lossy else Lossless(part, given)
    losses = {name: mechanisms_of(materials.resolve(design, name), wire) for name in given}
    lacking = tuple(
        name for name in given if own == 0 or not any(loss.uniform for loss in losses[name])
    )
    if not lacking and (given or wire is not None):
        return None
    every = [loss for name in given for loss in losses[name]]
    bending = dict.fromkeys(
        loss.name for loss in every if not loss.uniform and loss.acts_unstrained
    )
    if len(lacking) < len(given):
        bending = bending or {"other sections'": None}
    return Lossless(part, lacking, tuple(bending))


def _nonzero(matrix: list[float | list[float]] | None) -> bool:
    return any(any(row) if isinstance(row, list) else bool(row) for row in matrix or ())


def describe_lossless(found: list[Lossless], level: str) -> list[str]:
    """Describe parts without loss in the model `level`, and parts with loss only in bending."""
    lines = []
    nothing = [one for one in found if not one.bending]
    partial = [one for one in found if one.bending]
    if nothing:
        own = f" in the {level} model, which uses only loss angles given in the design"
        own *= not registry.by_name(level).bends_wires
        lines.append(
            f"no loss{own}: {_parts(nothing)}; they add no thermal noise and do not limit Q;"
            f" {_remedy(nothing)}"
        )
    if partial:
        names = " and ".join(dict.fromkeys(name for one in partial for name in one.bending))
        lines.append(
            f"no bulk loss, only {names} loss where they bend: {_parts(partial)};"
            f" thermal noise is too low and Q too high; {_remedy(partial)}"
        )
    return lines


def _remedy(found: list[Lossless]) -> str:
    """Name the keys that give these parts a loss."""
    made = sorted({f"materials.{name}.loss_angle" for one in found for name in one.material})
    others = [one.part for one in found if not one.material]
    return "give " + " and ".join(made + ([f"loss_angle of {', '.join(others)}"] if others else []))


def _parts(found: list[Lossless]) -> str:
    """List at most `MOST_PARTS` parts with materials: ``upper.blades, test.wires (steel302)``."""
    shown = found if len(found) <= MOST_PARTS else found[: MOST_PARTS - 1]
    listed = ", ".join(
        one.part + (f" ({', '.join(one.material)})" if one.material else "") for one in shown
    )
    return listed + (f" and {len(found) - len(shown)} more" if len(shown) < len(found) else "")
