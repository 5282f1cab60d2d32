"""Dimension lines, leaders and other marks of technical drawing, on a canvas in inches."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Unpack

import numpy as np

from suspension_cli.drawing.canvas import Canvas, TextLook
from suspension_cli.drawing.style import NOTE
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

SIZE = 5.6
"""Font size of dimensions, points."""
HEAD = 0.06
"""Length of an arrowhead, in."""
THIN = 0.5
"""Width of a dimension line, points."""
LETTER = 0.60 * SIZE / 72
"""Approximate width of a character, in."""
BLANK = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
"""Box behind a text, which hides what lies below."""
ORDER = 7.0
"""Order of dimensions on the canvas: above everything else."""


def width_of(text: str) -> float:
    """Approximate width of a text in inches, without the control characters of mathtext."""
    return LETTER * len("".join(sign for sign in text if sign not in "$_{}\\"))


def draw_arrow(canvas: Canvas, tail: Array, tip: Array) -> None:
    """Draw a line with a filled head at its tip."""
    along = (tip - tail) / max(float(np.linalg.norm(tip - tail)), 1e-12)
    across = np.array([-along[1], along[0]])
    canvas.line([tail, tip - 0.5 * HEAD * along], NOTE, THIN, ORDER)
    canvas.polygon(
        [tip, tip - HEAD * along + 0.17 * HEAD * across, tip - HEAD * along - 0.17 * HEAD * across],
        NOTE,
        "none",
        0.0,
        ORDER,
    )


def draw_extension(canvas: Canvas, start: ArrayLike, end: ArrayLike) -> None:
    """Draw a thin line from the object to a little beyond its dimension line."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    span = float(np.linalg.norm(end - start))
    if span > 1e-9:
        canvas.line([start, end + 0.04 * (end - start) / span], NOTE, 0.35, ORDER - 0.1)


def draw_dimension(
    canvas: Canvas,
    a: ArrayLike,
    b: ArrayLike,
    text: str,
    clear: float = 0.0,
    place: float = 0.5,
) -> None:
    """Draw a dimension line from a to b (2,), in inches, with its text.

    The text is in the middle, along the line, if there is room; else beyond b and horizontal. If
    there is no room for arrows either, they come from outside.

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
    middle, outside = (a + b) / 2, 0.0
    if span > 2.6 * HEAD:
        draw_arrow(canvas, middle, a)
        draw_arrow(canvas, middle, b)
    else:
        outside = 2.2 * HEAD
        canvas.line([a, b], NOTE, THIN, ORDER)
        draw_arrow(canvas, a - outside * along, a)
        draw_arrow(canvas, b + outside * along, b)
    if not text:
        return
    inside = span + min(clear, 0.0)
    if inside > width_of(text) + 3 * HEAD:
        angle = float(np.degrees(np.arctan2(along[1], along[0])))
        angle = angle - 180 if angle > 90 else angle + 180 if angle <= -90 else angle
        end = (width_of(text) / 2 + 1.5 * HEAD) / inside
        place = min(max(place, end), 1 - end)
        write_note(canvas, a + place * inside * along, text, rotation=angle)
        return
    if abs(along[0]) > 0.5:
        across, up = "left" if along[0] > 0 else "right", "center"
    else:
        across, up = "center", "bottom" if along[1] > 0 else "top"
    write_note(canvas, b + (max(clear, outside) + 0.05) * along, text, ha=across, va=up)


def write_note(canvas: Canvas, where: Iterable[float], text: str, **how: Unpack[TextLook]) -> None:
    """Write text, hiding what is below it; centred on a point unless `how` says otherwise."""
    look: TextLook = {"fontsize": SIZE, "color": NOTE, "bbox": BLANK}
    look |= {"ha": "center", "va": "center", **how}
    x, y = map(float, where)
    canvas.text(x, y, text, **look)


def draw_leader(canvas: Canvas, x: float, y: float, target: ArrayLike, text: str) -> None:
    """Write text that ends at x, with a thin line from there to a dot at the target."""
    target = np.asarray(target, dtype=float)
    knee = np.array([x + 0.10, y])
    canvas.line([[x + 0.02, y], knee, target], NOTE, 0.4, ORDER - 0.1)
    draw_dot(canvas, target)
    canvas.text(x, y, text, fontsize=SIZE, color=NOTE, ha="right", va="center")


def draw_dot(canvas: Canvas, where: Array, colour: str = NOTE) -> None:
    """Draw a small dot."""
    angle = np.linspace(0, 2 * np.pi, 13)
    canvas.polygon(
        where + 0.016 * np.column_stack([np.cos(angle), np.sin(angle)]), colour, "none", 0.0, ORDER
    )
