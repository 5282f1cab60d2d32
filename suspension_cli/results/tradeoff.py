"""The group `tradeoff` of a results file: a group in it for each comparison."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from suspension_cli.analysis.tradeoff.result import QUARTILES, Entry, Left, Panel, Tradeoff, View
from suspension_cli.results import Provenance, dataset, scale, write

TOLD = ("quantity", "compares", "title", "start", "item", "reference")
"""Attributes of a comparison that are plain text."""


def save(path: Path, found: Tradeoff, origin: Provenance) -> None:
    """Write what was measured for one design."""
    write(path, origin, lambda file: fill(file.create_group("tradeoff"), found))


def fill(group: h5py.Group, found: Tradeoff) -> None:
    """Put it into a group."""
    group.attrs["repeat"] = found.repeat
    group.attrs["threads"] = found.threads
    group.attrs["order"] = [panel.key for panel in found.panels]
    for panel in found.panels:
        _fill(group.create_group(panel.key), panel)


def _words(values: Iterable[str]) -> Any:
    """Strings as an array that stays one of strings when it is empty."""
    return np.array(list(values), dtype=str)


def _fill(home: h5py.Group, panel: Panel) -> None:
    for name in TOLD:
        home.attrs[name] = getattr(panel, name)
    home.attrs["count"] = panel.count
    left = scale(home, "left_out", _words(f"{item.rung}, {item.method}" for item in panel.left), "name")
    for name in ("rung", "method", "reason"):
        dataset(home, f"left_out_{name}", _words(getattr(item, name) for item in panel.left), "name", left)
    entry, component = scale(home, "entry", _words(item.label for item in panel.entries), "name"), scale(home, "component", _words(panel.component), "name")
    quartile, view = scale(home, "quartile", list(QUARTILES), "name"), scale(home, "view", _words(item.title for item in panel.views), "name")
    for name in ("rung", "method"):
        dataset(home, name, _words(getattr(item, name) for item in panel.entries), "name", entry)
    dataset(home, "error", np.array([item.error for item in panel.entries]).reshape(len(panel.entries), len(panel.component)), "1", entry, component)
    for name in ("once", "batch"):
        dataset(home, name, np.array([getattr(item, name) for item in panel.entries]).reshape(len(panel.entries), 3), "s", entry, quartile)
    dataset(home, "vectorised", np.array([item.vectorised for item in panel.entries], dtype=bool), "1", entry)
    judged = np.array([[n in item.components for n in range(len(panel.component))] for item in panel.views], dtype=bool)
    dataset(home, "judged", judged.reshape(len(panel.views), len(panel.component)), "1", view, component)
    for kind in ("once", "batch"):
        on = [[n in panel.front(kind, item) for n in range(len(panel.entries))] for item in panel.views]
        dataset(home, f"front_{kind}", np.array(on, dtype=bool).reshape(len(panel.views), len(panel.entries)), "1", view, entry)


def load(group: Any) -> Tradeoff:
    """What a group holds."""
    return Tradeoff(tuple(_load(group[name]) for name in group.attrs["order"]), int(group.attrs["repeat"]), int(group.attrs["threads"]))


def _load(home: Any) -> Panel:
    def names(key: str) -> list[str]:
        return [str(value) for value in home[key].asstr()[:]]

    rows = zip(names("rung"), names("method"), home["error"][:], home["once"][:], home["batch"][:], home["vectorised"][:], strict=True)
    return Panel(
        component=tuple(names("component")),
        count=int(home.attrs["count"]),
        entries=tuple(Entry(rung, method, error, once, batch, bool(many)) for rung, method, error, once, batch, many in rows),
        left=tuple(Left(*row) for row in zip(names("left_out_rung"), names("left_out_method"), names("left_out_reason"), strict=True)),
        views=tuple(View(title, tuple(np.flatnonzero(row).tolist())) for title, row in zip(names("view"), home["judged"][:], strict=True)),
        **{key: str(home.attrs[key]) for key in TOLD},
    )
