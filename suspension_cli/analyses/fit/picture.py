"""Figure of a fit: residuals of modes before and after, and fitted numbers in their own units."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from suspension_cli.analyses.fit.solve import Fit
from suspension_cli.design.path_units import DISPLAYED, LOW_PRESSURE, unit_of
from suspension_cli.drawing import curves
from suspension_cli.drawing.style import (
    NOTE,
    PALE,
    PALETTE,
    add_axes,
    house_style,
    new_figure,
    single_line,
    write_text,
)

PLAIN_POWERS = range(-3, 3)
"""Powers of ten of numbers that are written without an exponent."""
INTERVAL = 1.959964
"""Half the width of a 95 % interval of a normal distribution, standard deviations."""
FAR = 8.0
"""Residual, in standard deviations, beyond which the axis of residuals is logarithmic."""
BEFORE, AFTER = PALETTE[1], PALETTE[0]
"""Colours of the design as given and as fitted."""
ROW, NUMBER = 0.17, 0.57
"""Heights of a row of residuals and of a fitted number, in."""
WIDE = 2.5
"""Width of the panel of residuals and of the axes of numbers, in."""
TOP = 0.98
"""Place of the panels below the upper edge, in."""


LARGE = 999_999.5
"""Numbers written with a power of ten."""


def draw(found: Fit, title: str) -> Figure:
    """Draw the figure of `pendsus fit`.

    Parameters
    ----------
    found : Fit
    title : str
        Names of the design and the model.
    """
    names, residuals, edges = _residuals(found)
    with house_style():
        left = 0.25 + 0.054 * max((len(name) for name in names), default=10)
        tall = max(ROW * len(names) + 0.1, 1.0)
        sigmas = bool(found.label) or found.responses is None
        right = left + WIDE + 0.35
        places, foot = _places(len(found.name), tall, left, right)
        height = max(TOP + tall + 0.55, foot + 0.2)
        figure = new_figure(right + WIDE + 0.35, height)
        axes = add_axes(figure, left, TOP, WIDE, tall)
        _draw_residuals(axes, names, residuals, edges, sigmas=sigmas)
        _draw_numbers(figure, found, places)
        what = f"{len(names)} {'modes' if found.label else 'resonances'}"
        verdict = (
            f"{'MISFIT: ' if found.misfit else ''}{_count(found.name)} fitted to {what},"
            rf" $\chi^2$ = {found.chi_squared:.4g} for {found.freedom} degrees of freedom"
        )
        curves.write_heading(figure, "", title)
        write_text(figure, 0.1, 0.08, verdict, 9.5, bold=True)
        return figure


def _places(count: int, tall: float, left: float, right: float) -> tuple[Any, float]:
    """Places (left, top) of numbers right of the residuals and, if many, below them, and the foot.

    All in inches from the upper left corner.
    """
    start = TOP + tall + 0.8
    above = int((tall + 0.8) / NUMBER)
    rest = max(0, count - above)
    lower = rest // 2 if rest > 2 else 0
    places = [(right, TOP + NUMBER * n) for n in range(count - lower)]
    places += [(left, start + NUMBER * n) for n in range(lower)]
    return places, max((top for _, top in places), default=TOP) + NUMBER


def _count(names: tuple[str, ...]) -> str:
    return "1 number" if len(names) == 1 else f"{len(names)} numbers"


def _residuals(found: Fit) -> tuple[list[str], Any, Any]:
    """Labels (k), residuals (k, 2) before and after, and the ends of experiments.

    Of modes, in standard deviations; or of the resonances of measured transfer functions, in per
    cent: those are read off the peaks for comparison and are not what is fitted.
    """
    if found.label or found.responses is None:
        off = np.stack([found.before, found.after], axis=1) - found.measured[:, None]
        names = [
            f"{single_line(name, 40)}  {f:.4g} Hz"
            for name, f in zip(found.modes, found.measured, strict=True)
        ]
        return names, off / found.uncertainty[:, None], np.flatnonzero(np.diff(found.of))
    table = found.responses.resonance
    names = [
        f"{single_line(name, 40)}  {f:.4g} Hz, Q {q:.3g}"
        for name, f, q in zip(found.responses.mode, table[:, 0], table[:, 4], strict=True)
    ]
    return names, 100 * (table[:, 2:4] / table[:, :1] - 1), np.empty(0)


def _draw_residuals(
    axes: Axes, names: list[str], residuals: Any, edges: Any, *, sigmas: bool
) -> None:
    """Draw every residual before and after the fit, with lines between experiments."""
    rows = np.arange(len(names))
    if sigmas:
        axes.axvspan(-INTERVAL, INTERVAL, color=PALE, alpha=0.45, linewidth=0)
    axes.axvline(0.0, color=NOTE, linewidth=0.5)
    known = residuals[np.isfinite(residuals)]
    most = float(np.abs(known).max(initial=2.5 if sigmas else 0.1))
    axes.hlines(rows, residuals[:, 0], residuals[:, 1], color=PALE, linewidth=0.8, zorder=1.5)
    for column, marker, face, colour, label in (
        (0, "o", "white", BEFORE, "before"),
        (1, "D", AFTER, AFTER, "after"),
    ):
        axes.plot(
            residuals[:, column],
            rows,
            marker,
            markersize=3.5,
            markeredgecolor=colour,
            markerfacecolor=face,
            label=label,
        )
    if most > FAR:
        axes.set_xscale("symlog", linthresh=2.0, linscale=0.7)
        top = 1 + int(np.log10(most))
        powers = [10.0**n for n in range(1, top + 1)][-1 :: -max(1, top // 3)]
        axes.set_xticks(sorted([0.0, *powers, *(-p for p in powers)]))
        axes.set_xticks([], minor=True)
        axes.set_xlim(-2.2 * most, 2.2 * most)
    else:
        axes.set_xlim(-1.15 * most, 1.15 * most)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: curves.write_plainly(x)))
    curves.rule(axes)
    axes.grid(visible=False, axis="y")
    axes.set_yticks(rows, names)
    axes.tick_params(axis="y", labelsize=7.5, length=0)
    for edge in edges:
        axes.axhline(edge + 0.5, color=NOTE, linewidth=0.4, linestyle=(0, (4, 3)))
    axes.set_ylim(max(len(rows), 1) - 0.4, -0.6)
    axes.set_xlabel("(model − measured) / uncertainty" if sigmas else "model less measured (%)")
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.02, 1), ncols=2, borderaxespad=0.1, fontsize=7.5,
        handletextpad=0.1, columnspacing=0.8,
    )  # fmt: skip
    axes.set_title(
        "residuals; grey: 95 %" if sigmas else "resonances", loc="left", fontsize=8, pad=4
    )


def _draw_numbers(figure: Figure, found: Fit, places: list[tuple[float, float]]) -> None:
    """Draw each fitted number on an axis of its own: start, value and 95 % interval."""
    if places:
        write_text(figure, places[0][0], TOP - 0.19, "fitted numbers, bars: 95 %", 8)
    for n, (name, (left, top)) in enumerate(zip(found.name, places, strict=True)):
        unit, factor = _unit(name, float(found.value[n]))
        start, value = factor * found.start[n], factor * found.value[n]
        sigma = factor * found.scale * found.sigma[n]
        half = INTERVAL * sigma
        who = (
            ""
            if found.shared[n].all()
            else single_line(", ".join(np.array(found.experiment)[found.shared[n]]), 30)
        )
        write_text(figure, left, top, single_line(name, 44), 7.5)
        text = f"{format_with_sigma(value, half)} {unit}".strip()
        axes = add_axes(figure, left, top + 0.28, WIDE, 0.08)
        axes.text(
            1, 2.94, text + (f" ({who})" if who else ""), transform=axes.transAxes,
            va="top", ha="right", fontsize=7.5, color=AFTER,
        )  # fmt: skip
        axes.spines["left"].set_visible(False)
        axes.set_yticks([])
        axes.axvline(start, color=BEFORE, linewidth=0.6, ymin=-0.2, ymax=1.4, clip_on=False)
        axes.plot(
            start, 0, "o", markersize=4, markeredgecolor=BEFORE, markerfacecolor="white",
            clip_on=False, zorder=3,
        )  # fmt: skip
        known = math.isfinite(half)
        if known:
            axes.errorbar(value, 0, xerr=half, color=AFTER, elinewidth=1.4, capsize=2.5)
        axes.plot(value, 0, "D", markersize=3.5, color=AFTER, clip_on=False, zorder=4)
        ends = np.array([start, value - half, value + half] if known else [start, value])
        span = float(np.ptp(ends)) or abs(value) or 1.0
        axes.set_xlim(ends.min() - 0.1 * span, ends.max() + 0.1 * span)
        axes.set_ylim(-0.5, 0.5)
        axes.xaxis.set_major_locator(MaxNLocator(4 if np.abs(ends).max() < LARGE else 3))
        axes.tick_params(labelsize=7.5, length=2, pad=1.5)
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: _write_tick(x)))


def _write_tick(value: float) -> str:
    """Write a number with six digits; with a power of ten where it is very small or large."""
    if value == 0 or 1e-4 <= abs(value) < LARGE:
        return f"{value:.6g}".replace("-", "−")
    return curves.write_plainly(value)


def _unit(path: str, value: float) -> tuple[str, float]:
    """Unit in which a number of a design is read, and the factor to it."""
    unit = unit_of(path)
    if unit == "Pa" and abs(value) < LOW_PRESSURE:
        return unit, 1.0
    name, factor = DISPLAYED.get(unit, (unit, 1.0))
    return ("" if name == "1" else name), factor


def format_with_sigma(value: float, sigma: float) -> str:
    """Format a number with its uncertainty to two significant digits of that.

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
