"""Units of the numbers of a design, from the types of the file's tables."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

from msgspec import inspect

from suspension_cli.conventions import DOFS
from suspension_cli.design.schema import Design

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
    nodes, keys = [_design()], path.split(".")
    for key in keys:
        nodes = [below for node in nodes for below in _children(node, key)]
    known = next((unit for node in nodes for unit in _units(node)), "")
    if not known and keys[-2:-1] == ["damping"] and keys[-1] in DOFS:
        return "N s/m" if keys[-1] in DOFS[:3] else "N m s/rad"
    return known


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


@cache
def _design() -> inspect.Type:
    return inspect.type_info(Design)


def _children(node: inspect.Type, key: str) -> Iterator[inspect.Type]:
    """Types of the value under a key of a table, or of a member of a list."""
    if isinstance(node, inspect.Metadata):
        yield from _children(node.type, key)
    elif isinstance(node, inspect.UnionType):
        for one in node.types:
            yield from _children(one, key)
    elif isinstance(node, inspect.StructType):
        yield from (field.type for field in node.fields if field.encode_name == key)
    elif isinstance(node, inspect.DictType):
        yield node.value_type
    elif isinstance(node, inspect.ListType):
        yield node.item_type
    elif isinstance(node, inspect.TupleType):
        yield from node.item_types[:1]


def _units(node: inspect.Type) -> Iterator[str]:
    """Units of a value: its own, or that of the members of a list or union."""
    if isinstance(node, inspect.Metadata):
        unit = (node.extra or {}).get("unit", "")
        if unit:
            yield unit
        yield from _units(node.type)
    elif isinstance(node, inspect.UnionType):
        for one in node.types:
            yield from _units(one)
    elif isinstance(node, (inspect.ListType, inspect.TupleType)):
        yield from (unit for one in _children(node, "1") for unit in _units(one))
