"""`pendsus draw`: a drawing of a design, to scale."""

from __future__ import annotations

import click

from suspension_cli.analyses import options, settings
from suspension_cli.cli import terminal
from suspension_cli.cli.runner import Command


@click.command(
    "draw",
    cls=Command,
    params=[
        options.DESIGNS,
        options.OVERRIDES,
        options.OUT,
        options.NAME,
        options.FORMAT,
        options.QUIET,
    ],
)
def command(
    designs: tuple[str, ...],
    overrides: tuple[str, ...],
    out: str,
    stem: str | None,
    picture_format: str,
    quiet: bool,
) -> None:
    """Draw each DESIGN to scale, from the side and from the front: DIR/NAME-draw.png.

    Example: pendsus draw my.toml
    """
    from suspension_cli.analyses.analysis import demand_distinct_names
    from suspension_cli.design.reader import read
    from suspension_cli.drawing.quick_import import import_matplotlib

    import_matplotlib()
    from suspension_cli.drawing import draw
    from suspension_cli.drawing.style import save
    from suspension_cli.equilibrium.nominal import expand_nominal
    from suspension_cli.errors import attribute_faults_to
    from suspension_cli.files.atomic import writing_to

    sources = [settings.named(read(file, overrides), stem, overrides) for file in designs]
    demand_distinct_names(sources)
    for source in sources:
        with attribute_faults_to(source.file):
            scene = expand_nominal(source.design)
        path = settings.folder(out) / f"{source.stem()}-draw.{picture_format}"
        with writing_to(path):
            save(draw.draw(source.design, scene), path)
        if not quiet:
            terminal.tell(f"wrote {path}")
