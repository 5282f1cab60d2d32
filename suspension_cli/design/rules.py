"""Rules of tables: declared beside each table, applied to a whole document at once.

The functions make the rules that several tables share, for `Table.rules`; remedies follow from
units and descriptions of the keys. `find_faults` walks a document and adds path and value.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import cache, wraps
from itertools import pairwise
from typing import Any, Concatenate, ParamSpec, TypeVar, get_args, get_origin, get_type_hints

from msgspec import Meta, Struct

from suspension_cli.design import faults
from suspension_cli.design.faults import fault_of, step
from suspension_cli.design.units import Problems, Raw, Table
from suspension_cli.errors import Fault, InputError

T = TypeVar("T", bound=Table)
Rule = Callable[[Any], Problems]
"""Yields key, problem and remedy of what is wrong with a table."""
P = ParamSpec("P")


def rule(check: Callable[Concatenate[Any, P], Problems]) -> Callable[P, Rule]:
    """Make of a check of a table, with arguments, a function of these that returns a rule."""

    @wraps(check)
    def declare(*args: P.args, **keywords: P.kwargs) -> Rule:
        return lambda table: check(table, *args, **keywords)

    return declare


LEAST_MASS = 1e-9
"""Smallest mass, kg, or moment of inertia, kg m^2, other than 0."""


def convert(raw: Raw, kind: type[T]) -> T:
    """Convert a parsed TOML document to a type; raises `InputError` with all faults of it."""
    document = faults.convert(raw, kind)
    if found := [*find_faults(document)]:
        raise InputError(found)
    return document


def find_faults(document: Struct, known: Collection[int] = ()) -> Iterator[Fault]:
    """Find what breaks the rules of any table of a document but the `known` ones, see `tables`."""
    for path, table in tables(document, known=known):
        for key, problem, remedy in table.faults():
            yield fault_of(table, path, key, problem, remedy)


def tables(node: Any, path: str = "", known: Collection[int] = ()) -> Iterator[tuple[str, Any]]:
    """List a table and all tables in it, each behind its key path.

    Without those whose identities (`id`) are `known`.
    """
    if id(node) in known:
        return
    if isinstance(node, Struct):
        yield path, node
        for key, _ in keys_with(type(node), "tables"):
            if value := getattr(node, key):
                yield from tables(value, f"{path}.{key}" if path else key, known)
    elif isinstance(node, dict):
        for key, value in node.items():
            if isinstance(value, Struct):
                yield from tables(value, step(path, key), known)
    elif isinstance(node, list) and isinstance(node[0], Struct):
        names = [getattr(value, "name", None) for value in node]
        for number, value in enumerate(node):
            named = value if names.count(names[number]) == 1 else None
            yield from tables(value, step(path, number, named), known)


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
        if isinstance(meta, Meta):
            found |= ({"description": meta.description} if meta.description else {}) | (
                meta.extra or {}
            )
    return found


@cache
def keys_with(kind: type[Table], fact: str) -> tuple[tuple[str, Any], ...]:
    """Keys of a kind of table that declare a fact, with it."""
    return tuple((key, facts[fact]) for key, facts in declared(kind).items() if fact in facts)


def given(table: object, *keys: str) -> list[str]:
    """List those of some keys that a table gives."""
    return [key for key in keys if getattr(table, key) not in (None, [])]


def _give(table: Table, keys: Iterable[str]) -> str:
    """Name keys with their units: "stiffness (N/m) or frequency (Hz)"."""
    units = {key: declared(type(table))[key].get("unit", "1") for key in keys}
    return " or ".join(key if unit == "1" else f"{key} ({unit})" for key, unit in units.items())


@rule
def any_of(table: Table, *keys: str, count: str = "one") -> Problems:
    """Demand at least one of some keys."""
    if not given(table, *keys):
        yield "", f"none of {', '.join(keys)}", f"give {count}: {_give(table, keys)}"


@rule
def exactly_one(table: Table, *keys: str) -> Problems:
    """Demand exactly one of some keys."""
    yield from any_of(*keys, count="exactly one")(table)
    yield from at_most_one(*keys)(table)


@rule
def at_most_one(table: Table, *keys: str) -> Problems:
    """Demand at most one of some keys."""
    own = given(table, *keys)
    if len(own) > 1:
        both = f"{' and '.join(own)} are both given"
        yield "", both, f"give exactly one: {_give(table, keys)}"


@rule
def required(table: Any, *keys: str, when: Callable[[Any], bool] = bool) -> Problems:
    """Demand some keys in tables that fulfil a condition."""
    for key in keys:
        if when(table) and getattr(table, key) is None:
            yield key, "missing", f"give {declared(type(table))[key]['description']}"


@rule
def excludes(table: object, key: str, *others: str, problem: str = "") -> Problems:
    """Refuse each of `others` beside a key."""
    if getattr(table, key) is not None:
        for other in others:
            if getattr(table, other):
                yield other, problem or f"conflicts with {key}", "keep one of the two"


@rule
def needs(table: Table, key: str, other: str) -> Problems:
    """Refuse a key, unless neutral, without another one."""
    if getattr(table, key) and getattr(table, other) is None:
        remedy = f"give {_give(table, [other])} too, or remove it"
        yield key, f"has no effect without {other}", remedy


@rule
def by_kind(
    table: Table, kind: str, keys: Mapping[object, tuple[Sequence[str], Sequence[str]]]
) -> Problems:
    """Demand, for each value of the key `kind`, the needed keys, and admit the others alone."""
    needed, others = keys[getattr(table, kind)]
    yield from required(*needed)(table)
    every = dict.fromkeys(key for both in keys.values() for key in (*both[0], *both[1]))
    for key in every:
        if key not in (*needed, *others) and getattr(table, key) not in (None, []):
            kinds = [value for value, both in keys.items() if key in (*both[0], *both[1])]
            listed = " or ".join(f'"{value}"' for value in kinds if value is not None)
            problem = f"goes with {kind} = {listed}" if listed else f"conflicts with {kind}"
            yield key, problem, f"remove it, or change {kind}"


@rule
def together(table: object, *keys: str) -> Problems:
    """Demand all of some keys, or none."""
    if 0 < len(given(table, *keys)) < len(keys):
        yield "", f"{' and '.join(keys)} go together", "give both or neither"


@rule
def whole_or_parts(table: object, whole: str, *parts: str) -> Problems:
    """Demand one key alone, or all of some others, or none."""
    if getattr(table, whole) is None:
        yield from together(*parts)(table)
    elif given(table, *parts):
        problem = f"conflicts with {' or '.join(parts)}"
        yield whole, problem, f"give {whole} alone, or {' and '.join(parts)}"


@rule
def unique(table: object, key: str) -> Problems:
    """Demand that the names of the members of a list differ."""
    names: list[str] = [item.name for item in getattr(table, key) or ()]
    for n, name in enumerate(names):
        if name is not None and name in names[:n]:
            problem = f"is also the name of an earlier {key.replace('_', ' ')}"
            yield f"{key}.{name}.name", problem, "give each a name of its own"


@rule
def ascending(table: object, key: str) -> Problems:
    """Demand that the numbers of a list rise."""
    for n, (low, high) in enumerate(pairwise(getattr(table, key) or ()), 2):
        if high <= low:
            yield key, f"is not in ascending order (see number {n})", "sort the table by it"
            return


@rule
def same_length(table: object, key: str, other: str) -> Problems:
    """Demand as many numbers in a list as in another."""
    count, wanted = (len(getattr(table, name) or ()) for name in (key, other))
    if count != wanted:
        yield key, f"has {count} values for {wanted} of {other}", "give one for each"


def bounded(table: Any) -> Problems:
    """Demand that the bounds `lower` and `upper` of a number are in order, with `start` inside."""
    low = -math.inf if table.lower is None else table.lower
    high = math.inf if table.upper is None else table.upper
    start = getattr(table, "start", None)
    if low >= high:
        yield "lower", f"is not below the upper bound {high:g}", "exchange them"
    elif start is not None and not low <= start <= high:
        yield "start", "lies outside the bounds", "start within them"


def is_symmetric(matrix: list[list[float]], tolerance: float = 0.0) -> bool:
    """Whether a square matrix is symmetric, up to a relative error of its elements."""
    pairs = ((matrix[i][j], matrix[j][i]) for i in range(len(matrix)) for j in range(i))
    return all(math.isclose(one, other, rel_tol=tolerance) for one, other in pairs)


@rule
def symmetric(table: object, *keys: str, tolerance: float = 0.0) -> Problems:
    """Demand that matrices are numbers of a diagonal, or rows that are symmetric."""
    for key in keys:
        matrix: list[Any] = getattr(table, key) or []
        rows = [isinstance(row, list) for row in matrix]
        if any(rows) and not all(rows):
            count = {3: "three", 6: "six"}[len(rows)]
            remedy = f"give {count} numbers or {count} rows of {count}"
            yield key, "mixes numbers and rows", remedy
        elif any(rows) and not is_symmetric(matrix, tolerance):
            yield key, "is not symmetric", "make element (i, j) equal to (j, i)"


@rule
def not_tiny(table: object, key: str, unit: str) -> Problems:
    """Refuse masses or moments of inertia that are almost but not 0."""
    value = getattr(table, key)
    if any(0 < one < LEAST_MASS for one in (value if isinstance(value, list) else [value])):
        remedy = f"give 0, or at least {LEAST_MASS:g} {unit}"
        yield key, "is too small for its motion to be computed", remedy
