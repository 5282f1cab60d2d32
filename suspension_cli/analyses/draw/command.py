"""`pendsus draw`: a drawing of a design, to scale."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from suspension_cli.analyses import options
from suspension_cli.analyses.analysis import Analysis, Result, Run, Settings
from suspension_cli.files.whole_files import write_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
        options.OUT,
        options.NAME,
        options.FORMAT,
        options.QUIET,
    )

    def solve(self, run: Run) -> Result:
        """Draw the design."""
        from suspension_cli.drawing import draw
        from suspension_cli.equilibrium.nominal import expand_nominal
        from suspension_cli.models.registry import Choice

        figure = draw.draw(run.design, expand_nominal(run.design))
        extra = {"format": run.setting["picture_format"]}
        return Result(self, run.source, Choice("all", ""), figure, extra)

    def path(self, result: Result, folder: Path) -> Path:
        """Path of the picture."""
        return folder / f"{result.given.stem()}-draw.{result.extra['format']}"

    def save(self, path: Path, result: Result) -> None:
        """Write the picture."""
        from suspension_cli.drawing.style import encode

        write_bytes(path, encode(result.data, result.extra["format"]))

    def returned(self, result: Result, files: Settings) -> Figure:
        """Return the figure."""
        return result.data


ANALYSIS = DrawAnalysis()
