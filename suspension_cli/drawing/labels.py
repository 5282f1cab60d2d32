"""Labels of points, placed so that they do not overlap."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke
from matplotlib.text import Text

from suspension_cli.drawing.style import NOTE

if TYPE_CHECKING:
    from jaxtyping import Float
    from matplotlib.transforms import BboxBase
    from numpy.typing import ArrayLike

NEAR = 4.5
"""Distance of a label from its point, points (1/72 in)."""
SPACE = 3.0
"""Least distance between two labels side by side, points."""
REACHES = (1.0, 2.2, 3.6, 5.2, 7.0, 9.0, 11.5, 14.5, 18.0, 22.0)
"""Factors on `NEAR`, tried in this order; from the second on a line leads to the point."""
SIDES = ((1, 0), (1, 1), (1, -1), (-1, 0), (-1, 1), (-1, -1), (0, 1), (0, -1))
"""Directions of a label from its point (x, y), the best first."""
ALONG = np.linspace(0, 1, 16)[:, None]
"""Sampling of a line, to test if it passes through a box."""
ON_LABEL, ON_POINT, CROSSED, ON_LINE, OUTSIDE, FAR = 60.0, 25.0, 20.0, 4.0, 200.0, 1.0
"""Cost of a place per label or point that it covers, per crossing of its line or box with another,
per line that it covers, for leaving the frame, and per unit of reach."""


def annotate(
    axes: Axes,
    points: Sequence[tuple[float, float]],
    texts: Sequence[str],
    colours: Sequence[str],
    size: float,
    taken: Sequence[ArrayLike] = (),
    lines: Sequence[tuple[float, float, float, float]] = (),
) -> list[Text]:
    """Label points, each where it overlaps least with other labels, points and the frame.

    Parameters
    ----------
    axes
        With final limits and position in the figure.
    points : sequence of (x, y)
        In data coordinates.
    size
        Font size, points.
    taken : sequence of (x0, y0, x1, y1)
        Further boxes to avoid, pixels.
    lines : sequence of (x0, y0, x1, y1)
        Vertical or horizontal lines to avoid if possible, pixels.
    """
    pixel = axes.figure.dpi / 72
    where = axes.transData.transform(np.array(points, dtype=float).reshape(-1, 2))
    frame = axes.get_window_extent()
    boxes = [np.array(box, dtype=float) for box in taken]
    leads: list[Float[np.ndarray, "2 2"]] = []
    dots = [
        np.array([x - 3 * pixel, y - 3 * pixel, x + 3 * pixel, y + 3 * pixel]) for x, y in where
    ]
    result = []
    # from the left, so that a row of points fills from one side
    for n in np.lexsort((where[:, 1], where[:, 0])).tolist():
        text = axes.annotate(
            str(texts[n]),
            points[n],
            xytext=(0, 0),
            textcoords="offset points",
            fontsize=size,
            color=colours[n],
            zorder=5,
        )
        text.set_path_effects([withStroke(linewidth=1.6, foreground="white")])
        extent = text.get_window_extent()
        others, shape = dots[:n] + dots[n + 1 :], (extent.width, extent.height)
        places = _places(where[n], shape, pixel, frame, boxes, others, lines, leads)
        reach, box = _cheapest(places)
        boxes.append(box)
        text.set_position(((box[0] - where[n, 0]) / pixel, (box[1] - where[n, 1]) / pixel))
        text.set_verticalalignment("bottom")
        if reach > 1.0:
            leads.append(_lead(where[n], box, pixel))
            ends = axes.transData.inverted().transform(leads[-1])
            axes.plot(
                ends[:, 0], ends[:, 1], color=NOTE, linewidth=0.4, zorder=2, solid_capstyle="butt"
            )
        result.append(text)
    return result


def _cheapest(
    places: Iterator[tuple[float, tuple[float, Float[np.ndarray, " 4"]]]],
) -> tuple[float, Float[np.ndarray, " 4"]]:
    """Reach and box of the first place of least cost.

    Ends when even a free place farther away would cost more.
    """
    least, chosen = np.inf, (0.0, np.zeros(4))
    for cost, place in places:
        if least < FAR * place[0]:
            break
        if cost < least:
            least, chosen = cost, place
    return chosen


def _places(
    point: Float[np.ndarray, " 2"],
    size: tuple[float, float],
    pixel: float,
    frame: BboxBase,
    boxes: list[Float[np.ndarray, " 4"]],
    dots: list[Float[np.ndarray, " 4"]],
    lines: Sequence[tuple[float, float, float, float]],
    leads: list[Float[np.ndarray, "2 2"]],
) -> Iterator[tuple[float, tuple[float, Float[np.ndarray, " 4"]]]]:
    """Cost, reach and box of every possible place of a label."""
    width, height = size
    for reach, (side, up) in product(REACHES, SIDES):
        gap = NEAR * reach * pixel
        left = point[0] + (gap if side > 0 else -gap - width if side < 0 else -width / 2)
        low = point[1] + (0.55 * gap if up > 0 else -0.55 * gap - height if up < 0 else -height / 2)
        box = np.array([left, low, left + width, low + height])
        padded = box + SPACE * pixel * np.array([-1, -0.3, 1, 0.3])
        cost = FAR * reach + 0.05 * SIDES.index((side, up))
        cost += ON_LABEL * sum(_overlap(padded, other) > 0 for other in boxes)
        cost += ON_POINT * sum(_overlap(box, dot) > 0 for dot in dots)
        if reach > 1.0:
            lead = _lead(point, box, pixel)
            cost += CROSSED * (
                sum(_cross(lead, other) for other in leads)
                + sum(_through(lead, dot) for dot in dots if not _inside(point, dot))
            )
            cost += CROSSED * sum(_through(lead, other) for other in boxes)
        cost += CROSSED * sum(_through(other, box) for other in leads)
        cost += ON_LINE * sum(
            box[0] < line[2] and line[0] < box[2] and box[1] < line[3] and line[1] < box[3]
            for line in lines
        )
        cost += OUTSIDE * (
            padded[0] < frame.x0
            or padded[2] > frame.x1
            or padded[1] < frame.y0
            or padded[3] > frame.y1
        )
        yield cost, (reach, box)


def _overlap(a: Float[np.ndarray, " 4"], b: Float[np.ndarray, " 4"]) -> float:
    """Area common to two boxes."""
    return max(min(a[2], b[2]) - max(a[0], b[0]), 0.0) * max(min(a[3], b[3]) - max(a[1], b[1]), 0.0)


def _lead(
    point: Float[np.ndarray, " 2"], box: Float[np.ndarray, " 4"], pixel: float
) -> Float[np.ndarray, "2 2"]:
    """Line (2, 2) from a point to the nearest edge of its label."""
    x = np.clip(point[0], box[0], box[2])
    return np.array([point, [x, np.clip(point[1], box[1] + pixel, box[3] - pixel)]])


def _cross(a: Float[np.ndarray, "2 2"], b: Float[np.ndarray, "2 2"]) -> bool:
    """Whether two lines (2, 2) cross."""

    def side(line: Float[np.ndarray, "2 2"], point: Float[np.ndarray, " 2"]) -> float:
        along, across = line[1] - line[0], point - line[0]
        return float(along[0] * across[1] - along[1] * across[0])

    return side(a, b[0]) * side(a, b[1]) < 0 and side(b, a[0]) * side(b, a[1]) < 0


def _through(line: Float[np.ndarray, "2 2"], box: Float[np.ndarray, " 4"]) -> bool:
    """Whether a line (2, 2) passes through a box."""
    points = line[0] + ALONG * (line[1] - line[0])
    return bool(((points > box[:2]) & (points < box[2:])).all(axis=1).any())


def _inside(point: Float[np.ndarray, " 2"], box: Float[np.ndarray, " 4"]) -> bool:
    return bool(box[0] < point[0] < box[2] and box[1] < point[1] < box[3])
