"""Dimension lines, leaders and other means of technical drawing, on a canvas in inches."""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.design.scene import Array
from suspension_cli.plots.canvas import Canvas
from suspension_cli.plots.style import NOTE

SIZE = 6.8
"""Of the text of dimensions, points."""
HEAD = 0.075
"""Length of an arrow's head, in."""
THIN = 0.5
"""Width of a dimension line, points."""
LETTER = 0.60 * SIZE / 72
"""About the width of a character, in."""
BLANK = {"facecolor": "white", "edgecolor": "none", "pad": 0.8}
"""What lies below a text is blanked out."""
ORDER = 7.0
"""Dimensions lie above everything else."""


def width_of(text: str) -> float:
    """About the width of a text in inches; mathtext's own signs do not count."""
    return LETTER * len("".join(sign for sign in text if sign not in "$_{}\\"))


def arrow(canvas: Canvas, tail: Array, tip: Array) -> None:
    """A line with a filled head at its tip."""
    along = (tip - tail) / max(float(np.linalg.norm(tip - tail)), 1e-12)
    across = np.array([-along[1], along[0]])
    canvas.line([tail, tip - 0.5 * HEAD * along], NOTE, THIN, ORDER)
    canvas.polygon([tip, tip - HEAD * along + 0.17 * HEAD * across, tip - HEAD * along - 0.17 * HEAD * across], NOTE, "none", 0.0, ORDER)


def extension(canvas: Canvas, start: Any, end: Any) -> None:
    """A thin line from what is measured to a little beyond its dimension line."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    span = float(np.linalg.norm(end - start))
    if span > 1e-9:
        canvas.line([start, end + 0.04 * (end - start) / span], NOTE, 0.35, ORDER - 0.1)


def dimension(canvas: Canvas, a: Any, b: Any, text: str, clear: float = 0.0) -> None:
    """A dimension line from a to b with its text.

    Parameters
    ----------
    canvas : Canvas
    a, b : (2,) arrays
        The ends, in.  With room for it the text stands in the middle, along the line; else beyond b, and level.
        Where there is no room for arrows either they come from outside.
    text : str
    clear : float
        Where something else crosses the line, from b on, in: a text outside keeps beyond it, one inside before it.
    """
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    span = float(np.linalg.norm(b - a))
    along = (b - a) / span if span > 0 else np.array([1.0, 0.0])
    middle = (a + b) / 2
    if span > 2.6 * HEAD:
        arrow(canvas, middle, a)
        arrow(canvas, middle, b)
    else:
        canvas.line([a, b], NOTE, THIN, ORDER)
        arrow(canvas, a - 2.2 * HEAD * along, a)
        arrow(canvas, b + 2.2 * HEAD * along, b)
    if not text:
        return
    inside = span + min(clear, 0.0)
    if inside > width_of(text) + 3 * HEAD:
        angle = float(np.degrees(np.arctan2(along[1], along[0])))
        angle = angle - 180 if angle > 90 else angle + 180 if angle <= -90 else angle
        note(canvas, a + inside / 2 * along, text, rotation=angle)
        return
    beyond = b + (max(clear, 0.0 if span > 2.6 * HEAD else 2.2 * HEAD) + 0.05) * along
    level = abs(along[0]) > 0.5
    across, up = ("left" if along[0] > 0 else "right", "center") if level else ("center", "bottom" if along[1] > 0 else "top")
    canvas.text(float(beyond[0]), float(beyond[1]), text, fontsize=SIZE, color=NOTE, ha=across, va=up, bbox=BLANK)


def note(canvas: Canvas, where: Any, text: str, rotation: float = 0.0) -> None:
    """Text centred on a point, what lies below it blanked out."""
    canvas.text(float(where[0]), float(where[1]), text, fontsize=SIZE, color=NOTE, ha="center", va="center", rotation=rotation, bbox=BLANK)


def leader(canvas: Canvas, x: float, y: float, target: Any, text: str) -> None:
    """Text that ends at x, and from there a thin line with a dot at the target."""
    target = np.asarray(target, dtype=float)
    knee = np.array([x + 0.10, y])
    canvas.line([[x + 0.02, y], knee, target], NOTE, 0.4, ORDER - 0.1)
    dot(canvas, target)
    canvas.text(x, y, text, fontsize=SIZE, color=NOTE, ha="right", va="center")


def dot(canvas: Canvas, where: Array, colour: str = NOTE) -> None:
    """A small dot."""
    angle = np.linspace(0, 2 * np.pi, 13)
    canvas.polygon(where + 0.016 * np.column_stack([np.cos(angle), np.sin(angle)]), colour, "none", 0.0, ORDER)


def spread(wanted: list[float], gap: float) -> list[float]:
    """Positions as near as may be to the wanted ones, in the same order, and at least a gap apart.

    Neighbours that are too close form a group that stands around the mean of what its members want.
    """
    order = sorted(range(len(wanted)), key=lambda n: wanted[n])
    groups: list[list[int]] = []
    starts: list[float] = []
    for n in order:
        groups.append([n])
        starts.append(wanted[n])
        while len(groups) > 1 and starts[-2] + gap * len(groups[-2]) > starts[-1] + 1e-12:
            last = groups.pop()
            starts.pop()
            groups[-1] += last
            members = groups[-1]
            starts[-1] = sum(wanted[m] - gap * k for k, m in enumerate(members)) / len(members)
    result = [0.0] * len(wanted)
    for group, start in zip(groups, starts, strict=True):
        for k, n in enumerate(group):
            result[n] = start + gap * k
    return result
