"""Settings of a command: its options, and defaults from the design's `[analysis]` tables."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import options

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Analysis, Settings
    from suspension_cli.design.reader import Source
    from suspension_cli.errors import Fault


NOT_IN_TABLES = ("overrides", "out", "stem", "as_json", "as_csv", "quiet", "verbose", "help")
"""Options that `[analysis]` tables do not set."""


def prepared(
    ctx: click.Context,
    file: str | Source,
    overrides: tuple[str, ...],
    extra: tuple[str, ...] = (),
) -> tuple[Source, Settings]:
    """Read a design, unless it is given, and settings with defaults from its `[analysis]` table."""
    from suspension_cli.design.reader import read

    source = read(file, overrides) if isinstance(file, str) else file
    source = named(source, ctx.params.get("stem"), ctx.params.get("overrides", ()))
    check_tables(source.design.analysis, source.file)
    table = source.design.analysis.get(str(ctx.command.name), {})
    return source, with_analysis_table(ctx, table, source.file, extra)


def named(source: Source, stem: str | None, overrides: tuple[str, ...]) -> Source:
    """Return a source whose files are named after `--name`, or the design and its overrides."""
    return dataclasses.replace(source, given_stem=stem, overrides=overrides)


def defaults(analysis: Analysis, given: Settings) -> Settings:
    """Settings of an analysis that another one runs: its defaults and those `given`."""
    command = click.Command(analysis.name, params=list(analysis.parameters))
    return command.make_context(analysis.name, []).params | given


def of_design(
    name: str,
    parameters: Sequence[click.Parameter],
    extra: tuple[str, ...],
    source: Source,
    given: Settings,
) -> Settings:
    """Settings: those `given`, else those of the design's table `name`, else defaults.

    A given value that is the default of its option counts as not given. `extra` as of
    `with_analysis_table`.
    """
    context = options.context(name, parameters, given)
    context.params["as_json"] = True  # nothing is printed
    table = source.design.analysis.get(name, {})
    return with_analysis_table(context, table, source.file, extra)


def with_analysis_table(
    ctx: click.Context, table: Settings, file: str, extra: tuple[str, ...] = ()
) -> Settings:
    """Settings of a command, with defaults from the design's `[analysis.COMMAND]` table.

    The command line has precedence. Keys in `extra` are parameters to sweep, with their grids.

    Raises `InputError` if the table has a key that is no option of the command, or a value that the
    option does not take.
    """
    from suspension_cli.design.faults import step, suggest
    from suspension_cli.errors import Fault, InputError, format_value

    params = {
        _long_name(p): p
        for p in ctx.command.params
        if isinstance(p, click.Option) and p.name not in NOT_IN_TABLES
    }
    result, faults = dict(ctx.params), []
    for key, value in table.items():
        # an imperfection or a dotted path: the grid that it is swept over
        if key in extra or (extra and "." in key):
            faults += _grid_faults(step(f"analysis.{ctx.command.name}", key), value)
            continue
        where = step(f"analysis.{ctx.command.name}", key)
        param = params.get(key)
        if param is None or param.name is None:
            faults.append(
                Fault(
                    where,
                    "no option of this command",
                    suggest(key, [*params, *extra]),
                    format_value(value),
                )
            )
            continue
        if ctx.get_parameter_source(param.name) is click.core.ParameterSource.COMMANDLINE:
            continue
        try:
            result[param.name] = param.type_cast_value(ctx, _as_typed(param, value))
        except click.BadParameter as error:
            faults.append(
                Fault(
                    where,
                    error.message.rstrip("."),
                    f"see pendsus {ctx.command.name} --help",
                    format_value(value),
                )
            )
    if faults:
        raise InputError(faults, file)
    return result


def _grid_faults(key: str, value: object) -> list[Fault]:
    """Find faults of a grid in an `[analysis]` table."""
    from suspension_cli.errors import Fault, InputError, format_value
    from suspension_cli.grids import parse_grid

    try:
        parse_grid(",".join(map(str, value)) if isinstance(value, list) else str(value), key)
    except InputError as error:
        return [
            Fault(key, fault.problem, fault.remedy, format_value(value)) for fault in error.faults
        ]
    return []


def check_tables(tables: dict[str, Settings], file: str) -> None:
    """Check the `[analysis]` tables of all commands.

    Raises `InputError` with the faults of every table.
    """
    from suspension_cli.analyses import registry
    from suspension_cli.errors import InputError

    faults = []
    for name, table in tables.items():
        if name == "info":
            parameters, extra = options.INFO, ()
        else:
            analysis = registry.get(name)
            parameters, extra = analysis.parameters, analysis.swept_names()
        bare = click.Command(name, params=list(parameters))
        try:
            with_analysis_table(click.Context(bare), table, file, extra)
        except InputError as error:
            faults += error.faults
    if faults:
        raise InputError(faults, file)


def _as_typed(option: click.Option, value: object) -> bool | str | list[str]:
    """Convert a value of an `[analysis]` table to the form of the command line."""
    if option.is_flag:
        if not isinstance(value, bool):
            raise click.BadParameter("must be true or false")
        return value
    if isinstance(value, dict) and "=GRID" in str(option.metavar):
        parts = ((k, v if isinstance(v, list) else [v]) for k, v in value.items())
        value = ",".join(f"{key}={','.join(map(str, own))}" for key, own in parts)
    items = value if isinstance(value, list) else [value]
    if any(isinstance(item, (bool, dict, list)) for item in items):
        raise click.BadParameter("must be a string or a number")
    texts = [str(item) for item in items]
    return texts if option.multiple or option.nargs != 1 else ",".join(texts)


def _long_name(option: click.Option) -> str:
    return (
        max(option.opts, key=len).lstrip("-").replace("-", "_") if option.name != "plot" else "plot"
    )


def command_line(argv: list[str]) -> str:
    """Quote a command line for a shell, with escapes for bytes that are not text."""
    import shlex

    return shlex.join(["pendsus", *argv[1:]]).encode("utf-8", "backslashreplace").decode("utf-8")


def folder(path: str) -> Path:
    """Make the folder for results if it is missing.

    Raises `InputError` if it cannot be made.
    """
    from suspension_cli.files.atomic import writing_to

    with writing_to(path):
        Path(path).mkdir(parents=True, exist_ok=True)
    return Path(path)
