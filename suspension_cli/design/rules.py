"""Rules of tables: declared beside each table, applied to a whole document at once.

`Table.faults` yields key, problem and remedy of what is wrong with a table beyond its single
values; the functions here are the rules that several tables share. `find_faults` walks a document
and adds path and value.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

from msgspec import Meta, Struct

from suspension_cli.design import faults
from suspension_cli.design.faults import fault_of, step
from suspension_cli.design.units import Problems, Raw, Table
from suspension_cli.errors import Fault, InputError

T = TypeVar("T", bound=Table)

LEAST_MASS = 1e-9
"""Smallest mass, kg, or moment of inertia, kg m^2, other than 0."""


def convert(raw: Raw, kind: type[T]) -> T:
    """Convert a parsed TOML document to a type; raises `InputError` with all faults of it."""
    document = faults.convert(raw, kind)
    if found := [*find_faults(document)]:
        raise InputError(found)
    return document


def find_faults(document: Struct) -> Iterator[Fault]:
    """Find what breaks the rules of any table of a document."""
    for path, table in tables(document):
        for key, problem, remedy in table.faults():
            yield fault_of(table, path, key, problem, remedy)


def tables(node: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """List a table and all tables in it, each behind its key path."""
    if isinstance(node, Struct):
        yield path, node
        for key, _ in keys_with(type(node), "tables"):
            if value := getattr(node, key):
                yield from tables(value, f"{path}.{key}" if path else key)
    elif isinstance(node, dict):
        for key, value in node.items():
            if isinstance(value, Struct):
                yield from tables(value, step(path, key))
    elif isinstance(node, list) and isinstance(node[0], Struct):
        names = [getattr(value, "name", None) for value in node]
        for number, value in enumerate(node):
            named = value if names.count(names[number]) == 1 else None
            yield from tables(value, step(path, number, named))


@cache
def declared(kind: type[Table]) -> dict[str, dict[str, Any]]:
    """Facts of the keys of a kind of table, from their types.

    Those that `units` declares (``unit``, ``plausible``, ``names``), kinds of ``tables`` below the
    key, and whether these are ``listed``, behind names or numbers.
    """
    hints = get_type_hints(kind, include_extras=True)
    return {key: _facts(hints[key]) for key in kind.__struct_fields__}


def _facts(hint: Any) -> dict[str, Any]:
    if isinstance(hint, type) and issubclass(hint, Table):
        return {"tables": (hint,)}
    found: dict[str, Any] = {}
    metadata = getattr(hint, "__metadata__", ())
    for inner in get_args(hint)[: 1 if metadata else None]:
        below = _facts(inner)
        tables = found.get("tables", ()) + below.get("tables", ())
        found = below | found | ({"tables": tables} if tables else {})
    if get_origin(hint) in (list, dict) and "tables" in found:
        found["listed"] = True
    for meta in metadata:
        found |= (isinstance(meta, Meta) and meta.extra) or {}
    return found


@cache
def keys_with(kind: type[Table], fact: str) -> tuple[tuple[str, Any], ...]:
    """Keys of a kind of table that declare a fact, with it."""
    return tuple((key, facts[fact]) for key, facts in declared(kind).items() if fact in facts)


def given(table: object, *keys: str) -> list[str]:
    """List those of some keys that a table gives."""
    return [key for key in keys if getattr(table, key) is not None]


def exactly_one(table: object, *keys: str, give: str, none: str = "") -> Problems:
    """Demand exactly one of some keys; `none` says that there is none."""
    own = given(table, *keys)
    if len(own) != 1:
        have = f"{' and '.join(own)} are both given" if own else none
        yield "", have or f"none of {', '.join(keys)}", f"give exactly one: {give}"


def at_most_one(table: object, *keys: str, give: str) -> Problems:
    """Demand at most one of some keys."""
    if given(table, *keys):
        yield from exactly_one(table, *keys, give=give)


def excludes(
    table: object, key: str, *others: str, problem: str = "", remedy: str = "keep one of the two"
) -> Problems:
    """Refuse each of `others` beside a key."""
    if getattr(table, key) is not None:
        for other in others:
            if getattr(table, other):
                yield other, problem or f"conflicts with {key}", remedy


def together(table: object, *keys: str, remedy: str = "give both or neither") -> Problems:
    """Demand all of some keys, or none."""
    if 0 < len(given(table, *keys)) < len(keys):
        yield "", f"{' and '.join(keys)} go together", remedy


def whole_or_parts(table: object, whole: str, *parts: str) -> Problems:
    """Demand one key alone, or all of some others, or none."""
    if getattr(table, whole) is None:
        yield from together(table, *parts, remedy=f"give both, or {whole} alone")
    elif given(table, *parts):
        problem = f"conflicts with {' or '.join(parts)}"
        yield whole, problem, f"give {whole} alone, or {' and '.join(parts)}"


def unique(table: object, key: str, kind: str) -> Problems:
    """Demand that the names of the members of a list differ."""
    names: list[str] = [item.name for item in getattr(table, key) or ()]
    for n, name in enumerate(names):
        if name is not None and name in names[:n]:
            problem = f"is also the name of an earlier {kind}"
            yield f"{key}.{name}.name", problem, "give each a name of its own"


def ascending(table: object, key: str, remedy: str = "sort the table by it") -> Problems:
    """Demand that the numbers of a list rise."""
    for n, (low, high) in enumerate(pairwise(getattr(table, key) or ()), 2):
        if high <= low:
            yield key, f"is not in ascending order (see number {n})", remedy
            return


def bounded(table: Any, start: float | None = None) -> Problems:
    """Demand that the bounds `lower` and `upper` of a number are in order, with `start` inside."""
    low = -math.inf if table.lower is None else table.lower
    high = math.inf if table.upper is None else table.upper
    if low >= high:
        yield "lower", f"is not below the upper bound {high:g}", "exchange them"
    elif start is not None and not low <= start <= high:
        yield "start", "lies outside the bounds", "start within them"


def is_symmetric(matrix: list[list[float]], tolerance: float = 0.0) -> bool:
    """Whether a square matrix is symmetric, up to a relative error of its elements."""
    pairs = ((matrix[i][j], matrix[j][i]) for i in range(len(matrix)) for j in range(i))
    return all(math.isclose(one, other, rel_tol=tolerance) for one, other in pairs)


def symmetric(table: object, *keys: str, tolerance: float = 0.0) -> Problems:
    """Demand that matrices are numbers of a diagonal, or rows that are symmetric."""
    for key in keys:
        matrix: list[Any] = getattr(table, key) or []
        rows = [isinstance(row, list) for row in matrix]
        if any(rows) and not all(rows):
            count = {3: "three", 6: "six"}[len(rows)]
            yield key, "mixes numbers and rows", f"give {count} numbers or {count} rows of {count}"
        elif any(rows) and not is_symmetric(matrix, tolerance):
            yield key, "is not symmetric", "make element (i, j) equal to (j, i)"


def not_tiny(table: object, key: str, unit: str) -> Problems:
    """Refuse masses or moments of inertia that are almost but not 0."""
    value = getattr(table, key)
    if any(0 < one < LEAST_MASS for one in (value if isinstance(value, list) else [value])):
        remedy = f"give 0, or at least {LEAST_MASS:g} {unit}"
        yield key, "is too small for its motion to be computed", remedy
