"""The group `tradeoff` of a results file, with a group per comparison."""

from __future__ import annotations

from collections.abc import Iterable

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
    for name in TEXTS:
        home.attrs[name] = getattr(panel, name)
    home.attrs["count"] = panel.count
    left = add_scale(
        home, "left_out", _words(f"{item.model}, {item.method}" for item in panel.left), "name"
    )
    for name in ("model", "method", "reason"):
        add_dataset(
            home,
            f"left_out_{name}",
            _words(getattr(item, name) for item in panel.left),
            "name",
            left,
        )
    entry = add_scale(home, "entry", _words(item.label for item in panel.entries), "name")
    component = add_scale(home, "component", _words(panel.component), "name")
    quartile = add_scale(home, "quartile", list(QUARTILES), "name")
    view = add_scale(home, "view", _words(item.title for item in panel.views), "name")
    for name in ("model", "method"):
        add_dataset(
            home, name, _words(getattr(item, name) for item in panel.entries), "name", entry
        )
    add_dataset(
        home,
        "error",
        np.array([item.error for item in panel.entries]).reshape(
            len(panel.entries), len(panel.component)
        ),
        "1",
        entry,
        component,
    )
    for name in ("once", "batch"):
        add_dataset(
            home,
            name,
            np.array([getattr(item, name) for item in panel.entries]).reshape(
                len(panel.entries), 3
            ),
            "s",
            entry,
            quartile,
        )
    add_dataset(
        home,
        "vectorised",
        np.array([item.vectorised for item in panel.entries], dtype=bool),
        "1",
        entry,
    )
    judged = np.array(
        [[n in item.components for n in range(len(panel.component))] for item in panel.views],
        dtype=bool,
    )
    add_dataset(
        home, "judged", judged.reshape(len(panel.views), len(panel.component)), "1", view, component
    )
    for kind in ("once", "batch"):
        on = [
            [n in panel.front(kind, item) for n in range(len(panel.entries))]
            for item in panel.views
        ]
        add_dataset(
            home,
            f"front_{kind}",
            np.array(on, dtype=bool).reshape(len(panel.views), len(panel.entries)),
            "1",
            view,
            entry,
        )


def load(group: Stored) -> Tradeoff:
    """Read the comparisons of a design from the group `tradeoff`."""
    return Tradeoff(
        tuple(_load(group[name]) for name in group.attrs["order"]),
        int(group.attrs["repeat"]),
        int(group.attrs["threads"]),
        tuple(_load_waits(group[f"{WAITS}{key}"]) for key in COMPARED if f"{WAITS}{key}" in group),
    )


def _load_waits(home: Stored) -> ResponseTimes:
    rows = zip(
        home["model"].asstr()[:],
        home["method"].asstr()[:],
        home["largest_error"][:],
        home["time"][:],
        strict=True,
    )
    return ResponseTimes(
        str(home.attrs["compares"]),
        str(home.attrs["start"]),
        tuple(
            ResponseTime(str(model), str(method), float(error), time)
            for model, method, error, time in rows
        ),
    )


def _load(home: Stored) -> Panel:
    def names(key: str) -> list[str]:
        return [str(value) for value in home[key].asstr()[:]]

    rows = zip(
        names("model"),
        names("method"),
        home["error"][:],
        home["once"][:],
        home["batch"][:],
        home["vectorised"][:],
        strict=True,
    )
    return Panel(
        component=tuple(names("component")),
        count=int(home.attrs["count"]),
        entries=tuple(
            Entry(model, method, error, once, batch, bool(many))
            for model, method, error, once, batch, many in rows
        ),
        left=tuple(
            Omission(*row)
            for row in zip(
                names("left_out_model"),
                names("left_out_method"),
                names("left_out_reason"),
                strict=True,
            )
        ),
        views=tuple(
            View(title, tuple(np.flatnonzero(row).tolist()))
            for title, row in zip(names("view"), home["judged"][:], strict=True)
        ),
        **{key: str(home.attrs[key]) for key in TEXTS},
    )
