"""The group `tradeoff` of a results file, with a group per comparison."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import h5py
import numpy as np

from suspension_cli.analyses.tradeoff.result import (
    COMPARED,
    COUNTS,
    OCCASIONS,
    QUARTILES,
    Entry,
    Omission,
    Panel,
    ResponseTime,
    ResponseTimes,
    Tradeoff,
    View,
)
from suspension_cli.files.hdf5 import Stored, add_dataset, add_scale

TEXTS = ("quantity", "compares", "title", "start", "item", "reference")
"""Attributes of a comparison that are text."""
WAITS = "response-times-"
"""Begins the names of the groups of the times of responses in a row."""


def fill(group: h5py.Group, found: Tradeoff) -> None:
    """Write the comparisons of a design into the group `tradeoff`."""
    group.attrs["repeat"] = found.repeat
    group.attrs["threads"] = found.threads
    group.attrs["order"] = [panel.key for panel in found.panels]
    for panel in found.panels:
        _fill(group.create_group(panel.key), panel)
    for each in found.waits:
        _fill_waits(group.create_group(f"{WAITS}{each.compares}"), each)


def _fill_waits(home: h5py.Group, each: ResponseTimes) -> None:
    home.attrs["compares"], home.attrs["start"] = each.compares, each.start
    entries = each.entries
    scales = (
        add_scale(home, "entry", _words(f"{e.model}, {e.method}" for e in entries), "name"),
        add_scale(home, "occasion", list(OCCASIONS), "name"),
        add_scale(home, "count", np.array(COUNTS), "1"),
        add_scale(home, "quartile", list(QUARTILES), "name"),
    )
    for name in ("model", "method"):
        add_dataset(home, name, _words(getattr(e, name) for e in entries), "name", scales[0])
    add_dataset(home, "largest_error", np.array([e.error for e in entries]), "1", scales[0])
    add_dataset(home, "time", np.array([e.time for e in entries]), "s", *scales)


def _words(values: Iterable[str]) -> np.ndarray:
    """Make an array of strings, also if it is empty."""
    return np.array(list(values), dtype=str)


def _fill(home: h5py.Group, panel: Panel) -> None:
    def scale(name: str, values: Iterable[str]) -> h5py.Dataset:
        return add_scale(home, name, _words(values), "name")

    def add(name: str, values: list, kind: type, units: str, *axes: h5py.Dataset) -> None:
        shape = [len(axis) for axis in axes]
        add_dataset(home, name, np.array(values, dtype=kind).reshape(shape), units, *axes)

    for name in TEXTS:
        home.attrs[name] = getattr(panel, name)
    home.attrs["count"] = panel.count
    entries, views = panel.entries, panel.views
    left = scale("left_out", (f"{item.model}, {item.method}" for item in panel.left))
    for name in ("model", "method", "reason"):
        add(f"left_out_{name}", [getattr(item, name) for item in panel.left], str, "name", left)
    entry = scale("entry", (item.label for item in entries))
    component = scale("component", panel.component)
    quartile = scale("quartile", QUARTILES)
    view = scale("view", (item.title for item in views))
    for name in ("model", "method"):
        add(name, [getattr(item, name) for item in entries], str, "name", entry)
    add("error", [item.error for item in entries], float, "1", entry, component)
    for name in ("once", "batch"):
        add(name, [getattr(item, name) for item in entries], float, "s", entry, quartile)
    add("vectorised", [item.vectorised for item in entries], bool, "1", entry)
    judged = [[n in item.components for n in range(len(panel.component))] for item in views]
    add("judged", judged, bool, "1", view, component)
    for kind in ("once", "batch"):
        front = [[n in panel.front(kind, item) for n in range(len(entries))] for item in views]
        add(f"front_{kind}", front, bool, "1", view, entry)


def load(group: Stored) -> Tradeoff:
    """Read the comparisons of a design from the group `tradeoff`."""
    return Tradeoff(
        tuple(_load(group[name]) for name in group.attrs["order"]),
        int(group.attrs["repeat"]),
        int(group.attrs["threads"]),
        tuple(_load_waits(group[f"{WAITS}{key}"]) for key in COMPARED if f"{WAITS}{key}" in group),
    )


def _load_waits(home: Stored) -> ResponseTimes:
    entries = tuple(
        ResponseTime(model, method, float(error), time)
        for model, method, error, time in _rows(home, "model", "method", "largest_error", "time")
    )
    return ResponseTimes(str(home.attrs["compares"]), str(home.attrs["start"]), entries)


def _rows(home: Stored, *names: str) -> Iterator[tuple[Stored, ...]]:
    """Iterate over the rows of some datasets; names are strings."""
    columns = [home[name] for name in names]
    texts = [h5py.check_string_dtype(column.dtype) for column in columns]
    read = (c.asstr()[:].tolist() if t else c[:] for c, t in zip(columns, texts, strict=True))
    return zip(*read, strict=True)


def _load(home: Stored) -> Panel:
    left = ("left_out_model", "left_out_method", "left_out_reason")
    return Panel(
        component=tuple(name for (name,) in _rows(home, "component")),
        count=int(home.attrs["count"]),
        entries=tuple(
            Entry(model, method, error, once, batch, bool(many))
            for model, method, error, once, batch, many in _rows(
                home, "model", "method", "error", "once", "batch", "vectorised"
            )
        ),
        left=tuple(Omission(*row) for row in _rows(home, *left)),
        views=tuple(
            View(title, tuple(np.flatnonzero(row).tolist()))
            for title, row in _rows(home, "view", "judged")
        ),
        **{key: str(home.attrs[key]) for key in TEXTS},
    )
