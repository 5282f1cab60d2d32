"""Settings of a command: values of its options, from three places.

What is given, on the command line or as arguments of the Python function, has precedence over the
design's `[analysis]` table, and this over the defaults.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses.arguments import Settings, convert, default_values, grid
from suspension_cli.errors import InputError, format_value

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Analysis
    from suspension_cli.design.reader import Source

NOT_IN_TABLES = ("overrides", "out", "stem", "as_json", "as_csv", "quiet", "verbose")
"""Options that `[analysis]` tables do not set."""


def defaults(analysis: Analysis, given: Settings) -> Settings:
    """Settings of an analysis that another one runs: its defaults and those `given`."""
    return default_values(analysis.parameters) | given


def merge(analysis: Analysis, source: Source, given: Settings) -> Settings:
    """Settings of an analysis of a design: those `given`, else those of its table, else defaults.

    Raises `InputError` with the faults of all `[analysis]` tables.
    """
    return defaults(analysis, from_tables(source).get(analysis.name, {}) | given)


def from_tables(source: Source) -> dict[str, Settings]:
    """Convert the `[analysis]` tables of all commands.

    Keys that are no options may be parameters to sweep, with their grids: imperfections and dotted
    paths. Raises `InputError` if a table has another key, or a value that its option does not take.
    """
    from suspension_cli.analyses import registry
    from suspension_cli.design.faults import step
    from suspension_cli.errors import Fault, suggest
    from suspension_cli.grids import parse_grid

    result: dict[str, Settings] = {}
    faults = []
    for name, table in source.design.analysis.items():
        analysis, found = registry.get(name), result.setdefault(name, {})
        swept = analysis.swept_names()
        known = {_key(p): p for p in analysis.parameters if p.name not in NOT_IN_TABLES}
        for key, value in table.items():
            try:
                if key in swept or (swept and "." in key):
                    parse_grid(grid(value, key), key)
                elif key in known:
                    param = known[key]
                    found[str(param.name)] = convert(name, param, value, in_file=True)
                else:
                    problem = "no option of this command"
                    raise InputError.of(key, problem, suggest(key, [*known, *swept]))
            except InputError as error:
                where, own = step(f"analysis.{name}", key), format_value(value)
                for fault in error.faults:
                    problem = fault.problem.replace("True or False", "true or false")
                    faults.append(Fault(where, problem, fault.remedy, own))
    if faults:
        raise InputError(faults, source.file)
    return result


def _key(option: click.Parameter) -> str:
    """Key of an option in tables: its long name."""
    longest = max(option.opts, key=len).lstrip("-").replace("-", "_")
    return "plot" if option.name == "plot" else longest


def named(source: Source, stem: str | None, overrides: tuple[str, ...]) -> Source:
    """Return a source whose files are named after `--name`, or the design and its overrides."""
    return dataclasses.replace(source, given_stem=stem, overrides=overrides)


def folder(path: str) -> Path:
    """Make the folder for results if it is missing.

    Raises `InputError` if it cannot be made.
    """
    from suspension_cli.files.atomic import writing_to

    with writing_to(path):
        Path(path).mkdir(parents=True, exist_ok=True)
    return Path(path)


def command_line(argv: list[str]) -> str:
    """Quote a command line for a shell, with escapes for bytes that are not text."""
    import shlex

    return shlex.join(["pendsus", *argv[1:]]).encode("utf-8", "backslashreplace").decode("utf-8")
