"""The tables of a save: lists that Mathematica wrote, ``save$mass = {{26.6, {1.99, 0, 0}}, ...}``.

Only lists, numbers, texts, and names without a value are read; nothing is evaluated. The form of
the rows is checked.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from suspension_cli.design.derive import set_geometry
from suspension_cli.design.faults import convert
from suspension_cli.design.wires import WireSet
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.importing.imported import plain, word

Value = float | bool | str | list["Value"]
"""What a list contains; names other than True and False are texts."""
MOST_MEMBERS = 200_000
"""Members of one list: far more than those of any suspension."""

_STATEMENT = r"^{}[ \t]*=(?!=)"
_TOKEN = re.compile(
    r"""(?P<mark>[{}])|"(?P<text>(?:[^"\\]|\\.)*+)"
    |(?P<number>[-+]?+(?:\d++\.?+\d*+|\.\d++))(?:``?+[-+.\d]*+)?+(?:\*\^(?P<power>[-+]?+\d{1,4}))?+
    |(?P<name>[A-Za-z$][\w$]*+)""",
    re.VERBOSE | re.DOTALL,
)


def read_list(text: str, name: str) -> list[Value] | None:
    """Read the list that the last statement of a name assigns; None without such a statement.

    Raises `InputError` if the statement ends too early or assigns an expression.
    """
    found = [match.end() for match in re.finditer(_STATEMENT.format(re.escape(name)), text, re.M)]
    if not found:
        return None
    after = re.compile(_STATEMENT.format(r"[\w$]+"), re.M).search(text, found[-1])
    own = text[found[-1] : after.start() if after else None]
    written = _TOKEN.sub(_as_json, own).lstrip()
    remedy = "save the model in SUMCON again"

    def number(digits: str) -> float:
        if abs(value := float(digits)) < 1e150:
            return value
        correct = "correct it in SUMCON"
        raise InputError.of(name, "has a number too large", correct, format_value(value))

    try:
        decoder = json.JSONDecoder(parse_float=number, parse_int=number)
        result, at = decoder.raw_decode(written)
    except json.JSONDecodeError as error:
        result = None
        at = error.pos
    except RecursionError:
        result = None
        at = 0
    if isinstance(result, list) and written.count(",") < MOST_MEMBERS:
        return result
    rest = written[at:].translate({ord("["): "{", ord("]"): "}"}).strip()
    if not rest and result is None:
        raise InputError.of(name, "ends too early", "the file is truncated: copy it again")
    shown = format_value(rest[:30].strip())
    raise InputError.of(name, "is not a list of numbers and texts", remedy, shown)


def _as_json(token: re.Match[str]) -> str:
    """Write a token of Mathematica in JSON."""
    if token["mark"]:
        return "[" if token["mark"] == "{" else "]"
    if token["number"] is None:
        word = token["name"]
        known = {"True": "true", "False": "false"}
        return known.get(word) or json.dumps(token["text"] if word is None else word)
    sign, digits = re.fullmatch(r"\+?(-?)(.*)", token["number"]).groups()  # type: ignore[union-attr]
    whole, dot, part = digits.partition(".")
    power = f"e{token['power']}" if token["power"] else ""
    return f"{sign}{(whole.lstrip('0') or '0')}{f'.{part or 0}' if dot else ''}{power}"


Form = type | Sequence["Form"]
"""Form of a value: float, bool or str, or the forms of a list's members."""


def find_fault(value: Value, form: Form, path: str) -> Fault | None:
    """Find the first place where a value has another form; lists may have further members."""
    remedy = "save the model in SUMCON 1.3 again"
    if isinstance(form, type):
        if isinstance(value, form):
            return None
        wanted = {float: "a number", bool: "True or False", str: "a text"}[form]
        return Fault(path, f"is not {wanted}", remedy, _shown(value))
    if not isinstance(value, list) or len(value) < len(form):
        return Fault(path, f"is not a list of {len(form)}", remedy, _shown(value))
    pairs = enumerate(zip(value, form, strict=False), 1)
    found = (find_fault(one, own, f"{path}.{n}") for n, (one, own) in pairs)
    return next(filter(None, found), None)


def _shown(value: Value) -> str:
    return f"a list of {len(value)}" if isinstance(value, list) else format_value(value)


Tables = dict[str, list[list[Any]]]
"""Rows of the tables of a save, by name; numbers of other rows count from 0."""
POINT = [float] * 3
SIX = [float] * 6
LAST = [bool, float, bool]
FORMS: dict[str, Form] = {
    "bdn": [bool, str],  # whether it is ground, name
    "mass": [float, [POINT] * 3],
    "mat": [str, *[float] * 5, str],  # g/cm^3, GPa, Poisson's ratio, loss (digits, power), source
    "initpos": POINT,
    # upper body and end, lower body and end, material, natural length, diameter, length and
    # diameter of the ends, tension, directions of the hinges, name, k, torsion
    "wire": [float, POINT, float, POINT, float, *[float] * 5, POINT, POINT, str, float, float],
    # wire, end, k, load, whether its inertia counts, dB, direction, name, Q
    "vspr": [float, float, float, float, bool, float, POINT, str, float],
    # base, top, places, stiffness and Q (lateral of each leg, yaw), name, length, dB, whether its
    # inertia is negative, load in kg, whether its inertia counts
    "IP": [*[float] * 2, [[float] * 2] * 3, *[[float] * 4] * 2, str, float, float, *LAST],
    # two bodies and points, span, shape, Q, stiffness, names of tables, name
    "HL": [float, float, POINT, POINT, POINT, float, float, [SIX] * 6, [[str] * 6] * 6, str],
    "damp": [str, float, float, POINT, POINT, [SIX] * 6],
}
"""Vertical springs are `vspr`, inverted pendulums `IP`, heat links `HL`."""
NEEDED = ("bdn", "mass", "mat", "wire")
MOST = {"bdn": 200, "wire": 2000, "vspr": 2000, "HL": 500, "damp": 500}
NUMBERS = [
    ("wire", (0, 2), "bdn"),
    ("wire", (4,), "mat"),
    ("vspr", (0,), "wire"),
    ("IP", (0, 1), "bdn"),
    ("HL", (0, 1), "bdn"),
    ("damp", (1, 2), "bdn"),
]
"""Table, places in its rows, and the table whose rows these number."""


def read_tables(text: str) -> Tables:
    """Read the tables of a save from its text; raises `InputError`."""
    result: dict[str, Any] = {}
    for key, form in FORMS.items():
        rows = read_list(text, f"save${key}")
        if rows is None and key in NEEDED:
            remedy = "name a whole save of SUMCON (models/sumcon/save/*.m)"
            raise InputError.of("", f"has no save${key}", remedy)
        result[key] = rows or []
        if len(result[key]) > MOST.get(key, 1000):
            raise InputError.of(f"save${key}", f"has {len(result[key])} rows", "give fewer")
        for n, row in enumerate(result[key], 1):
            if key == "IP":
                _complete_legs(row)
            if fault := find_fault(row, form, f"save${key}.{n}"):
                raise InputError([fault])
    if len(result["mass"]) < len(result["bdn"]):
        problem = f"has {len(result['mass'])} rows for {len(result['bdn'])} bodies"
        raise InputError.of("save$mass", problem, "complete it in SUMCON")
    for key, places, of in NUMBERS:
        for n, row in enumerate(result[key], 1):
            for place in places:
                _number(row, place, len(result[of]), f"save${key}.{n}.{place + 1}")
    return result


def _complete_legs(row: Any) -> None:
    """Add the yaw of legs that SUMCON 1.0 wrote without it."""
    for place, usual in ((3, 0.0), (4, 1000.0)):
        if isinstance(row, list) and len(row) > 4 and isinstance(row[place], list):
            row[place] += [usual] * (4 - len(row[place]))


def _number(row: list[Any], place: int, most: int, path: str) -> None:
    """Make the number of another row count from 0; raises `InputError` if there is no such row."""
    if row[place] not in range(1, most + 1):
        problem = f"is not a whole number from 1 to {most}"
        raise InputError([Fault(path, problem, "correct it in SUMCON", f"{row[place]:g}")])
    row[place] = int(row[place]) - 1


# Bodies.

GRAVITY = 9.81
LONGEST_BENDS = 0.45
"""Fraction of a wire that its bends may take for hinges; the string model refuses half."""
TWELFTH = math.pi / 12
"""Angle whose multiples are taken as exact, rad."""


@dataclass(frozen=True)
class Wire:
    """A wire in our axes; m, N, kg."""

    upper: int
    top: np.ndarray
    lower: int
    bottom: np.ndarray
    material: int
    natural: float
    diameter: float
    end_length: float
    end_diameter: float
    tension: float
    hinges: tuple[np.ndarray, np.ndarray]
    name: str
    k: float
    torsion: float
    spring: list[Any] | None = None  # row of its vertical spring
    bend: float = 0.0  # distance of its ends from the clamps if these are at SUMCON's hinges

    @property
    def elastic(self) -> tuple[float, ...]:
        """What wires of a set have in common."""
        ends = self.end_length, self.end_diameter
        spring = [(self.spring or [0.0] * 9)[n] for n in (2, 3, 5, 8)]
        return (self.material, self.natural, self.diameter, *ends, self.k, self.torsion, *spring)


@dataclass
class Body:
    """A body, and where it hangs or stands; kg, m.

    `offset` and `place` are its COM from the COM of the body above (or the ground) and from the
    suspension point.
    """

    number: int
    name: str
    ground: bool
    mass: float
    inertia: np.ndarray
    above: Body | None = None
    wires: list[Wire] = field(default_factory=list)
    legs: list[Any] | None = None
    below: list[Body] = field(default_factory=list)
    load: float = 0.0  # mass of this body and all below
    length: float = 0.0  # loaded, of its wires
    offset: np.ndarray = field(default_factory=lambda: np.zeros(3))
    place: np.ndarray = field(default_factory=lambda: np.zeros(3))
    set_keys: dict[str, Any] | None = None  # of a symmetric set; None where wires are single
    blades_for: Wire | None = None  # the wire on the keystone, if the body is a filter

    @property
    def share(self) -> float:
        """Weight on each of the wires, N."""
        return self.load * GRAVITY / max(len(self.wires), 1)

    @property
    def is_balanced(self) -> bool:
        """Whether this body and all below it hang from symmetric sets."""
        held = self.set_keys is not None or self.legs is not None
        return held and all(body.is_balanced for body in self.below)


def turned(point: Sequence[float]) -> np.ndarray:
    """Turn a vector from SUMCON's axes into ours; below 1e-12 m it is rounding."""
    own = np.array([point[2], point[0], point[1]])
    return np.where(abs(own) < 1e-12, 0.0, own)


def turned_matrix(rows: Sequence[Sequence[float]] | np.ndarray) -> np.ndarray:
    """Turn the axes of a 3x3 or 6x6 matrix."""
    order = [n + block for block in range(0, len(rows), 3) for n in (2, 0, 1)]
    return np.array(rows, dtype=float)[np.ix_(order, order)]


def read_bodies(tables: Tables, bending_points: bool, notes: list[str]) -> list[Body]:
    """List the bodies of a save with their places; `order` lists those that are not ground."""
    bodies: list[Body] = []
    for row, (mass, inertia, *_) in zip(tables["bdn"], tables["mass"], strict=False):
        own = word(row[1], "body")
        if own.lower() in ("support", "ground") or own in [body.name for body in bodies]:
            own = f"{own}-{len(bodies) + 1}"
        if own != row[1] and not row[0]:
            notes.append(f"body {plain(row[1])} is {own} here")
        bodies.append(Body(len(bodies), own, row[0], mass, turned_matrix(inertia)))
    springs = {row[0]: row for row in tables["vspr"]}
    for n, row in enumerate(tables["wire"]):
        upper, top, lower, bottom, *numbers, first, second, name, k, torsion = row[:15]
        hinges = (turned(first), turned(second))
        spring = springs.get(n)
        own: Any = (*numbers, hinges, plain(name), k, torsion, spring)
        wire = Wire(upper, turned(top), lower, turned(bottom), *own)
        if wire.tension <= 0 or wire.natural <= 0 or wire.k <= 0:
            problem = f"has no tension, length or k ({wire.name})"
            raise InputError.of("save$wire", problem, "correct it in SUMCON")
        if spring and (spring[1] != 1 or max(map(abs, spring[6][::2])) > 1e-9):
            notes.append(f"spring {plain(spring[7])} moves the upper end along z alone")
        bodies[lower].wires.append(wire)
    for body in bodies:
        _hang(body, bodies, tables, notes)
    _set_places(bodies, tables, bending_points, notes)
    return bodies


def order(bodies: list[Body]) -> list[Body]:
    """List the bodies that are not ground below what they hang from; raises `InputError`."""
    found: list[Body] = []
    waiting = [body for body in bodies if body.ground][::-1]
    while waiting:
        body = waiting.pop()
        found += [] if body.ground else [body]
        waiting += body.below[::-1]
    held = {body.number for body in found}
    loose = [body.name for body in bodies if not body.ground and body.number not in held]
    if loose or not found:
        problem = f"does not hold {', '.join(loose[:5]) or 'any body'}"
        raise InputError.of("save$wire", problem, "hang every body from the ground")
    return found


def _hang(body: Body, bodies: list[Body], tables: Tables, notes: list[str]) -> None:
    """Find what a body stands on, or hangs from by most of its tension."""
    wires = body.wires
    body.wires = []
    legs = [row for row in tables["IP"] if row[1] == body.number]
    tension = {wire.upper: 0.0 for wire in wires}
    for wire in wires:
        tension[wire.upper] += wire.tension
    if legs and not body.ground:
        body.legs = legs[0]
        body.above = bodies[legs[0][0]]
        notes += [f"inverted pendulum {plain(row[5])} is left out" for row in legs[1:]]
    elif wires and not body.ground:
        body.above = bodies[max(tension, key=lambda n: tension[n])]
        body.wires = [wire for wire in wires if wire.upper == body.above.number]
    for wire in wires:
        if not any(wire is one for one in body.wires):
            notes.append(f"wire {wire.name} is left out: {body.name} is held by another body")
    if body.above is not None:
        body.above.below.append(body)


def _set_places(bodies: list[Body], tables: Tables, bending_points: bool, notes: list[str]) -> None:
    grounds = [body for body in bodies if body.ground]
    hanging = order(bodies)
    if len(tables["initpos"]) >= len(bodies):
        for body in grounds[1:]:
            at, start = (tables["initpos"][one.number] for one in (body, grounds[0]))
            body.place = turned([a - b for a, b in zip(at, start, strict=False)])
            if body.below:
                notes.append(f"{body.name} (ground) does not move alone: it is the support here")
    for body in hanging[::-1]:
        body.load = body.mass + sum(one.load for one in body.below)
        modulus = [tables["mat"][wire.material][2] * 1e9 for wire in body.wires]
        longest = 0.0 if bending_points else LONGEST_BENDS
        pairs = zip(body.wires, modulus, strict=True)
        body.wires = [_at_hinges(wire, e, body.share, longest) for wire, e in pairs]
    for body in hanging:
        assert body.above is not None
        start = body.above.place if body.above.ground else np.zeros(3)
        if body.legs is not None:
            body.offset = np.array([0.0, 0.0, body.legs[6]])
        else:
            _set_length(body, start)
        body.place = body.offset + (body.above.place - start)
    for body in hanging[::-1]:
        if not all(one.is_balanced for one in body.below):
            body.set_keys = None
    for body in hanging:
        above = body.above
        if body.set_keys is not None and len(body.wires) == 1 and above and not above.ground:
            wire = body.wires[0]
            above.blades_for = above.blades_for or (wire if wire.spring else None)


def _at_hinges(wire: Wire, modulus: float, share: float, longest: float) -> Wire:
    """The wire, with its ends at SUMCON's hinges if its bends take more than a fraction of it."""
    bends = [
        math.sqrt(modulus * math.pi / 64 / tension) * wire.end_diameter**2
        for tension in (wire.tension, max(share, 1e-9))
    ]
    if 2 * max(bends) <= longest * wire.natural or 2 * bends[0] >= wire.natural:
        return wire
    top = wire.top + bends[0] * wire.hinges[0]
    bottom = wire.bottom + bends[0] * wire.hinges[1]
    natural = wire.natural - 2 * bends[0]
    return replace(wire, top=top, bottom=bottom, natural=natural, bend=bends[0])


def _set_length(body: Body, start: np.ndarray) -> None:
    """Set the loaded length of the wires, their keys as a set, and the offset of the body.

    `start` is the place of a ground from the suspension point, else 0.
    """
    tops = [wire.top + start for wire in body.wires]
    body.set_keys = symmetric(tops, [wire.bottom for wire in body.wires])
    if any(not np.allclose(wire.elastic, body.wires[0].elastic, 1e-6) for wire in body.wires):
        body.set_keys = None
    first = body.wires[0]
    across = math.dist(tops[0][:2], first.bottom[:2]) if body.set_keys is not None else 0.0
    body.length = first.natural
    upright = 1.0
    for _ in range(100):  # the stretch changes the angle, each time by less
        upright = math.sqrt(max(1 - (across / body.length) ** 2, 1e-6))
        body.length = first.natural + body.share / (upright * first.k)
    gaps = [top - wire.bottom for top, wire in zip(tops, body.wires, strict=True)]
    body.offset = np.mean(gaps, axis=0) - [0.0, 0.0, body.length * upright]
    if body.set_keys is not None:
        body.offset[:2] = 0.0


def symmetric(tops: Sequence[np.ndarray], bottoms: Sequence[np.ndarray]) -> dict[str, Any] | None:
    """Keys of a symmetric set of wires with these ends; None if they are not symmetric.

    The wire above the quadrant of positive x and y proposes a grid and a ring; a set whose wires
    have all these ends, in any order, is it.
    """
    given = np.array([[*top, *bottom] for top, bottom in zip(tops, bottoms, strict=True)])
    x, y, top, u, v, bottom = map(float, max(given, key=lambda ends: tuple(ends[:2] > -1e-9)))
    count = len(given)
    across = {"t1": y, "t2": v}
    radius = math.hypot(x, y)
    turn = min(np.arctan2(given[:, 1], given[:, 0]) % math.tau)
    if abs(math.remainder(turn, TWELFTH)) < 1e-9:
        turn = round(turn / TWELFTH) * TWELFTH
    ring = _pair("ring", radius, (u * x + v * y) / max(radius, 1e-9))
    further = {"d": bottom, "d_upper": -top}
    for keys in {1: [{}], 2: [across, ring]}.get(count, [_pair("s", x, u) | across, ring]):
        optional = {"phase": float(turn)} | further if keys is ring else further
        own = keys | {key: value for key, value in optional.items() if value}
        try:
            wires = convert({"count": count, "l": 1e5, "k": 1.0} | own, WireSet)
        except InputError:
            continue
        made = [[*upper, top, *lower, bottom] for upper, lower in set_geometry(wires).ends]
        same = np.isclose(given[:, None], made, rtol=1e-6, atol=1e-9).all(-1)
        if same.any(0).all() and same.any(-1).all():
            return own
    return None


def _pair(name: str, upper: float, lower: float) -> dict[str, float]:
    if math.isclose(upper, lower, rel_tol=1e-6):
        return {name: upper}
    return {f"{name}_upper": upper, f"{name}_lower": lower}


def hinge_notes(body: Body) -> Iterator[str]:
    """Say where hinges are not those of SUMCON, or wires are too stiff for hinges."""
    share = body.share
    for same in {(wire.tension, wire.bend, wire.natural): wire for wire in body.wires}.values():
        names = names_of([wire for wire in body.wires if wire.tension == same.tension])
        part = 2 * same.bend / (same.natural + 2 * same.bend)
        if part > LONGEST_BENDS:
            yield (
                f"wire {names}: its bends take {part:.0%} of it, so its ends are its bending"
                f" points, {same.bend:.3g} m from the clamps"
            )
        elif abs(same.tension / share - 1) > 0.01:
            yield (
                f"wire {names}: SUMCON puts its hinges for {same.tension:.4g} N, it carries about"
                f" {share:.4g} N"
            )


def names_of(wires: list[Wire]) -> str:
    """First and last name of wires."""
    return wires[0].name + (f" to {wires[-1].name}" if len(wires) > 1 else "")
