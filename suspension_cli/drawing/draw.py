"""Drawing of a design to scale, side on and face on, with its dimensions and imperfections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from suspension_cli.design.derive import (
    SetGeometry,
    origin_positions,
    set_geometry,
    with_bodies_above,
)
from suspension_cli.design.locked_stages import title_of
from suspension_cli.design.schema import Design
from suspension_cli.drawing import dimension_tables, labels, parts, style
from suspension_cli.drawing.dimension_tables import SIZE, separation
from suspension_cli.drawing.geometry import FACE, SIDE, Sketch, Stroke, View, sketch_at_rest
from suspension_cli.drawing.labels import spread
from suspension_cli.drawing.parts import Canvas, Look, full_canvas
from suspension_cli.drawing.style import INK, NOTE, PALE, length, shorten, single_line
from suspension_cli.equilibrium import nominal
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.rotations import rotation_matrix
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.scene import Scene

MARGIN = 0.1
"""Margin around everything, in."""
TOP = 0.8
"""Height of the heading, in."""
FOOT = 0.55
"""Height of the horizontal axes, in."""
SCALE = 0.56
"""Width of the axis of heights, in."""
LEADERS = 0.8
"""Width of the dimensions left of the views, in."""
RIGHT = 1.2
"""Width of the dimensions right of the views, in."""
THICK = 0.025
"""Thickness of the support over the size of the suspension."""
TICK = 0.27
"""Least distance between ticks, in."""
LINE = 0.115
"""Height of a line of small text, in."""
LOWEST = 4.0
"""Height of the views that long tables leave to them, in."""
LARGEST_SHIFT = 0.15
"""Largest displacement by imperfections, as a fraction of the suspension's size."""
FACTORS = tuple(m * 10.0**n for n in range(-2, 9) for m in (1, 2, 5))
"""Factors of exaggeration; below 1 where imperfections are larger than a drawing can show."""
NOTHING = 1e-12
"""Displacement over the suspension's size below which nothing is drawn."""
MANY = 12
"""Number of bodies above which dimensions, masses and numbers of wires, which the tables list, are
left out."""
ORDER = 7.0
"""Order of dimensions on the canvas: above everything else."""

Strokes = dict[int, list[Stroke]]
"""Strokes of a suspension by the axis of the view."""


@dataclass(frozen=True)
class Plan:
    """The two views of a drawing, placed on its canvas (in).

    Columns of text end at `left` of the side view, and begin at `right` of the face view and at
    `names` between the views.
    """

    sketch: Sketch
    side: View
    face: View
    left: float
    right: float
    names: float


def draw(design: Design, scene: Scene, tabulate: bool = True) -> Figure:
    """Draw a suspension to scale, optionally with tables of dimensions and the key below.

    Side view (x-z) and face view (y-z) have one scale in metres, with names, masses and the
    dimensions of symmetric sets of wires. The tables have the dimensions of every stage and of
    every wire outside symmetric sets. Imperfections are drawn exaggerated by a factor that the
    heading gives, in front of the design without them in grey; dimensions are without them. The
    scene has no imperfections or batch axes.
    """
    with style.house_style():
        sketch = sketch_at_rest(design, scene, THICK)
        shown, factor = exaggerate(sketch)
        low, high = _extent(sketch, shown)
        listed = dimension_tables.listed(design, scene) if tabulate else []
        key = dimension_tables.key(design, scene) if tabulate else []
        below = FOOT + sum(table.height + 0.1 for table in listed) + LINE * len(key) + 0.1
        plan, scale = _plan(sketch, low, high, below)
        figure = style.new_figure(style.PAGE_WIDTH, TOP + scale * (high - low)[2] + below)
        style.write_heading(figure, _heading(factor), title_of(design))
        canvas = full_canvas(figure)
        colours = tuple(style.stage_colours(scene.bodies.name).values())
        _draw_views(canvas, plan, shown, colours, is_displaced=factor is not None)
        _write_dimensions(canvas, plan)
        _write_names(canvas, plan, colours)
        _write_numbers(canvas, plan)
        _draw_axes(figure, plan, low, high)
        top = below - FOOT
        inner = style.PAGE_WIDTH - 2 * MARGIN
        for n, table in enumerate(listed):
            dimension_tables.write(canvas, MARGIN, top, inner, table, () if n else colours)
            top -= table.height + 0.1
        for n, line in enumerate(key):
            canvas.text(MARGIN, top - n * LINE, line, fontsize=SIZE, color=NOTE, va="top")
        canvas.flush()
        return figure


def _extent(sketch: Sketch, shown: Strokes) -> tuple[Array, Array]:
    """Smallest and largest coordinates of all that is drawn, the support included, m."""
    strokes = [*sketch.strokes(0), *sketch.strokes(1), *shown[0], *shown[1]]
    points = np.concatenate([*(one.points for one in strokes), parts.support_box(sketch)])
    high = points.max(0)
    high[2] = max(high[2], 0.0)  # the suspension point, where heights begin
    return points.min(0), high


def _heading(factor: float | None) -> str:
    """Heading with the factor by which imperfections are exaggerated, if there are any."""
    if not factor:
        return "Dimensions, to scale"
    size = "to scale" if factor == 1 else f"{factor:,.6g} times larger"
    return f"Dimensions, to scale; imperfections {size} (grey: without)"


def _plan(sketch: Sketch, low: Array, high: Array, below: float) -> tuple[Plan, float]:
    """Place both views above what takes the height `below`, in; also their scale, in per m.

    From left to right: heights, leaders, side view, names of bodies, face view, dimensions.
    """
    names = 0.52 + 0.068 * min(max(len(name) for name in sketch.scene.bodies.name), 18)
    beside = SCALE + LEADERS + names + RIGHT
    inner = style.PAGE_WIDTH - 2 * MARGIN
    wide, deep, tall = high - low
    room = max(style.PAGE_HEIGHT - TOP - below, LOWEST)
    scale = min((inner - beside) / max(wide + deep, 1e-9), room / max(tall, 1e-9))
    left = MARGIN + SCALE + LEADERS + (inner - beside - scale * (wide + deep)) / 2
    face = left + scale * wide + names
    foot = below - scale * low[2]
    plan = Plan(
        sketch=sketch,
        side=SIDE.at((left - scale * low[0], foot), scale),
        face=FACE.at((face - scale * low[1], foot), scale),
        left=left - 0.16,
        right=face + scale * deep + 0.28,
        names=left + scale * wide + 0.32,
    )
    return plan, scale


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
    if all(one.converged for one in found):
        poses = [one.pose for one in found]
    else:
        poses = [sketch.pose] * 2
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


def _draw_views(
    canvas: Canvas, plan: Plan, shown: Strokes, colours: tuple[str, ...], *, is_displaced: bool
) -> None:
    """Draw the suspension in both views; imperfect wires thick, with their numbers."""
    sketch = plan.sketch
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
        for name in flawed:  # with the number three quarters down
            line = wires[sketch.scene.wires.label.index(name)]
            canvas.line(line, INK, 2.0, look.order + 0.5)
            _write_note(canvas, 0.25 * line[0] + 0.75 * line[1], name.rpartition(".")[2])
        marked = set[int]()
        for one in strokes:
            if one.kind == "body" and one.body not in marked:
                marked.add(one.body)
                first = sketch.outlines[one.body].shapes[0]
                middle = view.see(one.points[:-1].mean(0) - first.at)
                parts.draw_com_mark(canvas, middle, 0.042, colours[one.body])


def _write_dimensions(canvas: Canvas, plan: Plan) -> None:
    """Write the dimensions of symmetric sets beside the views, with leaders to a wire of each."""
    sketch = plan.sketch
    side = list[tuple[Array, str]]()
    face = list[tuple[Array, str]]()
    origin = {name: np.array(at) for name, at in origin_positions(sketch.design).items()}
    for stage, above in with_bodies_above(sketch.design):
        if stage.wires is None or len(sketch.design.stage) > MANY:
            continue
        shape = set_geometry(stage.wires)
        along, across = _dimension_texts(shape)
        upper = origin[above]
        lower = origin[stage.name]
        for view, column, own, wire in (
            (plan.side, side, along, -1),
            (plan.face, face, across, 0),
        ):
            first, last = (np.array(end) for end in shape.ends[wire])
            top = upper + np.array([*first, -shape.d_upper])
            bottom = lower + np.array([*last, shape.d])
            places = view.see([top, (top + bottom) / 2, bottom])
            column += [pair for pair in zip(places, own, strict=True) if pair[1]]
    _write_leaders(canvas, plan.left, side, "right")
    _write_leaders(canvas, plan.right, face, "left")


def _dimension_texts(shape: SetGeometry) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Texts at the upper end, middle and lower end of a wire, in side and in face view."""

    def text(symbol: str, value: float) -> str:
        return f"{symbol} = {length(value)}" if value else ""

    s = t1 = t2 = ""
    if shape.count == 4 and not shape.is_ring and (shape.s_upper or shape.s_lower):
        s = f"$s$ = {separation(shape.s_upper, shape.s_lower)} mm"
    if shape.count > 1 and not shape.is_ring:
        same = shape.t1 == shape.t2
        t1 = text("$t_1$ = $t_2$" if same else "$t_1$", shape.t1)
        t2 = "" if same else text("$t_2$", shape.t2)
    across = (t1, text("$l$", shape.length), t2)
    return (text("$d_u$", shape.d_upper), s, text("$d$", shape.d)), across


def _write_leaders(canvas: Canvas, x: float, notes: Sequence[tuple[Array, str]], side: str) -> None:
    """Write texts in a column that ends ("right") or begins at x, with lines to their targets."""
    out = 1 if side == "right" else -1
    # parts behind each other have the same notes
    places = {(text, *target.round(1).tolist()): (target, text) for target, text in notes}
    notes = [*places.values()]
    levels = spread([float(target[1]) for target, _ in notes], LINE)
    for (target, text), y in zip(notes, levels, strict=True):
        line = [[x + 0.02 * out, y], [x + 0.1 * out, y], target]
        canvas.line(line, NOTE, 0.4, ORDER - 0.1)
        _draw_dot(canvas, target)
        _write_note(canvas, (x, y), text, ha=side)


def _write_note(canvas: Canvas, where: Sequence[float] | Array, text: str, **how: Any) -> None:
    """Write text, hiding what is below it; centred on a point unless `how` says otherwise."""
    look = {"fontsize": SIZE, "color": NOTE, "ha": "center", "va": "center"}
    blank = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
    canvas.text(float(where[0]), float(where[1]), text, bbox=blank, **(look | how))


def _draw_dot(canvas: Canvas, where: Array, colour: str = NOTE) -> None:
    """Draw a small dot."""
    angle = np.linspace(0, 2 * np.pi, 13)
    circle = 0.016 * np.column_stack([np.cos(angle), np.sin(angle)])
    canvas.polygon(where + circle, colour, "none", 0.0, ORDER)


def _write_names(canvas: Canvas, plan: Plan, colours: tuple[str, ...]) -> None:
    """Write each body's name and mass between the views, with a line to it in the side view."""
    bodies = plan.sketch.scene.bodies
    outlines = plan.sketch.outlines
    many = len(outlines) > MANY
    places = zip(bodies.position[1:], outlines, strict=True)
    edges = [plan.side.see(position + body.half * (1, 0, 0)) for position, body in places]
    every = plan.sketch.points(plan.side)[:, 1]
    low = float(every.min())
    high = float(every.max())
    gap = min((1.1 if many else 2.1) * LINE, (high - low) / len(edges))
    levels = spread([float(edge[1]) for edge in edges], gap, low, high)
    blank = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}
    for n, (edge, y, colour) in enumerate(zip(edges, levels, colours, strict=True)):
        ends = [edge, [plan.names - 0.16, y], [plan.names - 0.04, y]]
        canvas.line(ends, colour, 0.5, 5)
        _draw_dot(canvas, edge, colour)
        look = {"fontsize": 6.5, "color": colour, "fontweight": "bold", "bbox": blank}
        name = single_line(bodies.name[n], 18)
        canvas.text(plan.names, y, name, va="center" if many else "bottom", **look)
        if not many:
            mass = f"{float(bodies.mass[n]):.4g} kg"
            canvas.text(plan.names, y - 0.01, mass, fontsize=SIZE, color=NOTE, va="top")


def _write_numbers(canvas: Canvas, plan: Plan) -> None:
    """Write the numbers of wires of stages without a symmetric set, at the middle of each.

    Wires that are close together share a label.
    """
    sketch = plan.sketch
    explicit = {stage.name for stage in sketch.design.stage if stage.wires is None}
    for view in (plan.side, plan.face) if len(sketch.design.stage) <= MANY else ():
        groups: list[tuple[Array, list[str]]] = []
        middle = view.see(sketch.wire_ends().mean(1))
        for where, label in zip(middle, sketch.scene.wires.label, strict=True):
            stage, _, number = label.rpartition(".")
            near = [own for place, own in groups if (np.abs(where - place) < LINE).all()]
            if stage in explicit and near:
                near[0].append(number)
            elif stage in explicit:
                groups.append((where, [number]))
        for where, numbers in groups:
            _write_note(canvas, where, shorten(", ".join(dict.fromkeys(numbers)), 12))


def _draw_axes(figure: Figure, plan: Plan, low: Array, high: Array) -> None:
    """Draw scales in m, heights at the left, x and y below, and the names of the views above."""
    across, up = figure.get_size_inches()
    highest = float(max(0.0, *(one.points[:, 2].max() for one in plan.sketch.strokes(1))))
    for view in (plan.side, plan.face):
        axis = 1 - view.normal
        left, bottom = view.see(low)
        right, top = view.see(high)
        axes = style.add_axes(figure, left, up - top, right - left, top - bottom)
        limits = {"xlim": (low[axis], high[axis]), "ylim": (low[2], high[2])}
        axes.set(facecolor="none", xlabel=f"{'xy'[axis]} (m)", zorder=-1, **limits)
        axes.spines["bottom"].set_position(("outward", 8))
        labels.thin_ticks(axes.xaxis)
        middle = (left + right) / 2 / across
        look = {"fontsize": 8, "fontweight": "bold"}
        figure.text(middle, (top + 0.13) / up, view.name.upper(), ha="center", **look)
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
