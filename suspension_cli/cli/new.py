"""`pendsus new`: a commented, valid design to start from."""

from __future__ import annotations

import click

from suspension_cli.cli import options

KINDS = ("single", "double", "triple", "blades")


@click.command("new")
@click.argument("kind", type=click.Choice(KINDS))
@click.argument("file", required=False)
@click.option("--name", metavar="NAME", help="The design's name; default: the stem of FILE, or KIND.")
@click.option("--force", is_flag=True, help="Replace FILE if it exists.")
def command(kind: str, file: str | None, name: str | None, force: bool) -> None:
    """Start a design of one KIND: write it to FILE, or to stdout without FILE."""
    import re
    from pathlib import Path

    from suspension_cli.design.reader import parse, template
    from suspension_cli.errors import Fault, InputError, shown
    from suspension_cli.results import write_bytes

    if name is None:
        name = re.sub(r"[^A-Za-z0-9._-]+", "-", Path(file).stem).strip("-._")[:100] if file else kind
    elif not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{,99}", name):
        raise InputError([Fault("--name", "is no name of a design", "give letters, digits, . _ and -", shown(name))])
    text = template(kind, name or kind)
    parse(text)
    if file is None:
        click.echo(text, nl=False)
        return
    if Path(file).exists() and not force:
        raise InputError([Fault("", "exists already", "name another file, or give --force")], file)
    write_bytes(Path(file), text.encode(), key="")
    options.tell(f"wrote {file}; next: pendsus modes {file}")
