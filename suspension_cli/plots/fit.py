"""A fit: how far modes lay from what was measured before and after, and what was learned."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.analysis.fit import Fit
from suspension_cli.plots.style import NOTE, PALE, PALETTE, house, new_figure, plain


def draw(found: Fit, title: str) -> Figure:
    """The figure of `pendsus fit`.

    Parameters
    ----------
    found : Fit
    title : str
    """
    with house():
        rows = np.arange(len(found.label))
        figure = new_figure(7.6, max(2.6, 0.22 * len(rows) + 1.5))
        left, right = figure.subplots(1, 2, width_ratios=[1.5, 1])
        error = 100 * found.uncertainty / found.measured
        left.axvline(0.0, color=NOTE, linewidth=0.5)
        left.hlines(rows, -error, error, color=PALE, linewidth=5)
        for value, marker, colour, label in ((found.before, "o", PALETTE[1], "before"), (found.after, "D", PALETTE[0], "after")):
            face = "white" if marker == "o" else colour
            left.plot(100 * (value / found.measured - 1), rows, marker, markersize=3.5, markeredgecolor=colour, markerfacecolor=face, label=label)
        left.set_yticks(rows, [f"{plain(name, 40)}  {f:.4g} Hz" for name, f in zip(found.label, found.measured, strict=True)], fontsize=6.5)
        left.invert_yaxis()
        left.set_xlabel("model less measurement (%); bars: its uncertainty")
        left.grid(visible=True, axis="x", color=PALE, linewidth=0.4)
        left.legend(loc="best")
        numbers = np.arange(len(found.name))
        change = 100 * (found.value / np.where(found.start == 0, 1.0, found.start) - 1)
        spread = 100 * np.where(np.isfinite(found.sigma), found.sigma, 0.0) / np.where(found.start == 0, 1.0, np.abs(found.start))
        right.axvline(0.0, color=NOTE, linewidth=0.5)
        right.errorbar(change, numbers, xerr=spread, fmt="D", markersize=3.5, color=PALETTE[0], elinewidth=1.0, capsize=2)
        right.set_yticks(
            numbers, [f"{plain(name, 40)}\n{value:.5g} ± {sigma:.1g}" for name, value, sigma in zip(found.name, found.value, found.sigma, strict=True)]
        )
        right.tick_params(axis="y", labelsize=6.5)
        right.set_ylim(len(numbers) - 0.5, -0.5)
        right.set_xlabel("change from the start (%)")
        right.grid(visible=True, axis="x", color=PALE, linewidth=0.4)
        figure.suptitle(f"{plain(title, 70)}: $\\chi^2$ = {found.chi_squared:.3g} for {found.freedom} degrees of freedom", x=0.01, ha="left", fontsize=9)
        figure.tight_layout()
        return figure
