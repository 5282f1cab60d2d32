"""The progress bar: on stderr of a terminal, after a second, not with `--quiet`."""

from __future__ import annotations

import io
import re
import sys

import pytest

from suspension_cli.cli import terminal as messages
from tests.support.commandline import run
from tests.support.couplings import FILE

GRID = (
    *("--sweep", "k=0.6:1.4:41,offset=-2e-3:2e-3:40", "--no-plot", "--workers"),
    *("1", "--chunk", "64"),
)


class Screen(io.StringIO):
    """A stderr that is a terminal or is not."""

    def __init__(self, terminal):
        super().__init__()
        self.terminal = terminal

    def isatty(self):
        return self.terminal


def drawn(monkeypatch, screen, times, enabled=True):
    """What a bar writes when it is given progress at some times (s), without escapes."""
    clock = iter([100.0, *(100.0 + time for time in times)])
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setattr(messages, "time", type("Clock", (), {"monotonic": lambda: next(clock)}))
    with messages.Bar(enabled=enabled) as bar:
        for n in range(1, len(times) + 1):
            bar(1000 * n, 1000 * len(times), 500.0)
    return re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", screen.getvalue())


@pytest.mark.parametrize("terminal", [False, True])
def test_nothing_within_a_second(terminal, monkeypatch):
    assert drawn(monkeypatch, Screen(terminal), [0.1, 0.5, 0.99]) == ""
    assert drawn(monkeypatch, Screen(terminal), [5.0, 50.0, 500.0], enabled=False) == ""
    assert drawn(monkeypatch, Screen(False), [5.0, 50.0, 500.0]) == ""  # as in a log


def test_on_a_terminal(monkeypatch):
    """Redrawn in place five times a second at most, and finished with a new line."""
    text = drawn(monkeypatch, Screen(True), [0.5, 1.1, 1.15, 1.2, 1.35, 1.36])
    shown = list(dict.fromkeys(re.findall(r"[\d,]+ of 6,000  500/s  \d+ s left", text)))
    assert shown == [
        "2,000 of 6,000  500/s  8 s left",
        "5,000 of 6,000  500/s  2 s left",
        "6,000 of 6,000  500/s  0 s left",
    ]
    assert text.endswith("\n")


def test_before_anything_is_known(monkeypatch):
    monkeypatch.setattr(messages, "PATIENCE", 0.0)
    screen = Screen(True)
    monkeypatch.setattr(sys, "stderr", screen)
    with messages.Bar(enabled=True) as bar:
        bar(0, 10, 0.0)
    assert "0 of 10  0/s" in screen.getvalue()


def test_before_the_first_part_is_done(monkeypatch):
    """An empty bar appears after a second, and none after the work has ended."""
    monkeypatch.setattr(messages, "PATIENCE", 0.01)
    screen = Screen(True)
    monkeypatch.setattr(sys, "stderr", screen)
    with messages.Bar(enabled=True) as bar:
        bar.timer.join()
    assert "computing" in screen.getvalue()
    silent = Screen(True)
    monkeypatch.setattr(sys, "stderr", silent)
    monkeypatch.setattr(messages, "PATIENCE", 60.0)
    with messages.Bar(enabled=True) as bar:
        pass
    bar.timer.join()
    assert silent.getvalue() == ""


def test_of_a_run(monkeypatch, tmp_path):
    monkeypatch.setattr(messages, "PATIENCE", 0.0)
    monkeypatch.setattr(messages.Bar, "__init__", _on_any_stderr(messages.Bar.__init__))
    shown = run("xcouple", FILE, *GRID, "--out", tmp_path)
    assert "1,640 of 1,640" in shown.stderr
    assert "1,640 of" not in shown.stdout
    quiet = run("xcouple", FILE, *GRID, "--out", tmp_path, "-q")
    assert quiet.stderr == ""


def _on_any_stderr(init):
    def start(bar, *, enabled):
        init(bar, enabled=enabled)
        bar.enabled = enabled

    return start
