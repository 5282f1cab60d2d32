"""`pendsus draw`: a drawing of a design, to scale."""

from __future__ import annotations

import click

from suspension_cli.analyses import options, settings
from suspension_cli.cli import terminal
from suspension_cli.cli.runner import Command


@click.command(
    "draw",
    cls=Command,
    params=[options.DESIGNS, options.OVERRIDES, options.OUT, options.FORMAT, options.QUIET],
)
def command(
    designs: tuple[str, ...],
    overrides: tuple[str, ...],
    out: str,
    picture_format: str,
    quiet: bool,
) -> None:
    """Draw each DESIGN to scale, from the side and from the front: DIR/NAME-draw.png.

    Example: pendsus draw my.toml
    """
    from suspension_cli.design.reader import read
    from suspension_cli.drawing.quick_import import import_matplotlib

    import_matplotlib()
    from suspension_cli.drawing import draw
    from suspension_cli.drawing.style import save
    from suspension_cli.equilibrium.nominal import expand_nominal
    from suspension_cli.errors import attribute_faults_to
    from suspension_cli.files.atomic import writing_to

    for source in [read(file, overrides) for file in designs]:
        with attribute_faults_to(source.file):
            scene = expand_nominal(source.design)
        path = settings.folder(out) / f"{source.design.design.name}-draw.{picture_format}"
        with writing_to(path):
            save(draw.draw(source.design, scene), path)
        if not quiet:
            terminal.tell(f"wrote {path}")
