"""Settings of an analysis: values of its options, from three places.

What is given, on the command line or as arguments of the Python function, has precedence over the
design's `[analysis]` table, and this over the defaults. Values from Python and from tables are
converted in one way, see `convert`.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.errors import InputError, format_value

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Analysis
    from suspension_cli.analyses.options import Option
    from suspension_cli.design.reader import Source

Settings = dict[str, Any]
"""Values of parameters by name; each parameter has its own type."""
NOT_IN_TABLES = ("overrides", "out", "stem", "as_json", "as_csv", "quiet", "verbose")
"""Options that `[analysis]` tables do not set."""


def default_values(parameters: Sequence[click.Parameter]) -> Settings:
    """Default values of options."""
    command = click.Command("", params=list(parameters))
    return command.make_context("", [], resilient_parsing=True).params


def from_arguments(command: str, parameters: Sequence[Option], arguments: Settings) -> Settings:
    """Convert arguments of a Python function; one at its default value counts as not given."""
    default, given = default_values(parameters), {}
    for param in parameters:
        name = str(param.name)
        if name in arguments and (arguments[name] is not None or default[name] is not None):
            value = convert(command, param, arguments[name])
            if value != default[name]:
                given[name] = value
    return given


def convert(command: str, param: Option, value: Any, *, in_file: bool = False) -> Any:
    """Convert a value of Python, or of a table `in_file`, to that of an option.

    Texts in files may be those of the command line. Raises `InputError` with the name of the option
    if the value is of the wrong kind or out of bounds.
    """
    name, kind, remedy = str(param.name), param.python_type, f"see pendsus {command} --help"
    is_text, texts = isinstance(value, str), None
    if in_file and kind != "bool" and _holds_texts(value):
        texts = (value,) if is_text else tuple(value)
    elif kind == "Grid":
        texts = (grid(value, name),)
    elif "Mapping" in kind and (param.multiple or not is_text):
        texts = _grids(value, name)
    elif kind in ("Names", "Paths") and (param.multiple or not is_text):
        texts = items(value, name)
    if texts is None:
        found = _single(param, value, remedy)
    else:
        found = texts if param.multiple else ",".join(texts) or None
    try:
        return param.type_cast_value(click.Context(click.Command(command)), found)
    except click.BadParameter as error:
        raise InputError.of(name, error.message.rstrip("."), remedy) from None


def _holds_texts(value: Any) -> bool:
    """Whether a value is a text, or a list of texts."""
    values = value if isinstance(value, list) else [value]
    return all(isinstance(one, str) for one in values)


def _single(param: Option, value: Any, remedy: str) -> Any:
    """Convert one flag, number (also of numpy, or as text) or text."""
    import numpy as np

    kind, choices = param.python_type, getattr(param.type, "choices", ())
    wanted = f"is not one of {', '.join(map(repr, choices))}" if choices else "must be a text"
    if kind == "bool":
        wanted = "must be True or False"
        if isinstance(value, (bool, int, np.bool_)):
            return bool(value)
    elif kind in ("int", "float"):
        wanted = "must be a whole number" if kind == "int" else "must be a number"
        try:
            if not np.ndim(value) and not isinstance(value, (bool, np.bool_)):
                number = float(value)
                if kind == "float":
                    return number
                if number == math.floor(number):
                    return int(value)
        except (TypeError, ValueError, OverflowError):
            pass
    elif isinstance(value, str):
        return value
    raise InputError.of(str(param.name), wanted, remedy, shown(value))


def grid(values: Any, name: str) -> str:
    """Write a grid as its text; every number keeps all its digits."""
    import numpy as np

    if isinstance(values, (str, bool)):
        return str(values)
    if isinstance(values, (Iterator, range)):
        values = list(values)
    wanted, remedy = "must be real numbers", 'give numbers, or a text such as "1:10:50"'
    try:
        if values is None or isinstance(values, (bytes, Mapping, set)) or np.iscomplexobj(values):
            raise TypeError
        numbers = [float(value) for value in np.ravel(values)]
    except (TypeError, ValueError):
        raise InputError.of(name, wanted, remedy, shown(values)) from None
    if not numbers:
        raise InputError.of(name, "is empty", remedy)
    return ",".join(map(repr, numbers))


def _grids(values: Any, name: str) -> tuple[str, ...]:
    """Write a dictionary of names and grids as ``NAME=GRID`` texts."""
    if not isinstance(values, Mapping):
        remedy = f'write for example {name}={{"stage.test.wires.d": [1e-3, 2e-3]}}'
        raise InputError.of(name, "must be a dictionary", remedy, shown(values))
    return tuple(f"{key}={grid(own, f'{name} {key}')}" for key, own in values.items())


def items(values: Any, name: str) -> tuple[str, ...]:
    """Convert one text or path, or several, to a tuple of texts; numbers of modes to texts."""
    if isinstance(values, (str, os.PathLike, int)):
        return (str(values),)
    try:
        if isinstance(values, bytes):
            raise TypeError
        return tuple(map(str, values))
    except TypeError:
        remedy = "leave it out for its default" if values is None else "give a text or a list"
        raise InputError.of(name, "must be texts", remedy, shown(values)) from None


def path(value: Any, name: str) -> str:
    """Return a path as text; raises `InputError` for anything else."""
    if not isinstance(value, (str, os.PathLike)):
        raise InputError.of(name, "must be a path", "give a text or a Path", shown(value))
    return os.fsdecode(value)


def shown(value: Any) -> str:
    """Write a value of any type in one short line."""
    if isinstance(value, (str, Path)):
        return format_value(str(value))
    return format_value(" ".join(repr(value).split())).strip('"')


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
    from suspension_cli.files.atomic import writing_to

    with writing_to(path):
        Path(path).mkdir(parents=True, exist_ok=True)
    return Path(path)
