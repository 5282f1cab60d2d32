"""Locked stages: a design in which they, and the stages above them, are part of the support.

A locked stage is clamped to the support structure in its nominal place. What hangs from it hangs
from the support instead, at the same points in space, so the coordinates of the locked stage do not
exist, in any model. The stages above cannot move what hangs below the clamps, and are left out.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from msgspec.structs import replace

from suspension_cli.conventions import BETWEEN, GROUND, SUPPORT
from suspension_cli.design.control import Control, Loop
from suspension_cli.design.derive import (
    Point,
    add_keystones,
    add_points,
    origin_positions,
    with_bodies_above,
)
from suspension_cli.design.heat_flow import complete, reduce_to_file
from suspension_cli.design.links import Cavity, Damper, Link, Strands
from suspension_cli.design.loop_sensors import Sensor
from suspension_cli.design.schema import Design, Stage
from suspension_cli.design.typed_tables import Problems
from suspension_cli.errors import Fault, InputError, format_value

Joint = TypeVar("Joint", Link, Damper, Cavity)


class PartlyLocked(Design, frozen=True):
    """A design without its locked stages: what hangs from these hangs from the support."""

    in_file: Design
    """The design with all stages, keystones of filters too."""


def spell_out(design: Design) -> Design:
    """Spell out the design of a file: complete it (`heat_flow`), remove locked stages."""
    whole = complete(design)
    held = find_held(whole)
    return _without(whole, held) if held else whole


def as_in_file(design: Design) -> Design:
    """Undo the removal of locked stages by `spell_out`; keystones stay."""
    return design.in_file if isinstance(design, PartlyLocked) else design


def undo(design: Design) -> Design:
    """Undo all of `spell_out`: the design as the file gives it."""
    return reduce_to_file(as_in_file(design))


def locked_names(design: Design) -> list[str]:
    """List the stages that do not move: those that are locked, and those above them."""
    return find_held(as_in_file(design))


def title_of(design: Design) -> str:
    """Title of a design, or its name, and which stages do not move."""
    title = design.design.title or design.design.name
    held = locked_names(design)
    return f"{title}, {', '.join(held)} locked" if held else title


def requirements_at_rest(design: Design) -> list[str]:
    """List the quantities of requirements without effect, as they are those of stages at rest."""
    return [row.quantity for row in as_in_file(design).requirement if row not in design.requirement]


def find_held(design: Design) -> list[str]:
    """List the locked stages of a design with its keystones, and all stages above them."""
    if not any(stage.locked for stage in design.stage):
        return []
    above = {stage.name: parent for stage, parent in with_bodies_above(design)}
    held: set[str] = set()
    for stage in design.stage:
        name = stage.name if stage.locked else SUPPORT
        while name != SUPPORT:
            held.add(name)
            name = above[name]
    return [name for name in above if name in held]


def check_locked(design: Design) -> Problems:
    """Check that a stage is free, and that what hangs from locked ones can hang from the support.

    `design` has no faults of its tables, no keystones yet, and perhaps faults of `[heat]`.
    """
    if not any(stage.locked for stage in design.stage):
        return
    whole = add_keystones(design)
    held = find_held(whole)
    locked = {stage.name: stage.locked for stage in whole.stage}
    lowest = [stage.name for stage in whole.stage if stage.locked][-1]
    place = origin_positions(whole)
    if len(held) == len(whole.stage):
        problem = "leaves nothing that moves: the stages above a locked one are held too"
        yield f"stage.{lowest}.locked", problem, "remove it, or lock a stage above"
        return
    yield from _check_control(design.control, held)
    for stage, above in with_bodies_above(whole):
        if above not in held or stage.name in held:
            continue
        if not locked[above]:
            problem = f"is held, as {lowest} below it is locked, but {stage.name} hangs from it too"
            yield f"stage.{above}.locked", problem, "give locked = true here too, if it is clamped"
        if stage.wires is not None and (place[above][0] != 0 or place[above][1] != 0):
            problem = f"hangs by a symmetric set from {above}, which is locked beside the z axis"
            remedy = "give its wires one by one, as [[stage.wire]]"
            yield f"stage.{stage.name}.wires", problem, remedy
        if stage.inverted_pendulum is not None:
            problem = f"stands on {above}, which is locked"
            remedy = f"remove {above}, so that it stands on the support"
            yield f"stage.{stage.name}.inverted_pendulum", problem, remedy


def _check_control(control: Control | None, held: Sequence[str]) -> Problems:
    """Refuse inertial sensors of locked stages, which move with the support."""
    if control is None:
        return
    problem = "senses a locked stage against inertial space: the support"
    for loop in control.loop:
        own = control.named_sensor(loop) is None and _part_of(held, loop.sensor)
        if own and loop.reference == "inertial":
            yield f"control.loop.{loop.name}.sensor", problem, "remove the loop"
    for sensor in control.sensor:
        for text in sensor.motions:
            if _part_of(held, text) and not _against(text):
                yield f"control.sensor.{sensor.name}.motion", problem, "write support there"


def refuse_locked(design: Design, given: Mapping[str, Sequence[str]]) -> None:
    """Raise `InputError` for names of signals or quantities that are those of a stage at rest.

    `given` are the names by the option that gave them.
    """
    held = locked_names(design)
    faults = [
        Fault(
            option,
            f"{stage} is locked, so it is at rest and has no such result",
            f"name a stage that moves, or remove locked = true of {stage} or below it",
            format_value(text),
        )
        for option, texts in given.items()
        for text in texts
        for stage in _named(held, text)[:1]
    ]
    if faults:
        raise InputError(faults)


def _named(held: Sequence[str], text: str) -> list[str]:
    """List the held stages that the name of a signal or quantity has as a word."""
    words = re.findall(r"[\w-]+", text)
    return [stage for stage in held if stage in words]


def _without(whole: Design, held: Sequence[str]) -> PartlyLocked:
    """Make the design without its held stages."""
    place = origin_positions(whole)
    stages = [
        _hung(stage, above, held, place[above])
        for stage, above in with_bodies_above(whole)
        if stage.name not in held
    ]

    def free(rows: Sequence[Any], *keys: str) -> list[Any]:
        """Rows that name no part of a held stage."""
        return [row for row in rows if not any(_part_of(held, getattr(row, key)) for key in keys)]

    tolerance = whole.tolerance
    if tolerance is not None:
        scattered = {
            part: free(getattr(tolerance, part), *keys)
            for part, keys in (
                ("wire", ("stage", "wire")),
                ("body", ("stage",)),
                ("blade", ("stage",)),
                ("leg", ("stage",)),
            )
        }
        tolerance = replace(tolerance, **scattered)
    parts: dict[str, Any] = {name: getattr(whole, name) for name in whole.__struct_fields__}
    parts |= {
        "stage": stages,
        "link": _between_free(whole.link, held, place),
        "damper": _between_free(whole.damper, held, place),
        "cavity": _between_free(whole.cavity, held, place),
        "perturbation": free(whole.perturbation, "wire", "body", "blade", "leg"),
        "tolerance": tolerance,
        "control": _control_of_free(whole.control, held),
        "requirement": [row for row in whole.requirement if not _named(held, row.quantity)],
    }
    return PartlyLocked(**parts, in_file=whole)


def _part_of(held: Sequence[str], name: str | None) -> bool:
    """Whether a name (``upper``, ``upper.1``, ``upper.x@0,0,1``) is that of a part of a stage."""
    return name is not None and name.partition(".")[0].partition(BETWEEN)[0] in held


def _control_of_free(control: Control | None, held: Sequence[str]) -> Control | None:
    """Local control without the loops that sense or push held stages; None if no loop is left.

    Sensors of held stages read 0, and so do those of the forces of loops that are left out.
    """
    if control is None:
        return None
    loops = []
    for loop in control.loop:
        senses_held = control.named_sensor(loop) is None and _part_of(held, loop.sensor)
        if not senses_held and not _part_of(held, loop.actuator):
            loops.append(_against_support(loop, held))
    if not loops:
        return None
    names = [loop.name for loop in loops]
    return replace(
        control,
        loop=loops,
        osem=[osem for osem in control.osem if osem.stage not in held],
        sensor=[_sensor_of_free(sensor, held, names) for sensor in control.sensor],
    )


def _sensor_of_free(sensor: Sensor, held: Sequence[str], loops: Sequence[str]) -> Sensor:
    """Relate a sensor to the support instead of held stages, whose own motions are 0."""
    motions: dict[str, float] = {}
    for text, factor in sensor.motions.items():
        at_rest = _part_of(held, text)
        name = f"{SUPPORT}.x" if at_rest else _end_against_support(text, held)
        motions[name] = motions.get(name, 0.0) + (0.0 if at_rest else factor)
    inputs = [one for one in sensor.inputs if one.drive is None or one.drive in loops]
    return replace(sensor, motion=motions or None, inputs=inputs)


def _against(text: str) -> str:
    """Name of the second body of a signal between two, or ""."""
    return text.partition(".")[0].partition(BETWEEN)[2]


def _end_against_support(text: str, held: Sequence[str]) -> str:
    """Relate a signal to the support instead of a held stage: ``test~upper.x``."""
    body, _, motion = text.partition(".")
    own = body.partition(BETWEEN)[0]
    return f"{own}{BETWEEN}{SUPPORT}.{motion}" if _against(text) in held else text


def _against_support(loop: Loop, held: Sequence[str]) -> Loop:
    """Relate the ends of a loop to the support instead of a held stage."""
    ends = {end: _end_against_support(getattr(loop, end), held) for end in ("sensor", "actuator")}
    return replace(loop, **ends)


def _hung(stage: Stage, above: str, held: Sequence[str], place: Point) -> Stage:
    """Hang a stage from the support instead of a held one, whose origin is at `place`, m."""
    damping = stage.damping
    if damping is not None and damping.against in held:
        damping = replace(damping, against=SUPPORT)
    if above not in held:
        return replace(stage, hangs_from=above, damping=damping)
    changed: dict[str, Any] = {
        "hangs_from": SUPPORT,
        "damping": damping,
        "wire": [replace(wire, upper=add_points(place, wire.upper)) for wire in stage.wire],
        "blade": [
            blade if blade.at is None else replace(blade, at=add_points(place, blade.at))
            for blade in stage.blade
        ],
    }
    if stage.position is not None:
        changed["position"] = add_points(place, stage.position)
    if stage.wires is not None:
        wires = stage.wires
        changed["wires"] = replace(wires, d_upper=wires.d_upper - place[2])
    return replace(stage, **changed)


def _between_free(
    rows: Sequence[Joint], held: Sequence[str], place: dict[str, Point]
) -> list[Joint]:
    """Replace held bodies by the support in elements between two bodies; drop those at rest."""
    result = []
    for row in rows:
        first, second = row.between
        if first in held and (second in held or second in (SUPPORT, GROUND)):
            continue
        if first in held:
            row = _turned(row, place)
            first, second = row.between
        if second in held:
            row = replace(row, between=[first, SUPPORT])
            if isinstance(row, Link) and row.strands is not None:
                strands = replace(row.strands, to=add_points(place[second], row.strands.to))
                row = replace(row, strands=strands)
        result.append(row)
    return result


def _turned(row: Joint, place: dict[str, Point]) -> Joint:
    """The same element, from its second body to its first."""
    first, second = row.between
    between = [second, first]
    if isinstance(row, Cavity):
        return replace(row, between=between, radii=row.radii[::-1])
    shift = _difference(place[first], place[second])
    if isinstance(row, Damper) or row.strands is None:
        turned = replace(row, between=between, at=add_points(shift, row.at))
    else:
        points = [add_points(shift, point) for point in reversed(row.strands.points)]
        strands: Strands = replace(row.strands, to=row.at, points=points)
        turned = replace(row, between=between, at=row.strands.to, strands=strands)
    if isinstance(turned, Link):
        turned = replace(turned, preload=[-value for value in turned.preload])
    return turned


def _difference(one: Sequence[float], other: Sequence[float]) -> Point:
    x, y, z = (a - b for a, b in zip(one, other, strict=True))
    return x, y, z
