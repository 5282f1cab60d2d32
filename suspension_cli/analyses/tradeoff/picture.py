"""Pages of error against time, a chart per quantity: models, and methods once and in a batch."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import replace
from itertools import cycle, pairwise
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from suspension_cli.analyses.tradeoff.result import (
    KINDS,
    ROUNDING,
    Panel,
    Tradeoff,
    View,
    unit_of_time,
)
from suspension_cli.drawing.curves import COLUMN, label_plainly, write_heading
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

if TYPE_CHECKING:
    from jaxtyping import Float
    from numpy.typing import ArrayLike

COLOUR = {
    model.name: colour
    for model, colour in zip(MODELS, cycle(PALETTE[n] for n in (3, 2, 0, 1, 6)), strict=False)
}
"""Colours of the models, repeated if there are more models."""
PAGES = {
    "-models": ("models", KINDS),
    "-methods-once": ("methods", ("once",)),
    "-methods-batch": ("methods", ("batch",)),
}
"""End of the name of each page, what it compares, and the kinds of its charts side by side."""
LEFT, EDGE, GAP = 0.86, 0.19, 0.2
"""Left of all charts, right of them and between them, in."""
HIGH, FLAT, FOOT, LINE, KEYED = 1.2, 0.66, 0.5, 0.145, 0.43
"""Heights of a chart, of one with rounding errors alone, below it and of a line of text, and
where the key begins, in."""
FONT = 7.5
CHARACTERS = 78
"""Length of a line of notes."""
HEADING = {
    ("models", "once"): "Error of the models against time",
    ("methods", "once"): "Error of the methods against time: one evaluation",
    ("methods", "batch"): "Error of the methods against time: in a batch",
}
KEY = {
    "models": "Steps: no other is both faster and more accurate.",
    "methods": (
        "Errors against 50 digits in the same model. Steps: no other is both faster and more"
        " accurate."
    ),
}
SPANS = "Thin vertical: smallest to largest error. Thick horizontal: quartiles of the time."
HOLLOW = "Hollow: not vectorised, so that a batch is a loop."
KEPT = ", kept"
"""End of the names of methods that are prepared beforehand."""
IN_A_ROW = {
    "once": "first response, at 5 frequencies",
    "batch": "next response, at 2000 other frequencies",
}
"""In place of `Panel.start` where there are methods that are prepared beforehand."""
POWERS = 3.0
"""Decades of time from which the axis has few labels."""


def draw(found: Tradeoff, title: str) -> dict[str, Figure]:
    """Draw the pages of `pendsus tradeoff` with something to show, by the ends of their names."""
    return {
        end: _draw_page(found, title, compares, kinds)
        for end, (compares, kinds) in PAGES.items()
        if any(panel.compares == compares for panel in found.panels)
    }


def _draw_page(found: Tradeoff, title: str, compares: str, kinds: Sequence[str]) -> Figure:
    """Draw a row of charts per quantity, or why there is none."""
    rows: list[tuple[Panel, View | None]] = []
    for panel in found.panels:
        if panel.compares == compares:
            rows += [(panel, view) for view in panel.views or (None,)]
    loops = "batch" in kinds and not all(e.vectorised for panel, _ in rows for e in panel.entries)
    key = textwrap.wrap(" ".join([KEY[compares], SPANS, *([HOLLOW] if loops else [])]), CHARACTERS)
    notes = [textwrap.wrap(_note(panel, kinds), CHARACTERS) for panel, _ in rows]
    charts = [_height(panel, view) + FOOT if view else 0.15 for panel, view in rows]
    start = KEYED + LINE * len(key) + 0.15
    tall = [0.24 + LINE * len(note) + chart for note, chart in zip(notes, charts, strict=True)]
    with house_style():
        figure = new_figure(COLUMN, start + sum(tall))
        write_heading(figure, HEADING[compares, kinds[0]], title)
        for n, line in enumerate(key):
            write_text(figure, 0.1, KEYED + LINE * n, line, FONT, NOTE)
        for (panel, view), note, high in zip(rows, notes, tall, strict=True):
            models = {entry.model for entry in panel.entries}
            name = view.title if view else panel.title
            name += f" ({models.pop()} model)" if len(models) == 1 else ""
            write_text(figure, 0.1, start, name, 8.5, INK, bold=True)
            for n, line in enumerate(note):
                write_text(figure, 0.1, start + 0.17 + LINE * n, single_line(line), FONT, NOTE)
            if view:
                _draw_row(figure, panel, view, kinds, start + 0.24 + LINE * len(note))
            start += high
    return figure


def _note(panel: Panel, kinds: Sequence[str]) -> str:
    """Return the steps that are timed and the reference of the errors, or why there are none."""
    if not panel.views:
        return f"left out: {'; '.join(panel.left_out)}"
    in_a_row = panel.quantity == "response" and panel.compares == "methods"
    if panel.compares == "models":
        return f"{panel.start}; against {panel.reference}"
    return f"{panel.start}, {IN_A_ROW[kinds[0]]}" if in_a_row else panel.start


def _height(panel: Panel, view: View) -> float:
    """Height of the charts of a view, in."""
    return HIGH if panel.worst(view).max() >= ROUNDING else FLAT


def _draw_row(figure: Figure, panel: Panel, view: View, kinds: Sequence[str], top: float) -> None:
    """Draw the charts of one view of a panel."""
    width = (COLUMN - LEFT - EDGE - GAP * (len(kinds) - 1)) / len(kinds)
    for column, kind in enumerate(kinds):
        axes = add_axes(figure, LEFT + column * (width + GAP), top, width, _height(panel, view))
        _draw_chart(axes, _shown(panel, kind), view, kind)
        if column:
            axes.tick_params(labelleft=False)
        else:
            few = axes.get_window_extent().height < figure.dpi
            axes.set_ylabel("error" if few else "relative error", fontsize=FONT)
            axes.yaxis.set_label_coords(-0.64 / width, 0.5)


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
    unit, size = unit_of_time(panel.fastest(kind))
    times = np.array([getattr(entry, kind) for entry in panel.entries]) / size
    floor = _floor(least, worst)
    high, low = np.where(worst < ROUNDING, floor, worst), np.where(least < ROUNDING, floor, least)
    _set_axes(axes, times, high, floor)
    item = "one evaluation" if kind == "once" else f"per {panel.item} in a batch"
    axes.set_xlabel(f"{item} ({unit})", fontsize=FONT, labelpad=1.5)
    path = draw_front(axes, times[:, 1], high, panel.front(kind, view))
    bars = np.stack([times[:, ::2], np.stack([high, high], 1)], -1)
    spans = np.stack([times[:, [1, 1]], np.stack([low, high], 1)], -1)
    for n, entry in enumerate(panel.entries):
        colour = COLOUR[entry.model]
        axes.plot(*bars[n].T, color=colour, lw=2.6, alpha=0.4, solid_capstyle="butt", zorder=2)
        axes.plot(*spans[n].T, color=colour, lw=0.8, alpha=0.6, zorder=1)
        inside = "white" if kind == "batch" and not entry.vectorised else colour
        point = {"ms": 4.6, "mfc": inside, "mew": 1.0, "zorder": 4}
        axes.plot(times[n, 1], high[n], "o", color=colour, **point)
    annotate(
        axes,
        list(zip(times[:, 1].tolist(), high.tolist(), strict=True)),
        [entry.name(panel.compares).removesuffix(KEPT) for entry in panel.entries],
        [COLOUR[entry.model] for entry in panel.entries],
        FONT,
        lines=[pixels(axes, ends) for ends in [*pairwise(path), *bars, *spans]],
    )


def pixels(axes: Axes, ends: ArrayLike) -> tuple[float, float, float, float]:
    """Bounding box of a line, pixels."""
    there = axes.transData.transform(ends)
    return (*there.min(0).tolist(), *there.max(0).tolist())


def _floor(*errors: Float[np.ndarray, " model"]) -> float:
    """Ordinate of points whose error is rounding: a strip below the smallest other error."""
    every = np.concatenate(errors)
    seen = every[every >= ROUNDING]
    return float(10 ** np.floor(np.log10(seen.min()) - 1.0)) if len(seen) else ROUNDING


def _set_axes(
    axes: Axes,
    times: Float[np.ndarray, "model 3"],
    errors: Float[np.ndarray, " model"],
    floor: float,
) -> None:
    """Set logarithmic axes with room for labels, and the strip of rounding errors."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    fastest = float(times[:, 1].min())
    most = max(float(times.max()) / fastest, 2.0)
    first = min(0.7, 0.9 * float(times.min()) / fastest) / most**0.16
    axes.set_xlim(fastest * first, fastest * 1.6 * most**1.25)
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
    label_plainly(axes.xaxis)
    if np.log10(most) > POWERS:
        axes.xaxis.set_major_locator(LogLocator(numticks=5))
    axes.minorticks_off()
    axes.grid(visible=True, which="major", color=PALE, linewidth=0.3)
    flat = bool((errors <= floor).all())
    edge = floor * 10 ** (0.07 * room + 0.1)
    if flat:
        edge = floor * 10
        axes.set_ylim(floor / 10, edge)
    if exact:
        axes.axhspan(axes.get_ylim()[0], edge, color=PALE, alpha=0.25, linewidth=0, zorder=0)
    axes.tick_params(length=2, labelsize=FONT)
    axes.set_axisbelow(True)


def draw_front(
    axes: Axes,
    times: Float[np.ndarray, " model"],
    errors: Float[np.ndarray, " model"],
    on: list[int],
) -> Float[np.ndarray, "corner 2"]:
    """Draw the steps of the Pareto front; return its corners (c, 2)."""
    x, y = times[on], errors[on]
    right, top = axes.get_xlim()[1], axes.get_ylim()[1]
    corners = np.repeat(np.stack([x, y], axis=1), 2, axis=0)
    corners[1::2, 0] = [*x[1:], right]  # along to the next time, then down
    path = np.concatenate([[[x[0], top]], corners])
    axes.plot(*path.T, color=NOTE, lw=0.9, alpha=0.75, zorder=1.5, solid_joinstyle="miter")
    return path
