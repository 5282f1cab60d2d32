"""Text on the terminal: results on stdout, messages and progress on stderr."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Sequence

import click

from suspension_cli.analyses.analysis import Log, Progress, Result
from suspension_cli.cli.progress import Bar


def tell(text: str) -> None:
    """Print one line on stderr, with escapes for what would break it."""
    from suspension_cli.errors import escape_unprintable

    click.echo(escape_unprintable(text), err=True)


def put(text: str) -> None:
    """Print lines for people on stdout, with escapes for what cannot be printed."""
    from suspension_cli.errors import escape_unprintable

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

    @contextlib.contextmanager
    def progress(self) -> Iterator[Progress]:
        """Draw a progress bar where a computation takes more than a second."""
        with Bar(enabled=not self.quiet) as bar:
            yield bar
