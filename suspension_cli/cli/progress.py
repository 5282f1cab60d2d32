"""Progress bar on stderr for computations of more than a second."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress

PATIENCE = 1.0
"""Time before the bar appears, s."""
EVERY = 0.2
"""Time between two updates, s."""


class Bar:
    """Progress bar, rate and time left on a terminal; call it with (done, all, rate)."""

    def __init__(self, *, enabled: bool) -> None:
        self.enabled = enabled and sys.stderr.isatty()
        self.due = time.monotonic() + PATIENCE
        self.bar: Progress | None = None

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
            self.bar = _start()
        text = f"{done:,} of {count:,}  {pace}  {left}"
        self.bar.update(
            self.bar.task_ids[0], completed=done, total=count, description=text, refresh=True
        )


def _start() -> Progress:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    columns = BarColumn(30), TextColumn("{task.description}", markup=False)
    console = Console(stderr=True)
    bar = Progress(*columns, console=console, auto_refresh=False, redirect_stdout=False)
    bar.add_task("")
    bar.start()
    return bar
