"""Drawing of bodies, wires, blades, springs and the support on a canvas, in a view."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import Collection, LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from suspension_cli.drawing import style
from suspension_cli.drawing.geometry import Sketch, Stroke, View, free_springs
from suspension_cli.drawing.style import NOTE, PALE
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from matplotlib.typing import ColorType, LineStyleType
    from numpy.typing import ArrayLike

WIDTHS = {
    "bore": (0.8, 0.0),
    "bracket": (2.2, 0.1),
    "wire": (1.0, 0.2),
    "leg": (1.2, 0.2),
    "link": (0.9, 0.35),
    "light": (0.5, -0.1),
}
"""Width of lines relative to that of a wire, and their order above that of the bodies."""
ZIGZAG = np.array(
    [[0, 0, 0.6, -0.6, 0.6, -0.6, 0, 0], [-1.6, -1, -0.75, -0.25, 0.25, 0.75, 1, 1.6]]
)
"""Sign of a spring: right and up, in units of its size."""
DASHPOT = np.array(
    [
        [0, 0, -0.7, -0.7, -0.7, 0.7, 0.7, 0.7, 0, np.nan, 0, 0, -0.5, 0.5],
        [-1.6, -0.8, -0.8, 0.8, -0.8, -0.8, 0.8, -0.8, -0.8, np.nan, 1.6, 0.2, 0.2, 0.2],
    ]
)
"""Sign of a damper: a piston in a cylinder."""
SIGN = 0.022
"""Size of the signs of springs over that of the suspension."""


class Canvas:
    """Shapes collected for one pair of axes, drawn as a few collections, not thousands of artists.

    ``canvas = full_canvas(figure); canvas.line([[0, 0], [1, 1]], "black", 0.5, 1); canvas.flush()``

    Polygons and lines end at a `frame`, if there is one, not at the axes.
    """

    def __init__(self, axes: Axes, frame: Rectangle | None = None) -> None:
        self.axes = axes
        self.frame = frame
        self._polygons: dict[float, list[tuple[Any, ...]]] = defaultdict(list)
        self._lines: dict[tuple[float, LineStyleType], list[tuple[Any, ...]]] = defaultdict(list)

    def polygon(
        self, points: ArrayLike, face: ColorType, edge: ColorType, width: float, order: float
    ) -> None:
        """Add a filled polygon (p, 2), its edge of a width in points; a larger order is above."""
        self._polygons[order].append((np.asarray(points), face, edge, width))

    def line(
        self,
        points: ArrayLike | Sequence[ArrayLike],
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
        left, foot = np.asarray(corner)
        right, top = np.asarray(opposite)
        look: Any = {"hatch": 5 * "/", "edgecolor": colour, "facecolor": "none", "linewidth": 0.0}
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
            self._add(PolyCollection(points, zorder=order, **look))
        for (order, dashes), lines in self._lines.items():
            points, colours, widths = zip(*_join_alike(lines), strict=True)
            look = {"colors": colours, "linewidths": widths, "linestyles": dashes}
            look["capstyle"] = "round" if dashes == "solid" else "butt"
            self._add(LineCollection(points, zorder=order, **look))
        self._polygons.clear()
        self._lines.clear()

    def _add(self, shapes: Collection) -> None:
        """Add shapes to the axes, cut at the frame."""
        self.axes.add_collection(shapes, autolim=False)
        shapes.set_clip_on(self.frame is not None)
        if self.frame is not None:
            shapes.set_clip_path(self.frame)

    def framed(self, left: float, foot: float, width: float, height: float) -> Canvas:
        """Make a canvas on the same axes that ends at a frame, which is drawn."""
        look: Any = {"facecolor": "none", "edgecolor": PALE, "linewidth": 0.5}
        frame = Rectangle((left, foot), width, height, **look)
        self.axes.add_artist(frame)
        return Canvas(self.axes, frame)


def _join_alike(lines: Sequence[tuple[Any, ...]]) -> Iterator[tuple[Any, ...]]:
    """Join neighbouring lines of one colour and width to one with gaps, which is drawn faster.

    >>> [(points, *look)] = _join_alike([(np.eye(2), "black", 0.5), (np.eye(2), "black", 0.5)])
    >>> points.shape, look
    ((5, 2), ['black', 0.5])
    """
    gap = np.full((1, 2), np.nan)
    for look, members in groupby(lines, key=lambda line: line[1:]):
        pieces = [piece for points, *_ in members for piece in (points, gap)]
        yield np.concatenate(pieces[:-1]), *look


def full_canvas(figure: Figure) -> Canvas:
    """Make a canvas as large as a figure, in inches from its lower left corner."""
    width, height = figure.get_size_inches()
    axes = style.add_axes(figure, 0, 0, width, height)
    axes.set(xlim=(0, width), ylim=(0, height))
    axes.set_axis_off()
    return Canvas(axes)


@dataclass(frozen=True)
class Look:
    """Colours of bodies (outline and interior) and lines, width of a wire, drawing order.

    The width is in points; blades (on a canvas in inches) and outlines scale with it.
    """

    edge: tuple[ColorType, ...]
    fill: tuple[ColorType, ...]
    line: ColorType
    width: float
    order: float


def draw_suspension(
    canvas: Canvas, view: View, sketch: Sketch, look: Look, strokes: Sequence[Stroke] | None = None
) -> None:
    """Draw all bodies, wires, blades and springs, optionally as strokes moved elsewhere."""
    strokes = sketch.strokes(view.normal) if strokes is None else strokes
    shapes = [(one, view.see(one.points)) for one in strokes]
    bodies = [(one.body, line) for one, line in shapes if one.kind == "body"]
    # a body behind or around another one must not hide it
    for body, line in sorted(bodies, key=lambda item: -float(np.prod(np.ptp(item[1], axis=0)))):
        canvas.polygon(line, look.fill[body], look.edge[body], 1.3 * look.width, look.order)
    unit = SIGN * sketch.size * view.scale
    taken = [(line.min(0) + line.max(0)) / 2 for _, line in bodies]
    for one, line in shapes:
        if one.kind in WIDTHS and np.ptp(line, axis=0).any():
            width, above = WIDTHS[one.kind]
            colour = look.edge[one.body] if one.kind in ("bore", "bracket") else look.line
            canvas.line(line, colour, width * look.width, look.order + above)
        if one.kind == "locked":
            canvas.line(line, NOTE, 0.9 * look.width, look.order - 0.5, (0, (4, 2)))
        if one.kind == "blade":
            _draw_blade(canvas, line, look)
        elif one.kind == "leg":  # a thick bar between thin flexures
            ends = line[0] + np.array([[0.12], [0.94]]) * (line[1] - line[0])
            canvas.line(ends, look.line, 4.5 * look.width, look.order + 0.25)
        elif one.kind in ("spring", "damper"):
            _draw_spring(canvas, one, line, unit, taken, look)
        elif one.kind == "mass":
            _draw_mass(canvas, line, unit, look)
        elif one.grounded:
            _draw_foot(canvas, line[-1], unit, look)


def _draw_blade(canvas: Canvas, line: Array, look: Look) -> None:
    """Draw a blade, tapered from root to tip, along a line (p, 2)."""
    along = np.gradient(line, axis=0)
    norm = np.linalg.norm(along, axis=1, keepdims=True)
    across = along[:, ::-1] * (-1, 1) / np.maximum(norm, 1e-12)
    half = np.linspace(2.0, 0.8, len(line))[:, None] * look.width / 72
    shape = np.concatenate([line + half * across, (line - half * across)[::-1]])
    canvas.line(line, look.line, 1.2 * look.width, look.order + 0.3)
    canvas.polygon(shape, look.line, "none", 0.0, look.order + 0.3)


def _draw_spring(
    canvas: Canvas, one: Stroke, line: Array, unit: float, taken: list[Array], look: Look
) -> None:
    """Draw a spring as a zigzag, with a dotted line to the body above or a hatched foot.

    A damper is a piston. It lies beside the places `taken`, of a size `unit`.
    """
    *held, upper, lower = line
    middle = (lower + upper) / 2
    while (np.abs(np.array(taken) - middle).max(1) < unit).any():
        middle = middle + np.array([2.6 * unit, 0.0])
    taken.append(middle)
    if one.grounded:
        _draw_foot(canvas, middle - np.array([0.0, 1.6 * unit]), unit, look)
    elif np.linalg.norm(held[0] - upper) > 3 * unit:
        ends = np.stack([held[0], upper])
        canvas.line(ends, look.line, 0.8 * look.width, look.order + 0.25, (0, (1, 2)))
    sign = middle + unit * (DASHPOT if one.kind == "damper" else ZIGZAG).T
    if np.linalg.norm(upper - lower) > unit:
        sign = np.vstack([lower, sign, upper] if lower[1] < upper[1] else [upper, sign, lower])
    canvas.line(sign, look.line, 1.3 * look.width, look.order + 0.4)


def _draw_mass(canvas: Canvas, line: Array, unit: float, look: Look) -> None:
    """Draw a damper: a square of a size `unit` at the end of a line (2, 2)."""
    canvas.line(line, look.line, look.width, look.order + 0.4)
    corners = np.array([[-1, -1], [-1, 1], [1, 1], [1, -1]]) * 0.4 * unit
    canvas.polygon(line[1] + corners, look.line, look.line, look.width, look.order + 0.5)


def _draw_foot(canvas: Canvas, point: Array, unit: float, look: Look) -> None:
    """Draw the ground under a point of the picture: a hatched bar."""
    left, right = point + 1.4 * unit * np.array([[-1.0, 0.0], [1.0, 0.0]])
    canvas.line([left, right], NOTE, 1.2, look.order + 0.4)
    canvas.hatch(left - (0.0, 0.6 * unit), right, NOTE, look.order + 0.4)


def _support_points(sketch: Sketch) -> Array:
    """Points (k, 3) of the support where wires, roots of blades and springs are attached, m."""

    def attached() -> Iterator[Array]:
        scene = sketch.scene
        free = free_springs(sketch.scene)
        yield scene.wires.upper_point[(scene.wires.upper == 0) & (scene.wires.blade < 0)]
        blades = [one.points[:1] for one in sketch.strokes(0) if one.kind == "blade"]
        yield from (blades[n] for n in np.flatnonzero(scene.blades.body == 0))
        held = free[(scene.springs.upper[free] == 0) & ~scene.springs.grounded[free]]
        of_filter = np.array([scene.springs.label[n].endswith(".blades") for n in held], dtype=bool)
        yield scene.springs.upper_point[held[of_filter]]  # in a locked filter
        yield scene.springs.upper_point[held[~of_filter]] * (1, 1, 0)
        yield scene.struts.upper_point[scene.struts.upper == 0]

    found = np.concatenate([*attached()])
    return found if len(found) else np.zeros((1, 3))


def support_box(sketch: Sketch) -> tuple[Array, Array]:
    """Opposite corners (3,), (3,) of the support in the drawing, m.

    It is above everything attached to it, or below what stands on it; the first corner's z is on
    the side of the attachments.
    """
    points = _support_points(sketch)
    scene = sketch.scene
    low = points.min(0) - 2 * sketch.thick
    high = points.max(0) + 2 * sketch.thick
    stands = bool((scene.struts.upper == 0).any())
    up = -1.0 if stands or scene.bodies.position[1:, 2].mean() > 0 else 1.0
    gap = 1.2 * sketch.thick if (scene.blades.body == 0).any() else 0.0
    low[2] = (up * points[:, 2]).max() * up + up * gap
    high[2] = low[2] + up * sketch.thick
    return low, high


def draw_support(canvas: Canvas, view: View, sketch: Sketch) -> None:
    """Draw the support: a hatched bar with posts to remote attachments, or plate from above."""
    low, high = support_box(sketch)
    if view.normal == 2:
        x0, y0, z = low
        x1, y1, _ = high
        frame = view.see([[x0, y0, z], [x0, y1, z], [x1, y1, z], [x1, y0, z], [x0, y0, z]])
        canvas.line(frame, NOTE, 0.6, 0.5)
        canvas.hatch(frame[3], frame[1], PALE, 0.5)
        return
    points = np.unique(_support_points(sketch), axis=0)
    points = points[np.abs(points[:, 2] - low[2]) > 1e-9]
    for post in view.see(np.stack([points, points * (1, 1, 0) + (0, 0, low[2])], axis=1)):
        canvas.line(post, NOTE, 1.4, 0.6)
    left, foot = view.see(low)
    right, top = view.see(high)
    canvas.line([[left, foot], [right, foot]], NOTE, 1.4, 0.7)
    canvas.hatch([left, foot], [right, top], NOTE, 0.5)


def draw_com_mark(canvas: Canvas, where: Array, radius: float, colour: ColorType) -> None:
    """Draw the quartered circle of a centre of mass, at a point (2,) of the picture."""
    angle = np.linspace(0, 2 * np.pi, 49)
    circle = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    canvas.polygon(where + circle, "white", colour, 0.6, 6)
    for quarter in (circle[:13], circle[24:37]):
        canvas.polygon(where + np.vstack([[0.0, 0.0], quarter]), colour, "none", 0.0, 6.1)
