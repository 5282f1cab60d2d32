"""Progress bar on stderr for computations of more than a second."""

from __future__ import annotations

import contextlib
import sys
import time
from types import TracebackType

WIDTH = 30
PATIENCE = 1.0
"""Time before the bar appears, s."""
EVERY = 0.2
"""Time between two updates, s."""


class Bar:
    """Progress bar, rate and time left; call it with (done, all, rate)."""

    def __init__(self, *, enabled: bool) -> None:
        self.enabled = enabled
        self.began = time.monotonic()
        self.drawn = 0.0

    def __enter__(self) -> Bar:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self.drawn and sys.stderr.isatty():
            sys.stderr.write("\n")

    def __call__(self, done: int, count: int, rate: float) -> None:
        """Update the bar if enough time has passed."""
        now = time.monotonic()
        last = done == count and self.drawn
        if (
            not self.enabled
            or now - self.began < PATIENCE
            or (now - self.drawn < EVERY and not last)
        ):
            return
        self.drawn = now
        filled = int(WIDTH * done / count)
        left = f"{(count - done) / rate:.0f} s left" if rate else ""
        pace = f"{rate:,.0f}/s" if rate >= 1 or not rate else f"{1 / rate:.0f} s each"
        end = "\r" if sys.stderr.isatty() else "\n"
        with contextlib.suppress(OSError):  # a stderr that is full or closed stops nothing
            sys.stderr.write(
                f"{'#' * filled}{'.' * (WIDTH - filled)} {done:,} of {count:,}  {pace} "
                f" {left:12}{end}"
            )
            sys.stderr.flush()
        if not sys.stderr.isatty():
            self.drawn = now + 10 - EVERY  # a log gets a line every ten seconds
