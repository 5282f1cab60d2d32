"""Commands for files of designs and of results: `new`, `import`, `schema`, `plot`."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import known_analyses, options, settings
from suspension_cli.cli import terminal
from suspension_cli.cli.runner import Command
from suspension_cli.design import DETECTORS
from suspension_cli.errors import Fault, InputError, format_value

if TYPE_CHECKING:
    from suspension_cli.analyses.record import Record
    from suspension_cli.design.reader import Source

KINDS = ("single", "double", "triple", "quad", "blades", "two-wires", "torsion", "payload")
"""As `design.reader.TEMPLATES`, which is not imported just to print help."""
NAMED = click.option(
    "--name", metavar="NAME", help="Name of the design.  [default: the stem of FILE]"
)
FORCED = click.option("--force", is_flag=True, help="Replace FILE if it exists.")


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
@click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="PATH=VALUE",
    help="Change a value: stage.test.wires.d=0.002 (repeatable); comments and layout stay.",
)
@NAMED
@FORCED
def new(
    words: tuple[str, ...],
    example: str | None,
    listing: bool,
    overrides: tuple[str, ...],
    name: str | None,
    force: bool,
) -> None:
    """Start a design: write it to FILE, or to stdout without FILE.

    Example: pendsus new quad my.toml

    Example: pendsus new single my.toml --set stage.test.body.mass=0.3
    """
    from suspension_cli.design import reader

    if listing:
        from suspension_cli.analyses import tables

        rows = [(one, reader.example(one).title) for one in reader.examples()]
        terminal.put(tables.render({"example": "", "title": ""}, rows))
        return
    most = 2 if example is None else 1
    if (not words and example is None) or len(words) > most:
        problem = f"takes a kind of design ({', '.join(KINDS)}) or --from, then at most one file"
        raise InputError.of("new", problem, "write for example pendsus new triple my.toml")
    if example is not None and words and words[0] in KINDS:
        problem = "is a kind of design, beside --from"
        remedy = "give one of both, then a file"
        raise InputError.of("new", problem, remedy, format_value(words[0]))
    if example is None:
        kind = words[0]
        files = words[1:]
    else:
        kind = example.rpartition("/")[2]
        files = words
    file = files[0] if files else None
    name = _design_name(name, Path(file).stem if file else kind, kind)
    text = reader.template(kind, name) if example is None else reader.example_text(example, name)
    _put_design(file, reader.edit(text, overrides), force)


@click.command("import")
@click.argument("source", shell_complete=options.complete_file)
@click.argument("file", required=False, shell_complete=options.complete_file)
@NAMED
@click.option("--reference", metavar="TEXT", default="", help="Where SOURCE comes from.")
@click.option(
    "--tables",
    metavar="DIR",
    help="Of SUMCON: stiffness tables of heat links.  [default: HeatLink near SOURCE]",
)
@click.option(
    "--bending-points", is_flag=True, help="Of SUMCON: end wires at its hinges, not at clamps."
)
@FORCED
def convert(
    source: str,
    file: str | None,
    name: str | None,
    reference: str,
    tables: str | None,
    bending_points: bool,
    force: bool,
) -> None:
    """Convert a file of another program into a design: write FILE, or stdout without FILE.

    SOURCE is a save of SUMCON (KAGRA) or the ifo.yaml of a budget of gwinc (LIGO). What the design
    has otherwise, and what had to be chosen, is listed on stderr and in the file.

    Example: pendsus import sumcon_PR3.m pr3.toml

    Example: pendsus import ifo.yaml my.toml
    """
    from suspension_cli.importing.formats import read

    own = _design_name(name, Path(file or source).stem, "imported")
    folder = Path(tables) if tables else None
    found = read(Path(source), own, reference, tables=folder, bending_points=bending_points)
    if file is None and found.files:
        problem = "has stiffness tables, which stand in files of their own"
        raise InputError.of("", problem, "name a file to write", source)
    for note in found.notes:
        terminal.tell(f"{source}: {note}")
    for table, text in found.files.items():
        _write_new(Path(file or "").parent / table, text, force)
    _put_design(file, found.text, force, found.next_command)


@click.command("schema")
@click.option(
    "--measured",
    is_flag=True,
    help="Print the schema of files of measurements (docs/measurements.md).",
)
def schema(measured: bool) -> None:
    """Print the JSON Schema of the design file, for editors that complete and check TOML."""
    if measured:
        from suspension_cli.design.measured import json_schema
    else:
        from suspension_cli.design.schema import json_schema

    click.echo(json.dumps(json_schema(), indent=2))


def _design_name(given: str | None, stem: str, default: str) -> str:
    """Check the name that is given for a design, or make one from the stem of a file."""
    from suspension_cli.design import reader

    if given is None:
        return reader.make_name(stem, default)
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{,99}", given):
        remedy = "give letters, digits, . _ and -"
        raise InputError.of("--name", "is no name of a design", remedy, format_value(given))
    return given


def _put_design(
    file: str | None, text: str, force: bool, next_command: str = "modes {file}"
) -> None:
    """Write a design to a new file and say what to run next, or write it to stdout without one."""
    if file is None:
        click.echo(text, nl=False)
        return
    _write_new(Path(file), text, force)
    terminal.tell(f"wrote {file}; next: pendsus {next_command.format(file=file)}")


def _write_new(path: Path, text: str, force: bool) -> None:
    """Write a file that does not exist yet, unless `force`; raises `InputError`."""
    from suspension_cli.files.whole_files import write_bytes

    if path.exists() and not force:
        problem = "exists already"
        remedy = "name another file, or give --force"
        raise InputError([Fault("", problem, remedy)], str(path))
    write_bytes(path, text.encode(), key="")


LIMITS = [
    options.option(
        "--x",
        "x_limits",
        metavar="LOW:HIGH",
        help="Limits of the first horizontal axis, in its unit, and of all with the same label.",
    ),
    options.option(
        "--y",
        "y_limits",
        metavar="LOW:HIGH",
        help="Limits of the uppermost vertical axis, in its unit.",
    ),
]
TOGETHER = options.option(
    "--together",
    is_flag=True,
    help="Draw modes, responses or thermal noises of all files in one picture, as compare does.",
)
FILES = options.argument("files", nargs=-1, required=True, metavar="FILE.h5...")
FORM = (options.FORMAT, options.CSV, options.BESIDE, options.QUIET)


@click.command("plot", cls=Command, params=[FILES, TOGETHER, *LIMITS, *FORM])
def plot(
    files: tuple[str, ...],
    together: bool,
    x_limits: str | None,
    y_limits: str | None,
    picture_format: str,
    as_csv: bool,
    out: str | None,
    quiet: bool,
) -> None:
    """Redraw the pictures of each results FILE, from the file alone.

    Example: pendsus plot results/my-response.h5 --x 0.5:5 --format pdf
    """
    from suspension_cli.analyses import labelled
    from suspension_cli.drawing.panels import limited
    from suspension_cli.drawing.style import encode
    from suspension_cli.files.hdf5 import open_results, reporting_damage
    from suspension_cli.files.whole_files import write_bytes

    limits = _limits("--x", x_limits), _limits("--y", y_limits)
    folder = settings.folder(out) if out else None
    if together:
        results = [_compared(files)]
        home = folder or Path(files[0]).parent
        paths = [known_analyses.get("compare").path(results[0], home)]
    else:
        results = []
        paths = [(folder or Path(file).parent) / Path(file).name for file in files]
        for file in files:
            with open_results(file) as stored:
                results.append(known_analyses.loaded(stored, file))
    for result, path in zip(results, paths, strict=True):
        with reporting_damage(result.run.design.file, "run the analysis again"):
            with limited(*limits):
                figures = result.figures() or {"": result.plot()}  # refused if there is none
            for figure in figures.values():
                if any(limits) and not any(axes.axison for axes in figure.axes):
                    option = "--x" if limits[0] else "--y"
                    raise InputError.of(option, "this picture has no axes", "leave it out")
            pictures = {end: encode(figure, picture_format) for end, figure in figures.items()}
        # first, as it refuses damaged numbers that the picture leaves out
        written = labelled.write_csv(result, path) if as_csv else []
        for end, picture in pictures.items():
            written.append(path.with_name(f"{path.stem}{end}.{picture_format}"))
            write_bytes(written[-1], picture, key="--out" if out else "")
        for one in [] if quiet else written:
            terminal.tell(f"wrote {one}")


def _compared(files: tuple[str, ...]) -> Record:
    """Compare stored results."""
    from suspension_cli.analyses.analysis import Run
    from suspension_cli.analyses.logs import Log

    analysis = known_analyses.get("compare")

    def ask(source: Source, _overrides: tuple[str, ...] = ()) -> Run:
        return Run(source, settings.defaults(analysis, {}), Log(), Path(), "pendsus plot")

    return analysis.solve(analysis.read(ask, {"items": files}))


def _limits(option: str, text: str | None) -> tuple[float, float] | None:
    """Parse ``LOW:HIGH``."""
    if text is None:
        return None
    try:
        low, high = map(float, text.split(":"))
    except ValueError:
        low = 1.0
        high = 0.0
    if not -math.inf < low < high < math.inf:
        problem = "is not LOW:HIGH, two ascending numbers"
        remedy = "write for example 0.1:10"
        raise InputError.of(option, problem, remedy, format_value(text))
    return low, high
