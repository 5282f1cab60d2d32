"""Values of arguments of the Python functions, converted to those that options of commands take.

A value of the wrong kind raises `InputError` with the name of its argument.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np

from suspension_cli.analyses import options
from suspension_cli.design.reader import Source
from suspension_cli.errors import InputError, format_value

Value = Any
"""An argument before it is checked."""
Settings = dict[str, Value]
"""Arguments or values of parameters by name."""
GRID = "GRID"
"""What help calls the value of an option that takes numbers as `grids.parse_grid` does."""
NUMBERS = 'give numbers, or a text such as "1:10:50"'
"""Remedy for what is no grid."""


def is_multiple(param: click.Parameter) -> bool:
    """Whether an option may be repeated."""
    return isinstance(param, click.Option) and param.multiple


def setting(parameters: Sequence[click.Parameter], arguments: Settings, function: str) -> Settings:
    """Convert arguments of a function to the values of its command's parameters.

    Raises
    ------
    InputError
        If an argument is of the wrong kind. Bounds are left to the parameters.
    """
    defaults = options.context(function, parameters, {}).params
    given = {}
    for param in parameters:
        name = str(param.name)
        if name in arguments:
            value = arguments[name]
            if isinstance(value, Mapping) and "=GRID," in str(param.metavar):
                value = ",".join(grids(value, name))
            optional = value is None and defaults[name] is None
            given[name] = None if optional else _convert(param, name, value, function)
    return given


def _convert(param: click.Parameter, name: str, value: Value, function: str) -> Value:
    kind, metavar = param.type, str(param.metavar)
    if metavar == GRID:
        return grid(value, name)
    if is_multiple(param) or metavar.endswith(",..."):
        if isinstance(value, str) and not is_multiple(param):
            return value
        several = grids(value, name) if "GRID" in metavar else items(value, name)
        return several if is_multiple(param) else ",".join(several) or None
    remedy = f"see help(sus.{function})"
    if isinstance(kind, click.types.BoolParamType):
        if isinstance(value, (bool, np.bool_, int)):
            return bool(value)
        if not isinstance(value, str):
            raise InputError.of(name, "must be True or False", remedy, shown(value))
    elif isinstance(kind, click.types.IntParamType):
        return _number(name, value, remedy, whole=True)
    elif isinstance(kind, click.types.FloatParamType):
        return _number(name, value, remedy)
    elif isinstance(kind, click.Choice):
        if value is None:  # which click takes for a missing value
            known = ", ".join(map(repr, kind.choices))
            raise InputError.of(name, f"is not one of {known}", remedy, shown(value))
    elif not isinstance(value, str):
        raise InputError.of(name, "must be a text", remedy, shown(value))
    return value


def _number(name: str, value: Value, remedy: str, *, whole: bool = False) -> float:
    """Convert one number, also of numpy or as text."""
    wanted = "must be a whole number" if whole else "must be a number"
    try:
        if np.ndim(value) or np.iscomplexobj(value):
            raise ValueError
        number = int(value) if whole and isinstance(value, (str, int)) else float(value)
        if whole and number != math.floor(number):
            raise ValueError
    except (TypeError, ValueError, OverflowError):
        raise InputError.of(name, wanted, remedy, shown(value)) from None
    return int(number) if whole else number


def grid(values: Value, name: str) -> str:
    """Write a grid as its text; every number keeps all its digits."""
    if isinstance(values, str):
        return values
    if isinstance(values, (Iterator, range)):
        values = list(values)
    wanted = "must be real numbers"
    if values is None or isinstance(values, (bytes, Mapping, set)) or np.iscomplexobj(values):
        raise InputError.of(name, wanted, NUMBERS, shown(values))
    try:
        numbers = [float(value) for value in np.ravel(values)]
    except (TypeError, ValueError):
        raise InputError.of(name, wanted, NUMBERS, shown(values)) from None
    if not numbers:
        raise InputError.of(name, "is empty", NUMBERS)
    return ",".join(map(repr, numbers))


def grids(values: Value, name: str) -> tuple[str, ...]:
    """Write a dictionary of names and grids as ``NAME=GRID`` texts."""
    if not isinstance(values, Mapping):
        remedy = f'write for example {name}={{"stage.test.wires.d": [1e-3, 2e-3]}}'
        raise InputError.of(name, "must be a dictionary", remedy, shown(values))
    return tuple(f"{key}={grid(own, f'{name} {key}')}" for key, own in values.items())


def items(values: Value, name: str) -> tuple[str, ...]:
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


def text(value: Value, name: str, remedy: str) -> str:
    """Return a text; raises `InputError` for anything else."""
    if not isinstance(value, str):
        raise InputError.of(name, "must be a text", remedy, shown(value))
    return value


def path(value: Value, name: str) -> str:
    """Return a path as text; raises `InputError` for anything else."""
    if not isinstance(value, (str, os.PathLike)):
        raise InputError.of(name, "must be a path", "give a text or a Path", shown(value))
    return os.fsdecode(value)


def design(value: Value, name: str = "design") -> Source:
    """Return a design; raises `InputError` for anything else."""
    if not isinstance(value, Source):
        remedy = "give one of sus.read, sus.parse, sus.template or sus.example"
        if isinstance(getattr(value, "source", None), Source):
            remedy = "give the attribute source of the result"
        raise InputError.of(name, "is no design", remedy, shown(value))
    return value


def shown(value: Value) -> str:
    """Write a value of any type in one short line."""
    if isinstance(value, (str, Path)):
        return format_value(str(value))
    return format_value(" ".join(repr(value).split())).strip('"')
