"""Wires, blades, springs and supports without loss, which add no thermal noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design import materials
from suspension_cli.design.materials import mechanisms_of
from suspension_cli.design.schema import Design
from suspension_cli.design.wires import AnyWire
from suspension_cli.models import registry

MOST_PARTS = 10
"""Most parts that a warning lists."""
Lack = tuple[tuple[str, ...], tuple[str, ...]]
"""Materials of a part without bulk loss, and its losses that act only in bending."""


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
    lack = partial(_lack, design, level)
    found = list[Lossless]()
    frame = design.support
    if frame and not frame.loss_angle and not any(getattr(frame.damping, dof) for dof in DOFS):
        found.append(Lossless(SUPPORT))
    for stage in design.stage:
        blades: dict[str, Lack | None] = {}
        for blade in stage.blade_tables:
            lacking = lack([blade.made_of], blade.loss_angle)
            thick = blade.thickness is not None or blade.geometry is not None
            blades[getattr(blade, "name", "")] = lacking and (lacking[0], lacking[1] * thick)
        wires = {
            str(number): lack(
                [wire.material, *(one.material for one in wire.sections or ())], wire=wire
            )
            for number, wire in enumerate(stage.wire_tables, 1)
        }
        for word, parts in (("blades", blades), ("wires", wires)):
            if len({*parts.values()}) == 1:
                parts = {word: next(iter(parts.values()))}
            found += [Lossless(f"{stage.name}.{name}", *own) for name, own in parts.items() if own]
        if any(
            lack([spring.material], spring.loss_angle)
            for spring in stage.spring
            if _nonzero(spring.stiffness) and not _nonzero(spring.damping)
        ):
            found.append(Lossless(f"{stage.name}.springs"))
        for name in ("inverted_pendulum", "filter"):
            part = getattr(stage, name)
            if part is not None and not part.loss_angle and part.q is None:
                found.append(Lossless(f"{stage.name}.{name}"))
    for link in design.link:
        if link.table is None and not _nonzero(link.damping):
            material = link.made_of if link.loss_angle is None else None
            if own := lack([material], link.loss_angle):
                found.append(Lossless(f"{link.name}.link", *own))
    return found


def _lack(
    design: Design,
    level: str,
    names: Sequence[str | None],
    own: float | None = None,
    wire: AnyWire | None = None,
) -> Lack | None:
    """Materials without bulk loss, and losses in bending, of a part; None if it has bulk loss.

    The part is of materials `names`, or has a loss angle of its `own`.
    """
    given = tuple(sorted({name for name in names if name is not None}))
    if own:
        return None
    if not registry.by_name(level).bends_wires:
        lossy = own is None and any(materials.constant_angle(design, name) for name in given)
        return None if lossy else (given, ())
    losses = {name: mechanisms_of(materials.look_up(design, name), wire) for name in given}
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
    return lacking, tuple(bending)


def _nonzero(matrix: list[float | list[float]] | None) -> bool:
    return any(any(row) if isinstance(row, list) else bool(row) for row in matrix or ())


def describe_lossless(found: list[Lossless], level: str) -> list[str]:
    """Describe parts without loss in the model `level`, and parts with loss only in bending."""
    own = f" in the {level} model, which uses only loss angles given in the design"
    own *= not registry.by_name(level).bends_wires
    names = " and ".join(dict.fromkeys(name for one in found for name in one.bending))
    kinds = (
        (False, f"no loss{own}", "they add no thermal noise and do not limit Q"),
        (
            True,
            f"no bulk loss, only {names} loss where they bend",
            "thermal noise is too low and Q too high",
        ),
    )
    lines = []
    for bends, what, effect in kinds:
        parts = [one for one in found if bool(one.bending) == bends]
        made = sorted({f"materials.{name}.loss_angle" for one in parts for name in one.material})
        if others := ", ".join(one.part for one in parts if not one.material):
            made.append(f"loss_angle of {others}")
        words = [one.part + f" ({', '.join(one.material)})" * bool(one.material) for one in parts]
        if len(words) > MOST_PARTS:
            words[MOST_PARTS - 1 :] = [f"{len(words) - MOST_PARTS + 1} more"]
            words[-2:] = [" and ".join(words[-2:])]
        if parts:
            lines.append(f"{what}: {', '.join(words)}; {effect}; give {' and '.join(made)}")
    return lines
