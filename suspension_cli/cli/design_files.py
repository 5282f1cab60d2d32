"""Commands for files of designs: `new`, `import`, `schema`."""

from __future__ import annotations

from pathlib import Path

import click

from suspension_cli.cli import terminal
from suspension_cli.design.detectors import DETECTORS

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
def new(
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


@click.command("import")
@click.argument("save", metavar="SAVE.m")
@click.argument("file", required=False)
@click.option("--name", metavar="NAME", help="Name of the design.  [default: the stem of FILE]")
@click.option("--reference", metavar="TEXT", default="", help="Where the save comes from.")
@click.option(
    "--tables",
    metavar="DIR",
    help="Stiffness tables of heat links.  [default: HeatLink near SAVE.m]",
)
@click.option(
    "--bending-points",
    is_flag=True,
    help="End wires at SUMCON's hinges, not at clamps.",
)
@click.option("--force", is_flag=True, help="Replace FILE if it exists.")
def convert(
    save: str,
    file: str | None,
    name: str | None,
    reference: str,
    tables: str | None,
    bending_points: bool,
    force: bool,
) -> None:
    """Convert a save of SUMCON (KAGRA) into a design: write FILE, or stdout without FILE.

    What the design has otherwise than the save is listed on stderr and in the file.

    Example: pendsus import sumcon_PR3.m pr3.toml
    """
    from suspension_cli.errors import InputError
    from suspension_cli.importing.convert import read

    own = design_name(name, Path(file or save).stem, "imported")
    folder = Path(tables) if tables else None
    found = read(Path(save), own, reference, tables=folder, bending_points=bending_points)
    if file is None and found.files:
        problem = "has stiffness tables, which stand in files of their own"
        raise InputError.of("", problem, "name a file to write", save)
    for note in found.notes:
        terminal.tell(f"{save}: {note}")
    if file is None:
        click.echo(found.text, nl=False)
        return
    for table, text in found.files.items():
        write_new(Path(file).parent / table, text, force=force)
    write_new(Path(file), found.text, force=force)
    terminal.tell(f"wrote {file}; next: pendsus modes {file} --fidelity string")


@click.command("schema")
@click.option(
    "--measured",
    is_flag=True,
    help="Print the schema of files of measurements (docs/measurements.md).",
)
def schema(measured: bool) -> None:
    """Print the JSON Schema of the design file, for editors that complete and check TOML."""
    import json

    if measured:
        from suspension_cli.design.measured import json_schema
    else:
        from suspension_cli.design.schema import json_schema

    click.echo(json.dumps(json_schema(), indent=2))


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
