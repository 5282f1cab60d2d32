"""Rules among the keys of a table.

Each function takes the keys that a rule is about, and returns the rule; a table declares its rules
beside its keys:

>>> from suspension_cli.design.typed_tables import Table
>>> class Rod(Table, frozen=True):
...     radius: float | None = None
...     area: float | None = None
...     rules = (exactly_one("radius", "area"),)
>>> Rod(radius=0.1).faults()
[]
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any, Concatenate, ParamSpec

from suspension_cli.design.typed_tables import Problems, Rule, Table, declared, given

P = ParamSpec("P")
LEAST_MASS = 1e-9
"""Smallest mass, kg, or moment of inertia, kg m^2, other than 0."""


def rule(check: Callable[Concatenate[Any, P], Problems]) -> Callable[P, Rule]:
    """Make of a check of a table, with arguments, a function of these that returns a rule."""

    def declare(*args: P.args, **keywords: P.kwargs) -> Rule:
        return lambda table: check(table, *args, **keywords)

    return declare


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
def at_most_one(table: Table, *keys: str) -> Problems:
    """Demand at most one of some keys."""
    own = given(table, *keys)
    if len(own) > 1:
        both = f"{' and '.join(own)} are both given"
        yield "", both, f"give exactly one: {_give(table, keys)}"


@rule
def exactly_one(
    table: Table, *keys: str, when: Callable[[Any], bool] = lambda table: True
) -> Problems:
    """Demand exactly one of some keys, `when` that applies."""
    if when(table):
        yield from any_of(*keys, count="exactly one")(table)
        yield from at_most_one(*keys)(table)


@rule
def required(table: Any, *keys: str, when: Callable[[Any], bool] = bool) -> Problems:
    """Demand some keys in tables that fulfil a condition."""
    for key in keys:
        if when(table) and getattr(table, key) is None:
            yield key, "missing", f"give {declared(type(table))[key]['description']}"


@rule
def excludes(table: object, key: str, *others: str, problem: str = "") -> Problems:
    """Refuse each of `others` beside a key."""
    for other in others:
        if getattr(table, key) is not None and getattr(table, other):
            yield other, problem or f"conflicts with {key}", "keep one of the two"


@rule
def needs(table: Table, key: str, other: str, unless: str = "", remedy: str = "") -> Problems:
    """Refuse a key, unless neutral or beside a third one, without another one."""
    alone = getattr(table, key) and not getattr(table, other)
    if alone and not (unless and getattr(table, unless)):
        remedy = remedy or f"give {_give(table, [other])} too, or remove it"
        yield key, f"has no effect without {other}", remedy


@rule
def by_kind(
    table: Table,
    kind: str,
    keys: Mapping[Any, tuple[Sequence[str], Sequence[str]]],
    when: Callable[[Any], bool] = lambda table: True,
) -> Problems:
    """Demand, for each value of the key `kind`, the needed keys, and admit the others alone.

    `when` that applies.
    """
    if not when(table):
        return
    needed, others = keys[getattr(table, kind)]
    yield from required(*needed)(table)
    for key in dict.fromkeys(key for both in keys.values() for key in (*both[0], *both[1])):
        if key not in (*needed, *others) and given(table, key):
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
def unique(table: object, *keys: str) -> Problems:
    """Demand that the names of the members of a list, or of several, differ."""
    pairs = [(key, item.name) for key in keys for item in getattr(table, key) or ()]
    names = [name for _, name in pairs]
    for n, (key, name) in enumerate(pairs):
        if name is not None and name in names[:n]:
            problem = f"is also the name of an earlier {' or '.join(keys).replace('_', ' ')}"
            yield f"{key}.{name}.name", problem, "give each a name of its own"


@rule
def nonzero(table: object, key: str) -> Problems:
    """Refuse a factor of 0."""
    if getattr(table, key) == 0:
        yield key, "must not be zero", "give the factor"


@rule
def ascending(table: object, key: str) -> Problems:
    """Demand that the numbers of a list rise."""
    pairs = enumerate(pairwise(getattr(table, key) or ()), 2)
    for n in [n for n, (low, high) in pairs if high <= low][:1]:
        yield key, f"is not in ascending order (see number {n})", "sort them, each once"


@rule
def same_length(table: object, key: str, other: str) -> Problems:
    """Demand as many numbers in a list as in another."""
    count, wanted = (len(getattr(table, name) or ()) for name in (key, other))
    if count != wanted:
        yield key, f"has {count} values for {wanted} of {other}", "give one for each"


@rule
def ordered(table: Any, low: str, high: str, remedy: str = "exchange them") -> Problems:
    """Demand that a number is below another, if both are given."""
    below = getattr(table, low)
    limit = getattr(table, high)
    if below is not None and limit is not None and below >= limit:
        yield low, f"is not below {high} = {limit:g}", remedy


def bounded(table: Any) -> Problems:
    """Demand that the bounds `lower` and `upper` of a number are in order, with `start` inside."""
    reversed_bounds = [*ordered("lower", "upper")(table)]
    yield from reversed_bounds
    start = getattr(table, "start", None)
    numbers = [one for one in (table.lower, start, table.upper) if one is not None]
    if start is not None and not reversed_bounds and numbers != sorted(numbers):
        yield "start", "lies outside the bounds", "start within them"


@rule
def symmetric(table: object, *keys: str, tolerance: float = 0.0) -> Problems:
    """Demand that matrices are numbers of a diagonal, or rows that are symmetric."""
    for key in keys:
        matrix = getattr(table, key)
        rows = [isinstance(row, list) for row in matrix] if isinstance(matrix, list) else []
        if any(rows) and not all(rows):
            count = {3: "three", 6: "six"}[len(rows)]
            remedy = f"give {count} numbers or {count} rows of {count}"
            yield key, "mixes numbers and rows", remedy
        elif any(rows) and not all(
            math.isclose(matrix[i][j], matrix[j][i], rel_tol=tolerance)
            for i in range(len(rows))
            for j in range(i)
        ):
            yield key, "is not symmetric", "make element (i, j) equal to (j, i)"


@rule
def not_tiny(table: Table, *keys: str) -> Problems:
    """Refuse masses or moments of inertia that are almost but not 0."""
    for key in keys:
        value = getattr(table, key)
        if any(0 < one < LEAST_MASS for one in (value if isinstance(value, list) else [value])):
            remedy = f"give 0, or at least {LEAST_MASS:g} {declared(type(table))[key]['unit']}"
            yield key, "is too small for its motion to be computed", remedy
