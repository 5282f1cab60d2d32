"""Sweeps that are killed, broken off or run out of disk: what was done is kept, and `--resume` finishes the very same file."""

from __future__ import annotations

import errno
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from commandline import python, run
from couplings import FILE

from suspension_cli import store

NAME = "husman2000-figure6-xcouple.h5"
MAIN = "from suspension_cli.cli.main import main; main(prog_name='pendsus')"
SMALL = ("--sweep", "k=0.6:1.4:100,offset=-2e-3:2e-3:200", "--no-plot", "-q", "--chunk", "256")
LARGE = ("--sweep", "k=0.6:1.4:400,offset=-2e-3:2e-3:500", "--no-plot", "-q")


def started(out, *options):
    """A run as a process group of its own."""
    command = [sys.executable, "-c", MAIN, "xcouple", str(FILE), "--out", str(out), *options]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)


def finished(out, *options):
    """The file of a run that goes through."""
    process = started(out, *options)
    _, stderr = process.communicate(timeout=300)
    assert process.returncode == 0, stderr
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


def begun(out):
    """Wait until something has been written (or all is done)."""
    part = out / f"{NAME}.part"
    until = time.monotonic() + 60
    while time.monotonic() < until and not (out / NAME).exists():
        if part.exists() and (out / f"{NAME}.journal").exists() and (out / f"{NAME}.journal").stat().st_size:
            return
        time.sleep(0.01)


def killed(out, delay, *options):
    """Start a run and kill it some time after its file is there; its workers must not outlive it."""
    process = started(out, *options)
    begun(out)
    time.sleep(delay)
    workers = children(process.pid)
    process.kill()
    process.wait()
    process.stdout.close()
    process.stderr.close()
    until = time.monotonic() + 20
    while any(map(alive, workers)) and time.monotonic() < until:
        time.sleep(0.05)
    assert not any(map(alive, workers))


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    return finished(tmp_path_factory.mktemp("small"), *SMALL, "--workers", "1")


@pytest.mark.parametrize("workers", ["1", "2"])
def test_killed_and_resumed(workers, small, tmp_path):
    """20,000 points, killed twice."""
    rng = np.random.default_rng([61, int(workers)])
    for resume in ((), ("--resume",)):
        killed(tmp_path, float(rng.uniform(0.05, 0.6)), *SMALL, "--workers", workers, *resume)
        if (tmp_path / NAME).exists():  # this machine was too quick
            break
        with h5py.File(tmp_path / f"{NAME}.part") as file:
            assert file["xcouple/ratio"].shape == (100, 200, 1)
    assert finished(tmp_path, *SMALL, "--workers", workers, "--resume") == small


def test_a_large_sweep_killed_and_resumed(tmp_path):
    """200,000 points on two processes, killed once after two seconds or so and once more later."""
    rng = np.random.default_rng(62)
    killed(tmp_path / "killed", float(rng.uniform(2.0, 3.5)), *LARGE, "--workers", "2")
    journal = (tmp_path / "killed" / f"{NAME}.journal").read_bytes()
    share = np.frombuffer(journal[store.JOURNAL_HEAD :], dtype=np.uint8).mean()
    assert share < 1
    killed(tmp_path / "killed", float(rng.uniform(0.5, 1.0)), *LARGE, "--workers", "2", "--resume")
    resumed = finished(tmp_path / "killed", *LARGE, "--workers", "2", "--resume")
    assert resumed == finished(tmp_path / "whole", *LARGE, "--workers", "2")


@pytest.mark.parametrize(("workers", "delay"), [("1", 0.3), ("2", 0.0), ("2", 0.1), ("2", 0.8)])
def test_interrupted_from_the_keyboard(workers, delay, small, tmp_path):
    """Ctrl-C goes to the whole process group: workers that start, wait or compute must not answer it with tracebacks."""
    process = started(tmp_path, *SMALL, "--workers", workers)
    begun(tmp_path)
    while workers == "2" and len(children(process.pid)) < 3 and process.poll() is None:  # with the one that looks after what they share
        time.sleep(0.01)
    time.sleep(delay)
    os.killpg(process.pid, signal.SIGINT)
    _, stderr = process.communicate(timeout=60)
    if process.returncode != 0:
        assert process.returncode == 130
        [line] = [line for line in stderr.splitlines() if line]
        assert line.startswith("interrupted; ") and "--resume" in line
        assert sorted(path.name for path in tmp_path.iterdir()) == [f"{NAME}.journal", f"{NAME}.part"]
    assert finished(tmp_path, *SMALL, "--workers", workers, "--resume") == small


def interrupt_after(monkeypatch, writes, error):
    """Let `os.pwrite` fail after some writes of results, and for good."""
    real, count = os.pwrite, iter(range(10**9))

    def pwrite(handle, data, offset):
        if next(count) >= writes:
            raise error
        return real(handle, data, offset)

    monkeypatch.setattr(store.os, "pwrite", pwrite)


def full():
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_disk_that_is_full_from_the_start(monkeypatch, tmp_path):
    def no_space(*_):
        raise full()

    monkeypatch.setattr(store.os, "posix_fallocate", no_space)
    result = run("xcouple", FILE, "--out", tmp_path)
    assert result.exit_code == 2
    assert result.stderr == f"--out = {tmp_path / NAME}: cannot be written (No space left on device); name a folder with space and permission\n"
    assert list(tmp_path.iterdir()) == []


def test_a_file_larger_than_allowed(tmp_path):
    """A limit that the system itself enforces."""

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (500_000, 500_000))

    result = python(MAIN, "xcouple", FILE, "--out", tmp_path, *SMALL, preexec_fn=limit)
    assert result.returncode == 2
    assert result.stderr.count("\n") == 1
    assert "cannot be written (File too large)" in result.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("writes", [0, 1, 4, 100, 300])
def test_a_disk_that_fills_up(writes, monkeypatch, small, tmp_path):
    """One line, exit code 2; what was done can be read, and the run goes on from there."""
    monkeypatch.setattr(store, "SYNC_SECONDS", -1.0)  # after every chunk
    with monkeypatch.context() as patch:
        interrupt_after(patch, writes, full())
        result = run("xcouple", FILE, "--out", tmp_path, *SMALL, "--workers", "1")
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1
    assert "cannot be written (No space left on device)" in result.stderr
    if writes == 0:  # not even the journal
        assert list(tmp_path.iterdir()) == []
    else:
        with h5py.File(tmp_path / f"{NAME}.part") as file:
            ratio = file["xcouple/ratio"][:].ravel()
        done = np.repeat(np.frombuffer((tmp_path / f"{NAME}.journal").read_bytes()[store.JOURNAL_HEAD :], dtype=bool), store.UNIT)[: len(ratio)]
        assert done.any() == (writes > 7)  # the journal, six columns, the journal
        assert np.array_equal(ratio[done], numbers(small, tmp_path)["ratio"].ravel()[done])
        assert (ratio != 0).any() == (writes > 1)
    result = run("xcouple", FILE, "--out", tmp_path, *SMALL, "--workers", "1", "--resume")
    assert result.exit_code == 0, result.stderr
    found, expected = numbers((tmp_path / NAME).read_bytes(), tmp_path), numbers(small, tmp_path)
    assert all(np.array_equal(found[name], expected[name]) for name in expected)


def numbers(image, folder):
    """All datasets of a file: the command that it records is that of the process."""
    path = folder / "image.h5"
    path.write_bytes(image)
    with h5py.File(path) as file:
        result = {name: values[:] for name, values in file["xcouple"].items()}
    path.unlink()
    return result


@pytest.mark.parametrize(
    "options",
    [("--set", "stage.test.wires.s=0.006"), ("--wire", "test.2"), ("--hold", "natural-length"), ("--frequency", "51"), ("--allow-unstable",)],
)
def test_resume_of_another_question_is_refused(options, monkeypatch, tmp_path):
    with monkeypatch.context() as patch:
        interrupt_after(patch, 20, full())
        assert run("xcouple", FILE, "--out", tmp_path, *SMALL, "--workers", "1").exit_code == 2
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    result = run("xcouple", FILE, "--out", tmp_path, *SMALL, "--resume", *options)
    assert result.exit_code == 2
    remedy = "take the same design and options, or start anew without --resume"
    assert result.stderr == f"--resume: {NAME}.part belongs to another design or sweep; {remedy}\n"
    assert before == {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert run("xcouple", FILE, "--out", tmp_path, *SMALL, "--workers", "1", *options).exit_code == 0  # anew


def test_a_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    result = run("xcouple", FILE, "--out", tmp_path / "file" / "below")
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1
