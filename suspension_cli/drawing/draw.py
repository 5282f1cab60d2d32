"""Drawing of a design to scale, side on and face on, with its dimensions."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.design.schema import Design
from suspension_cli.drawing import annotate, imperfect, panels, parts, style, tables
from suspension_cli.drawing.annotate import Plan
from suspension_cli.drawing.bodies import outlines
from suspension_cli.drawing.canvas import Canvas, full_canvas
from suspension_cli.drawing.geometry import FACE, SIDE, View
from suspension_cli.drawing.imperfect import Exaggerated
from suspension_cli.drawing.parts import Look, Sketch
from suspension_cli.drawing.style import INK, NOTE, PALE
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.pose import nominal_pose
from suspension_cli.scene.scene import Scene

MARGIN = 0.1
"""Margin around everything, in."""
TOP = 0.8
"""Height of the heading and the names of the views, in."""
SCALE = 0.56
"""Width of the axis of heights, in."""
LEADERS = 0.8
"""Width of the texts left of the side view, in."""
LENGTHS = 0.38
"""Width of the lengths of wires left of the face view, in."""
RIGHT = 1.15
"""Width of the dimensions right of the face view, in."""
FOOT = 0.55
"""Height of the horizontal axes, in."""
SUPPORT = 0.1
"""Thickness of the support, in."""
TICK = 0.36
"""Least distance between ticks, in."""
KEY = 0.12
"""Height of a line of the key, in."""
LOWEST = 4.0
"""Height of the views that long tables leave to them, in."""


@dataclass(frozen=True)
class _Bounds:
    """Bounds of the two views in m: (low, high) along x, y and z."""

    x: tuple[float, float]
    y: tuple[float, float]
    z: tuple[float, float]

    @property
    def width(self) -> float:
        return self.x[1] - self.x[0] + self.y[1] - self.y[0]

    @property
    def height(self) -> float:
        return self.z[1] - self.z[0]


def draw(design: Design, scene: Scene, tabulate: bool = True) -> Figure:
    """Draw a suspension to scale, optionally with tables of dimensions and the key below.

    Side view (x-z) and face view (y-z) have one scale in metres, with names, masses and the
    dimensions for which there is room. The tables have the dimensions of every stage and of every
    wire outside symmetric sets. Imperfections are drawn exaggerated by a factor that the heading
    gives, in front of the design without them in grey; dimensions are without them. The scene has
    no imperfections or batch axes.
    """
    with style.house_style():
        bare = Sketch(design, scene, outlines(design, scene), nominal_pose(scene), 0.0)
        flawed = imperfect.exaggerate(bare)
        bounds = _bounds(bare, flawed)
        inner = style.PAGE_WIDTH - 2 * MARGIN
        shown = [table.stretched(inner) for table in tables.listed(design, scene) if tabulate]
        key = tables.key(scene) if tabulate else []
        below = FOOT + sum(table.height + 0.1 for table in shown) + KEY * len(key) + 0.1
        beside = SCALE + LEADERS + _names(scene) + LENGTHS + RIGHT
        room = inner - beside, max(style.PAGE_HEIGHT - TOP - below, LOWEST)
        sketch = replace(bare, thick=SUPPORT / _scale(bounds, room))
        bounds = _bounds(sketch, flawed)
        scale = _scale(bounds, room)
        figure = style.new_figure(style.PAGE_WIDTH, TOP + scale * bounds.height + below)
        name = design.design.title or design.design.name
        panels.write_heading(figure, "Dimensions, to scale" + _remark(flawed), name)
        plan = _plan(
            figure, sketch, bounds, scale, MARGIN + (inner - beside - scale * bounds.width) / 2
        )
        canvas = full_canvas(figure)
        _views(canvas, plan, flawed)
        _axes(figure, plan, bounds)
        top = below - FOOT
        for table in shown:
            tables.write(canvas, MARGIN, top, table, _colours(scene) if table is shown[0] else ())
            top -= table.height + 0.1
        for line in key:
            canvas.text(MARGIN, top, line, fontsize=tables.SIZE, color=NOTE, va="top")
            top -= KEY
        canvas.flush()
        return figure


def _scale(bounds: _Bounds, room: tuple[float, float]) -> float:
    """Choose the scale, in/m, at which the views fit into a width and height, in."""
    return min(room[0] / max(bounds.width, 1e-9), room[1] / max(bounds.height, 1e-9))


def exaggeration(design: Design, scene: Scene) -> float | None:
    """Factor by which `draw` exaggerates imperfections; None if nothing is displaced."""
    bare = Sketch(design, scene, outlines(design, scene), nominal_pose(scene), 0.0)
    flawed = imperfect.exaggerate(bare)
    return flawed.factor if flawed else None


def _names(scene: Scene) -> float:
    """Width of the bodies' names between the views, in."""
    return 0.42 + 0.068 * min(max(len(name) for name in scene.bodies.name), 18)


def _remark(flawed: Exaggerated | None) -> str:
    """Say how much imperfections are exaggerated, for the heading."""
    if flawed is None:
        return ""
    size = f"{flawed.factor:,.6g} times larger" if flawed.factor != 1 else "to scale"
    return f"; imperfections {size} (grey: without)"


def _bounds(sketch: Sketch, flawed: Exaggerated | None) -> _Bounds:
    """Bounds of everything that is drawn, including the support."""
    box = np.array(parts.support_box(sketch))
    drawn = [sketch, *([flawed.sketch] if flawed else [])]
    side = np.concatenate([*(one.points(SIDE) for one in drawn), SIDE.see(box)])
    face = np.concatenate([*(one.points(FACE) for one in drawn), FACE.see(box)])

    def span(values: Array) -> tuple[float, float]:
        return float(values.min()), float(values.max())

    return _Bounds(
        span(side[:, 0]), span(face[:, 0]), span(np.concatenate([side[:, 1], face[:, 1]]))
    )


def _plan(figure: Figure, sketch: Sketch, bounds: _Bounds, scale: float, left: float) -> Plan:
    """Place the views on the sheet."""
    foot = float(figure.get_size_inches()[1]) - TOP - scale * bounds.z[1]
    start = left + SCALE + LEADERS
    side_end = start + scale * (bounds.x[1] - bounds.x[0])
    face_start = side_end + _names(sketch.scene) + LENGTHS
    return Plan(
        sketch=sketch,
        side=SIDE.at((start - scale * bounds.x[0], foot), scale),
        face=FACE.at((face_start - scale * bounds.y[0], foot), scale),
        left=start - 0.16,
        right=face_start + scale * (bounds.y[1] - bounds.y[0]) + RIGHT - 0.2,
        names=side_end + 0.32,
    )


def _colours(scene: Scene) -> tuple[str, ...]:
    return tuple(style.stage_colours(scene.bodies.name).values())


def _views(canvas: Canvas, plan: Plan, flawed: Exaggerated | None) -> None:
    colours = _colours(plan.sketch.scene)
    look = Look(colours, tuple(style.with_opacity(colour, 0.13) for colour in colours), INK, 0.9, 2)
    count = len(colours)
    still = Look((PALE,) * count, (style.with_opacity(PALE, 0.2),) * count, PALE, 0.9, 1)
    sketch = flawed.sketch if flawed else plan.sketch
    for view in (plan.side, plan.face):
        parts.draw_support(canvas, view, plan.sketch)
        if flawed:
            parts.draw_suspension(canvas, view, plan.sketch, still)
        parts.draw_suspension(canvas, view, sketch, look)
        if flawed:
            imperfect.draw_marks(canvas, view, flawed, look.order + 0.5)
        centres = sketch.scene.bodies.position + sketch.pose.shift
        for n, colour in enumerate(colours, 1):
            parts.draw_com_mark(canvas, view.see(centres[n]), 0.042, colour)
    annotate.draw_axes_of_symmetry(canvas, plan)
    annotate.draw_dimensions(canvas, plan)
    annotate.write_names(canvas, plan, colours)
    annotate.write_numbers(canvas, plan)


def _axes(figure: Figure, plan: Plan, bounds: _Bounds) -> None:
    """Draw scales in m, heights at the left, x and y below, and the names of the views above."""
    up = float(figure.get_size_inches()[1])
    tops = [
        position[2] + body.half[2]
        for position, body in zip(
            plan.sketch.scene.bodies.position[1:], plan.sketch.outlines, strict=True
        )
    ]
    highest = max(0.0, float(max(tops)))
    for view, (low, high), name in ((plan.side, bounds.x, "x"), (plan.face, bounds.y, "y")):
        left, bottom = view.see(_point(view, low, bounds.z[0]))
        right, top = view.see(_point(view, high, bounds.z[1]))
        axes = style.add_axes(figure, left, up - top, right - left, top - bottom)
        axes.set(xlim=(low, high), ylim=bounds.z, facecolor="none", xlabel=f"{name} (m)", zorder=-1)
        axes.spines["bottom"].set_position(("outward", 8))
        axes.set_xticks(*_ticks(low, high, TICK / view.scale))
        figure.text(
            (left + right) / 2 / figure.get_size_inches()[0],
            (top + 0.13) / up,
            view.name.upper(),
            ha="center",
            fontsize=8,
            fontweight="bold",
        )
        if view is plan.side:
            axes.spines["left"].set_bounds(bounds.z[0], highest)
            axes.spines["left"].set_position(("outward", 72 * LEADERS))
            axes.set_yticks(
                *_ticks(
                    bounds.z[0], highest, min(TICK / view.scale, 0.45 * (highest - bounds.z[0]))
                )
            )
            axes.set_ylabel("z (m)")
        else:
            axes.spines["left"].set_visible(False)
            axes.yaxis.set_visible(False)


def _point(view: View, across: float, up: float) -> Array:
    point = np.zeros(3)
    point[1 - view.normal], point[2] = across, up
    return point


def _ticks(low: float, high: float, least: float) -> tuple[Array, list[str]]:
    """Round values between two bounds, at least `least` apart, m, and their labels."""
    step = min(value for value in _round_numbers(least) if value >= least * (1 - 1e-9))
    values = step * np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1)
    near = min(-low, high)
    if len(values) < 2 and near > least / 2:
        # no room for a label at 0 between two others
        values = max(value for value in _round_numbers(near) if value <= near) * np.array(
            [-1.0, 1.0]
        )
    return values, [f"{value + 0.0:.6g}".replace("-", "−") for value in np.round(values, 12)]


def _round_numbers(about: float) -> list[float]:
    """1, 2 and 5 times the powers of ten around a positive number."""
    power = int(np.floor(np.log10(about)))
    return [factor * 10.0**n for n in (power - 1, power, power + 1) for factor in (1, 2, 5)]
