"""Drawing of a design to scale, side on and face on, with its dimensions and imperfections."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from suspension_cli.design.schema import Design
from suspension_cli.drawing import annotate, panels, parts, style, tables
from suspension_cli.drawing.annotate import Plan, write_note
from suspension_cli.drawing.canvas import Canvas, full_canvas
from suspension_cli.drawing.geometry import (
    FACE,
    SIDE,
    Sketch,
    Stroke,
    sketch_at_rest,
)
from suspension_cli.drawing.parts import Look
from suspension_cli.drawing.style import INK, NOTE, PALE
from suspension_cli.equilibrium import nominal
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.rotations import rotation_matrix
from suspension_cli.scene.arrays import Array
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
SUPPORT = 0.025
"""Thickness of the support over the size of the suspension."""
TICK = 0.27
"""Least distance between ticks, in."""
KEY = 0.12
"""Height of a line of the key, in."""
LOWEST = 4.0
"""Height of the views that long tables leave to them, in."""
LARGEST_SHIFT = 0.15
"""Largest displacement by imperfections, as a fraction of the suspension's size."""
FACTORS = tuple(m * 10.0**n for n in range(-2, 9) for m in (1, 2, 5))
"""Factors of exaggeration; below 1 where imperfections are larger than a drawing can show."""
NOTHING = 1e-12
"""Displacement over the suspension's size below which nothing is drawn."""


def draw(design: Design, scene: Scene, tabulate: bool = True) -> Figure:
    """Draw a suspension to scale, optionally with tables of dimensions and the key below.

    Side view (x-z) and face view (y-z) have one scale in metres, with names, masses and the
    dimensions for which there is room. The tables have the dimensions of every stage and of every
    wire outside symmetric sets. Imperfections are drawn exaggerated by a factor that the heading
    gives, in front of the design without them in grey; dimensions are without them. The scene has
    no imperfections or batch axes.
    """
    with style.house_style():
        sketch = sketch_at_rest(design, scene, SUPPORT)
        shown, factor = exaggerate(sketch)
        low, high = _bounds(sketch, shown)
        inner = style.PAGE_WIDTH - 2 * MARGIN
        listed = tables.listed(design, scene) if tabulate else []
        key = tables.key(scene) if tabulate else []
        below = FOOT + sum(table.height + 0.1 for table in listed) + KEY * len(key) + 0.1
        names = 0.42 + 0.068 * min(max(len(name) for name in scene.bodies.name), 18)
        beside = SCALE + LEADERS + names + LENGTHS + RIGHT
        wide, deep, tall = high - low
        room = max(style.PAGE_HEIGHT - TOP - below, LOWEST)
        scale = min((inner - beside) / max(wide + deep, 1e-9), room / max(tall, 1e-9))
        left = MARGIN + SCALE + LEADERS + (inner - beside - scale * (wide + deep)) / 2
        face = left + scale * wide + names + LENGTHS
        foot = below - scale * low[2]
        plan = Plan(
            sketch=sketch,
            side=SIDE.at((left - scale * low[0], foot), scale),
            face=FACE.at((face - scale * low[1], foot), scale),
            left=left - 0.16,
            right=face + scale * deep + RIGHT - 0.2,
            names=left + scale * wide + 0.32,
        )
        figure = style.new_figure(style.PAGE_WIDTH, TOP + scale * tall + below)
        remark = ""
        if factor:
            size = f"{factor:,.6g} times larger" if factor != 1 else "to scale"
            remark = f"; imperfections {size} (grey: without)"
        name = design.design.title or design.design.name
        panels.write_heading(figure, "Dimensions, to scale" + remark, name)
        canvas = full_canvas(figure)
        _views(canvas, plan, shown, is_displaced=factor is not None)
        _axes(figure, plan, low, high)
        colours = tuple(style.stage_colours(scene.bodies.name).values())
        top = below - FOOT
        for n, table in enumerate(listed):
            tables.write(canvas, MARGIN, top, inner, table, () if n else colours)
            top -= table.height + 0.1
        for n, line in enumerate(key):
            canvas.text(MARGIN, top - n * KEY, line, fontsize=tables.SIZE, color=NOTE, va="top")
        canvas.flush()
        return figure


Strokes = dict[int, list[Stroke]]
"""Strokes of a suspension by the axis of the view."""


def exaggerate(sketch: Sketch) -> tuple[Strokes, float | None]:
    """Displace the strokes of a sketch by its imperfections, times the factor that shows them well.

    A point at n in the drawn design, at p in its equilibrium and at q in that of the imperfect one,
    is drawn at n + f (q - p), with one factor f for all. The `sketch` is without imperfections, at
    rest. The factor is None if nothing is displaced.
    """
    still = {view.normal: sketch.strokes(view.normal) for view in (SIDE, FACE)}
    if not sketch.design.perturbation:
        return still, None
    scenes = sketch.scene, nominal.expand(sketch.design)
    found = [equilibrium.solve(scene) for scene in scenes]
    poses = [
        one.pose if found[0].converged and found[1].converged else sketch.pose for one in found
    ]
    turns = dict.fromkeys(sketch.scene.bodies.name, np.zeros(3))
    for item in sketch.design.perturbation:
        if item.body in turns and item.rotation is not None:
            turns[item.body] = turns[item.body] + item.rotation
    pairs = zip(sketch.outlines, turns.values(), strict=True)
    turned = [replace(body, turn=rotation_matrix(turn)) for body, turn in pairs]
    before = replace(sketch, scene=scenes[0], pose=poses[0])
    after = replace(sketch, scene=scenes[1], pose=poses[1], outlines=turned)
    change = {
        normal: [
            last.points - first.points
            for first, last in zip(before.strokes(normal), after.strokes(normal), strict=True)
        ]
        for normal in still
    }
    moved = np.concatenate([line for lines in change.values() for line in lines])
    largest = float(np.abs(moved).max()) / sketch.size
    if largest <= NOTHING:
        return still, None
    factor = max((one for one in FACTORS if one * largest <= LARGEST_SHIFT), default=FACTORS[0])
    return {
        normal: [
            replace(line, points=line.points + factor * moved)
            for line, moved in zip(lines, change[normal], strict=True)
        ]
        for normal, lines in still.items()
    }, factor


def _bounds(sketch: Sketch, shown: Strokes) -> tuple[Array, Array]:
    """Bounds (3,), (3,) of everything that is drawn, including the support, m."""
    strokes = [*sketch.strokes(0), *sketch.strokes(1), *shown[0], *shown[1]]
    points = np.concatenate([*(one.points for one in strokes), parts.support_box(sketch)])
    return points.min(0), points.max(0)


def _views(canvas: Canvas, plan: Plan, shown: Strokes, *, is_displaced: bool) -> None:
    """Draw the suspension in both views, and its dimensions, names and numbers."""
    sketch, scene = plan.sketch, plan.sketch.scene
    colours = tuple(style.stage_colours(scene.bodies.name).values())
    look = Look(colours, tuple((colour, 0.13) for colour in colours), INK, 0.9, 2)
    grey = (PALE,) * len(colours)
    still = Look(grey, ((PALE, 0.2),) * len(colours), PALE, 0.9, 1)
    flawed = dict.fromkeys(item.wire for item in sketch.design.perturbation if item.wire)
    for view in (plan.side, plan.face):
        parts.draw_support(canvas, view, sketch)
        strokes = shown[view.normal]
        if is_displaced:
            parts.draw_suspension(canvas, view, sketch, still)
        parts.draw_suspension(canvas, view, sketch, look, strokes)
        wires = [view.see(one.points) for one in strokes if one.kind == "wire"]
        for name in flawed:  # thick, with the number three quarters down
            line = wires[scene.wires.label.index(name)]
            canvas.line(line, INK, 2.0, look.order + 0.5)
            write_note(canvas, 0.25 * line[0] + 0.75 * line[1], name.rpartition(".")[2])
        for one in strokes:
            if one.kind == "body":
                middle = view.see(one.points[:-1].mean(0))
                parts.draw_com_mark(canvas, middle, 0.042, colours[one.body])
    annotate.draw_axes_of_symmetry(canvas, plan)
    annotate.draw_dimensions(canvas, plan)
    annotate.write_names(canvas, plan, colours)
    annotate.write_numbers(canvas, plan)


def _axes(figure: Figure, plan: Plan, low: Array, high: Array) -> None:
    """Draw scales in m, heights at the left, x and y below, and the names of the views above."""
    across, up = figure.get_size_inches()
    highest = float(max(0.0, *(one.points[:, 2].max() for one in plan.sketch.strokes(1))))
    for view in (plan.side, plan.face):
        axis = 1 - view.normal
        (left, bottom), (right, top) = view.see(low), view.see(high)
        axes = style.add_axes(figure, left, up - top, right - left, top - bottom)
        limits = {"xlim": (low[axis], high[axis]), "ylim": (low[2], high[2])}
        axes.set(facecolor="none", xlabel=f"{'xy'[axis]} (m)", zorder=-1, **limits)
        axes.spines["bottom"].set_position(("outward", 8))
        axes.set_xticks(_ticks(low[axis], high[axis], view.scale))
        figure.text(
            (left + right) / 2 / across,
            (top + 0.13) / up,
            view.name.upper(),
            ha="center",
            fontsize=8,
            fontweight="bold",
        )
        if view is plan.side:
            axes.spines["left"].set_bounds(low[2], highest)
            axes.spines["left"].set_position(("outward", 72 * LEADERS))
            axes.set_yticks(_ticks(low[2], highest, view.scale))
            axes.set_ylabel("z (m)")
        else:
            axes.spines["left"].set_visible(False)
            axes.yaxis.set_visible(False)


def _ticks(low: float, high: float, scale: float) -> list[float]:
    """Round values between two bounds, m, at least `TICK` apart at a scale in in/m."""
    count = max(int(scale * (high - low) / TICK), 1)
    values = MaxNLocator(count, steps=[1, 2, 5, 10], min_n_ticks=1).tick_values(low, high)
    return [float(value) for value in values if low - 1e-9 <= value <= high + 1e-9]
