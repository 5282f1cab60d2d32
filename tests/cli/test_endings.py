"""How runs end that something stops: one line on stderr, an exit code, no traceback, nothing
half-written."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import time

import pytest

from suspension_cli.analyses.export import file as exported
from suspension_cli.files import whole_files
from suspension_cli.linear import eigenmodes, response
from tests.support.commandline import assert_refused, from_template, process, run, written
from tests.support.golden import CONFIGS

FULL = pytest.mark.skipif(not os.path.exists("/dev/full"), reason="Linux alone has /dev/full")
MAIN = "from suspension_cli.cli.main import main; main(prog_name='pendsus')"


def shell(redirection, *args):
    """Run the command through a shell with its standard streams redirected."""
    words = f'"{sys.executable}" -c "{MAIN}" {" ".join(map(str, args))} {redirection}'
    buffered = {key: value for key, value in os.environ.items() if key != "PYTHONUNBUFFERED"}
    return subprocess.run(
        ["bash", "-c", words], capture_output=True, text=True, timeout=60, check=False, env=buffered
    )


@pytest.mark.parametrize(
    ("redirection", "reason"),
    [
        (">&-", "Bad file descriptor"),
        pytest.param("> /dev/full", "No space left on device", marks=FULL),
    ],
)
def test_standard_output_closed_or_full(redirection, reason):
    result = shell(redirection, "schema")
    assert result.returncode == 1
    assert (
        result.stderr
        == f"standard output cannot be written ({reason}); files that were written are whole\n"
    )


def test_standard_output_closed_by_its_reader():
    result = shell('| head -c 0; exit "${PIPESTATUS[0]}"', "schema")
    assert result.returncode == 1
    assert (
        result.stderr
        == "standard output was closed before everything was printed; files that were written are"
        " whole\n"
    )


@pytest.mark.parametrize("redirection", ["2>&-", pytest.param("2> /dev/full", marks=FULL)])
def test_a_closed_or_full_stderr_changes_no_exit_code(redirection, tmp_path):
    assert shell(redirection, "new", "single", tmp_path / "x.toml").returncode == 0
    assert shell(redirection, "new", "no-such-design", tmp_path / "x.toml").returncode == 2


def failing(error):
    def fail(*_, **__):
        raise error

    return fail


def test_interrupted(tmp_path, monkeypatch):
    monkeypatch.setattr(eigenmodes, "solve", failing(KeyboardInterrupt()))
    result = run("modes", CONFIGS / "double.toml", "--out", tmp_path / "out")
    assert (result.exit_code, result.stderr, result.stdout) == (130, "interrupted\n", "")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        OSError(errno.ENOMEM, os.strerror(errno.ENOMEM)),
        ImportError("x.so: failed to map segment from shared object"),
    ],
)
def test_out_of_memory(error, tmp_path, monkeypatch):
    monkeypatch.setattr(response, "solve", failing(error))
    result = run("response", CONFIGS / "double.toml", "--out", tmp_path / "out")
    assert result.exit_code == 1
    [line] = result.stderr.splitlines()
    assert line.startswith("out of memory") and line.endswith(
        "ask for less: fewer points in --frequency"
    )
    assert not (tmp_path / "out").exists()


def test_a_bug_is_not_hidden(tmp_path, monkeypatch):
    monkeypatch.setattr(response, "solve", failing(RuntimeError("a bug")))
    with pytest.raises(RuntimeError, match="a bug"):
        run("response", CONFIGS / "double.toml", "--out", tmp_path)


@pytest.mark.parametrize("command", [("modes",), ("draw",), ("export",), ("plot",)])
def test_out_that_names_a_file(command, tmp_path):
    file = from_template(tmp_path)
    out = tmp_path / "foo.png"
    result = run(*command, file, "--out", out)
    assert result.exit_code == 2
    assert result.stderr.startswith(f"--out = {out}: names a file, but results go into a folder; ")
    assert not out.exists()
    assert result.stderr.count("\n") == 1


def test_escapes_in_names_are_escaped(tmp_path):
    folder = tmp_path / "a\x1b[31m\nb"
    folder.mkdir()
    file = from_template(folder)
    checked = run("check", file)
    assert checked.stdout.split(":")[0].endswith("a\\u001b[31m\\nb/single.toml")
    drawn = run("draw", file, "--out", folder)
    assert drawn.stderr == f"wrote {tmp_path}/a\\u001b[31m\\nb/single-draw.png\n"
    titled = run(
        "modes", file, "--no-plot", "--out", tmp_path, "--set", 'design.title="\\u001b[31m"'
    )
    assert "\x1b" not in titled.stdout + titled.stderr
    assert "\x1b" not in run("schema", "\x1b[31m").stderr


SPRING = ("--vary", "stage.test.wires.s=0.02,0.03", "--workers", "1")
KINDS = {
    "modes": (),
    "export": ("--format", "mat"),
    "sweep": SPRING,
}


@pytest.mark.parametrize("command", KINDS)
def test_a_result_that_replaces_that_of_another_design_says_so(command, tmp_path):
    """The same design again does not; the file written is that of the new one."""
    plot = () if command == "export" else ("--no-plot",)
    options = (*KINDS[command], *plot, "--fidelity", "string", "--out", tmp_path / "out")
    first = CONFIGS / "double.toml"
    other = written(tmp_path, first.read_text() + "\n[analysis.modes]\nplot = true\n", "other.toml")
    reported = [run(command, file, *options) for file in (first, first, other)]
    assert [result.exit_code for result in reported] == [0, 0, 0]
    remarks = [
        [line for line in result.stderr.splitlines() if "another design" in line]
        for result in reported
    ]
    assert [len(lines) for lines in remarks] == [0, 0, 1]
    assert remarks[2][0].startswith(f"wrote {tmp_path / 'out' / 'double-'}")


def test_mat_files_hold_no_date(tmp_path, monkeypatch):
    images = []
    for moment in (0.0, 1e9):
        monkeypatch.setattr(time, "asctime", lambda *_, moment=moment: time.ctime(moment))
        assert run("export", CONFIGS / "double.toml", "--out", tmp_path).exit_code == 0
        images.append((tmp_path / "double-statespace.mat").read_bytes())
    assert images[0] == images[1]
    assert images[0].startswith(b"MATLAB 5.0 MAT-file, written by pendsus")
    assert len(exported.MAT_HEAD) == 116


def test_pipes_are_read_once(tmp_path):
    """Designs, measurements and goals may come through a pipe; results may not."""
    design, measured = (
        CONFIGS / "husman2000" / "table1-case4.toml",
        CONFIGS.parent / "measured" / "husman2000" / "table1-case4.toml",
    )
    words = []
    for file in (design, measured):
        end, start = os.pipe()
        os.write(start, file.read_bytes())
        os.close(start)
        words.append(f"/dev/fd/{end}")
    result = run("fit", *words, "--no-plot", "--fidelity", "string", "--out", tmp_path)
    assert result.exit_code == 0, result.stderr
    for word in words:
        os.close(int(word.rpartition("/")[2]))
    os.mkfifo(tmp_path / "x.h5")
    assert_refused(run("plot", tmp_path / "x.h5"), tmp_path / "x.h5")


@pytest.mark.parametrize("size", [400, 4_000])
def test_no_room_for_the_chunks_or_the_file_of_a_sweep(size, tmp_path):
    """What was computed stays for --resume."""
    result = process(
        "sweep", CONFIGS / "double.toml", *SPRING, "--no-plot", "-q", "--out", tmp_path, limit=size
    )
    assert result.returncode == 2
    assert "cannot be written (File too large)" in result.stderr.splitlines()[-1]
    assert not list(tmp_path.glob("*.h5"))


@pytest.mark.parametrize("ending", ["png", "csv"])
def test_no_room_for_what_follows_the_results_file(ending, tmp_path, monkeypatch):
    """The results file is complete, and says so."""
    real = whole_files.replace_file

    def full(path, data):
        if path.suffix == f".{ending}":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(path, data)

    monkeypatch.setattr(whole_files, "replace_file", full)
    result = run("modes", CONFIGS / "double.toml", "--csv", "--out", tmp_path, "-q")
    path = tmp_path / "double-modes.h5"
    assert result.exit_code == 2
    assert result.stderr.endswith(
        "cannot be written (No space left on device); name a folder with space and permission;"
        f" the results file {path} is complete, `pendsus plot {path}` draws its pictures\n"
    )
    monkeypatch.undo()
    assert run("plot", path).exit_code == 0


def test_no_room_for_the_results_file(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", failing(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))))
    result = run("modes", CONFIGS / "double.toml", "--out", tmp_path, "-q")
    assert result.stderr.endswith("name a folder with space and permission\n")
    assert not list(tmp_path.iterdir())
