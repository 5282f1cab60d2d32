"""Texts of figures: what they say, and whether they lie inside and apart."""

from __future__ import annotations

import numpy as np
from matplotlib.text import Text

from suspension_cli.drawing.style import house_style


def texts(figure):
    found = [text for axes in figure.axes for text in [*axes.texts, axes.title, axes._left_title]]
    return [text for text in [*figure.texts, *found] if text.get_text() and text.get_visible()]


def misplaced(figure, shown, apart=0.02):
    """Texts of a figure that lie outside it or overlap by more than a length, in."""
    renderer = figure.canvas.get_renderer()
    boxes = np.array([Text.get_window_extent(text, renderer).extents for text in shown])
    words = [text.get_text() for text in shown]
    outside = (boxes[:, :2] < -1).any(1) | (boxes[:, 2:] > np.array(figure.bbox.size) + 1).any(1)
    low = np.maximum(boxes[:, None, :2], boxes[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], boxes[None, :, 2:])
    over = np.triu((high - low > apart * figure.dpi).all(-1), 1)
    faults = [f"outside: {words[n]}" for n in np.flatnonzero(outside)]
    return faults + [f"overlap: {words[i]} / {words[j]}" for i, j in np.argwhere(over)]


def assert_legible(figure):
    """Texts lie within the figure and apart from each other, ticks and axis labels included."""
    with house_style():
        figure.draw_without_rendering()
    found = texts(figure)
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            ticks = [t for t in axis.get_major_ticks() if low <= t.get_loc() <= high]
            shown = [tick.label1 for tick in ticks if axes.axison and tick.label1.get_visible()]
            found += [text for text in [*shown, axis.label] if text.get_text()]
    assert misplaced(figure, found) == []


def said(figure):
    return [text.get_text() for text in texts(figure)]
