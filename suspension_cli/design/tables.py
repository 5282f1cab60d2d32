"""Tables of a file: what their keys declare, and rules among their keys.

A key declares its type, description, SI unit, bounds and plausible range in one line. A table
declares its rules beside its keys: ``rules = (tables.exactly_one("k", "radius"), ...)``.
`design.faults` applies all of these to a whole document.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import (
    Annotated,
    Any,
    ClassVar,
    Concatenate,
    NamedTuple,
    Optional,
    ParamSpec,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)

import msgspec
from msgspec import Meta, Struct

P = ParamSpec("P")
Raw = dict[str, Any]
"""Tables of a TOML file as they are read, before they are checked."""
Schema = dict[str, Any]
"""A JSON Schema, or a part of one."""
Problems = Iterator[tuple[str, str, str]]
"""Key, problem and remedy of what is wrong with a table ("" for the whole table)."""
Rule = Callable[[Any], Problems]
MILLIMETRES = (("mm", 1e-3), ("um", 1e-6))
LEAST_MASS = 1e-9
"""Smallest mass, kg, or moment of inertia, kg m^2, other than 0."""


@dataclass(frozen=True)
class Plausible:
    """Range of the magnitude of plausible numbers; others are valid, but rarely meant."""

    high: float
    above: str  # what a larger number is: "longer than any suspension"
    units: tuple[tuple[str, float], ...] = MILLIMETRES  # that may have been meant, with size in SI
    low: float = 0.0
    below: str = ""  # what a smaller number is
    serious: bool = False  # whether results are meaningless beyond, so that analyses warn too

    def problem(self, size: float, unit: str) -> str:
        """Describe what is wrong with the size of a number; "" for a plausible one."""
        if self.low <= size <= self.high:
            return ""
        word, limit = (self.above, self.high) if size > self.high else (self.below, self.low)
        return f"is {word} ({f'{limit:g} {unit}'.rstrip()})"

    def remedy(self, size: float, unit: str) -> str:
        """Suggest the first unit in which the number is plausible: "did you mean mm?"."""
        good = (name for name, one in self.units if self.low <= size * one <= self.high)
        give = f"give it in {unit}" if unit else "check its unit"
        return next((f"did you mean {name}?" for name in good), give)


def doc(
    description: str = "",
    unit: str = "",
    plausible: Plausible | None = None,
    names: str = "",
    count: int | None = None,
    **bounds: Any,
) -> Meta:
    """Describe a value of a type: SI unit, plausible range and bounds of numbers.

    `names` is the kind of part that a text names, ``stage``, ``wire``, ... (`checks`), `count` the
    length of a list.
    """
    facts = {"unit": unit, "plausible": plausible, "names": names}
    extra = {name: fact for name, fact in facts.items() if fact}
    bounds |= {} if count is None else {"min_length": count, "max_length": count}
    return Meta(description=description or None, extra=extra or None, **bounds)


class _Key(NamedTuple):
    default: Any
    meta: Meta


_REQUIRED: Any = object()


def key(description: str = "", default: Any = _REQUIRED, **facts: Any) -> Any:
    """Declare a key of a table beside its type; `facts` are those of `doc`.

    A key without a default is required, but for one whose type allows None.
    """
    return _Key(default, doc(description, **facts))


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(msgspec.field,))
class _Declared(msgspec.StructMeta):
    """Turns each `key` of a table into its default, and its description into a part of the type."""

    def __new__(
        cls, name: str, bases: tuple[type, ...], namespace: Raw, **options: Any
    ) -> _Declared:
        described: dict[str, Meta] = {}
        for field, hint in namespace.get("__annotations__", {}).items():
            if isinstance(namespace.get(field), _Key):
                default, described[field] = namespace.pop(field)
                if default is _REQUIRED and str(hint).endswith("| None"):
                    default = None
                if isinstance(default, list) and default:
                    default = msgspec.field(default_factory=default.copy)
                if default is not _REQUIRED:
                    namespace[field] = default
        made = super().__new__(cls, name, bases, namespace, kw_only=True, **options)
        hints = get_type_hints(made, include_extras=True) if described else {}
        for field, meta in described.items():
            members = [one for one in get_args(hints[field]) if one is not type(None)]
            optional = type(None) in get_args(hints[field])
            kind = Annotated[Union[tuple(members)] if optional else hints[field], meta]  # noqa: UP007
            made.__annotations__[field] = Optional[kind] if optional else kind  # noqa: UP045
        return made


class Table(
    Struct, metaclass=_Declared, frozen=True, forbid_unknown_fields=True, omit_defaults=True
):
    """Base of all tables of a file: immutable, and unknown keys are faults."""

    rules: ClassVar[Sequence[Rule]] = ()
    """Rules beyond single values, of the functions below; those of the base count too."""

    def check(self) -> Problems:
        """Find what else is wrong with a table that breaks no rule."""
        yield from ()

    def faults(self) -> list[tuple[str, str, str]]:
        """Find what breaks the rules, else what is wrong otherwise."""
        kinds = reversed(type(self).__mro__)
        rules = (rule for kind in kinds for rule in vars(kind).get("rules", ()))
        return [fault for rule in rules for fault in rule(self)] or [*self.check()]


def extend_table(base: type[Table], keys: Mapping[str, object]) -> Any:
    """Derive a table from another, with more keys: their types by name, not required with None."""
    optional = {name: None for name, kind in keys.items() if type(None) in get_args(kind)}
    namespace = {"__module__": base.__module__, "__annotations__": dict(keys), **optional}
    return _Declared(f"_{base.__name__}", (base,), namespace, frozen=True)


@cache
def declared(kind: type[Table]) -> dict[str, dict[str, Any]]:
    """Facts of the keys of a kind of table, from their types.

    Those of `doc`, kinds of ``tables`` below the key, and whether these are ``listed``, behind
    names or numbers.
    """
    hints = get_type_hints(kind, include_extras=True)
    return {key: facts(hints[key]) for key in kind.__struct_fields__}


def facts(hint: Any) -> dict[str, Any]:
    """Facts that a type declares, and those of the types in it, see `declared`.

    >>> facts(Annotated[float, doc("length in m", "m", ge=0)])
    {'description': 'length in m', 'unit': 'm'}
    """
    if isinstance(hint, type) and issubclass(hint, Table):
        return {"tables": (hint,)}
    found: dict[str, Any] = {}
    metadata = getattr(hint, "__metadata__", ())
    for inner in get_args(hint)[: 1 if metadata else None]:
        below = facts(inner)
        tables = found.get("tables", ()) + below.get("tables", ())
        found = below | found | ({"tables": tables} if tables else {})
    if get_origin(hint) in (list, dict) and "tables" in found:
        found["listed"] = True
    for meta in metadata:
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
    return [key for key in keys if getattr(table, key) not in (None, [], {})]


def json_schema(kind: type[Table], title: str) -> Schema:
    """Make the JSON Schema of a kind of file (draft 2020-12)."""
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title}
    return head | msgspec.json.schema(kind)


# Rules: each function below takes the keys that a rule is about, and returns the rule.


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
    table: Table, kind: str, keys: Mapping[object, tuple[Sequence[str], Sequence[str]]]
) -> Problems:
    """Demand, for each value of the key `kind`, the needed keys, and admit the others alone."""
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
    below, limit = getattr(table, low), getattr(table, high)
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
