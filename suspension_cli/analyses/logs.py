"""Logs of analyses: what they report while they run, and the warnings that results keep."""

from __future__ import annotations

import contextlib
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from suspension_cli.errors import PendsusWarning

if TYPE_CHECKING:
    from suspension_cli.analyses.options import Option

Progress = Callable[[int, int, float], None]
"""Called with (points done, points in all, points per second)."""
PACKAGE = os.path.join(Path(__file__).parents[1], "")
"""Folder of the package."""


class Log:
    """Messages of a run: silent except warnings, which become Python warnings.

    `parameters` are those of the command, whose options warnings call by the names of arguments.
    """

    def __init__(self, parameters: Sequence[Option] = ()) -> None:
        self.parameters = parameters

    def say(self, text: str) -> None:
        """Report a step that was done."""

    def detail(self, text: str) -> None:
        """Report a detail."""

    def warn(self, text: str) -> None:
        """Report a warning, at the line that called the package."""
        from suspension_cli.analyses.python_functions import translate

        frame = sys._getframe()
        level = 0
        while frame is not None and frame.f_code.co_filename.startswith(PACKAGE):
            frame = frame.f_back
            level += 1
        warnings.warn(translate(text, self.parameters), PendsusWarning, stacklevel=level + 1)

    def progress(self) -> contextlib.AbstractContextManager[Progress]:
        """Show the progress of a long computation."""
        return contextlib.nullcontext(lambda _done, _count, _rate: None)


class RunLog(Log):
    """Log of one run: passes messages on, and keeps its warnings."""

    def __init__(self, outer: Log) -> None:
        self.outer = outer
        self.warnings: list[str] = []
        self.say = outer.say
        self.detail = outer.detail
        self.progress = outer.progress

    def warn(self, text: str) -> None:
        """Keep a warning, and pass it on."""
        self.warnings.append(text)
        self.outer.warn(text)


class RelayedLog(Log):
    """Log of an analysis that another one runs: passes each warning on once, and keeps them."""

    def __init__(self, outer: Log) -> None:
        self.outer = outer
        self.lines: list[str] = []
        self.passed: set[str] = set()
        self.detail = outer.detail
        self.progress = outer.progress

    def warn(self, text: str) -> None:
        """Keep a warning."""
        if text not in self.lines:
            self.lines.append(text)
        if text not in self.passed:
            self.passed.add(text)
            self.outer.warn(text)

    def take(self) -> list[str]:
        """Return the warnings since the last call."""
        lines = self.lines
        self.lines = []
        return lines
