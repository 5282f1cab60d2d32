"""Pictures of modes: shapes, one panel per mode; one period in motion, as GIF; Q of all modes."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from suspension_cli.conventions import DOFS, WIRE_MODE_NAMES
from suspension_cli.design.faults import suggest
from suspension_cli.design.schema import Design
from suspension_cli.drawing import geometry, panels, parts, style
from suspension_cli.drawing.geometry import ABOVE, FACE, SIDE, Sketch, Stroke, View
from suspension_cli.drawing.parts import Canvas, Look, full_canvas
from suspension_cli.drawing.style import INK, NOTE, PALE, LineLook
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.grids import parse_place
from suspension_cli.linear.eigenmodes import Modes, describe, place
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.scene import Scene

ACROSS = 6
PAGE = 24
MOST = 120
"""Largest numbers of panels side by side, of modes of one figure, and of modes drawn."""
GAP = 0.1
HEAD = 0.16
ROW = 0.125
SHOWN = 3
"""Distance between panels, height of a panel's title and of a row of energies, in; most rows."""
AROUND = HEAD + (SHOWN + 1) * ROW + GAP
"""Height of a panel without its picture, in."""
TOP = 0.66
"""Height of the figure's heading, in."""
SMALL = 5.5
LARGE = 7.0
"""Font sizes of a panel and of its title, points."""
THIN = 0.6
"""Width of a wire, points."""
LEAST = 0.02
"""Least fraction of kinetic energy that is written."""
THICK = 0.028
"""Thickness of the support over the size of the suspension."""
FEW = 8
"""Number of bodies up to which a suspension is always drawn whole."""
MOVING = 0.6
"""Fraction of the kinetic energy of the bodies that a detail shows."""
MARGIN = 0.4
"""Room around these bodies, over the size of what they fill."""
DETAIL = 0.2
"""Size of a detail over that of the suspension, up to which the detail is drawn instead."""
KINDS = {
    "longitudinal and pitch": ("x", "pitch"),
    "transverse and roll": ("y", "roll"),
    "vertical and yaw": ("z", "yaw"),
}
"""Kinds of modes that share a figure, and their degrees of freedom: coupled even in a symmetric
design, or few."""
BODIES = "bodies"
MARKERS = {BODIES: "x", "violin-x": "<", "violin-y": ">", "stretch": "^", "twist": "v"}
"""Marker of the modes of bodies, and of each motion of a wire; two at one point differ from one."""
FRAMES = 24
DURATION = 50
"""Frames of a period (even: the second half is the first in reverse), and time of each, ms."""
WIDTH = 1.6
TALLEST = 2.6
LOWEST = 0.9
DPI = 200
COLOURS = 64
"""Of a moving picture: width and bounds of the height, in; dots per inch; most colours."""
ALL = "all"


@dataclass(frozen=True)
class Panel:
    """A mode (number from 0), displaced in a view, and the bounds (2,), (2,) of its picture, m.

    The picture is that of the whole suspension, or a detail.
    """

    number: int
    view: View
    sketch: Sketch
    low: Array
    high: Array
    is_detail: bool = False


@dataclass(frozen=True)
class Page:
    """One of several figures of modes: their kind (`KINDS`; "" for all), and numbers from 0."""

    kind: str
    numbers: tuple[int, ...]
    figure: Figure


def draw_pages(modes: Modes, design: Design, scene: Scene, subtitle: str) -> list[Page]:
    """Draw the modes of a suspension, ascending, on figures of a page's width.

    There is one panel for each of the lowest `MOST` modes (modes of wires alone are in
    `draw_quality`). It shows the suspension at rest (grey) and displaced, in the view that shows
    most of the motion. The more kinetic energy a body has, the stronger its stage's colour. More
    than `PAGE` modes are split by kind (`KINDS`), and those of one kind into figures of about equal
    numbers. If few bodies of a tall suspension move, a detail shows these (`find_detail`).
    """
    bodily = np.flatnonzero(modes.order == 0).tolist()
    numbers = bodily[:MOST]
    if not numbers:
        return []
    note = f"The lowest {MOST} of {len(bodily)} modes. " if len(bodily) > MOST else ""
    with style.house_style():
        rest = geometry.sketch_at_rest(design, scene, THICK)
        drawn = {number: make_panel(modes, number, rest) for number in numbers}
        whole = [panel for panel in drawn.values() if not panel.is_detail]
        largest = extent(whole or [*drawn.values()])
        result = []
        for kind, part in [("", numbers)] if len(numbers) <= PAGE else _split(modes, numbers):
            title = (kind or "normal modes").capitalize(), subtitle
            figure = _figure(modes, rest, [drawn[n] for n in part], largest, title, note)
            result.append(Page(kind, tuple(part), figure))
        return result


def _split(modes: Modes, numbers: list[int]) -> Iterator[tuple[str, list[int]]]:
    """Split modes by kind, and a kind into pages of at most `PAGE`, each with its title."""
    for title, dofs in KINDS.items():
        kind = [number for number in numbers if modes.home[number][1] in dofs]
        count = -(-len(kind) // PAGE)
        for page in range(count):
            part = kind[page * len(kind) // count : (page + 1) * len(kind) // count]
            yield title + (f" modes, {page + 1} of {count}" if count > 1 else " modes"), part


def make_panel(modes: Modes, number: int, rest: Sketch, phase: float = 1.0) -> Panel:
    """Make the panel of a mode at a phase, from 1 (largest displacement) to -1."""
    view = choose_view(modes, number)
    detail = find_detail(modes, number, view, rest)
    size = None if detail is None else float(np.max(detail[1] - detail[0]))
    of_dampers = modes.home[number][0].count(".") == 2
    sketch = geometry.sketch_mode(
        rest, modes.coordinate, modes.shape[number], size, phase, of_dampers=of_dampers
    )
    if detail is not None:
        return Panel(number, view, sketch, *detail, is_detail=True)
    points = np.concatenate([_whole(view, rest), sketch.points(view)])
    return Panel(number, view, sketch, points.min(0), points.max(0))


def _whole(view: View, rest: Sketch) -> Array:
    """Points (k, 2) of the whole suspension at rest in a view, with the support, m."""
    (x0, y0, z0), (x1, y1, z1) = parts.support_box(rest)
    heights = (z0,) if view.normal == 2 else (z0, z1)
    plate = [*product((x0, x1), (y0, y1), heights)]
    return np.concatenate([rest.points(view), view.see(plate)])


def find_detail(modes: Modes, number: int, view: View, rest: Sketch) -> tuple[Array, Array] | None:
    """Find the bounds (2,), (2,), m, of the bodies that move most; None if these are far apart.

    None, too, of a suspension of few bodies.
    """
    if len(rest.outlines) <= FEW:
        return None
    energy = modes.energy[number].sum(-1)
    order = np.argsort(-energy, kind="stable")
    count = int(np.searchsorted(np.cumsum(energy[order]), MOVING * energy.sum())) + 1
    moving = set(order[:count].tolist())
    bodies = [one for one in rest.strokes(view.normal) if one.kind == "body"]
    points = view.see(np.concatenate([one.points for one in bodies if one.body in moving]))
    low = points.min(0)
    high = points.max(0)
    margin = MARGIN * float(np.max(high - low))
    low = low - margin
    high = high + margin
    if np.max(high - low) > DETAIL * np.max(np.ptp(_whole(view, rest), axis=0)):
        return None
    return low, high


def extent(shown: Sequence[Panel]) -> Array:
    """Largest width and height (2,) of the pictures of panels, m."""
    return np.max([panel.high - panel.low for panel in shown], axis=0)


def choose_view(modes: Modes, number: int) -> View:
    """Choose the view that shows most of a mode's kinetic energy.

    Vertical motion shows in the side and in the face view.
    """
    energy: dict[str, float] = dict.fromkeys(DOFS, 0.0)
    for coordinate, fraction in zip(modes.place, modes.fractions[number], strict=True):
        if place(coordinate)[1] in energy:
            energy[place(coordinate)[1]] += float(fraction)
    side = energy["x"] + energy["pitch"] + energy["z"]
    face = energy["y"] + energy["roll"] + energy["z"]
    if energy["yaw"] > 0.2 and energy["yaw"] + energy["x"] + energy["y"] > max(side, face):
        return ABOVE
    return SIDE if side >= face - 1e-9 else FACE


def _figure(
    modes: Modes,
    rest: Sketch,
    shown: list[Panel],
    largest: Array,
    title: tuple[str, str],
    note: str,
) -> Figure:
    """Draw panels on a figure of a page's width, and at most its height."""
    rows = -(-len(shown) // ACROSS)
    across = -(-len(shown) // rows)
    width = (style.PAGE_WIDTH - GAP) / across
    most = (style.PAGE_HEIGHT - TOP) / rows - AROUND
    tall = min(most, (width - GAP) * float(largest[1] / largest[0]))
    height = TOP + rows * (tall + AROUND)
    figure = style.new_figure(style.PAGE_WIDTH, height)
    style.write_heading(figure, *title)
    key = (
        f"{note}Grey: at rest. Colour: stage, as in the bars below; stronger where it has more"
        " kinetic energy. Bars: fractions of this. Motions exaggerated."
    )
    if any(panel.is_detail for panel in shown):
        key += "\nIn a frame: the bodies that move most, enlarged; other pictures have one scale."
    style.write_text(figure, 0.1, 0.44, key, SMALL, NOTE)
    canvas = full_canvas(figure)
    for n, one in enumerate(shown):
        corner = GAP + (n % across) * width, height - TOP - (n // across) * (tall + AROUND)
        draw_panel(canvas, corner, (width - GAP, tall), modes, one, rest, largest)
    canvas.flush()
    return figure


def draw_panel(
    canvas: Canvas,
    corner: tuple[float, float],
    size: tuple[float, float],
    modes: Modes,
    panel: Panel,
    rest: Sketch,
    largest: Array,
) -> None:
    """Draw the title, the picture and the energies of a mode.

    `corner` is the upper left corner, `size` the width and height of the picture, in, for pictures
    of a `largest` extent (2,), m. The more energy a body has, the stronger its colour.
    """
    left, top = corner
    width, tall = size
    number = panel.number
    colours = style.stage_colours(rest.scene.bodies.name)
    canvas.text(
        left,
        top,
        format_heading(modes, number),
        va="top",
        fontsize=SMALL if np.isnan(modes.frequency[number]) else LARGE,
        fontweight="bold",
        color=INK if modes.omega_squared[number] >= 0 else style.PALETTE[1],
    )
    top -= HEAD
    if panel.is_detail:
        picture = canvas.framed(left, top - tall, width, tall)
        largest = panel.high - panel.low
    else:
        picture = canvas
    scale = float(np.min((np.array(size) - (0.05, 0.06)) / largest))
    middle = left + width / 2 - scale * (panel.low[0] + panel.high[0]) / 2
    upper = top - 0.03 - scale * float(panel.high[1])
    if panel.is_detail:
        upper = top - tall / 2 - scale * float(panel.low[1] + panel.high[1]) / 2
    view = panel.view.at((middle, upper), scale)
    grey = (PALE,) * len(rest.outlines)
    still = Look(grey, ((PALE, 0.25),) * len(grey), PALE, THIN, 1)
    energy = modes.energy[number].sum(-1)
    strength = 0.05 + 0.65 * energy / max(float(energy.max()), 1e-9)
    edge = tuple(colours.values())
    fill = tuple(zip(edge, strength.tolist(), strict=True))
    moved = Look(edge, fill, INK, THIN, 3)
    if panel.is_detail:
        box = np.array([[left, top - tall], [left + width, top]])
        for sketch, look in ((rest, still), (panel.sketch, moved)):
            strokes = _strokes_inside(sketch, view, box)
            parts.draw_suspension(picture, view, sketch, look, strokes)
    else:
        parts.draw_support(picture, view, rest)
        parts.draw_suspension(picture, view, rest, still)
        parts.draw_suspension(picture, view, panel.sketch, moved)
    for n, colour in enumerate(edge, 1):
        _draw_cross(picture, view, panel.sketch, n, colour)
    if panel.is_detail:
        picture.flush()
    top -= tall + ROW / 2
    look = {"ha": "right", "color": NOTE, "va": "center", "fontsize": SMALL}
    canvas.text(left + width, top, panel.view.name, **look)
    _draw_energies(canvas, left, top - ROW, width, modes, number, colours)


def _strokes_inside(sketch: Sketch, view: View, box: Array) -> list[Stroke]:
    """Strokes of a sketch that may reach into a box: its corners (2, 2), in the view."""
    result = []
    for stroke in sketch.strokes(view.normal):
        points = view.see(stroke.points)
        if (points.max(0) >= box[0]).all() and (points.min(0) <= box[1]).all():
            result.append(stroke)
    return result


def _draw_cross(canvas: Canvas, view: View, moved: Sketch, n: int, colour: str) -> None:
    """Draw a cross that turns with a body; in a circle it ends at the rim."""
    body = moved.outlines[n - 1]
    reach = 1.0 if body.axis == view.normal else 0.3
    for axis in {0, 1, 2} - {view.normal}:
        arm = reach * np.eye(3)[axis] * body.half
        canvas.line(view.see(moved.locate(n, np.array([-arm, arm]))), colour, THIN, 4)


def format_heading(modes: Modes, number: int) -> str:
    """Number and frequency of a mode, for the title of its panel."""
    frequency = float(modes.frequency[number])
    if modes.overdamped[number]:
        words = f"overdamped, decays at {style.format_significant(modes.decay_rate[number])} 1/s"
    elif np.isnan(frequency):
        words = f"unstable, grows at {style.format_significant(modes.growth_rate[number])} 1/s"
    else:
        words = f"{style.format_significant(frequency)} Hz" if frequency else "rigid"
    return f"{number + 1}  {words}"


def _draw_energies(
    canvas: Canvas,
    left: float,
    middle: float,
    width: float,
    modes: Modes,
    number: int,
    colours: dict[str, str],
) -> None:
    """Write the largest fractions of kinetic energy, over bars in the colours of the stages."""
    fractions = modes.fractions[number]
    for n in np.argsort(-fractions, kind="stable")[:SHOWN]:
        fraction = float(fractions[n])
        stage = place(modes.place[n])[0].partition(".")[0]
        if fraction < LEAST:
            break
        end = left + width * fraction
        low = middle - 0.062
        high = middle - 0.04
        box = [[left, low], [end, low], [end, high], [left, high]]
        canvas.polygon(box, colours.get(stage, NOTE), "none", 0.0, 2)
        percent = f"{100 * fraction:.{0 if fraction >= 0.095 else 1}f} %"
        body, _, motion = describe(modes.place[n]).rpartition(" ")
        rest = f" {motion} {percent}"
        body = style.shorten_to(body, width - style.text_width(rest, SMALL), SMALL)
        label = f"{style.single_line(body)}{rest}"
        canvas.text(left, middle, label, va="center", fontsize=SMALL)
        middle -= ROW


def draw_quality(modes: Modes, design: Design, subtitle: str) -> Figure:
    """Draw Q and dilution of every mode, those of wires included, against its frequency."""
    colours = style.stage_colours(stage.name for stage in design.stage)
    kinds = [
        (body.partition(".")[0], BODIES if order == 0 else dof)
        for (body, dof), order in zip(modes.home, modes.order, strict=True)
    ]

    def look(motion: str) -> LineLook:
        marker = MARKERS.get(motion, "o")
        return {"linestyle": "none", "marker": marker, "markersize": 4, "fillstyle": "none"}

    key = [panels.Line([], [], name, colour, look("")) for name, colour in colours.items()]
    names = {BODIES: BODIES} | WIRE_MODE_NAMES
    motions = {motion for _, motion in kinds}
    key += [panels.Line([], [], names[m], NOTE, look(m)) for m in MARKERS if m in motions]
    shown = []
    for values, name in ((modes.q, "Q"), (modes.dilution, "dilution")):
        good = np.isfinite(values) & (modes.omega_squared > 0) & (modes.frequency > 0)
        lines = []
        for stage, motion in dict.fromkeys(kinds):
            own = good & [kind == (stage, motion) for kind in kinds]
            points = modes.frequency[own], values[own]
            lines.append(panels.Line(*points, "_", colours.get(stage, NOTE), look(motion)))
        label = f"{name} (ratio)"
        above = () if shown else key
        shown.append(panels.Panel(label, lines, 1.7, "log", empty="no losses given", key=above))
    frequency = modes.frequency[modes.omega_squared > 0]
    limits = (float(frequency.min()) / 1.2, float(frequency.max()) * 1.2)
    across = panels.Across(limits=limits)
    return panels.draw("Q and dilution factor of all modes", subtitle, shown, across)


def parse_names(modes: Modes, text: str, option: str = "--animate") -> list[int]:
    """Parse numbers (from 1) and labels of modes, separated by commas, or ``all``.

    Returns numbers from 0. Raises `InputError` if there is no such mode, or it is one of wires
    alone, whose shape is not drawn.
    """
    drawn = np.flatnonzero(modes.order == 0).tolist()
    found = list[int]()
    for name in [*filter(None, map(str.strip, text.split(",")))] or [text]:
        if name == ALL:
            chosen = drawn
        elif name.isdecimal():
            position = parse_place(name, len(modes.frequency))
            chosen = [] if position is None else [position]
        else:
            chosen = modes.with_label(name)
        if not chosen:
            remedy = f"give a number from 1 to {len(modes.frequency)}, {ALL}, or a label:"
            remedy += f" {suggest(name, modes.label)}"
            raise InputError([Fault(option, "names no mode", remedy, format_value(name))])
        if not set(chosen) <= set(drawn):
            problem = "is a mode of wires alone, whose shape is not drawn"
            fault = Fault(option, problem, "name a mode of the bodies", format_value(name))
            raise InputError([fault])
        found += chosen
    return [*dict.fromkeys(found)]


def animate(modes: Modes, number: int, design: Design, scene: Scene) -> bytes:
    """Draw one period of a mode, as a GIF that repeats without end.

    Displacements go with cos(2 pi n / `FRAMES`); the largest is as in the picture of all modes.
    """
    with style.house_style():
        rest = geometry.sketch_at_rest(design, scene, THICK)
        phases = np.cos(2 * np.pi * np.arange(FRAMES // 2 + 1) / FRAMES)
        shown = [make_panel(modes, number, rest, phase) for phase in phases.tolist()]
        low = np.min([panel.low for panel in shown], axis=0)
        high = np.max([panel.high for panel in shown], axis=0)
        shown = [replace(panel, low=low, high=high) for panel in shown]
        frames = [_draw_frame(modes, rest, panel) for panel in shown]
    palette = Image.fromarray(np.concatenate(frames)).quantize(
        COLOURS, method=Image.Quantize.MAXCOVERAGE
    )
    images = [
        Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in frames
    ]
    stream = io.BytesIO()
    back = images[-2:0:-1]
    how: Any = {"duration": DURATION, "loop": 0, "optimize": False, "comment": b"pendsus"}
    images[0].save(stream, format="GIF", save_all=True, append_images=images[1:] + back, **how)
    return stream.getvalue()


def _draw_frame(modes: Modes, rest: Sketch, panel: Panel) -> Array:
    """Draw one frame: red, green and blue (height, width, 3) of its pixels."""
    size = extent([panel])
    tall = float(np.clip(WIDTH * size[1] / size[0], LOWEST, TALLEST))
    figure = style.new_figure(WIDTH + 2 * GAP, tall + AROUND + GAP)
    figure.set_dpi(DPI)
    canvas = full_canvas(figure)
    draw_panel(canvas, (GAP, tall + AROUND), (WIDTH, tall), modes, panel, rest, size)
    canvas.flush()
    pixels: Any = figure.canvas
    pixels.draw()
    return np.asarray(pixels.buffer_rgba())[..., :3]
