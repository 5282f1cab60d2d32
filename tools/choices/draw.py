"""Picture of the choices of `auto`: errors against tolerances, models chosen, and time."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from suspension_cli.analyses.tradeoff.headline import percent
from suspension_cli.analyses.tradeoff.picture import COLOUR as MODEL_COLOUR
from suspension_cli.drawing.curves import rule, write_plainly
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALE,
    PALETTE,
    add_axes,
    new_figure,
    with_opacity,
    write_text,
)
from tools.choices.quantities import QUANTITIES
from tools.choices.trial import Trial

COLOUR = {level: MODEL_COLOUR[level] for level in ("force", "string", "beam", "violin")}
"""Colours of models, from the simplest to the most complete, as in `pendsus tradeoff`."""
FLOOR = 1e-9
"""Errors below this are drawn here."""
WIDTH, HIGH = 7.2, 4.35


def draw(found: list[Trial]) -> Figure:
    """Draw errors against tolerances, the models taken, and time per quantity."""
    figure = new_figure(WIDTH, HIGH)
    kept = sum(one.miss <= 1 for one in found)
    write_text(
        figure,
        0.1,
        0.08,
        f"auto kept the requested tolerance in {kept:,} of {len(found):,} random suspensions",
        10,
        bold=True,
    )
    for n, line in enumerate(
        (
            "Requested: one result for each (modes or a coupling) and a tolerance for its error.",
            "auto takes the fastest model within the tolerance. The error is that against violin,"
            " the most complete.",
        )
    ):
        write_text(figure, 0.1, 0.32 + 0.15 * n, line, 7.2, NOTE)
    errors = add_axes(figure, 0.82, 1.1, 2.75, 2.75)
    _draw_errors(errors, found)
    _draw_models(add_axes(figure, 4.72, 1.1, 2.2, 0.92), found)
    _draw_times(add_axes(figure, 4.72, 2.78, 2.2, 1.07), found)
    write_text(figure, 0.1, 0.82, "Was the error within the tolerance?", 8.5, bold=True)
    write_text(figure, 3.9, 0.82, "What did auto take? (% of suspensions)", 8.5, bold=True)
    write_text(figure, 3.9, 2.38, "What did it cost?", 8.5, bold=True)
    key = (
        "Dot and bar: median, and 5 to 95 % of suspensions.",
        "Black line: median of the fastest model within the tolerance.",
    )
    for n, line in enumerate(key):
        write_text(figure, 3.9, 2.53 + 0.13 * n, line, 6.8, NOTE)
    return figure


def _draw_errors(axes: Axes, found: list[Trial]) -> None:
    """Draw a point per suspension, and the errors that are allowed."""
    tolerance = np.array([one.tolerance for one in found])
    low, high = tolerance.min() / 1.3, tolerance.max() * 1.3
    worst = max(high, max(one.error for one in found))
    axes.set(xscale="log", yscale="log", xlim=(low, high), ylim=(FLOOR / 4, 3 * worst))
    rule(axes)
    axes.fill_between(
        [low, high], [low, high], FLOOR / 4, color=with_opacity(PALE, 0.28), linewidth=0, zorder=0
    )
    axes.plot([low, high], [low, high], color=INK, linewidth=0.9)
    for level, colour in COLOUR.items():
        some = [one for one in found if one.level == level]
        points = np.array([(one.tolerance, max(one.error, FLOOR)) for one in some]).reshape(-1, 2)
        look = {"markersize": 3.2, "markeredgewidth": 0, "alpha": 0.8}
        axes.plot(*points.T, "o", color=colour, label=level, **look)
    axes.set_xlabel("requested tolerance")
    axes.set_ylabel("error of the result")
    ticks = (1e-7, 1e-5, 1e-3, 1e-1)
    labels = [f"{write_plainly(100 * tick)} %" for tick in ticks]
    axes.set_yticks([FLOOR, *ticks], ["none", *labels])
    ticks = (1e-4, 1e-3, 1e-2, 1e-1)
    axes.set_xticks(ticks, [percent(tick) for tick in ticks])
    axes.minorticks_off()
    for text, up, place in (("too large", -4, "top"), ("allowed", 20, "bottom")):
        axes.annotate(
            text,
            (0, 1 if place == "top" else 0),
            (5, up),
            xycoords="axes fraction",
            textcoords="offset points",
            va=place,
            fontsize=8,
            color=NOTE,
        )


def _draw_models(axes: Axes, found: list[Trial]) -> None:
    """Draw the fractions of the models that were taken, per quantity."""
    for n, quantity in enumerate(QUANTITIES):
        some = [one.level for one in found if one.quantity == quantity]
        start = 0.0
        for level, colour in COLOUR.items():
            wide = 100 * some.count(level) / max(len(some), 1)
            axes.barh(n, wide, 0.72, start, color=colour)
            if wide >= 9:
                axes.text(
                    start + wide / 2,
                    n,
                    f"{wide:.0f}",
                    ha="center",
                    va="center",
                    fontsize=7,
                    color="white",
                )
            start += wide
    axes.set(xlim=(0, 100), ylim=(len(QUANTITIES) - 0.45, -0.55), xticks=[])
    axes.set_yticks(range(len(QUANTITIES)), list(QUANTITIES))
    axes.tick_params(length=0, labelsize=8)
    for spine in axes.spines.values():
        spine.set_visible(False)
    for level, across in zip(COLOUR, (0.0, 0.25, 0.52, 0.77), strict=True):
        axes.annotate(
            f"■ {level}",
            (across, 0),
            (0, -3),
            xycoords="axes fraction",
            textcoords="offset points",
            va="top",
            fontsize=7.5,
            color=COLOUR[level],
        )


def _draw_times(axes: Axes, found: list[Trial]) -> None:
    """Draw medians and 90 % ranges of the time over that of violin, per quantity."""
    for n, quantity in enumerate(QUANTITIES):
        some = [one for one in found if one.quantity == quantity]
        if not some:
            continue
        low, middle, high = np.quantile([one.cost for one in some], (0.05, 0.5, 0.95))
        axes.plot([low, high], [n, n], color=PALETTE[0], linewidth=4, alpha=0.35)
        axes.plot(middle, n, "o", color=PALETTE[0], markersize=6)
        best = float(np.median([one.best for one in some]))
        axes.plot(best, n, "|", color=INK, markersize=10, markeredgewidth=1.4)
    axes.axvline(1.0, color=NOTE, linewidth=0.8, linestyle=(0, (4, 3)), zorder=0)
    axes.set(xscale="log", ylim=(len(QUANTITIES) - 0.4, -0.6))
    low = min(0.03, *(line.get_xdata()[0] / 1.3 for line in axes.lines))
    high = max(4.0, *(line.get_xdata()[-1] * 1.3 for line in axes.lines))
    axes.set_xlim(low, high)
    axes.set_yticks(range(len(QUANTITIES)), list(QUANTITIES))
    ticks = [tick for tick in (0.001, 0.01, 0.1, 1, 10, 100) if low <= tick <= high]
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.tick_params(axis="y", length=0, labelsize=8)
    axes.spines["left"].set_visible(False)
    axes.set_xlabel("time over that of violin", fontsize=8)
