"""What can go wrong, told so that the user can mend it.

Every fault of the input is one line: where (file and key path), what was found, why it will not do
and what to write instead.  Commands turn `InputError` into exit code 2, any other `PendsusError`
into exit code 1.
"""

from __future__ import annotations

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
        """The fault as one line of text."""
        where = f"{file}: " if file else ""
        key = self.key if self.value is None else f"{self.key} = {self.value}" if self.key else self.value
        return f"{where}{key + ': ' if key else ''}{self.problem}; {self.remedy}"


class PendsusError(Exception):
    """Anything that stops a run and is not a bug.  ``exit_code`` is what the shell sees."""

    exit_code = 1


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

    def in_file(self, file: str) -> InputError:
        """The same faults, told of ``file``."""
        return InputError(self.faults, file)


def shown(value: object) -> str:
    """A value as TOML would write it, shortened to one readable line."""
    if isinstance(value, bool):
        text = "true" if value else "false"
    elif isinstance(value, str):
        text = '"' + value.encode("unicode_escape").decode("ascii") + '"'
    elif isinstance(value, dict):
        text = "{" + ", ".join(str(key) for key in value) + "}"
    elif isinstance(value, (list, tuple)):
        text = "[" + ", ".join(shown(item) for item in value) + "]"
    else:
        text = str(value)
    return text if len(text) <= 60 else text[:57] + "..."
