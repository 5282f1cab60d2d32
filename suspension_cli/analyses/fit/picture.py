"""Figure of a fit: residuals of modes before and after, and fitted numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import blended_transform_factory

from suspension_cli.analyses.fit.result import Fit, ResponseFit
from suspension_cli.design.paths import displayed_unit
from suspension_cli.drawing import labels, panels
from suspension_cli.drawing.canvas import TextLook
from suspension_cli.drawing.panels import ITEM, Across, Line, Panel, Rule
from suspension_cli.drawing.style import (
    NOTE,
    PALE,
    PALETTE,
    LineLook,
    figure_of,
    format_raised,
    single_line,
)

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Int

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
NAMES = ("before", "after")
LOOKS: tuple[tuple[str, LineLook], ...] = (
    (
        BEFORE,
        {
            "linestyle": "none",
            "marker": "o",
            "markersize": 3.5,
            "markerfacecolor": "white",
            "zorder": 4,
        },
    ),
    (AFTER, {"linestyle": "none", "marker": "D", "markersize": 3.5, "zorder": 4}),
)
"""Marks of the design as given and as fitted."""
LONGEST, WHO = 32, 14
"""Longest names of modes and of experiments, characters."""
SHOWN = 6
"""Most functions that are drawn."""
POINTS = 1000
"""Frequencies at which a model is drawn."""
EXACT, ENOUGH = 1e-9, 1e-6
"""Relative errors of a rational interpolation: aim, and largest accepted."""


def draw(found: Fit, title: str) -> Figure:
    """Draw the figure of `pendsus fit`."""
    verdict = rf"$\chi^2$ = {found.chi_squared:.4g} for {found.freedom} degrees of freedom"
    if found.misfit:
        wide = f"bars widened {found.scale:.3g} times"
        verdict += f"; {wide if found.unlikely else 'contradicts the priors'}"
    shown: list[Panel | tuple[Panel, ...]] = [_residuals_panel(found, verdict)]
    numbers = [_number(found, n) for n in range(len(found.name))]
    if numbers:
        numbers[0] = replace(numbers[0], title="Fitted numbers; bars: 95 %")
        beside = [*numbers, Panel(across=Across(""), height=0.08, paint=Axes.set_axis_off)]
        shown += [(beside[n], beside[n + 1]) for n in range(0, len(numbers), 2)]
    return panels.draw(_heading_text(found), title, shown)


def _heading_text(found: Fit) -> str:
    """Write the heading: counts of numbers and data, and a misfit."""
    several = f" in {len(found.experiment)} experiments" if len(found.experiment) > 1 else ""
    modes = [_count(len(found.label), "mode") + several] if found.label else []
    functions = len(found.responses.function) if found.responses else 0
    what = modes + ([_count(functions, "transfer function")] if functions else [])
    said = f"{_count(len(found.name), 'number')} fitted to {' and '.join(what)}"
    return f"MISFIT: {said}" if found.misfit else said


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


def _residuals_panel(found: Fit, verdict: str) -> Panel:
    """Make the panel of residuals before and after, with names of experiments."""
    names, residuals, starts = _residuals(found)
    who = [single_line(found.experiment[found.of[n]], WHO) for n in starts]
    known = residuals[np.isfinite(residuals)]
    most = float(np.abs(known).max(initial=2.5))

    def paint(axes: Axes) -> None:
        rows = np.arange(len(names))
        axes.axvspan(-INTERVAL, INTERVAL, color=PALE, alpha=0.45, linewidth=0)
        axes.hlines(rows, residuals[:, 0], residuals[:, 1], color=PALE, linewidth=0.8, zorder=1.5)
        for values, name, (colour, look) in zip(residuals.T, NAMES, LOOKS, strict=True):
            axes.plot(values, rows, color=colour, label=name, **look)
        axes.set_xlim(-1.15 * most, 1.15 * most)
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
        axes.xaxis.set_major_formatter(lambda x, _: format_raised(x, 6))
        figure = figure_of(axes)
        for n, (name, start) in enumerate(zip(who, starts, strict=True)):
            at = 0.1 / figure.get_figwidth()
            place = blended_transform_factory(figure.transFigure, axes.transData)
            look = TextLook(va="center", fontweight="bold", fontsize=labels.SMALL)
            axes.text(at, start, name, transform=place, **look)
            if n:
                box = axes.get_position()
                edge = (at - box.x0) / box.width
                axes.axhline(start - 0.5, edge, color=NOTE, linewidth=0.4, clip_on=False)

    key = [Line([], [], "95 %", PALE, {"linewidth": 6})]
    key += [Line([], [], name, *look) for name, look in zip(NAMES, LOOKS, strict=True)]
    what = "measured" if found.label or found.responses is None else "peak read off"
    return Panel(
        height=max(ITEM * len(names) + 0.1, 0.5), rows=names, title=verdict, key=key, paint=paint,
        left=0.24 + labels.widest(names or [" " * 10]) + labels.widest(who) + 0.1 * bool(who),
        rules=[Rule(0.0, "", True, NOTE, "-")],
        across=Across(f"(model − {what}) / uncertainty", "linear"),
    )  # fmt: skip


def _number(found: Fit, n: int) -> Panel:
    """Make the panel of the start, value and 95 % interval of a number."""
    name = found.name[n]
    unit, factor = displayed_unit(name, float(found.value[n]))
    start, value = factor * found.start[n], factor * found.value[n]
    half = INTERVAL * factor * found.scale * found.sigma[n]
    text = f"{format_with_sigma(value, half)} {unit.replace('^2', '²')}".strip()
    remarks = [single_line(name, 35)]
    if not found.shared.all():
        who = ", ".join(np.array(found.experiment)[found.shared[n]])
        remarks.append("all" if found.shared[n].all() else single_line(who, 33))
    ends = np.array([start, value - half, value + half] if math.isfinite(half) else [start, value])
    span = float(np.ptp(ends)) or abs(value) or 1.0

    def paint(axes: Axes) -> None:
        axes.grid(visible=False)
        axes.spines["left"].set_visible(False)
        axes.set_yticks([])
        axes.set_ylim(-0.5, 0.5)
        for at, error, (colour, look) in zip((start, value), (None, half), LOOKS, strict=True):
            axes.plot(at, 0, color=colour, clip_on=False, **look)
            if error is not None and math.isfinite(error):
                axes.errorbar(at, 0, xerr=error, color=colour, elinewidth=1.4, capsize=2.5)
        look = {"va": "bottom", "ha": "right", "fontsize": labels.SMALL, "color": LOOKS[1][0]}
        axes.annotate(
            text, (1, 1), (0, 4), xycoords="axes fraction", textcoords="offset points", **look
        )
        axes.xaxis.set_major_locator(MaxNLocator(4 if np.abs(ends).max() < MANY else 3))
        axes.tick_params(length=2, pad=1.5)
        axes.xaxis.set_major_formatter(lambda x, _: format_raised(x, 6))

    limits = float(ends.min() - 0.1 * span), float(ends.max() + 0.1 * span)
    return Panel(
        height=0.08, remarks=remarks, above=0.2, left=0.22, right=0.15, paint=paint,
        across=Across("", "linear", limits),
    )  # fmt: skip


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
    shown = []
    for n in order:
        unit = f" ({units[n]})" if len(units) else ""
        shown += _function(found, int(n), float(ratio[n]), f"|reading / drive|{unit}")
    left = len(found.function) - len(order)
    which = f", the {len(order)} of {len(found.function)} that fit worst" if left else ""
    return panels.draw(f"Fitted transfer functions{which}", title, shown)


def _function(found: ResponseFit, n: int, ratio: float, label: str) -> list[Panel]:
    """Make the panels of a transfer function and of its residuals."""
    own = found.of == n
    frequency = found.frequency[own]
    size = np.abs(found.measured[own])
    dots: LineLook = {"linestyle": "none", "marker": ".", "markersize": 2.5, "zorder": 1}
    lines = [Line(frequency, size, "measured", NOTE, dots)]
    for value, colour, name in ((found.before, BEFORE, "before"), (found.after, AFTER, "after")):
        if np.abs(value[own]).max() > 1e-6 * size.max():
            at, seen = interpolate(frequency, value[own])
            lines.append(Line(at, np.abs(seen), name, colour, {"linewidth": 0.9}))
    low, high = size[size > 0].min(initial=np.inf), size.max()
    limits = (float(low / 3), float(high * 3)) if low < high else None
    name = single_line(f"{found.function[n]}: {found.output[n]} / {found.input[n]}", 46)
    title = rf"{name}, $\chi^2$ per value {ratio:.3g}"
    off = (found.after[own] - found.measured[own]) / found.uncertainty[own]
    largest = max(4.0, 1.1 * float(np.abs([off.real, off.imag]).max()))
    cross: LineLook = {"linestyle": "none", "marker": "x", "markersize": 2.5}
    parts = [
        Line(frequency, off.real, "residual, real", PALETTE[3], {**dots, "markersize": 3}),
        Line(frequency, off.imag, "imaginary", PALETTE[2], cross),
    ]

    def paint(axes: Axes) -> None:
        axes.axhspan(-2, 2, color=PALE, linewidth=0, alpha=0.5)

    key = [*parts, Line([], [], "±2σ", PALE, {"linewidth": 6})]
    return [
        Panel(label, lines, 1.4, "log", limits, title),
        Panel(
            "residual (σ)", parts, 0.65, limits=(-largest, largest), paint=paint, key=key,
            across=Across(),
        ),
    ]  # fmt: skip


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
