"""Settings of an analysis: values of its options, from three places.

What is given, on the command line or as arguments of the Python function, has precedence over the
design's `[analysis]` table, and this over the defaults.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from suspension_cli.analyses import known_analyses
from suspension_cli.analyses.analysis import Analysis
from suspension_cli.analyses.options import Option, Settings, convert, default_values, grid
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value, suggest

if TYPE_CHECKING:
    from suspension_cli.design.reader import Source

NOT_IN_TABLES = ("overrides", "ties", "out", "stem", "as_json", "as_csv", "quiet", "verbose")
"""Options that `[analysis]` tables do not set."""
NAMES_OF_RESULTS = ("SIGNAL", "QUANTITY", "STAGE", "STAGE.N", "STAGE@X,Y,Z")
"""What help calls the values of options that name parts of the moving suspension."""


def defaults(analysis: Analysis, given: Settings) -> Settings:
    """Settings of an analysis that another one runs: its defaults and those `given`."""
    return {**default_values(analysis.parameters), **given}


def merge(analysis: Analysis, source: Source, given: Settings) -> Settings:
    """Settings of an analysis of a design: those `given`, else those of its table, else defaults.

    Raises `InputError` with the faults of all `[analysis]` tables, and for names of locked stages.
    """
    from suspension_cli.design.locked_stages import refuse_locked

    result = defaults(analysis, from_tables(source).get(analysis.name, {}) | given)
    named = {}
    for option in analysis.parameters:
        value = result.get(str(option.name))
        if option.metavar in NAMES_OF_RESULTS and value:
            named[max(option.opts, key=len)] = [value] if isinstance(value, str) else value
    with attribute_faults_to(source.file):
        refuse_locked(source.design, named)
    return result


def from_tables(source: Source) -> dict[str, Settings]:
    """Convert the `[analysis]` tables of all commands.

    Keys that are no options may be parameters to sweep, with their grids: imperfections and dotted
    paths. Raises `InputError` if a table has another key, or a value that its option does not take.
    """
    from suspension_cli.design.faults import step
    from suspension_cli.grids import parse_grid

    result: dict[str, Settings] = {}
    faults = []
    for name, table in source.design.analysis.items():
        analysis, found = known_analyses.get(name), result.setdefault(name, {})
        swept = analysis.swept_names()
        known = {_key(p): p for p in analysis.parameters if p.name not in NOT_IN_TABLES}
        for key, value in table.items():
            try:
                if key in swept or (swept and "." in key):
                    parse_grid(grid(value, key), key)
                elif key in known:
                    found[str(known[key].name)] = convert(name, known[key], value, in_file=True)
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


def _key(option: Option) -> str:
    """Key of an option in tables: its long name."""
    longest = max(option.opts, key=len).lstrip("-").replace("-", "_")
    return "plot" if option.name == "plot" else longest


def folder(path: str) -> Path:
    """Make the folder for results if it is missing; raises `InputError` if that fails."""
    from suspension_cli.files.whole_files import writing_to

    with writing_to(path):
        Path(path).mkdir(parents=True, exist_ok=True)
    return Path(path)
