"""Columns of what `check` lists: keys of the JSON document, headings and forms of the tables.

They annotate the fields of the parts that are listed.
"""

from __future__ import annotations

from collections.abc import Sequence
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
    known = ((name, getattr(hints[name], "__metadata__", ())) for name in dict.fromkeys(names))
    return {name: column for name, (column, *_) in ((n, m) for n, m in known if m)}


def list_documents(parts: Sequence[object]) -> list[Document]:
    """Return the JSON list of parts of one kind."""
    return [
        {column.key: _plain(getattr(part, name)) for name, column in _columns(type(part)).items()}
        for part in parts
    ]


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def list_rows(parts: Sequence[object]) -> list[list[Any]]:
    """List the cells of the table of parts."""
    shown = [item for item in _columns(type(parts[0])).items() if item[1].head]
    cells = [[(getattr(part, name), column.factor) for name, column in shown] for part in parts]
    return [[v if factor == 1 or v is None else v * factor for v, factor in row] for row in cells]


def render(kind: type, rows: Sequence[Sequence[Any]]) -> str:
    """Render the table of rows of a kind of part."""
    return tables.render({c.head: c.form for c in _columns(kind).values() if c.head}, rows)
