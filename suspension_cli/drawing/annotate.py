"""Dimensions, names and numbers in the drawing of a suspension, in inches on one canvas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from suspension_cli.design.derive import SetGeometry, set_geometry
from suspension_cli.design.schema import Stage
from suspension_cli.drawing.canvas import Canvas
from suspension_cli.drawing.dimensions import (
    HEAD,
    SIZE,
    draw_dimension,
    draw_dot,
    draw_extension,
    draw_leader,
    width_of,
    write_note,
)
from suspension_cli.drawing.geometry import View, wire_ends
from suspension_cli.drawing.labels import spread
from suspension_cli.drawing.parts import Sketch, support_box
from suspension_cli.drawing.style import NOTE, PALE, length, shorten, single_line
from suspension_cli.scene.arrays import Array

LEAST_ROOM = 0.25
"""Free height between two bodies that is enough for one dimension line, in."""
MOST_CLEARANCE = 0.4
"""Largest distance of a wire from its length's dimension line, in."""
LINE = 0.115
"""Height of a line of small text, in."""
MANY = 12
"""Number of bodies above which names are written into the bodies, without masses and numbers of
wires, which the tables list."""


@dataclass(frozen=True)
class Plan:
    """The two views of a drawing, placed on its canvas (in).

    Attributes
    ----------
    left
        Right end of the leaders' texts, left of the side view.
    right
        Position of the total height's dimension, right of the face view.
    names
        Left end of the bodies' names, between the views.
    """

    sketch: Sketch
    side: View
    face: View
    left: float
    right: float
    names: float


@dataclass(frozen=True)
class _Set:
    """A symmetric set of wires and the space around it.

    Attributes
    ----------
    above, below : (3,) arrays
        The two COMs, m.
    top, bottom
        Bounds in z of the free space between the bodies, m.
    halves : (float, float)
        Half widths in y of the two bodies, m; 0 for the support.
    """

    shape: SetGeometry
    above: Array
    below: Array
    top: float
    bottom: float
    halves: tuple[float, float]


def draw_dimensions(canvas: Canvas, plan: Plan) -> None:
    """Draw the dimensions of symmetric sets for which there is room; a table lists them all."""
    labels: list[tuple[Array, str]] = []
    parents = [
        _parent(plan.sketch, n, stage) for n, stage in enumerate(plan.sketch.design.stage, 1)
    ]
    for n, (stage, parent) in enumerate(zip(plan.sketch.design.stage, parents, strict=True), 1):
        if stage.wires is None or parents.count(parent) > 1:
            continue  # the lines of bodies that hang from the same one would overlap
        here = _set(plan.sketch, stage, parent, n)
        _separations(canvas, plan, here)
        _wire_length(canvas, plan, here)
        labels += _heights(canvas, plan.side, here)
    for (target, text), y in zip(
        labels, spread([float(target[1]) for target, _ in labels], LINE), strict=True
    ):
        draw_leader(canvas, plan.left, y, target, text)
    _total(canvas, plan)


def _parent(sketch: Sketch, number: int, stage: Stage) -> int:
    """Number of the body from which a stage hangs; 0 is the support."""
    if stage.hangs_from is None:
        return number - 1
    names = sketch.scene.bodies.name
    return names.index(stage.hangs_from) + 1 if stage.hangs_from in names else 0


def _set(sketch: Sketch, stage: Stage, parent: int, number: int) -> _Set:
    assert stage.wires is not None
    shape, position = set_geometry(stage.wires), sketch.scene.bodies.position
    above, below = position[parent], position[number]
    upper = sketch.outlines[parent - 1].half if parent else np.zeros(3)
    lower = sketch.outlines[number - 1].half
    top = float(above[2]) - max(shape.d_upper, float(upper[2]))
    bottom = float(below[2]) + max(shape.d, float(lower[2]))
    return _Set(shape, above, below, top, bottom, (float(upper[1]), float(lower[1])))


def _separations(canvas: Canvas, plan: Plan, here: _Set) -> None:
    """Draw s in the side view, t1 and t2 in the face view, in the space between the bodies."""
    shape, face, side = here.shape, plan.face, plan.side
    room = face.scale * (here.top - here.bottom)
    if room < LEAST_ROOM or shape.count == 1 or shape.is_ring:
        return
    symbols = ("$t_1$", "$t_2$", "$t_1$ = $t_2$")
    _pair(canvas, face, here, 1, (shape.t1, shape.t2), symbols, room)
    if shape.count == 4:
        _pair(canvas, side, here, 0, (shape.s_upper, shape.s_lower), ("$s$", "$s$", "$s$"), room)


def _pair(
    canvas: Canvas,
    view: View,
    here: _Set,
    axis: int,
    halves: tuple[float, float],
    symbols: tuple[str, str, str],
    room: float,
) -> None:
    """Draw the half separations at the upper and lower ends; equal ones as one."""
    upper, lower = halves
    top, bottom = float(here.above[2]) - here.shape.d_upper, float(here.below[2]) + here.shape.d
    inset = min(0.16, room / 3) / view.scale
    middle = (here.top + here.bottom) / 2
    if upper == lower:
        _across(canvas, view, here, axis, (middle, middle), (upper, upper), symbols[2])
        return

    def wire(level: float) -> float:
        return float(np.interp(level, [bottom, top], [lower, upper]))

    level = here.top - inset
    _across(canvas, view, here, axis, (level, top), (upper, wire(level)), symbols[0])
    if room > 2 * LEAST_ROOM or upper == 0:
        level = here.bottom + inset
        _across(canvas, view, here, axis, (level, bottom), (lower, wire(level)), symbols[1])


def _across(
    canvas: Canvas,
    view: View,
    here: _Set,
    axis: int,
    levels: tuple[float, float],
    halves: tuple[float, float],
    symbol: str,
) -> None:
    """Draw a half separation from the axis outwards.

    `levels` are the heights of its dimension line and of the wires' ends (m). `halves` are the half
    separation and that of the wires at the dimension line (m), which the text avoids.
    """
    half, wire = halves
    if half == 0:
        return
    inner = np.array([*here.below[:2], levels[0]])
    outer = inner + half * np.eye(3)[axis]
    a, b, end = view.see(inner), view.see(outer), view.see(np.array([*outer[:2], levels[1]]))
    draw_extension(canvas, end, b)
    draw_dimension(canvas, a, b, f"{symbol} = {length(half)}", view.scale * (wire - half))


def _wire_length(canvas: Canvas, plan: Plan, here: _Set) -> None:
    """Draw l beside the wire at -y in the face view, if the wire is long enough on paper.

    Its text is between the two bodies, or below a support between them.
    """
    shape, view, ground = here.shape, plan.face, float(support_box(plan.sketch)[1][2])
    top = ground if here.bottom < ground < here.top else here.top
    free = view.see(np.array([0.0, 0.0, (top + here.bottom) / 2]))[1]
    upper = view.see(here.above - np.array([0.0, shape.t1, shape.d_upper]))
    lower = view.see(here.below + np.array([0.0, -shape.t2, shape.d]))
    span = lower - upper
    size = float(np.linalg.norm(span))
    out = _clearance(view.scale, here) * np.array([span[1], -span[0]]) / size
    texts = [f"$l$ = {length(shape.length)}", length(shape.length)]
    fitting = [text for text in texts if width_of(text) + 3 * HEAD < size]
    if not fitting:
        return
    free_of_bodies = [text for text in fitting if width_of(text) < view.scale * (top - here.bottom)]
    draw_extension(canvas, upper, upper + out)
    draw_extension(canvas, lower, lower + out)
    place = float((free - lower[1] - out[1]) / (upper[1] - lower[1] or 1.0))
    text = (free_of_bodies or fitting)[0]
    draw_dimension(canvas, lower + out, upper + out, text, place=place)


def _clearance(scale: float, here: _Set) -> float:
    """Distance of a wire from its dimension line, in: clear of both bodies if these are near."""
    ends = zip(here.halves, (here.shape.t1, here.shape.t2), strict=True)
    wanted = [0.17, *(scale * (half - t) + 0.13 for half, t in ends)]
    return max(value for value in wanted if value <= MOST_CLEARANCE)


def _heights(canvas: Canvas, view: View, here: _Set) -> list[tuple[Array, str]]:
    """Targets and texts of the leaders for d and d_u; draws arrows too if they are long enough."""
    shape, leaders = here.shape, []
    ends = (
        (here.above, -shape.s_upper, -shape.d_upper, shape.d_upper, "$d_u$"),
        (here.below, -shape.s_lower, shape.d, shape.d, "$d$"),
    )
    for centre, x, z, value, symbol in ends:
        if value == 0:
            continue
        level = view.see(centre + np.array([x, 0.0, 0.0]))
        end = view.see(centre + np.array([x, 0.0, z]))
        if float(np.linalg.norm(end - level)) > 3 * HEAD:
            draw_extension(canvas, view.see(centre), level)
            draw_dimension(canvas, level, end, "")
            end = (level + end) / 2
        leaders.append((end, f"{symbol} = {length(value)}"))
    return leaders


def _total(canvas: Canvas, plan: Plan) -> None:
    """Draw the height from the suspension point to the lowest body."""
    sketch, view = plan.sketch, plan.face
    positions = sketch.scene.bodies.position[1:]
    bottoms = [
        float(position[2] - body.half[2])
        for position, body in zip(positions, sketch.outlines, strict=True)
    ]
    lowest, box = int(np.argmin(bottoms)), support_box(sketch)
    top, bottom = view.see(np.zeros(3)), view.see(np.array([0.0, 0.0, min(bottoms)]))
    if float(top[1] - bottom[1]) < 4 * HEAD:
        return
    half = np.array([0.0, float(sketch.outlines[lowest].half[1]), 0.0])
    edges = (view.see(box[1])[0], top[1]), (view.see(positions[lowest] + half)[0], bottom[1])
    for x, y in edges:
        draw_extension(canvas, [x + 0.04, y], [plan.right, y])
    draw_dimension(canvas, [plan.right, bottom[1]], [plan.right, top[1]], length(-min(bottoms)))


def draw_axes_of_symmetry(canvas: Canvas, plan: Plan) -> None:
    """Draw a dash-dotted line through the two bodies of each symmetric set."""
    position = plan.sketch.scene.bodies.position
    for n, stage in enumerate(plan.sketch.design.stage, 1):
        if stage.wires is not None:
            line = np.stack([position[_parent(plan.sketch, n, stage)], position[n]])
            for view in (plan.side, plan.face):
                canvas.line(view.see(line), PALE, 0.5, 1.9, (0, (8, 2, 1, 2)))


def write_names(canvas: Canvas, plan: Plan, colours: tuple[str, ...]) -> None:
    """Write each body's name and mass between the views, with a line to the body in the side view.

    If another body obstructs that line, they are inside the body. Of many bodies only names are
    written, inside where there is room.
    """
    bodies, boxes = plan.sketch.scene.bodies, _boxes(plan)
    names = [single_line(name, 18) for name in bodies.name]
    many = len(boxes) > MANY
    beside: list[int] = []
    for n, box in enumerate(boxes):
        x, y = box.mean(1).tolist()
        if many and _fits(box, 1.2 * width_of(names[n]), LINE):
            _name(canvas, names[n], (box[0, 0] + 0.05, y - LINE / 2), colours[n])
        elif not many and _hidden(boxes, n) and _fits(box, 1.25 * width_of(bodies.name[n]), 0.9):
            _name(canvas, names[n], (x, y - 0.23), colours[n], bodies.mass[n], "center")
        else:
            beside.append(n)
    levels = [float(boxes[n][1].mean()) for n in beside]
    for n, y in zip(beside, spread(levels, (1.1 if many else 2.1) * LINE), strict=True):
        edge = np.array([boxes[n][0, 1], boxes[n][1].mean()])
        canvas.line([edge, [plan.names - 0.16, y], [plan.names - 0.04, y]], colours[n], 0.5, 5)
        draw_dot(canvas, edge, colours[n])
        if many:
            _name(canvas, names[n], (plan.names, y - LINE / 2), colours[n])
        else:
            _name(canvas, names[n], (plan.names, y + 0.01), colours[n], bodies.mass[n])


def _name(
    canvas: Canvas,
    name: str,
    where: tuple[float, float],
    colour: str,
    mass: float | None = None,
    side: str = "left",
) -> None:
    """Write the name of a body above a point, and below its mass (kg) if it is given."""
    x, y = where
    canvas.text(x, y, name, fontsize=6.5, color=colour, fontweight="bold", va="bottom", ha=side)
    if mass is not None:
        text = f"{float(mass):.4g} kg"
        canvas.text(x, y - 0.02, text, fontsize=SIZE, color=NOTE, va="top", ha=side)


def _boxes(plan: Plan) -> list[Array]:
    """Bounds (2, 2) of each body in the side view, in: ((left, right), (bottom, top))."""
    positions = plan.sketch.scene.bodies.position[1:]
    return [
        plan.side.see(np.stack([position - body.half, position + body.half])).T
        for position, body in zip(positions, plan.sketch.outlines, strict=True)
    ]


def _hidden(boxes: list[Array], n: int) -> bool:
    """Whether another body lies between a body's right edge and the names."""
    (_, right), level = boxes[n][0], boxes[n][1].mean()
    return any(
        m != n and box[0, 0] >= right and box[1, 0] < level < box[1, 1]
        for m, box in enumerate(boxes)
    )


def _fits(box: Array, width: float, height: float) -> bool:
    """Whether a text of a size (in) fits into a body."""
    wide, tall = np.ptp(box, axis=1)
    return bool(wide > width + 0.1 and tall > height)


def write_numbers(canvas: Canvas, plan: Plan) -> None:
    """Write the numbers of wires of stages without a symmetric set, at the middle of each.

    Wires that hide each other share a label. Of many bodies none is written.
    """
    if len(plan.sketch.design.stage) > MANY:
        return
    for view in (plan.side, plan.face):
        taken: list[tuple[Array, float]] = []
        for where, text in _numbered(plan.sketch, view):
            wide = width_of(text)
            if all(
                abs(where[1] - y) > LINE or abs(where[0] - x) > (wide + other) / 2 + 0.04
                for (x, y), other in taken
            ):
                taken.append((where, wide))
                write_note(canvas, where, text)


def _numbered(sketch: Sketch, view: View) -> list[tuple[Array, str]]:
    """Middles of these wires in a view, and the numbers of the wires there."""
    explicit = {stage.name for stage in sketch.design.stage if stage.wires is None}
    middle = view.see(wire_ends(sketch.scene, sketch.pose).mean(1))
    groups: list[tuple[Array, list[str]]] = []
    for where, label in zip(middle, sketch.scene.wires.label, strict=True):
        stage, _, number = label.rpartition(".")
        if stage in explicit:
            near = [
                members for place, members in groups if float(np.abs(place - where).max()) < 0.1
            ]
            if near:
                near[0].append(number)
            else:
                groups.append((where, [number]))
    return [(where, shorten(", ".join(dict.fromkeys(members)), 12)) for where, members in groups]
