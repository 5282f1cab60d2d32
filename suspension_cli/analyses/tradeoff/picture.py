"""Figure of error against time, a row per quantity: models on the left, methods on the right."""

from __future__ import annotations

from dataclasses import replace
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.tradeoff.result import (
    COMPARED,
    KINDS,
    ROUNDING,
    Panel,
    Tradeoff,
    View,
    format_time,
)
from suspension_cli.drawing.labels import annotate
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALE,
    PALETTE,
    add_axes,
    house_style,
    new_figure,
    single_line,
    write_text,
)
from suspension_cli.models.registry import MODELS

COLOUR = {
    model.name: colour
    for model, colour in zip(MODELS, cycle(PALETTE[n] for n in (3, 2, 0, 1, 6)), strict=False)
}
"""Colours of the models, repeated if there are more models."""
CHART, HIGH = 2.32, 1.3
"""Width and height of a chart, inches."""
LEFT = {"models": 0.72, "methods": 6.32}
"""Left edge of the charts of a half, inches; between them `GAP`."""
GAP, WIDTH = 0.14, 11.2
HEAD, ROW, ABOVE, FOOT = 1.27, 1.98, 0.34, 0.2
"""Heights above all rows, of a row, of its heading, and below all rows, inches."""
SIDE = 0.1
FONT = 6.6
NOTED = {"once": "one evaluation", "batch": "in a batch"}
HALVES = {
    "models": ("Models: physics neglected", "error against the most complete valid model"),
    "methods": (
        "Methods: arithmetic and approximations",
        "error against 50 digits in the same model",
    ),
}
KEPT = ", kept"
"""End of the names of methods that are prepared beforehand."""
NEXT = {"once": "first response", "batch": "next response"}
"""In place of `NOTED` where there are such methods."""
KEY = (
    (
        "Grey steps: Pareto front; no other point is both faster and more accurate. Thin vertical"
        " bars: smallest to largest error."
    ),
    (
        "Thick horizontal bars: quartiles of the time. Hollow: not vectorised, so that a batch is a"
        " loop. Grey strip: errors below 10⁻¹² are rounding."
    ),
    (
        "Responses by methods: on the left the first response (5 frequencies), on the right the"
        " next of the same system (2000 other frequencies)."
    ),
)


def draw(found: Tradeoff, title: str) -> Figure:
    """Draw the figure of `pendsus tradeoff`.

    Parameters
    ----------
    found : Tradeoff
    title : str
        Title of the design.
    """
    halves = {key: [panel for panel in found.panels if panel.compares == key] for key in COMPARED}
    rows = _rows(found)
    with house_style():
        figure = new_figure(WIDTH, HEAD + ROW * len(rows) + FOOT)
        write_text(
            figure, SIDE, 0.1, single_line(f"{title}: speed against accuracy", 110), 12, bold=True
        )
        for n, line in enumerate(KEY):
            write_text(figure, SIDE, 0.36 + 0.15 * n, line, 7.2, NOTE)
        for key, (heading, against) in HALVES.items():
            if halves[key]:
                left = LEFT[key] - 0.62
                write_text(figure, left, HEAD - 0.32, heading, 9.5, bold=True)
                write_text(figure, left, HEAD - 0.13, against, 7.2, NOTE)
        for number, (quantity, heading) in enumerate(rows):
            for key in COMPARED:
                for panel in halves[key]:
                    if panel.quantity == quantity:
                        _draw_row(figure, panel, heading, HEAD + ROW * number + 0.1)
        up = figure.get_size_inches()[1]
        figure.text(
            0.5,
            0.06 / up,
            "processor time relative to the fastest in the chart",
            ha="center",
            va="bottom",
            fontsize=8,
        )
    return figure


def _rows(found: Tradeoff) -> list[tuple[str, str]]:
    """Quantity and heading of every row: all views, and quantities that were left out."""
    every: list[tuple[str, str]] = []
    for quantity in dict.fromkeys(panel.quantity for panel in found.panels):
        panels = [panel for panel in found.panels if panel.quantity == quantity]
        titles = [view.title for panel in panels for view in panel.views]
        every += [(quantity, title) for title in dict.fromkeys(titles or [panels[0].title])]
    return every


def _draw_row(figure: Figure, panel: Panel, heading: str, top: float) -> None:
    """Draw the charts of one view of a panel, or why there are none."""
    left = LEFT[panel.compares]
    models = {entry.model for entry in panel.entries}
    name = heading + (f" ({models.copy().pop()})" if len(models) == 1 else "")
    write_text(figure, left - 0.62, top, name, 8, INK, bold=True)
    views = [view for view in panel.views if view.title == heading]
    if not views:
        reasons = dict.fromkeys(item.reason for item in panel.left)
        for n, reason in enumerate(reasons):
            write_text(
                figure,
                left - 0.62,
                top + 0.2 + 0.15 * n,
                single_line(f"left out: {reason}", 100),
                7,
                NOTE,
            )
        return
    write_text(
        figure,
        left - 0.62,
        top + 0.145,
        single_line(f"{panel.start}; against {panel.reference}", 110),
        6.6,
        NOTE,
    )
    for column, kind in enumerate(KINDS):
        axes = add_axes(figure, left + column * (CHART + GAP), top + ABOVE, CHART, HIGH)
        _draw_chart(axes, _shown(panel, kind), views[0], kind)
        if column:
            axes.tick_params(labelleft=False)
        else:
            axes.set_ylabel("relative error")
            axes.yaxis.set_label_coords(-0.2, 0.5)


def _shown(panel: Panel, kind: str) -> Panel:
    """Leave out methods with their preparation in batches, and those without it elsewhere."""
    names = {entry.method for entry in panel.entries}

    def other(name: str) -> str:
        return name + KEPT if kind == "batch" else name.removesuffix(KEPT)

    shown = (
        e for e in panel.entries if other(e.method) == e.method or other(e.method) not in names
    )
    return replace(panel, entries=tuple(shown))


def _draw_chart(axes: Axes, panel: Panel, view: View, kind: str) -> None:
    """Draw points, Pareto front and labels for one kind of time."""
    worst = panel.worst(view)
    least = np.array([entry.error[list(view.components)].min() for entry in panel.entries])
    times = np.array([getattr(entry, kind) for entry in panel.entries]) / panel.fastest(kind)
    floor = _floor(least, worst)
    high, low = np.where(worst < ROUNDING, floor, worst), np.where(least < ROUNDING, floor, least)
    _set_axes(axes, times, high, floor)
    path = _draw_front(axes, times[:, 1], high, panel.front(kind, view))
    for n, entry in enumerate(panel.entries):
        colour = COLOUR[entry.model]
        axes.plot(
            times[n, [0, 2]],
            [high[n]] * 2,
            color=colour,
            linewidth=2.2,
            alpha=0.4,
            solid_capstyle="butt",
            zorder=2,
        )
        axes.plot(
            [times[n, 1]] * 2, [low[n], high[n]], color=colour, linewidth=0.6, alpha=0.6, zorder=1
        )
        hollow = kind == "batch" and not entry.vectorised
        axes.plot(
            times[n, 1],
            high[n],
            "o",
            color=colour,
            markersize=4.2,
            markerfacecolor="white" if hollow else colour,
            markeredgewidth=0.9,
            zorder=4,
        )
    in_a_row = panel.quantity == "response" and panel.compares == "methods"
    note = f"{(NEXT if in_a_row else NOTED)[kind]}: 1 = {format_time(panel.fastest(kind))}" + (
        f" per {panel.item}" if kind == "batch" else ""
    )
    corner = axes.text(
        0.985, 0.97, note, transform=axes.transAxes, ha="right", va="top", fontsize=6.6, color=INK
    )
    figure: Any = axes.get_figure()
    extent = corner.get_window_extent(figure.canvas.get_renderer())
    bars = [np.array([[row[0], y], [row[2], y]]) for row, y in zip(times, high, strict=True)]
    spans = [
        np.array([[row[1], y], [row[1], z]]) for row, y, z in zip(times, low, high, strict=True)
    ]
    lines = [
        _pixels(axes, ends)
        for ends in [*(path[n : n + 2] for n in range(len(path) - 1)), *bars, *spans]
    ]
    points = list(zip(times[:, 1].tolist(), high.tolist(), strict=True))
    texts = [entry.name(panel.compares).removesuffix(KEPT) for entry in panel.entries]
    annotate(
        axes,
        points,
        texts,
        [COLOUR[entry.model] for entry in panel.entries],
        FONT,
        [(extent.x0, extent.y0, extent.x1, extent.y1)],
        lines,
    )


def _pixels(axes: Axes, ends: Any) -> tuple[float, ...]:
    """Bounding box of a line, pixels."""
    there = axes.transData.transform(ends)
    return (*there.min(0).tolist(), *there.max(0).tolist())


def _floor(*errors: Any) -> float:
    """Ordinate of points whose error is rounding: a strip below the smallest other error."""
    every = np.concatenate(errors)
    seen = every[every >= ROUNDING]
    return float(10 ** np.floor(np.log10(seen.min()) - 1.0)) if len(seen) else ROUNDING


def _set_axes(axes: Axes, times: Any, errors: Any, floor: float) -> None:
    """Set logarithmic axes with room for labels, and the strip of rounding errors."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    most = max(float(times.max()), 2.0)
    first, last = min(0.7, 0.9 * float(times.min())) / most**0.16, 1.6 * most**1.25
    axes.set_xlim(first, last)
    top, exact = float(errors.max()), bool((errors <= floor).any())
    # keeps the next label above clear of that of the strip
    least = np.log10(floor) + exact * max(0.12 * np.log10(top / floor), 0.5)
    decades = np.arange(np.ceil(least), np.ceil(np.log10(top)) + (top > floor))
    top = max(top, 10 * floor)
    chosen = decades[:: -max(1, int(np.ceil(len(decades) / 5)))][::-1]
    axes.set_yticks(
        [*([floor] if exact else []), *10.0**chosen],
        ["rounding"] * exact + [f"$10^{{{int(n)}}}$" for n in chosen],
    )
    room = np.log10(top / floor)
    axes.set_ylim(floor / 10 ** (0.12 * room + 0.15), top * 10 ** (0.3 * room + 0.2))
    ticks = (
        [1.0, 2.0, 5.0, 10.0, 20.0, 50.0]
        if most < 30
        else [10.0**n for n in range(int(np.log10(most)) + 2)]
    )
    shown = [tick for tick in ticks if tick < last]
    axes.set_xticks(
        shown, [f"{tick:g}" if tick < 1000 else f"$10^{{{int(np.log10(tick))}}}$" for tick in shown]
    )
    axes.minorticks_off()
    axes.grid(visible=True, which="major", color=PALE, linewidth=0.3)
    if exact:
        axes.axhspan(
            axes.get_ylim()[0],
            floor * 10 ** (0.07 * room + 0.1),
            color=PALE,
            alpha=0.25,
            linewidth=0,
            zorder=0,
        )
    axes.tick_params(length=2, labelsize=6.5)
    axes.yaxis.label.set_fontsize(7)
    axes.set_axisbelow(True)


def _draw_front(axes: Axes, times: Any, errors: Any, on: list[int]) -> Any:
    """Draw the steps of the Pareto front; return its corners (c, 2)."""
    x, y = times[on], errors[on]
    right, top = axes.get_xlim()[1], axes.get_ylim()[1]
    corners = np.repeat(np.stack([x, y], axis=1), 2, axis=0)
    corners[1::2, 0] = [*x[1:], right]  # along to the next time, then down
    path = np.concatenate([[[x[0], top]], corners])
    axes.plot(
        path[:, 0],
        path[:, 1],
        color=NOTE,
        linewidth=0.9,
        alpha=0.75,
        zorder=1.5,
        solid_joinstyle="miter",
    )
    return path
