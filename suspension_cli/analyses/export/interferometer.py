"""Suspensions for programs of interferometers: elements of finesse."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module, resources
from pathlib import Path
from typing import Any

import numpy as np

from suspension_cli.analyses.export.solve import Exported
from suspension_cli.conventions import SUPPORT
from suspension_cli.errors import InputError
from suspension_cli.files.atomic import write_bytes
from suspension_cli.files.hdf5 import Provenance

FORCES = ("force_x", "torque_pitch", "torque_yaw")
MOTIONS = ("x", "pitch", "yaw")
"""Forces on a mirror, and its motions, that finesse has."""


def finesse_signals(chain: list[str]) -> tuple[list[str], list[str]]:
    """Inputs and outputs by default: the support's motions, forces on stages, and their motions."""
    moved = [f"{SUPPORT}.{dof}" for dof in MOTIONS]
    return (
        moved + [f"{body}.{force}" for body in chain for force in FORCES],
        [f"{body}.{dof}" for body in chain for dof in MOTIONS],
    )


def check_names(inputs: Sequence[str], outputs: Sequence[str], mirror: str) -> None:
    """Raise `InputError` for signals that are no nodes of finesse."""
    for option, names in (("--input", inputs), ("--output", outputs)):
        for name in names:
            body, _, kind = name.rpartition(".")
            remedy = ""
            if not name.replace(".", "").replace("-", "").isidentifier():
                remedy = f"take motions of and forces on the COM of one body, such as {mirror}.x"
            elif body == mirror and kind not in (*FORCES, *MOTIONS):
                remedy = f"finesse's mirrors have {', '.join((*MOTIONS, *FORCES))}"
            if remedy:
                raise InputError.of(option, "is no node of finesse", remedy, name)


def plant(made: Exported, mirror: str) -> dict[str, Any]:
    """State space with the names of signals, as `finesse.Suspension` takes it."""
    system = made.system.balanced()
    names = {
        key: [name.replace("-", "_") for name in getattr(system, key)]
        for key in ("input", "output")
    }
    matrices = {key: getattr(system, key) for key in "abcd"}
    return {**matrices, **names, "mirror": mirror.replace("-", "_")}


def write_finesse(path: Path, made: Exported, origin: Provenance) -> None:
    """Write a Python module with the element and its numbers."""
    text = resources.files(__package__ or "").joinpath("finesse.py").read_text("utf-8")
    lines = [
        text,
        "",
        f"# Written by {origin.command}",
        "",
        "def _matrix(shape, row, column, value):",
    ]
    lines += [
        "    result = np.zeros(shape)",
        "    result[row, column] = value",
        "    return result",
    ]
    lines += ["", "", "PLANT = {"]
    for key, value in plant(made, made.mirror).items():
        if isinstance(value, np.ndarray):
            row, column = (part.tolist() for part in np.nonzero(value))
            numbers = value[row, column].tolist()
            value = f"_matrix({value.shape}, {row}, {column}, {numbers})"
        lines.append(f"    {key!r}: {value if key in 'abcd' else repr(value)},")
    lines += ["}", "", "", "def suspend(name, mirror, facing=1):"]
    lines += [f'    """Suspend a mirror of finesse as the {made.mirror} of this design."""']
    lines += ["    return Suspension(name, mirror, facing, PLANT)", ""]
    write_bytes(path, "\n".join(lines).encode())


def suspend(made: Exported, name: str, mirror: Any, facing: int) -> Any:
    """Make the element of finesse."""
    module = import_module("suspension_cli.analyses.export.finesse")
    return module.Suspension(name, mirror, facing, plant(made, made.mirror))
