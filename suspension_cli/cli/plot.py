"""`pendsus plot`: redraw from a results file alone."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import options, registry, settings
from suspension_cli.cli import terminal
from suspension_cli.cli.runner import Command

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Result
    from suspension_cli.design.reader import Source

LIMITS = [
    options.option(
        "--x",
        "x_limits",
        metavar="LOW:HIGH",
        help="Limits of the first horizontal axis, in its unit, and of all with the same label.",
    ),
    options.option(
        "--y",
        "y_limits",
        metavar="LOW:HIGH",
        help="Limits of the uppermost vertical axis, in its unit.",
    ),
]
TOGETHER = options.option(
    "--together",
    is_flag=True,
    help="Draw modes, responses or thermal noises of all files in one picture, as compare does.",
)
FILES = options.argument("files", nargs=-1, required=True, metavar="FILE.h5...")
FORM = (options.FORMAT, options.CSV, options.BESIDE, options.QUIET)


@click.command("plot", cls=Command, params=[FILES, TOGETHER, *LIMITS, *FORM])
def command(
    files: tuple[str, ...],
    together: bool,
    x_limits: str | None,
    y_limits: str | None,
    picture_format: str,
    as_csv: bool,
    out: str | None,
    quiet: bool,
) -> None:
    """Redraw the pictures of each results FILE, from the file alone.

    Example: pendsus plot results/my-response.h5 --x 0.5:5 --format pdf
    """
    from suspension_cli.analyses import labelled
    from suspension_cli.drawing.quick_import import import_matplotlib

    import_matplotlib()
    from suspension_cli.drawing.panels import limited
    from suspension_cli.drawing.style import encode
    from suspension_cli.errors import InputError
    from suspension_cli.files.atomic import write_bytes
    from suspension_cli.files.hdf5 import open_results, reporting_damage

    limits = _limits("--x", x_limits), _limits("--y", y_limits)
    folder = settings.folder(out) if out else None
    if together:
        results = [_compared(files)]
        paths = [results[0].analysis.path(results[0], folder or Path(files[0]).parent)]
    else:
        results, paths = [], [(folder or Path(file).parent) / Path(file).name for file in files]
        for file in files:
            with open_results(file) as stored:
                results.append(registry.loaded(stored, file))
    for result, path in zip(results, paths, strict=True):
        with reporting_damage(result.source.file, "run the analysis again"):
            with limited(*limits):
                figures = result.figures() or {"": result.plot()}  # refused if there is none
            for figure in figures.values():
                if any(limits) and not any(axes.axison for axes in figure.axes):
                    option = "--x" if limits[0] else "--y"
                    raise InputError.of(option, "this picture has no axes", "leave it out")
            pictures = {end: encode(figure, picture_format) for end, figure in figures.items()}
        # first, as it refuses damaged numbers that the picture leaves out
        written = labelled.write_csv(result, path) if as_csv else []
        for end, picture in pictures.items():
            written.append(path.with_name(f"{path.stem}{end}.{picture_format}"))
            write_bytes(written[-1], picture, key="--out" if out else "")
        for one in [] if quiet else written:
            terminal.tell(f"wrote {one}")


def _compared(files: tuple[str, ...]) -> Result:
    """Compare stored results."""
    from suspension_cli.analyses.analysis import Log, Run

    analysis = registry.get("compare")

    def ask(source: Source, _overrides: tuple[str, ...] = ()) -> Run:
        return Run(source, settings.defaults(analysis, {}), Log(), Path(), "pendsus plot")

    return analysis.solve(analysis.read(ask, {"items": files}))


def _limits(option: str, text: str | None) -> tuple[float, float] | None:
    """Parse ``LOW:HIGH``."""
    from suspension_cli.errors import InputError, format_value

    if text is None:
        return None
    try:
        low, high = map(float, text.split(":"))
    except ValueError:
        low, high = 1.0, 0.0
    if not -math.inf < low < high < math.inf:
        problem, remedy = "is not LOW:HIGH, two ascending numbers", "write for example 0.1:10"
        raise InputError.of(option, problem, remedy, format_value(text))
    return low, high
