"""Figure of a fit of transfer functions: the functions that fit worst, before and after."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.fit.response_fit import ResponseFit
from suspension_cli.drawing import curves
from suspension_cli.drawing.style import NOTE, PALE, PALETTE, house_style, new_figure, single_line

if TYPE_CHECKING:
    from jaxtyping import Complex, Float
    from matplotlib.artist import Artist

SHOWN = 6
"""Functions that are drawn."""
POINTS = 1000
"""Frequencies at which a model is drawn."""
EXACT, ENOUGH = 1e-9, 1e-6
"""Relative error at which a rational interpolation ends, and which it may have."""


def draw(found: ResponseFit, title: str, units: Sequence[str] = ()) -> Figure:
    """Draw magnitudes as measured, before and after the fit, and residuals.

    Parameters
    ----------
    units
        Of the functions, ``m/V``.
    """
    ratio = found.chi_squared / np.maximum(found.points, 1)
    order = np.argsort(-ratio, kind="stable")[:SHOWN]
    rows = len(order)
    with house_style():
        across, up = curves.COLUMN, curves.HEAD + 0.45 + 2.7 * rows + 0.3
        figure = new_figure(across, up)
        outer = figure.add_gridspec(rows, 1)
        curves.set_margins(figure, left=0.7, top=curves.HEAD + 0.63, bottom=0.6, hspace=0.32)
        handles: list[Artist] = []
        names: list[str] = []
        for place, n in enumerate(order):
            inner = outer[place].subgridspec(2, 1, height_ratios=[2.2, 1], hspace=0.1)
            top = figure.add_subplot(inner[0])
            below = figure.add_subplot(inner[1], sharex=top)
            _draw_one(top, below, found, int(n), float(ratio[n]))
            unit = units[n] if len(units) else ""
            top.set_ylabel("|reading / drive|" + (f" ({unit})" if unit else ""))
            figure.align_ylabels([top, below])
            if place == 0:
                handles = [
                    *top.get_legend_handles_labels()[0],
                    *below.get_legend_handles_labels()[0],
                ]
                handles = [handles[m] for m in (0, 3, 1, 4, 2, 5)[: len(handles)]]
                names = [str(handle.get_label()) for handle in handles]
        figure.legend(
            handles, names, loc="upper left", bbox_to_anchor=(0.05 / across, 1 - 0.42 / up),
            ncols=3, fontsize=7.5, handletextpad=0.2, columnspacing=0.8, handlelength=1.1,
        )  # fmt: skip
        left = len(found.function) - len(order)
        which = f", the {len(order)} of {len(found.function)} that fit worst" if left else ""
        curves.write_heading(figure, f"Fitted transfer functions{which}", title)
        return figure


def _draw_one(top: Axes, below: Axes, found: ResponseFit, n: int, ratio: float) -> None:
    own = found.of == n
    frequency = found.frequency[own]
    size = np.abs(found.measured[own])
    top.loglog(frequency, size, ".", markersize=2.5, color=NOTE, label="measured", zorder=1)
    for value, colour, label, width in (
        (found.before, PALETTE[1], "before", 0.8),
        (found.after, PALETTE[0], "after", 1.0),
    ):
        if np.abs(value[own]).max() > 1e-6 * size.max():
            at, seen = interpolate(frequency, value[own])
            top.loglog(at, np.abs(seen), color=colour, linewidth=width, label=label)
    low, high = size[size > 0].min(initial=np.inf), size.max()
    if low < high:
        top.set_ylim(low / 3, high * 3)
    name = single_line(f"{found.function[n]}: {found.output[n]} / {found.input[n]}", 46)
    top.set_title(rf"{name}, $\chi^2$ per value {ratio:.3g}", fontsize=7.5, loc="left", pad=3)
    top.tick_params(which="both", labelbottom=False)
    curves.rule(top)
    off = (found.after[own] - found.measured[own]) / found.uncertainty[own]
    below.axhspan(-2, 2, color=PALE, linewidth=0, alpha=0.5, label="±2σ")
    below.semilogx(frequency, off.real, ".", markersize=3, color=PALETTE[3], label="residual, real")
    below.semilogx(frequency, off.imag, "x", markersize=2.5, color=PALETTE[2], label="imaginary")
    largest = max(4.0, 1.1 * float(np.abs([off.real, off.imag]).max()))
    below.set_ylim(-largest, largest)
    below.set_ylabel("residual (σ)")
    below.set_xlabel("frequency (Hz)")
    curves.rule(below)
    curves.label_plainly(top.yaxis)


def interpolate(
    frequency: Float[np.ndarray, " frequency"], value: Complex[np.ndarray, " frequency"]
) -> tuple[Float[np.ndarray, " finer"], Complex[np.ndarray, " finer"]]:
    """Interpolate a computed response by a rational function, so that its peaks are round.

    A response is a rational function but for slow factors of delays and losses, so that the AAA
    algorithm (Nakatsukasa, Sete and Trefethen, SIAM J. Sci. Comput. 40, A1494 (2018)) finds the
    poles between the points. Where it does not, the points are returned.

    Examples
    --------
    >>> f = np.linspace(0.5, 2.0, 16)
    >>> response = 1 / (1.03**2 - f**2 + 0.01j * f)
    >>> [round(float(abs(some).max())) for some in (response, interpolate(f, response)[1])]
    [16, 97]
    """
    from scipy.interpolate import AAA

    if len(frequency) < 8:
        return frequency, value
    model = AAA(frequency, value, rtol=EXACT, max_terms=len(frequency) // 2)
    if model.errors[-1] > ENOUGH * np.abs(value).max():
        return frequency, value
    at = np.union1d(frequency, np.geomspace(frequency[0], frequency[-1], POINTS))
    return at, model(at)
