"""Columns of what `check` lists: keys of the JSON document, headings and forms of the tables.

They annotate the fields of the parts that are listed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple, get_type_hints

from suspension_cli.analyses import tables
from suspension_cli.analyses.analysis import Document


class Column(NamedTuple):
    """Key in JSON; heading ("" for no column in the table), form and factor of its numbers."""

    key: str
    head: str = ""
    form: str = ""
    factor: float = 1.0


@cache
def _columns(kind: type) -> dict[str, Column]:
    """Columns of a class by field, its own before those of its base."""
    hints = get_type_hints(kind, include_extras=True)
    names = [name for one in kind.__mro__ for name in vars(one).get("__annotations__", ())]
    known = {name: getattr(hints[name], "__metadata__", (None,))[0] for name in names}
    return {name: column for name, column in known.items() if column}


def list_documents(parts: Sequence[object]) -> list[Document]:
    """Return the JSON list of parts of one kind."""
    return [
        {
            column.key: list(value) if isinstance(value, tuple) else value
            for column, value in _values(part)
        }
        for part in parts
    ]


def _values(part: object) -> list[tuple[Column, Any]]:
    return [(column, getattr(part, name)) for name, column in _columns(type(part)).items()]


def render(parts: Sequence[object], merge: Callable[[list[list[Any]]], list[list[Any]]]) -> str:
    """Render the table of parts of one kind, with rows that `merge` may join."""
    heads = {one.head: one.form for one in _columns(type(parts[0])).values() if one.head}
    rows = [
        [
            value if one.factor == 1 or value is None else value * one.factor
            for one, value in _values(part)
            if one.head
        ]
        for part in parts
    ]
    return tables.render(heads, merge(rows))
