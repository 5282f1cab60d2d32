"""Text on the terminal: results on stdout, messages and progress on stderr.

What stops a run becomes one line on stderr and an exit code; tracebacks are for bugs alone.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import click

from suspension_cli.analyses.logs import Log
from suspension_cli.errors import Interrupted, PendsusError, Signalled, escape_unprintable

PATIENCE = 1.0
"""Time before the bar appears, s."""
ENDING = ("SIGTERM", "SIGHUP")
"""Signals of batch systems and closed terminals that end a run; Windows lacks the second."""
EVERY = 0.2
"""Time between two updates, s."""


def tell(text: str) -> None:
    """Print one line on stderr, with escapes for what would break it."""
    click.echo(escape_unprintable(text), err=True)


def put(text: str) -> None:
    """Print lines for people on stdout, with escapes for what cannot be printed."""
    click.echo("\n".join(map(escape_unprintable, text.split("\n"))))


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
    """Progress bar, rate and time left on a terminal; call it with (done, all, rate).

    It appears after a second, empty if the first part of the work takes longer.
    """

    def __init__(self, *, enabled: bool) -> None:
        self.enabled = enabled and sys.stderr.isatty()
        self.due = time.monotonic() + PATIENCE
        self.bar: Any = None
        self.lock = threading.Lock()
        self.timer = threading.Timer(PATIENCE, self._appear)
        self.timer.daemon = True

    def __enter__(self) -> Bar:
        if self.enabled:
            self.timer.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.timer.cancel()
        with self.lock:
            self.enabled = False
            if self.bar:
                self.bar.stop()

    def _appear(self) -> None:
        """Draw an empty bar if there is none yet; called by the timer's thread."""
        with self.lock:
            if self.enabled and not self.bar:
                self._start()
                self._draw(0, 1, "computing")

    def __call__(self, done: int, count: int, rate: float) -> None:
        """Update the bar if enough time has passed."""
        now = time.monotonic()
        if not self.enabled or (now < self.due and not (self.bar and done == count)):
            return
        self.due = now + EVERY
        left = f"{(count - done) / rate:.0f} s left" if rate else ""
        pace = f"{rate:,.0f}/s" if rate >= 1 or not rate else f"{1 / rate:.0f} s each"
        with self.lock:
            if not self.bar:
                self._start()
            self._draw(done, count, f"{done:,} of {count:,}  {pace}  {left}")

    def _draw(self, done: int, count: int, text: str) -> None:
        task = self.bar.task_ids[0]
        self.bar.update(task, completed=done, total=count, description=text, refresh=True)

    def _start(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn

        columns = BarColumn(30), TextColumn("{task.description}", markup=False)
        console = Console(stderr=True)
        self.bar = Progress(*columns, console=console, auto_refresh=False, redirect_stdout=False)
        self.bar.add_task("")
        self.bar.start()


SMALLER = {
    "--chunk": "a smaller --chunk, fewer --workers",
    "--frequency": "fewer points in --frequency",
    "--vary": "shorter grids in --vary",
    "--sweep": "shorter grids in --sweep",
    "--builds": "fewer --builds",
    "--max-frequency": "a lower --max-frequency",
    "--starts": "fewer --starts",
}
"""Remedies where memory does not suffice, by the options that a command has."""
NO_MEMORY = (
    "failed to map segment",
    "cannot allocate memory",
    "can't start new thread",
    "unable to allocate",
)
"""Messages of the system and of libraries that get no memory."""


@contextlib.contextmanager
def in_one_line(command: Callable[[], click.Command | None] = lambda: None) -> Iterator[None]:
    """End a run that the input, the user or the system stops with one line on stderr.

    The `command` that runs has the options that could be made smaller. Raises
    `click.exceptions.Exit` with exit code 2 for a fault of the input, 130 after Ctrl-C, 128 + its
    number after another signal, 1 for anything else.
    """
    try:
        yield
    except click.ClickException as error:
        line = escape_unprintable(error.message)
        error.message = line  # pyright: ignore[reportAttributeAccessIssue]
        raise
    except PendsusError as error:
        _stop(str(error), error.exit_code)
    except KeyboardInterrupt as cause:
        error = Interrupted.by(cause)
        _stop(str(error), error.exit_code)
    except (MemoryError, ImportError, RuntimeError, OSError) as error:
        words = str(error).lower()
        if isinstance(error, MemoryError) or any(found in words for found in NO_MEMORY):
            _stop(_describe_memory_error(error, command()), 1)
        if not isinstance(error, OSError):
            raise
        _stop(_describe_system_error(error), 1)


@contextlib.contextmanager
def raising_signals() -> Iterator[None]:
    """Raise `Signalled` inside for SIGTERM and SIGHUP, as Python raises an error for Ctrl-C.

    Those that the caller ignores, as `nohup` does, stay ignored. After the first one further ones
    are: a shell and its terminal both send SIGHUP, and ending takes some time.
    """
    known = (getattr(signal, name, None) for name in ENDING)
    numbers = [one for one in known if one and signal.getsignal(one) is signal.SIG_DFL]
    if threading.current_thread() is not threading.main_thread():
        numbers = []  # which alone may handle signals

    def end(number: int, _frame: object) -> None:
        for one in numbers:
            signal.signal(one, signal.SIG_IGN)
        numbers.clear()
        raise Signalled(number)

    for one in numbers:
        signal.signal(one, end)
    try:
        yield
    finally:
        for one in numbers:
            signal.signal(one, signal.SIG_DFL)


def _stop(text: str, code: int) -> None:
    for line in text.split("\n"):
        tell(line)
    raise click.exceptions.Exit(code)


def _describe_memory_error(error: BaseException, command: click.Command | None) -> str:
    given = [name for param in getattr(command, "params", ()) for name in param.opts]
    smaller = [SMALLER[name] for name in SMALLER if name in given] or [
        "a design of fewer bodies and wires, or a file of fewer points"
    ]
    found = escape_unprintable(str(error).strip().rstrip("."))
    return f"out of memory{f' ({found})' if found else ''}; ask for less: {', '.join(smaller)}"


def _describe_system_error(error: OSError) -> str:
    """Describe an error of the system; errors in results files are described by their writers."""
    reason = error.strerror or str(error)
    if error.filename is not None:
        return escape_unprintable(f"{os.fsdecode(error.filename)}: {reason}")
    with contextlib.suppress(OSError, ValueError, AttributeError):
        handle = sys.stdout.fileno()  # Python would report unprinted output at exit
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, handle)
        os.close(nowhere)
    whole = "files that were written are whole"
    if error.errno == errno.EPIPE:
        return f"standard output was closed before everything was printed; {whole}"
    return f"standard output cannot be written ({reason}); {whole}"


class _Optional(io.FileIO):
    """A stream that discards what cannot be written, instead of failing at exit."""

    def write(self, data: bytes) -> int:  # pyright: ignore[reportIncompatibleMethodOverride]
        with contextlib.suppress(OSError):
            return super().write(data) or 0
        return len(data)


def guard_streams() -> None:
    """Replace closed standard streams, whose numbers a results file would take otherwise.

    Printing to a closed standard output then fails, as it should. Output to a closed or full stderr
    is lost without ending the run. Characters that the terminal cannot show are printed as escapes,
    and Python's warnings take one line.
    """
    warnings.formatwarning = lambda message, category, filename, lineno, _line=None: (
        f"warning: {category.__name__}: {' '.join(str(message).split())}"
        f" ({os.path.basename(filename)}:{lineno})\n"
    )
    for handle, mode in ((0, os.O_RDONLY), (1, os.O_RDONLY), (2, os.O_WRONLY)):
        try:
            os.fstat(handle)
        except OSError:
            os.open(os.devnull, mode)  # takes the lowest number that is free
    if sys.stdout is None:
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    if sys.stderr is sys.__stderr__:  # None where it was closed
        sys.stderr = io.TextIOWrapper(
            _Optional(2, "w", closefd=False),
            encoding=getattr(sys.stderr, "encoding", "utf-8"),
            errors="backslashreplace",
            write_through=True,
        )
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
