"""Columns of what `check` lists: keys of the JSON document, headings and forms of the tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from suspension_cli.analyses import tables
from suspension_cli.analyses.analysis import Document


class Column(NamedTuple):
    """Key in JSON; heading ("" for no column in the table), form and factor of its numbers."""

    key: str
    head: str = ""
    form: str = ""
    factor: float = 1.0


Columns = Mapping[str, Column]
"""Columns by the attribute of a part."""


def list_documents(columns: Columns, parts: Sequence[object]) -> list[Document]:
    """Return the JSON list of parts."""
    return [{column.key: getattr(part, name) for name, column in columns.items()} for part in parts]


def list_rows(columns: Columns, parts: Sequence[object]) -> list[list[float | str | None]]:
    """List the cells of the table of parts."""
    shown = [(name, column.factor) for name, column in columns.items() if column.head]
    return [
        [
            value if factor == 1 or value is None else value * factor
            for name, factor in shown
            for value in [getattr(part, name)]
        ]
        for part in parts
    ]


def render(columns: Columns, rows: Sequence[Sequence[float | str | None]]) -> str:
    """Render the table of rows."""
    return tables.render({c.head: c.form for c in columns.values() if c.head}, rows)
