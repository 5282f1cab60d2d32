"""Figure of a fit of transfer functions: the functions that fit worst, before and after."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.fit.response_fit import ResponseFit
from suspension_cli.drawing.style import NOTE, PALE, PALETTE, house_style, new_figure, single_line

SHOWN = 6
"""Functions that are drawn."""


def draw(found: ResponseFit, title: str) -> Figure:
    """Draw magnitudes as measured, before and after the fit, and residuals.

    Parameters
    ----------
    found : ResponseFit
    title : str
    """
    ratio = found.chi_squared / np.maximum(found.points, 1)
    order = np.argsort(-ratio, kind="stable")[:SHOWN]
    columns = min(len(order), 2)
    rows = -(-len(order) // columns)
    with house_style():
        figure = new_figure(4.4 * columns, 2.9 * rows + 0.4)
        outer = figure.add_gridspec(rows, columns)
        for place, n in enumerate(order):
            row, column = divmod(place, columns)
            inner = outer[row, column].subgridspec(2, 1, height_ratios=[2.2, 1], hspace=0.1)
            top = figure.add_subplot(inner[0])
            below = figure.add_subplot(inner[1], sharex=top)
            _draw_one(top, below, found, int(n), float(ratio[n]), legend=place == 0)
        left = len(found.function) - len(order)
        which = (
            f"the {len(order)} of {len(found.function)} functions that fit worst" if left else ""
        )
        figure.suptitle(
            f"{single_line(title, 70)}" + (f": {which}" if which else ""),
            x=0.01,
            ha="left",
            fontsize=9,
        )
        figure.tight_layout()
        return figure


def _draw_one(
    top: Axes, below: Axes, found: ResponseFit, n: int, ratio: float, *, legend: bool
) -> None:
    own = found.of == n
    frequency = found.frequency[own]
    size = np.abs(found.measured[own])
    top.loglog(frequency, size, ".", markersize=2.5, color=NOTE, label="measured", zorder=1)
    for value, colour, label, width in (
        (found.before, PALETTE[1], "before", 0.8),
        (found.after, PALETTE[0], "after", 1.0),
    ):
        seen = np.abs(value[own])
        if seen.max() > 1e-6 * size.max():
            top.loglog(frequency, seen, color=colour, linewidth=width, label=label)
    low, high = size[size > 0].min(initial=np.inf), size.max()
    if low < high:
        top.set_ylim(low / 3, high * 3)
    top.set_ylabel("magnitude")
    name = single_line(f"{found.function[n]}: {found.output[n]} / {found.input[n]}", 56)
    top.set_title(f"{name}, $\\chi^2$ per value {ratio:.3g}", fontsize=7, loc="left")
    top.tick_params(which="both", labelbottom=False)
    top.grid(visible=True, color=PALE, linewidth=0.4)
    if legend:
        top.legend(fontsize=6.5)
    off = (found.after[own] - found.measured[own]) / found.uncertainty[own]
    below.axhspan(-2, 2, color=PALE, linewidth=0, alpha=0.5, label="2 $\\sigma$")
    below.semilogx(frequency, off.real, ".", markersize=2, color=PALETTE[0], label="real")
    below.semilogx(frequency, off.imag, ".", markersize=2, color=PALETTE[2], label="imaginary")
    largest = max(4.0, 1.1 * float(np.abs([off.real, off.imag]).max()))
    below.set_ylim(-largest, largest)
    below.set_ylabel("residual / $\\sigma$", fontsize=6.5)
    below.set_xlabel("frequency (Hz)")
    below.grid(visible=True, color=PALE, linewidth=0.4)
    if legend:
        below.legend(
            fontsize=6, ncols=3, loc="upper right", bbox_to_anchor=(1, -0.25), borderaxespad=0
        )
