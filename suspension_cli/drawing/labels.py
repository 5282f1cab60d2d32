"""Placement of labels: texts measured, moved apart along a line or about points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator
from scipy.optimize import isotonic_regression

from suspension_cli.drawing.style import (
    NOTE,
    SMALL,
    format_raised,
    shorten,
    single_line,
    text_width,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from suspension_cli.scene.arrays import Array

LIFT = 0.1
"""Height above axes at which the frequencies of peaks stand, in."""
FARTHEST = 2.5
"""Largest distance of a frequency from its peak, in widths of the text."""
MOST_TICKS = 8
"""Largest number of intervals between the ticks of a linear axis."""
TICKS_APART = 0.1
"""Least distance between the labels of ticks, in."""
MOST_PEAKS = 12
"""Largest number of labels of peaks."""
SIDES = np.array([(1, 0), (1, 1), (1, -1), (-1, 0), (-1, 1), (-1, -1), (0, 1), (0, -1)])
"""Directions of a label from its point (x, y), the best first."""
REACHES = (3.5, 8.0, 14.0, 22.0, 32.0, 44.0, 58.0, 75.0, 95.0)
"""Distances of a label from its point, points; from the second on a line leads to it."""


def widest(texts: Sequence[str], size: float = SMALL) -> float:
    """Width of the longest of some texts, in."""
    return max((text_width(line, size) for text in texts for line in text.split("\n")), default=0.0)


def wrap(text: str, width: float, size: float = SMALL) -> list[str]:
    """Break text into lines of a width, in."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".lstrip()
        lines[-1:] = [longer] if text_width(longer, size) <= width else [lines[-1], word]
    return [line for line in lines if line]


def spread(
    wanted: Sequence[float], gap: float, low: float = -np.inf, high: float = np.inf
) -> list[float]:
    """Positions nearest to the wanted ones (least squares), in their order, at least a gap apart.

    They lie between two bounds as far as there is room. An isotonic regression: less n gaps, the
    n-th position must not be below those before it, nor beyond the bounds.
    """
    if not len(wanted):
        return []
    order = np.argsort(wanted, kind="stable")
    offset = gap * np.arange(len(wanted))
    found = isotonic_regression(np.asarray(wanted, dtype=float)[order] - offset).x
    result = np.empty(len(wanted))
    result[order] = np.clip(found, min(low, high - offset[-1]), high - offset[-1]) + offset
    return result.tolist()


def thin_ticks(axis: Axis) -> None:
    """Choose fewer ticks on a linear horizontal axis until their labels do not touch.

    The axis has its limits and place, and numbers as labels.
    """
    axes = axis.axes
    wide = axes.get_window_extent().width / axes.figure.dpi
    low, high = axis.get_view_interval()
    for most in range(MOST_TICKS, 1, -1):
        axis.set_major_locator(MaxNLocator(most, steps=[1, 2, 5, 10]))
        ticks = np.asarray(axis.get_majorticklocs())
        ticks = ticks[(ticks >= min(low, high)) & (ticks <= max(low, high))]
        room = wide * float(np.diff(ticks).min(initial=np.inf)) / abs(high - low)
        texts = axis.get_major_formatter().format_ticks(ticks.tolist())
        if widest(texts) + TICKS_APART <= room:
            return


def room_for(names: Sequence[str], most: int = 26) -> float:
    """Width of labels at line ends, in."""
    return 0.2 + widest([f"↓ {shorten(name, most)}" for name in names]) if names else 0.15


def label_ends(
    axes: Axes, ends: Sequence[tuple[ArrayLike, ArrayLike, str, str]], most: int = 26
) -> None:
    """Write labels at the ends of lines, right of the axes, moved apart, with leaders.

    A line that ends outside the panel gets an arrow up or down. The axes have their limits and
    place; `ends` are abscissas, ordinates, label and colour of each line, `most` the characters of
    a label.
    """
    box = axes.get_window_extent()
    inch = axes.figure.dpi
    raw = [_end_height(axes, np.asarray(x, float), np.asarray(y, float)) for x, y, *_ in ends]
    gap = 1.18 * SMALL * inch / 72 / box.height
    # outside the panel the order is that of the values
    places = spread([min(max(at, 1e-6 * at), 1.0) for at in raw], gap, 0.0, 1.0)
    for at, real, (*_, name, colour) in zip(places, raw, ends, strict=True):
        outside = ""
        if real < -5e-3:
            outside = "↓ "
        elif real > 1.005:
            outside = "↑ "
        plain = name if name.startswith("$") else single_line(shorten(name, most))
        look: Any = {"va": "center", "fontsize": SMALL, "color": colour, "annotation_clip": False}
        look |= {"xycoords": "axes fraction", "textcoords": "offset points"}
        axes.annotate(outside + plain, (1, at), (8, 0), **look)
        if not outside and abs(at - real) > 0.3 * gap:
            across = 1 + 6 * inch / 72 / box.width
            leader = Line2D([1, across], [real, at], color=colour, lw=0.6, clip_on=False)
            leader.set_transform(axes.transAxes)
            axes.add_line(leader)


def _end_height(axes: Axes, x: Array, y: Array) -> float:
    """Height of the last point of a line within the limits, as a fraction of the axes."""
    low, high = sorted(axes.get_xlim())
    shown = y[np.isfinite(y) & (x >= low) & (x <= high)]
    if not len(shown):
        return -1e-2
    with np.errstate(invalid="ignore", divide="ignore"):
        end = axes.transAxes.inverted().transform(axes.transData.transform((high, shown[-1])))[1]
    return float(end) if np.isfinite(end) else -1e-2


def label_peaks(axes: Axes, peaks: Sequence[tuple[float, float, str]], unit: str = " Hz") -> None:
    """Write the frequencies of peaks in a row above axes, moved apart, with leaders.

    The axes have their limits, and room above. `peaks` are frequency (Hz), ordinate and remark of
    each, the most important last. `unit` follows the last frequency of the row.
    """
    chosen: list[tuple[float, float, str]] = []
    low, high = axes.get_xlim()
    for peak in reversed(peaks):
        near = any(abs(np.log(peak[0] / other[0])) < 5e-3 for other in chosen)
        if low <= peak[0] <= high and not near:
            chosen.append(peak)
    if not chosen:
        return
    box = axes.get_window_extent()
    inch = axes.figure.dpi
    texts = [f"{format_raised(peak[0], 3)}{peak[2]}" for peak in chosen[:MOST_PEAKS]]
    wide = (widest(texts) + 0.1) * inch
    chosen = chosen[: min(MOST_PEAKS, max(1, int(box.width / wide)))]
    while True:  # without the least important, until no label is far from its peak
        shown = sorted(chosen)
        raw = [float(axes.transData.transform((at, 1))[0] - box.x0) for at, *_ in shown]
        places = spread(raw, wide, wide / 2, box.width - wide / 2)
        if len(chosen) == 1 or np.abs(np.subtract(places, raw)).max() < FARTHEST * wide:
            break
        chosen.pop()
    foot = 1 + LIFT * inch / box.height
    look = {"transform": axes.transAxes, "color": NOTE}
    for peak, place, x in zip(shown, places, raw, strict=True):
        text = f"{format_raised(peak[0], 3)}{unit if peak is shown[-1] else ''}{peak[2]}"
        middle = place / box.width
        axes.text(middle, foot, text, ha="center", va="bottom", fontsize=SMALL, **look)
        top = (axes.transData.transform(peak[:2])[1] - box.y0) / box.height
        across = [x / box.width] * 2 + [middle]
        up = [min(top + 0.01, 1.0), 1.0, foot]
        axes.add_line(Line2D(across, up, linewidth=0.4, zorder=1, clip_on=False, **look))


def label_points(
    axes: Axes,
    points: Sequence[Sequence[float]],
    texts: Sequence[str],
    colours: Sequence[str],
    size: float = SMALL,
    pad: float = 0.0,
) -> list[Text]:
    """Label points (x, y), from the left, at the nearest place beside each that is free.

    The axes have their limits and place. `pad` is the room around each text, points. Labels keep
    off points with an empty text, too.
    """
    pixel = axes.figure.dpi / 72
    low, high = np.reshape(axes.get_window_extent().extents, (2, 2)) / pixel
    where = axes.transData.transform(np.reshape(points, (-1, 2)).astype(float)) / pixel
    dots = np.stack([where - 3.0, where + 3.0], axis=1)
    offsets = np.array([(side, reach) for reach in REACHES for side in range(len(SIDES))])
    placed = np.zeros((0, 2, 2))
    found = dict[int, Text]()
    for n in np.lexsort((where[:, 1], where[:, 0])).tolist():
        half = np.array([36 * text_width(texts[n], size), 0.58 * size]) + pad
        shifts = SIDES[offsets[:, 0].astype(int)] * (half + offsets[:, 1:])
        boxes = (where[n] + shifts)[:, None] + np.stack([-half, half])
        others = np.concatenate([np.delete(dots, n, axis=0), placed])
        apart = (boxes[:, None, 0] >= others[:, 1]) | (others[:, 0] >= boxes[:, None, 1])
        cut = (boxes[:, 0] < low).any(1) | (boxes[:, 1] > high).any(1)
        best = int(np.argmin((~apart.any(-1)).sum(1) + 100 * cut))
        placed = np.append(placed, boxes[best][None], axis=0)
        look: Any = {"textcoords": "offset points", "ha": "center", "va": "center", "zorder": 5}
        look |= {"fontsize": size, "color": colours[n]}
        if texts[n] and best >= len(SIDES):
            look["arrowprops"] = {"arrowstyle": "-", "color": NOTE, "lw": 0.4, "shrinkB": 0.0}
        text = axes.annotate(str(texts[n]), tuple(points[n]), tuple(shifts[best]), **look)
        text.set_path_effects([withStroke(linewidth=1.6, foreground="white")])
        found[n] = text
    return [found[n] for n in range(len(texts))]
