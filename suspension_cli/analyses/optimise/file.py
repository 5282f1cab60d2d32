"""The group `optimise` of a results file, and the optimised design as TOML."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

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

PARTS: dict[str, tuple[str, type]] = {
    "numbers": ("number", Numbers),
    "quantities": ("quantity", Quantities),
    "limits": ("limit", Limits),
    "modes": ("mode", ModeTable),
    "starts": ("start", Starts),
}
"""Parts of a result: scale, whose name starts those of the datasets, and type."""
TEXTS = ("name", "label", "sense", "unit", "model")
"""Fields that are text."""
UNITS = {
    "number": dict.fromkeys(("before", "after", "lower", "upper"), "SI"),
    "quantity": dict.fromkeys(("before", "after", "searched"), "see quantity_unit"),
    "limit": dict.fromkeys(("asked", "value"), "see quantity_unit"),
    "mode": dict.fromkeys(("before", "after"), "Hz"),
    "start": {},
}
"""Units of datasets that are neither text nor dimensionless."""


def fill(group: h5py.Group, found: Optimum) -> None:
    """Write an optimised design into the group `optimise`."""
    group.attrs["goals"], group.attrs["goals_met"] = found.goals, found.met
    group.attrs["optimised_design"], group.attrs["objective"] = found.design, found.objective
    group.attrs["stationarity"] = found.stationarity
    group.attrs["unknown"] = "\n".join(found.unknown)
    group.attrs["checked_on"], group.attrs["checked_because"] = found.fidelity, found.reason
    group.attrs["checked_error"] = found.error
    for part, (word, kind) in PARTS.items():
        values = getattr(found, part)
        names = (
            list(values.name) if hasattr(values, "name") else np.arange(1, len(values.before) + 1)
        )
        axis = add_scale(group, word, names, "name" if hasattr(values, "name") else "1")
        for field in fields(kind):
            if field.name != "name":
                value, unit = getattr(values, field.name), UNITS[word].get(field.name, "1")
                text = field.name in TEXTS
                add_dataset(
                    group,
                    f"{word}_{field.name}",
                    list(value) if text else value,
                    "name" if text else unit,
                    axis,
                )


def load(group: Stored) -> Optimum:
    """Read an optimised design from the group `optimise`."""
    parts = {}
    for part, (word, kind) in PARTS.items():
        names = {
            field.name: word if field.name == "name" else f"{word}_{field.name}"
            for field in fields(kind)
        }
        parts[part] = kind(
            **{
                name: tuple(group[key].asstr()[:]) if name in TEXTS else group[key][:]
                for name, key in names.items()
                if key in group or name != "model"
            }
        )
    attrs = group.attrs
    return Optimum(
        unknown=tuple(str(attrs["unknown"]).splitlines()),
        objective=str(attrs["objective"]),
        stationarity=float(attrs["stationarity"]),
        fidelity=str(attrs["checked_on"]),
        reason=str(attrs["checked_because"]),
        error=float(attrs["checked_error"]),
        design=str(attrs["optimised_design"]),
        goals=str(attrs["goals"]),
        **parts,
    )


def save_design(path: Path, found: Optimum, file: str, goals: str, command: str) -> None:
    """Write the optimised design, headed by comments on its origin and limits not met."""
    limits, numbers = found.limits, found.numbers
    head = [f"{file}, optimised for {goals} by pendsus {__version__}:", f"  {command}"]
    head.append(
        f"{int(limits.met.sum())} of {len(limits.name)} limits are met, {found.checked}"
        + (":" if not limits.met.all() else "")
    )
    head += [
        f"  NOT MET: {name}: {value:.6g}"
        for name, value, met in zip(limits.name, limits.value, limits.met, strict=True)
        if not met
    ]
    head += [f"  UNKNOWN: {what}" for what in found.unknown]
    for name, before, after in zip(numbers.name, numbers.before, numbers.after, strict=True):
        head.append(f"  {name} = {float(after)!r}, from {before:.6g}")
    text = "".join(f"# {escape_unprintable(line)}\n" for line in head) + "\n" + found.design
    write_bytes(path, text.encode())
