"""What the messages of a run are given to: the terminal, or Python's warnings."""

from __future__ import annotations

from typing import Protocol


class Log(Protocol):
    """Receiver of messages."""

    def say(self, text: str) -> None:
        """Report a step that was done."""
        ...

    def detail(self, text: str) -> None:
        """Report a detail."""
        ...

    def warn(self, text: str) -> None:
        """Report a warning."""
        ...
