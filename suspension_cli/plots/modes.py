"""A picture of every mode, so that one knows at a glance what moves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from suspension_cli.analysis.modes import Modes, described, place
from suspension_cli.conventions import DOFS, WORDS
from suspension_cli.design.scene import Array, Scene
from suspension_cli.design.schema import Design
from suspension_cli.mechanics.pose import nominal_pose
from suspension_cli.plots import geometry, parts, style
from suspension_cli.plots.bodies import outlines, size
from suspension_cli.plots.canvas import Canvas, sheet
from suspension_cli.plots.geometry import FACE, SIDE, View
from suspension_cli.plots.parts import Look, Sketch
from suspension_cli.plots.style import DOF_COLOUR, INK, NOTE, PALE

WIDTH = 1.85
"""Of a panel, in."""
GAP = 0.22
"""Between panels, in."""
HEAD = 0.40
"""Height of a panel's title, in."""
BARS = 0.44
"""Height of the energy bars below a picture, in."""
FOOT = 0.13
"""Height of the view's name between picture and bars, in."""
LEAST = 7.6
"""Width of a figure that takes its key, in."""
TALLEST, LOWEST = 3.3, 1.25
"""Bounds of the height of a picture, in."""
TOP = 1.06
"""Height of the figure's heading, in."""
THICK = 0.028
"""Of the support, as a share of the suspension's size."""
MOST = 120
"""Modes drawn; of more, the lowest."""
SHOWN = 3
"""Number of energy shares shown."""


@dataclass(frozen=True)
class Panel:
    """What one panel shows.

    Attributes
    ----------
    number : int
        The mode, from 0.
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
class Frame:
    """What all pictures of a figure have in common.

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
    """Draw every mode of a suspension, ascending.

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
        A panel a mode, for the lowest `MOST` (those of wires alone are in `plots.wires`): the suspension at rest (grey) and displaced (coloured by the degree
        of freedom that holds most of the kinetic energy, the stronger the more of it a body holds), in the view that shows most of the motion.
    """
    with style.house():
        rest = Sketch(design, scene, outlines(design, scene), nominal_pose(scene), THICK * size(scene))
        bodily = np.flatnonzero(modes.order == 0).tolist()
        panels = [_panel(modes, number, rest) for number in bodily[:MOST]]
        frame = _frame(panels)
        tall = float(np.clip((WIDTH - 0.1) * frame.height / frame.width, LOWEST, TALLEST))
        pitch = HEAD + tall + FOOT + BARS + GAP
        across = _columns(len(panels), WIDTH + GAP, pitch)
        figure = style.new_figure(max(across * (WIDTH + GAP) + GAP, LEAST), TOP + -(-len(panels) // across) * pitch)
        _heading(figure, design, f"The lowest {len(panels)} of {len(bodily)} modes. " if len(panels) < len(bodily) else "")
        canvas = sheet(figure)
        for n, panel in enumerate(panels):
            left = GAP + (n % across) * (WIDTH + GAP)
            top = figure.get_size_inches()[1] - TOP - (n // across) * pitch
            _title(canvas, left, top, modes, panel.number)
            _picture(canvas, (left, top - HEAD), tall, modes, panel, rest, frame)
            _bars(canvas, left, top - HEAD - tall - FOOT, modes, panel.number)
        canvas.flush()
        return figure


def view_of(modes: Modes, number: int, above: View) -> View:
    """The view that shows most of a mode's kinetic energy; vertical motion is seen side on and face on."""
    shares: dict[str, float] = dict.fromkeys(DOFS, 0.0)
    for coordinate, share in zip(modes.place, modes.shares[number], strict=True):
        if place(coordinate)[1] in shares:
            shares[place(coordinate)[1]] += float(share)
    side, face = shares["x"] + shares["pitch"] + shares["z"], shares["y"] + shares["roll"] + shares["z"]
    if shares["yaw"] > 0.2 and shares["yaw"] + shares["x"] + shares["y"] > max(side, face):
        return above
    return SIDE if side >= face - 1e-9 else FACE


def heading_of(modes: Modes, number: int) -> str:
    """A mode's number and frequency, as its panel's title says it."""
    frequency = float(modes.frequency[number])
    if modes.overdamped[number]:
        return f"{number + 1}  overdamped, decays at {style.significant(float(modes.decay_rate[number]))} 1/s"
    if np.isnan(frequency):
        return f"{number + 1}  unstable, grows at {style.significant(float(modes.growth_rate[number]))} 1/s"
    return f"{number + 1}  " + ("rigid" if frequency == 0 else f"{style.significant(frequency)} Hz")


def caption_of(modes: Modes, number: int) -> str:
    """Where a mode lives, in words, and the share of its kinetic energy there."""
    share = float(modes.shares[number].max())
    return f"{brief(modes.label[number], 27)} {_percent(share)}"


def brief(label: str, most: int) -> str:
    """A body and its motion in at most so many characters; what is too long is the body's name."""
    body, _, motion = label.rpartition(" ")
    return f"{style.plain(body, max(most - 1 - len(motion), 3))} {motion}"


def _percent(share: float) -> str:
    percent = 100 * share
    return f"{percent:.0f} %" if percent >= 9.5 or percent == 0 else f"{percent:.1f} %" if percent >= 0.05 else "< 0.1 %"


def _panel(modes: Modes, number: int, rest: Sketch) -> Panel:
    scene, bodies = rest.scene, rest.outlines
    view = view_of(modes, number, geometry.from_above(scene, bodies))
    pose = geometry.pose_of(scene, modes.coordinate, modes.shape[number])
    sketch = replace(rest, pose=pose)
    (x0, y0, z0), (x1, y1, z1) = parts.support_box(rest)
    plate = [[x, y, z] for x in (x0, x1) for y in (y0, y1) for z in ((z0,) if view.normal == 2 else (z0, z1))]
    points = np.concatenate([rest.points(view), sketch.points(view), view.see(plate)])
    return Panel(number, view, sketch, points.min(0), points.max(0))


def _frame(panels: list[Panel]) -> Frame:
    upright = [float(panel.high[1]) for panel in panels if panel.view.normal != 2]
    high = max(upright, default=0.0)
    heights = [(float(panel.high[1]) if panel.view.normal == 2 else high) - float(panel.low[1]) for panel in panels]
    return Frame(max(float(panel.high[0] - panel.low[0]) for panel in panels), max(heights), high)


def _columns(count: int, width: float, tall: float) -> int:
    """The number of columns: one row for a single body, else a figure somewhat wider than tall without a nearly empty last row."""
    if count <= 6:
        return count

    def badness(across: int) -> float:
        down = -(-count // across)
        shape = abs(np.log((across * width) / (down * tall + TOP) / 1.2))
        return shape + 1.5 * (across * down - count) / count

    return min(range(1, count + 1), key=badness)


def _heading(figure: Figure, design: Design, shown: str) -> None:
    style.title(figure, design.design.title, design.design.name)
    across, _ = figure.get_size_inches()
    swatches = [Patch(facecolor=style.tint(DOF_COLOUR[dof], 0.6), edgecolor=DOF_COLOUR[dof], label=WORDS[dof]) for dof in DOFS]
    swatches.insert(0, Patch(facecolor=style.tint(PALE, 0.25), edgecolor=PALE, label="at rest"))
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
    key = f"{shown}Colour: where most kinetic energy is; the stronger, the more of it a body holds. Bars: shares of kinetic energy. Motions exaggerated."
    style.write(figure, 0.2, 0.78, key, 7.5, NOTE)


def _title(canvas: Canvas, left: float, top: float, modes: Modes, number: int) -> None:
    colour = INK if modes.omega_squared[number] >= 0 else style.PALETTE[1]
    long = bool(np.isnan(modes.frequency[number]))
    canvas.text(left, top - 0.02, heading_of(modes, number), va="top", fontsize=6.5 if long else 9, fontweight="bold", color=colour)
    canvas.text(left, top - 0.20, caption_of(modes, number), va="top", fontsize=7.5)


def _picture(canvas: Canvas, corner: tuple[float, float], tall: float, modes: Modes, panel: Panel, rest: Sketch, frame: Frame) -> None:
    """The suspension at rest and displaced; all pictures of a figure have one scale, and their supports at one height."""
    scale = min((WIDTH - 0.05) / frame.width, (tall - 0.06) / frame.height)
    high = float(panel.high[1]) if panel.view.normal == 2 else frame.high
    origin = (corner[0] + WIDTH / 2 - scale * (panel.low[0] + panel.high[0]) / 2, corner[1] - 0.03 - scale * high)
    view = panel.view.at(origin, scale)
    colour, count = DOF_COLOUR[modes.home[panel.number][1]], len(rest.outlines)
    still = Look((PALE,) * count, (style.tint(PALE, 0.25),) * count, PALE, 0.7, 1)
    shares = modes.energy[panel.number].sum(-1)
    strength = 0.05 + 0.65 * shares / max(float(shares.max()), 1e-9)
    moving = Look((colour,) * count, tuple(style.tint(colour, float(s)) for s in strength), INK, 0.7, 3)
    parts.support(canvas, view, rest)
    parts.suspension(canvas, view, rest, still)
    parts.suspension(canvas, view, panel.sketch, moving)
    _crosses(canvas, view, panel.sketch, colour)
    canvas.text(corner[0] + WIDTH, corner[1] - tall - 0.01, view.name, ha="right", va="top", fontsize=6, color=NOTE)


def _crosses(canvas: Canvas, view: View, sketch: Sketch, colour: str) -> None:
    """A cross through each displaced body, which shows a rotation even of a circle."""
    for n, body in enumerate(sketch.outlines, 1):
        for axis in range(3):
            if axis != view.normal:
                arm = 0.3 * np.eye(3)[axis] * body.half
                canvas.line(view.see(geometry.moved(sketch.scene, sketch.pose, n, np.stack([-arm, arm]))), colour, 0.7, 4)


def _bars(canvas: Canvas, left: float, top: float, modes: Modes, number: int) -> None:
    """The largest shares of kinetic energy, each as a bar."""
    shares = modes.shares[number]
    for row, n in enumerate(np.argsort(-shares, kind="stable")[:SHOWN]):
        share, dof = float(shares[n]), place(modes.place[n])[1]
        if share < 5e-4:
            break
        middle = top - (row + 0.5) * BARS / SHOWN
        start, end = left + 0.60 * WIDTH, left + (0.60 + 0.26 * share) * WIDTH
        box = [[start, middle - 0.045], [end, middle - 0.045], [end, middle + 0.045], [start, middle + 0.045]]
        canvas.polygon(box, DOF_COLOUR.get(dof, NOTE), "none", 0.0, 2)
        canvas.text(left, middle, brief(described(modes.place[n]), 23), va="center", fontsize=6.2)
        canvas.text(end + 0.03, middle, _percent(share), va="center", fontsize=6.2, color=NOTE)
