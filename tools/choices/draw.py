"""Chart of the errors and costs of `auto`."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.drawing.style import INK, NOTE, PALETTE, new_figure
from tools.choices.quantities import QUANTITIES
from tools.choices.trial import Trial

COLOUR = dict(zip(("force", "string", "beam", "violin"), PALETTE, strict=False))
FLOOR = 1e-9
"""Errors below this are drawn here."""


def draw(found: list[Trial]) -> Figure:
    """Draw errors against tolerances, and the cost per quantity."""
    figure = new_figure(8.4, 3.6)
    left, right = figure.subplots(1, 2)
    _errors(left, found)
    _costs(right, found)
    figure.tight_layout(w_pad=2.5)
    return figure


def _errors(axes: Axes, found: list[Trial]) -> None:
    low, high = min(one.tolerance for one in found) / 1.3, max(one.tolerance for one in found) * 1.3
    axes.plot([low, high], [low, high], color=INK, linewidth=0.8)
    axes.annotate(
        "tolerance",
        (low * 40, low * 40),
        xytext=(-4, 6),
        textcoords="offset points",
        fontsize=8,
        ha="right",
        color=INK,
    )
    axes.annotate(
        "nothing neglected",
        (low, FLOOR),
        xytext=(3, 5),
        textcoords="offset points",
        fontsize=8,
        color=NOTE,
    )
    for level, colour in COLOUR.items():
        some = [one for one in found if one.level == level]
        label = f"{level} ({len(some)})"
        points = np.array([(one.tolerance, max(one.error, FLOOR)) for one in some]).reshape(-1, 2)
        axes.plot(
            *points.T, "o", color=colour, markersize=3.2, markeredgewidth=0, alpha=0.8, label=label
        )
    axes.set(
        xscale="log",
        yscale="log",
        xlim=(low, high),
        ylim=(FLOOR / 3, 30.0),
        xlabel="tolerance",
        ylabel="error against violin",
    )
    axes.legend(
        loc="upper left",
        ncols=2,
        columnspacing=1.2,
        handletextpad=0.3,
        title="model taken (scenes)",
        fontsize=8,
        title_fontsize=8,
        alignment="left",
    )


def _costs(axes: Axes, found: list[Trial]) -> None:
    """Draw the fraction of scenes against their largest cost."""
    for quantity, colour in zip(QUANTITIES, PALETTE[1:], strict=False):
        cost = np.sort([one.cost for one in found if one.quantity == quantity])
        axes.step(
            cost,
            100 * np.arange(1, len(cost) + 1) / len(cost),
            where="post",
            color=colour,
            label=quantity,
        )
    cost = np.sort([one.cost for one in found])
    axes.step(
        cost,
        100 * np.arange(1, len(cost) + 1) / len(cost),
        where="post",
        color=INK,
        linewidth=1.6,
        label="all",
    )
    best = np.sort([one.best for one in found])
    axes.step(
        best,
        100 * np.arange(1, len(best) + 1) / len(best),
        where="post",
        color=INK,
        linewidth=0.9,
        linestyle=(0, (3, 2)),
        label="all, errors known beforehand",
    )
    axes.axvline(1.0, color=NOTE, linewidth=0.7, linestyle=(0, (4, 3)))
    axes.set(
        xscale="log",
        ylim=(0, 100),
        xlabel="time of auto / time of violin",
        ylabel="scenes that cost at most this (%)",
    )
    axes.legend(loc="upper left", fontsize=8)
