"""Moving pictures of modes: one period each, as GIF that repeats."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from suspension_cli.analyses.modes import picture
from suspension_cli.analyses.modes.picture import Panel
from suspension_cli.design.faults import suggest
from suspension_cli.design.schema import Design
from suspension_cli.drawing import geometry, style
from suspension_cli.drawing.geometry import Sketch
from suspension_cli.drawing.parts import full_canvas
from suspension_cli.drawing.style import NOTE
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.scene.pose import displace, layout, nominal_pose
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FRAMES = 24
"""Frames of one period; even, as the second half repeats those of the first in reverse."""
DURATION = 50
"""Time that a frame is shown, ms; a whole number of hundredths of a second, as GIF needs."""
COLOURS = 64
"""Largest number of colours."""
DPI = 200
"""Resolution, dots per inch."""
WIDTH, TALLEST, LOWEST = 1.6, 2.6, 0.9
"""Width of the picture, and bounds of its height, in."""
FOOT = 0.2
"""Height of the remark below, in."""
ALL = "all"


def parse(modes: Modes, text: str, option: str = "--animate") -> list[int]:
    """Parse numbers (from 1) and labels of modes, separated by commas, or ``all``.

    Returns numbers from 0. Raises `InputError` if there is no such mode, or it is one of wires
    alone, whose shape is not drawn.
    """
    drawn = np.flatnonzero(modes.order == 0).tolist()
    found: list[int] = []
    for name in [*filter(None, map(str.strip, text.split(",")))] or [text]:
        if name == ALL:
            chosen = drawn
        elif name.isdecimal():
            chosen = [int(name) - 1] if 0 < int(name) <= len(modes.frequency) else []
        else:
            chosen = [n for n, label in enumerate(modes.label) if label == name]
        given = format_value(name)
        if not chosen:
            remedy = f"give a number from 1 to {len(modes.frequency)}, {ALL}, or a label:"
            remedy += f" {suggest(name, list(dict.fromkeys(modes.label)))}"
            raise InputError([Fault(option, "names no mode", remedy, given)])
        if not set(chosen) <= set(drawn):
            problem = "is a mode of wires alone, whose shape is not drawn"
            raise InputError([Fault(option, problem, "name a mode of the bodies", given)])
        found += chosen
    return [*dict.fromkeys(found)]


def animate(modes: Modes, number: int, design: Design, scene: Scene) -> bytes:
    """Draw one period of a mode, with the largest displacement as in the picture of all modes.

    Returns a GIF that repeats without end: displacements go with cos(2 pi n / `FRAMES`).
    """
    with style.house_style():
        rest = geometry.sketch_at_rest(design, scene, picture.THICK)
        numbering, still = layout(scene), nominal_pose(scene)
        step = geometry.mode_step(numbering, modes.coordinate, modes.shape[number])
        factor = geometry.amplitude(scene, step)
        sizes = factor * np.cos(2 * np.pi * np.arange(FRAMES // 2 + 1) / FRAMES)
        poses = [displace(numbering, still, size * step) for size in sizes]
        panels = [picture.make_panel(modes, number, rest, pose) for pose in poses]
        low = np.min([panel.low for panel in panels], axis=0)
        high = np.max([panel.high for panel in panels], axis=0)
        note = _describe_scale(modes, number, factor)
        frames = [
            _pixels(_figure(modes, rest, replace(panel, low=low, high=high), note))
            for panel in panels
        ]
    return _gif(frames)


def _describe_scale(modes: Modes, number: int, factor: float) -> str:
    """Exaggeration of a mode in words, relative to 1 mm or 1 mrad of the motion that names it."""
    shape, (body, dof) = modes.shape[number], modes.home[number]
    name = f"{body}.{dof}"
    place = modes.coordinate.index(name) if name in modes.coordinate else int(abs(shape).argmax())
    unit = "mrad" if dof in ("roll", "pitch", "yaw") else "mm"
    times = style.format_significant(1e3 * factor * abs(float(shape[place])), 2)
    return f"1 {unit} of {modes.label[number]} is drawn as {times} {unit}"


def _figure(modes: Modes, rest: Sketch, panel: Panel, note: str) -> Figure:
    """Draw one frame."""
    extent, gap = picture.extent([panel]), picture.GAP
    tall = float(np.clip(WIDTH * extent[1] / extent[0], LOWEST, TALLEST))
    figure = style.new_figure(WIDTH + 2 * gap, tall + picture.AROUND + FOOT)
    figure.set_dpi(DPI)
    canvas = full_canvas(figure)
    corner = gap, float(figure.get_size_inches()[1]) - gap
    picture.draw_panel(canvas, corner, (WIDTH, tall), modes, panel, rest, extent)
    canvas.text(gap, FOOT / 2, style.single_line(note, 50), color=NOTE, va="center", fontsize=4.6)
    canvas.flush()
    return figure


def _pixels(figure: Figure) -> Image.Image:
    """Draw a figure into memory."""
    canvas: Any = figure.canvas
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])


def _gif(frames: list[Image.Image]) -> bytes:
    """Encode frames, there and back, with one palette, as a GIF that repeats."""
    every = Image.fromarray(np.concatenate([np.asarray(frame) for frame in frames]))
    palette = every.quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE)
    images = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    images += images[-2:0:-1]
    stream = io.BytesIO()
    how: Any = {"duration": DURATION, "loop": 0, "optimize": False, "comment": b"pendsus"}
    images[0].save(stream, format="GIF", save_all=True, append_images=images[1:], **how)
    return stream.getvalue()
