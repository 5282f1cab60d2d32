"""Canvas that collects shapes and draws them as a few collections, not thousands of artists."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable, Sequence
from typing import TYPE_CHECKING, NamedTuple, TypedDict, TypeVar, Unpack

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from suspension_cli.drawing import style
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from matplotlib.typing import ColorType, LineStyleType
    from numpy.typing import ArrayLike

T = TypeVar("T")

BREAK = np.full((1, 2), np.nan)
"""Between two lines that are drawn as one path, which takes less time."""


class TextLook(TypedDict, total=False):
    """Properties of a text on a canvas, by Matplotlib's names."""

    fontsize: float
    color: ColorType
    fontweight: str
    ha: str
    va: str
    rotation: float
    linespacing: float
    bbox: dict[str, float | str]


class _Polygon(NamedTuple):
    points: Array
    face: ColorType
    edge: ColorType
    width: float


class _Line(NamedTuple):
    points: Array
    colour: ColorType
    width: float
    dashes: LineStyleType


class Canvas:
    """Shapes collected for one pair of axes, whose limits and scale the caller sets.

    ``canvas = full_canvas(figure); canvas.line([[0, 0], [1, 1]], "black", 0.5, 1); canvas.flush()``
    """

    def __init__(self, axes: Axes) -> None:
        self.axes = axes
        self._polygons: dict[float, list[_Polygon]] = defaultdict(list)
        self._lines: dict[float, list[_Line]] = defaultdict(list)
        self._stamps: dict[Hashable, Canvas] = {}

    def polygon(
        self,
        points: Array | Sequence[ArrayLike],
        face: ColorType,
        edge: ColorType,
        width: float,
        order: float,
    ) -> None:
        """Add a filled polygon (p, 2), its edge of a width in points; a larger order is above."""
        self._polygons[order].append(_Polygon(np.asarray(points), face, edge, width))

    def line(
        self,
        points: Array | Sequence[ArrayLike],
        colour: ColorType,
        width: float,
        order: float,
        dashes: LineStyleType = "solid",
    ) -> None:
        """Add a line (p, 2) of a width in points."""
        self._lines[order].append(_Line(np.asarray(points), colour, width, dashes))

    def stamp(
        self, key: Hashable, shift: Array | tuple[float, float], draw: Callable[[Canvas], None]
    ) -> None:
        """Draw shapes moved by a vector (2,); those of equal `key` are made once.

        `draw` adds the shapes (no text) to a canvas, about the origin.
        """
        made = self._stamps.get(key)
        if made is None:
            made = self._stamps[key] = Canvas(self.axes)
            draw(made)
        for order, polygons in made._polygons.items():
            self._polygons[order] += [one._replace(points=one.points + shift) for one in polygons]
        for order, lines in made._lines.items():
            self._lines[order] += [one._replace(points=one.points + shift) for one in lines]

    def text(self, x: float, y: float, text: str, **keywords: Unpack[TextLook]) -> None:
        """Draw text at a point of the axes, not clipped by them."""
        self.axes.text(x, y, text, zorder=9, **keywords)

    def flush(self) -> None:
        """Draw all shapes collected so far."""
        for order, polygons in self._polygons.items():
            verts, faces, edges, widths = zip(*polygons, strict=True)
            self.axes.add_collection(
                PolyCollection(
                    verts,
                    facecolors=_once(faces),
                    edgecolors=_once(edges),
                    linewidths=_once(widths),
                    zorder=order,
                    clip_on=False,
                ),
                autolim=False,
            )
        for order, lines in self._lines.items():
            alike = defaultdict(list)
            for line in lines:
                alike[line.colour, line.width, line.dashes] += [line.points, BREAK]
            colours, line_widths, dashes = zip(*alike, strict=True)
            solid = all(dash == "solid" for dash in dashes)
            collection = LineCollection(
                [np.concatenate(points) for points in alike.values()],
                colors=colours,
                linewidths=line_widths,
                linestyles="solid" if solid else list(dashes),
                zorder=order,
                clip_on=False,
            )
            collection.set_capstyle("round" if solid else "butt")
            self.axes.add_collection(collection, autolim=False)
        self._polygons.clear()
        self._lines.clear()


def _once(values: tuple[T, ...]) -> T | tuple[T, ...]:
    """Return one of equal values, which draws faster, else all."""
    first = values[0]
    return first if all(value == first for value in values) else values


def full_canvas(figure: Figure) -> Canvas:
    """Make a canvas as large as a figure, in inches from its lower left corner."""
    width, height = figure.get_size_inches()
    axes = style.add_axes(figure, 0, 0, width, height)
    axes.set_xlim(0, width)
    axes.set_ylim(0, height)
    axes.set_axis_off()
    return Canvas(axes)
