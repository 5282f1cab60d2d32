"""`pendsus new`: a commented, valid design to start from."""

from __future__ import annotations

from pathlib import Path

import click

from suspension_cli.cli import terminal
from suspension_cli.design import DETECTORS

KINDS = ("single", "double", "triple", "quad", "blades")
"""As `design.reader.TEMPLATES`, which is not imported just to print help."""


@click.command(
    "new",
    epilog="\n".join(
        ["\b", "Suspensions of detectors for --from:"]
        + [f"  {name:14}{text}" for name, (_, text) in DETECTORS.items()]
    ),
)
@click.argument("words", nargs=-1, metavar=f"[{'|'.join(KINDS)}] [FILE]")
@click.option(
    "--from",
    "example",
    metavar="EXAMPLE",
    help="Start from a design that comes with the program instead, for example ligo-quad.",
)
@click.option("--examples", "listing", is_flag=True, help="List these designs.")
@click.option("--name", metavar="NAME", help="Name of the design.  [default: the stem of FILE]")
@click.option("--force", is_flag=True, help="Replace FILE if it exists.")
def command(
    words: tuple[str, ...], example: str | None, listing: bool, name: str | None, force: bool
) -> None:
    """Start a design: write it to FILE, or to stdout without FILE.

    Example: pendsus new quad my.toml
    """
    from suspension_cli.design import reader
    from suspension_cli.errors import InputError, format_value

    if listing:
        terminal.put("\n".join(reader.examples()))
        return
    most = 2 if example is None else 1
    if (not words and example is None) or len(words) > most:
        problem = f"takes a kind of design ({', '.join(KINDS)}) or --from, then at most one file"
        raise InputError.of("new", problem, "write for example pendsus new triple my.toml")
    if example is not None and words and words[0] in KINDS:
        problem, remedy = "is a kind of design, beside --from", "give one of both, then a file"
        raise InputError.of("new", problem, remedy, format_value(words[0]))
    kind, file = (words[0], words[1:]) if example is None else (example.rpartition("/")[2], words)
    name = design_name(name, Path(file[0]).stem if file else kind, kind)
    text = reader.template(kind, name) if example is None else reader.example_text(example, name)
    reader.parse(text)
    if not file:
        click.echo(text, nl=False)
        return
    write_new(Path(file[0]), text, force=force)
    terminal.tell(f"wrote {file[0]}; next: pendsus modes {file[0]}")


def design_name(given: str | None, stem: str, default: str) -> str:
    """Check the name that is given for a design, or make one from the stem of a file."""
    import re

    from suspension_cli.design import reader
    from suspension_cli.errors import InputError, format_value

    if given is None:
        return reader.make_name(stem, default)
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{,99}", given):
        remedy = "give letters, digits, . _ and -"
        raise InputError.of("--name", "is no name of a design", remedy, format_value(given))
    return given


def write_new(path: Path, text: str, *, force: bool) -> None:
    """Write a file that does not exist yet, unless `force`; raises `InputError`."""
    from suspension_cli.errors import Fault, InputError
    from suspension_cli.files.atomic import write_bytes

    if path.exists() and not force:
        problem, remedy = "exists already", "name another file, or give --force"
        raise InputError([Fault("", problem, remedy)], str(path))
    write_bytes(path, text.encode(), key="")
