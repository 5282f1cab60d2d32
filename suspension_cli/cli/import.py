"""`pendsus import`: a design from a save of SUMCON."""

from __future__ import annotations

from pathlib import Path

import click

from suspension_cli.cli import terminal


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
def command(
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
    from suspension_cli.cli.new import design_name, write_new
    from suspension_cli.errors import InputError
    from suspension_cli.importing import convert

    own = design_name(name, Path(file or save).stem, "imported")
    folder = Path(tables) if tables else None
    found = convert.read(Path(save), own, reference, tables=folder, bending_points=bending_points)
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
