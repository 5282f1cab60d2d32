"""Drawing of bodies, wires, blades, springs and the support on a canvas, in a view."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.drawing import geometry
from suspension_cli.drawing.bodies import Outline, suspension_size
from suspension_cli.drawing.canvas import Canvas
from suspension_cli.drawing.geometry import View
from suspension_cli.drawing.style import NOTE, PALE
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.pose import Pose
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from matplotlib.typing import ColorType

ZIGZAG = (
    0.6 * np.array([0, 0, 1, -1, 1, -1, 0, 0]),
    np.array([-1.6, -1, -0.75, -0.25, 0.25, 0.75, 1, 1.6]),
)
"""Sign of a spring: right and up, in units of its size."""
DASHPOT = (
    0.7 * np.array([0, 0, -1, -1, -1, 1, 1, 1, 0.0, np.nan, 0, 0, -0.7, 0.7]),
    np.array([-1.6, -0.8, -0.8, 0.8, -0.8, -0.8, 0.8, -0.8, -0.8, np.nan, 1.6, 0.2, 0.2, 0.2]),
)
"""Sign of a damper: a piston in a cylinder."""


@dataclass(frozen=True)
class Look:
    """Colours and line widths of a suspension.

    Attributes
    ----------
    edge, fill
        Outline and interior of each body.
    line
        Wires, blades, springs.
    width
        Of a wire, points; blades (on a canvas in inches) and outlines scale with it.
    order
        Drawing order; larger is above.
    """

    edge: tuple[ColorType, ...]
    fill: tuple[ColorType, ...]
    line: ColorType
    width: float
    order: float


@dataclass(frozen=True)
class Sketch:
    """A suspension in one pose, to be drawn in any view.

    Attributes
    ----------
    scene
        Without batch axes.
    thick
        Thickness of the support, m.
    """

    design: Design
    scene: Scene
    outlines: list[Outline]
    pose: Pose
    thick: float

    @cached_property
    def leaves(self) -> Array:
        """Line of each blade, see `geometry.leaves`."""
        return geometry.leaves(self.design, self.scene, self.pose, self.outlines)

    @cached_property
    def support_points(self) -> Array:
        """Points (k, 3) of the support where wires, roots of blades and springs are attached, m."""
        return _support_points(self)

    def points(self, view: View) -> Array:
        """Points (k, 2) in a view of everything that is drawn, except the support."""
        lines = [
            *geometry.sections(self.scene, self.pose, self.outlines, view),
            self.leaves.reshape(-1, 3),
            geometry.wire_ends(self.scene, self.pose).reshape(-1, 3),
            geometry.spring_points(self.scene, self.pose).reshape(-1, 3),
            *geometry.link_curves(self.design, self.scene, self.pose).values(),
            geometry.legs(self.scene, self.pose).reshape(-1, 3),
        ]
        return view.see(np.concatenate(lines))


def draw_suspension(canvas: Canvas, view: View, sketch: Sketch, look: Look) -> None:
    """Draw all bodies, wires, blades and springs."""
    scene, pose, outlines = sketch.scene, sketch.pose, sketch.outlines
    shapes = [view.see(line) for line in geometry.sections(scene, pose, outlines, view)]
    # a body behind or around another one must not hide it
    for n in sorted(range(len(shapes)), key=lambda n: -float(np.prod(np.ptp(shapes[n], axis=0)))):
        canvas.polygon(shapes[n], look.fill[n], look.edge[n], 1.3 * look.width, look.order)
        bore = outlines[n].bore(view.normal)
        if bore is not None:
            canvas.line(
                view.see(geometry.position_of(scene, pose, n + 1, bore)),
                look.edge[n],
                0.8 * look.width,
                look.order,
            )
    for n, line in geometry.brackets(scene, pose, outlines):
        canvas.line(view.see(line), look.edge[n], 2.2 * look.width, look.order + 0.1)
    for line in geometry.wire_ends(scene, pose):
        canvas.line(view.see(line), look.line, look.width, look.order + 0.2)
    _leaves(canvas, view.see(sketch.leaves), look)
    for leg in geometry.legs(scene, pose):
        _leg(canvas, view.see(leg), look)
    _springs(canvas, view, sketch, look)


def _leg(canvas: Canvas, line: Array, look: Look) -> None:
    """Draw a leg from its foot (2,) to its top: a thick bar between thin flexures."""
    foot, top = line
    ends = np.stack([foot + share * (top - foot) for share in (0.12, 0.94)])
    canvas.line(line, look.line, 1.2 * look.width, look.order + 0.2)
    canvas.line(ends, look.line, 4.5 * look.width, look.order + 0.25)


def _leaves(canvas: Canvas, lines: Array, look: Look) -> None:
    """Draw blades, tapered from root to tip, along lines (b, p, 2)."""
    along = np.gradient(lines, axis=1)
    norm = np.linalg.norm(along, axis=2, keepdims=True)
    across = np.stack([-along[..., 1], along[..., 0]], axis=2) / np.maximum(norm, 1e-12)
    half = np.linspace(2.0, 0.8, lines.shape[1])[:, None] * look.width / 72
    left, right = lines + half * across, (lines - half * across)[:, ::-1]
    for line, shape in zip(lines, np.concatenate([left, right], axis=1), strict=True):
        canvas.line(line, look.line, 1.2 * look.width, look.order + 0.3)
        canvas.polygon(shape, look.line, "none", 0.0, look.order + 0.3)


def _springs(canvas: Canvas, view: View, sketch: Sketch, look: Look) -> None:
    """Draw springs as zigzags at their points, with dotted lines to the bodies above.

    Dampers are pistons, links of curved wires are curves, and springs on the ground have hatched
    feet.
    """
    scene, pose = sketch.scene, sketch.pose
    unit = 0.022 * suspension_size(scene) * view.scale
    curves = geometry.link_curves(sketch.design, scene, pose)
    drawn = geometry.free_springs(scene)
    taken = [*view.see(scene.bodies.position + pose.shift)]
    for number, pair in zip(drawn, geometry.spring_points(scene, pose), strict=True):
        springs = scene.springs
        curve, grounded = curves.get(springs.label[number]), springs.grounded[number]
        upper, lower = view.see(pair[0]), view.see(pair[1])
        if curve is not None:
            canvas.line(view.see(curve), look.line, 0.9 * look.width, look.order + 0.35)
            if grounded:
                _foot(canvas, view.see(curve[-1]), unit, look)
            continue
        middle = (lower + upper) / 2
        while (np.abs(np.array(taken) - middle).max(1) < unit).any():  # beside what is there
            middle = middle + np.array([2.6 * unit, 0.0])
        taken.append(middle)
        if grounded:
            far = upper
            _foot(canvas, middle - np.array([0.0, 1.6 * unit]), unit, look)
        else:
            body = springs.upper[number]
            held = geometry.position_of(scene, pose, body, np.zeros(3))
            if body == 0:
                held = np.array([*pair[0, :2], held[2]])
            far = view.see(held)
        if np.linalg.norm(far - upper) > 3 * unit:
            canvas.line(
                np.stack([far, upper]), look.line, 0.8 * look.width, look.order + 0.25, (0, (1, 2))
            )
        across, up = DASHPOT if springs.label[number].endswith(".damper") else ZIGZAG
        sign = middle + unit * np.stack([across, up], axis=1)
        if np.linalg.norm(upper - lower) > unit:
            sign = np.vstack([lower, sign, upper] if lower[1] < upper[1] else [upper, sign, lower])
        canvas.line(sign, look.line, 1.3 * look.width, look.order + 0.4)


def _foot(canvas: Canvas, point: Array, unit: float, look: Look) -> None:
    """Draw the ground under a point of the picture: a hatched bar."""
    left, right = point - np.array([1.4 * unit, 0.0]), point + np.array([1.4 * unit, 0.0])
    canvas.line(np.stack([left, right]), NOTE, 1.2, look.order + 0.4)
    for part in np.linspace(0, 1, 5):
        start = left + part * (right - left)
        canvas.line(np.stack([start, start - 0.6 * unit]), NOTE, 0.6, look.order + 0.4)


def _support_points(sketch: Sketch) -> Array:
    scene, wires = sketch.scene, sketch.scene.wires
    direct = (wires.upper == 0) & (wires.blade < 0)
    points = [wires.upper_point[direct], np.zeros((0, 3))]
    points += [
        line[:1] for line, body in zip(sketch.leaves, scene.blades.body, strict=True) if body == 0
    ]
    free = geometry.free_springs(scene)
    held = free[(scene.springs.upper[free] == 0) & ~scene.springs.grounded[free]]
    points.append(scene.springs.upper_point[held] * (1, 1, 0))
    points.append(scene.struts.upper_point[scene.struts.upper == 0])
    found = np.concatenate(points)
    return found if len(found) else np.zeros((1, 3))


def support_box(sketch: Sketch) -> tuple[Array, Array]:
    """Opposite corners (3,), (3,) of the support in the drawing, m.

    It is above everything attached to it, or below what stands on it; the first corner's z is on
    the side of the attachments.
    """
    points = sketch.support_points
    low, high = points.min(0) - 2 * sketch.thick, points.max(0) + 2 * sketch.thick
    scene = sketch.scene
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
        corner, (wide, tall) = _plate(view, low, high)
        frame = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]) * (wide, tall)
        canvas.line(corner + frame, NOTE, 0.6, 0.5)
        for shift in np.arange(-wide, tall, (wide + tall) / 12)[1:]:
            ends = np.array([max(-shift, 0.0), min(wide, tall - shift)])
            canvas.line(corner + np.column_stack([ends, ends + shift]), PALE, 0.6, 0.5)
        return
    points = np.unique(sketch.support_points, axis=0)
    points = points[np.abs(points[:, 2] - low[2]) > 1e-9]
    for post in view.see(np.stack([points, points * (1, 1, 0) + (0, 0, low[2])], axis=1)):
        canvas.line(post, NOTE, 1.4, 0.6)
    (left, foot), (right, top) = view.see(low), view.see(high)
    canvas.line([[left, foot], [right, foot]], NOTE, 1.4, 0.7)
    tall = abs(top - foot)
    for start in np.linspace(left, right, max(round((right - left) / tall), 3) + 1)[:-1]:
        canvas.line([[start, foot], [start + tall, top]], NOTE, 0.6, 0.5)


def _plate(view: View, low: Array, high: Array) -> tuple[Array, Array]:
    """Lower left corner (2,) and size (2,) of the support in the view from above."""
    corner, opposite = view.see([high[0], low[1], low[2]]), view.see([low[0], high[1], low[2]])
    return corner, opposite - corner


def draw_com_mark(canvas: Canvas, where: Array, radius: float, colour: ColorType) -> None:
    """Draw the quartered circle of a centre of mass, at a point (2,) of the picture."""
    angle = np.linspace(0, np.pi / 2, 13)
    quarter = np.vstack([[0.0, 0.0], np.column_stack([np.cos(angle), np.sin(angle)])])
    whole = np.linspace(0, 2 * np.pi, 37)
    canvas.polygon(
        where + radius * np.column_stack([np.cos(whole), np.sin(whole)]), "white", colour, 0.6, 6
    )
    for side in (1, -1):
        canvas.polygon(where + side * radius * quarter, colour, "none", 0.0, 6.1)
