"""Files are written through links, devices and pipes of the user's, and through none that stands in
place of an unfinished file."""

from __future__ import annotations

import os
import stat
import threading

import pytest

import suspension_cli as sus
from tests.support.commandline import from_template, run
from tests.support.paths import CONFIGS

RESULT = sus.modes(sus.template("single"), fidelity="string")


def save(path):
    RESULT.save(path)


def start(path):
    assert run("new", "single", path, "--force").exit_code == 0


def solve(path):
    """Modes of a design whose results file has this path."""
    file, folder = from_template(path.parent / "designs"), path.parent
    words = ("--fidelity", "string", "--name", path.name.removesuffix("-modes.h5"), "--no-plot")
    assert run("modes", file, *words, "--out", folder).exit_code == 0


WRITERS = (save, start, solve)


@pytest.fixture(params=WRITERS, ids=lambda writer: writer.__name__)
def written(request, tmp_path):
    """A function that writes to a path, and what it writes into a regular file."""
    (tmp_path / "designs").mkdir()
    request.param(tmp_path / "a-modes.h5")
    return request.param, (tmp_path / "a-modes.h5").read_bytes()[:8]


@pytest.mark.parametrize("exists", [True, False])
def test_the_target_of_a_link_is_written(exists, written, tmp_path):
    write, begins = written
    (tmp_path / "own").mkdir()
    target, link = tmp_path / "own" / "file", tmp_path / "link-modes.h5"
    if exists:
        target.write_text("old")
    link.symlink_to("own/file")
    write(link)
    assert link.is_symlink() and target.read_bytes().startswith(begins)
    assert list(target.parent.iterdir()) == [target]


def test_a_pipe_is_written(written, tmp_path):
    write, begins = written
    pipe, taken = tmp_path / "pipe-modes.h5", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: taken.append(pipe.read_bytes()), daemon=True)
    reader.start()
    write(pipe)
    reader.join(10)
    assert taken[0].startswith(begins) and stat.S_ISFIFO(pipe.lstat().st_mode)


@pytest.mark.parametrize(("minor", "full"), [(3, False), (7, True)])
def test_a_device_stays_a_device(minor, full, tmp_path):
    """One that takes everything, and one that is full: nodes of this test alone."""
    node = tmp_path / "node"
    try:
        os.mknod(node, 0o600 | stat.S_IFCHR, os.makedev(1, minor))
        node.open("wb").close()
    except OSError:
        pytest.skip("nodes of devices are for root alone")
    done = run("new", "single", node, "--force")
    assert done.exit_code == (2 if full else 0)
    assert ("No space left" in done.stderr) == full
    assert stat.S_ISCHR(node.lstat().st_mode)
    assert list(tmp_path.iterdir()) == [node]


@pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="open files have no paths here")
def test_a_pipe_of_the_process_is_written(tmp_path):
    """As of /dev/stdout: a link to a pipe that has no name."""
    read, write = os.pipe()
    link = tmp_path / "x.h5"
    link.symlink_to(f"/proc/self/fd/{write}")
    with os.fdopen(read, "rb") as stream:
        thread = threading.Thread(target=lambda: (save(link), os.close(write)), daemon=True)
        thread.start()
        assert stream.read().startswith(b"\x89HDF")
    assert link.is_symlink()


def test_links_that_lead_to_themselves(tmp_path):
    link = tmp_path / "x.h5"
    link.symlink_to(link)
    with pytest.raises(sus.InputError, match="cannot be written"):
        save(link)
    assert link.is_symlink() and list(tmp_path.iterdir()) == [link]


SWEEP = ("--vary", "stage.test.wires.s=0.01,0.02", "--fidelity", "string", "--no-plot")


@pytest.mark.parametrize("resume", [(), ("--resume",)])
@pytest.mark.parametrize("exists", [True, False])
def test_unfinished_files_are_not_written_through_links(exists, resume, tmp_path):
    file, out, victim = from_template(tmp_path), tmp_path / "out", tmp_path / "victim"
    out.mkdir()
    if exists:
        victim.write_text("precious")
    link = out / "single-sweep.h5.part"
    link.symlink_to(victim)
    done = run("sweep", file, *SWEEP, *resume, "--out", out)
    assert done.exit_code == 2
    assert done.stderr == (
        f"--out = {link}: is no folder of an unfinished run; delete it, or name another folder\n"
    )
    assert list(out.iterdir()) == [link] and link.is_symlink()
    assert victim.read_text() == "precious" if exists else not victim.exists()


def test_a_sweep_fills_the_target_of_a_link(tmp_path):
    """Its unfinished files stand beside the target, as renaming needs one file system."""
    file, out, target = from_template(tmp_path), tmp_path / "out", tmp_path / "own.h5"
    out.mkdir()
    link = out / "single-sweep.h5"
    link.symlink_to(target)
    assert run("sweep", file, *SWEEP, "--out", out).exit_code == 0
    assert list(out.iterdir()) == [link] and link.is_symlink()
    found = sus.load(target)
    found.save(link)
    assert link.is_symlink() and sus.load(target).value.tolist() == found.value.tolist()
    assert found.stored_file() == target


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir])
def test_a_sweep_needs_a_regular_file(make, tmp_path):
    file, out = from_template(tmp_path), tmp_path / "out"
    out.mkdir()
    make(out / "single-sweep.h5")
    done = run("sweep", file, *SWEEP, "--out", out)
    assert done.exit_code == 2 and "is not a regular file" in done.stderr
    assert [path.name for path in out.iterdir()] == ["single-sweep.h5"]


@pytest.mark.parametrize(
    ("command", "option"),
    [("budget", "--ground"), ("budget", "--isolation"), ("response", "--measured")],
)
def test_names_that_are_too_long_name_no_file(command, option, tmp_path):
    done = run(command, CONFIGS / "double.toml", option, "9" * 400, "--out", tmp_path)
    assert done.exit_code == 2, done.stderr
    assert "is no file" in done.stderr or "is missing" in done.stderr
