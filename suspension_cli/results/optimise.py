"""The group `optimise` of a results file, and the design found as TOML."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from suspension_cli import __version__
from suspension_cli.analysis.optimise.optimum import Every, Limits, Numbers, Optimum, Quantities, Starts
from suspension_cli.errors import printable
from suspension_cli.results import Provenance, dataset, scale, write, write_bytes

PARTS: dict[str, tuple[str, Any]] = {
    "numbers": ("number", Numbers),
    "quantities": ("quantity", Quantities),
    "limits": ("limit", Limits),
    "modes": ("mode", Every),
    "starts": ("start", Starts),
}
"""Parts of a result, the scale of each and so the first word of its datasets, and its type."""
NAMES = ("name", "label", "sense", "unit")
UNITS = {
    "number": dict.fromkeys(("before", "after", "lower", "upper"), "SI"),
    "quantity": dict.fromkeys(("before", "after", "searched"), "see quantity_unit"),
    "limit": dict.fromkeys(("asked", "value"), "see quantity_unit"),
    "mode": dict.fromkeys(("before", "after"), "Hz"),
    "start": {},
}
"""Units of datasets that are neither names nor bare numbers."""


def save(path: Path, found: Optimum, origin: Provenance, goals: str) -> None:
    """Write a design that was made to meet goals: group `optimise`; `goals` is the text of the goals."""

    def fill(file: h5py.File) -> None:
        group = file.create_group("optimise")
        group.attrs["goals"], group.attrs["goals_met"] = goals, found.met
        group.attrs["optimised_design"], group.attrs["objective"] = found.design, found.objective
        group.attrs["stationarity"], group.attrs["corrections"] = found.stationarity, found.rounds
        group.attrs["unknown"] = "\n".join(found.unknown)
        group.attrs["checked_on"], group.attrs["checked_because"], group.attrs["checked_error"] = found.fidelity, found.reason, found.error
        for part, (word, kind) in PARTS.items():
            values = getattr(found, part)
            names = list(values.name) if hasattr(values, "name") else np.arange(1, len(values.before) + 1)
            axis = scale(group, word, names, "name" if hasattr(values, "name") else "1")
            for field in fields(kind):
                if field.name != "name":
                    value, unit = getattr(values, field.name), UNITS[word].get(field.name, "1")
                    text = field.name in NAMES
                    dataset(group, f"{word}_{field.name}", list(value) if text else value, "name" if text else unit, axis)

    write(path, origin, fill)


def load(group: Any) -> Optimum:
    """What was found, from its group."""
    parts = {}
    for part, (word, kind) in PARTS.items():
        names = {field.name: word if field.name == "name" else f"{word}_{field.name}" for field in fields(kind)}
        parts[part] = kind(**{name: tuple(group[key].asstr()[:]) if name in NAMES else group[key][:] for name, key in names.items()})
    attrs = group.attrs
    return Optimum(
        unknown=tuple(str(attrs["unknown"]).splitlines()),
        objective=str(attrs["objective"]),
        stationarity=float(attrs["stationarity"]),
        rounds=int(attrs["corrections"]),
        fidelity=str(attrs["checked_on"]),
        reason=str(attrs["checked_because"]),
        error=float(attrs["checked_error"]),
        design=str(attrs["optimised_design"]),
        **parts,
    )


def save_design(path: Path, found: Optimum, file: str, goals: str, command: str) -> None:
    """Write the design found, headed by where it comes from and what it does not meet."""
    limits, numbers = found.limits, found.numbers
    head = [f"{file}, made to meet {goals} by pendsus {__version__}:", f"  {command}"]
    head.append(f"{int(limits.met.sum())} of {len(limits.name)} limits are met, checked on {found.fidelity}" + (":" if not limits.met.all() else ""))
    head += [f"  NOT MET: {name}: {value:.6g}" for name, value, met in zip(limits.name, limits.value, limits.met, strict=True) if not met]
    head += [f"  UNKNOWN: {what}" for what in found.unknown]
    for name, before, after in zip(numbers.name, numbers.before, numbers.after, strict=True):
        head.append(f"  {name} = {float(after)!r}, from {before:.6g}")
    text = "".join(f"# {printable(line)}\n" for line in head) + "\n" + found.design
    write_bytes(path, text.encode())
