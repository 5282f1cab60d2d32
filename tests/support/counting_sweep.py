"""A sweep that costs nothing, records its calls, and fails on request."""

from __future__ import annotations

import multiprocessing
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from suspension_cli.files.hdf5 import Provenance, add_scale
from suspension_cli.studies import run as batch
from suspension_cli.studies import sweep_file
from suspension_cli.studies.builds import Column


@dataclass(frozen=True)
class Toy:
    """Points 0 to count - 1.

    `log` takes a line for each range that was computed to its end; at point `fails` an exception is
    raised; with `dies`, further processes end without a word.
    """

    count: int
    log: str
    fails: int = -1
    dies: bool = False

    @property
    def shape(self) -> tuple[int, ...]:
        return (self.count,)

    @property
    def scales(self) -> tuple[str, ...]:
        return ("point",)

    @property
    def columns(self) -> tuple[Column, ...]:
        return (
            Column("point", "u4", (), "1"),
            Column("value", "f8", (3,), "m", ("axis",)),
            Column("flag", "u1", (), "1"),
        )

    def compute(self, start: int, stop: int) -> dict[str, Any]:
        if self.dies and multiprocessing.parent_process() is not None:
            os._exit(3)
        if start <= self.fails < stop and not self.dies:
            raise RuntimeError("failure on request")
        point = np.arange(start, stop)
        with Path(self.log).open("a") as stream:
            stream.write(f"{start} {stop}\n")
        return {
            "point": point,
            "value": np.sin(point[:, None] + [1.0, 2.0, 3.0]),
            "flag": 1 + point % 7,
        }

    def computed(self) -> Any:
        """How often each point was computed."""
        times = np.zeros(self.count, dtype=int)
        for line in Path(self.log).read_text().splitlines() if Path(self.log).exists() else ():
            start, stop = map(int, line.split())
            times[start:stop] += 1
        return times


def fill(group: h5py.Group) -> None:
    add_scale(group, "axis", np.arange(3), "1")


def run(
    job: Toy, path: Path, design: str = "a = 1", sweep: str = "toy", fill: Any = fill, **how: Any
) -> None:
    """Run a toy into a file."""
    batch.run(
        job,
        path,
        "toy",
        Provenance(design, "pendsus toy", "none", "", sweep),
        fill,
        **how,
    )


def part(path: Path) -> Path:
    return path.with_name(path.name + ".part")


def marked(path: Path, count: int) -> Any:
    """Points that are marked as done."""
    return np.repeat(marks(part(path), count), sweep_file.UNIT)[:count].astype(bool)


def marks(file: Path, count: int) -> Any:
    """Marks of the units of points in an unfinished file."""
    try:
        with h5py.File(file, locking=False) as stored:
            return (stored[sweep_file.SUMS][:] != 0).astype(np.uint8)
    except (OSError, KeyError):  # just begun, or just finished
        return np.zeros(-(-count // sweep_file.UNIT), dtype=np.uint8)
