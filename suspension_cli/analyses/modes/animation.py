"""Moving pictures of modes: one period each, as GIF that repeats."""

from __future__ import annotations

import io
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from suspension_cli.analyses.modes import picture
from suspension_cli.analyses.modes.picture import Panel
from suspension_cli.design.faults import suggest
from suspension_cli.design.schema import Design
from suspension_cli.drawing import geometry, style
from suspension_cli.drawing.canvas import full_canvas
from suspension_cli.drawing.parts import Sketch
from suspension_cli.drawing.style import NOTE
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.pose import displace, layout, nominal_pose
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FRAMES = 24
"""Frames of one period, an even number: the way back shows those of the way there."""
DURATION = 50
"""Time that a frame is shown, ms; a whole number of hundredths of a second, as GIF needs."""
COLOURS = 64
"""Largest number of colours."""
DPI = 200
"""Resolution, dots per inch."""
WIDTH = 1.6
"""Width of the picture, in."""
TALLEST, LOWEST = 2.6, 0.9
"""Bounds of its height, in."""
FOOT = 0.2
"""Height of the remark below, in."""
ALL = "all"


@dataclass(frozen=True)
class _Scale:
    """Exaggeration of a picture of a mode.

    Attributes
    ----------
    factor : float
        From the mode's shape to the picture.
    note : str
        The exaggeration in words.
    """

    factor: float
    note: str


def parse(modes: Modes, text: str, option: str = "--animate") -> list[int]:
    """Parse numbers (from 1) and labels of modes, separated by commas; ``all`` for every one.

    Returns
    -------
    list of int
        Numbers from 0.

    Raises
    ------
    InputError
        If there is no such mode, or it is one of wires alone, whose shape is not drawn.

    Examples
    --------
    ``parse(modes, "1,test pitch")``
    """
    drawn = np.flatnonzero(modes.order == 0).tolist()
    found: list[int] = []
    for name in filter(None, map(str.strip, text.split(","))):
        if name == ALL:
            chosen = drawn
        elif name.isdecimal():
            chosen = [int(name) - 1] if 0 < int(name) <= len(modes.frequency) else []
        else:
            chosen = [n for n, label in enumerate(modes.label) if label == name]
        if not chosen:
            labels = list(dict.fromkeys(modes.label))
            remedy = f"give a number from 1 to {len(modes.frequency)}, {ALL}, or a label:"
            fault = Fault(
                option, "names no mode", f"{remedy} {suggest(name, labels)}", format_value(name)
            )
            raise InputError([fault])
        if not set(chosen) <= set(drawn):
            problem = "is a mode of wires alone, whose shape is not drawn"
            raise InputError(
                [Fault(option, problem, "name a mode of the bodies", format_value(name))]
            )
        found += [n for n in chosen if n not in found]
    if not found:
        remedy = f"give numbers or labels of modes, or {ALL}"
        raise InputError([Fault(option, "names no mode", remedy, format_value(text))])
    return found


def animate(modes: Modes, number: int, design: Design, scene: Scene) -> bytes:
    """Draw one period of a mode, as the picture of all modes shows it at its largest.

    Parameters
    ----------
    number : int
        Of the mode, from 0.
    scene : Scene
        The same design spelled out, without batch axes.

    Returns
    -------
    bytes
        GIF that repeats without end: displacements go with cos(2 pi n / `FRAMES`).
    """
    with style.house_style():
        rest = picture.sketch_at_rest(design, scene)
        scale = _choose_scale(modes, number, scene)
        there = [np.cos(2 * np.pi * n / FRAMES) for n in range(FRAMES // 2 + 1)]
        panels = [_panel(modes, number, rest, scale.factor * size) for size in there]
        low = np.min([panel.low for panel in panels], axis=0)
        high = np.max([panel.high for panel in panels], axis=0)
        frames = [
            _pixels(_figure(modes, rest, replace(panel, low=low, high=high), scale.note))
            for panel in panels
        ]
    return _gif([*frames, *frames[-2:0:-1]])


def _choose_scale(modes: Modes, number: int, scene: Scene) -> _Scale:
    """Exaggeration of a mode, relative to 1 mm or 1 mrad of the motion that names it."""
    shape, (body, dof) = modes.shape[number], modes.home[number]
    step = geometry.mode_step(layout(scene), modes.coordinate, shape)
    factor = geometry.amplitude(scene, step)
    name = f"{body}.{dof}"
    place = modes.coordinate.index(name) if name in modes.coordinate else int(abs(shape).argmax())
    drawn = factor * abs(float(shape[place]))
    unit = "mrad" if dof in ("roll", "pitch", "yaw") else "mm"
    times = style.format_significant(1e3 * drawn, 2)
    return _Scale(factor, f"1 {unit} of {modes.label[number]} is drawn as {times} {unit}")


def _panel(modes: Modes, number: int, rest: Sketch, factor: float) -> Panel:
    """The panel of a mode, displaced by a factor times its shape."""
    scene = rest.scene
    numbering = layout(scene)
    step = geometry.mode_step(numbering, modes.coordinate, modes.shape[number])
    pose = displace(numbering, nominal_pose(scene), factor * step)
    return picture.make_panel(modes, number, rest, pose)


def _figure(modes: Modes, rest: Sketch, panel: Panel, note: str) -> Figure:
    frame, gap = picture.measure_frame([panel]), picture.GAP
    tall = float(np.clip(WIDTH * frame.height / frame.width, LOWEST, TALLEST))
    figure = style.new_figure(WIDTH + 2 * gap, tall + picture.AROUND + FOOT)
    figure.set_dpi(DPI)
    canvas = full_canvas(figure)
    corner = gap, float(figure.get_size_inches()[1]) - gap
    picture.draw_panel(canvas, corner, (WIDTH, tall), modes, panel, rest, frame)
    canvas.text(gap, FOOT / 2, style.single_line(note, 50), color=NOTE, va="center", fontsize=4.6)
    canvas.flush()
    return figure


def _pixels(figure: Figure) -> Array:
    """Draw a figure into memory: colours (height, width, 3)."""
    canvas: Any = figure.canvas
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _gif(frames: list[Array]) -> bytes:
    """Encode frames (height, width, 3) with one palette as GIF that repeats without end."""
    half = frames[: len(frames) // 2 + 1]
    several = Image.fromarray(np.concatenate(half)).quantize(COLOURS, dither=Image.Dither.NONE)
    palette = np.array(several.getpalette()).reshape(-1, 3)
    palette[np.abs(palette - 255).sum(1).argmin()] = 255  # the paper
    images = [_with_palette(frame, palette) for frame in frames]
    stream = io.BytesIO()
    images[0].save(
        stream,
        format="GIF",
        save_all=True,
        append_images=images[1:],
        duration=DURATION,
        loop=0,
        optimize=False,
        comment=b"pendsus",
    )
    return stream.getvalue()


def _with_palette(frame: Array, palette: Array) -> Image.Image:
    """Replace each colour by the nearest of a palette (k, 3), which Pillow finds only nearly."""
    codes = frame.astype(np.int64) @ (1 << 16, 1 << 8, 1)
    found, place = np.unique(codes, return_inverse=True)
    colours = np.stack([found >> 16, (found >> 8) & 255, found & 255], axis=1)
    nearest = ((colours[:, None] - palette) ** 2).sum(-1).argmin(1)
    image = Image.fromarray(nearest[place].reshape(codes.shape).astype(np.uint8))
    image.putpalette(palette.astype(np.uint8).tobytes())
    return image
