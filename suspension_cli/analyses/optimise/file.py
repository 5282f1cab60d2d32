"""The group `optimise` of a results file, and the optimised design as TOML."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from suspension_cli.analyses.optimise.optimum import (
    Limits,
    ModeTable,
    Numbers,
    Optimum,
    Quantities,
    Starts,
)
from suspension_cli.errors import escape_unprintable
from suspension_cli.files.atomic import write_bytes
from suspension_cli.files.hdf5 import Stored, add_dataset, add_scale
from suspension_cli.version import __version__

PARTS: dict[str, tuple[str, type, str]] = {
    "numbers": ("number", Numbers, "SI"),
    "quantities": ("quantity", Quantities, "see quantity_unit"),
    "limits": ("limit", Limits, "see quantity_unit"),
    "modes": ("mode", ModeTable, "Hz"),
    "starts": ("start", Starts, "1"),
}
"""Parts of a result: scale, whose name starts those of the datasets, type, and unit of `VALUES`."""
TEXTS = ("name", "label", "sense", "unit", "model")
"""Fields that are text."""
VALUES = ("before", "after", "lower", "upper", "asked", "value")
"""Fields that have units; others are dimensionless."""
ATTRIBUTES = {
    "unknown": "unknown",
    "objective": "objective",
    "stationarity": "stationarity",
    "fidelity": "checked_on",
    "reason": "checked_because",
    "error": "checked_error",
    "design": "optimised_design",
    "goals": "goals",
}
"""Other fields of a result, with the names of their attributes."""


def fill(group: h5py.Group, found: Optimum) -> None:
    """Write an optimised design into the group `optimise`."""
    group.attrs["goals_met"] = found.met
    for field, name in ATTRIBUTES.items():
        value = getattr(found, field)
        group.attrs[name] = "\n".join(value) if field == "unknown" else value
    for part, (word, kind, unit) in PARTS.items():
        values = getattr(found, part)
        names = getattr(values, "name", None)
        count = np.arange(1, len(values.before) + 1) if names is None else list(names)
        axis = add_scale(group, word, count, "1" if names is None else "name")
        for field in [field.name for field in fields(kind) if field.name != "name"]:
            text, value = field in TEXTS, getattr(values, field)
            units = "name" if text else unit if field in VALUES else "1"
            add_dataset(group, f"{word}_{field}", list(value) if text else value, units, axis)


def load(group: Stored) -> Optimum:
    """Read an optimised design from the group `optimise`."""
    found: dict[str, Any] = {field: group.attrs[name] for field, name in ATTRIBUTES.items()}
    for part, (word, kind, _) in PARTS.items():
        values: dict[str, Any] = {}
        for field in [field.name for field in fields(kind)]:
            key = word if field == "name" else f"{word}_{field}"
            if field == "model" and key not in group:  # of an older version
                values[field] = ("",) * len(group[word])
            else:
                values[field] = tuple(group[key].asstr()[:]) if field in TEXTS else group[key][:]
        found[part] = kind(**values)
    found["unknown"] = tuple(str(found["unknown"]).splitlines())
    return Optimum(**found)


def save_design(path: Path, found: Optimum, file: str, goals: str, command: str) -> None:
    """Write the optimised design, headed by comments on its origin and limits not met."""
    limits, numbers = found.limits, found.numbers
    colon = "" if limits.met.all() else ":"
    head = [
        f"{file}, optimised for {goals} by pendsus {__version__}:",
        f"  {command}",
        f"{int(limits.met.sum())} of {len(limits.name)} limits are met, {found.checked}{colon}",
        *(
            f"  NOT MET: {name}: {value:.6g}"
            for name, value, met in zip(limits.name, limits.value, limits.met, strict=True)
            if not met
        ),
        *(f"  UNKNOWN: {what}" for what in found.unknown),
        *(
            f"  {name} = {float(after)!r}, from {before:.6g}"
            for name, before, after in zip(numbers.name, numbers.before, numbers.after, strict=True)
        ),
    ]
    text = "".join(f"# {escape_unprintable(line)}\n" for line in head) + "\n" + found.design
    write_bytes(path, text.encode())
