"""Which dimensions of a suspension stand in its drawing, and where: all positions in inches on one canvas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from suspension_cli.design.derive import SetGeometry, set_geometry
from suspension_cli.design.scene import Array
from suspension_cli.design.schema import Stage
from suspension_cli.plots.canvas import Canvas
from suspension_cli.plots.dimensions import HEAD, dimension, dot, extension, leader, note, spread, width_of
from suspension_cli.plots.geometry import View, wire_ends
from suspension_cli.plots.parts import Sketch, support_box
from suspension_cli.plots.style import NOTE, PALE, length, plain, shortened

LEAST_ROOM = 0.3
"""Free height between two bodies that takes one dimension line, in."""
MOST_CLEARANCE = 0.5
"""Largest distance of a wire from its length's dimension line, in."""
LINE = 0.14
"""Height of a line of small text, in."""


@dataclass(frozen=True)
class Plan:
    """A drawing's two views, placed on its canvas.

    Attributes
    ----------
    sketch : Sketch
    side, face : View
        With their origins and scale in inches.
    left : float
        Where the leaders' texts left of the side view end.
    right : float
        Where the dimension of the total height stands, right of the face view.
    names : float
        Where the bodies' names begin, between the views.
    """

    sketch: Sketch
    side: View
    face: View
    left: float
    right: float
    names: float


@dataclass(frozen=True)
class _Set:
    """A symmetric set of wires in the drawing.

    Attributes
    ----------
    shape : SetGeometry
    above, below : (3,) arrays
        The two COMs, m.
    top, bottom : float
        Bounds in z of the free room between the bodies, m.
    halves : (float, float)
        Half widths in y of the two bodies, m; 0 for the support.
    """

    shape: SetGeometry
    above: Array
    below: Array
    top: float
    bottom: float
    halves: tuple[float, float]


def dimensions(canvas: Canvas, plan: Plan) -> None:
    """Draw the dimensions of symmetric sets, as far as there is room for them; the table beside the drawing has them all."""
    labels: list[tuple[Array, str]] = []
    parents = [_parent(plan.sketch, n, stage) for n, stage in enumerate(plan.sketch.design.stage, 1)]
    for n, (stage, parent) in enumerate(zip(plan.sketch.design.stage, parents, strict=True), 1):
        if stage.wires is None or parents.count(parent) > 1:
            # the lines of bodies that hang from the same one would run into each other
            continue
        here = _set(plan.sketch, stage, parent, n)
        _separations(canvas, plan, here)
        _wire_length(canvas, plan.face, here)
        labels += _heights(canvas, plan.side, here)
    for (target, text), y in zip(labels, spread([float(target[1]) for target, _ in labels], LINE), strict=True):
        leader(canvas, plan.left, y, target, text)
    _total(canvas, plan)


def _parent(sketch: Sketch, number: int, stage: Stage) -> int:
    if stage.hangs_from is None:
        return number - 1
    return [s.name for s in sketch.design.stage].index(stage.hangs_from) + 1 if stage.hangs_from in sketch.scene.bodies.name else 0


def _set(sketch: Sketch, stage: Stage, parent: int, number: int) -> _Set:
    assert stage.wires is not None
    shape, position = set_geometry(stage.wires), sketch.scene.bodies.position
    above, below = position[parent], position[number]
    top = float(above[2]) - max(shape.d_upper, float(sketch.outlines[parent - 1].half[2]) if parent else 0.0)
    bottom = float(below[2]) + max(shape.d, float(sketch.outlines[number - 1].half[2]))
    halves = (float(sketch.outlines[parent - 1].half[1]) if parent else 0.0, float(sketch.outlines[number - 1].half[1]))
    return _Set(shape, above, below, top, bottom, halves)


def _separations(canvas: Canvas, plan: Plan, here: _Set) -> None:
    """s in the side view, t1 and t2 in the face view, in the room between the bodies."""
    shape, scale = here.shape, plan.face.scale
    room = scale * (here.top - here.bottom)
    if room < LEAST_ROOM or shape.count == 1:
        return
    _pair(canvas, plan.face, here, 1, (shape.t1, shape.t2), ("$t_1$", "$t_2$", "$t_1$ = $t_2$"), room)
    if shape.count == 4:
        _pair(canvas, plan.side, here, 0, (shape.s_upper, shape.s_lower), ("$s$", "$s$", "$s$"), room)


def _pair(canvas: Canvas, view: View, here: _Set, axis: int, halves: tuple[float, float], symbols: tuple[str, str, str], room: float) -> None:
    """The half separations at the upper and lower ends, or both in one line where they are equal."""
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


def _across(canvas: Canvas, view: View, here: _Set, axis: int, levels: tuple[float, float], halves: tuple[float, float], symbol: str) -> None:
    """A half separation from the axis outwards.

    `levels` are those of its dimension line and of the wires' ends (m), `halves` the half separation itself and
    that of the wires at the level of the line (m), which the text must keep clear of.
    """
    half, wire = halves
    if half == 0:
        return
    inner = np.array([*here.below[:2], levels[0]])
    outer = inner + half * np.eye(3)[axis]
    a, b, end = view.see(inner), view.see(outer), view.see(np.array([*outer[:2], levels[1]]))
    extension(canvas, end, b)
    dimension(canvas, a, b, f"{symbol} = {length(half)}", view.scale * (wire - half))


def _wire_length(canvas: Canvas, view: View, here: _Set) -> None:
    """l beside the wire at -y in the face view, if the wire is long enough on paper."""
    shape = here.shape
    upper = view.see(here.above - np.array([0.0, shape.t1, shape.d_upper]))
    lower = view.see(here.below + np.array([0.0, -shape.t2, shape.d]))
    span = lower - upper
    size = float(np.linalg.norm(span))
    out = _clearance(view.scale, here) * np.array([span[1], -span[0]]) / size
    texts = [text for text in (f"$l$ = {length(shape.length)}", length(shape.length)) if width_of(text) + 3 * HEAD < size]
    if not texts:
        return
    extension(canvas, upper, upper + out)
    extension(canvas, lower, lower + out)
    dimension(canvas, lower + out, upper + out, texts[0])


def _clearance(scale: float, here: _Set) -> float:
    """How far from the wire its length stands, in: clear of both bodies' edges if that is not far away."""
    shape = here.shape
    wanted = [0.17, scale * (here.halves[0] - shape.t1) + 0.13, scale * (here.halves[1] - shape.t2) + 0.13]
    return max(value for value in wanted if value <= MOST_CLEARANCE)


def _heights(canvas: Canvas, view: View, here: _Set) -> list[tuple[Array, str]]:
    """Where leaders should point for d and d_u, and what they say; arrows too where the height can be seen."""
    shape, found = here.shape, []
    ends = ((here.above, -shape.s_upper, -shape.d_upper, shape.d_upper, "$d_u$"), (here.below, -shape.s_lower, shape.d, shape.d, "$d$"))
    for centre, x, z, value, symbol in ends:
        if value == 0:
            continue
        level, end = view.see(centre + np.array([x, 0.0, 0.0])), view.see(centre + np.array([x, 0.0, z]))
        if float(np.linalg.norm(end - level)) > 3 * HEAD:
            extension(canvas, view.see(centre), level)
            dimension(canvas, level, end, "")
            end = (level + end) / 2
        found.append((end, f"{symbol} = {length(value)}"))
    return found


def _total(canvas: Canvas, plan: Plan) -> None:
    """The height from the suspension point to the lowest body."""
    sketch, view = plan.sketch, plan.face
    bottoms = [float(position[2] - body.half[2]) for position, body in zip(sketch.scene.bodies.position[1:], sketch.outlines, strict=True)]
    lowest = int(np.argmin(bottoms))
    body, box = sketch.outlines[lowest], support_box(sketch)
    top, bottom = view.see(np.zeros(3)), view.see(np.array([0.0, 0.0, min(bottoms)]))
    if float(top[1] - bottom[1]) < 4 * HEAD:
        return
    edge = view.see(sketch.scene.bodies.position[lowest + 1] + np.array([0.0, float(body.half[1]), 0.0]))[0]
    extension(canvas, [view.see(box[1])[0] + 0.04, top[1]], [plan.right, top[1]])
    extension(canvas, [edge + 0.04, bottom[1]], [plan.right, bottom[1]])
    dimension(canvas, [plan.right, bottom[1]], [plan.right, top[1]], length(-min(bottoms)))


def axes_of_symmetry(canvas: Canvas, plan: Plan) -> None:
    """A dash-dotted line through the bodies on either side of each symmetric set."""
    position = plan.sketch.scene.bodies.position
    for n, stage in enumerate(plan.sketch.design.stage, 1):
        if stage.wires is not None:
            line = np.stack([position[_parent(plan.sketch, n, stage)], position[n]])
            for view in (plan.side, plan.face):
                canvas.line(view.see(line), PALE, 0.5, 1.9, (0, (8, 2, 1, 2)))


def names(canvas: Canvas, plan: Plan, colours: tuple[str, ...]) -> None:
    """Each body's name and mass: between the views with a line to the body in the side view, or in the body where another is in the way."""
    boxes = _boxes(plan)
    inside = [n for n in range(len(boxes)) if _hidden(boxes, n) and _fits(boxes[n], plan.sketch.scene.bodies.name[n])]
    beside = [n for n in range(len(boxes)) if n not in inside]
    for n, y in zip(beside, spread([float(boxes[n][1].mean()) for n in beside], 2.1 * LINE), strict=True):
        edge = np.array([boxes[n][0, 1], boxes[n][1].mean()])
        canvas.line([edge, [plan.names - 0.16, y], [plan.names - 0.04, y]], colours[n], 0.5, 5)
        dot(canvas, edge, colours[n])
        _name(canvas, plan, n, (plan.names, y), colours[n], "left")
    for n in inside:
        _name(canvas, plan, n, (float(boxes[n][0].mean()), float(boxes[n][1].mean()) - 0.24), colours[n], "center")


def _name(canvas: Canvas, plan: Plan, n: int, where: tuple[float, float], colour: str, side: str) -> None:
    bodies = plan.sketch.scene.bodies
    canvas.text(where[0], where[1] + 0.01, plain(bodies.name[n], 18), fontsize=7.6, color=colour, fontweight="bold", va="bottom", ha=side)
    canvas.text(where[0], where[1] - 0.01, f"{float(bodies.mass[n]):.4g} kg", fontsize=6.8, color=NOTE, va="top", ha=side)


def _boxes(plan: Plan) -> list[Array]:
    """Bounds (2, 2) of each body in the side view, in: ((left, right), (bottom, top))."""
    found = []
    for position, body in zip(plan.sketch.scene.bodies.position[1:], plan.sketch.outlines, strict=True):
        found.append(plan.side.see(np.stack([position - body.half, position + body.half])).T)
    return found


def _hidden(boxes: list[Array], n: int) -> bool:
    """Whether another body stands between a body's right edge and the names."""
    (_, right), level = boxes[n][0], boxes[n][1].mean()
    return any(m != n and box[0, 0] >= right and box[1, 0] < level < box[1, 1] for m, box in enumerate(boxes))


def _fits(box: Array, name: str) -> bool:
    wide, tall = np.ptp(box, axis=1)
    return bool(wide > width_of(name) * 1.25 + 0.1 and tall > 0.9)


def numbers(canvas: Canvas, plan: Plan) -> None:
    """The numbers of wires given one by one, at the middle of each; wires that hide each other share a label."""
    for view in (plan.side, plan.face):
        taken: list[tuple[Array, float]] = []
        for where, text in _numbered(plan.sketch, view):
            wide = width_of(text)
            if all(abs(where[1] - y) > LINE or abs(where[0] - x) > (wide + other) / 2 + 0.04 for (x, y), other in taken):
                taken.append((where, wide))
                note(canvas, where, text)


def _numbered(sketch: Sketch, view: View) -> list[tuple[Array, str]]:
    """Where the middles of wires given one by one are seen, and the numbers of those that are there."""
    explicit = {stage.name for stage in sketch.design.stage if stage.wires is None}
    middle = view.see(wire_ends(sketch.scene, sketch.pose).mean(1))
    groups: list[tuple[Array, list[str]]] = []
    for where, label in zip(middle, sketch.scene.wires.label, strict=True):
        stage, _, number = label.rpartition(".")
        if stage in explicit:
            near = [members for place, members in groups if float(np.abs(place - where).max()) < 0.1]
            if near:
                near[0].append(number)
            else:
                groups.append((where, [number]))
    return [(where, shortened(", ".join(dict.fromkeys(members)), 12)) for where, members in groups]
