"""Figure of the coupling matrix: every motion of a body per motion of the support."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from suspension_cli.drawing.style import INK, NOTE, house_style, new_figure
from suspension_cli.linear.response import Response

RANGE = 1e8
"""Ratio of the largest coupling to the smallest with a colour."""


def draw(response: Response, title: str) -> Figure:
    """Draw a coloured table for each frequency; couplings forbidden by symmetry are white zeros.

    Parameters
    ----------
    response : Response
        With several outputs and inputs.
    title : str
    """
    with house_style():
        count = len(response.frequency)
        figure = new_figure(5.4, 0.9 + 3.1 * count)
        for axes, frequency, value in zip(
            np.atleast_1d(figure.subplots(count, 1)),
            response.frequency,
            np.abs(response.value),
            strict=True,
        ):
            shown = np.where(value > 0, value, np.nan)
            top = float(np.nanmax(shown)) if np.isfinite(shown).any() else 1.0
            axes.imshow(shown, norm=LogNorm(top / RANGE, top), cmap="Blues", aspect="auto")
            for (row, column), size in np.ndenumerate(value):
                dark = size > 1e-3 * top
                axes.text(
                    column,
                    row,
                    f"{size:.1e}" if size else "0",
                    ha="center",
                    va="center",
                    fontsize=6.5,
                    color="white" if dark else INK if size else NOTE,
                )
            axes.set_xticks(range(len(response.input)), response.input, fontsize=6.5, rotation=20)
            axes.set_yticks(range(len(response.output)), response.output, fontsize=6.5)
            axes.set_title(
                f"|motion / motion of the support| at {frequency:g} Hz (SI)",
                loc="left",
                fontsize=7.5,
            )
            axes.tick_params(length=0)
            for side in ("left", "bottom"):
                axes.spines[side].set_visible(False)
        figure.suptitle(title, x=0.01, ha="left", fontsize=9)
        figure.tight_layout()
        return figure
