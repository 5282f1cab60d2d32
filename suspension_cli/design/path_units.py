"""Units of the numbers of a design, from the types of the file's tables."""

from __future__ import annotations

from functools import cache
from typing import Any

from suspension_cli.conventions import DOFS
from suspension_cli.design.schema import Design
from suspension_cli.design.tables import Table, declared

DISPLAYED = {"m": ("mm", 1e3), "rad": ("mrad", 1e3), "Pa": ("GPa", 1e-9)}
"""Customary unit by SI unit, and the factor to it."""
LOW_PRESSURE = 1e6
"""Pa; below it a value is a pressure, not a modulus or strength."""


@cache
def unit_of(path: str) -> str:
    """Return the SI unit of the number at a dotted path, as ``--set`` takes it; "" if it has none.

    Examples
    --------
    >>> unit_of("stage.test.wires.d"), unit_of("materials.steel302.density")
    ('m', 'kg/m^3')
    >>> unit_of("stage.test.body.inertia.2"), unit_of("design.name")
    ('kg m^2', '')
    """
    kinds: tuple[type[Table], ...] = (Design,)
    facts: dict[str, Any] = {}
    keys = path.split(".")
    for key in keys:
        known = [kind for kind in kinds if key in kind.__struct_fields__]
        if facts.pop("listed", False) or not known:
            continue  # the name or number of a member
        facts = dict(declared(known[0])[key])
        kinds = facts.get("tables", ())
    if "unit" not in facts and keys[-2:-1] == ["damping"] and keys[-1] in DOFS:
        return "N s/m" if keys[-1] in DOFS[:3] else "N m s/rad"
    return facts.get("unit", "")


def displayed_unit(path: str, value: float) -> tuple[str, float]:
    """Choose the customary unit of a number of a design, and the factor to it from SI.

    The unit of a pure number is "".

    Examples
    --------
    >>> displayed_unit("stage.test.wires.d", 0.0015), displayed_unit("gas.pressure", 1e-5)
    (('mm', 1000.0), ('Pa', 1.0))
    """
    unit = unit_of(path)
    if unit == "1" or (unit == "Pa" and abs(value) < LOW_PRESSURE):
        return unit.removeprefix("1"), 1.0
    return DISPLAYED.get(unit, (unit, 1.0))


def format_with_unit(path: str, value: float, digits: int = 4) -> str:
    """Write a number of a design in its customary unit.

    Examples
    --------
    >>> format_with_unit("stage.test.wires.d", 0.0015)
    '1.5 mm'
    """
    name, factor = displayed_unit(path, value)
    return f"{value * factor:.{digits}g} {name}".rstrip()
