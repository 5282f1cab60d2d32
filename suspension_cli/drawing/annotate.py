"""Dimensions, names and numbers in the drawing of a suspension, in inches on one canvas."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design.derive import SetGeometry, set_geometry
from suspension_cli.design.schema import Stage
from suspension_cli.drawing.canvas import Canvas
from suspension_cli.drawing.geometry import Sketch, View, wire_ends
from suspension_cli.drawing.labels import spread
from suspension_cli.drawing.parts import support_box
from suspension_cli.drawing.style import NOTE, PALE, length, shorten, single_line, text_width
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

SIZE = 5.6
"""Font size of dimensions, points."""
HEAD = 0.06
"""Length of an arrowhead, in."""
THIN = 0.5
"""Width of a dimension line, points."""
BLANK = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
"""Box behind a text, which hides what lies below."""
ORDER = 7.0
"""Order of dimensions on the canvas: above everything else."""
LEAST_ROOM = 0.25
"""Free height between two bodies that is enough for one dimension line, in."""
CLEARANCE = 0.17
"""Distance of a wire from its length's dimension line, in."""
LINE = 0.115
"""Height of a line of small text, in."""
MANY = 12
"""Number of bodies above which d, d_u, masses and numbers of wires, which the tables list, are left
out."""


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
    """

    shape: SetGeometry
    above: Array
    below: Array
    top: float
    bottom: float


def draw_dimensions(canvas: Canvas, plan: Plan) -> None:
    """Draw the dimensions of symmetric sets for which there is room; a table lists them all."""
    sketch, labels = plan.sketch, list[tuple[Array, str]]()
    parents = [_parent(sketch, n, stage) for n, stage in enumerate(sketch.design.stage, 1)]
    for n, (stage, parent) in enumerate(zip(sketch.design.stage, parents, strict=True), 1):
        if stage.wires is None or parents.count(parent) > 1:
            continue  # the lines of bodies that hang from the same one would overlap
        here = _set(sketch, set_geometry(stage.wires), parent, n)
        if plan.face.scale * (here.top - here.bottom) >= LEAST_ROOM:
            _separations(canvas, plan, here)
        _wire_length(canvas, plan, here)
        labels += _heights(plan.side, here) if len(parents) <= MANY else []
    levels = spread([float(target[1]) for target, _ in labels], LINE)
    for (target, text), y in zip(labels, levels, strict=True):
        canvas.line([[plan.left + 0.02, y], [plan.left + 0.1, y], target], NOTE, 0.4, ORDER - 0.1)
        draw_dot(canvas, target)
        canvas.text(plan.left, y, text, fontsize=SIZE, color=NOTE, ha="right", va="center")
    _total(canvas, plan)


def _parent(sketch: Sketch, number: int, stage: Stage) -> int:
    """Number of the body from which a stage hangs; 0 is the support."""
    if stage.hangs_from is None:
        return number - 1
    names = sketch.scene.bodies.name
    return names.index(stage.hangs_from) + 1 if stage.hangs_from in names else 0


def _set(sketch: Sketch, shape: SetGeometry, parent: int, number: int) -> _Set:
    above, below = sketch.scene.bodies.position[[parent, number]]
    upper = float(sketch.outlines[parent - 1].half[2]) if parent else 0.0
    top = float(above[2]) - max(shape.d_upper, upper)
    bottom = float(below[2]) + max(shape.d, float(sketch.outlines[number - 1].half[2]))
    return _Set(shape, above, below, top, bottom)


def _separations(canvas: Canvas, plan: Plan, here: _Set) -> None:
    """Draw s in the side view, t1 and t2 in the face view, from the axis, between the bodies.

    Extension lines lead to the ends of the wires; text outside avoids the wires. Equal separations
    at both ends are drawn as one.
    """
    shape = here.shape
    if shape.count == 1 or shape.is_ring:
        return
    top, bottom = float(here.above[2]) - shape.d_upper, float(here.below[2]) + shape.d
    pairs = [(plan.face, 1, shape.t1, shape.t2, ("$t_1$", "$t_2$", "$t_1$ = $t_2$"))]
    if shape.count == 4:
        pairs.append((plan.side, 0, shape.s_upper, shape.s_lower, ("$s$", "$s$", "$s$")))
    for view, axis, upper, lower, symbols in pairs:
        room = view.scale * (here.top - here.bottom)
        inset = min(0.16, room / 3) / view.scale
        shown = [(here.top - inset, top, upper, symbols[0])]
        if upper == lower:
            middle = (here.top + here.bottom) / 2
            shown = [(middle, middle, upper, symbols[2])]
        elif room > 2 * LEAST_ROOM or upper == 0:
            shown.append((here.bottom + inset, bottom, lower, symbols[1]))
        for level, end, half, symbol in (one for one in shown if one[2]):
            points = np.tile([*here.below[:2], level], (3, 1))
            points[1:, axis] += half
            points[2, 2] = end
            a, b, tip = view.see(points)
            wire = float(np.interp(level, [bottom, top], [lower, upper]))
            _draw_extension(canvas, tip, b)
            text = f"{symbol} = {length(half)}"
            _draw_dimension(canvas, a, b, text, clear=view.scale * (wire - half))


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
    out = CLEARANCE * np.array([span[1], -span[0]]) / size
    text, room = f"$l$ = {length(shape.length)}", view.scale * (top - here.bottom)
    if text_width(text, SIZE) > max(room, 0.15):
        text = length(shape.length)
    if text_width(text, SIZE) + 3 * HEAD < size:
        _draw_extension(canvas, upper, upper + out)
        _draw_extension(canvas, lower, lower + out)
        place = float((free - lower[1] - out[1]) / (upper[1] - lower[1] or 1.0))
        _draw_dimension(canvas, lower + out, upper + out, text, place=place)


def _heights(view: View, here: _Set) -> list[tuple[Array, str]]:
    """Targets and texts of the leaders for d and d_u."""
    shape, leaders = here.shape, []
    ends = (
        (here.above, -shape.s_upper, -shape.d_upper, shape.d_upper, "$d_u$"),
        (here.below, -shape.s_lower, shape.d, shape.d, "$d$"),
    )
    for centre, x, z, value, symbol in ends:
        if value == 0:
            continue
        leaders.append((view.see(centre + np.array([x, 0.0, z])), f"{symbol} = {length(value)}"))
    return leaders


def _total(canvas: Canvas, plan: Plan) -> None:
    """Draw the height from the suspension point to the lowest body."""
    sketch, view = plan.sketch, plan.face
    positions = sketch.scene.bodies.position[1:]
    half = np.array([body.half for body in sketch.outlines])
    bottoms = positions[:, 2] - half[:, 2]
    lowest, box = int(np.argmin(bottoms)), support_box(sketch)
    top, bottom = view.see([[0.0, 0.0, 0.0], [0.0, 0.0, bottoms.min()]])[:, 1]
    if top - bottom < 4 * HEAD:
        return
    side = view.see(positions[lowest] + half[lowest] * (0, 1, 0))[0]
    for x, y in ((view.see(box[1])[0], top), (side, bottom)):
        _draw_extension(canvas, [x + 0.04, y], [plan.right, y])
    _draw_dimension(canvas, [plan.right, bottom], [plan.right, top], length(-float(bottoms.min())))


def _draw_extension(canvas: Canvas, start: ArrayLike, end: ArrayLike) -> None:
    """Draw a thin line from the object to a little beyond its dimension line."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    span = float(np.linalg.norm(end - start))
    if span > 1e-9:
        canvas.line([start, end + 0.04 * (end - start) / span], NOTE, 0.35, ORDER - 0.1)


def _draw_dimension(
    canvas: Canvas,
    a: ArrayLike,
    b: ArrayLike,
    text: str,
    clear: float = 0.0,
    place: float = 0.5,
) -> None:
    """Draw a dimension line from a to b (2,), in inches, with its text.

    The text is in the line if there is room; else beyond b and horizontal. If there is no room for
    arrows either, they come from outside.

    Parameters
    ----------
    clear
        Position, relative to b, in, at which something else crosses the line: text outside stays
        beyond it, text inside before it.
    place
        Place of text inside, as a fraction of the way from a to b, where it has room.
    """
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    span = float(np.linalg.norm(b - a))
    along = (b - a) / span if span > 0 else np.array([1.0, 0.0])
    across = np.array([-along[1], along[0]])
    outside = 0.0 if span > 2.6 * HEAD else 2.2 * HEAD
    canvas.line([a - outside * along, b + outside * along], NOTE, THIN, ORDER)
    for tip, sign in ((a, -1.0 if outside else 1.0), (b, 1.0 if outside else -1.0)):
        base = tip + sign * HEAD * along
        wings = [tip, base + 0.17 * HEAD * across, base - 0.17 * HEAD * across]
        canvas.polygon(wings, NOTE, "none", 0.0, ORDER)
    inside, wide = span + min(clear, 0.0), text_width(text, SIZE)
    if inside > wide + 3 * HEAD:
        angle = (float(np.degrees(np.arctan2(along[1], along[0]))) + 89.999) % 180 - 89.999
        end = (wide / 2 + 1.5 * HEAD) / inside
        place = min(max(place, end), 1 - end)
        write_note(canvas, a + place * inside * along, text, rotation=angle)
        return
    if abs(along[0]) > 0.5:
        side, up = "left" if along[0] > 0 else "right", "center"
    else:
        side, up = "center", "bottom" if along[1] > 0 else "top"
    write_note(canvas, b + (max(clear, outside) + 0.05) * along, text, ha=side, va=up)


def write_note(canvas: Canvas, where: Iterable[float], text: str, **how: Any) -> None:
    """Write text, hiding what is below it; centred on a point unless `how` says otherwise."""
    x, y = map(float, where)
    look = {"fontsize": SIZE, "color": NOTE, "bbox": BLANK, "ha": "center", "va": "center"}
    canvas.text(x, y, text, **(look | how))


def draw_dot(canvas: Canvas, where: Array, colour: str = NOTE) -> None:
    """Draw a small dot."""
    angle = np.linspace(0, 2 * np.pi, 13)
    circle = 0.016 * np.column_stack([np.cos(angle), np.sin(angle)])
    canvas.polygon(where + circle, colour, "none", 0.0, ORDER)


def draw_axes_of_symmetry(canvas: Canvas, plan: Plan) -> None:
    """Draw a dash-dotted line through the two bodies of each symmetric set."""
    position = plan.sketch.scene.bodies.position
    for n, stage in enumerate(plan.sketch.design.stage, 1):
        if stage.wires is not None:
            line = np.stack([position[_parent(plan.sketch, n, stage)], position[n]])
            for view in (plan.side, plan.face):
                canvas.line(view.see(line), PALE, 0.5, 1.9, (0, (8, 2, 1, 2)))


def write_names(canvas: Canvas, plan: Plan, colours: tuple[str, ...]) -> None:
    """Write each body's name and mass between the views, with a line to it in the side view.

    Of many bodies only names are written.
    """
    bodies, outlines = plan.sketch.scene.bodies, plan.sketch.outlines
    many = len(outlines) > MANY
    places = zip(bodies.position[1:], outlines, strict=True)
    edges = [plan.side.see(position + body.half * (1, 0, 0)) for position, body in places]
    levels = spread([float(edge[1]) for edge in edges], (1.1 if many else 2.1) * LINE)
    for n, (edge, y, colour) in enumerate(zip(edges, levels, colours, strict=True)):
        ends = [edge, [plan.names - 0.16, y], [plan.names - 0.04, y]]
        canvas.line(ends, colour, 0.5, 5)
        draw_dot(canvas, edge, colour)
        look = {"fontsize": 6.5, "color": colour, "fontweight": "bold"}
        name = single_line(bodies.name[n], 18)
        canvas.text(plan.names, y, name, va="center" if many else "bottom", **look)
        if not many:
            mass = f"{float(bodies.mass[n]):.4g} kg"
            canvas.text(plan.names, y - 0.01, mass, fontsize=SIZE, color=NOTE, va="top")


def write_numbers(canvas: Canvas, plan: Plan) -> None:
    """Write the numbers of wires of stages without a symmetric set, at the middle of each.

    Wires that are close together share a label. Of many bodies none is written.
    """
    sketch = plan.sketch
    explicit = {stage.name for stage in sketch.design.stage if stage.wires is None}
    if len(sketch.design.stage) > MANY:
        return
    for view in (plan.side, plan.face):
        middle = view.see(wire_ends(sketch.scene, sketch.pose).mean(1))
        groups: dict[tuple[float, ...], list[str]] = {}
        for where, label in zip(middle, sketch.scene.wires.label, strict=True):
            stage, _, number = label.rpartition(".")
            if stage in explicit:
                near = (place for place in groups if (np.abs(where - place) < LINE).all())
                groups.setdefault(next(near, tuple(where.tolist())), []).append(number)
        for where, numbers in groups.items():
            write_note(canvas, where, shorten(", ".join(dict.fromkeys(numbers)), 12))
