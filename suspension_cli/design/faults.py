"""All faults of a file at once, in the user's words.

msgspec stops at its first error; a user with three typos wants to hear of three.  So when a conversion
fails, the same types are walked once more, value by value, and every fault is kept.
"""

from __future__ import annotations

import math
import re
import types
from collections.abc import Iterator
from functools import cache
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec

from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, key_shown, shown

_KINDS = {bool: "true or false", str: "a string", int: "an integer", float: "a number"}


def of_table(raw: dict[str, Any], kind: Any = Design) -> list[Fault]:
    """Every way in which a parsed TOML document departs from the file format.

    Parameters
    ----------
    raw : dict
        The document as `tomllib` gives it.
    kind : type
        What it should be.

    Returns
    -------
    list of Fault
        Empty if the document can be converted to that.
    """
    return list(_walk(kind, raw, ""))


def step(path: str, key: object, item: Any = None) -> str:
    """The key path one level down; members of a list go by their name, else by their number from 1."""
    if isinstance(key, int):
        name = item.get("name") if isinstance(item, dict) else None
        key = name if isinstance(name, str) and name else str(key + 1)
    text = key_shown(str(key))
    return f"{path}.{text}" if path else text


def _walk(kind: Any, value: Any, path: str) -> Iterator[Fault]:
    kind, meta = _bare(kind)
    origin = _origin(kind)
    if origin is msgspec.Struct:
        yield from _walk_struct(kind, value, path)
    elif origin is dict:
        yield from _walk_dict(kind, value, path)
    elif origin is list:
        yield from _walk_list(kind, meta, value, path)
    elif origin is tuple:
        yield from _walk_tuple(kind, value, path)
    elif origin in (Union, types.UnionType):
        yield from _walk_union(kind, meta, value, path)
    else:
        yield from _leaf(kind, meta, value, path)


# The types of a file format are few and its values many: what follows from a type alone is kept.


@cache
def _origin(kind: Any) -> Any:
    """What a type without `Annotated` is made of; `Struct` for all structs."""
    return msgspec.Struct if isinstance(kind, type) and issubclass(kind, msgspec.Struct) else get_origin(kind)


@cache
def _annotated(kind: Any, meta: msgspec.Meta | None) -> Any:
    return kind if meta is None else Annotated[kind, meta]


@cache
def _members(kind: Any) -> tuple[Any, Any, Any]:
    """Of a union without None: all members; those for a row; those for a table."""
    members = [member for member in get_args(kind) if member is not type(None)]
    rows = [member for member in members if _origin(_bare(member)[0]) in (list, tuple)]
    return members, rows, [member for member in members if _origin(member) is msgspec.Struct]


@cache
def _bare(kind: Any) -> tuple[Any, msgspec.Meta | None]:
    """The type without `Annotated`, and its outermost `Meta`."""
    if get_origin(kind) is Annotated:
        inner, *extras = get_args(kind)
        metas = [extra for extra in extras if isinstance(extra, msgspec.Meta)]
        return inner, msgspec.Meta(**{k: v for m in metas for k, v in _meta_items(m)}) if metas else None
    return kind, None


def _meta_items(meta: msgspec.Meta) -> list[tuple[str, Any]]:
    names = ("gt", "ge", "lt", "le", "pattern", "min_length", "max_length", "description")
    return [(name, getattr(meta, name)) for name in names if getattr(meta, name) is not None]


@cache
def _fields(kind: type[msgspec.Struct]) -> dict[str, tuple[Any, bool]]:
    """Field name to (type, required)."""
    hints = get_type_hints(kind, include_extras=True)
    return {f.name: (hints[f.name], f.required) for f in msgspec.structs.fields(kind)}


def _walk_struct(kind: type[msgspec.Struct], value: Any, path: str) -> Iterator[Fault]:
    if not isinstance(value, dict):
        yield Fault(path, "must be a table", f"give {{ {', '.join(_fields(kind))} }}", shown(value))
        return
    known = _fields(kind)
    for key, item in value.items():
        if key in known:
            yield from _walk(known[key][0], item, step(path, key))
        else:
            yield Fault(step(path, key), "unknown key", suggestion(key, list(known)), shown(item))
    for key, (hint, required) in known.items():
        if required and key not in value:
            yield Fault(step(path, key), "missing", f"give {_described(hint)}")


def suggestion(word: str, known: list[str]) -> str:
    """What the user may have meant."""
    import difflib  # only when something is wrong already

    close = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    if close:
        return f"did you mean {close[0]!r}?"
    return "known here: " + ", ".join(known) if known else "remove it"


def _walk_dict(kind: Any, value: Any, path: str) -> Iterator[Fault]:
    if not isinstance(value, dict):
        yield Fault(path, "must be a table", "give key = value pairs under it", shown(value))
        return
    for key, item in value.items():
        yield from _walk(get_args(kind)[1], item, step(path, key))


def _walk_list(kind: Any, meta: msgspec.Meta | None, value: Any, path: str) -> Iterator[Fault]:
    (item_kind,) = get_args(kind)
    bare_item = _bare(item_kind)[0]
    tables = isinstance(bare_item, type) and issubclass(bare_item, msgspec.Struct)
    if not isinstance(value, list):
        remedy = f"write it as [[{path}]]" if tables else f"give {_described(kind, meta)}"
        yield Fault(path, "must be an array", remedy, shown(value))
        return
    short = meta is not None and meta.min_length is not None and len(value) < meta.min_length
    long = meta is not None and meta.max_length is not None and len(value) > meta.max_length
    if short or long:
        yield Fault(path, f"has {len(value)} elements", f"give {_described(kind, meta)}", shown(value))
    for number, item in enumerate(value):
        yield from _walk(item_kind, item, step(path, number, item if tables else None))


def _walk_tuple(kind: Any, value: Any, path: str) -> Iterator[Fault]:
    kinds = get_args(kind)
    if not isinstance(value, list) or len(value) != len(kinds):
        yield Fault(path, f"must be an array of {len(kinds)} numbers", "give x, y, z" if len(kinds) == 3 else f"give {len(kinds)} numbers", shown(value))
        return
    for number, (item_kind, item) in enumerate(zip(kinds, value, strict=True)):
        yield from _walk(item_kind, item, step(path, number))


def _walk_union(kind: Any, meta: msgspec.Meta | None, value: Any, path: str) -> Iterator[Fault]:
    """An optional value, or a number that may also be a row or a table: take the member that the value's form asks for."""
    members, rows, tables = _members(kind)
    member = ((isinstance(value, list) and rows) or (isinstance(value, dict) and tables) or members)[0]
    if member not in tables:
        member = _annotated(member, meta)
    yield from _walk(member, value, path)


def _leaf(kind: Any, meta: msgspec.Meta | None, value: Any, path: str) -> Iterator[Fault]:
    if kind is Any:
        yield from _anything(value, path)
        return
    if isinstance(value, float) and not math.isfinite(value):
        yield Fault(path, "must be finite", f"give {_described(kind, meta)}", shown(value))
        return
    number = value
    if isinstance(value, int) and not isinstance(value, bool) and (kind is float or abs(value) >= 2**63):
        number = float(min(max(value, -(10**301)), 10**301))  # beyond all bounds, but a float
    try:
        msgspec.convert(number, _annotated(kind, meta))
        good = meta is None or meta.pattern is None or re.search(meta.pattern + r"(?!\n)", str(number)) is not None  # a last newline is none of a name
    except msgspec.ValidationError:
        good = False
    if not good:
        yield Fault(path, _problem(kind, meta, number), f"give {_described(kind, meta)}", shown(value))


def _anything(value: Any, path: str) -> Iterator[Fault]:
    """A value whose type the file format leaves open: all that matters is that it can be written again."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _anything(item, step(path, key))
    elif isinstance(value, list):
        for number, item in enumerate(value):
            yield from _anything(item, step(path, number))
    elif isinstance(value, float) and not math.isfinite(value):
        yield Fault(path, "must be finite", "give a number, or leave it out", shown(value))
    elif isinstance(value, int) and abs(value) >= 2**63:
        yield Fault(path, "is too large an integer", "give a smaller one, or a number with a decimal point", shown(value))


def _problem(kind: Any, meta: msgspec.Meta | None, value: Any) -> str:
    if get_origin(kind) is Literal:
        options = [str(option) for option in get_args(kind)]
        return "must be one of " + ", ".join(options)
    if kind is not type(value):
        return f"must be {_KINDS.get(kind, kind)}"
    if meta is None:
        return "is not acceptable"
    bounds = [
        f"{word} {getattr(meta, name):g}"
        for name, word in (("gt", "greater than"), ("ge", "at least"), ("lt", "less than"), ("le", "at most"))
        if getattr(meta, name) is not None
    ]
    if bounds:
        return "must be " + " and ".join(bounds)
    if meta.max_length is not None and len(value) > meta.max_length:
        return f"is longer than {meta.max_length} characters"
    return "is not acceptable"


def _described(kind: Any, meta: msgspec.Meta | None = None) -> str:
    """What belongs here, for a remedy."""
    bare, inner = _bare(kind)
    meta = meta or inner
    text = meta.description if meta is not None else None
    if get_origin(bare) is Literal:
        options = [shown(option) for option in get_args(bare)]
        return text if text and all(option in text for option in options) else " or ".join(options)
    if text:
        return text
    if get_origin(bare) in (Union, types.UnionType):
        return _described(get_args(bare)[0])
    if isinstance(bare, type) and issubclass(bare, msgspec.Struct):
        required = [name for name, (_, needed) in _fields(bare).items() if needed]
        return f"a table with {', '.join(required or _fields(bare))}"
    if get_origin(bare) is list:
        return "an array"
    return _KINDS.get(bare, "a value")
