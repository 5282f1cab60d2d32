"""Conversion of saves of SUMCON, KAGRA's modeller of suspensions in Mathematica, into designs.

SUMCON's y is vertical and its z along the beam: its x, y, z are y, z, x here. It minimises the
energy of wires with natural lengths. A wire is a string between hinges, sqrt(E I / T) from each
clamp, with the diameter of its ends and a tension T of its own in the save. A vertical spring moves
the upper end of a wire, an inverted pendulum holds a body by a lateral stiffness that includes the
load, a heat link is a stiffness between two points.

A body hangs from one other. Where its wires and all below are symmetric, they are a set, whose
loaded length is the natural length plus T / k with T from the weight. Other wires keep their natural
lengths, so that the pose is solved for.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from suspension_cli.design.mathematica import Form, find_fault, read_list
from suspension_cli.errors import Fault, InputError

Vector = tuple[float, float, float]
Columns = Callable[[str], list[list[float]]]
"""Reads a stiffness table by its name: frequency (Hz), real and imaginary part (N/m)."""

GRAVITY = 9.81
POINT = [float] * 3
SIX = [float] * 6
TABLES: dict[str, Form] = {
    "bdn": [bool, str],  # whether it is ground, name
    "mass": [float, [POINT] * 3],
    "mat": [str, *[float] * 5, str],  # g/cm^3, GPa, Poisson's ratio, loss (two), source
    # wire: upper body and end, lower body and end, material, natural length, diameter, length and
    # diameter of the ends, tension, directions of the hinges, name, k, torsion
    "wire": [float, POINT, float, POINT, float, *[float] * 5, POINT, POINT, str, float, float],
    "initpos": POINT,
    # vertical spring: wire, end, k, load, whether its inertia counts, dB, direction, name, Q
    "vspr": [float, float, float, float, bool, float, POINT, str, float],
    # legs: base, top, places, stiffness and Q (lateral of each, yaw), name, length, dB, whether its
    # inertia is negative, load in kg, whether its inertia counts
    "IP": [float, float, [[float] * 2] * 3, *[[float] * 4] * 2, str, float, float, bool, float, bool],
    # heat link: two bodies and points, span, shape, Q, stiffness, names of tables, name
    "HL": [float, float, POINT, POINT, POINT, float, float, [SIX] * 6, [[str] * 6] * 6, str],
    "damp": [str, float, float, POINT, POINT, [SIX] * 6],
}
NEEDED = ("bdn", "mass", "mat", "wire")
MOST_BODIES, MOST_WIRES = 200, 2000
RIGID = 1e9
"""Stiffness of what SUMCON takes as rigid, N/m or N m/rad."""
LONGEST_BENDS = 0.45
"""Fraction of a wire that its bends may take for hinges; the string model refuses half."""


@dataclass(frozen=True)
class Imported:
    """A converted save.

    Attributes
    ----------
    text
        The design as TOML.
    notes
        What it has otherwise than the save, or not at all.
    files
        CSV files of stiffness tables that it names, as text by name.
    """

    text: str
    notes: list[str]
    files: dict[str, str]


@dataclass
class Wire:
    """A wire in our axes, in m, N and kg; see `TABLES`."""

    upper: int
    top: Vector
    lower: int
    bottom: Vector
    material: int
    natural: float
    diameter: float
    end_length: float
    end_diameter: float
    tension: float
    hinges: tuple[Vector, Vector]
    name: str
    k: float
    torsion: float
    bend: float = 0.0
    spring: list[Any] | None = None


@dataclass
class Body:
    """A body, what it hangs from, and its place.

    `set_keys` are the keys of a symmetric set of wires; None where the wires are single.
    """

    number: int
    name: str
    ground: bool
    mass: float
    inertia: list[list[float]]
    above: int = -1
    wires: list[Wire] = field(default_factory=list)
    legs: list[Any] | None = None
    below: list[Body] = field(default_factory=list)
    load: float = 0.0
    length: float = 0.0
    offset: Vector = (0.0, 0.0, 0.0)
    place: Vector = (0.0, 0.0, 0.0)
    set_keys: dict[str, Any] | None = None
    filter_of: Wire | None = None

    @property
    def is_balanced(self) -> bool:
        """Whether this body and all below it hang from symmetric sets."""
        return (self.set_keys is not None or self.legs is not None) and all(
            body.is_balanced for body in self.below
        )


def convert(text: str, name: str, reference: str, columns: Columns) -> Imported:
    """Convert the text of a save into a design of the given name; raises `InputError`."""
    tables = _tables(text)
    notes: list[str] = []
    bodies = _bodies(tables, notes)
    order = _hang(bodies, tables, notes)
    _place(order, bodies, tables, notes)
    files: dict[str, str] = {}
    lines = [*_materials(tables, order)]
    for n, body in enumerate(order):
        before = order[n - 1] if n else None
        lines += _stage(body, before, bodies, tables, notes)
    for row in tables["damp"]:
        lines += _damper(row, bodies, notes)
    for row in tables["HL"]:
        lines += _link(row, bodies, columns, files, notes)
    head = [
        f"# {_plain(reference)}: converted by `pendsus import`.",
        "# SUMCON's x, y, z are y, z, x here; names of bodies are SUMCON's.",
    ]
    if notes:
        head += ["# Otherwise than in SUMCON, or not taken over:", *(f"#   {one}" for one in notes)]
    title = f"Suspension {_plain(_title(text)) or name} of SUMCON"
    own = {"name": name, "title": title, "reference": _plain(reference, 300)}
    return Imported("\n".join([*head, *_table("design", own), *lines, ""]), notes, files)


def _tables(text: str) -> dict[str, list[list[Any]]]:
    result: dict[str, Any] = {}
    for key, form in TABLES.items():
        rows = read_list(text, f"save${key}")
        if rows is None and key in NEEDED:
            remedy = "name a save of SUMCON (models/sumcon/save/*.m), whole"
            raise InputError.of("", f"has no save${key}", remedy)
        result[key] = rows or []
        for row in result[key]:
            for n in (3, 4) if key == "IP" and len(row) > 4 else ():  # as version 1.0 wrote them
                if isinstance(row[n], list) and len(row[n]) == 3:
                    row[n].append(0.0 if n == 3 else 1000.0)
        found = (find_fault(row, form, f"save${key}.{n}") for n, row in enumerate(result[key], 1))
        if fault := next(filter(None, found), None):
            raise InputError([fault])
    for key, most in (("bdn", MOST_BODIES), ("mass", MOST_BODIES), ("wire", MOST_WIRES)):
        if len(result[key]) > most:
            raise InputError.of(f"save${key}", f"has more than {most} rows", "give fewer")
    count = len(result["bdn"])
    _check_numbers(result, "mass", None, count)
    for key, places, most in (
        ("wire", (0, 2), count),
        ("wire", (4,), len(result["mat"])),
        ("vspr", (0,), len(result["wire"])),
        ("vspr", (1,), 2),
        ("IP", (0, 1), count),
        ("HL", (0, 1), count),
        ("damp", (1, 2), count),
    ):
        _check_numbers(result, key, places, most)
    return result


def _check_numbers(tables: dict[str, Any], key: str, places: Sequence[int] | None, most: int) -> None:
    """Raise `InputError` for numbers of rows of another table that do not exist."""
    if places is None:
        if len(tables[key]) < most:
            problem = f"has {len(tables[key])} rows for {most} bodies"
            raise InputError.of(f"save${key}", problem, "complete it in SUMCON")
        return
    for n, row in enumerate(tables[key], 1):
        for place in places:
            if row[place] not in range(1, most + 1):
                path = f"save${key}.{n}.{place + 1}"
                problem, remedy = f"is not a whole number from 1 to {most}", "correct it in SUMCON"
                raise InputError([Fault(path, problem, remedy, f"{row[place]:g}")])
            row[place] = int(row[place]) - 1


def _turned(point: Sequence[float]) -> Vector:
    """Turn a vector from SUMCON's axes into ours; lengths below 1e-12 m are rounding."""
    x, y, z = (0.0 if abs(value) < 1e-12 else value for value in point[:3])
    return z, x, y


def _turned_matrix(rows: Sequence[Sequence[float]]) -> list[list[float]]:
    """Turn the axes of a 3x3 or 6x6 matrix."""
    order = [n + block for block in range(0, len(rows), 3) for n in (2, 0, 1)]
    return [[rows[a][b] for b in order] for a in order]


def _bodies(tables: dict[str, Any], notes: list[str]) -> list[Body]:
    result: list[Body] = []
    for number, ((ground, name, *_), (mass, inertia, *_)) in enumerate(
        zip(tables["bdn"], tables["mass"], strict=False)
    ):
        own = re.sub(r"[^A-Za-z0-9_-]+", "-", name).strip("-")[:60]
        own = own if re.match(r"[A-Za-z]", own) else f"body-{own}".rstrip("-")
        if own.lower() in ("support", "ground") or own in [body.name for body in result]:
            own = f"{own}-{number + 1}"
        if own != name and not ground:
            notes.append(f"body {_plain(name)} is {own} here")
        result.append(Body(number, own, ground, mass, _turned_matrix(inertia)))
    for row in tables["wire"]:
        upper, top, lower, bottom, material, *numbers, first, second, name, k, torsion = row[:15]
        hinges = _turned(first), _turned(second)
        numbers = [*numbers, hinges, _plain(name), k, torsion]
        wire = Wire(upper, _turned(top), lower, _turned(bottom), material, *numbers)
        result[lower].wires.append(_bent(wire, tables["mat"][material][2] * 1e9, notes))
    for row in tables["vspr"]:
        index, end, *_, direction, name, _ = row[:9]
        lower = tables["wire"][index][2]
        wire = result[lower].wires[sum(one[2] == lower for one in tables["wire"][:index])]
        if end == 1:
            notes.append(f"spring {_plain(name)} is at the upper end of its wire, not the lower")
        if max(abs(direction[0]), abs(direction[2])) > 1e-9:
            notes.append(f"spring {_plain(name)} moves along z, without its tilt")
        wire.spring = row
    return result


def _bent(wire: Wire, modulus: float, notes: list[str]) -> Wire:
    """The wire, with its ends at the hinges if the bends take much of it."""
    if wire.tension <= 0 or wire.natural <= 0:
        remedy = "correct it in SUMCON"
        raise InputError.of("save$wire", f"has no tension or length ({wire.name})", remedy)
    bend = math.sqrt(modulus * math.pi / 64 / wire.tension) * wire.end_diameter**2
    if not LONGEST_BENDS < 2 * bend / wire.natural < 1:
        return wire
    notes.append(
        f"wire {wire.name}: its bends take {2 * bend / wire.natural:.0%} of it, so its ends are its"
        f" bending points, {bend:.3g} m from the clamps"
    )
    ends = [
        _moved(point, [bend * value for value in along])
        for point, along in zip((wire.top, wire.bottom), wire.hinges, strict=True)
    ]
    natural = wire.natural - 2 * bend
    return replace(wire, top=ends[0], bottom=ends[1], natural=natural, bend=bend)


def _hang(bodies: list[Body], tables: dict[str, Any], notes: list[str]) -> list[Body]:
    """Find what each body hangs from or stands on, and list the bodies below what they hang from."""
    for row in tables["IP"]:
        if bodies[row[1]].legs is None:
            bodies[row[1]].legs, bodies[row[1]].above = row, row[0]
        else:
            notes.append(f"inverted pendulum {_plain(row[5])}: its body stands on legs already")
    for body in bodies:
        tensions: dict[int, float] = {}
        for wire in body.wires:
            tensions[wire.upper] = tensions.get(wire.upper, 0.0) + abs(wire.tension)
        if body.ground or body.legs is not None:
            tensions = {}
        elif tensions:
            body.above = max(tensions, key=lambda n: tensions[n])
        for wire in body.wires:
            if wire.upper != body.above or body.legs is not None or body.ground:
                reason = "is ground" if body.ground else "is held by another body already"
                notes.append(f"wire {wire.name} is left out: {_plain(body.name)} {reason}")
        body.wires = [wire for wire in body.wires if tensions and wire.upper == body.above]
    order: list[Body] = []
    for body in bodies:
        if not body.ground and body.above >= 0:
            bodies[body.above].below.append(body)
    waiting = [body for body in bodies if body.ground][::-1]
    while waiting:
        body = waiting.pop()
        order += [] if body.ground else [body]
        waiting += body.below[::-1]
    loose = [body.name for body in bodies if not body.ground and body not in order]
    if loose or not order:
        problem = f"does not hold {', '.join(loose[:5]) or 'any body'}"
        raise InputError.of("save$wire", problem, "hang every body from the ground")
    return order


def _place(
    order: list[Body], bodies: list[Body], tables: dict[str, Any], notes: list[str]
) -> None:
    """Compute loads, loaded lengths, symmetric sets and places of all bodies."""
    grounds = [body for body in bodies if body.ground]
    if len(tables["initpos"]) == len(bodies):
        start = tables["initpos"][grounds[0].number]
        for body in grounds[1:]:
            at = tables["initpos"][body.number]
            body.place = _turned([a - b for a, b in zip(at, start, strict=False)])
            if body.below:
                notes.append(f"{body.name} (ground) does not move by itself: it is the support")
    for body in reversed(order):
        body.load = body.mass + sum(one.load for one in body.below)
    for body in order:
        above = bodies[body.above]
        if body.legs is not None:
            body.offset = (0.0, 0.0, body.legs[6])
        else:
            count, at = len(body.wires), above.place if above.ground else (0.0, 0.0, 0.0)
            across = math.dist(body.wires[0].top[:2], body.wires[0].bottom[:2])
            body.set_keys = _symmetric([_moved(w.top, at) for w in body.wires], body.wires)
            across = across if body.set_keys is not None and count > 1 else 0.0
            wire, body.length = body.wires[0], body.wires[0].natural
            for _ in range(100):  # the stretch changes the angle, by less each time
                upright = math.sqrt(max(1 - (across / body.length) ** 2, 1e-6))
                body.length = wire.natural + body.load * GRAVITY / (count * upright * wire.k)
            gaps = [_minus(w.top, w.bottom) for w in body.wires]
            x, y, z = (sum(gap[n] for gap in gaps) / count for n in range(3))
            x, y = (0.0, 0.0) if body.set_keys is not None else (x, y)
            body.offset = (x, y, z - body.length * upright)
        body.place = _moved(body.offset, above.place)
    for body in reversed(order):
        if body.wires and not all(one.is_balanced for one in body.below):
            body.set_keys = None
    for body in order:
        carries = body.set_keys is not None and len(body.wires) == 1
        if carries and body.wires[0].spring and not bodies[body.above].ground:
            bodies[body.above].filter_of = bodies[body.above].filter_of or body.wires[0]


def _moved(point: Sequence[float], by: Sequence[float]) -> Vector:
    x, y, z = (a + b for a, b in zip(point, by, strict=True))
    return x, y, z


def _minus(point: Sequence[float], other: Sequence[float]) -> Vector:
    return _moved(point, [-value for value in other])


def _symmetric(tops: list[Vector], wires: list[Wire]) -> dict[str, Any] | None:
    """Keys of a symmetric set with these upper ends from the COM above; None if there is none."""

    def close(a: float, b: float) -> bool:
        return abs(a - b) <= 1e-6 * max(abs(a), abs(b)) + 1e-9

    first, count = wires[0], len(wires)
    bottoms = [wire.bottom for wire in wires]
    for wire, top in zip(wires, tops, strict=True):
        springs = [one.spring[2:6] + one.spring[8:] if one.spring else None for one in (first, wire)]
        same = ("material", "natural", "diameter", "end_length", "end_diameter", "k", "torsion")
        if (
            not all(close(getattr(wire, key), getattr(first, key)) for key in same)
            or springs[0] != springs[1]
            or not close(top[2], tops[0][2])
            or not close(wire.bottom[2], first.bottom[2])
        ):
            return None
    keys = {"d": first.bottom[2], "d_upper": -tops[0][2]}
    keys = {key: value for key, value in keys.items() if value}
    radii = [math.hypot(*point[:2]) for point in (*tops, *bottoms)]
    if count == 1:
        return keys if max(radii) < 1e-9 else None
    sizes = [[abs(point[n]) for point in points] for points in (tops, bottoms) for n in (0, 1)]
    even = all(close(max(own), min(own)) for own in sizes)
    s_upper, t1, s_lower, t2 = (own[0] for own in sizes)
    signs = {tuple(math.copysign(1, v) if abs(v) > 1e-9 else 0.0 for v in t[:2]) for t in tops}
    crossed = {(a[0] * b[0] < 0, a[1] * b[1] < 0) for a, b in zip(tops, bottoms, strict=True)}
    if even and count in (2, 4) and len(signs) == count and crossed == {(False, False)}:
        if count == 4 and all(0.0 not in sign for sign in signs):
            in_x = {"s": s_upper} if close(s_upper, s_lower) else {"s_upper": s_upper, "s_lower": s_lower}
            return {**in_x, "t1": t1, "t2": t2, **keys}
        if count == 2 and max(s_upper, s_lower) < 1e-9 and t1 > 0:
            return {"t1": t1, "t2": t2, **keys}
    upper, lower = radii[:count], radii[count:]
    angles = [math.atan2(top[1], top[0]) % math.tau for top in tops]
    turned = (math.atan2(low[1], low[0]) - a for low, a in zip(bottoms, angles, strict=True))
    steps = sorted((a - angles[0]) % math.tau for a in angles)
    if (
        min(radii) < 1e-9
        or not (close(max(upper), min(upper)) and close(max(lower), min(lower)))
        or any(abs(math.remainder(turn, math.tau)) > 1e-6 for turn in turned)
        or any(abs(math.remainder(step - n * math.tau / count, math.tau)) > 1e-6 for n, step in enumerate(sorted(step if step < math.tau - 1e-6 else 0.0 for step in steps)))
    ):
        return None
    phase = min(angles)
    ring = {"ring": upper[0]} if close(upper[0], lower[0]) else {"ring_upper": upper[0], "ring_lower": lower[0]}
    return {**ring, **({"phase": phase} if phase > 1e-9 else {}), **keys}


def _stage(
    body: Body, before: Body | None, bodies: list[Body], tables: dict[str, Any], notes: list[str]
) -> Iterator[str]:
    above = bodies[body.above]
    inertia: list[Any] = body.inertia
    if not any(inertia[a][b] for a in range(3) for b in range(3) if a != b):
        inertia = [inertia[n][n] for n in range(3)]
    on_keystone = above.filter_of is not None and above.filter_of in body.wires
    holder = "support" if above.ground else above.name + "-keystone" * on_keystone
    usual = "support" if before is None else before.name + "-keystone" * bool(before.filter_of)
    keys: dict[str, Any] = {"name": body.name}
    if holder != usual:
        keys["hangs_from"] = holder
    if body.name == "TM" and not body.below:
        keys["mirror"] = True
    start = _moved(body.offset, above.place if above.ground else (0.0, 0.0, 0.0))
    if on_keystone:
        assert above.filter_of is not None
        start = _minus(start, (0.0, 0.0, above.filter_of.top[2]))
    if body.wires and body.set_keys is None:
        keys["position"] = list(start)
    mass = body.mass
    if body.filter_of is not None:
        mass -= _keystone(body.filter_of)[0]
    keys["body"] = {"mass": mass, "inertia": inertia}
    yield from _table("[stage]", keys)
    if body.legs is not None:
        yield from _legs(body, notes)
    for wire in body.wires:
        share = body.load * GRAVITY / len(body.wires)
        if abs(wire.tension / share - 1) > 0.01:
            notes.append(
                f"wire {wire.name}: SUMCON puts its hinges for {wire.tension:.4g} N, it carries"
                f" about {share:.4g} N"
            )
    if body.set_keys is not None:
        yield from _wire_set(body, on_keystone, tables)
    else:
        shift = above.place if above.ground else (0.0, 0.0, 0.0)
        for wire in body.wires:
            yield from _wire(wire, shift, len(body.wires), tables)
    if body.filter_of is not None:
        yield from _filter(body, bodies)


def _names(wires: list[Wire]) -> str:
    return wires[0].name + (f" to {wires[-1].name}" if len(wires) > 1 else "")


def _wire_set(body: Body, on_keystone: bool, tables: dict[str, Any]) -> Iterator[str]:
    wire, shape = body.wires[0], dict(body.set_keys or {})
    if on_keystone:
        shape.pop("d_upper", None)
    keys = {"count": len(body.wires), "l": body.length} | shape | _elastic(wire, tables)
    yield from _table("stage.wires", keys, f"SUMCON: {_names(body.wires)}", _doubt(wire, tables))
    if wire.spring is not None and not on_keystone:
        springs = [one.spring[7] for one in body.wires if one.spring]
        keys = {"count": len(body.wires)} | _blade(wire, body.load * GRAVITY / len(body.wires))
        yield from _table("stage.blades", keys, f"SUMCON: {', '.join(map(_plain, springs))}")


def _wire(wire: Wire, shift: Vector, count: int, tables: dict[str, Any]) -> Iterator[str]:
    keys: dict[str, Any] = {"upper": list(_moved(wire.top, shift)), "lower": list(wire.bottom)}
    if count > 1 or wire.top[:2] != (0.0, 0.0) or wire.bottom[:2] != (0.0, 0.0) or wire.spring:
        keys["natural_length"] = wire.natural
    if wire.spring is not None:
        keys["blade"] = _word(wire.spring[7])
    keys |= _elastic(wire, tables)
    yield from _table("[stage.wire]", keys, f"SUMCON: {wire.name}", _doubt(wire, tables))
    if wire.spring is not None:
        keys = {"name": _word(wire.spring[7])} | _blade(wire, math.nan)
        yield from _table("[stage.blade]", keys)


def _elastic(wire: Wire, tables: dict[str, Any]) -> dict[str, Any]:
    keys: dict[str, Any] = {"material": _word(tables["mat"][wire.material][0])}
    ends = {"length": wire.end_length, "radius": wire.end_diameter / 2}
    if 0 < 2 * wire.end_length < wire.natural and wire.end_diameter != wire.diameter:
        keys["sections"] = [ends, {"radius": wire.diameter / 2}, ends]
    else:
        keys["radius"] = wire.diameter / 2
    bends = {"clamp": "bending-point"} if wire.bend else {"bending": "hinged"}
    return keys | {"k": wire.k, "torsion": wire.torsion} | bends


def _doubt(wire: Wire, tables: dict[str, Any]) -> dict[str, str]:
    """Comments on a spring constant that is not that of the material and the cross-section."""
    ends = min(2 * wire.end_length, wire.natural) if wire.end_diameter != wire.diameter else 0.0
    squares = wire.diameter**2, wire.end_diameter**2
    soft = (wire.natural + 2 * wire.bend - ends) / squares[0] + ends / squares[1] if min(squares) > 0 else 0.0
    modulus = tables["mat"][wire.material][2] * 1e9
    usual = modulus * math.pi / 4 / soft if soft else 0.0
    if usual and abs(wire.k / usual - 1) > 0.01:
        return {"k": f"material and cross-section give {usual:.5g} N/m"}
    return {}


def _keystone(wire: Wire) -> tuple[float, float]:
    """Mass of a keystone and the inertia of the blades that it shares with the filter, kg.

    SUMCON couples both bodies by an inertia, but has no keystone: it has little more than that.
    """
    assert wire.spring is not None
    _, _, _, load, counts, decibel, *_ = wire.spring
    coupling = 10 ** (decibel / 20) * load / GRAVITY if counts and decibel < -6 else 0.0
    return max(1.1 * coupling, 1e-4 * load / GRAVITY), coupling


def _filter(body: Body, bodies: list[Body]) -> Iterator[str]:
    wire = body.filter_of
    assert wire is not None and wire.spring is not None
    mass, coupling = _keystone(wire)
    keys = {"at": [0.0, 0.0, wire.top[2]], "stiffness": wire.spring[2]}
    load = (bodies[wire.lower].load + mass) * GRAVITY
    if abs(wire.spring[3] + mass * GRAVITY - load) > 1e-4 * wire.spring[2]:
        keys["load"] = wire.spring[3] + mass * GRAVITY
    keys["keystone"] = {"mass": mass}
    if coupling:
        keys["mass_coupling"] = coupling
    if wire.spring[8] > 1:
        keys["q"] = wire.spring[8]
    keys |= {"lateral_stiffness": RIGID, "tilt_stiffness": RIGID}
    comments = {
        "lateral_stiffness": "rigid, as in SUMCON",
        "keystone": "not in SUMCON: taken from the body, as light as mass_coupling allows",
        "mass_coupling": f"{wire.spring[5]:g} dB",
    }
    yield from _table("stage.filter", keys, f"SUMCON: {_plain(wire.spring[7])}", comments)


def _blade(wire: Wire, share: float) -> dict[str, Any]:
    assert wire.spring is not None
    _, _, stiffness, load, *_, q = wire.spring[:9]
    keys = {"stiffness": stiffness}
    if not abs(load - share) <= 1e-4 * stiffness:
        keys["load"] = load
    return keys | ({"loss_angle": 1 / q} if q > 1 else {})


def _legs(body: Body, notes: list[str]) -> Iterator[str]:
    assert body.legs is not None
    _, _, places, stiffness, q, name, length, decibel, negative, load, counts, *_ = body.legs
    name, lateral = _plain(name), sum(stiffness[:3])
    if lateral <= 0 or length <= 0:
        remedy = "correct the inverted pendulum in SUMCON"
        raise InputError.of("save$IP", f"has no stiffness or length ({name})", remedy)
    tops = [_turned((x, 0.0, z)) for x, z in places]
    probe = Wire(0, tops[0], 0, tops[0], 0, 1, 1, 0, 1, 1, (tops[0], tops[0]), "", 1, 1)
    ring = _symmetric(tops, [_at(probe, top) for top in tops]) or {}
    keys: dict[str, Any] = {"points": [list(top) for top in tops]}
    if "ring" in ring:
        keys = {"count": 3, "radius": ring["ring"], "phase": ring.get("phase", 0.0)}
    inertia = 10 ** (decibel / 20) * load / 3 if counts else 0.0
    ballast, mass = {}, body.load
    if inertia and negative:  # -m b/L (1 + b/L) couples foot and top, with b = L/2
        ballast = {"counterweight": {"mass": inertia / 0.75, "below": length / 2}}
        mass += 3 * inertia / 0.75 / 4
    elif inertia:  # a thin rod couples m/6
        ballast = {"leg_mass": 6 * inertia}
        mass += 3 * 6 * inertia / 3
    keys |= {"length": length, "frequency": math.sqrt(lateral / mass) / math.tau}
    keys |= {"axial_stiffness": RIGID, "yaw_stiffness": 0.0, "q": q[0]} | ballast
    comments = {
        "axial_stiffness": "rigid, as in SUMCON",
        "frequency": f"{lateral:.6g} N/m under {body.load:.6g} kg",
        "yaw_stiffness": "a spring of its own loss, below",
        next(iter(ballast), ""): f"stands for the {decibel:g} dB of SUMCON",
    }
    if max(stiffness[:3]) > 1.001 * min(stiffness[:3]) or len(set(q[:3])) > 1:
        notes.append(f"legs of {name} are equal: a third of the sum of their stiffnesses, Q of the first")
    if abs(load / body.load - 1) > 0.01:
        notes.append(
            f"legs of {name}: SUMCON tilts them with the ground under {load:.5g} kg, they carry"
            f" {body.load:.5g} kg"
        )
    yield from _table("stage.inverted_pendulum", keys, f"SUMCON: {name}", comments)
    if stiffness[3]:
        keys = {"stiffness": [0.0] * 5 + [stiffness[3]]}
        keys |= {"loss_angle": 1 / q[3]} if q[3] > 1 else {}
        yield from _table("[stage.spring]", keys, "yaw of the legs")


def _at(wire: Wire, point: Vector) -> Wire:
    return Wire(**(vars(wire) | {"top": point, "bottom": point}))


def _between(
    pair: tuple[int, int], points: tuple[Vector, Vector], bodies: list[Body]
) -> tuple[list[str], list[float], float]:
    """Names of two bodies, the point half-way between two points from the COM of the first, and
    the distance of both points, m.
    """
    first, second = (bodies[n] for n in pair)
    ends = _moved(points[0], first.place), _moved(points[1], second.place)
    middle = [(a + b) / 2 for a, b in zip(*ends, strict=True)]
    if first.ground:
        first, second = second, first
    other = second.name
    if second.ground:
        other = "ground" if any(body.ground for body in bodies[: second.number]) else "support"
    return [first.name, other], list(_minus(middle, first.place)), math.dist(*ends)


def _damper(row: list[Any], bodies: list[Body], notes: list[str]) -> Iterator[str]:
    name, first, second, at, other, matrix = row[:6]
    name, damping = _word(name, "damper"), _turned_matrix(matrix)
    if not any(map(any, damping)):
        notes.append(f"damper {name} is left out: all its numbers are 0")
        return
    if bodies[first].ground and bodies[second].ground:
        notes.append(f"damper {name} is left out: it joins two grounds")
        return
    between, point, apart = _between((first, second), (_turned(at), _turned(other)), bodies)
    if apart > 1e-3:
        notes.append(f"damper {name} acts at one point, half-way between two {apart:.3g} m apart")
    keys = {"name": name, "between": between, "at": point, "damping": _diagonal(damping)}
    yield from _table("[damper]", keys)


def _diagonal(matrix: list[list[float]]) -> list[Any]:
    if any(matrix[a][b] for a in range(6) for b in range(6) if a != b):
        return matrix
    return [matrix[n][n] for n in range(6)]


def _link(
    row: list[Any], bodies: list[Body], columns: Columns, files: dict[str, str], notes: list[str]
) -> Iterator[str]:
    first, second, at, other, span, _, q, matrix, tables, name = row[:10]
    name = _word(name, "link")
    if bodies[first].ground and bodies[second].ground:
        notes.append(f"heat link {name} is left out: it joins two grounds")
        return
    between, point, apart = _between((first, second), (_turned(at), _turned(other)), bodies)
    keys: dict[str, Any] = {"name": name, "between": between, "at": point}
    if apart > 1e-3:
        notes.append(f"heat link {name} acts at one point, half-way between its ends {apart:.3g} m apart")
    sine, cosine = (-span[2], span[0]) if span[0] or span[2] else (0.0, 1.0)
    size = math.copysign(math.hypot(sine, cosine), cosine)
    sine, cosine = sine / size, cosine / size
    loss = 1 / q if q > 1 else 0.0
    if any(map(any, tables)):
        named = {(a, b): one for a, line in enumerate(tables) for b, one in enumerate(line) if one}
        if lost := [one for (a, b), one in named.items() if a != b]:
            notes.append(f"heat link {name}: tables off the diagonal are left out ({lost[0]})")
        diagonal = [columns(tables[n][n]) if tables[n][n] else matrix[n][n] for n in range(6)]
        if abs(sine * cosine) > 1e-9 and tables[0][0] != tables[2][2]:
            notes.append(f"heat link {name}: its x and y stiffness are not coupled by its direction")
        text = _table_file(diagonal, loss, sine**2)
        file = "-".join(dict.fromkeys(_word(tables[n][n] or "0") for n in range(3))) + f"-{name}.csv"
        same = [known for known, own in files.items() if own == text]
        files[same[0] if same else file] = text
        yield from _table("[link]", keys)
        yield from _table("link.table", {"file": same[0] if same else file})
        return
    turn = [[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]]
    whole = [[0.0] * 6 for _ in range(6)]
    for n in range(3):
        whole[n][:3] = turn[n]
        whole[n + 3][n + 3] = 1.0
    half = [[sum(a * b for a, b in zip(line, col, strict=True)) for col in zip(*matrix, strict=True)] for line in whole]
    stiffness = [[sum(a * b for a, b in zip(line, own, strict=True)) for own in whole] for line in half]
    small = 1e-12 * max(abs(value) for line in stiffness for value in line)
    stiffness = [[0.0 if abs(value) <= small else value for value in line] for line in stiffness]
    if not any(map(any, stiffness)):
        notes.append(f"heat link {name} is left out: it has no stiffness")
        return
    keys["stiffness"] = _diagonal(_turned_matrix(stiffness))
    yield from _table("[link]", keys | ({"loss_angle": loss} if loss else {}))


def _table_file(diagonal: list[Any], loss: float, turned: float) -> str:
    """CSV of the stiffness of a heat link, whose x axis is turned by an angle of squared sine.

    `diagonal` has a table (rows of frequency, real, imaginary) or a number per axis of SUMCON.
    """
    grids = [one for one in diagonal if isinstance(one, list)]
    frequency = [row[0] for row in grids[0]]
    parts: list[list[complex]] = []
    for one in diagonal:
        if isinstance(one, list):
            parts.append([_interpolated(one, f) for f in frequency])
        else:
            parts.append([complex(one, loss * one)] * len(frequency))
    x, z = parts[0], parts[2]
    parts[0] = [a * (1 - turned) + b * turned for a, b in zip(x, z, strict=True)]
    parts[2] = [b * (1 - turned) + a * turned for a, b in zip(x, z, strict=True)]
    axes = [parts[n + block] for block in (0, 3) for n in (2, 0, 1)]
    lines = ["frequency," + ",".join(f"{a} real,{a} imaginary" for a in "x y z roll pitch yaw".split())]
    for f, *row in zip(frequency, *axes, strict=True):
        cells = [f, *(value for one in row for value in (one.real, one.imag))]
        lines.append(",".join(f"{cell:.6g}" for cell in cells))
    return "\n".join(lines) + "\n"


def _interpolated(rows: list[list[float]], frequency: float) -> complex:
    """Stiffness between the lines of a table, linear in the logarithm of frequency."""
    after = next((n for n, row in enumerate(rows) if row[0] >= frequency), len(rows) - 1)
    (f1, *low), (f2, *high) = rows[max(after - 1, 0)], rows[after]
    part = math.log(frequency / f1) / math.log(f2 / f1) if f2 > f1 else 1.0
    part = min(max(part, 0.0), 1.0)
    return complex(*(a + (b - a) * part for a, b in zip(low, high, strict=True)))


def _materials(tables: dict[str, Any], order: list[Body]) -> Iterator[str]:
    used = {wire.material for body in order for wire in body.wires}
    for number in sorted(used):
        name, density, modulus, poisson, digits, power, source = tables["mat"][number][:7]
        keys: dict[str, Any] = {"youngs_modulus": modulus * 1e9, "poisson_ratio": poisson}
        keys |= {"density": density * 1e3, "loss_angle": digits * 10.0 ** min(power, 9.0)}
        keys |= {"source": _plain(source, 300)} if source else {}
        yield from _table(f"materials.{_word(name)}", keys, f"SUMCON: {_plain(name)}")


def _title(text: str) -> str:
    found = re.search(r'^save\$FileName[ \t]*=\s*"([^"\n]{1,100})"', text, re.M)
    return found[1] if found else ""


def _plain(text: str, most: int = 60) -> str:
    """Text for a comment or a title: printable characters in one line."""
    return "".join(one if one.isprintable() else " " for one in text)[:most].strip()


def _word(text: str, default: str = "name") -> str:
    """Name for TOML: lower-case words of materials, else letters as they are."""
    word = re.sub(r"[^A-Za-z0-9_]+", "-", text.lower() if " " in text else text).strip("-")[:60]
    return word if re.match(r"[A-Za-z]", word) else f"{default}-{word}".rstrip("-")


def _table(
    head: str, keys: dict[str, Any], comment: str = "", comments: dict[str, str] | None = None
) -> list[str]:
    lines = ["", f"[{head}]" + (f"  # {comment}" if comment else "")]
    for key, value in keys.items():
        beside = (comments or {}).get(key)
        lines.append(f"{key} = {_toml(value)}" + (f"  # {beside}" if beside else ""))
    return lines


def _toml(value: Any) -> str:
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", " ")
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_toml(one)}' for key, one in value.items())} }}"
    if isinstance(value, int):
        return str(value)
    return repr(float(f"{value:.12g}"))
