"""Checks of a design across its tables: which names exist, which lengths fit, what is implausible.

What a table must fulfil by itself is declared in its `rules`, see `design.key_rules`. Problems are
here behind whole key paths.

Implausible numbers (millimetres written as metres, grams as kilograms, GPa as Pa) are valid, so
there are warnings, not faults. Limits are wide: a unit that is wrong by a factor of a thousand
exceeds them, an unusual design does not. Ranges of single numbers stand beside their keys
(`typed_tables.Plausible`); here are those that depend on several numbers.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

from suspension_cli.conventions import ANALYSES, DOFS, FRAME, GROUND, SUPPORT
from suspension_cli.design import bodies, faults, foton, heat_flow, materials, units
from suspension_cli.design.bodies import Body, Solid
from suspension_cli.design.derive import (
    add_keystones,
    drop_keystones,
    origin_positions,
    part_loss,
    set_geometry,
    with_bodies_above,
)
from suspension_cli.design.faults import fault_of, suggest
from suspension_cli.design.imperfections import Distribution
from suspension_cli.design.links import Cavity, Damper, Link, Strands
from suspension_cli.design.locked_stages import as_in_file, check_locked
from suspension_cli.design.loop_filters import DigitalFilter
from suspension_cli.design.materials import MECHANISMS, AgainstTemperature
from suspension_cli.design.schema import Design, Spring, Stage
from suspension_cli.design.towers import SUFFIX, leg_count
from suspension_cli.design.typed_tables import Plausible, Problems, Table, declared, keys_with
from suspension_cli.design.units import OSMIUM
from suspension_cli.design.wires import (
    RADII,
    Clamp,
    Profile,
    Wire,
    WireSet,
    cross_sections,
    is_ring,
)
from suspension_cli.errors import Fault, format_key, format_value

BLADES_FOR_WIRES = {1: (1,), 2: (1, 2), 4: (2, 4)}
"""Numbers of blades that can carry a symmetric set, by its number of wires."""
CLAMP_ANGLE = 0.5
"""Largest angle of a clamp to the nominal wire, rad: the beam model assumes small slopes."""
PROFILE = 0.05
"""Largest relative difference of lengths of a wire and its measured profile, which is scaled."""
SPAN = 1e-6
"""Largest relative difference of a wire's length from the sum of its sections."""
ROUNDING = 1e-9
"""Negative eigenvalue of a matrix, its diagonal scaled to 1, that is an error of its digits."""
AIR = 1.2
"""kg/m^3; a lighter body would float."""
USUAL = 3000.0
"""kg/m^3; typical of masses of silica and steel with gaps."""
OF_SHAPE = {"g for the mass": 1e-3, "mm for the sizes": 1e9}
OF_INERTIA = {"g for the mass": 1e-3**2.5} | {
    f"{name} for the inertia": size**-1.5
    for name, size in (("g m^2", 1e-3), ("kg cm^2", 1e-4), ("kg mm^2", 1e-6), ("g mm^2", 1e-9))
}
"""Factor on the density of a body, given by its shape or its inertia, if another unit was meant."""
BEYOND = 0.5
"""Largest distance of a wire's end from a body (on posts, ears), in its largest half sides."""
INFERRED = 3.0
"""Factor on the half sides of the homogeneous box of its inertia, for a body of unknown shape."""
SERIOUS = 5.0
"""Factor on these bounds beyond which a number is an error."""
Span = tuple[float, float, float]


def check_design(design: Design, sound: Collection[Stage] = ()) -> list[Fault]:
    """List all faults of a design whose single values are valid.

    It may differ in numbers alone from a design with the `sound` stages.
    """
    known = {id(stage) for stage in design.stage if stage in sound}
    tables = [*faults.tables(design, known=known)]
    problems = [*_check_stages(design), *_check_materials(design), *_check_names(design, tables)]
    for stage in design.stage:
        if id(stage) not in known:
            problems += _check_suspension(stage, f"stage.{stage.name}")
    problems += _check_links(design)
    found = [*faults.find_faults(tables), *(fault_of(design, "", *one) for one in problems)]
    for command in design.analysis:
        if command not in ANALYSES:
            key = f"analysis.{format_key(command)}"
            remedy = suggest(command, [*ANALYSES])
            found.append(Fault(key, "unknown command", remedy))
    for link in design.link:
        own = ("stage", "materials", f"link.{link.name}")
        if link.strands is not None and not any(fault.key.startswith(own) for fault in found):
            strands = _check_strands(design, link, link.strands, f"link.{link.name}.strands")
            found += [fault_of(design, "", *one) for one in strands]
    if not found:
        found = [fault_of(design, "", *one) for one in check_locked(design)]
        found += [fault_of(design, "", *one) for one in heat_flow.find_faults(design)]
    for part, fault in () if found else find_active(design, tables):
        if not part.active:
            remedy = f"{fault.remedy}, or give active = true if a sensor and an actuator do this"
            found.append(replace(fault, remedy=remedy))
    return found


def _check_stages(design: Design) -> Problems:
    """Check that the names of stages differ, and that one is the mirror."""
    taken = {SUPPORT: "the suspension point"}
    if design.support is not None:
        taken[FRAME] = "the support structure that [support] describes"
    if any(GROUND in item.between for _, item in design.between_bodies):
        taken[GROUND] = "the ground, where a link or damper ends"
    for stage in design.stage:
        if stage.name in taken:
            problem = f"is the name of {taken[stage.name]}"
            yield f"stage.{stage.name}.name", problem, "give each stage another name"
        taken |= dict.fromkeys(_bodies(stage), "an earlier stage")
    for stage in [stage for stage in design.stage if stage.mirror][1:]:
        remedy = "keep it on the stage that is the mirror"
        yield f"stage.{stage.name}.mirror", "is given for an earlier stage too", remedy


def _bodies(stage: Stage) -> list[str]:
    """Names of the bodies of a stage: its own, and its filter's keystone."""
    return [stage.name, *([stage.name + SUFFIX] if stage.filter is not None else [])]


def _check_materials(design: Design) -> Problems:
    """Check the tables of materials."""
    for name, own in design.materials.items():
        path = f"materials.{format_key(name)}"
        material = materials.look_up(design, name)
        if not re.fullmatch(units.NAME, name):
            remedy = "call it by letters, digits, _ and -, starting with a letter"
            yield path, "is not a valid name, so no wire can refer to it", remedy
        elif material.youngs_modulus is None:
            yield f"{path}.youngs_modulus", "missing", "give Young's modulus in Pa"
        for mechanism in MECHANISMS:
            for key, problem, remedy in mechanism.check(own, material):
                yield f"{path}.{key}", problem, remedy


def _check_names(design: Design, tables: Iterable[tuple[str, Table]]) -> Problems:
    """Check that parts which are named exist."""
    known = _known_names(design)
    tabulated = {link.name for link in design.link if link.table is not None}
    for path, table in tables:
        stage = path.split(".")[1] if path.startswith("stage.") else ""
        for key, kind in keys_with(type(table), "names"):
            name = getattr(table, key)
            names = known.get(kind, known.get(f"{kind} {stage}", []))
            if name is not None and name not in names:
                remedy = suggest(name, names)
                if kind == "material":
                    remedy += " or define it as [materials.NAME]"
                yield f"{path}.{key}", f"names no {kind}", remedy
            elif kind == "link" and name in tabulated:
                problem = "names a link given by a table, whose stiffness does not scatter"
                yield f"{path}.{key}", problem, f"vary link.{name}.table.factor with --set or sweep"


def _known_names(design: Design) -> dict[str, list[str]]:
    """List the names of all parts by kind; of some kinds for each stage."""
    found: dict[str, list[str]] = {kind: [] for kind in ("stage", "wire", "blade", "leg")}
    above = [SUPPORT]
    for number, stage in enumerate(design.stage, 1):
        name = stage.name
        legs = stage.inverted_pendulum
        own = _bodies(stage)
        blades = [blade.name for blade in stage.blade]
        for key in (name, number):  # by which paths call it
            found[f"earlier stage {key}"] = [*above]
            found[f"blade of the stage {key}"] = blades
        count = len(stage.wire) if stage.wires is None else stage.wires.count
        if stage.blades is not None:
            blades = [f"blade{n}" for n in range(1, stage.blades.count + 1)]
        found["stage"] += own
        above += own
        found["wire"] += [f"{name}.{n}" for n in range(1, count + 1)]
        found["blade"] += [f"{name}.{blade}" for blade in blades] + own[:-1]
        found["leg"] += [f"{name}.leg{n}" for n in range(1, leg_count(legs) + 1)] if legs else []
    for part in ("wire", "blade", "leg"):
        found[f"stage with {part}s"] = [*dict.fromkeys(name.split(".")[0] for name in found[part])]
    links = [link.name for link in design.link]
    return found | {"link": links, "material": materials.known(design)}


def _check_suspension(stage: Stage, path: str) -> Problems:
    """Check wires and blades of a stage against each other and against its position."""
    if stage.wires is not None:
        yield from _check_set(stage, stage.wires, path)
    for number, wire in enumerate(stage.wire if stage.position is not None else (), 1):
        assert stage.position is not None
        ends = zip(stage.position, wire.lower, wire.upper, strict=True)
        x, y, z = (p + q - u for p, q, u in ends)
        if math.hypot(x, y, z) < 1e-9:
            problem = "both ends of the wire are at one point"
            yield f"{path}.wire.{number}.lower", problem, "check upper, lower and position"
        else:
            yield from _check_span(wire, (x, y, z), f"{path}.wire.{number}")
    for blade in stage.blade:
        if not any(wire.blade == blade.name for wire in stage.wire):
            remedy = f'name it in a wire: blade = "{blade.name}"'
            yield f"{path}.blade.{blade.name}", "carries no wire", remedy


def _check_set(stage: Stage, wires: WireSet, path: str) -> Problems:
    """Check that the wires of a set exceed their horizontal span, and its number of blades."""
    shape = set_geometry(wires)
    (both, *halves) = [getattr(wires, key) for key in RADII]
    ring = is_ring(wires)
    count = wires.count
    if both is not None or None not in halves or (not ring and count in BLADES_FOR_WIRES):
        (a, b), (c, d) = shape.ends[0]
        if shape.height_squared > 1e-12 * wires.l**2:
            yield from _check_span(wires, (c - a, d - b, -shape.height), f"{path}.wires")
        else:
            span = math.hypot(c - a, d - b)
            problem = f"the wire is not longer than its horizontal span of {span:g} m"
            millimetres = span > 1.0 and wires.l > 5e-4 * span
            remedy = "give a longer wire or a smaller span" + " (did you mean mm?)" * millimetres
            yield f"{path}.wires.l", problem, remedy
    allowed = (1, count) if ring else BLADES_FOR_WIRES.get(count)
    if stage.blades is not None and allowed is not None and stage.blades.count not in allowed:
        remedy = f"give {' or '.join(map(str, allowed))}"
        yield f"{path}.blades.count", f"cannot carry {count} wires", remedy


def _check_span(wire: WireSet | Wire, span: Span, path: str) -> Problems:
    """Check sections and clamps against the nominal wire (of a set, the first) along `span`, m."""
    length = math.hypot(*span)
    neck = wire.neck
    pieces = wire.sections or []
    if isinstance(wire.profile, Profile) and len(wire.profile.position) > 1:
        measured = wire.profile.position[-1] - wire.profile.position[0]
        if abs(measured - length) > PROFILE * length:
            problem = f"is {measured:.6g} m long, but the wire is {length:.6g} m"
            remedy = "measure from clamp to clamp, or write the unit into the column's title"
            yield f"{path}.profile", problem, f"{remedy} (position_mm)"
    if neck is not None and 2 * (neck.length + neck.stock) >= length:
        problem = f"both necks take {2 * (neck.length + neck.stock):g} m of {length:.6g} m"
        remedy = "give a shorter neck" + (" (did you mean mm?)" if neck.length > 0.1 else "")
        yield f"{path}.neck.length", problem, remedy
    given = sum(piece.length or 0.0 for piece in pieces)
    if any(piece.length is None for piece in pieces):
        if given >= length * (1 - SPAN):
            problem = f"take {given:.9g} m of {length:.9g} m and leave nothing for the open one"
            yield f"{path}.sections", problem, "give shorter sections, or all lengths"
    elif pieces and abs(given - length) > SPAN * length:
        problem = f"sum to {given:.9g} m, but the wire is {length:.9g} m long"
        yield f"{path}.sections", problem, "leave out one length, that section takes the rest"
    for end in ("upper", "lower") if isinstance(wire.clamp, Clamp) else ():
        along = getattr(wire.clamp, end)
        if along is None:
            continue
        size = math.hypot(*along)
        if size == 0:
            yield f"{path}.clamp.{end}", "has no direction", "give x, y, z, not all zero"
            continue
        cosine = sum(a / size * b / length for a, b in zip(along, span, strict=True))
        if cosine < math.cos(CLAMP_ANGLE):
            problem = f"makes an angle of {math.acos(max(-1.0, cosine)):.3g} rad with the wire"
            within = f"within {CLAMP_ANGLE} rad of the wire"
            remedy = f"give it from the upper towards the lower end, {within}"
            yield f"{path}.clamp.{end}", problem, remedy


def _check_links(design: Design) -> Problems:
    """Check the names of all elements between two bodies."""
    stages = [stage.name for stage in design.stage]
    taken = [*stages]
    ends = [*stages, SUPPORT, GROUND]
    for kind, item in design.between_bodies:
        path = f"{kind}.{item.name}"
        first, second = item.between
        if item.name in taken:
            problem = "is the name of another link, damper, cavity or stage"
            yield f"{path}.name", problem, "give each a name of its own"
        taken.append(item.name)
        problem = ""
        remedy = "name two bodies"
        if first not in stages:
            problem = f"begins with {first}, which is not a stage"
            remedy = suggest(first, stages)
            if second in stages and first in ends:
                problem = "must begin with a stage"
                remedy = f'swap them: ["{second}", "{first}"]'
        elif second not in ends:
            problem = f"ends with {second}, which is not a body"
            remedy = suggest(second, ends)
        elif first == second:
            problem = "joins a body to itself"
        if problem:
            yield f"{path}.between", problem, remedy


def _check_strands(design: Design, link: Link, given: Strands, path: str) -> Problems:
    """Check that wires reach from end to end in their shape."""
    position = origin_positions(add_keystones(design))
    first, second = (position[SUPPORT if name == GROUND else name] for name in link.between)
    x, y, z = (b + q - a - p for a, b, p, q in zip(first, second, link.at, given.to, strict=True))
    width = math.hypot(x, y)
    if given.shape == "points":
        end = tuple(p + d for p, d in zip(link.at, (x, y, z), strict=True))
        points = [link.at, *given.points, end]
        if any(math.dist(one, other) < 1e-9 for one, other in pairwise(points)):
            yield f"{path}.points", "two points of the wire coincide", "check at, points, to"
    elif width < 1e-6:
        problem = "lies above or below the point at, so the shape has no plane"
        yield f"{path}.to", problem, "move one end sideways, or give points"
    elif given.length is not None:
        least = math.hypot(width, z) if given.shape == "catenary" else math.pi / 2 * width + abs(z)
        if given.length <= least * (1 + 1e-9):
            problem = (
                f"is too short for ends {width:.4g} m apart and {abs(z):.4g} m in height: this"
                f" shape needs more than {least:.4g} m"
            )
            yield f"{path}.length", problem, "give a longer wire, or check at and to (m)"


def find_active(
    design: Design, tables: Iterable[tuple[str, Table]]
) -> Iterator[tuple[Link | Damper | Spring | Cavity, Fault]]:
    """Find which of some tables of a design give power to the motion, each with what does so."""
    for path, part in tables:
        if isinstance(part, Cavity) and part.active:
            remedy = "make it negative, or lower the power"
            problem = "is positive, so that the delay of the optical spring drives the motion"
            yield part, fault_of(part, path, "detuning", problem, remedy)
        if not isinstance(part, (Link, Damper, Spring)):
            continue
        if problem := _negative(part.damping):
            problem = f"{problem}, so it drives the motion instead of damping it"
            yield part, fault_of(part, path, "damping", problem, "make it positive")
        if isinstance(part, Damper):
            continue
        angle = part_loss(design, part) if isinstance(part, Spring) else part.loss_angle
        if angle and (problem := _negative(part.stiffness)):
            problem = f"is that of a stiffness that {problem}, so it drives the motion"
            yield part, fault_of(part, path, "loss_angle", problem, "give loss_angle = 0.0")
        if (table := getattr(part, "table", None)) is None:
            continue
        for n, row in enumerate(table.imaginary):
            if (least := min(row)) < 0:
                at = f"along {table.axis or DOFS[n]} at {table.frequency[row.index(least)]:g} Hz"
                problem = f"is negative {at}, so it drives the motion instead of damping it"
                where = f"{path}.table.imaginary"
                yield part, Fault(where, problem, "make it positive", f"{least:g}")


def _negative(given: units.Matrix6 | None) -> str:
    """In which direction a matrix is negative, as a verb phrase; "" if it is not."""
    import numpy as np

    if given is None or not np.isrealobj(given):
        return ""
    matrix = np.array(given, dtype=float)
    matrix = np.diag(matrix) if matrix.ndim == 1 else matrix
    size = np.abs(matrix.diagonal())
    scale = np.sqrt(np.where(size > 0, size, np.abs(matrix).max() or 1.0))
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    axis = DOFS[int(np.abs(vectors[:, 0]).argmax())]
    return f"is negative along {axis}" if values[0] < -ROUNDING else ""


def find_without_drag(design: Design) -> list[Fault]:
    """Find the bodies that gas surrounds, but whose surface is unknown; one fault for all."""
    if design.gas is None or not design.gas.pressure:
        return []
    bare = [stage for stage in design.stage if not bodies.has_surface(stage.body)]
    if not bare:
        return []
    names = ", ".join(stage.name for stage in bare)
    problem = f"exerts no drag on {names}, whose body has neither a shape nor a surface_area"
    remedy = "give surface_area (m^2), or a shape with its sizes beside mass and inertia"
    return [Fault("gas", problem, remedy)]


@dataclass(frozen=True)
class ImplausibleNumber(Fault):
    """An implausible number."""

    serious: bool = False
    """Whether results are then meaningless, so that analyses warn too."""

    @classmethod
    def of(cls, fault: Fault, serious: bool = False) -> ImplausibleNumber:
        """Make a fault a warning."""
        return cls(fault.key, fault.problem, fault.remedy, fault.value, serious)


def find_implausible(design: Design) -> list[ImplausibleNumber]:
    """Find implausible numbers of a design, from its tables alone."""
    design = as_in_file(design)
    found: list[Row] = [
        *_check_ranges(drop_keystones(design)),
        *_check_planes(design),
        *_check_signs(design),
    ]
    body_of = {stage.name: stage.body for stage in design.stage}
    for stage, above in with_bodies_above(design):
        own = [
            *_check_densities(stage.body),
            *_check_attachments(stage, body_of.get(above)),
            *_check_slenderness(stage),
        ]
        found += [(f"stage.{stage.name}.{row[0]}", *row[1:]) for row in own]
    return [ImplausibleNumber(*row) for row in found]


Row = tuple[str, str, str, str, bool]
"""Key, problem, remedy, value as written, and whether it is serious."""


def _check_ranges(design: Design) -> Iterator[Row]:
    """Report numbers, lists with numbers and distributions outside their plausible ranges."""
    for path, table in faults.tables(design):
        for key, plausible in keys_with(type(table), "plausible"):
            value = getattr(table, key)
            unit = declared(type(table))[key].get("unit", "")
            if isinstance(value, Distribution):
                value = value.normal or value.uniform
            numbers = value
            if key.endswith("_noise") and isinstance(value, list):
                numbers = [density for _, density in value]
            size = max(_sizes(numbers), default=plausible.high)
            if problem := plausible.problem(size, unit):
                remedy = plausible.remedy(size, unit)
                shown = format_value(value)
                yield f"{path}.{key}", problem, remedy, shown, plausible.serious


def _check_planes(design: Design) -> Iterator[Row]:
    """Report filters with poles or zeros in rad/s because their strings name no plane."""
    for path, text in _filter_strings(design):
        if factors := foton.find_without_plane(text):
            what = " and ".join(factors)
            bare = factors[0][:-1]
            problem = f"{what} without a plane: in rad/s by Foton's rule, not in Hz,"
            problem += " with another gain at 0 Hz than 1"
            remedy = f'write {bare}, "n") for Hz and a gain of 1, or {bare}, "s") if this is'
            remedy += " meant"
            yield path, problem, remedy, format_value(text), True


def _check_signs(design: Design) -> Iterator[Row]:
    """Report factors to which Foton gives another sign than its documentation."""
    for path, text in _filter_strings(design):
        if factors := foton.find_turned(text):
            problem = f"{' and '.join(factors)}: Foton turns the sign, as the zeros exceed the"
            problem += " poles by an odd number, or an odd number is in the right half plane"
            remedy = "check the sign of the loop; turn that of the gain if this is not meant"
            yield path, problem, remedy, format_value(text), True


def _filter_strings(design: Design) -> Iterator[tuple[str, str]]:
    """Iterate over the keys of filters of loops and their sensors, and their design strings."""
    control = design.control
    if control is None:
        return
    tables: list[tuple[str, Any]] = []
    for loop in control.loop:
        tables += [
            (f"loop.{loop.name}.filter", loop.filter),
            (f"loop.{loop.name}.sensor_response", loop.sensor_response),
        ]
    for sensor in control.sensor:
        tables.append((f"sensor.{sensor.name}.response", sensor.response))
        tables += [
            (f"sensor.{sensor.name}.inputs.{n}.filter", one.filter)
            for n, one in enumerate(sensor.inputs, 1)
        ]
    for osem in control.osem:
        tables.append((f"osem.{osem.name}.driver_response", osem.driver_response))
    for path, given in tables:
        text = given.design if isinstance(given, DigitalFilter) else given
        yield f"control.{path}", text or ""


def _sizes(value: Any) -> list[float]:
    """Magnitudes of a number, or of those of a list or of a table against temperature."""
    if isinstance(value, AgainstTemperature):
        value = value.values
    if isinstance(value, (list, tuple)):
        return [size for item in value for size in _sizes(item)]
    return [abs(value)] if isinstance(value, (int, float)) else []


def _check_densities(body: Body) -> Iterator[Row]:
    """Report a body, or a part of it, that is too dense or too light."""
    if not body.parts:
        yield from _check_density(body, "body")
    for n, part in enumerate(body.parts, 1):
        yield from _check_density(part, f"body.parts.{n}")


def _check_density(body: Solid, path: str) -> Iterator[Row]:
    """Report a body denser than osmium or less dense than air.

    Its density follows from its mass and shape. Of a body that gives moments of inertia, it is that
    of the homogeneous ellipsoid, whose half axes have the squares 5 S_i / m with the second moments
    S_i of the mass m: the most compact body of these moments, so a lower bound.
    """
    mass = bodies.body_mass(body)
    moments = bodies.second_moments(body)
    if min(moments) < -1e-6 * max(moments):
        problem = "one moment exceeds the sum of the other two, impossible for a rigid body"
        remedy = "check the three moments, in kg m^2"
        shown = format_value(body.inertia)
        yield f"{path}.inertia", problem, remedy, shown, True
        return
    if body.density is not None:
        return  # it has a range of its own
    if body.shape is None and min(moments) <= 1e-6 * max(moments):
        return  # a plate or rod has no volume
    if body.shape is None:
        key = "inertia"
        units = OF_INERTIA
        axes = math.prod(5 * moment / mass for moment in moments)
        volume = 4 * math.pi / 3 * math.sqrt(axes)
    else:
        key = "mass"
        units = OF_SHAPE
        volume = bodies.volume(body)
    density = mass / volume
    if AIR <= density <= OSMIUM:
        return
    limit = f"denser than osmium ({OSMIUM:g})" if density > AIR else f"lighter than air ({AIR:g})"
    meant = min(units, key=lambda name: abs(math.log(units[name] * density / USUAL)))
    good = 100 <= units[meant] * density <= OSMIUM
    remedy = f"did you mean {meant}?" if good else "check mass (kg), sizes (m), inertia (kg m^2)"
    problem = f"a body of {mass:g} kg of this size has {density:.3g} kg/m^3, {limit}"
    serious = body.shape is not None or not AIR / SERIOUS <= density <= OSMIUM
    yield f"{path}.{key}", problem, remedy, format_value(getattr(body, key)), serious


def _check_slenderness(stage: Stage) -> Iterator[Row]:
    """Report wires of a set and blades that are shorter than they are thick: they are no beams."""
    parts: list[tuple[str, float, float]] = []
    if stage.wires is not None:
        for section in cross_sections(stage.wires):
            parts.append(("wires.l", stage.wires.l, min(section.depth)))
    if stage.blades is not None and (blade := stage.blades.geometry) is not None:
        parts.append(("blades.geometry.length", blade.length, blade.thickness))
    for key, length, thickness in parts:
        if length < thickness < math.inf:
            problem = f"is less than the thickness, {thickness:g} m: neither a wire nor a beam"
            yield key, problem, "check the length and the thickness (m)", format_value(length), True


def _check_attachments(stage: Stage, above: Body | None) -> Iterator[Row]:
    """Report ends of wires and springs far outside their bodies."""
    if stage.wires is not None:
        shape = set_geometry(stage.wires)
        ring = "ring" if shape.is_ring else "s"
        both = getattr(stage.wires, ring) is not None
        lower, upper = (ring if both else f"{ring}_{end}" for end in ("lower", "upper"))
        point = (max(shape.s_lower, shape.ring_lower), shape.t2, shape.d)
        keys = [f"wires.{key}" for key in (lower, "t2", "d")]
        yield from _check_point(stage.body, point, keys, "lower ends of wires lie")
        point = (max(shape.s_upper, shape.ring_upper), shape.t1, shape.d_upper)
        keys = [f"wires.{key}" for key in (upper, "t1", "d_upper")]
        yield from _check_point(above, point, keys, "upper ends of wires lie")
    for n, wire in enumerate(stage.wire, 1):
        lower, upper = ([f"wire.{n}.{end}"] * 3 for end in ("lower", "upper"))
        yield from _check_point(stage.body, wire.lower, lower, "the lower end lies")
        yield from _check_point(above, wire.upper, upper, "the upper end lies")
    for n, spring in enumerate(stage.spring, 1):
        keys = [f"spring.{n}.at"] * 3
        yield from _check_point(stage.body, spring.at, keys, "the point of the spring lies")


def _check_point(body: Body | None, point: Span, keys: list[str], what: str) -> Iterator[Row]:
    """Report the coordinate of a point of a body that lies furthest outside it."""
    if body is None:
        return
    halves = bodies.half_sides(body)
    has_size = body.parts or body.shape is not None
    inferred = 1.0 if has_size else INFERRED
    limits = [inferred * half + BEYOND * max(halves) for half in halves]
    far = [abs(value) / limit for value, limit in zip(point, limits, strict=True)]
    n = far.index(max(far))
    if far[n] > 1:
        about = "" if has_size else "about "
        middle = "origin" if body.parts else "COM"
        problem = (
            f"{what} {abs(point[n]):.3g} m from the {middle}, far outside the body (whose half"
            f" along {'xyz'[n]} is {about}{halves[n]:.2g} m)"
        )
        remedy = Plausible(limits[n], "").remedy(abs(point[n]), "m, as the body's size")
        yield keys[n], problem, remedy, format_value(point[n]), far[n] > SERIOUS
