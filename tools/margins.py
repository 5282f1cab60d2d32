"""Margins of the figures that are not made of panels."""

from __future__ import annotations

from matplotlib.figure import Figure

from suspension_cli.drawing.panels import FOOT, HEAD, LEFT


def set_margins(
    figure: Figure,
    left: float = LEFT,
    right: float = 0.15,
    top: float = HEAD + 0.08,
    bottom: float = 0.45 + FOOT,
    **between: float,
) -> None:
    """Set the margins of a figure in inches; `between` are `wspace` and `hspace`."""
    across, up = figure.get_size_inches()
    ends = {"left": left / across, "right": 1 - right / across}
    figure.subplots_adjust(**ends, top=1 - top / up, bottom=bottom / up, **between)
