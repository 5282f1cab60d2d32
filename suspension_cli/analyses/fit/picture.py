"""Figures of a fit: residuals of modes, fitted numbers, and transfer functions before and after."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.analyses.fit.printed_parameters import short
from suspension_cli.analyses.fit.response_fit import ResponseFit
from suspension_cli.analyses.fit.result import Fitted
from suspension_cli.design.paths import displayed_unit
from suspension_cli.drawing import panels
from suspension_cli.drawing.panels import ITEM, Across, Line, Panel, Rule
from suspension_cli.drawing.style import NOTE, PALE, PALETTE, LineLook, single_line, write_unit
from suspension_cli.quantities.requirements import displayed_unit as displayed

if TYPE_CHECKING:
    from jaxtyping import Float

INTERVAL = 1.959964
"""Half width of a 95 % interval of a normal distribution, standard deviations."""
MARK: LineLook = {"linestyle": "none", "markersize": 3.5, "zorder": 4}
HOLLOW: LineLook = {**MARK, "marker": "o", "markerfacecolor": "white"}
BEFORE = Line([], [], "before", PALETTE[1], HOLLOW)
AFTER = Line([], [], "after", PALETTE[0], {**MARK, "marker": "D"})
"""Marks of the design as given and as fitted."""
LONGEST = 30
"""Longest names of modes and numbers, characters."""
SHOWN = 6
"""Most functions that are drawn."""


def draw(found: Fitted, title: str) -> Figure:
    """Draw the figure of `pendsus fit`.

    Residuals are those of modes and quantities; else those of resonances read off the peaks of
    transfer functions, which are not fitted themselves.
    """
    verdict = rf"$\chi^2$ = {found.chi_squared:.4g} for {found.freedom} degrees of freedom"
    if found.scale > 1:
        verdict += f"; uncertainties {found.scale:.3g} times as large"
    elif found.misfit and not found.unlikely:
        verdict += "; contradicts the priors"
    shown = [_residuals(found, verdict)]
    if found.name:
        with np.errstate(invalid="ignore", divide="ignore"):
            moved = ((found.value - found.start) / found.sigma)[:, None]
        names = [single_line(_name(found, n), LONGEST) for n in range(len(found.name))]
        texts = [_number(found, n) for n in range(len(names))]
        label = "(fitted − start) / uncertainty"
        shown.append(_rows(names, moved, [AFTER], "Fitted numbers", label, texts))
    said = f"{_count(len(found.name), 'number')} fitted to {_data(found)}"
    return panels.draw(f"MISFIT: {said}" if found.misfit else said, title, shown)


def _data(found: Fitted) -> str:
    """Count the modes, quantities and functions that were measured."""
    what = []
    if found.label:
        what.append(_count(len(found.label), "mode"))
    if found.quantity:
        what.append(_count(len(found.quantity), "quantity", "quantities"))
    if found.responses is not None:
        what.append(_count(len(found.responses.function), "transfer function"))
    several = f" in {len(found.experiment)} experiments" if len(found.experiment) > 1 else ""
    return " and ".join(what) + several


def _residuals(found: Fitted, verdict: str) -> Panel:
    """Make the panel of modes and quantities, or of resonances of transfer functions."""
    source = "measured"
    if found.label or found.quantity or found.responses is None:
        measured = np.concatenate([found.measured, found.value_measured])
        uncertainty = np.concatenate([found.uncertainty, found.value_uncertainty])
        before = np.concatenate([found.before, found.value_before])
        after = np.concatenate([found.after, found.value_after])
        rows = [
            f"{single_line(name, LONGEST)}  {hz:.4g} Hz"
            for name, hz in zip(found.modes, found.measured, strict=True)
        ]
        for n, name in enumerate(found.quantities):
            unit, factor = displayed(found.quantity_unit[n])
            value = f"{factor * found.value_measured[n]:.4g} {write_unit(unit)}".rstrip()
            rows.append(f"{single_line(name, LONGEST)}  {value}")
    else:
        source = "peak read off"
        measured, uncertainty, before, after, q, _ = found.responses.resonance.T
        rows = [
            f"{single_line(name, LONGEST)}  {hz:.4g} Hz, Q {own:.3g}"
            for name, hz, own in zip(found.responses.mode, measured, q, strict=True)
        ]
    moves = np.stack([before - measured, after - measured], axis=1)
    label = f"(model − {source}) / uncertainty"
    return _rows(rows, moves / uncertainty[:, None], [BEFORE, AFTER], verdict, label)


def _count(count: int, thing: str, things: str = "") -> str:
    return f"1 {thing}" if count == 1 else f"{count} {things or thing + 's'}"


def _name(found: Fitted, n: int) -> str:
    """Shorten the path of a number; its first experiment follows unless all share it."""
    whose = np.array(found.experiment)[found.shared[n]]
    who = f" ({whose[0]}{' …' if len(whose) > 1 else ''})"
    return short(found.name[n]) + who * (not found.shared[n].all())


def _rows(
    names: Sequence[str], values: Float[np.ndarray, "row mark"], marks: Sequence[Line],
    title: str, label: str, beside: Sequence[str] = (),
) -> Panel:  # fmt: skip
    """Make a panel of named rows with marks at multiples of a standard deviation."""
    most = float(np.abs(values[np.isfinite(values)]).max(initial=2.5))
    rows = np.arange(len(names))
    lines = [Line(column, rows, one.name, one.colour, one.look)
             for column, one in zip(values.T, marks, strict=True)]  # fmt: skip
    start = values[:, 0] if len(marks) > 1 else 0.0 * values[:, 0]
    lines += panels.stems(start, values[:, -1], PALE)
    return Panel(
        lines=lines, height=max(ITEM * len(names) + 0.1, 0.5), rows=names, beside=beside,
        title=title, key=[Line([], [], "95 %", PALE, {"linewidth": 6}), *marks],
        rules=[Rule(-INTERVAL, "", True, PALE, to=INTERVAL), Rule(0.0, "", True, NOTE, "-")],
        across=Across(label, "signed", (-1.3 * most, 1.3 * most)),
    )  # fmt: skip


def _number(found: Fitted, n: int) -> str:
    """Write a fitted number with its standard deviation, rounded to two digits of that."""
    unit, factor = displayed_unit(found.name[n], float(found.value[n]))
    value = factor * float(found.value[n])
    sigma = factor * float(found.sigma[n])
    if not math.isfinite(sigma) or sigma <= 0:
        text = f"{value:.5g}, " + ("at its bound" if math.isnan(sigma) else "not determined")
    else:
        powers = [math.floor(math.log10(abs(size) or sigma)) for size in (value, sigma)]
        digits = max(2 + powers[0] - powers[1], 1)
        text = f"{value:#.{digits}g}".rstrip(".") + f" ± {sigma:#.2g}".rstrip(".")
    return f"{text} {unit.replace('^2', '²')}".replace("-", "−").strip()


def draw_responses(found: ResponseFit, title: str) -> Figure:
    """Draw magnitudes measured, before and after the fit, and residuals."""
    ratio = found.chi_squared / np.maximum(2 * found.points, 1)
    order = np.argsort(-ratio, kind="stable")[:SHOWN]
    shown = [panel for n in order for panel in _function(found, int(n), float(ratio[n]))]
    left = len(found.function) - len(order)
    which = f", the {len(order)} of {len(found.function)} that fit worst" if left else ""
    return panels.draw(f"Fitted transfer functions{which}", title, shown)


def _function(found: ResponseFit, n: int, ratio: float) -> list[Panel]:
    """Make the panels of a transfer function and of its residuals."""
    own = found.of == n
    frequency = found.frequency[own]
    size = np.abs(found.measured[own])
    dots: LineLook = {"linestyle": "none", "marker": ".", "markersize": 2.5, "zorder": 1}
    lines = [Line(frequency, size, "measured", NOTE, dots)]
    for value, mark in ((found.before, BEFORE), (found.after, AFTER)):
        if np.abs(value[own]).max() > 1e-6 * size.max():
            modelled = np.abs(value[own])
            lines.append(Line(frequency, modelled, mark.name, mark.colour, {"linewidth": 0.9}))
    low = size[size > 0].min(initial=np.inf)
    high = size.max()
    limits = (float(low / 3), float(high * 3)) if low < high else None
    name = single_line(f"{found.function[n]}: {found.output[n]} / {found.input[n]}", 46)
    title = rf"{name}, $\chi^2$ per value {ratio:.3g}"
    label = "|reading / drive|" + (f" ({found.unit[n]})" if found.unit[n] else "")
    off = (found.after[own] - found.measured[own]) / found.uncertainty[own]
    largest = max(4.0, 1.1 * float(np.abs([off.real, off.imag]).max()))
    cross: LineLook = {"linestyle": "none", "marker": "x", "markersize": 2.5}
    parts = [
        Line(frequency, off.real, "residual, real", PALETTE[3], {**dots, "markersize": 3}),
        Line(frequency, off.imag, "imaginary", PALETTE[2], cross),
    ]
    return [
        Panel(label, lines, 1.4, "log", limits, title),
        Panel(
            "residual (σ)", parts, 0.65, limits=(-largest, largest), across=Across(),
            key=[*parts, Line([], [], "±2σ", PALE, {"linewidth": 6})],
            rules=[Rule(-2.0, colour=PALE, to=2.0)],
        ),
    ]  # fmt: skip
