"""Figures of mode shapes, one panel per mode."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.conventions import DOFS
from suspension_cli.design.schema import Design
from suspension_cli.drawing import geometry, parts, style
from suspension_cli.drawing.bodies import Outline, outlines, suspension_size
from suspension_cli.drawing.canvas import Canvas, full_canvas
from suspension_cli.drawing.geometry import FACE, SIDE, View
from suspension_cli.drawing.panels import write_heading
from suspension_cli.drawing.parts import Look, Sketch
from suspension_cli.drawing.style import INK, NOTE, PALE
from suspension_cli.linear.eigenmodes import Modes, describe, place
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.pose import Pose, nominal_pose
from suspension_cli.scene.scene import Scene

ACROSS = 6
"""Largest number of panels side by side."""
GAP = 0.1
"""Distance between panels, in."""
HEAD = 0.16
"""Height of a panel's title, in."""
ROW = 0.125
"""Height of a row of the energies below a picture, in."""
SHOWN = 3
"""Largest number of these rows."""
AROUND = HEAD + (SHOWN + 1) * ROW + GAP
"""Height of a panel without its picture, in."""
SMALL = 5.5
"""Font size, points; that of a panel's title is `LARGE`."""
LARGE = 7.0
ROW_STYLE: Any = {"va": "center", "fontsize": SMALL}
LEAST = 0.02
"""Least fraction of kinetic energy that is written."""
TOP = 0.66
"""Height of the figure's heading, in."""
THICK = 0.028
"""Thickness of the support over the size of the suspension."""
MOST = 120
"""Largest number of modes drawn: the lowest ones."""
PAGE = 24
"""Largest number of modes of one figure."""
KINDS = {
    "longitudinal and pitch": ("x", "pitch"),
    "transverse and roll": ("y", "roll"),
    "vertical and yaw": ("z", "yaw"),
}
"""Kinds of modes that share a figure, and their degrees of freedom: coupled even in a symmetric
design, or few."""


@dataclass(frozen=True)
class Panel:
    """Contents of one panel: a mode (from 0), displaced, and the bounds of its picture, m."""

    number: int
    view: View
    sketch: Sketch
    low: Array
    high: Array


@dataclass(frozen=True)
class Page:
    """One of several figures of modes: their kind (`KINDS`; "" for all), and numbers from 0."""

    kind: str
    numbers: tuple[int, ...]
    figure: Figure


@dataclass(frozen=True)
class Frame:
    """Common scale of all pictures of a figure: largest width and height, m.

    `high` is the upper bound of the pictures in side and face view, m, where their supports are.
    """

    width: float
    height: float
    high: float


def draw_pages(modes: Modes, design: Design, scene: Scene, subtitle: str) -> list[Page]:
    """Draw the modes of a suspension, ascending, on figures of a page's width.

    There is one panel for each of the lowest `MOST` modes (modes of wires alone are in
    `quality_picture`). It shows the suspension at rest (grey) and displaced, in the view that shows
    most of the motion. The more kinetic energy a body has, the stronger its stage's colour. More
    than `PAGE` modes are split by kind (`KINDS`), and those of one kind into figures of about equal
    numbers.
    """
    bodily = np.flatnonzero(modes.order == 0).tolist()
    numbers = bodily[:MOST]
    if not numbers:
        return []
    note = f"The lowest {MOST} of {len(bodily)} modes. " if len(bodily) > MOST else ""
    with style.house_style():
        rest = sketch_at_rest(design, scene)
        panels = {number: make_panel(modes, number, rest) for number in numbers}
        common = measure_frame([*panels.values()])
        result = []
        for kind, part in [("", numbers)] if len(numbers) <= PAGE else _split(modes, numbers):
            title = (kind or "normal modes").capitalize(), subtitle
            figure = _figure(modes, rest, [panels[n] for n in part], common, title, note)
            result.append(Page(kind, tuple(part), figure))
        return result


def sketch_at_rest(design: Design, scene: Scene) -> Sketch:
    """Make the sketch of a design at rest."""
    thick = THICK * suspension_size(scene)
    return Sketch(design, scene, outlines(design, scene), nominal_pose(scene), thick)


def _split(modes: Modes, numbers: list[int]) -> Iterator[tuple[str, list[int]]]:
    """Split modes by kind, and a kind into pages of at most `PAGE`, each with its title."""
    for title, dofs in KINDS.items():
        kind = [number for number in numbers if modes.home[number][1] in dofs]
        count = -(-len(kind) // PAGE)
        for page in range(count):
            part = kind[page * len(kind) // count : (page + 1) * len(kind) // count]
            yield title + (f" modes, {page + 1} of {count}" if count > 1 else " modes"), part


def _figure(
    modes: Modes,
    rest: Sketch,
    panels: list[Panel],
    common: Frame,
    title: tuple[str, str],
    note: str,
) -> Figure:
    """Draw panels on a figure of a page's width, and at most its height."""
    rows = -(-len(panels) // ACROSS)
    across = -(-len(panels) // rows)
    width = (style.PAGE_WIDTH - GAP) / across
    tall = min(
        (style.PAGE_HEIGHT - TOP) / rows - AROUND, (width - GAP) * common.height / common.width
    )
    height = TOP + rows * (tall + AROUND)
    figure = style.new_figure(style.PAGE_WIDTH, height)
    write_heading(figure, *title)
    key = (
        f"{note}Grey: at rest. Colour: stage, as in the bars below; stronger where it has more"
        " kinetic energy. Bars: fractions of this. Motions exaggerated."
    )
    style.write_text(figure, 0.1, 0.44, key, SMALL, NOTE)
    canvas = full_canvas(figure)
    for n, one in enumerate(panels):
        corner = GAP + (n % across) * width, height - TOP - (n // across) * (tall + AROUND)
        draw_panel(canvas, corner, (width - GAP, tall), modes, one, rest, common)
    canvas.flush()
    return figure


def draw_panel(
    canvas: Canvas,
    corner: tuple[float, float],
    size: tuple[float, float],
    modes: Modes,
    panel: Panel,
    rest: Sketch,
    frame: Frame,
) -> None:
    """Draw the title, the picture and the energies of a mode.

    `corner` is the upper left corner, `size` the width and height of the picture, in.
    """
    (left, top), (width, tall), number = corner, size, panel.number
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
    draw_shape(canvas, (left, top), size, modes, panel, rest, frame, tuple(colours.values()), 0.6)
    top -= tall + ROW / 2
    canvas.text(left + width, top, panel.view.name, ha="right", color=NOTE, **ROW_STYLE)
    _draw_energies(canvas, left, top - ROW, width, modes, number, colours)


def choose_view(modes: Modes, number: int, above: View) -> View:
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
        return above
    return SIDE if side >= face - 1e-9 else FACE


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


def shorten_label(label: str, most: int) -> str:
    """Shorten a body and its motion to `most` characters, by the body's name."""
    body, _, motion = label.rpartition(" ")
    return f"{style.single_line(body, max(most - 1 - len(motion), 3))} {motion}"


def _format_percent(fraction: float) -> str:
    percent = 100 * fraction
    if percent >= 9.5 or percent == 0:
        return f"{percent:.0f} %"
    return f"{percent:.1f} %"


def make_panel(
    modes: Modes, number: int, rest: Sketch, pose: Pose | None = None, view: View | None = None
) -> Panel:
    """Make the panel of a mode, displaced to a pose; by default that of `geometry.mode_pose`."""
    scene, bodies = rest.scene, rest.outlines
    if view is None:
        view = choose_view(modes, number, geometry.from_above(scene, bodies))
    if pose is None:
        pose = geometry.mode_pose(scene, modes.coordinate, modes.shape[number])
    sketch = replace(rest, pose=pose)
    (x0, y0, z0), (x1, y1, z1) = parts.support_box(rest)
    heights = (z0,) if view.normal == 2 else (z0, z1)
    plate = [*product((x0, x1), (y0, y1), heights)]
    points = np.concatenate([rest.points(view), sketch.points(view), view.see(plate)])
    return Panel(number, view, sketch, points.min(0), points.max(0))


def measure_frame(panels: list[Panel]) -> Frame:
    """Measure the common scale and height of panels."""
    high = max((float(p.high[1]) for p in panels if p.view.normal != 2), default=0.0)
    tops = [float(p.high[1]) if p.view.normal == 2 else high for p in panels]
    height = max(top - float(p.low[1]) for top, p in zip(tops, panels, strict=True))
    return Frame(max(float(p.high[0] - p.low[0]) for p in panels), height, high)


def draw_shape(
    canvas: Canvas,
    corner: tuple[float, float],
    size: tuple[float, float],
    modes: Modes,
    panel: Panel,
    rest: Sketch,
    frame: Frame,
    colours: tuple[str, ...],
    thick: float,
) -> None:
    """Draw the suspension at rest and displaced, at the scale and height of the frame.

    `corner` and `size` are as of `draw_panel`. The more energy a body has, the stronger its colour;
    wires are `thick` points wide.
    """
    scale = min((size[0] - 0.05) / frame.width, (size[1] - 0.06) / frame.height)
    high = float(panel.high[1]) if panel.view.normal == 2 else frame.high
    origin = (
        corner[0] + size[0] / 2 - scale * (panel.low[0] + panel.high[0]) / 2,
        corner[1] - 0.03 - scale * high,
    )
    view = panel.view.at(origin, scale)
    count = len(rest.outlines)
    still = Look((PALE,) * count, (style.with_opacity(PALE, 0.25),) * count, PALE, thick, 1)
    energy = modes.energy[panel.number].sum(-1)
    strength = 0.05 + 0.65 * energy / max(float(energy.max()), 1e-9)
    moving = Look(
        colours,
        tuple(map(style.with_opacity, colours, strength.tolist())),
        INK,
        thick,
        3,
    )

    def draw_rest(canvas: Canvas) -> None:
        here = panel.view.at(np.zeros(2), scale)
        parts.draw_support(canvas, here, rest)
        parts.draw_suspension(canvas, here, rest, still)
        _draw_references(canvas, here, rest)

    canvas.stamp((id(rest), panel.view.name, scale, thick), origin, draw_rest)
    parts.draw_suspension(canvas, view, panel.sketch, moving)
    _draw_crosses(canvas, view, panel.sketch, colours, thick)


def _draw_crosses(
    canvas: Canvas, view: View, sketch: Sketch, colours: tuple[str, ...], thick: float
) -> None:
    """Draw a cross through each displaced body, and in a circle a mark on the rim.

    They show rotations; `_draw_references` shows the marks at rest.
    """
    for n, (body, colour) in enumerate(zip(sketch.outlines, colours, strict=True), 1):
        for axis in range(3):
            if axis != view.normal:
                arm = 0.3 * np.eye(3)[axis] * body.half
                line = geometry.position_of(sketch.scene, sketch.pose, n, np.stack([-arm, arm]))
                canvas.line(view.see(line), colour, thick, 4)
        if body.axis == view.normal:
            rim = _rim(body, view)
            for low, width in ((0.0, thick), (0.82, 3.4 * thick)):
                line = np.stack([low * rim, rim])
                line = geometry.position_of(sketch.scene, sketch.pose, n, line)
                canvas.line(view.see(line), colour, width, 4)


def _draw_references(canvas: Canvas, view: View, rest: Sketch) -> None:
    """Draw, in every circle, the radius to the mark on its rim at rest."""
    for n, body in enumerate(rest.outlines, 1):
        if body.axis == view.normal:
            line = np.stack([np.zeros(3), _rim(body, view)])
            line = geometry.position_of(rest.scene, rest.pose, n, line)
            canvas.line(view.see(line), NOTE, 0.5, 3.5, (0, (2, 2)))


def _rim(body: Outline, view: View) -> Array:
    """Point (3,) on the rim of a circle, in the body's frame, m."""
    return np.eye(3)[0 if view.normal == 2 else 2] * body.half


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
        fraction, stage = float(fractions[n]), place(modes.place[n])[0].partition(".")[0]
        if fraction < LEAST:
            break
        end, low, high = left + width * fraction, middle - 0.062, middle - 0.04
        box = [[left, low], [end, low], [end, high], [left, high]]
        canvas.polygon(box, colours.get(stage, NOTE), "none", 0.0, 2)
        percent = _format_percent(fraction)
        label = shorten_label(describe(modes.place[n]), int(width / 0.0435) - len(percent) - 1)
        canvas.text(left, middle, f"{label} {percent}", **ROW_STYLE)
        middle -= ROW
