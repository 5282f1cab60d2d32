"""Error against time of every method: a row of two charts for each quantity, one evaluation and in a batch."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analysis.tradeoff.result import ROUNDING, Panel, Tradeoff, View, spell
from suspension_cli.plots.labels import annotate
from suspension_cli.plots.style import INK, NOTE, PALE, PALETTE, house, new_figure, place, plain, write

COLOUR: dict[str, str] = dict(
    zip(("closed-form", "force", "string", "beam", "violin"), (PALETTE[3], PALETTE[2], PALETTE[0], PALETTE[1], PALETTE[6]), strict=True)
)
WIDTH, LEFT, GAP, RIGHT = 7.4, 0.68, 0.2, 0.12
ROW, CHART, HEAD, FOOT = 2.0, 1.38, 0.62, 0.22
"""Inches: of a row, of the charts in it, above and below all rows."""
FONT = 6.3
KINDS = {"once": "one evaluation", "batch": "in a batch"}


def draw(found: Tradeoff, title: str) -> Figure:
    """The figure of `pendsus tradeoff`.

    Parameters
    ----------
    found : Tradeoff
    title : str
        Of the design.
    """
    rows = [(panel, view) for panel in found.panels for view in panel.views]
    left = list(dict.fromkeys((panel.title, item.reason) for panel in found.panels if not panel.entries for item in panel.left))
    with house():
        figure = new_figure(WIDTH, HEAD + ROW * max(len(rows), 1) + FOOT + 0.14 * len(left))
        write(figure, 0.1, 0.1, plain(title, 90), 10, bold=True)
        legend = "line: no method is both faster and more accurate; thin bars: quartiles of the time, and from the least to the largest error"
        write(figure, 0.1, 0.3, f"{legend}; hollow: a batch is done one by one", 6.3, NOTE)
        for number, (panel, view) in enumerate(rows):
            top = HEAD + ROW * number
            _row(figure, panel, view, top)
        for n, (name, reason) in enumerate(left):
            write(figure, 0.1, HEAD + ROW * len(rows) + 0.12 + 0.14 * n, plain(f"{name}: left out, {reason}", 130), 6.5, NOTE)
        up = figure.get_size_inches()[1]
        figure.text(0.5, 0.1 / up, "time relative to the fastest", ha="center", va="bottom", fontsize=8)
    return figure


def _row(figure: Figure, panel: Panel, view: View, top: float) -> None:
    """Both charts of one view."""
    rungs = {entry.rung for entry in panel.entries}
    heading = view.title + (f" ({rungs.copy().pop()})" if len(rungs) == 1 else "")
    write(figure, 0.1, top, heading, 8, INK, bold=True)
    write(figure, 0.1, top + 0.145, plain(f"{panel.start}; error against {panel.reference}", 140), 6.3, NOTE)
    width = (WIDTH - LEFT - GAP - RIGHT) / 2
    worst, least = panel.worst(view), np.array([entry.error[list(view.components)].min() for entry in panel.entries])
    for column, kind in enumerate(KINDS):
        axes = place(figure, LEFT + column * (width + GAP), top + 0.3, width, CHART)
        _chart(axes, panel, view, kind, worst, least, named=len(rungs) > 1)
        if column:
            axes.tick_params(labelleft=False)
        else:
            axes.set_ylabel("relative error")
            axes.yaxis.set_label_coords(-0.155, 0.5)


def _chart(axes: Axes, panel: Panel, view: View, kind: str, worst: Any, least: Any, *, named: bool) -> None:
    """Points, front and labels of one kind of time."""
    times = np.array([getattr(entry, kind) for entry in panel.entries]) / panel.fastest(kind)
    floor = _floor(least, worst)
    high, low = np.where(worst < ROUNDING, floor, worst), np.where(least < ROUNDING, floor, least)
    _scaled(axes, times, high, floor)
    path = _front(axes, times[:, 1], high, panel.front(kind, view))
    for n, entry in enumerate(panel.entries):
        colour = COLOUR[entry.rung]
        axes.plot(times[n, [0, 2]], [high[n]] * 2, color=colour, linewidth=2.2, alpha=0.4, solid_capstyle="butt", zorder=2)
        axes.plot([times[n, 1]] * 2, [low[n], high[n]], color=colour, linewidth=0.6, alpha=0.6, zorder=1)
        hollow = kind == "batch" and not entry.vectorised
        axes.plot(times[n, 1], high[n], "o", color=colour, markersize=4.2, markerfacecolor="white" if hollow else colour, markeredgewidth=0.9, zorder=4)
    note = f"{KINDS[kind]}: 1 = {spell(panel.fastest(kind))}" + (f" a {panel.item}" if kind == "batch" else "")
    corner = axes.text(0.985, 0.965, note, transform=axes.transAxes, ha="right", va="top", fontsize=6.5, color=INK)
    figure: Any = axes.get_figure()
    extent = corner.get_window_extent(figure.canvas.get_renderer())
    texts = [f"{entry.rung}, {entry.method}" if named else entry.method for entry in panel.entries]
    bars = [np.array([[row[0], y], [row[2], y]]) for row, y in zip(times, high, strict=True)]
    spans = [np.array([[row[1], y], [row[1], z]]) for row, y, z in zip(times, low, high, strict=True)]
    lines = [_pixels(axes, ends) for ends in [*(path[n : n + 2] for n in range(len(path) - 1)), *bars, *spans]]
    points = list(zip(times[:, 1].tolist(), high.tolist(), strict=True))
    annotate(axes, points, texts, [COLOUR[entry.rung] for entry in panel.entries], FONT, [(extent.x0, extent.y0, extent.x1, extent.y1)], lines)


def _pixels(axes: Axes, ends: Any) -> tuple[float, ...]:
    """Box of a line in pixels."""
    there = axes.transData.transform(ends)
    return (*there.min(0).tolist(), *there.max(0).tolist())


def _floor(*errors: Any) -> float:
    """Where points stand whose error is rounding: in a strip below the least error that is not."""
    every = np.concatenate(errors)
    seen = every[every >= ROUNDING]
    return float(10 ** np.floor(np.log10(seen.min()) - 1.0)) if len(seen) else ROUNDING


def _scaled(axes: Axes, times: Any, errors: Any, floor: float) -> None:
    """Logarithmic axes with room for labels, and the strip of what is exact to rounding."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    most = max(float(times.max()), 2.0)
    axes.set_xlim(min(0.75, 0.9 * float(times.min())) / most**0.14, most * 1.3 * most**0.22)
    top = max(float(errors.max()), 10 * floor)
    exact = bool((errors <= floor).any())
    decades = np.arange(np.ceil(np.log10(floor)) + exact, np.ceil(np.log10(top)) + 1)
    chosen = decades[:: -max(1, int(np.ceil(len(decades) / 5)))][::-1]
    axes.set_yticks([*([floor] if exact else []), *10.0**chosen], ["rounding"] * exact + [f"$10^{{{int(n)}}}$" for n in chosen])
    room = np.log10(top / floor)
    axes.set_ylim(floor / 10 ** (0.12 * room + 0.15), top * 10 ** (0.3 * room + 0.2))
    ticks = [1, 2, 5, 10, 20, 50] if most < 30 else [10.0**n for n in range(int(np.log10(most)) + 2)]
    axes.set_xticks(ticks, [f"{tick:g}" if tick < 1000 else f"$10^{{{int(np.log10(tick))}}}$" for tick in ticks])
    axes.minorticks_off()
    axes.grid(visible=True, which="major", color=PALE, linewidth=0.3)
    if exact:
        axes.axhspan(axes.get_ylim()[0], floor * 10 ** (0.07 * room + 0.1), color=PALE, alpha=0.25, linewidth=0, zorder=0)
    axes.tick_params(length=2, labelsize=6.5)
    axes.yaxis.label.set_fontsize(7)
    axes.set_axisbelow(True)


def _front(axes: Axes, times: Any, errors: Any, on: list[int]) -> Any:
    """The steps below and to the left of which no method gets, drawn; its corners (c, 2)."""
    x, y = times[on], errors[on]
    right, top = axes.get_xlim()[1], axes.get_ylim()[1]
    corners = np.repeat(np.stack([x, y], axis=1), 2, axis=0)
    corners[1::2, 0] = [*x[1:], right]  # along to the next time, then down
    path = np.concatenate([[[x[0], top]], corners])
    axes.plot(path[:, 0], path[:, 1], color=NOTE, linewidth=0.9, alpha=0.75, zorder=1.5, solid_joinstyle="miter")
    return path
