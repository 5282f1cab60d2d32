"""Texts of figures: what they say, and whether they lie inside and apart."""

from __future__ import annotations

from suspension_cli.drawing.style import house_style


def texts(figure):
    found = [text for axes in figure.axes for text in [*axes.texts, axes.title, axes._left_title]]
    return [text for text in [*figure.texts, *found] if text.get_text() and text.get_visible()]


def assert_legible(figure):
    """Texts lie within the figure and apart from each other, ticks and axis labels included."""
    with house_style():
        figure.draw_without_rendering()
    renderer = figure.canvas.get_renderer()
    found = texts(figure)
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            ticks = [t for t in axis.get_major_ticks() if low <= t.get_loc() <= high]
            shown = [tick.label1 for tick in ticks if tick.label1.get_visible()]
            found += [text for text in [*shown, axis.label] if text.get_text()]
    boxes = [text.get_window_extent(renderer) for text in found]
    for text, box in zip(found, boxes, strict=True):
        inside = box.x0 >= -1 and box.y0 >= -1
        assert inside and box.x1 <= figure.bbox.x1 + 1 and box.y1 <= figure.bbox.y1 + 1, (
            text.get_text()
        )
    apart = 0.02 * figure.dpi
    for n, one in enumerate(boxes):
        for k in range(n + 1, len(boxes)):
            other = boxes[k]
            wide = min(one.x1, other.x1) - max(one.x0, other.x0)
            high = min(one.y1, other.y1) - max(one.y0, other.y0)
            pair = found[n].get_text(), found[k].get_text()
            assert min(wide, high) <= apart, pair


def said(figure):
    return [text.get_text() for text in texts(figure)]
