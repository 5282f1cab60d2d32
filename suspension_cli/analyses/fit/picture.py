"""Figure of a fit: residuals of modes before and after, and fitted numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator
from matplotlib.transforms import blended_transform_factory

from suspension_cli.analyses.fit.result import Fit, ResponseFit
from suspension_cli.design.path_units import displayed_unit
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

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Int
    from matplotlib.artist import Artist

PLAIN_POWERS = range(-3, 3)
"""Powers of ten that are written without an exponent."""
MANY = 9999.5
"""Largest number on an axis above which it has fewer labels."""
INTERVAL = 1.959964
"""Half width of a 95 % interval of a normal distribution, standard deviations."""
FAR = 8.0
"""Residual (standard deviations) beyond which their axis is logarithmic."""
BEFORE, AFTER = PALETTE[1], PALETTE[0]
"""Colours of the design as given and as fitted."""
ROW, NUMBER, LINE = 0.17, 0.57, 0.15
"""Heights of a row of residuals, of a fitted number, and of a line of text, in."""
PLACES, WIDE = (0.22, 2.46), 1.88
"""Left edges and width of the axes of numbers, in."""
TOP = 0.85
"""Top of the residuals below the upper edge, in."""
LONGEST, WHO = 32, 14
"""Longest names of modes and of experiments, characters."""
LETTER = 0.058
"""Width of a letter, in."""


LARGE = 999_999.5
"""Number from which ticks have a power of ten."""
SHOWN = 6
"""Most functions that are drawn."""
POINTS = 1000
"""Frequencies at which a model is drawn."""
EXACT, ENOUGH = 1e-9, 1e-6
"""Relative errors of a rational interpolation: aim, and largest accepted."""


def draw(found: Fit, title: str) -> Figure:
    """Draw the figure of `pendsus fit`."""
    names, residuals, starts = _residuals(found)
    with house_style():
        who = [single_line(found.experiment[found.of[n]], WHO) for n in starts]
        left = 0.15 + LETTER * (max(map(len, names), default=10) + max(map(len, who), default=-2))
        left += 0.1 if who else 0.0
        tall = max(ROW * len(names) + 0.1, 0.5)
        below = TOP + tall + 0.78
        places, foot = _places(found, below)
        figure = new_figure(curves.COLUMN, foot + 0.2)
        axes = add_axes(figure, left, TOP, curves.COLUMN - left - 0.15, tall)
        known = "measured" if found.label or found.responses is None else "peak read off"
        _draw_residuals(axes, names, residuals, f"(model − {known}) / uncertainty")
        _name_experiments(figure, axes, who, starts)
        _draw_numbers(figure, found, places, below)
        curves.write_heading(figure, _heading_text(found), title)
        verdict = rf"$\chi^2$ = {found.chi_squared:.4g} for {found.freedom} degrees of freedom"
        if found.misfit:
            wide = f"bars widened {found.scale:.3g} times"
            verdict += f"; {wide if found.unlikely else 'contradicts the priors'}"
        write_text(figure, 0.1, 0.43, verdict, 7.5)
        figure.legend(
            handles=axes.get_legend_handles_labels()[0], loc="upper left",
            bbox_to_anchor=(0.08 / curves.COLUMN, 1 - 0.57 / figure.get_figheight()), ncols=3,
            borderpad=0.1, borderaxespad=0.0, handletextpad=0.3, columnspacing=1.0, fontsize=7.5,
            handlelength=1.2,
        )  # fmt: skip
        return figure


def _heading_text(found: Fit) -> str:
    """Write the heading: counts of numbers and data, and a misfit."""
    several = f" in {len(found.experiment)} experiments" if len(found.experiment) > 1 else ""
    modes = [_count(len(found.label), "mode") + several] if found.label else []
    functions = len(found.responses.function) if found.responses else 0
    what = modes + ([_count(functions, "transfer function")] if functions else [])
    said = f"{_count(len(found.name), 'number')} fitted to {' and '.join(what)}"
    return f"MISFIT: {said}" if found.misfit else said


def _places(found: Fit, top: float) -> tuple[list[tuple[float, float]], float]:
    """Corners (left, top) of the axes of numbers in two columns, and the foot, in."""
    count = len(found.name)
    high = NUMBER + (0.0 if found.shared.all() else LINE)
    rows = -(-count // len(PLACES))
    places = [(PLACES[n // rows], top + high * (n % rows)) for n in range(count)]
    return places, top + high * rows


def _count(count: int, thing: str) -> str:
    return f"1 {thing}" if count == 1 else f"{count} {thing}s"


def _residuals(
    found: Fit,
) -> tuple[list[str], Float[np.ndarray, "row 2"], Int[np.ndarray, " experiment"]]:
    """Labels (k), residuals (k, 2) before and after, and the first row of each experiment.

    Residuals are those of modes, in standard deviations; else those of resonances read off the
    peaks of transfer functions, which are not fitted themselves.
    """
    if found.label or found.responses is None:
        off = np.stack([found.before, found.after], axis=1) - found.measured[:, None]
        names = [
            f"{single_line(name, LONGEST - 10)}  {f:.4g} Hz"
            for name, f in zip(found.label, found.measured, strict=True)
        ]
        several = len(found.experiment) > 1
        starts = np.flatnonzero(np.diff(found.of, prepend=-1)) if several else np.empty(0, int)
        return names, off / found.uncertainty[:, None], starts
    table = found.responses.resonance
    names = [
        f"{single_line(name, LONGEST - 10)}  {f:.4g} Hz, Q {q:.3g}"
        for name, f, q in zip(found.responses.mode, table[:, 0], table[:, 4], strict=True)
    ]
    return names, (table[:, 2:4] - table[:, :1]) / table[:, 1:2], np.empty(0, int)


def _draw_residuals(
    axes: Axes, names: list[str], residuals: Float[np.ndarray, "row 2"], label: str
) -> None:
    rows = np.arange(len(names))
    axes.axvspan(-INTERVAL, INTERVAL, color=PALE, alpha=0.45, linewidth=0, label="95 %")
    axes.axvline(0.0, color=NOTE, linewidth=0.5)
    known = residuals[np.isfinite(residuals)]
    most = float(np.abs(known).max(initial=2.5))
    axes.hlines(rows, residuals[:, 0], residuals[:, 1], color=PALE, linewidth=0.8, zorder=1.5)
    for column, marker, face, colour, text in (
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
            label=text,
        )
    if most > FAR:
        decades = np.log10(most)
        axes.set_xscale("symlog", linthresh=2.0, linscale=0.5 + 0.3 * decades)
        powers = np.arange(np.ceil(decades), 0, -np.ceil(decades / 3))
        tens = 10.0 ** powers[10.0**powers <= 2 * most]
        both = np.array([[1.0], [-1.0]])
        axes.set_xticks([0.0, *(both * [1.0, 2.0, *tens]).ravel()])
        fine = np.outer(10.0 ** np.arange(np.ceil(decades)), np.arange(2.0, 10.0)).ravel()
        axes.set_xticks((both * fine).ravel(), minor=True)
        axes.set_xlim(-2.2 * most, 2.2 * most)
    else:
        axes.set_xlim(-1.15 * most, 1.15 * most)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: curves.write_plainly(x)))
    curves.rule(axes)
    axes.grid(visible=False, axis="y")
    axes.set_yticks(rows, names)
    axes.tick_params(axis="y", labelsize=7.5, length=0)
    axes.set_ylim(max(len(rows), 1) - 0.4, -0.6)
    axes.set_xlabel(label)


def _name_experiments(
    figure: Figure, axes: Axes, who: list[str], starts: Int[np.ndarray, " experiment"]
) -> None:
    """Write the name of each experiment beside its first row, under a line."""
    box = axes.get_position()
    margin = (0.1 / curves.COLUMN - box.x0) / box.width
    for n, (name, start) in enumerate(zip(who, starts, strict=True)):
        at = blended_transform_factory(figure.transFigure, axes.transData)
        axes.text(
            0.1 / curves.COLUMN, start, name, transform=at, va="center", fontsize=7.5,
            fontweight="bold",
        )  # fmt: skip
        if n:
            axes.axhline(start - 0.5, xmin=margin, color=NOTE, linewidth=0.4, clip_on=False)


def _draw_numbers(
    figure: Figure, found: Fit, places: list[tuple[float, float]], top: float
) -> None:
    """Draw start, value and 95 % interval of each number on an axis of its own."""
    if places:
        write_text(figure, 0.1, top - 0.2, "Fitted numbers; bars: 95 %", 8, bold=True)
    joint = not found.shared.all()
    for n, (name, (left, top)) in enumerate(zip(found.name, places, strict=True)):
        unit, factor = displayed_unit(name, float(found.value[n]))
        unit = unit.replace("^2", "²")
        start, value = factor * found.start[n], factor * found.value[n]
        sigma = factor * found.scale * found.sigma[n]
        half = INTERVAL * sigma
        write_text(figure, left - 0.12, top, single_line(name, 35), 7.5)
        if joint:
            who = ", ".join(np.array(found.experiment)[found.shared[n]])
            who = "all" if found.shared[n].all() else single_line(who, 33)
            top += LINE
            write_text(figure, left - 0.12, top, who, 7.5, NOTE)
        text = f"{format_with_sigma(value, half)} {unit}".strip()
        axes = add_axes(figure, left, top + 0.28, WIDE, 0.08)
        axes.text(
            1, 2.94, text, transform=axes.transAxes, va="top", ha="right", fontsize=7.5, color=AFTER
        )
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
        axes.xaxis.set_major_locator(MaxNLocator(4 if np.abs(ends).max() < MANY else 3))
        axes.tick_params(labelsize=7.5, length=2, pad=1.5)
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: _write_tick(x)))


def _write_tick(value: float) -> str:
    """Write a number with six digits, and a power of ten if it is very small or large."""
    if value == 0 or 1e-4 <= abs(value) < LARGE:
        return f"{value:.6g}".replace("-", "−")
    return curves.write_plainly(value)


def format_with_sigma(value: float, sigma: float) -> str:
    """Format a number with its uncertainty to two digits.

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


def draw_responses(found: ResponseFit, title: str, units: Sequence[str] = ()) -> Figure:
    """Draw magnitudes (in `units`: ``m/V``) measured, before and after the fit, and residuals."""
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
            _draw_function(top, below, found, int(n), float(ratio[n]))
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


def _draw_function(top: Axes, below: Axes, found: ResponseFit, n: int, ratio: float) -> None:
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
    """Interpolate a computed response by a rational function, to draw its peaks between points.

    A response is a rational function but for slow factors of delays and losses. The AAA algorithm
    (Nakatsukasa, Sete and Trefethen, SIAM J. Sci. Comput. 40, A1494 (2018)) finds its poles; if it
    fails, the points are returned.

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
