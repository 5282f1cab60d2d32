"""The tables of a save: lists that Mathematica wrote, ``save$mass = {{26.6, {1.99, 0, 0}}, ...}``.

Only lists, numbers, texts, and names without a value are read; nothing is evaluated. The form of
the rows is checked.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any

from suspension_cli.errors import Fault, InputError, format_value

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
        result, at = None, error.pos
    except RecursionError:
        result, at = None, 0
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
POINT, SIX, LAST = [float] * 3, [float] * 6, [bool, float, bool]
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
