"""A sweep that costs nothing, records its calls, and fails on request."""

from __future__ import annotations

import multiprocessing
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from suspension_cli.files.hdf5 import Provenance
from suspension_cli.studies import chunks
from suspension_cli.studies import run as batch


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
    identity: str = "toy"

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


def write(group: h5py.Group, columns: dict[str, Any]) -> None:
    for name, values in columns.items():
        group[name] = values


def run(job: Toy, path: Path, design: str = "a = 1", **how: Any) -> None:
    """Run a toy into a file."""
    batch.run(job, path, "toy", Provenance(design, "pendsus toy", "none", ""), write, **how)


def part(path: Path) -> Path:
    return path.with_name(path.name + ".part")


def finished(folder: Path, count: int) -> Any:
    """Points that the folder of an unfinished run has."""
    done = np.zeros(count, dtype=bool)
    job = folder / batch.KEY
    for file in folder.glob("*.chunk"):
        found = chunks.read(file, job.read_text(), count)
        start = chunks.start_of(file)
        if found is not None and start is not None:
            done[start : start + len(next(iter(found.values())))] = True
    return done


def damage(folder: Path) -> None:
    """Spoil a byte of the first chunk."""
    file = folder / "0.chunk"
    flip(file, 8 * (file.stat().st_size // 2))


def flip(file: Path, bit: int) -> None:
    """Change one bit of a file."""
    content = bytearray(file.read_bytes())
    content[bit // 8] ^= 1 << bit % 8
    file.write_bytes(content)
