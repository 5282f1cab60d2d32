"""Figure of a fit: residuals of modes before and after, and fitted numbers."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.fit.solve import Fit
from suspension_cli.drawing.style import NOTE, PALE, PALETTE, house_style, new_figure, single_line

PLAIN_POWERS = range(-3, 3)
"""Powers of ten of numbers that are written without an exponent."""


def draw(found: Fit, title: str) -> Figure:
    """Draw the figure of `pendsus fit`.

    Parameters
    ----------
    found : Fit
    title : str
    """
    with house_style():
        figure = new_figure(8.4, max(2.6, 0.2 * _rows(found) + 1.3, 0.3 * len(found.name) + 1.3))
        left, right = figure.subplots(1, 2, width_ratios=[1.4, 1])
        if found.label:
            _draw_modes(left, found)
        else:
            _draw_resonances(left, found)
        _draw_numbers(right, found)
        verdict = (
            f"{'MISFIT, ' if found.misfit else ''}$\\chi^2$ = {found.chi_squared:.3g} for"
            f" {found.freedom} degrees of freedom"
        )
        figure.suptitle(f"{single_line(title, 70)}: {verdict}", x=0.01, ha="left", fontsize=9)
        figure.tight_layout()
        return figure


def _rows(found: Fit) -> int:
    if found.label or found.responses is None:
        return len(found.label)
    return len(found.responses.mode)


def _draw_resonances(axes: Axes, found: Fit) -> None:
    """Draw the resonances of measured transfer functions before and after the fit."""
    assert found.responses is not None
    table, rows = found.responses.resonance, np.arange(len(found.responses.mode))
    axes.axvline(0.0, color=NOTE, linewidth=0.5)
    for column, marker, colour, label in (
        (2, "o", PALETTE[1], "before"),
        (3, "D", PALETTE[0], "after"),
    ):
        axes.plot(
            100 * (table[:, column] / table[:, 0] - 1),
            rows,
            marker,
            markersize=3.5,
            markeredgecolor=colour,
            markerfacecolor="white" if marker == "o" else colour,
            label=label,
        )
    names = zip(found.responses.mode, table[:, 0], table[:, 4], strict=True)
    axes.set_yticks(
        rows, [f"{single_line(name, 40)}  {f:.4g} Hz, Q {q:.3g}" for name, f, q in names]
    )
    axes.tick_params(axis="y", labelsize=6.5)
    axes.set_ylim(max(len(rows), 1) - 0.4, -0.6)
    axes.set_xlabel("resonance of the model less measured (%)")
    axes.grid(visible=True, axis="x", color=PALE, linewidth=0.4)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, borderaxespad=0.1, fontsize=6.5)


def _draw_modes(axes: Axes, found: Fit) -> None:
    """Draw every mode before and after the fit, with lines between experiments."""
    rows = np.arange(len(found.label))
    error = 100 * found.uncertainty / found.measured
    axes.axvline(0.0, color=NOTE, linewidth=0.5)
    axes.hlines(rows, -error, error, color=PALE, linewidth=5)
    for value, marker, colour, label in (
        (found.before, "o", PALETTE[1], "before"),
        (found.after, "D", PALETTE[0], "after"),
    ):
        face = "white" if marker == "o" else colour
        axes.plot(
            100 * (value / found.measured - 1),
            rows,
            marker,
            markersize=3.5,
            markeredgecolor=colour,
            markerfacecolor=face,
            label=label,
        )
    axes.set_yticks(
        rows,
        [
            f"{single_line(name, 40)}  {f:.4g} Hz"
            for name, f in zip(found.modes, found.measured, strict=True)
        ],
        fontsize=6.5,
    )
    for edge in np.flatnonzero(np.diff(found.of)):
        axes.axhline(edge + 0.5, color=NOTE, linewidth=0.4, linestyle=(0, (4, 3)))
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlabel("model less measurement (%); bars: uncertainty")
    axes.grid(visible=True, axis="x", color=PALE, linewidth=0.4)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, borderaxespad=0.1, fontsize=6.5)


def _draw_numbers(axes: Axes, found: Fit) -> None:
    """Draw the fitted numbers with their uncertainties."""
    numbers = np.arange(len(found.name))
    unit = np.where(found.start == 0, 1.0, np.abs(found.start))
    spread = 100 * found.scale * np.where(np.isfinite(found.sigma), found.sigma, 0.0) / unit
    axes.axvline(0.0, color=NOTE, linewidth=0.5)
    axes.errorbar(
        100 * (found.value - found.start) / unit,
        numbers,
        xerr=spread,
        fmt="D",
        markersize=3.5,
        color=PALETTE[0],
        elinewidth=1.0,
        capsize=2,
    )
    experiments = [
        "" if row.all() else single_line(", ".join(np.array(found.experiment)[row]), 30) + ": "
        for row in found.shared
    ]
    texts = [
        format_with_sigma(value, sigma)
        for value, sigma in zip(found.value, found.scale * found.sigma, strict=True)
    ]
    axes.set_yticks(
        numbers,
        [
            f"{single_line(name, 44)}\n{who}{text}"
            for name, who, text in zip(found.name, experiments, texts, strict=True)
        ],
    )
    axes.tick_params(axis="y", labelsize=6)
    axes.set_ylim(len(numbers) - 0.4, -0.6)
    axes.set_xlabel("change from the start (%)")
    axes.grid(visible=True, axis="x", color=PALE, linewidth=0.4)


def format_with_sigma(value: float, sigma: float) -> str:
    """Format a number with its standard deviation to two significant digits of that.

    >>> format_with_sigma(1.2345, 0.012)
    '1.234 ± 0.012'
    """
    if not math.isfinite(sigma) or sigma <= 0:
        return f"{value:.5g}, " + ("at its bound" if math.isnan(sigma) else "not determined")
    power = math.floor(math.log10(max(abs(value), sigma)))
    unit, tail = (1.0, "") if power in PLAIN_POWERS else (10.0**power, f" × 10$^{{{power}}}$")
    digits = max(0, 1 - math.floor(math.log10(sigma / unit)))
    both = f"{value / unit:.{digits}f} ± {sigma / unit:.{digits}f}"
    return (f"({both}){tail}" if tail else both).replace("-", "−")
