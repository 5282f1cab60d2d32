"""Differences between two designs, number by number, in usual units."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field

from suspension_cli.analyses.analysis import Document
from suspension_cli.design.paths import format_with_unit

OTHER_TABLES = ("design", "analysis")
"""Tables that do not describe a suspension."""
MISSING = "not given"


@dataclass(frozen=True)
class Change:
    """A key that differs, and its values with units; ``"not given"`` where missing.

    `item` is the number, from 0, of the design that differs from the first.
    """

    path: str
    before: str
    after: str
    item: int = field(default=0, repr=False)

    @property
    def words(self) -> str:
        """Short path: ``test wires d``."""
        return " ".join(part for part in self.path.split(".") if part != "stage").replace("_", " ")


def find_changes(before: str, after: str) -> list[Change]:
    """List the keys in which two designs (TOML) differ; a stage in only one of them is one change.

    >>> find_changes("constants.gravity = 9.81", "constants.gravity = 9.8")
    [Change(path='constants.gravity', before='9.81 m/s^2', after='9.8 m/s^2')]
    """
    documents = [tomllib.loads(text) for text in (before, after)]
    names = [{stage["name"] for stage in one.get("stage", ())} for one in documents]
    first, second = (_flatten(document, names[0] ^ names[1]) for document in documents)
    return [
        Change(path, _format(path, first.get(path)), _format(path, second.get(path)))
        for path in dict.fromkeys((*first, *second))
        if first.get(path) != second.get(path)
    ]


def _flatten(document: Document, alone: set[str]) -> dict[str, object]:
    """Collect values by dotted path; stages that are `alone` are one value."""
    kept = {key: value for key, value in document.items() if key not in OTHER_TABLES}
    values = dict(_values(kept))
    whole = {
        path: f"stage.{name}"
        for path in values
        for name in alone
        if path.startswith(f"stage.{name}.")
    }
    return {whole.get(path, path): "a stage" if path in whole else values[path] for path in values}


def _values(value: object, path: str = "") -> Iterator[tuple[str, object]]:
    """List dotted paths and values; tables in lists by name or number."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _values(item, f"{path}.{key}".strip("."))
    elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
        for n, item in enumerate(value, 1):
            yield from _values(item, f"{path}.{item.get('name', n)}")
    else:
        yield path, value


def _format(path: str, value: object) -> str:
    if value is None:
        return MISSING
    if isinstance(value, list):
        return ", ".join(_format(path, item) for item in value)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return str(value).lower() if isinstance(value, bool) else str(value)
    return format_with_unit(path, value, digits=10)
