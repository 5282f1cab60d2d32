"""The tables of a save, checked."""

from __future__ import annotations

from typing import Any

from suspension_cli.design.sumcon.mathematica import Form, find_fault, read_list
from suspension_cli.errors import Fault, InputError

Tables = dict[str, list[list[Any]]]
"""Rows of the tables of a save, by name; numbers of other rows count from 0."""
POINT, SIX = [float] * 3, [float] * 6
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
    "IP": [
        float,
        float,
        [[float] * 2] * 3,
        *[[float] * 4] * 2,
        str,
        *[float] * 2,
        bool,
        float,
        bool,
    ],
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
