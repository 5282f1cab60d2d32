"""`--resume` with an unfinished file that is not that of the run: refused in one line, and left as
it is."""

from __future__ import annotations

import errno
import os
import shutil

import h5py
import pytest

from suspension_cli.studies import sweep_file
from tests.support.commandline import run
from tests.support.counting_sweep import marks
from tests.support.couplings import FILE
from tests.support.golden import CONFIGS

SMALL = (
    *("--sweep", "k=0.6:1.4:20,offset=-2e-3:2e-3:10", "--no-plot", "-q"),
    *("--chunk", "64", "--workers", "1"),
)
NAME = "husman2000-figure6-xcouple.h5"


@pytest.fixture(scope="module")
def full_disk(tmp_path_factory):
    """The folder of a run whose disk was full after some points."""
    folder = tmp_path_factory.mktemp("full")
    real, count = sweep_file._write, iter(range(10**9))

    def write(stream, data, place):
        if next(count) >= 8:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(stream, data, place)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sweep_file, "_write", write)
        assert run("xcouple", FILE, "--out", folder, *SMALL).exit_code == 2
    assert 0 < marks(folder / f"{NAME}.part", 200).sum() < 4
    return folder


@pytest.fixture
def broken_off(full_disk, tmp_path):
    """A copy of it."""
    return shutil.copytree(full_disk, tmp_path, dirs_exist_ok=True)


def elsewhere(part):
    part.unlink()
    with h5py.File(part, "w") as file:
        file["x"] = 1.0


def foreign(part):
    """The unfinished file of a sweep of the same shape of another design."""
    double = CONFIGS / "double.toml"
    assert (
        run(
            "xcouple",
            double,
            "--out",
            part.parent / "other",
            "--set",
            "design.name=husman2000-figure6",
            *SMALL,
        ).exit_code
        == 0
    )
    os.replace(part.parent / "other" / NAME, part)
    (part.parent / "other").rmdir()


SPOILT = {
    "cut": lambda part: os.truncate(part, part.stat().st_size - 1000),
    "cut short": lambda part: os.truncate(part, 100),
    "empty": lambda part: os.truncate(part, 0),
    "prose": lambda part: part.write_text("no HDF5"),
    "another HDF5": elsewhere,
    "another design": foreign,
    "a folder": lambda part: (part.unlink(), part.mkdir()),
    "a pipe": lambda part: (part.unlink(), os.mkfifo(part)),
}


@pytest.mark.parametrize("kind", SPOILT)
def test_refused(kind, broken_off):
    part = broken_off / f"{NAME}.part"
    SPOILT[kind](part)
    before = {path.name: path.stat().st_size for path in broken_off.iterdir()}
    result = run("xcouple", FILE, "--out", broken_off, *SMALL, "--resume")
    assert result.exit_code == 2
    [line] = result.stderr.splitlines()
    assert f"{NAME}.part" in line and line.endswith(
        "start anew without --resume"
        if part.is_file()
        else "is not a regular file; delete it, or name another folder"
    )
    assert before == {path.name: path.stat().st_size for path in broken_off.iterdir()}
    if part.is_file():
        assert run("xcouple", FILE, "--out", broken_off, *SMALL).exit_code == 0
