"""Measured times and errors, and the table in which they are stored."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path


@dataclass(frozen=True)
class Measurement:
    """Processor time and error of one piece of work.

    Attributes
    ----------
    work
        What is computed: ``thermal noise from 10 to 100 Hz, 200 frequencies``.
    design
        Name of the design; "" if there is none, or it is that of `work`.
    method
        Model, method or program.
    size
        Number of frequencies, points, builds or stages; 0 where `work` says it.
    time
        Processor time, s.
    error
        Relative; 0 of the reference, None if there is nothing to compare with.
    chosen
        ``best``: the fastest within the tolerance; ``auto``: the model of ``--fidelity auto``.
    """

    work: str
    design: str
    method: str
    size: int
    time: float
    error: float | None
    chosen: str = ""


def write_table(rows: Sequence[Measurement]) -> str:
    """Write measurements as CSV, times and errors with three digits."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([field.name for field in fields(Measurement)])
    for row in rows:
        writer.writerow([_write_cell(value) for value in astuple(row)])
    return stream.getvalue()


def _write_cell(value: str | float | None) -> str:
    """Write a cell; None is an empty one."""
    if value is None:
        return ""
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def read_table(path: Path) -> list[Measurement]:
    """Read measurements that `write_table` wrote."""
    with path.open(newline="") as stream:
        return [
            Measurement(
                row["work"],
                row["design"],
                row["method"],
                int(row["size"]),
                float(row["time"]),
                float(row["error"]) if row["error"] else None,
                row["chosen"],
            )
            for row in csv.DictReader(stream)
        ]


def select(rows: Sequence[Measurement], work: str, **wanted: str | int) -> list[Measurement]:
    """Select the measurements of one work, of a design, method or size."""
    return [
        row
        for row in rows
        if row.work == work and all(getattr(row, name) == value for name, value in wanted.items())
    ]
