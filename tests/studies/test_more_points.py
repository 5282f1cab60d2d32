"""A job that is continued with further points keeps the points that it has."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import h5py
import numpy as np
import pytest

from suspension_cli.files.hdf5 import Provenance
from suspension_cli.studies.run import Verdict, run

ORIGIN = Provenance("", "test", "string", "", 0.0)


@dataclass(frozen=True)
class Squares:
    """Squares of the numbers of points; `fails_from` is the first that cannot be computed."""

    count: int
    fails_from: int = 100
    computed: list = field(default_factory=list, compare=False)
    identity: str = "squares"

    def compute(self, start, stop):
        if stop > self.fails_from:
            raise KeyboardInterrupt
        self.computed.append((start, stop))
        return {"value": np.arange(start, stop) ** 2.0}


def squares_up_to(job, path, most, resume=False):
    """Run a job, and again with 6 more points until there are `most`."""

    def write(group, columns):
        group["value"] = columns["value"]

    def review(columns):
        count = len(columns["value"])
        more = replace(job, count=min(count + 6, most)) if count < most else None
        return Verdict(ORIGIN, write, more, keeps_points=True)

    run(job, path, "squares", ORIGIN, write, review=review, chunk=4, resume=resume)
    with h5py.File(path) as file:
        return file["squares/value"][:]


def test_points_are_kept(tmp_path):
    """But for a last chunk that was not full."""
    job = Squares(8)
    assert (squares_up_to(job, tmp_path / "a.h5", 20) == np.arange(20) ** 2.0).all()
    assert job.computed == [(0, 4), (4, 8), (8, 12), (12, 14), (12, 16), (16, 20)]


def test_an_interrupted_continuation_resumes(tmp_path):
    path = tmp_path / "a.h5"
    with pytest.raises(KeyboardInterrupt):
        squares_up_to(Squares(8, fails_from=15), path, 20)
    job = Squares(8)
    assert (squares_up_to(job, path, 20, resume=True) == np.arange(20) ** 2.0).all()
    assert job.computed == [(12, 16), (16, 20)]
