"""JSON and tables of what check lists of a design's parts."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, get_type_hints

from suspension_cli.analyses import tables
from suspension_cli.analyses.analysis import Document
from suspension_cli.physics.loads import Column

if TYPE_CHECKING:
    pass


MANY = 40
"""Number of wires above which equal wires of a stage share a row."""


@cache
def _columns(kind: type) -> list[tuple[str, Column]]:
    """Fields of a class with their columns, its own before those of its base."""
    hints = get_type_hints(kind, include_extras=True)
    names = [name for one in kind.__mro__ for name in vars(one).get("__annotations__", ())]
    known = {name: getattr(hints[name], "__metadata__", (None,))[0] for name in names}
    return [(name, column) for name, column in known.items() if column]


def list_documents(parts: Sequence[object]) -> list[Document]:
    """Return the JSON list of parts of one kind."""
    return [
        {
            column.key: list(value) if isinstance(value := getattr(part, name), tuple) else value
            for name, column in _columns(type(part))
        }
        for part in parts
    ]


def render(parts: Sequence[object]) -> str:
    """Render the table of parts of one kind; of many, equal wires of a stage share a row."""
    shown = [(name, column) for name, column in _columns(type(parts[0])) if column.head]
    rows: list[list[Any]] = []
    last: object = None
    for part in parts:
        label, *values = (getattr(part, name) for name, _ in shown)
        factors = [column.factor for _, column in shown[1:]]
        row = [label, *(v and v * f for v, f in zip(values, factors, strict=True))]
        stage, _, number = label.rpartition(".")
        equal = stage, *(value and f"{value:.3f}" for value in row[1:])
        if len(parts) > MANY and equal == last and number.isdecimal():
            rows[-1][0] = f"{rows[-1][0].partition(' ')[0]} to {number}"
        else:
            rows.append(row)
        last = equal
    return tables.render({column.head: column.form for _, column in shown}, rows)
