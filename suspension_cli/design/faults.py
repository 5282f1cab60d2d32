"""The walker that applies what tables declare to a whole document, and lists all its faults.

First single values: msgspec stops at the first error, so a file that it refuses is compared, value
by value, with the JSON Schema of its type. Then the rules of each table, see `design.key_rules`.
"""

from __future__ import annotations

import math
import operator
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from functools import cache
from itertools import islice
from typing import Any, TypeVar

import msgspec
from msgspec import Struct

from suspension_cli.design import paths, units
from suspension_cli.design.typed_tables import Raw, Schema, Table, keys_with
from suspension_cli.errors import Fault, InputError, format_key, format_value, suggest

T = TypeVar("T")

_TYPES: dict[str, tuple[type | tuple[type, ...], str]] = {
    "boolean": (bool, "true or false"),
    "string": (str, "a string"),
    "integer": (int, "an integer"),
    "number": ((int, float), "a number"),
    "array": (list, "an array"),
    "object": (dict, "a table"),
}
_BOUNDS = {
    "exclusiveMinimum": ("greater than", operator.gt),
    "minimum": ("at least", operator.ge),
    "exclusiveMaximum": ("less than", operator.lt),
    "maximum": ("at most", operator.le),
}
TINY = 1e-150
"""Magnitude below which numbers other than 0 are refused: the square would not be a number of full
precision (2e-308)."""
LONGEST_TEXT = 100_000
"""Longest text of a document, characters; the filter of a loop has up to some ten thousand."""
MOST_FAULTS = 1000
"""Most faults that are listed of one document."""
ELSEWHERE = {
    "diameter": ("radius", "half of the diameter in m"),
    "length": ("l", "the loaded length in m"),
    "material": ("density", "that of the material in kg/m^3"),
    "stiffness": ("k", "the spring constant in N/m"),
}
"""Names that some tables have for what others call differently: that key, and what it takes. A
wire has a material and a radius, a body a density; a search by spelling finds neither."""


def convert(raw: Raw, kind: type[T], *, rules: bool = True) -> T:
    """Convert a parsed TOML document to a type of the file format.

    Raises `InputError` with all faults of its values or, if these are valid, of its `rules`.
    """
    try:
        document = msgspec.convert(raw, kind)
        refusal = ""
    except msgspec.ValidationError as error:
        document = None
        refusal = str(error)
    good = document is not None and _is_ordinary(raw)
    found = [] if good else [*islice(_walk(_schema(kind), raw, ""), MOST_FAULTS + 1)]
    if len(found) > MOST_FAULTS:
        found[-1] = Fault("", f"has more than these {MOST_FAULTS} faults", "correct these first")
    if rules and document is not None and not found:
        found = [*find_faults(tables(document))]
    if document is not None and not found:
        return document
    raise InputError(found or [Fault("", refusal, "see pendsus schema for the format")])


def find_faults(tables: Iterable[tuple[str, Table]]) -> Iterator[Fault]:
    """Find what breaks the rules of some tables, each behind its key path."""
    for path, table in tables:
        for key, problem, remedy in table.faults():
            yield fault_of(table, path, key, problem, remedy)


def tables(node: Any, path: str = "", known: Collection[int] = ()) -> Iterator[tuple[str, Any]]:
    """List a table and all tables in it, each behind its key path.

    Without those whose identities (`id`) are `known`.
    """
    members: Iterable[tuple[str, Any]] = ()
    if isinstance(node, Struct) and id(node) not in known:
        yield path, node
        keys = [key for key, _ in keys_with(type(node), "tables")]
        members = [(f"{path}.{key}" if path else key, getattr(node, key)) for key in keys]
    elif isinstance(node, dict):
        members = [(step(path, key), value) for key, value in node.items()]
    elif isinstance(node, list) and node:
        names = [name if isinstance(name := paths.name_of(value), str) else "" for value in node]
        counts = Counter(names)
        single = [
            value if counts[name] == 1 else None for value, name in zip(node, names, strict=True)
        ]
        members = [(step(path, n, single[n]), value) for n, value in enumerate(node)]
    for place, value in members:
        yield from tables(value, place, known)


def step(path: str, key: object, item: object = None) -> str:
    """Extend a key path by one level; members of a list go by name, else by number from 1."""
    if isinstance(key, int):
        name = paths.name_of(item)
        key = name if isinstance(name, str) and name else key + 1
    text = format_key(str(key))
    return f"{path}.{text}" if path else text


def fault_of(table: Table, path: str, key: str, problem: str, remedy: str) -> Fault:
    """Make a fault of a (dotted) key of the table at a path, or of the table, with its value."""
    value: Any = paths.value_at(table, key) if key else None
    tables = isinstance(value[0] if isinstance(value, list) and value else value, Struct)
    shown = None if value is None or tables or problem == "missing" else format_value(value)
    return Fault(".".join(filter(None, (path, key))), problem, remedy, shown)


def _is_ordinary(value: Any) -> bool:
    """Whether a document is free of values that msgspec accepts and a design must not contain.

    Those are values of a free type that cannot be written to a file, a newline after a name, texts
    that are too long, and numbers whose squares underflow.
    """
    if isinstance(value, (dict, list)):
        return all(map(_is_ordinary, value.values() if isinstance(value, dict) else value))
    if isinstance(value, str):
        return not value.endswith("\n") and len(value) <= LONGEST_TEXT
    return not isinstance(value, (int, float)) or value == 0 or TINY <= abs(value) < 2**63


@cache
def _schema(kind: type) -> Schema:
    """JSON Schema of a type, with its references resolved."""
    whole = msgspec.json.schema(kind)

    def plain(node: Any) -> Any:
        if isinstance(node, list):
            return [plain(item) for item in node]
        if not isinstance(node, dict):
            return node
        if "$ref" in node:
            own = plain(whole["$defs"][node["$ref"].rpartition("/")[2]])
            return own | {"description": node.get("description", "")}
        node = {key: plain(item) for key, item in node.items() if key != "$defs"}
        members = [item for item in node.pop("anyOf", ()) if item.get("type") != "null"]
        if len(members) == 1:  # an optional value
            return members[0] | node
        return node | {"anyOf": members} if members else node

    return plain(whole)


def _walk(node: Schema, value: object, path: str) -> Iterator[Fault]:
    """List the faults of a value, and of all in it, under its schema."""
    node = _member(node, value) if "anyOf" in node else node or _free(value)
    if node and (problem := _problem(node, value)):
        yield Fault(path, problem, _remedy(node, value, path), format_value(value))
    elif isinstance(value, dict):
        known = node.get("properties", {})
        rest = node.get("additionalProperties", {})
        for key, item in value.items():
            misnamed = isinstance(item, dict) and known.get(key, {}).get("type") == "array"
            others = [name for name in known if misnamed and name in value and name != key]
            if (hint := suggest(key, others)).startswith("did you mean"):
                yield Fault(step(path, key), "must be an array", hint, format_value(item))
            elif key in known or rest is not False:
                yield from _walk(known.get(key, rest), item, step(path, key))
            else:
                remedy = _suggest_key(key, list(known))
                yield Fault(step(path, key), "unknown key", remedy, format_value(item))
        for key in node.get("required", ()):
            if key not in value:
                yield Fault(step(path, key), "missing", f"give {_described(known[key])}")
    elif isinstance(value, list):
        kinds = node.get("prefixItems") or [node.get("items", {})] * len(value)
        for number, (kind, item) in enumerate(zip(kinds, value, strict=True)):
            yield from _walk(kind, item, step(path, number, item))


def _suggest_key(key: str, known: list[str]) -> str:
    """Suggest the key that the user may have meant, or list all."""
    meant, what = ELSEWHERE.get(key, ("", ""))
    return f"give {meant}, {what}" if meant in known else suggest(key, known)


def _free(value: object) -> Schema:
    """Schema of what a value of a free type must be, so that it can be written to a file again."""
    if isinstance(value, str):
        return {"type": "string", "description": "a shorter text"}
    forms = {dict: "object", list: "array", float: "number", int: "number"}
    ordinary = {"description": "an ordinary number, or leave it out"}
    return {"type": forms[type(value)]} | ordinary if type(value) in forms else {}


def _member(node: Schema, value: Any) -> Schema:
    """Choose the member of a union by the form of the value: table, array, text or other."""
    form = {list: "array", dict: "object", str: "string"}.get(type(value))
    member = next((one for one in node["anyOf"] if one.get("type") == form), node["anyOf"][0])
    text = node.get("description")
    named = "properties" in member
    return member if named or not text else member | {"description": text}


def _problem(node: Schema, value: Any) -> str:
    """Describe the problem of a value without what is in it; "" if there is none."""
    if isinstance(value, float) and not math.isfinite(value):
        return "must be finite"
    if "enum" in node:
        good = any(value == one and type(value) is type(one) for one in node["enum"])
        return "" if good else f"must be one of {', '.join(map(str, node['enum']))}"
    kind, word = _TYPES[node["type"]]
    count = len(node.get("prefixItems", ()))
    if count and not (isinstance(value, list) and len(value) == count):
        return f"must be an array of {count} numbers"
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        return f"must be {word}"
    bounds = {key: node[key] for key in _BOUNDS if key in node}
    if any(not _BOUNDS[key][1](value, bound) for key, bound in bounds.items()):
        return f"must be {' and '.join(f'{_BOUNDS[key][0]} {bounds[key]:g}' for key in bounds)}"
    if isinstance(value, int) and abs(value) >= 2**63:
        return "is too large an integer"
    if isinstance(value, float) and 0 < abs(value) < TINY:
        return f"is too small (products of numbers below {TINY:g} lose their digits)"
    if isinstance(value, (list, dict)):
        counted, what = ("Items", "elements") if isinstance(value, list) else ("Properties", "keys")
        least = node.get(f"min{counted}", 0)
        most = node.get(f"max{counted}", math.inf)
        return "" if least <= len(value) <= most else f"has {len(value)} {what}"
    if not isinstance(value, str):
        return ""
    longest = node.get("maxLength", LONGEST_TEXT)
    if len(value) > longest:
        return f"is longer than {longest} characters"
    # $ also matches before a last newline
    good = len(value) >= node.get("minLength", 0) and re.search(
        node.get("pattern", "") + r"(?!\n)", value
    )
    if good:
        return ""
    return "is not acceptable" if value else "is empty"


def _remedy(node: Schema, value: Any, path: str) -> str:
    if node.get("type") == "object":
        known = node.get("properties", {})
        if known:
            return f"give {{ {', '.join(known)} }}"
        return f"give {node.get('description') or 'key = value pairs under it'}"
    if len(node.get("prefixItems", ())) == 3:
        return "give x, y, z"
    of_tables = node.get("type") == "array" and (node.get("items") or {}).get("type") == "object"
    if of_tables and not isinstance(value, list):
        return f"write it as [[{path}]]"
    return f"give {_described(node)}"


def _described(node: Schema) -> str:
    """Describe a valid value, for a remedy."""
    text = node.get("description", "")
    if "enum" in node:
        options = [format_value(option) for option in node["enum"]]
        return text if text and all(option in text for option in options) else " or ".join(options)
    if not text and "anyOf" in node:
        return _described(node["anyOf"][0])
    if not text and "properties" in node:
        return f"a table with {', '.join(node.get('required') or node['properties'])}"
    if node.get("pattern") == units.NAME and units.NAMES not in text:
        return f"{text}: {units.NAMES}"
    return text or _TYPES.get(node.get("type", ""), (None, "a value"))[1]
