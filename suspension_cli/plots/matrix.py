"""The table of couplings of one design: every motion of a body for every motion of the support."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from suspension_cli.analysis.response import Response
from suspension_cli.plots.style import INK, NOTE, house, new_figure

RANGE = 1e8
"""Smallest coupling that gets a colour, below the largest."""


def draw(response: Response, title: str) -> Figure:
    """A coloured table for each frequency; what a symmetry forbids is left white with a 0.

    Parameters
    ----------
    response : Response
        With several outputs and inputs.
    title : str
    """
    with house():
        count = len(response.frequency)
        figure = new_figure(5.4, 0.9 + 3.1 * count)
        for axes, frequency, value in zip(np.atleast_1d(figure.subplots(count, 1)), response.frequency, np.abs(response.value), strict=True):
            shown = np.where(value > 0, value, np.nan)
            top = float(np.nanmax(shown)) if np.isfinite(shown).any() else 1.0
            axes.imshow(shown, norm=LogNorm(top / RANGE, top), cmap="Blues", aspect="auto")
            for (row, column), size in np.ndenumerate(value):
                dark = size > 1e-3 * top
                axes.text(column, row, f"{size:.1e}" if size else "0", ha="center", va="center", fontsize=6.5, color="white" if dark else INK if size else NOTE)
            axes.set_xticks(range(len(response.input)), response.input, fontsize=6.5, rotation=20)
            axes.set_yticks(range(len(response.output)), response.output, fontsize=6.5)
            axes.set_title(f"|motion / motion of the support| at {frequency:g} Hz (SI)", loc="left", fontsize=7.5)
            axes.tick_params(length=0)
            for side in ("left", "bottom"):
                axes.spines[side].set_visible(False)
        figure.suptitle(title, x=0.01, ha="left", fontsize=9)
        figure.tight_layout()
        return figure
