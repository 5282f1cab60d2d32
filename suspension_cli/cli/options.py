"""Options that commands share, and what they do with them."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import click

F = TypeVar("F", bound=Callable[..., Any])

LEVELS = ("auto", "closed-form", "force", "string", "beam", "violin")
"""As `models.fidelity.LEVELS`, which is not imported just to print help."""

TOLERANCE = 1e-3
"""As `analysis.auto.TOLERANCE`: relative error that auto leaves, and difference between two rungs that is worth a warning."""


class Finite(click.FloatRange):
    """A number within bounds; not a number is none."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Refuse NaN, which no bound catches."""
        found = super().convert(value, param, ctx)
        if found != found:
            self.fail("nan is no number.", param, ctx)
        return found


designs = click.argument("designs", nargs=-1, required=True, metavar="DESIGN...")
design = click.argument("design", metavar="DESIGN")
overrides = click.option("--set", "overrides", multiple=True, metavar="PATH=VALUE", help="Override a value, e.g. stage.test.wires.d=0.002 (repeatable).")


def _demand_folder(_ctx: click.Context, _param: click.Parameter, value: str | None) -> str | None:
    """Refuse a file as the folder for results, before anything is computed."""
    from suspension_cli.errors import Fault, InputError

    if value is None:
        return value
    path = Path(value)
    try:
        isdir, exists = path.is_dir(), path.exists()
    except OSError as error:
        raise InputError([Fault("--out", f"cannot be written ({error.strerror})", "name another folder", value)]) from None
    named = path.suffix.lower() in ENDINGS and not value.endswith("/")
    if not isdir and (named or exists):
        remedy = "name a folder; the files in it get their names from the design" + (f" (a folder of this name: {value}/)" if not exists else "")
        raise InputError([Fault("--out", "names a file, but results go into a folder", remedy, value)])
    return value


ENDINGS = (".csv", ".h5", ".hdf5", ".jpeg", ".jpg", ".json", ".mat", ".md", ".npz", ".pdf", ".png", ".svg", ".toml", ".txt", ".zip")
"""What the name of a file ends with, that of a folder hardly ever."""
out = click.option("--out", default="results", show_default=True, metavar="DIR", callback=_demand_folder, help="Folder for the files written.")
beside = click.option("--out", metavar="DIR", callback=_demand_folder, help="Folder for the PNG; default: beside the file.")
fidelity = click.option("--fidelity", type=click.Choice(LEVELS), default="auto", show_default=True, help="Rung of the ladder of models.")
tolerance = click.option("--tolerance", type=Finite(1e-12, 1.0), default=TOLERANCE, show_default=True, help="Relative error that --fidelity auto may leave.")
as_json = click.option("--json", "as_json", is_flag=True, help="One JSON document on stdout; no plot unless --plot is given.")
as_json_only = click.option("--json", "as_json", is_flag=True, help="One JSON document on stdout.")
plot = click.option("--plot/--no-plot", "plot", default=None, help="Whether to draw the PNG.  [default: --plot, with --json --no-plot]")
allow_unstable = click.option("--allow-unstable", is_flag=True, help="Go on about an unstable equilibrium.")
quiet = click.option("-q", "--quiet", is_flag=True, help="Say nothing on stderr but warnings.")
verbose = click.option("-v", "--verbose", is_flag=True, help="Say more on stderr.")


results = click.option(
    "--result",
    multiple=True,
    metavar="NAME",
    help="A mode by its label or number, a response OUTPUT/INPUT:HZ, a coupling OVER/UNDER/INPUT:HZ (repeatable).  [default: modes, every mode]",
)


def question(function: F) -> F:
    """Give a command the options that say which cross-coupling is asked for."""
    choices = [
        click.option("--input", "drive", default="support.z", show_default=True, metavar="SIGNAL", help="What drives: a motion of the support, or a force."),
        click.option("--observe", metavar="STAGE@X,Y,Z", help="The point watched: its x over its z.  [default: last stage, 1 mm below its COM]"),
        click.option("--over", metavar="SIGNAL", help="Numerator of the ratio, instead of the point's x."),
        click.option("--under", metavar="SIGNAL", help="Denominator of the ratio, instead of the point's z."),
        click.option("--frequency", default="50", show_default=True, metavar="GRID", help="Hz."),
    ]
    for option in reversed(choices):
        function = option(function)
    return function


def batch(function: F) -> F:
    """Give a command the options of every sweep."""
    import os

    choices = [
        click.option("--workers", type=click.IntRange(1, 4096), default=os.cpu_count() or 1, show_default="all cores", help="Processes."),
        click.option("--scheduler", metavar="tcp://HOST:PORT", help="A Dask scheduler instead of processes (pendsus[cluster])."),
        click.option("--chunk", type=click.IntRange(1, 1_000_000), default=512, show_default=True, help="Builds computed at once."),
        click.option("--resume", is_flag=True, help="Take up an interrupted run."),
    ]
    for option in reversed(choices):
        function = option(function)
    return function


def analysis(function: F) -> F:
    """Give a command the options of every analysis."""
    for option in reversed([overrides, out, fidelity, as_json, plot, quiet, verbose]):
        function = option(function)
    return function


def tell(text: str) -> None:
    """Print one line on stderr, with escapes for what would break it; a stderr that is full or closed stops nothing."""
    from suspension_cli.errors import printable

    with contextlib.suppress(OSError):
        click.echo(printable(text), err=True)


def put(text: str) -> None:
    """Print lines for people on stdout, with escapes for what cannot be printed."""
    from suspension_cli.errors import printable

    click.echo("\n".join(map(printable, text.split("\n"))))


@dataclass(frozen=True)
class Voice:
    """What goes to stderr."""

    quiet: bool
    verbose: bool

    def say(self, text: str) -> None:
        """Something worth knowing."""
        if not self.quiet:
            tell(text)

    def detail(self, text: str) -> None:
        """Something for who asked for more."""
        if self.verbose:
            tell(text)

    def warn(self, text: str) -> None:
        """Something that must not be missed."""
        tell(f"warning: {text}")


def with_analysis_table(ctx: click.Context, table: dict[str, Any], file: str, extra: tuple[str, ...] = ()) -> dict[str, Any]:
    """The options of a command, with defaults from the design's `[analysis.COMMAND]` table.

    What is given on the command line wins.  Keys in `extra` are the command's own business.

    Raises
    ------
    InputError
        If the table has a key that is no option of the command, or a value that the option does not take.
    """
    from suspension_cli.design.faults import step, suggestion
    from suspension_cli.errors import Fault, InputError, shown

    params = {
        _long_name(p): p
        for p in ctx.command.params
        if isinstance(p, click.Option) and p.name not in ("overrides", "out", "as_json", "quiet", "verbose", "help")
    }
    result, faults = dict(ctx.params), []
    for key, value in table.items():
        if key in extra or (extra and "." in key):  # an imperfection or a dotted path: the grid that it is swept over
            faults += _grid_faults(step(f"analysis.{ctx.command.name}", key), value)
            continue
        where = step(f"analysis.{ctx.command.name}", key)
        param = params.get(key)
        if param is None or param.name is None:
            faults.append(Fault(where, "no option of this command", suggestion(key, [*params, *extra]), shown(value)))
            continue
        if ctx.get_parameter_source(param.name) is click.core.ParameterSource.COMMANDLINE:
            continue
        try:
            result[param.name] = param.type_cast_value(ctx, _as_typed(param, value))
        except click.BadParameter as error:
            faults.append(Fault(where, error.message.rstrip("."), f"see pendsus {ctx.command.name} --help", shown(value)))
    if faults:
        raise InputError(faults, file)
    return result


def _grid_faults(key: str, value: Any) -> list[Any]:
    """What is wrong with a grid in an `[analysis]` table."""
    from suspension_cli.errors import Fault, InputError, shown
    from suspension_cli.grids import grid

    try:
        grid(",".join(map(str, value)) if isinstance(value, list) else str(value), key)
    except InputError as error:
        return [Fault(key, fault.problem, fault.remedy, shown(value)) for fault in error.faults]
    return []


def check_tables(tables: dict[str, dict[str, Any]], file: str) -> None:
    """Check the `[analysis]` tables of all commands.

    Raises
    ------
    InputError
        With the faults of every table.
    """
    import importlib

    from suspension_cli.errors import InputError

    faults = []
    for name, table in tables.items():
        module = importlib.import_module(f"suspension_cli.cli.{name}")
        try:
            with_analysis_table(click.Context(module.command), table, file, getattr(module, "swept_names", tuple)())
        except InputError as error:
            faults += error.faults
    if faults:
        raise InputError(faults, file)


def _as_typed(option: click.Option, value: Any) -> Any:
    """A value of an `[analysis]` table as it would have come from the command line."""
    if option.is_flag:
        if not isinstance(value, bool):
            raise click.BadParameter("must be true or false")
        return value
    items = value if isinstance(value, list) else [value]
    if any(isinstance(item, (bool, dict, list)) for item in items):
        raise click.BadParameter("must be a string or a number")
    texts = [str(item) for item in items]
    return texts if option.multiple or option.nargs != 1 else ",".join(texts)


def _long_name(option: click.Option) -> str:
    return max(option.opts, key=len).lstrip("-").replace("-", "_") if option.name != "plot" else "plot"


def command_line(argv: list[str]) -> str:
    """The command as it was typed, for results to tell: quoted for a shell, with escapes for what is no text."""
    import shlex

    return shlex.join(["pendsus", *argv[1:]]).encode("utf-8", "backslashreplace").decode("utf-8")


def folder(path: str) -> Path:
    """The folder for results, made if it is missing.

    Raises
    ------
    InputError
        If it cannot be made.
    """
    from suspension_cli.results import writing_to

    with writing_to(path):
        Path(path).mkdir(parents=True, exist_ok=True)
    return Path(path)
