"""`pendsus report`: one HTML file of a design with all its analyses."""

from __future__ import annotations

import click

from suspension_cli.analyses import options, settings
from suspension_cli.cli import terminal
from suspension_cli.cli.runner import Command


@click.command(
    "report",
    cls=Command,
    params=[
        options.DESIGN,
        *options.REPORT,
        options.OVERRIDES,
        options.OUT,
        options.NAME,
        options.QUIET,
        options.VERBOSE,
    ],
)
def command(
    design: str,
    sections: str | None,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    builds: int,
    arm: float,
    mirrors: float,
    fidelity: str,
    tolerance: float,
    overrides: tuple[str, ...],
    out: str,
    stem: str | None,
    quiet: bool,
    verbose: bool,
) -> None:
    """Write one HTML file of DESIGN with all its analyses: DIR/NAME-report.html.

    It has the drawing, checks, modes, responses, couplings, noises, tolerances and damping loops,
    and the command of each. Any browser opens and prints it, without network. Options of each
    analysis are those of the design's [analysis] tables. A section that cannot be computed says
    why.

    Example: pendsus report my.toml
    """
    from pathlib import Path

    from suspension_cli.analyses.report.composition import Request
    from suspension_cli.analyses.report.solve import compose
    from suspension_cli.design.reader import read
    from suspension_cli.drawing.quick_import import import_matplotlib
    from suspension_cli.files.atomic import write_bytes

    import_matplotlib()
    source = settings.named(read(design, overrides), stem, overrides)
    names = tuple(filter(None, (name.strip() for name in (sections or "").split(","))))
    request = Request(
        names, inputs, outputs, builds, fidelity, tolerance, arm, mirrors, overrides, Path(out)
    )
    page = compose(source, request, terminal.Voice(quiet=quiet, verbose=verbose))
    path = settings.folder(out) / f"{source.stem()}-report.html"
    write_bytes(path, page.encode())
    if not quiet:
        terminal.tell(f"wrote {path}")
