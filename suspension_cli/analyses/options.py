"""Options: their declaration, those that several commands share, and values given in Python.

Arguments of Python functions and values in tables of designs are converted by `convert`.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import re
from collections.abc import Mapping
from functools import cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import click
from click.shell_completion import CompletionItem

from suspension_cli.conventions import BUILDS_AT_ONCE
from suspension_cli.errors import InputError, format_value, text_of
from suspension_cli.grids import MAX_POINTS, Grid, write_grid
from suspension_cli.models.registry import AUTO, LEVELS

Settings = dict[str, Any]
"""Values of parameters by name; each parameter has its own type."""

TOLERANCE = 1e-3
"""Copy of `models.choice.TOLERANCE`."""
MOST_WIRE_MODES = 1000
"""Modes of wires with mass above which a run is refused unless --all of `modes` is given."""
FILES, MODEL, BATCH = "Files and messages", "Model", "Computation"
"""Groups of options, as help lists them."""
LONGEST_NAME = 255
"""Bytes of the name of a file or folder that systems take."""
MOST_TEXTS = 100_000
"""Most texts that an argument takes."""
PATHS = ("FILE", "[COORDINATES=]FILE", "[SIGNAL=]FILE")
"""What help calls the value of an option that takes names of files."""


class Option(click.Option):
    """An option with the group under which help lists it, and its default, if it has one.

    Options about files and messages belong to the command alone; all others are arguments of the
    Python function of the analysis too, with the default `in_python` if that differs.
    """

    def __init__(self, names: list[str], *, group: str, in_python: Any = None, **how: Any) -> None:
        how.setdefault("show_default", how.get("default") not in (None, False))
        super().__init__(names, **how)
        self.group, self.in_python = group, in_python

    @property
    def python_type(self) -> str:
        """Type of the argument in Python, as `suspension_cli.api` defines it."""
        metavar = str(self.metavar)
        if metavar == "GRID":
            return "Grid"
        if "=GRID" in metavar:
            return "Mapping[str, Grid]" if self.multiple else "str | Mapping[str, Grid]"
        if self.multiple or metavar.endswith(",..."):
            return "Paths" if metavar in PATHS else "Names"
        kinds = {click.types.IntParamType: "int", click.types.FloatParamType: "float"}
        kinds[click.types.BoolParamType] = "bool"
        return next((name for kind, name in kinds.items() if isinstance(self.type, kind)), "str")

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """List what a shell offers for the value."""
        if self.metavar == "DIR" or self.metavar in PATHS:
            return [CompletionItem(incomplete, type="dir" if self.metavar == "DIR" else "file")]
        found = super().shell_complete(ctx, incomplete)
        if found:
            return found
        from suspension_cli.analyses.completion import complete

        design = _design_before(ctx)
        words = complete(str(self.metavar), str(self.name), design, incomplete)
        return [CompletionItem(word) for word in words]

    def type_cast_value(self, ctx: click.Context, value: Any) -> Any:
        """Convert a value to the type of the option; numbers must be finite."""
        found = super().type_cast_value(ctx, value)
        if isinstance(found, float) and not math.isfinite(found):
            raise click.BadParameter(f"{found} is not a finite number.", ctx, self)
        return found


class Input(NamedTuple):
    """A design, result or file that an analysis reads, as an argument of its function.

    Its name has a star if there may be any number; `kind` is its type in Python.
    """

    name: str = "design"
    kind: str = "Design"
    about: str = "The design, or the path of its file."
    optional: bool = False


def option(*names: str, group: str = "Options", **how: Any) -> Option:
    """Declare an option of an analysis, as `click.option` does."""
    return Option(list(names), group=group, **how)


def signals(name: str, about: str, default: str = "") -> Option:
    """An option that takes any number of signals."""
    about += " (repeatable)." + (f"  [default: {default}]" if default else "")
    return option(f"--{name}", f"{name}s", multiple=True, metavar="SIGNAL", help=about)


def frequencies(
    default: str,
    about: str = "Frequencies, Hz: start:stop:count[:log|lin], a comma list or a number.",
) -> Option:
    """An option for a grid of frequencies."""
    return option("--frequency", default=default, metavar="GRID", help=about)


def argument(name: str, *, example: str = "", **how: Any) -> click.Argument:
    """Declare an argument of an analysis, the name of a file, as `click.argument` does.

    `example` is what to write, for the message where it is missing.
    """
    how.setdefault("shell_complete", complete_file)
    return click.Argument([name], type=_WithExample(example), **how)


class _WithExample(click.types.StringParamType):
    """Text, with an example for the message where it is missing."""

    def __init__(self, example: str) -> None:
        self.example = example

    def get_missing_message(self, *_: object, **__: object) -> str | None:
        """Return the example."""
        return self.example or None


def complete_file(_ctx: click.Context, _param: object, incomplete: str) -> list[CompletionItem]:
    """Let the shell list files."""
    return [CompletionItem(incomplete, type="file")]


def _design_before(ctx: click.Context) -> str:
    """First design of a command line that is not complete yet; "" if there is none."""
    given = ctx.params.get("design") or ctx.params.get("designs") or ctx.args
    words = [given] if isinstance(given, str) else given
    return next((word for word in words if word.endswith(".toml")), "")


def _demand_folder(_ctx: click.Context, _param: click.Parameter, value: str | None) -> str | None:
    """Refuse a file as the folder for results, before anything is computed."""
    if value is None or os.path.isdir(value):
        return value
    exists = os.path.exists(value)
    if exists or os.path.splitext(value)[1].lower() in ENDINGS:
        remedy = "name a folder; the files in it get their names from the design"
        remedy += "" if exists else f" (a folder of this name: {value}/)"
        raise InputError.of("--out", "names a file, but results go into a folder", remedy, value)
    return value


def _demand_stem(_ctx: click.Context, _param: click.Parameter, value: str | None) -> str | None:
    """Refuse what is no start of a file's name."""
    if value is not None and not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._=+-]{,149}", value):
        remedy = "give letters, digits, . _ = + and - (at most 150), for example my-violin"
        raise InputError.of("--name", "is no name of files", remedy, format_value(value))
    return value


RESULTS_ENDINGS = (".h5", ".hdf5", ".csv")
"""Endings of paths to which results are saved."""
ENDINGS = (*RESULTS_ENDINGS, ".gif", ".jpg", ".jpeg", ".json", ".m", ".mat", ".md", ".npz")
ENDINGS += (".pdf", ".png", ".py", ".svg", ".toml", ".txt", ".xlsx", ".xml", ".yaml", ".zip")
"""Endings of file names, which folders rarely have."""

MOTIONS = "Output: test.x, test.pitch, test.x@0,0,0.001, ..."
"""Help of an option that takes motions."""
BEAM = (
    option(
        "--arm",
        type=click.FloatRange(0, 1e7),
        default=0.0,
        metavar="LENGTH",
        help="Observe x along the beam of an arm of this length (m), for example 4000.",
    ),
    option(
        "--mirrors",
        type=click.FloatRange(1e-3, 1e6),
        default=1.0,
        metavar="COUNT",
        help=(
            "Add the powers of this many equal, independent suspensions: 4 for the difference of"
            " two arms. A mirror whose motion counts twice counts as 4."
        ),
    ),
)
"""Options that define the degree of freedom of an interferometer whose noise is computed."""
DESIGN = argument("design", metavar="DESIGN")
DESIGNS = argument("designs", nargs=-1, required=True, metavar="DESIGN...")

_of_files = partial(option, group=FILES)
_of_model = partial(option, group=MODEL)
_of_batch = partial(option, group=BATCH)

OVERRIDES = _of_files(
    "--set",
    "overrides",
    multiple=True,
    metavar="PATH=VALUE",
    help="Change a value of the design: stage.test.wires.d=0.002 (repeatable).",
)
TIES = _of_files(
    "--tie",
    "ties",
    multiple=True,
    metavar="PATH=EXPRESSION",
    help=(
        "Let a parameter follow from others: 'stage.test.wires.t2 = stage.test.wires.t1 + 5e-3'"
        " (repeatable; [[tie]] of the design does the same)."
    ),
)
OUT = _of_files(
    "--out",
    default="results",
    metavar="DIR",
    callback=_demand_folder,
    help="Folder for the written files.",
)
NAME = _of_files(
    "--name",
    "stem",
    metavar="STEM",
    callback=_demand_stem,
    help="Start of the names of written files.  [default: the design's name, and values of --set]",
)
BESIDE = _of_files(
    "--out",
    metavar="DIR",
    callback=_demand_folder,
    help="Folder for the PNG.  [default: that of the file]",
)
_JSON = "Print one JSON document on stdout"
AS_JSON_ONLY = _of_files("--json", "as_json", is_flag=True, help=f"{_JSON}.")
AS_JSON = _of_files(
    "--json",
    "as_json",
    is_flag=True,
    help=f"{_JSON}; draw no picture unless --plot is given.",
)
PLOT = _of_files(
    "--plot/--no-plot",
    "plot",
    default=None,
    help="Draw pictures or not.  [default: --plot; with --json: --no-plot]",
)
NO_PICTURE = _of_files(
    "--plot/--no-plot",
    "plot",
    default=False,
    hidden=True,
    help="Accepted without effect, as scripts give it to every analysis.",
)
FORMAT = _of_files(
    "--format",
    "picture_format",
    type=click.Choice(["png", "pdf", "svg"]),
    default="png",
    help="Format of pictures.",
)
CSV = _of_files(
    "--csv",
    "as_csv",
    is_flag=True,
    help="Also write the numbers as CSV: a row per frequency, mode or point.",
)
QUIET = _of_files("-q", "--quiet", is_flag=True, help="Print only warnings on stderr.")
VERBOSE = _of_files("-v", "--verbose", is_flag=True, help="Print details on stderr.")
FIDELITY = _of_model(
    "--fidelity",
    type=click.Choice(LEVELS),
    default=AUTO,
    help="Model of bodies and wires; auto takes the cheapest that is accurate enough.",
)
ACCURACY = _of_model(
    "--tolerance",
    type=click.FloatRange(1e-12, 1.0),
    default=TOLERANCE,
    help="Largest relative error of the result that --fidelity auto accepts.",
)
ALLOW_UNSTABLE = _of_model(
    "--allow-unstable",
    is_flag=True,
    help="Continue with motion that grows (an unstable equilibrium, active elements).",
)
QUANTITIES = option(
    "--result",
    "results",
    multiple=True,
    metavar="QUANTITY",
    help=(
        "A quantity: a mode by its label or number, 'Q of test pitch', 'thermal test.x:10', a"
        " response OUTPUT/INPUT:HZ or any other (repeatable)."
        "  [default: modes, which stands for every mode]"
    ),
)
COUPLING_LIMIT = 1e-3
"""Limit on the cross-coupling, unless `[analysis.tolerance]` gives another."""
COUPLING = (
    option(
        "--input",
        default="support.z",
        metavar="SIGNAL",
        help="The input: a motion of the support, or a force.",
    ),
    option(
        "--observe",
        metavar="STAGE@X,Y,Z",
        help=(
            "Observed point; the coupling is its motion along x over that along z."
            "  [default: mirror, 1 mm below its COM]"
        ),
    ),
    option("--over", metavar="SIGNAL", help="Numerator of the ratio, instead of the point's x."),
    option("--under", metavar="SIGNAL", help="Denominator of the ratio, instead of the point's z."),
    frequencies("50", "Frequencies at which the coupling is computed, Hz."),
)
"""Options that define the cross-coupling."""
EVERY_POINT = _of_batch(
    "--every-point",
    is_flag=True,
    help="Solve every point; else maps of analytic results are interpolated, and checked.",
)
SWEEP = (
    _of_batch(
        "--workers",
        type=click.IntRange(1, 4096),
        show_default="all cores, where that is faster",
        in_python=1,
        help="Number of processes.",
    ),
    _of_batch(
        "--scheduler",
        metavar="tls://HOST:PORT",
        help="Address of a Dask scheduler that computes instead (pendsus[cluster]).",
    ),
    _of_batch(
        "--chunk",
        type=click.IntRange(1, 1_000_000),
        default=BUILDS_AT_ONCE,
        help="Number of builds or points computed at once.",
    ),
    _of_batch("--resume", is_flag=True, help="Continue an interrupted run."),
)
"""Options of the computation of a sweep."""
WRITING = (OVERRIDES, TIES, OUT, NAME, FIDELITY, AS_JSON, CSV, PLOT, FORMAT, QUIET, VERBOSE)
"""Options of every analysis that writes a results file and a picture."""


@cache
def default_values(parameters: tuple[click.Parameter, ...]) -> Mapping[str, Any]:
    """Default values of options, which click finds once for each command."""
    command = click.Command("", params=list(parameters))
    return MappingProxyType(command.make_context("", [], resilient_parsing=True).params)


def from_arguments(command: str, parameters: tuple[Option, ...], arguments: Settings) -> Settings:
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
        found = grid(value, name)
        if not isinstance(found, str):
            return found
        texts = (found,)
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


_WANTED = {"bool": "True or False", "int": "a whole number", "float": "a number"}


def _single(param: Option, value: Any, remedy: str) -> Any:
    """Convert one flag, number (also of numpy, or as text) or text."""
    import numpy as np

    kind, choices = param.python_type, getattr(param.type, "choices", ())
    is_flag = isinstance(value, (bool, np.bool_))
    if kind not in _WANTED and isinstance(value, str):
        return value
    if kind == "bool" and (is_flag or isinstance(value, int)):
        return bool(value)
    if kind in ("int", "float") and not is_flag:
        with contextlib.suppress(Exception):  # whatever the value cannot do, it is no number
            if np.ndim(value):
                raise TypeError
            number = float(value)
            if kind == "float":
                return number
            if number == math.floor(number):
                return int(value)
    wanted = f"must be {_WANTED.get(kind, 'a text')}"
    wanted = f"is not one of {', '.join(map(repr, choices))}" if choices else wanted
    raise InputError.of(str(param.name), wanted, remedy, shown(value))


def grid(values: Any, name: str) -> Grid:
    """Return the text of a grid, or its numbers."""
    import numpy as np

    if isinstance(values, (str, bool)):
        return str(values)
    wanted, remedy = "must be real numbers", 'give numbers, or a text such as "1:10:50"'
    try:
        if isinstance(values, (bytes, Mapping, set)):
            raise TypeError
        if not hasattr(values, "__array__") and hasattr(values, "__iter__"):
            values = members(values, name, MAX_POINTS)
        if np.iscomplexobj(values):
            raise TypeError
        numbers = tuple(map(float, np.ravel(values)))
    except InputError:
        raise
    except Exception:  # whatever the values cannot do, they are no numbers
        raise InputError.of(name, wanted, remedy, shown(values)) from None
    if not numbers:
        raise InputError.of(name, "is empty", remedy)
    return numbers


def _grids(values: Any, name: str) -> tuple[str, ...]:
    """Write a dictionary of names and grids as ``NAME=GRID`` texts."""
    if not isinstance(values, Mapping):
        remedy = f'write for example {name}={{"stage.test.wires.d": [1e-3, 2e-3]}}'
        raise InputError.of(name, "must be a dictionary", remedy, shown(values))
    grids = {key: grid(own, f"{name} {key}") for key, own in values.items()}
    return tuple(f"{key}={write_grid(own)}" for key, own in grids.items())


def items(values: Any, name: str) -> tuple[str, ...]:
    """Convert one text or path, or several, to a tuple of texts; numbers of modes to texts."""
    try:
        if isinstance(values, (str, os.PathLike, int)):
            return (str(values),)
        if isinstance(values, bytes):
            raise TypeError
        return tuple(map(str, members(values, name, MOST_TEXTS)))
    except InputError:
        raise
    except Exception:  # whatever the values cannot do, they are no texts
        remedy = "leave it out for its default" if values is None else "give a text or a list"
        raise InputError.of(name, "must be texts", remedy, shown(values)) from None


def members(values: Any, name: str, most: int) -> list[Any]:
    """List the members of a value that can be iterated, once; raises `InputError` for too many."""
    count = len(values) if hasattr(values, "__len__") else 0
    found = [] if count > most else list(itertools.islice(values, most + 1))
    if max(count, len(found)) > most:
        remedy = f"give at most {most:,}"
        raise InputError.of(name, "has too many members", remedy, shown(values))
    return found


def path(value: Any, name: str) -> str:
    """Return a path as text; raises `InputError` for anything else."""
    if not isinstance(value, (str, os.PathLike)):
        raise InputError.of(name, "must be a path", "give a text or a Path", shown(value))
    try:
        text = os.fsdecode(value)
        encoded = os.fsencode(text)
        if b"\0" in encoded or max(map(len, re.split(rb"[/\\]", encoded))) > LONGEST_NAME:
            raise ValueError
    except ValueError:
        problem, remedy = "is no path on this system", "leave out characters that it does not take"
        raise InputError.of(name, problem, remedy, shown(value)) from None
    return text


def shown(value: Any) -> str:
    """Write a value of any type in one short line."""
    if isinstance(value, (str, Path)):
        return format_value(str(value))
    if isinstance(value, int):
        return format_value(value)
    return format_value(" ".join(text_of(value, repr).split())).strip('"')
