"""Functions of the Python API from the options of commands: signatures, docstrings, messages.

Every option, except those about files and messages, is an argument of the same name; its type,
default and description follow from the option. Messages name arguments instead of options.
"""

from __future__ import annotations

import contextlib
import inspect
import os
import re
import textwrap
from collections.abc import Callable, Iterator, Sequence
from typing import Any, ClassVar, NamedTuple, Protocol

import click

from suspension_cli.analyses import options
from suspension_cli.analyses.settings import (
    GRID,
    Value,
    default_values,
    is_multiple,
    shown,
)
from suspension_cli.design.reader import Source
from suspension_cli.errors import Fault, InputError, PendsusError


class Declared(Protocol):
    """What an analysis declares of its function, see `analysis.Analysis`."""

    name: ClassVar[str]
    inputs: ClassVar[tuple[options.Input, ...]]
    returns: ClassVar[str]
    parameters: ClassVar[tuple[click.Parameter, ...]]
    fills_file: ClassVar[bool]


PATHS = ("FILE", "[COORDINATES=]FILE", "[SIGNAL=]FILE")
"""What help calls the value of an option that takes names of files."""
WORDS = {
    "Design | PathLike": "Design",
    "Grid": "grid",
    "Names": "str or sequence of str",
    "Paths": "path or sequence of paths",
    "PathLike": "path",
    "Mapping[str, Grid]": "mapping",
    "str | Mapping[str, Grid]": "str or mapping",
}
"""Types of arguments as docstrings call them."""
FOLDER = options.Input(
    "folder",
    "PathLike",
    "Folder of the results file; default: a temporary one, kept as long as the result.",
    optional=True,
)
"""Argument of functions that fill a results file."""


class Argument(NamedTuple):
    """An argument of a function: annotation, default, and type and meaning in the docstring."""

    name: str
    annotation: str
    default: Value
    words: str
    about: str
    keyword: bool = True

    @property
    def parameter(self) -> inspect.Parameter:
        """The argument as part of a signature."""
        kind = inspect.Parameter.KEYWORD_ONLY
        if not self.keyword:
            starred = self.name.startswith("*")
            kind = inspect.Parameter.VAR_POSITIONAL if starred else kind.POSITIONAL_OR_KEYWORD
        name, annotation = self.name.lstrip("*"), self.annotation
        annotation += " | None" if self.default is None else ""
        return inspect.Parameter(name, kind, default=self.default, annotation=annotation)

    @property
    def description(self) -> str:
        """The argument as part of a docstring."""
        optional = ", optional" if self.default is None else ""
        return f"{self.name} : {self.words}{optional}\n{self.about}"


def arguments(analysis: Declared) -> list[Argument]:
    """List the arguments of the function of an analysis."""
    default = default_values(analysis.parameters)
    found = [_of_input(one, keyword=False) for one in analysis.inputs]
    for param in analysis.parameters:
        if isinstance(param, options.Option) and param.group != options.FILES:
            value = default[str(param.name)] if param.in_python is None else param.in_python
            value = inspect.Parameter.empty if "[required]" in str(param.help) else value
            kind, choices = _kind(param), getattr(param.type, "choices", ())
            quoted = ", ".join(f'"{one}"' for one in choices)
            words = f"{{{quoted}}}" if choices else WORDS.get(kind, kind)
            about = _about(param, analysis.parameters)
            found.append(Argument(str(param.name), kind, value, words, about))
    return found + ([_of_input(FOLDER, keyword=True)] if analysis.fills_file else [])


def _of_input(given: options.Input, *, keyword: bool) -> Argument:
    kind = "Design | PathLike" if given.kind == "Design" else given.kind
    default = None if given.optional else inspect.Parameter.empty
    return Argument(given.name, kind, default, WORDS.get(kind, kind), _filled(given.about), keyword)


def _kind(param: click.Parameter) -> str:
    """Name the type of an argument, as `suspension_cli.api` defines it."""
    metavar, multiple = str(param.metavar), is_multiple(param)
    if metavar == GRID:
        return "Grid"
    if "=GRID" in metavar:
        return "Mapping[str, Grid]" if multiple else "str | Mapping[str, Grid]"
    if multiple or metavar.endswith(",..."):
        return "Paths" if metavar in PATHS else "Names"
    types = click.types
    kinds = {types.BoolParamType: "bool", types.IntParamType: "int", types.FloatParamType: "float"}
    return next((name for kind, name in kinds.items() if isinstance(param.type, kind)), "str")


def _about(param: click.Parameter, parameters: Sequence[click.Parameter]) -> str:
    """Describe an argument in the words of the option's help."""
    about = " ".join(str(getattr(param, "help", "")).split())
    for mark in (" (repeatable)", " [required]"):
        about = about.replace(mark, "")
    about = re.sub(r" *\[default: (.*)\]", r" Default: \1.", about)
    return _filled(translate(about, parameters))


def _filled(text: str) -> str:
    return textwrap.fill(text, 95, initial_indent=4 * " ", subsequent_indent=4 * " ")


def describe(function: Callable[..., Any], analysis: Declared) -> None:
    """Give the function of an analysis its name, signature and docstring."""
    listed = arguments(analysis)
    parameters = [one.parameter for one in listed]
    signature = inspect.Signature(parameters, return_annotation=analysis.returns)
    annotations = {name: one.annotation for name, one in signature.parameters.items()}
    text = inspect.cleandoc(str(type(analysis).__doc__))
    head, sections = text.split("\n\n", 1)[0], text[text.index("\nReturns\n-") :]
    described = "\n".join(one.description for one in listed)
    function.__doc__ = f"{head}\n\nParameters\n----------\n{described}\n{sections}\n"
    function.__name__ = function.__qualname__ = analysis.name
    function.__annotations__ = annotations | {"return": analysis.returns}
    vars(function)["__signature__"] = signature


CALLS = (
    (r"--fidelity ([a-z]+(-[a-z]+)?)", r'fidelity="\1"'),
    (r"--set ([\w.]+)=([^\s,;)]+)", r'replace({"\1": \2})'),
    (r"--vary ([\w.]+)=([^\s,;)]+)", r'vary={"\1": "\2"}'),
    (r"`?pendsus new`?", "sus.template"),
    (r"pendsus fit DESIGN MEASURED", "sus.fit(measured, design)"),
    (r"pendsus fit MEASURED", "sus.fit(measured)"),
    (r"pendsus compare DESIGN FILE", "sus.compare(design, file)"),
    (r"pendsus response DESIGN --measured FILE", "sus.response(design, measured=file)"),
    (r"pendsus ([a-z]+) --help", r"help(sus.\1)"),
    (r"pendsus (?!schema)([a-z]+) (--|fidelity=)(\S+)", r"sus.\1(\2\3)"),
    (r"pendsus (check|damp|info|modes|response)\b", r"sus.\1"),
)
"""Commands and options with their values, as patterns, and the calls and arguments instead."""


def translate(text: str, parameters: Sequence[click.Parameter] = (), **names: str) -> str:
    """Replace commands and options in a message by functions and arguments.

    `parameters` are those of the command whose function was called; `names` are arguments of the
    function that are named differently from the options.

    >>> translate("rerun with --no-plot, or lower --max-frequency")
    'rerun with no_plot, or lower max_frequency'
    """
    for pattern, call in CALLS:
        text = re.sub(pattern, call, text)
    known = {}
    for param in parameters:
        name = str(param.name)
        flag = isinstance(param, click.Option) and param.is_flag
        known |= dict.fromkeys(param.opts, f"{name}=True" if flag else name)
        known |= dict.fromkeys(param.secondary_opts, f"{name}=False")
    known |= {f"--{option}": name for option, name in ({"out": "folder"} | names).items()}

    def argument(match: re.Match[str]) -> str:
        option = match[1].removeprefix("--")
        name = known.get(match[1], option.replace("-", "_"))
        return f"{name}={match[2]}" if match[2] else name

    return re.sub(r"(?<![\w/-])(--[a-z][a-z-]*[a-z])(?: (\d\S*\d))?", argument, text)


@contextlib.contextmanager
def python_names(parameters: Sequence[click.Parameter] = (), **names: str) -> Iterator[None]:
    """Report errors inside in terms of the Python API; arguments as of `translate`."""

    def reworded(text: str) -> str:
        return translate(text, parameters, **names)

    try:
        yield
    except PendsusError as error:
        if isinstance(error, InputError):
            error.faults = tuple(
                Fault(reworded(one.key), reworded(one.problem), reworded(one.remedy), one.value)
                for one in error.faults
            )
        error.args = (reworded(str(error)),)
        raise


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


def design(value: Value) -> Source:
    """Return a design; raises `InputError` for anything else."""
    if not isinstance(value, Source):
        remedy = "give one of sus.read, sus.parse, sus.template or sus.example"
        if isinstance(getattr(value, "source", None), Source):
            remedy = "give the attribute source of the result"
        raise InputError.of("design", "is no design", remedy, shown(value))
    return value
