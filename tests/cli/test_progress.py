"""The progress bar: on stderr, after a second, and not when quiet is asked for."""

from __future__ import annotations

import io

import pytest

from suspension_cli.cli import progress
from tests.support.commandline import run
from tests.support.couplings import FILE

GRID = (
    "--sweep",
    "k=0.6:1.4:41,offset=-2e-3:2e-3:40",
    "--no-plot",
    "--workers",
    "1",
    "--chunk",
    "64",
)


class Screen(io.StringIO):
    """A stderr that is a terminal or is not."""

    def __init__(self, terminal):
        super().__init__()
        self.terminal = terminal

    def isatty(self):
        return self.terminal


def drawn(monkeypatch, terminal, times, enabled=True):
    """What a bar writes when it is told of progress at some times (s)."""
    screen, clock = Screen(terminal), iter([100.0, *(100.0 + time for time in times)])
    monkeypatch.setattr(progress.sys, "stderr", screen)
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock))
    with progress.Bar(enabled=enabled) as bar:
        for n in range(1, len(times) + 1):
            bar(1000 * n, 1000 * len(times), 500.0)
    return screen.getvalue()


@pytest.mark.parametrize("terminal", [False, True])
def test_nothing_within_a_second(terminal, monkeypatch):
    assert drawn(monkeypatch, terminal, [0.1, 0.5, 0.99]) == ""
    assert drawn(monkeypatch, terminal, [5.0, 50.0, 500.0], enabled=False) == ""


def test_on_a_terminal(monkeypatch):
    """Redrawn in place five times a second at most, and finished with a new line."""
    text = drawn(monkeypatch, True, [0.5, 1.1, 1.15, 1.2, 1.35, 1.36])
    first, second, last, end = text.split("\r")
    assert end == "\n"
    assert "2,000 of 6,000  500/s  8 s left" in first
    assert "5,000 of 6,000  500/s  2 s left" in second
    assert last.startswith("#" * progress.WIDTH + " 6,000 of 6,000")
    assert first.startswith("#" * 10 + "." * 20 + " ")


def test_in_a_log(monkeypatch):
    """A line every ten seconds, and the last one."""
    lines = drawn(monkeypatch, False, [float(n) for n in range(1, 26)]).splitlines()
    assert [line.split()[1] for line in lines] == ["1,000", "11,000", "21,000", "25,000"]
    assert all(line.strip() for line in lines)


def test_before_anything_is_known(monkeypatch):
    screen = Screen(True)
    monkeypatch.setattr(progress.sys, "stderr", screen)
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    with progress.Bar(enabled=True) as bar:
        bar(0, 10, 0.0)
    assert "0 of 10  0/s" in screen.getvalue()


def test_of_a_run(monkeypatch, tmp_path):
    monkeypatch.setattr(progress, "PATIENCE", 1e6)
    assert "#" not in run("xcouple", FILE, *GRID, "--out", tmp_path).stderr
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    shown = run("xcouple", FILE, *GRID, "--out", tmp_path)
    assert "1,640 of 1,640" in shown.stderr
    assert "#" not in shown.stdout
    quiet = run("xcouple", FILE, *GRID, "--out", tmp_path, "-q")
    assert quiet.stderr == ""
