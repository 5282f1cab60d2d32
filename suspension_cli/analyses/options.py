"""Options that several commands share."""

from __future__ import annotations

import math
import os
import re
from typing import Any, NamedTuple

import click

from suspension_cli.models.registry import AUTO, LEVELS

TOLERANCE = 1e-3
"""Copy of `models.choice.TOLERANCE`."""
FILES, MODEL, BATCH = "Files and messages", "Model", "Computation"
"""Groups of options, as help lists them."""
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


def argument(name: str, **how: Any) -> click.Argument:
    """Declare an argument of an analysis, as `click.argument` does."""
    return click.Argument([name], **how)


def _demand_folder(_ctx: click.Context, _param: click.Parameter, value: str | None) -> str | None:
    """Refuse a file as the folder for results, before anything is computed."""
    from suspension_cli.errors import InputError

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
    from suspension_cli.errors import InputError, format_value

    if value is not None and not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._=+-]{,149}", value):
        remedy = "give letters, digits, . _ = + and - (at most 150), for example my-violin"
        raise InputError.of("--name", "is no name of files", remedy, format_value(value))
    return value


RESULTS_ENDINGS = (".h5", ".hdf5", ".csv")
"""Endings of paths to which results are saved."""
ENDINGS = (*RESULTS_ENDINGS, ".gif", ".jpg", ".jpeg", ".json", ".mat", ".md", ".npz", ".pdf")
ENDINGS += (".png", ".svg", ".toml", ".txt", ".xlsx", ".zip")
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

OVERRIDES = option(
    "--set",
    "overrides",
    multiple=True,
    metavar="PATH=VALUE",
    help="Change a value of the design: stage.test.wires.d=0.002 (repeatable).",
    group=FILES,
)
OUT = option(
    "--out",
    default="results",
    metavar="DIR",
    callback=_demand_folder,
    help="Folder for the written files.",
    group=FILES,
)
NAME = option(
    "--name",
    "stem",
    metavar="STEM",
    callback=_demand_stem,
    help="Start of the names of written files.  [default: the design's name, and values of --set]",
    group=FILES,
)
BESIDE = option(
    "--out",
    metavar="DIR",
    callback=_demand_folder,
    help="Folder for the PNG.  [default: that of the file]",
    group=FILES,
)
AS_JSON = option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print one JSON document on stdout; draw no picture unless --plot is given.",
    group=FILES,
)
AS_JSON_ONLY = option(
    "--json", "as_json", is_flag=True, help="Print one JSON document on stdout.", group=FILES
)
PLOT = option(
    "--plot/--no-plot",
    "plot",
    default=None,
    help="Draw pictures or not.  [default: --plot; with --json: --no-plot]",
    group=FILES,
)
NO_PICTURE = option(
    "--plot/--no-plot",
    "plot",
    default=False,
    hidden=True,
    help="Accepted without effect, as scripts give it to every analysis.",
    group=FILES,
)
FORMAT = option(
    "--format",
    "picture_format",
    type=click.Choice(["png", "pdf", "svg"]),
    default="png",
    help="Format of pictures.",
    group=FILES,
)
CSV = option(
    "--csv",
    "as_csv",
    is_flag=True,
    help="Also write the numbers as CSV: a row per frequency, mode or point.",
    group=FILES,
)
QUIET = option("-q", "--quiet", is_flag=True, help="Print only warnings on stderr.", group=FILES)
VERBOSE = option("-v", "--verbose", is_flag=True, help="Print details on stderr.", group=FILES)
FIDELITY = option(
    "--fidelity",
    type=click.Choice(LEVELS),
    default=AUTO,
    help="Model of bodies and wires; auto takes the cheapest that is accurate enough.",
    group=MODEL,
)
ACCURACY = option(
    "--tolerance",
    type=click.FloatRange(1e-12, 1.0),
    default=TOLERANCE,
    help="Largest relative error of the result that --fidelity auto accepts.",
    group=MODEL,
)
ALLOW_UNSTABLE = option(
    "--allow-unstable",
    is_flag=True,
    help="Continue with motion that grows (an unstable equilibrium, active elements).",
    group=MODEL,
)
RESULTS = option(
    "--result",
    "results",
    multiple=True,
    metavar="NAME",
    help=(
        "A mode by its label or number, a response OUTPUT/INPUT:HZ, a coupling OVER/UNDER/INPUT:HZ"
        " (repeatable).  [default: modes, which stands for every mode]"
    ),
)
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
SWEEP = (
    option(
        "--workers",
        type=click.IntRange(1, 4096),
        show_default="all cores, where that is faster",
        in_python=1,
        help="Number of processes.",
        group=BATCH,
    ),
    option(
        "--scheduler",
        metavar="tls://HOST:PORT",
        help="Address of a Dask scheduler that computes instead (pendsus[cluster]).",
        group=BATCH,
    ),
    option(
        "--chunk",
        type=click.IntRange(1, 1_000_000),
        default=512,
        help="Number of builds or points computed at once.",
        group=BATCH,
    ),
    option("--resume", is_flag=True, help="Continue an interrupted run.", group=BATCH),
)
"""Options of the computation of a sweep."""
WRITING = (OVERRIDES, OUT, NAME, FIDELITY, AS_JSON, CSV, PLOT, FORMAT, QUIET, VERBOSE)
"""Options of every analysis that writes a results file and a picture."""
