"""Sweeps that are killed, broken off or run out of disk: what was done is kept, and `--resume`
finishes the very same file."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import signal
import sys
import time
import warnings
from dataclasses import dataclass
from multiprocessing import resource_tracker
from pathlib import Path

import numpy as np
import pytest

from suspension_cli.files import whole_files
from suspension_cli.studies import run as batch
from tests.support import counting_sweep
from tests.support.commandline import become, process, run
from tests.support.counting_sweep import finished as finished_points
from tests.support.couplings import FILE
from tests.support.files import numbers_of

NAME = "husman2000-figure6-xcouple.h5"
SMALL = (
    *("--sweep", "k=0.6:1.4:40,offset=-2e-3:2e-3:60"),
    *("--every-point", "--no-plot", "-q", "--chunk", "16"),
)
CHUNKS = 40 * 60 // 16
"""Chunks of it: so many that on a machine with other work a run is not over before it is ended."""
TINY = ("--sweep", "k=0.6:1.4:15,offset=-2e-3:2e-3:15", "--no-plot", "-q", "--chunk", "64")
"""Four chunks."""


class Started:
    """A run as a process group of its own: a copy of this process, which has imported
    everything."""

    def __init__(self, out, *options):
        self.stderr, self.returncode = os.memfd_create("stderr"), None
        with warnings.catch_warnings():
            # idle threads of linear algebra are no hindrance
            warnings.simplefilter("ignore", DeprecationWarning)
            self.pid = os.fork()
        if self.pid == 0:
            os.setsid()
            resource_tracker._resource_tracker._fd = None  # it starts one of its own
            resource_tracker._resource_tracker._pid = None
            become(
                ["xcouple", str(FILE), "--out", str(out), *options],
                os.open(os.devnull, os.O_WRONLY),
                self.stderr,
            )

    def poll(self, how=os.WNOHANG):
        if self.returncode is None:
            found, status = os.waitpid(self.pid, how)
            self.returncode = os.waitstatus_to_exitcode(status) if found else None
        return self.returncode

    def ended(self):
        """What it, and the process that looks after its semaphores, reported in the end."""
        self.poll(0)
        until = time.monotonic() + 20
        with contextlib.suppress(ProcessLookupError):
            while time.monotonic() < until:
                os.killpg(self.pid, 0)
                time.sleep(0.005)
        reported = os.pread(self.stderr, 10**6, 0).decode()
        os.close(self.stderr)
        return reported


def finished(out, *options):
    """The file of a run that goes through, here, with the command that a process of its own would
    record."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["-c", "xcouple", str(FILE), "--out", str(out), *options])
        result = run("xcouple", FILE, "--out", out, *options, "--workers", "1")
    assert result.exit_code == 0, result.stderr
    assert [path.name for path in out.iterdir()] == [NAME]
    return (out / NAME).read_bytes()


def children(pid):
    try:
        return [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


def alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def waited(process, out, chunks):
    """Wait until so many chunks are finished (or all is done)."""
    part, until = out / f"{NAME}.part", time.monotonic() + 60
    while process.poll() is None and time.monotonic() < until:
        if part.exists() and finished_points(part, 40 * 60).sum() >= 16 * chunks:
            return
        time.sleep(0.002)


def killed(out, chunks, *options):
    """Start a run and kill it when so many chunks are done; its workers must not outlive it."""
    process = Started(out, *options)
    waited(process, out, chunks)
    workers = children(process.pid)
    if process.poll() is None:
        os.kill(process.pid, signal.SIGKILL)
    process.ended()
    until = time.monotonic() + 20
    while any(map(alive, workers)) and time.monotonic() < until:
        time.sleep(0.01)
    assert not any(map(alive, workers))


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    return finished(tmp_path_factory.mktemp("small"), *SMALL)


@pytest.fixture(scope="module")
def tiny(tmp_path_factory):
    return finished(tmp_path_factory.mktemp("tiny"), *TINY)


@pytest.mark.parametrize(("workers", "kills"), [("2", (3, 20))])
def test_killed_and_resumed(workers, kills, small, tmp_path):
    """2,400 points, killed while they are computed, and once more after they were taken up."""
    assert max(kills) < CHUNKS
    for n, chunks in enumerate(kills):
        killed(tmp_path, chunks, *SMALL, "--workers", workers, *(["--resume"] if n else []))
    assert finished(tmp_path, *SMALL, "--resume") == small


@pytest.mark.parametrize("when", ["importing", "computing"])
def test_interrupted_from_the_keyboard(when, small, tmp_path):
    """Ctrl-C goes to the whole process group: workers that start or compute must not answer it with
    tracebacks."""
    process = Started(tmp_path, *SMALL, "--workers", "2")
    waited(process, tmp_path, 5 if when == "computing" else 0)
    # with the one that looks after what they share
    while len(children(process.pid)) < 2 and process.poll() is None:
        time.sleep(0.002)
    if when == "importing":
        time.sleep(0.1)
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGINT)
    stderr = process.ended()
    if process.returncode != 0:
        assert process.returncode == 130
        assert stderr.count("\n") == 1, stderr
        kept = [path.name for path in tmp_path.iterdir()]
        if when == "computing" or kept:
            assert stderr.startswith("interrupted; ") and "--resume" in stderr
            assert kept == [f"{NAME}.part"]
        else:
            assert stderr.startswith("interrupted") and "--resume" not in stderr
            assert kept == []
    assert finished(tmp_path, *SMALL, "--resume") == small


@pytest.mark.parametrize(
    ("number", "workers", "whole_group"),
    [
        (signal.SIGTERM, "1", False),
        (signal.SIGTERM, "2", False),
        (signal.SIGTERM, "2", True),
        (signal.SIGHUP, "2", True),
    ],
)
def test_ended_by_a_batch_system(number, workers, whole_group, small, tmp_path):
    """As after Ctrl-C, whether all processes get the signal or this one alone; a second one while
    it ends changes nothing, as terminals and shells both send SIGHUP."""
    process = Started(tmp_path, *SMALL, "--workers", workers)
    waited(process, tmp_path, 5)
    for _ in range(2):
        with contextlib.suppress(ProcessLookupError):
            (os.killpg if whole_group else os.kill)(process.pid, number)
    stderr = process.ended()
    part = tmp_path / f"{NAME}.part"
    line = f"ended by {number.name}; finished points are in {part}; --resume continues\n"
    assert (process.returncode, stderr) == (128 + number, line)
    assert [path.name for path in tmp_path.iterdir()] == [part.name]
    assert finished(tmp_path, *SMALL, "--resume") == small


def test_workers_that_are_ended_first_are_not_out_of_memory(small, tmp_path):
    """Batch systems send the signal to one process after another."""
    process = Started(tmp_path, *SMALL, "--workers", "2")
    waited(process, tmp_path, 5)
    for worker in [*children(process.pid)[1:], process.pid]:
        with contextlib.suppress(ProcessLookupError):
            os.kill(worker, signal.SIGTERM)
        time.sleep(0.05)
    assert process.ended().startswith("ended by SIGTERM; ")
    assert process.returncode == 128 + signal.SIGTERM
    assert finished(tmp_path, *SMALL, "--resume") == small


def test_signals_that_are_ignored_stay_ignored(small, tmp_path):
    """As `nohup` ignores SIGHUP."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        process = Started(tmp_path, *SMALL, "--workers", "2")
    finally:
        signal.signal(signal.SIGHUP, before)
    waited(process, tmp_path, 5)
    os.killpg(process.pid, signal.SIGHUP)
    assert (process.ended(), process.returncode) == ("", 0)
    assert (tmp_path / NAME).read_bytes() == small


@dataclass(frozen=True)
class Slow(counting_sweep.Toy):
    """A job whose second chunk takes longer than anybody waits."""

    def compute(self, start, stop):
        if start == 64:
            time.sleep(3600)
        return super().compute(start, stop)


def test_chunks_that_take_long_are_not_waited_for(tmp_path):
    """Workers are ended at once: batch systems kill what does not end in some seconds."""
    job = Slow(64 * 8, str(tmp_path / "log"))

    def interrupt(done, _all, _rate):
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        counting_sweep.run(job, tmp_path / "toy.h5", chunk=64, workers=2, progress=interrupt)
    part = counting_sweep.part(tmp_path / "toy.h5")
    assert counting_sweep.finished(part, job.count).any()


@pytest.mark.parametrize("writes", [1, 3])
def test_interrupted_from_the_keyboard_without_workers(writes, monkeypatch, tiny, tmp_path):
    """In the first chunk and in later ones."""
    with monkeypatch.context() as patch:
        fail_after(patch, writes, KeyboardInterrupt())
        patch.setattr(sys, "argv", ["-c", "xcouple", str(FILE), "--out", str(tmp_path), *TINY])
        result = run("xcouple", FILE, "--out", tmp_path, *TINY, "--workers", "1")
    assert result.exit_code == 130
    [line] = result.stderr.splitlines()
    assert line.startswith("interrupted; ") and "--resume" in line
    assert [path.name for path in tmp_path.iterdir()] == [f"{NAME}.part"]
    assert finished(tmp_path, *TINY, "--resume") == tiny


def fail_after(monkeypatch, writes, error):
    """Let every write of results after some raise an error."""
    real, count = batch.chunks.write, iter(range(10**9))

    def write(file, *content):
        if next(count) >= writes:
            file.write_bytes(b"begun")
            raise error
        real(file, *content)

    monkeypatch.setattr(batch.chunks, "write", write)


FULL = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_disk_that_is_full_from_the_start(monkeypatch, tmp_path):
    fail_after(monkeypatch, 0, FULL)
    result = run("xcouple", FILE, "--out", tmp_path)
    assert result.exit_code == 2
    assert (
        result.stderr
        == f"--out = {tmp_path / NAME}: cannot be written (No space left on device); name a folder"
        " with space and permission\n"
    )
    assert list(tmp_path.iterdir()) == []


def test_a_file_larger_than_allowed(small, tmp_path):
    """A limit that the system itself enforces, on the results file alone: all points are kept."""
    result = process("xcouple", FILE, "--out", tmp_path, *SMALL, limit=70_000)
    assert result.returncode == 2
    assert result.stderr.count("\n") == 1
    assert "cannot be written (File too large)" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == [f"{NAME}.part"]
    assert finished_points(tmp_path / f"{NAME}.part", 40 * 60).all()


@pytest.mark.parametrize(("writes", "bare"), [(1, False), (3, False), (3, True)])
def test_a_disk_that_fills_up(writes, bare, monkeypatch, tiny, tmp_path):
    """One line, exit code 2; what was done can be read, and the run goes on from there: also
    without what Windows lacks, locks of `fcntl` and masks of signals."""
    if bare:
        monkeypatch.setattr(whole_files, "fcntl", None)
        monkeypatch.delattr(signal, "pthread_sigmask")
    with monkeypatch.context() as patch:
        fail_after(patch, writes, FULL)
        result = run("xcouple", FILE, "--out", tmp_path, *TINY, "--workers", "1")
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1
    assert "cannot be written (No space left on device)" in result.stderr
    assert finished_points(tmp_path / f"{NAME}.part", 15 * 15).sum() == 64 * writes
    # the command that a file records is that of the process
    found, expected = map(numbers_of, (finished(tmp_path, *TINY, "--resume"), tiny))
    assert all(np.array_equal(found[name], expected[name], equal_nan=True) for name in expected)


def test_a_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    result = run("xcouple", FILE, "--out", tmp_path / "file" / "below")
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1


def killed_while_writing(write):
    """A process, a copy of this one, that kills itself before it renames a file."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        os.fsync = lambda _handle: os.kill(os.getpid(), signal.SIGKILL)
        try:
            write()
        finally:
            os._exit(1)  # an exception must not go on with the tests in the copy
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == -signal.SIGKILL


@pytest.mark.parametrize("resume", [True, False])
def test_what_a_kill_during_the_last_write_leaves_is_removed(resume, tmp_path):
    """When the run begins, as it may need the space."""
    path, seen = tmp_path / "toy.h5", []

    class Witness(counting_sweep.Toy):
        def compute(self, start, stop):
            seen.append(sorted(one.name for one in tmp_path.iterdir()))
            return super().compute(start, stop)

    job = Witness(100, str(tmp_path / "log"))
    killed_while_writing(lambda: counting_sweep.run(job, path, chunk=64))
    left = [one.name for one in tmp_path.iterdir()]
    assert any(re.fullmatch(r"\.toy\.h5\.\w{8}", name) for name in left)
    (counting_sweep.part(path) / "64.chunk").unlink()
    seen.clear()
    counting_sweep.run(job, path, chunk=64, resume=resume)
    assert seen == [["log", "toy.h5.part"]] * (1 if resume else 2)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["log", "toy.h5"]


def test_files_of_other_names_and_kinds_are_no_leftovers(tmp_path):
    path = tmp_path / "x.png"
    killed_while_writing(lambda: whole_files.replace_file(path, b"1"))
    kept = [".x.png.notes", ".x.png.ABCDEFGH", ".y.png.abcdefgh", ".x.png.abcdefgh.txt"]
    for name in kept:
        (tmp_path / name).touch()
    (tmp_path / ".x.png.aaaaaaaa").mkdir()
    (tmp_path / ".x.png.bbbbbbbb").symlink_to("x.png")
    os.mkfifo(tmp_path / ".x.png.cccccccc")
    whole_files.replace_file(path, b"2")
    special = [".x.png.aaaaaaaa", ".x.png.bbbbbbbb", ".x.png.cccccccc"]
    assert sorted(one.name for one in tmp_path.iterdir()) == sorted([*kept, *special, "x.png"])


def test_what_another_process_is_writing_is_no_leftover(tmp_path):
    """Both files are whole in their turn."""
    path, read_end, write_end = tmp_path / "x.png", *os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        os.fsync = lambda _handle: os.read(read_end, 1)
        try:
            whole_files.replace_file(path, b"slow")
            os._exit(0)
        finally:
            os._exit(1)  # an exception must not go on with the tests in the copy
    while not (temporary := [*tmp_path.glob(".x.png.*")]) or not temporary[0].stat().st_size:
        time.sleep(0.002)
    whole_files.replace_file(path, b"quick")
    assert path.read_bytes() == b"quick" and temporary[0].exists()
    os.write(write_end, b".")
    assert os.waitpid(child, 0)[1] == 0
    assert path.read_bytes() == b"slow"
    assert [one.name for one in tmp_path.iterdir()] == ["x.png"]
    os.close(read_end)
    os.close(write_end)
