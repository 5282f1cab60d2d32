"""`pendsus draw`: a drawing of a design, to scale."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from suspension_cli.analyses import options
from suspension_cli.analyses.analysis import Analysis, Run, Settings
from suspension_cli.analyses.record import Record
from suspension_cli.files.declared import NOT_STORED
from suspension_cli.files.whole_files import write_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class Drawing(Record):
    """A design to scale."""

    figure: Figure = field(metadata=NOT_STORED)


class DrawAnalysis(Analysis):
    """Draw a design to scale, from the side and from the front, with its dimensions.

    Writes DIR/NAME-draw.png for each DESIGN.

    Example: pendsus draw my.toml

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If the design does not balance.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> figure = sus.draw(sus.template("single"))
    """

    name = "draw"
    has_model = False
    arguments = (options.DESIGNS,)
    returns = "Any"
    parameters = (
        options.OVERRIDES,
        options.TIES,
        options.OUT,
        options.NAME,
        options.FORMAT,
        options.QUIET,
    )

    def solve(self, run: Run) -> Drawing:
        """Draw the design."""
        from suspension_cli.drawing import draw
        from suspension_cli.equilibrium.nominal import expand_nominal
        from suspension_cli.models.registry import Choice

        figure = draw.draw(run.design, expand_nominal(run.design))
        return Drawing(figure, run=run.origin(self, Choice("all", "")))

    def path(self, result: Drawing, folder: Path) -> Path:
        """Path of the picture."""
        run = result.run
        return folder / f"{run.design.stem()}-draw.{run.options['picture_format']}"

    def save(self, path: Path, result: Drawing) -> None:
        """Write the picture."""
        from suspension_cli.drawing.style import encode

        write_bytes(path, encode(result.figure, result.run.options["picture_format"]))

    def returned(self, result: Drawing, files: Settings) -> Figure:
        """Return the figure."""
        return result.figure


ANALYSIS = DrawAnalysis()
