"""Dotted paths to the values of a design: get, set and list them, and their units.

A path names keys of tables, and members of lists by name or number from 1: ``stage.test.wires.s``,
``stage.test.body.inertia.2``. It leads through a parsed TOML document (dicts and lists) or a
`Design` (structs).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cache
from typing import Any

import msgspec

from suspension_cli.conventions import DOFS
from suspension_cli.design.schema import Design
from suspension_cli.design.typed_tables import Raw, Table, declared
from suspension_cli.errors import InputError, format_value, suggest
from suspension_cli.grids import parse_place

Value = Any
"""A value of a parsed document or of a design: a number, a text, a list or a table."""
DISPLAYED = {"m": ("mm", 1e3), "rad": ("mrad", 1e3), "Pa": ("GPa", 1e-9)}
"""Customary unit by SI unit, and the factor to it."""
PAIRS = ("zeros", "poles", "temperature")
"""Keys of lists of pairs, which are no symmetric matrices: of real and imaginary parts, of places
and temperatures."""
WHOLE = ("count", "steps")
"""Keys that take integers."""
LOW_PRESSURE = 1e6
"""Pa; below it a value is a pressure, not a modulus or strength."""


def member(items: Sequence[object], key: str) -> int | None:
    """Position of the member of a list with a name, or a number from 1; None if there is none.

    >>> member([{"name": "upper"}, {"name": "test"}], "test"), member([1.0, 2.0], "2")
    (1, 1)
    """
    for position, item in enumerate(items):
        if name_of(item) == key:
            return position
    return parse_place(key, len(items))


def name_of(item: object) -> object:
    """Name of a table, parsed or checked; None if it has none."""
    return item.get("name") if isinstance(item, dict) else getattr(item, "name", None)


def value_at(document: Raw | Table, path: str) -> Value:
    """Value of a parsed document or a table at a dotted path; None if there is none."""
    node: Value = document
    for key in path.split("."):
        if isinstance(node, (list, tuple)):
            place = member(node, key)
            node = None if place is None else node[place]
        elif isinstance(node, msgspec.Struct):
            node = getattr(node, key, None)
        else:
            node = node.get(key) if isinstance(node, dict) else None
    return node


def assign(document: Raw, keys: list[str], value: object, override: str) -> None:
    """Set a value in a parsed document, in place; missing tables are made. See `changed`."""
    document |= changed(document, keys, lambda _: value, override)


def changed(
    node: Value, keys: Sequence[str], change: Callable[[Value], Value], override: str = ""
) -> Value:
    """Copy a document or a tree of structs with one value replaced by a function of it.

    It shares all tables and lists that do not change. Missing tables of a document are made.
    `override` is the setting as given, for errors. Raises `InputError` if a list is missing or has
    no such member, or the path leads through a value.
    """
    if not keys:
        return change(node)
    key = keys[0]
    rest = keys[1:]
    done = override.partition("=")[0].split(".")[: -len(keys)]
    if isinstance(node, msgspec.Struct):
        new = changed(getattr(node, key), rest, change, override)
        return msgspec.structs.replace(node, **{key: new})
    if isinstance(node, (list, tuple)):
        place = member(node, key)
        if place is None:
            names = [str(name_of(item) or n) for n, item in enumerate(node, 1)]
            problem = f"there is no {key!r} here"
            raise InputError.of("--set", problem, suggest(key, names), format_value(override))
        own = changed(node[place], rest, change, override)
        return type(node)(own if n == place else item for n, item in enumerate(node))
    if not isinstance(node, dict):
        problem = f"{'.'.join(done)} is a value, not a table"
        raise InputError.of("--set", problem, "shorten the path", format_value(override))
    if rest and key not in node and rest[0].isdigit():
        whole = ".".join([*done, key])
        problem = f"the design gives no {whole} of which this is a member"
        remedy = f"give {whole} whole, or take what the design gives there: {', '.join(node)}"
        raise InputError.of("--set", problem, remedy, format_value(override))
    return node | {key: changed(node.get(key, {}), rest, change, override)}


def numbers(path: str, value: object, skip: Collection[str] = ()) -> Iterator[tuple[str, float]]:
    """List all numbers below a path of a parsed document, without those under the keys `skip`.

    A symmetric matrix (3 or 6 rows) gives its upper triangle, see `twins`.
    """
    if isinstance(value, dict):
        for key, item in value.items():
            if key not in skip:
                yield from numbers(f"{path}.{key}", item, skip)
    elif isinstance(value, list):
        sizes = {len(row) if isinstance(row, list) else 0 for row in value}
        square = len(value) in (3, 6) and sizes == {len(value)}
        for n, item in enumerate(value, 1):
            if square:
                for m in range(n, len(value) + 1):
                    yield f"{path}.{n}.{m}", float(item[m - 1])
            else:
                named = isinstance(item, dict) and "name" in item
                yield from numbers(f"{path}.{item['name'] if named else n}", item, skip)
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        yield path, float(value)


def twins(path: str) -> tuple[str, ...]:
    """A path, and that of its mirror image where it is an element of a symmetric matrix.

    >>> twins("stage.test.body.inertia.1.2")
    ('stage.test.body.inertia.1.2', 'stage.test.body.inertia.2.1')
    """
    *head, row, column = path.split(".") if path.count(".") > 1 else ("", "", path)
    of_matrix = row.isdigit() and column.isdigit() and head[-1] not in PAIRS
    mirrored = of_matrix and row != column
    return (path, ".".join([*head, column, row])) if mirrored else (path,)


def settings(values: Mapping[str, float]) -> tuple[str, ...]:
    """Settings ``path=value`` of numbers, as ``--set`` takes them, to all digits."""
    return tuple(f"{path}={number_for(path, value)!r}" for path, value in values.items())


def number_for(path: str, value: float) -> float | int:
    """Make a varied number one that the key of a path takes: an integer where that is wanted."""
    whole = path.rpartition(".")[2] in WHOLE and float(value).is_integer()
    return int(value) if whole else float(value)


def symmetric_settings(values: Mapping[str, float]) -> tuple[str, ...]:
    """`settings` that also set the mirror images of elements of symmetric matrices."""
    return settings({path: value for name, value in values.items() for path in twins(name)})


@cache
def unit_of(path: str) -> str:
    """Return the SI unit of the number at a dotted path, as ``--set`` takes it; "" if it has none.

    >>> unit_of("stage.test.wires.d"), unit_of("design.name")
    ('m', '')
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


def is_loss_angle(path: str) -> bool:
    """Whether a dotted path leads to a loss angle.

    >>> is_loss_angle("materials.steel302.loss_angle"), is_loss_angle("stage.lossy.wires.d")
    (True, False)
    """
    keys = path.split(".")
    names = keys[2:] or keys[-1:]  # after the name of a stage or material
    in_losses = any(key in ("loss", "loss_angle") for key in names)
    return in_losses and names[-1] != "surface_depth"


def displayed_unit(path: str, value: float) -> tuple[str, float]:
    """Choose the customary unit of a number of a design, and the factor to it from SI.

    The unit of a pure number is "". Loss angles are in rad, not in mrad like rotations.

    >>> displayed_unit("stage.test.wires.d", 0.0015), displayed_unit("gas.pressure", 1e-5)
    (('mm', 1000.0), ('Pa', 1.0))
    >>> displayed_unit("materials.steel302.loss_angle", 1e-9)
    ('rad', 1.0)
    """
    unit = unit_of(path)
    if is_loss_angle(path):
        return unit, 1.0
    if unit == "1" or (unit == "Pa" and abs(value) < LOW_PRESSURE):
        return unit.removeprefix("1"), 1.0
    return DISPLAYED.get(unit, (unit, 1.0))


def format_with_unit(path: str, value: float, digits: int = 4) -> str:
    """Write a number of a design in its customary unit.

    >>> format_with_unit("stage.test.wires.d", 0.0015)
    '1.5 mm'
    """
    name, factor = displayed_unit(path, value)
    return f"{value * factor:.{digits}g} {name}".rstrip()
