"""Figure of random builds: spread of modes, distribution of coupling, rank correlations."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.tolerance.statistics import QUANTILES, Summary, leading
from suspension_cli.drawing.style import NOTE, PALE, PALETTE, house_style, new_figure

MAX_BARS = 12
"""Largest rank correlations that are shown."""


def draw(summary: Summary, title: str, ratio: str) -> Figure:
    """Draw the figure of `pendsus tolerance`.

    Parameters
    ----------
    summary : Summary
    title : str
    ratio : str
        Name of the cross-coupling: ``test.x / test.z``.
    """
    with house_style():
        height = max(4.6, 0.24 * len(summary.label) + 1.2)
        figure = new_figure(9.0, height)
        left, middle, right = figure.subplots(1, 3, width_ratios=[1.25, 1, 1])
        _draw_modes(left, summary)
        _draw_coupling(middle, summary, ratio)
        _draw_ranks(right, summary)
        figure.suptitle(f"{title}: {summary.good:,} builds", x=0.01, ha="left", fontsize=9)
        figure.tight_layout()
        return figure


def _draw_modes(axes: Axes, summary: Summary) -> None:
    """Draw quantiles (5, 25, 50, 75, 95 %) of each mode, in % of the nominal frequency."""
    low, q1, mid, q3, high = (
        100 * (summary.quantiles[:, QUANTILES.index(level)] / summary.nominal - 1)
        for level in (0.05, 0.25, 0.5, 0.75, 0.95)
    )
    rows = np.arange(len(summary.label))
    axes.hlines(rows, low, high, color=PALETTE[0], linewidth=1.0)
    axes.hlines(rows, q1, q3, color=PALETTE[0], linewidth=4.0)
    axes.plot(mid, rows, "|", color="white", markersize=6)
    axes.set_yticks(
        rows,
        [f"{label}  {f:#.4g} Hz" for label, f in zip(summary.label, summary.nominal, strict=True)],
        fontsize=6.5,
    )
    axes.invert_yaxis()
    axes.axvline(0.0, color=NOTE, linewidth=0.5)
    axes.set_xlabel("frequency, % from nominal\n(5, 25, 50, 75, 95 % of builds)")
    axes.grid(visible=True, axis="x", color=PALE, linewidth=0.4)


def _draw_coupling(axes: Axes, summary: Summary, ratio: str) -> None:
    fraction = np.linspace(0, 1, len(summary.ratio_sorted))
    axes.semilogx(np.maximum(summary.ratio_sorted, 1e-300), 100 * fraction, color=PALETTE[0])
    axes.axvline(summary.limit, color=PALETTE[1], linestyle="--", linewidth=0.8)
    axes.set_title(
        f"{100 * summary.under:.3g} % of builds below {summary.limit:g}", loc="left", fontsize=7.5
    )
    if len(summary.ratio_sorted):
        axes.set_xlim(
            max(summary.ratio_quantiles[0] / 3, 1e-300),
            max(summary.limit, summary.ratio_sorted[-1]) * 2,
        )
    axes.set_ylim(0, 100)
    axes.set_xlabel(f"|{ratio}| at {summary.frequency:g} Hz")
    axes.set_ylabel("fraction of builds (%)")
    axes.grid(visible=True, color=PALE, linewidth=0.4)


def _draw_ranks(axes: Axes, summary: Summary) -> None:
    top = leading(summary.ratio_rank, summary.factor, MAX_BARS)
    rows = np.arange(len(top))
    axes.set_axisbelow(True)
    axes.barh(rows, [value for _, value in top], color=PALETTE[2], height=0.6)
    axes.set_yticks(rows, [name for name, _ in top], fontsize=6.5)
    axes.invert_yaxis()
    axes.axvline(0.0, color=NOTE, linewidth=0.5)
    axes.set_xlabel("rank correlation of the coupling\nwith the size of the deviation")
    axes.grid(visible=True, axis="x", color=PALE, linewidth=0.4)
