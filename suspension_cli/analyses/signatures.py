"""Signatures and docstrings of the Python functions, from the options of the commands.

Every option, except those about files and messages, is an argument of the same name; its type,
default and description follow from the option.
"""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Sequence

import click

from suspension_cli.analyses import options
from suspension_cli.analyses.arguments import GRID, is_multiple
from suspension_cli.analyses.python_names import translate

PATHS = ("FILE", "[COORDINATES=]FILE", "[SIGNAL=]FILE")
"""What help calls the value of an option that takes names of files."""


FOLDER = """folder : path, optional
    Folder of the results file; default: a temporary one, kept as long as the result."""


def of_function(parameters: Sequence[click.Parameter]) -> list[options.Option]:
    """List the options that are arguments of the Python function too."""
    return [
        param
        for param in parameters
        if isinstance(param, options.Option) and param.group != options.FILES
    ]


def signature(
    inputs: Sequence[options.Input], parameters: Sequence[click.Parameter], *, folder: bool = False
) -> inspect.Signature:
    """Signature of the function of an analysis.

    Parameters
    ----------
    inputs
        Its positional arguments.
    parameters
        The options of its command.
    folder
        Whether it has the argument `folder`, of the results file that it fills.
    """
    kinds = inspect.Parameter
    result = [
        kinds(
            each.name.lstrip("*"),
            kinds.VAR_POSITIONAL if each.name.startswith("*") else kinds.POSITIONAL_OR_KEYWORD,
            default=None if each.optional else kinds.empty,
            annotation=("Design | PathLike" if each.kind == "Design" else each.kind)
            + (" | None" if each.optional else ""),
        )
        for each in inputs
    ]
    defaults = options.context("", parameters, {}).params
    for param in of_function(parameters):
        default = defaults[str(param.name)] if param.in_python is None else param.in_python
        kind = _kind(param) + (" | None" if default is None else "")
        default = kinds.empty if "[required]" in str(param.help) else default
        name = str(param.name)
        result.append(kinds(name, kinds.KEYWORD_ONLY, default=default, annotation=kind))
    if folder:
        own = kinds("folder", kinds.KEYWORD_ONLY, default=None, annotation="PathLike | None")
        result.append(own)
    return inspect.Signature(result, return_annotation="Result")


def _kind(param: click.Parameter) -> str:
    """Name the type of an argument, as `suspension_cli.api` defines it."""
    metavar, multiple = str(param.metavar), is_multiple(param)
    if metavar == GRID:
        return "Grid"
    if "=GRID" in metavar:
        return "Mapping[str, Grid]" if multiple else "str | Mapping[str, Grid]"
    if multiple or metavar.endswith(",..."):
        return "Paths" if metavar in PATHS else "Names"
    kinds = {
        click.types.BoolParamType: "bool",
        click.types.IntParamType: "int",
        click.types.FloatParamType: "float",
    }
    return next((name for kind, name in kinds.items() if isinstance(param.type, kind)), "str")


WORDS = {
    "Grid": "grid",
    "Names": "str or sequence of str",
    "Paths": "path or sequence of paths",
    "PathLike": "path",
    "Mapping[str, Grid]": "mapping",
    "str | Mapping[str, Grid]": "str or mapping",
}
"""Types of arguments as docstrings call them."""


def documentation(
    docstring: str,
    inputs: Sequence[options.Input],
    parameters: Sequence[click.Parameter],
    *,
    folder: bool = False,
) -> str:
    """Docstring of the function of an analysis, from that of its class and the help of options."""
    text = inspect.cleandoc(docstring)
    described = []
    for each in inputs:
        optional = ", optional" if each.optional else ""
        kind = WORDS.get(each.kind, each.kind)
        described.append(f"{each.name} : {kind}{optional}\n    {each.about}")
    kinds = signature(inputs, parameters).parameters
    for param in of_function(parameters):
        described.append(_describe(param, str(kinds[str(param.name)].annotation), parameters))
    described += [FOLDER] if folder else []
    head = text.split("\n\n", 1)[0]
    sections = text[text.index("\nReturns\n-") :]
    return f"{head}\n\nParameters\n----------\n" + "\n".join(described) + f"\n{sections}\n"


def _describe(param: options.Option, kind: str, parameters: Sequence[click.Parameter]) -> str:
    optional = ", optional" if kind.endswith(" | None") else ""
    kind = WORDS.get(kind.removesuffix(" | None"), kind.removesuffix(" | None"))
    choices = ", ".join(f'"{choice}"' for choice in getattr(param.type, "choices", ()))
    about = " ".join(str(param.help).split())
    for mark in (" (repeatable)", " [required]"):
        about = about.replace(mark, "")
    about = re.sub(r" *\[default: (.*)\]", r" Default: \1.", about)
    about = translate(about, parameters)
    wrapped = textwrap.fill(about, 95, initial_indent=4 * " ", subsequent_indent=4 * " ")
    return f"{param.name} : {f'{{{choices}}}' if choices else kind}{optional}\n{wrapped}"
