"""The group `tradeoff` of a results file."""

from __future__ import annotations

import h5py
import numpy as np

from suspension_cli.analyses.tradeoff.result import Entry, Tradeoff
from suspension_cli.files.hdf5 import Stored, add_dataset, add_scale

UNITS = {"time": "s", "error": "1"}
"""Units of the fields of an entry that are numbers; the others are text."""
FIELDS = Entry.__annotations__


def fill(group: h5py.Group, found: Tradeoff) -> None:
    """Write the times and errors of a design into a group."""
    scale = add_scale(group, "entry", np.arange(1, len(found.entries) + 1), "1")
    for name in FIELDS:
        values = [getattr(entry, name) for entry in found.entries]
        add_dataset(group, name, values, UNITS.get(name, "name"), scale)


def load(group: Stored) -> Tradeoff:
    """Read the times and errors of a design from a group."""
    columns = [group[name][:] if name in UNITS else group[name].asstr()[:] for name in FIELDS]
    return Tradeoff(tuple(Entry(*row) for row in zip(*(c.tolist() for c in columns), strict=True)))
