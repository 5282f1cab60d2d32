"""`pendsus draw`: a design to scale."""

from __future__ import annotations

import click

from suspension_cli.cli import options


@click.command("draw")
@options.designs
@options.overrides
@options.out
@click.option("-q", "--quiet", is_flag=True, help="Do not say which files were written.")
def command(designs: tuple[str, ...], overrides: tuple[str, ...], out: str, quiet: bool) -> None:
    """Draw each DESIGN to scale, side on and face on, with its dimensions: DIR/NAME-draw.png."""
    from suspension_cli.design.reader import read
    from suspension_cli.errors import faults_of
    from suspension_cli.mechanics.nominal import nominal
    from suspension_cli.plots import draw
    from suspension_cli.plots.style import save
    from suspension_cli.results import writing_to

    for source in [read(file, overrides) for file in designs]:
        with faults_of(source.file):
            scene = nominal(source.design)
        path = options.folder(out) / f"{source.design.design.name}-draw.png"
        with writing_to(path):
            save(draw.draw(source.design, scene), path)
        if not quiet:
            options.tell(f"wrote {path}")
