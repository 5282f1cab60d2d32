"""Typed tables of a file, and what their keys declare.

A key declares its type, description, SI unit, bounds and plausible range in one line. A table
declares its rules beside its keys: ``rules = (key_rules.exactly_one("k", "radius"), ...)``, see
`design.key_rules`. `design.faults` applies all of these to a whole document.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import (
    Annotated,
    Any,
    ClassVar,
    NamedTuple,
    Optional,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)

import msgspec
from msgspec import Meta, Struct

Raw = dict[str, Any]
"""Tables of a TOML file as they are read, before they are checked."""
Schema = dict[str, Any]
"""A JSON Schema, or a part of one."""
Problems = Iterator[tuple[str, str, str]]
"""Key, problem and remedy of what is wrong with a table ("" for the whole table)."""
Rule = Callable[[Any], Problems]
MILLIMETRES = (("mm", 1e-3), ("um", 1e-6))


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
        is_large = size > self.high
        word = self.above if is_large else self.below
        limit = self.high if is_large else self.low
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
        hints = namespace.get("__annotations__", {})
        home = vars(sys.modules[namespace["__module__"]])
        for field, hint in hints.items():
            if not isinstance(namespace.get(field), _Key):
                continue
            default, meta = namespace.pop(field)
            kind = eval(hint, home) if isinstance(hint, str) else hint
            members = [one for one in get_args(kind) if one is not type(None)]
            optional = type(None) in get_args(kind)
            described = Annotated[Union[tuple(members)] if optional else kind, meta]  # noqa: UP007
            hints[field] = Optional[described] if optional else described  # noqa: UP045
            if default is _REQUIRED and optional:
                default = None
            if isinstance(default, list) and default:
                default = msgspec.field(default_factory=default.copy)
            if default is not _REQUIRED:
                namespace[field] = default
        return super().__new__(cls, name, bases, namespace, kw_only=True, **options)


class Table(
    Struct, metaclass=_Declared, frozen=True, forbid_unknown_fields=True, omit_defaults=True
):
    """Base of all tables of a file: immutable, and unknown keys are faults."""

    rules: ClassVar[Sequence[Rule]] = ()
    """Rules beyond single values, from `key_rules`; those of the base count too."""

    def check(self) -> Problems:
        """Find what else is wrong with a table that breaks no rule."""
        yield from ()

    def faults(self) -> list[tuple[str, str, str]]:
        """Find what breaks the rules, else what is wrong otherwise."""
        rules = _rules(type(self))
        return [fault for rule in rules for fault in rule(self)] or [*self.check()]


@cache
def _rules(kind: type[Table]) -> list[Rule]:
    """Rules of a kind of table, those of its bases first."""
    return [rule for one in reversed(kind.__mro__) for rule in vars(one).get("rules", ())]


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
