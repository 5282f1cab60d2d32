"""What can go wrong, told so that the user can mend it.

Every fault of the input is one line: where (file and key path), what was found, why it will not do
and what to write instead.  Commands turn `InputError` into exit code 2, any other `PendsusError`
into its own (1, or 130 after Ctrl-C).
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Fault:
    """One thing wrong with the input.

    Attributes
    ----------
    key : str
        Dotted path of the key (``stage.test.wires.l``), an option (``--out``) or ``""`` for the whole file.
    problem : str
        What is wrong, in the user's words.
    remedy : str
        What to do about it.
    value : str or None
        The value found, as it would be written in the file; None where nothing was given.
    """

    key: str
    problem: str
    remedy: str
    value: str | None = None

    def line(self, file: str) -> str:
        """The fault as one line of text, whatever characters the file holds."""
        where = f"{file}: " if file else ""
        key = self.key if self.value is None else f"{self.key} = {self.value}" if self.key else self.value
        return printable(f"{where}{key + ': ' if key else ''}{self.problem}; {self.remedy}")


class PendsusError(Exception):
    """Anything that stops a run and is not a bug.  ``exit_code`` is what the shell sees."""

    exit_code = 1


class Interrupted(PendsusError):
    """Ctrl-C, where there is something to say of what was done until then."""

    exit_code = 130


class InputError(PendsusError):
    """The input is at fault: all its faults at once.

    Parameters
    ----------
    faults : sequence of Fault
    file : str
        The file (or ``""``: the command line) in which they were found.
    """

    exit_code = 2

    def __init__(self, faults: list[Fault] | tuple[Fault, ...], file: str = "") -> None:
        self.faults = tuple(faults)
        self.file = file
        super().__init__("\n".join(fault.line(file) for fault in self.faults))

    def __reduce__(self) -> tuple[type[InputError], tuple[tuple[Fault, ...], str]]:
        """As it crosses from a worker process: an exception is rebuilt from its message otherwise."""
        return InputError, (self.faults, self.file)

    def in_file(self, file: str) -> InputError:
        """The same faults, told of ``file``."""
        return InputError(self.faults, file)


@contextlib.contextmanager
def faults_of(file: str) -> Iterator[None]:
    """Tell faults that are found in the meantime of a file, unless they are of another."""
    try:
        yield
    except InputError as error:
        raise error if error.file else error.in_file(file) from None


SHOWN = 60
"""Longest text of a value in a message."""


def joined(errors: list[InputError]) -> InputError:
    """The faults of several files as one error."""
    whole = InputError([fault for error in errors for fault in error.faults])
    whole.args = ("\n".join(str(error) for error in errors),)
    return whole


def shown(value: object, depth: int = 0) -> str:
    """A value as TOML would write it, shortened to one readable line."""
    if isinstance(value, bool):
        text = "true" if value else "false"
    elif isinstance(value, str):
        text = f'"{printable(value[:SHOWN].translate(_QUOTED))}"'
    elif isinstance(value, dict):
        text = "{" + ", ".join(key_shown(key) for key in list(value)[:SHOWN]) + "}"
    elif isinstance(value, (list, tuple)):
        text = "[...]" if depth > 3 else "[" + ", ".join(shown(item, depth + 1) for item in value[:SHOWN]) + "]"
    elif isinstance(value, int) and value.bit_length() > 4096:
        text = hex(value)  # Python writes no decimal numbers of more than 4300 digits
    else:
        text = str(value)
    return text if len(text) <= SHOWN else text[: SHOWN - 3] + "..."


def key_shown(key: str) -> str:
    """A key as TOML would write it: bare where that is allowed."""
    bare = key.isascii() and key.replace("-", "").replace("_", "").isalnum()
    return key if bare and len(key) <= SHOWN else shown(key)


def printable(text: str) -> str:
    """A text with escapes for what would break its line or cannot be printed."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else _ESCAPES.get(c) or (f"\\u{ord(c):04x}" if ord(c) < 0x10000 else f"\\U{ord(c):08x}") for c in text)


_ESCAPES = {"\n": "\\n", "\t": "\\t", "\r": "\\r"}
_QUOTED = str.maketrans({'"': '\\"', "\\": "\\\\"})
