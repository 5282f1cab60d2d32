"""Errors of the input, with messages that say how to correct them.

Each fault is one line: file and key path, value, problem, remedy. Commands turn a `PendsusError`
into its exit code: 2 for `InputError`, 130 after Ctrl-C, 128 + its number after another signal,
else 1.
"""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TypeVar

Given = TypeVar("Given")
Found = TypeVar("Found")

LONGEST = 60
"""Longest text of a value in a message, characters."""


@dataclass(frozen=True)
class Fault:
    """One thing wrong with the input.

    Attributes
    ----------
    key : str
        Dotted path of the key (``stage.test.wires.l``), an option (``--out``) or ``""`` for the
        whole file.
    problem : str
        What is wrong, as a verb phrase: ``must be positive``.
    remedy : str
        What to do, as an imperative.
    value : str or None
        The value found, as written in the file; None where none was given.
    """

    key: str
    problem: str
    remedy: str
    value: str | None = None

    def line(self, file: str) -> str:
        """The fault as one printable line: ``file: key = value: problem; remedy``."""
        found = " = ".join(filter(None, (self.key, self.value)))
        message = f"{self.problem}; {self.remedy}"
        return escape_unprintable(": ".join(filter(None, (file, found, message))))


class PendsusError(Exception):
    """Anything that stops a run and is not a bug; ``exit_code`` is returned to the shell."""

    exit_code = 1


class PendsusWarning(UserWarning):
    """Warning about a result; `pendsus` prints it on stderr."""


class Signalled(KeyboardInterrupt):
    """A signal by which a batch system or a closed terminal ends the run."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


class Interrupted(PendsusError):
    """Ctrl-C or a signal that ended the run, with a message about what was completed."""

    exit_code = 130

    @classmethod
    def by(cls, cause: KeyboardInterrupt, kept: str = "") -> Interrupted:
        """Make the error of an interruption; `kept` says what was completed."""
        if not isinstance(cause, Signalled):
            return cls(f"interrupted{kept}")
        result = cls(f"ended by {signal.Signals(cause.number).name}{kept}")
        result.exit_code = 128 + cause.number
        return result


class InputError(PendsusError):
    """Faults of the input, all at once.

    Parameters
    ----------
    faults : sequence of Fault
    file : str
        Where they are; ``""`` for the command line.
    """

    exit_code = 2

    def __init__(self, faults: list[Fault] | tuple[Fault, ...], file: str = "") -> None:
        self.faults = tuple(faults)
        self.file = file
        super().__init__("\n".join(fault.line(file) for fault in self.faults))

    @classmethod
    def of(cls, key: str, problem: str, remedy: str, value: str | None = None) -> InputError:
        """Make an error of one fault."""
        return cls([Fault(key, problem, remedy, value)])

    def __reduce__(self) -> tuple[type[InputError], tuple[tuple[Fault, ...], str]]:
        """Pickle the error, for worker processes."""
        return InputError, (self.faults, self.file)

    def in_file(self, file: str) -> InputError:
        """Return the faults attributed to a file."""
        return InputError(self.faults, file)


@contextlib.contextmanager
def attribute_faults_to(file: str) -> Iterator[None]:
    """Attribute faults that are raised inside to a file, unless they already name another.

    Faults of the options that name the folder of results stay as they are.
    """
    try:
        yield
    except InputError as error:
        own = error.file or any(fault.key in ("--out", "--resume") for fault in error.faults)
        raise error if own else error.in_file(file) from None


def suggest(word: str, known: list[str]) -> str:
    """Suggest the known word that the user may have meant, or list all."""
    import difflib  # 3 ms, only when something is wrong already

    close = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    if close:
        return f"did you mean {close[0]!r}?"
    return "known here: " + ", ".join(known) if known else "remove it"


def join_errors(errors: list[InputError]) -> InputError:
    """Join the faults of several files into one error, equal ones once."""
    different = list({str(error): error for error in errors}.values())
    if len(different) == 1:
        return different[0]
    files = dict.fromkeys(error.file for error in different if error.file)
    faults = [fault for error in different for fault in error.faults]
    whole = InputError(faults, ", ".join(files))  # nobody attributes them to another file
    whole.args = ("\n".join(map(str, different)),)
    return whole


def collect(
    function: Callable[[Given], Found], items: Iterable[Given], errors: list[InputError]
) -> list[Found]:
    """Call a function for each of some items, and collect the errors of those that have faults."""
    found = []
    for item in items:
        try:
            found.append(function(item))
        except InputError as error:
            errors.append(error)
    return found


def gather(function: Callable[[Given], Found], items: Iterable[Given]) -> list[Found]:
    """Call a function for each of some items; raises `InputError` with the faults of all."""
    errors: list[InputError] = []
    found = collect(function, items, errors)
    if errors:
        raise join_errors(errors)
    return found


def format_value(value: object, depth: int = 0) -> str:
    """Write a value as in TOML, shortened to one readable line."""
    if isinstance(value, bool):
        text = "true" if value else "false"
    elif isinstance(value, str):
        text = f'"{escape_unprintable(value[:LONGEST].translate(_QUOTED))}"'
    elif isinstance(value, dict):
        text = f"{{{', '.join(format_key(key) for key in list(value)[:LONGEST])}}}"
    elif isinstance(value, (list, tuple)):
        shown = ["..."] if depth > 3 else [format_value(one, depth + 1) for one in value[:LONGEST]]
        text = f"[{', '.join(shown)}]"
    elif isinstance(value, int) and value.bit_length() > 4096:
        text = hex(value)  # Python writes no decimal numbers of more than 4300 digits
    else:
        text = text_of(value)
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def text_of(value: object, write: Callable[[object], str] = str) -> str:
    """Text of any object, by `str` or `repr`; its type if that fails."""
    try:
        return write(value)
    except Exception:  # objects of others fail in any way
        return f"<{type(value).__name__}>"


def format_key(key: str) -> str:
    """Write a key as in TOML: bare where that is allowed."""
    bare = key.isascii() and key.replace("-", "").replace("_", "").isalnum()
    return key if bare and len(key) <= LONGEST else format_value(key)


def one_line(error: Exception) -> str:
    """Text of an exception on one short line."""
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= 120 else f"{text[:117]}..."


def escape_unprintable(text: str) -> str:
    """Escape line breaks and unprintable characters of a text."""
    return text if text.isprintable() else "".join(map(_escape, text))


def _escape(letter: str) -> str:
    if letter.isprintable() or letter in _ESCAPES:
        return _ESCAPES.get(letter, letter)
    code = ord(letter)
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


_ESCAPES = {"\n": "\\n", "\t": "\\t", "\r": "\\r"}
_QUOTED = str.maketrans({'"': '\\"', "\\": "\\\\"})
