"""Text on the terminal: results on stdout, messages and progress on stderr."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from typing import Any

import click

from suspension_cli.analyses.analysis import Log, Result
from suspension_cli.errors import escape_unprintable

PATIENCE = 1.0
"""Time before the bar appears, s."""
EVERY = 0.2
"""Time between two updates, s."""


def tell(text: str) -> None:
    """Print one line on stderr, with escapes for what would break it."""
    click.echo(escape_unprintable(text), err=True)


def put(text: str) -> None:
    """Print lines for people on stdout, with escapes for what cannot be printed."""
    click.echo("\n".join(map(escape_unprintable, text.split("\n"))))


def put_documents(found: Sequence[Result]) -> None:
    """Print the JSON document of one result, or the list of those of several, on stdout."""
    documents = [one.document() for one in found]
    click.echo(json.dumps(documents[0] if len(documents) == 1 else documents))


class Voice(Log):
    """Messages of a command, one line each on stderr."""

    def __init__(self, *, quiet: bool = False, verbose: bool = False) -> None:
        self.quiet = quiet
        self.verbose = verbose

    def say(self, text: str) -> None:
        """Print unless --quiet is given."""
        if not self.quiet:
            tell(text)

    def detail(self, text: str) -> None:
        """Print if --verbose is given."""
        if self.verbose:
            tell(text)

    def warn(self, text: str) -> None:
        """Print a warning."""
        tell(f"warning: {text}")

    def progress(self) -> Bar:
        """Draw a progress bar where a computation takes more than a second."""
        return Bar(enabled=not self.quiet)


class Bar:
    """Progress bar, rate and time left on a terminal; call it with (done, all, rate)."""

    def __init__(self, *, enabled: bool) -> None:
        self.enabled = enabled and sys.stderr.isatty()
        self.due = time.monotonic() + PATIENCE
        self.bar: Any = None

    def __enter__(self) -> Bar:
        return self

    def __exit__(self, *_: object) -> None:
        if self.bar:
            self.bar.stop()

    def __call__(self, done: int, count: int, rate: float) -> None:
        """Update the bar if enough time has passed."""
        now = time.monotonic()
        if not self.enabled or (now < self.due and not (self.bar and done == count)):
            return
        self.due = now + EVERY
        left = f"{(count - done) / rate:.0f} s left" if rate else ""
        pace = f"{rate:,.0f}/s" if rate >= 1 or not rate else f"{1 / rate:.0f} s each"
        if not self.bar:
            self._start()
        text = f"{done:,} of {count:,}  {pace}  {left}"
        self.bar.update(
            self.bar.task_ids[0], completed=done, total=count, description=text, refresh=True
        )

    def _start(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn

        columns = BarColumn(30), TextColumn("{task.description}", markup=False)
        console = Console(stderr=True)
        self.bar = Progress(*columns, console=console, auto_refresh=False, redirect_stdout=False)
        self.bar.add_task("")
        self.bar.start()
