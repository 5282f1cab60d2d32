"""Figures of mode shapes, one panel per mode."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from suspension_cli.conventions import DOF_NAMES, DOFS
from suspension_cli.design.schema import Design
from suspension_cli.drawing import geometry, parts, style
from suspension_cli.drawing.bodies import Outline, outlines, suspension_size
from suspension_cli.drawing.canvas import Canvas, full_canvas
from suspension_cli.drawing.geometry import FACE, SIDE, View
from suspension_cli.drawing.parts import Look, Sketch
from suspension_cli.drawing.style import DOF_COLOUR, INK, NOTE, PALE
from suspension_cli.linear.eigenmodes import Modes, describe, place
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.pose import Pose, nominal_pose
from suspension_cli.scene.scene import Scene

WIDTH = 1.85
"""Width of a panel, in."""
GAP = 0.22
"""Distance between panels, in."""
HEAD = 0.40
"""Height of a panel's title, in."""
BARS = 0.44
"""Height of the energy bars below a picture, in."""
FOOT = 0.13
"""Height of the view's name between picture and bars, in."""
LEAST = 7.6
"""Smallest width of a figure, which its key needs, in."""
TALLEST, LOWEST = 3.3, 1.25
"""Bounds of the height of a picture, in."""
TOP = 1.06
"""Height of the figure's heading, in."""
THICK = 0.028
"""Thickness of the support over the size of the suspension."""
MOST = 120
"""Largest number of modes drawn: the lowest ones."""
SHOWN = 3
"""Largest number of energy bars per mode."""
PAGE = 24
"""Largest number of modes of one figure."""
HIGHEST = 1.4
"""Largest ratio of height to width of a figure for a page."""
COLUMNS = 4
"""Largest number of panels side by side where modes take several figures, for a page."""
KINDS = {
    "longitudinal and pitch": ("x", "pitch"),
    "transverse and roll": ("y", "roll"),
    "vertical and yaw": ("z", "yaw"),
}
"""Kinds of modes that share a figure, and their degrees of freedom: coupled even in a symmetric
design, or few."""


@dataclass(frozen=True)
class Panel:
    """Contents of one panel.

    Attributes
    ----------
    number : int
        Of the mode, from 0.
    view : View
    sketch : Sketch
        The suspension displaced.
    low, high : (2,) arrays
        Bounds of the picture, m.
    """

    number: int
    view: View
    sketch: Sketch
    low: Array
    high: Array


@dataclass(frozen=True)
class Page:
    """One of several figures of modes.

    Attributes
    ----------
    kind : str
        Kind of its modes (`KINDS`); "" for all.
    numbers : tuple of int
        Its modes, from 0.
    figure : Figure
    """

    kind: str
    numbers: tuple[int, ...]
    figure: Figure


@dataclass(frozen=True)
class Frame:
    """Common scale and height of all pictures of a figure.

    Attributes
    ----------
    width, height : float
        Largest of any picture, m.
    high : float
        Upper bound of the pictures in side and face view, m: their supports stand at one height.
    """

    width: float
    height: float
    high: float


def draw(modes: Modes, design: Design, scene: Scene) -> Figure:
    """Draw the modes of a suspension, ascending.

    Parameters
    ----------
    modes : Modes
    design : Design
        For the shapes of bodies, the title and the lengths of blades.
    scene : Scene
        The same design spelled out, without batch axes.

    Returns
    -------
    Figure
        One panel per mode, for the lowest `MOST` (modes of wires alone are in
        `quality_picture`): the suspension at rest (grey) and displaced, in the view that shows most
        of the motion. The colour is that of the degree of freedom with most kinetic energy; the
        stronger it is, the larger the fraction of a body.
    """
    return draw_pages(modes, design, scene, MOST)[0].figure


def draw_pages(
    modes: Modes, design: Design, scene: Scene, most: int = PAGE, columns: int = 0
) -> list[Page]:
    """Draw the modes of a suspension on one figure, or on several where there are many.

    Parameters
    ----------
    modes, design, scene
        As of `draw`.
    most : int
        Largest number of modes of one figure. More are split by kind (`KINDS`), and the modes of
        one kind, ascending, into figures of about equal numbers that fit a page.
    columns : int
        Largest number of panels side by side, so that a figure fits a page: `COLUMNS` where there
        are several; 0 for as many as suit a single one.
    """
    bodily = np.flatnonzero(modes.order == 0).tolist()
    numbers = bodily[:MOST]
    cut = len(numbers) < len(bodily)
    note = f"The lowest {len(numbers)} of {len(bodily)} modes. " if cut else ""
    with style.house_style():
        rest = sketch_at_rest(design, scene)
        panels = {number: make_panel(modes, number, rest) for number in numbers}
        common = measure_frame([*panels.values()])
        pages = [("", numbers)]
        if len(numbers) > most:
            pages = [*_split(modes, numbers, _choose_number(common))]
        return [
            Page(
                kind,
                tuple(part),
                _figure(
                    modes,
                    rest,
                    [panels[n] for n in part],
                    common,
                    kind,
                    note,
                    columns or (COLUMNS if kind else 0),
                ),
            )
            for kind, part in pages
        ]


def sketch_at_rest(design: Design, scene: Scene) -> Sketch:
    """Make the sketch of a design at rest."""
    thick = THICK * suspension_size(scene)
    return Sketch(design, scene, outlines(design, scene), nominal_pose(scene), thick)


def _choose_number(common: Frame) -> int:
    """Choose the number of modes of a page on which pictures need not shrink."""
    highest = HIGHEST * (COLUMNS * (WIDTH + GAP) + GAP)
    pitch = choose_height(common) + HEAD + FOOT + BARS + GAP
    return COLUMNS * max(int((highest - TOP) / pitch), 1)


def _split(modes: Modes, numbers: list[int], most: int) -> Iterator[tuple[str, list[int]]]:
    """Split modes by kind, and a kind into pages of at most `most`, each with its title."""
    for title, dofs in KINDS.items():
        kind = [number for number in numbers if modes.home[number][1] in dofs]
        count = -(-len(kind) // most)
        for page in range(count):
            part = kind[page * len(kind) // count : (page + 1) * len(kind) // count]
            yield title + (f" modes, {page + 1} of {count}" if count > 1 else " modes"), part


def _figure(
    modes: Modes,
    rest: Sketch,
    panels: list[Panel],
    common: Frame,
    kind: str,
    note: str,
    widest: int,
) -> Figure:
    """Draw panels on a figure: as wide as it suits, or at most `widest` on one for a page."""
    tall = choose_height(common)
    around = HEAD + FOOT + BARS + GAP
    if widest:
        rows = -(-len(panels) // widest)
        across = -(-len(panels) // rows)
        width = max(across * (WIDTH + GAP) + GAP, LEAST)
        highest = (1.2 if rows <= 2 else HIGHEST) * width
        tall = max(min(tall, (highest - TOP) / rows - around), LOWEST)
    else:
        across = _choose_columns(len(panels), WIDTH + GAP, tall + around)
        width = max(across * (WIDTH + GAP) + GAP, LEAST)
        rows = -(-len(panels) // across)
    pitch = tall + around
    figure = style.new_figure(width, TOP + rows * pitch)
    _draw_heading(figure, rest.design, kind, note)
    canvas = full_canvas(figure)
    for n, one in enumerate(panels):
        left = GAP + (n % across) * (WIDTH + GAP)
        top = figure.get_size_inches()[1] - TOP - (n // across) * pitch
        draw_panel(canvas, (left, top), tall, modes, one, rest, common)
    canvas.flush()
    return figure


def choose_height(common: Frame) -> float:
    """Choose the height of pictures of a frame whose size is not bound by a page, in."""
    return float(np.clip((WIDTH - 0.1) * common.height / common.width, LOWEST, TALLEST))


def draw_panel(
    canvas: Canvas,
    corner: tuple[float, float],
    tall: float,
    modes: Modes,
    panel: Panel,
    rest: Sketch,
    frame: Frame,
) -> None:
    """Draw the title, the picture and the energy bars of a mode.

    Parameters
    ----------
    canvas : Canvas
        In inches.
    corner : (float, float)
        Upper left corner, in.
    tall : float
        Height of the picture, in.
    modes : Modes
    panel : Panel
    rest : Sketch
        The suspension at rest.
    frame : Frame
    """
    left, top = corner
    _draw_title(canvas, left, top, modes, panel.number)
    _draw_picture(canvas, (left, top - HEAD), tall, modes, panel, rest, frame)
    _draw_bars(canvas, left, top - HEAD - tall - FOOT, modes, panel.number)


def choose_view(modes: Modes, number: int, above: View) -> View:
    """Choose the view that shows most of a mode's kinetic energy.

    Vertical motion shows in both the side and the face view.
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
        return (
            f"{number + 1}  overdamped, decays at"
            f" {style.format_significant(float(modes.decay_rate[number]))} 1/s"
        )
    if np.isnan(frequency):
        return (
            f"{number + 1}  unstable, grows at"
            f" {style.format_significant(float(modes.growth_rate[number]))} 1/s"
        )
    return f"{number + 1}  " + (
        "rigid" if frequency == 0 else f"{style.format_significant(frequency)} Hz"
    )


def format_caption(modes: Modes, number: int) -> str:
    """Label of a mode, and the percentage of its kinetic energy there."""
    fraction = float(modes.fractions[number].max())
    return f"{shorten_label(modes.label[number], 27)} {_format_percent(fraction)}"


def shorten_label(label: str, most: int) -> str:
    """Shorten a body and its motion to `most` characters, by the body's name."""
    body, _, motion = label.rpartition(" ")
    return f"{style.single_line(body, max(most - 1 - len(motion), 3))} {motion}"


def _format_percent(fraction: float) -> str:
    percent = 100 * fraction
    if percent >= 9.5 or percent == 0:
        return f"{percent:.0f} %"
    return f"{percent:.1f} %" if percent >= 0.05 else "< 0.1 %"


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
    plate = [
        [x, y, z]
        for x in (x0, x1)
        for y in (y0, y1)
        for z in ((z0,) if view.normal == 2 else (z0, z1))
    ]
    points = np.concatenate([rest.points(view), sketch.points(view), view.see(plate)])
    return Panel(number, view, sketch, points.min(0), points.max(0))


def measure_frame(panels: list[Panel]) -> Frame:
    """Measure the common scale and height of panels."""
    upright = [float(panel.high[1]) for panel in panels if panel.view.normal != 2]
    high = max(upright, default=0.0)
    heights = [
        (float(panel.high[1]) if panel.view.normal == 2 else high) - float(panel.low[1])
        for panel in panels
    ]
    return Frame(max(float(panel.high[0] - panel.low[0]) for panel in panels), max(heights), high)


def _choose_columns(count: int, width: float, tall: float) -> int:
    """Choose the number of columns of panels of some width and height, in.

    One row for up to six, else a figure somewhat wider than tall without a nearly empty last row.
    """
    if count <= 6:
        return count

    def badness(across: int) -> float:
        down = -(-count // across)
        shape = abs(np.log((across * width) / (down * tall + TOP) / 1.2))
        return shape + 1.5 * (across * down - count) / count

    return min(range(1, count + 1), key=badness)


def _draw_heading(figure: Figure, design: Design, kind: str, note: str) -> None:
    name = design.design.name
    style.write_title(figure, design.design.title, f"{name}: {kind}" if kind else name)
    across, _ = figure.get_size_inches()
    swatches = [
        Patch(
            facecolor=style.with_opacity(DOF_COLOUR[dof], 0.6),
            edgecolor=DOF_COLOUR[dof],
            label=DOF_NAMES[dof],
        )
        for dof in DOFS
    ]
    swatches.insert(
        0, Patch(facecolor=style.with_opacity(PALE, 0.25), edgecolor=PALE, label="at rest")
    )
    figure.legend(
        handles=swatches,
        loc="upper left",
        bbox_to_anchor=(0.12 / across, 1 - 0.52 / figure.get_size_inches()[1]),
        ncols=7,
        fontsize=7.5,
        handlelength=1.2,
        columnspacing=1.2,
        handletextpad=0.5,
        borderpad=0.2,
    )
    key = (
        f"{note}Colour: degree of freedom with most kinetic energy, stronger where a body has"
        " more. Bars: fractions of it. Motions exaggerated."
    )
    style.write_text(figure, 0.2, 0.78, key, 7.5, NOTE)


def _draw_title(canvas: Canvas, left: float, top: float, modes: Modes, number: int) -> None:
    colour = INK if modes.omega_squared[number] >= 0 else style.PALETTE[1]
    long = bool(np.isnan(modes.frequency[number]))
    canvas.text(
        left,
        top - 0.02,
        format_heading(modes, number),
        va="top",
        fontsize=6.5 if long else 9,
        fontweight="bold",
        color=colour,
    )
    canvas.text(left, top - 0.20, format_caption(modes, number), va="top", fontsize=7.5)


def _draw_picture(
    canvas: Canvas,
    corner: tuple[float, float],
    tall: float,
    modes: Modes,
    panel: Panel,
    rest: Sketch,
    frame: Frame,
) -> None:
    """Draw the suspension at rest and displaced, and name the view."""
    colour = DOF_COLOUR[modes.home[panel.number][1]]
    draw_shape(canvas, corner, (WIDTH, tall), modes, panel, rest, frame, colour, 0.7)
    canvas.text(
        corner[0] + WIDTH,
        corner[1] - tall - 0.01,
        panel.view.name,
        ha="right",
        va="top",
        fontsize=6,
        color=NOTE,
    )


def draw_shape(
    canvas: Canvas,
    corner: tuple[float, float],
    size: tuple[float, float],
    modes: Modes,
    panel: Panel,
    rest: Sketch,
    frame: Frame,
    colour: str,
    thick: float,
) -> None:
    """Draw the suspension at rest and displaced, at the scale and height of the frame.

    Parameters
    ----------
    canvas, modes, panel, rest, frame
        As of `draw_panel`.
    corner, size : (float, float)
        Upper left corner, width and height of the picture, in.
    colour : colour
        Of bodies; the more energy of the mode they have, the stronger.
    thick : float
        Of wires, points.
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
        (colour,) * count,
        tuple(style.with_opacity(colour, float(s)) for s in strength),
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
    _draw_crosses(canvas, view, panel.sketch, colour, thick)


def _draw_crosses(canvas: Canvas, view: View, sketch: Sketch, colour: str, thick: float) -> None:
    """Draw a cross through each displaced body, and in a circle a mark on the rim.

    They show rotations; `_draw_references` shows where the marks are at rest.
    """
    for n, body in enumerate(sketch.outlines, 1):
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
    """Draw, in every circle, the radius to the place of the mark on its rim at rest."""
    for n, body in enumerate(rest.outlines, 1):
        if body.axis == view.normal:
            line = np.stack([np.zeros(3), _rim(body, view)])
            line = geometry.position_of(rest.scene, rest.pose, n, line)
            canvas.line(view.see(line), NOTE, 0.5, 3.5, (0, (2, 2)))


def _rim(body: Outline, view: View) -> Array:
    """Point (3,) on the rim of a circle, in the body's frame, m."""
    return np.eye(3)[0 if view.normal == 2 else 2] * body.half


def _draw_bars(canvas: Canvas, left: float, top: float, modes: Modes, number: int) -> None:
    """Draw the largest fractions of kinetic energy as bars."""
    fractions = modes.fractions[number]
    for row, n in enumerate(np.argsort(-fractions, kind="stable")[:SHOWN]):
        fraction, dof = float(fractions[n]), place(modes.place[n])[1]
        if fraction < 5e-4:
            break
        middle = top - (row + 0.5) * BARS / SHOWN
        start, end = left + 0.60 * WIDTH, left + (0.60 + 0.26 * fraction) * WIDTH
        box = [
            [start, middle - 0.045],
            [end, middle - 0.045],
            [end, middle + 0.045],
            [start, middle + 0.045],
        ]
        canvas.polygon(box, DOF_COLOUR.get(dof, NOTE), "none", 0.0, 2)
        canvas.text(
            left, middle, shorten_label(describe(modes.place[n]), 23), va="center", fontsize=6.2
        )
        text = _format_percent(fraction)
        canvas.text(end + 0.03, middle, text, va="center", fontsize=6.2, color=NOTE)
