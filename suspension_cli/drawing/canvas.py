"""Canvas that collects shapes and draws them as a few collections, not thousands of artists."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from suspension_cli.drawing import style
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from matplotlib.typing import ColorType, LineStyleType
    from numpy.typing import ArrayLike

HATCH = 5 * "/"


class Canvas:
    """Shapes collected for one pair of axes, whose limits and scale the caller sets.

    ``canvas = full_canvas(figure); canvas.line([[0, 0], [1, 1]], "black", 0.5, 1); canvas.flush()``
    """

    def __init__(self, axes: Axes) -> None:
        self.axes = axes
        self._polygons: dict[float, list[tuple[Any, ...]]] = defaultdict(list)
        self._lines: dict[tuple[float, LineStyleType], list[tuple[Any, ...]]] = defaultdict(list)

    def polygon(
        self,
        points: Array | Sequence[ArrayLike],
        face: ColorType,
        edge: ColorType,
        width: float,
        order: float,
    ) -> None:
        """Add a filled polygon (p, 2), its edge of a width in points; a larger order is above."""
        self._polygons[order].append((np.asarray(points), face, edge, width))

    def line(
        self,
        points: Array | Sequence[ArrayLike],
        colour: ColorType,
        width: float,
        order: float,
        dashes: LineStyleType = "solid",
    ) -> None:
        """Add a line (p, 2) of a width in points."""
        self._lines[order, dashes].append((np.asarray(points), colour, width))

    def hatch(
        self, corner: ArrayLike, opposite: ArrayLike, colour: ColorType, order: float
    ) -> None:
        """Hatch a rectangle between two opposite corners."""
        (left, foot), (right, top) = np.asarray(corner), np.asarray(opposite)
        look: Any = {"hatch": HATCH, "edgecolor": colour, "facecolor": "none", "linewidth": 0.0}
        box = Rectangle((left, foot), right - left, top - foot, zorder=order, clip_on=False, **look)
        self.axes.add_artist(box)

    def text(self, x: float, y: float, text: str, **look: Any) -> None:
        """Draw text at a point of the axes, not clipped by them."""
        self.axes.text(x, y, text, zorder=9, **look)

    def flush(self) -> None:
        """Draw all shapes collected so far."""
        for order, polygons in self._polygons.items():
            points, faces, edges, widths = zip(*polygons, strict=True)
            look: Any = {"facecolors": faces, "edgecolors": edges, "linewidths": widths}
            shapes = PolyCollection(points, zorder=order, clip_on=False, **look)
            self.axes.add_collection(shapes, autolim=False)
        for (order, dashes), lines in self._lines.items():
            points, colours, widths = zip(*lines, strict=True)
            look = {"colors": colours, "linewidths": widths, "linestyles": dashes}
            look["capstyle"] = "round" if dashes == "solid" else "butt"
            shapes = LineCollection(points, zorder=order, clip_on=False, **look)
            self.axes.add_collection(shapes, autolim=False)
        self._polygons.clear()
        self._lines.clear()


def full_canvas(figure: Figure) -> Canvas:
    """Make a canvas as large as a figure, in inches from its lower left corner."""
    width, height = figure.get_size_inches()
    axes = style.add_axes(figure, 0, 0, width, height)
    axes.set_xlim(0, width)
    axes.set_ylim(0, height)
    axes.set_axis_off()
    return Canvas(axes)
