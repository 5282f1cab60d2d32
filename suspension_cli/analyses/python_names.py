"""Messages of the commands in terms of the Python API: arguments instead of options."""

from __future__ import annotations

import contextlib
import dataclasses
import re
from collections.abc import Iterator, Sequence

import click

from suspension_cli.errors import InputError, PendsusError

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
def python_names(
    function: str = "", parameters: Sequence[click.Parameter] = (), **names: str
) -> Iterator[None]:
    """Report errors inside in terms of the Python API, for the `function` that was called.

    Other arguments as of `translate`.
    """
    try:
        yield
    except click.BadParameter as error:
        key = str(error.param.name) if error.param is not None else ""
        remedy = f"see help(sus.{function})"
        problem = error.message.rstrip(".")
        raise InputError.of(key, problem, remedy) from None
    except PendsusError as error:

        def reworded(text: str) -> str:
            return translate(text, parameters, **names)

        if isinstance(error, InputError):
            error.faults = tuple(
                dataclasses.replace(
                    fault,
                    key=reworded(fault.key),
                    problem=reworded(fault.problem),
                    remedy=reworded(fault.remedy),
                )
                for fault in error.faults
            )
        error.args = (reworded(str(error)),)
        raise
