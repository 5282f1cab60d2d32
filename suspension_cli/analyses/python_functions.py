"""Functions of the Python API from the options of commands: signatures, docstrings, messages.

Every option, except those about files and messages, is an argument of the same name; its type,
default and description follow from the option. Messages name arguments instead of options.
"""

from __future__ import annotations

import contextlib
import inspect
import re
import textwrap
from collections.abc import Callable, Collection, Iterator, Sequence
from inspect import Parameter
from typing import Any

from suspension_cli.analyses.options import FILES, Input, Option, default_values
from suspension_cli.errors import Fault, InputError, PendsusError, suggest

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
FOLDER = Input(
    "folder",
    "PathLike",
    "Folder of the results file; default: a temporary one, kept as long as the result.",
    optional=True,
)
"""Argument of functions that fill a results file."""


def describe(function: Callable[..., Any], analysis: Any) -> None:
    """Give the function of an `analysis.Analysis` its name, signature and docstring."""
    default = default_values(analysis.parameters)
    listed = [_of_input(one, Parameter.POSITIONAL_OR_KEYWORD) for one in analysis.inputs]
    for param in analysis.parameters:
        if param.group != FILES:
            value = default[str(param.name)] if param.in_python is None else param.in_python
            listed.append(_of_option(param, value, analysis.parameters))
    if analysis.fills_file:
        listed.append(_of_input(FOLDER, Parameter.KEYWORD_ONLY))
    returned = analysis.returned_type()
    signature = inspect.Signature([one for one, _ in listed], return_annotation=returned)
    annotations = {name: one.annotation for name, one in signature.parameters.items()}
    text = inspect.cleandoc(str(type(analysis).__doc__))
    head = text.split("\n\n", 1)[0]
    sections = text[text.index("\nReturns\n-") :]
    described = "\n".join(description for _, description in listed)
    function.__doc__ = f"{head}\n\nParameters\n----------\n{described}\n{sections}\n"
    function.__name__ = function.__qualname__ = analysis.name
    function.__annotations__ = annotations | {"return": returned}
    vars(function)["__signature__"] = signature


def _of_input(given: Input, how: Any) -> tuple[Parameter, str]:
    """Argument and its description for what an analysis reads."""
    kind = "Design | PathLike" if given.kind == "Design" else given.kind
    default = None if given.optional else Parameter.empty
    how = Parameter.VAR_POSITIONAL if given.name.startswith("*") else how
    return _argument(given.name, how, kind, default, WORDS.get(kind, kind), given.about)


def _of_option(param: Option, default: Any, all_of_command: Sequence[Option]) -> Any:
    """Argument and its description for an option."""
    about = " ".join(str(param.help).split())
    default = Parameter.empty if "[required]" in about else default
    for mark in (" (repeatable)", " [required]"):
        about = about.replace(mark, "")
    about = translate(re.sub(r" *\[default: (.*)\]", r" Default: \1.", about), all_of_command)
    kind = param.python_type
    choices = getattr(param.type, "choices", ())
    quoted = ", ".join(f'"{one}"' for one in choices)
    words = f"{{{quoted}}}" if choices else WORDS.get(kind, kind)
    return _argument(str(param.name), Parameter.KEYWORD_ONLY, kind, default, words, about)


def _argument(
    name: str, how: Any, annotation: str, default: Any, words: str, about: str
) -> tuple[Parameter, str]:
    optional = default is None
    annotation += " | None" if optional else ""
    about = textwrap.fill(about, 95, initial_indent=4 * " ", subsequent_indent=4 * " ")
    return (
        Parameter(name.lstrip("*"), how, default=default, annotation=annotation),
        f"{name} : {words}{', optional' if optional else ''}\n{about}",
    )


def demand_known_arguments(analysis: Any, known: Collection[str], given: Collection[str]) -> None:
    """Raise `InputError` for an argument that the function of an analysis does not have.

    It suggests the argument of the option of that name, ``inputs`` for ``input``, if there is one.
    """
    of_option = {
        option.lstrip("-").replace("-", "_"): str(param.name)
        for param in analysis.parameters
        for option in (*param.opts, *param.secondary_opts)
    }
    for name in given:
        if name in known:
            continue
        remedy = suggest(of_option.get(name, name), list(known))
        if name in of_option and of_option[name] not in known:
            remedy = "it is an option of the command alone; docs/api.md says what replaces it"
        raise InputError.of(name, f"is no argument of {analysis.name}()", remedy)


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
    (r"pendsus (check|damp|modes|response)\b", r"sus.\1"),
)
"""Commands and options with their values, as patterns, and the calls and arguments instead."""


def translate(text: str, parameters: Sequence[Option] = (), **names: str) -> str:
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
        known |= dict.fromkeys(param.opts, f"{name}=True" if param.is_flag else name)
        known |= dict.fromkeys(param.secondary_opts, f"{name}=False")
    known |= {f"--{option}": name for option, name in ({"out": "folder"} | names).items()}

    def argument(match: re.Match[str]) -> str:
        option = match[1].removeprefix("--")
        name = known.get(match[1], option.replace("-", "_"))
        return f"{name}={match[2]}" if match[2] else name

    return re.sub(r"(?<![\w/-])(--[a-z][a-z-]*[a-z])(?: (\d\S*\d))?", argument, text)


@contextlib.contextmanager
def python_names(parameters: Sequence[Option] = (), **names: str) -> Iterator[None]:
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
