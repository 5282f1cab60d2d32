"""Figure of cross-coupling against frequency or imperfections (Figure 6 of Husman et al.)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, to_hex
from matplotlib.figure import Figure

from suspension_cli.analyses.xcouple.solve import PARAMETERS, Coupling
from suspension_cli.design.imperfections import AXES
from suspension_cli.drawing import curves, panels
from suspension_cli.drawing.labels import widest
from suspension_cli.drawing.panels import Across, Line, Panel, Rule
from suspension_cli.drawing.scales import Tints, draw_bar, draw_table
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALETTE,
    RED,
    LineLook,
    format_raised,
    single_line,
)
from suspension_cli.linear.response import Response
from suspension_cli.studies.job import Axis

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

MOST_CURVES = 9
"""Curves at most; more values of the second axis are thinned out evenly."""
FINE = 64
"""Points per interval of the first axis, interpolated, so that zeros are sharp."""
FEW = 15
"""Number of builds along the first axis up to which they are marked."""
COLOURS = "viridis"
"""Colour map of the second axis."""


def draw(coupling: Coupling, title: str, limit: float | None = None) -> Figure:
    """Draw the figure of `pendsus xcouple`: a curve per value of the second axis.

    With several frequencies: largest and median ratio of all builds against frequency. `title`
    names the design and the model; `limit` is the largest ratio allowed.
    """
    several = len(coupling.frequency) > 1
    lines = _lines_over_frequency(coupling) if several else _lines_over_axes(coupling)
    ratio, size = f"{coupling.over} / {coupling.under}", np.abs(coupling.ratio)
    unit = curves.unit_of_ratio(ratio)
    most = float(np.nanmax(size)) if np.isfinite(size).any() else np.nan
    rules = [Rule(limit, f"limit {limit:g}", colour=RED, dashes=(0, (6, 2)))] if limit else []
    limits, across = None, panels.FREQUENCY
    if not several:
        limits = (0.0, 1.05 * most) if most > 0 else (0.0, 1.0)
        first = coupling.axes[0]
        across = Across(_label(first), "linear")
        if first.name in PARAMETERS:
            at = PARAMETERS[first.name][0].neutral
            if min(first.values) < at < max(first.values):
                rules.append(Rule(at, "as designed", vertical=True))
    panel = Panel(
        f"coupling ({unit})",
        lines,
        2.5,
        "log" if several else "linear",
        limits,
        remarks=_conditions(coupling),
        ends=True,
        rules=rules,
        empty="no build has an equilibrium",
    )
    at = "" if several else f" at {coupling.frequency[0]:g} Hz"
    said = f": at most {format_raised(most)}" if np.isfinite(most) else ""
    return panels.draw(f"Cross-coupling{at}{said}", title, [panel], across)


def _conditions(coupling: Coupling) -> list[str]:
    """Say what is driven, imperfect and kept."""
    parts = [f"coupling: |{coupling.over} / {coupling.under}| for {coupling.input}"]
    if coupling.wire:
        parts.append(f"wire {coupling.wire}, {coupling.hold.replace('-', ' ')} held")
    if coupling.failures:
        parts.append("gaps: " + "; ".join(coupling.failures))
    lines = [single_line("; ".join(parts))]
    if len(coupling.frequency) == 1 and len(coupling.axes) > 1:
        lines.append(f"lines: {_label(coupling.axes[1])}")
    if len(coupling.frequency) > 1 and coupling.ratio.shape[0] > 1:
        lines.append(_name_worst(coupling))
    return lines


def _name_worst(coupling: Coupling) -> str:
    """Name the build and the frequency with the largest ratio."""
    size = np.abs(coupling.ratio)
    if not np.isfinite(size).any():
        return ""
    *place, at = np.unravel_index(int(np.nanargmax(size)), size.shape)
    values = (
        f"{axis.name} = {_format_value(axis, int(n))}"
        for axis, n in zip(coupling.axes, place, strict=True)
    )
    where = f"{coupling.frequency[at]:.3g} Hz"
    return single_line(
        f"{np.prod(size.shape[:-1])} builds; largest at {where}: {', '.join(values)}"
    )


def _lines_over_frequency(coupling: Coupling) -> list[Line]:
    """Largest and median ratio of the builds."""
    size = np.abs(coupling.ratio).reshape(-1, len(coupling.frequency))
    size, at = size[np.isfinite(size).all(1)], coupling.frequency
    if len(size) < 2:
        return [Line(at, one, "_only", PALETTE[1]) for one in size]
    largest = Line(at, size.max(axis=0), "largest", PALETTE[1])
    return [largest, Line(at, np.median(size, axis=0), "median", PALETTE[0])]


def _lines_over_axes(coupling: Coupling) -> list[Line]:
    """A curve per value of the second axis, and the builds if they are few."""
    ratio = coupling.ratio[..., 0]
    while ratio.ndim > 2:  # worst case over further axes
        ratio = np.nanmax(np.abs(ratio), axis=-1)
    x = np.array(coupling.axes[0].values) * coupling.axes[0].displayed_unit[1]
    columns: list[tuple[Inexact[np.ndarray, " build"], str, str]] = []
    if ratio.ndim == 1:
        columns.append((ratio, "_only", PALETTE[0]))
    else:
        second = coupling.axes[1]
        values = np.array(second.values)
        span = float(np.ptp(values)) or 1.0
        shown = np.linspace(0, len(values) - 1, min(MOST_CURVES, len(values)))
        for n in np.unique(shown.round().astype(int)):
            place = 0.88 * (values[n] - values.min()) / span  # the rest is too pale
            colour = to_hex(matplotlib.colormaps[COLOURS](place))
            columns.append((ratio[:, n], _format_value(second, int(n)), colour))
    lines = []
    for values, name, colour in columns:
        lines.append(Line(*interpolate(x, values), name, colour, {"linewidth": 1.2}))
        if len(x) <= FEW:
            dots: LineLook = {"linestyle": "none", "marker": ".", "markersize": 4}
            lines.append(Line(x, np.abs(values), "_builds", colour, dots))
    return lines


def interpolate(
    x: Float[np.ndarray, " build"], ratio: Inexact[np.ndarray, " build"]
) -> tuple[Float[np.ndarray, " finer"], Float[np.ndarray, " finer"]]:
    """Interpolate a complex ratio (NaN where unknown); return its magnitude, sharp at zeros.

    >>> at, size = interpolate(np.array([0.0, 1.0, 2.0, 3.0]), np.array([-1.5, -0.5, 0.5, 1.5]))
    >>> bool(size.min() < 1e-12)
    True
    """
    order = np.argsort(x, kind="stable")
    x, ratio = np.asarray(x)[order], np.asarray(ratio)[order]
    weights = np.linspace(0, 1, FINE, endpoint=False)
    at = np.append((x[:-1, None] + np.diff(x)[:, None] * weights).ravel(), x[-1])
    return at, np.abs(np.interp(at, x, np.real(ratio)) + 1j * np.interp(at, x, np.imag(ratio)))


def _label(axis: Axis) -> str:
    """Describe an axis, with its unit."""
    name, (unit, _) = single_line(axis.name, 50), axis.displayed_unit
    if axis.name in PARAMETERS:
        item, number = PARAMETERS[axis.name]
        along = f" along {AXES[number]}" if number is not None and item.vector else ""
        name = f"factor on {item.quantity}" if item.relative else item.quantity + along
        unit = unit or "ratio"
    return f"{name} ({unit})" if unit else name


def _format_value(axis: Axis, n: int) -> str:
    """Write a value of an axis with its sign and unit."""
    sign = "+" if min(axis.values) < 0 < axis.values[n] else ""
    return sign + axis.describe(axis.values[n])


RANGE = 1e8
"""Ratio of the largest coupling of a kind to the smallest with a colour."""
DARK = 1e-3
"""Fraction of the largest of its kind from which a cell is dark."""
TINTS = Tints("Blues", LogNorm(1 / RANGE, 1), "of the largest of its unit (ratio)")


def draw_matrix(response: Response, title: str) -> Figure:
    """Draw a coloured table for each frequency; couplings forbidden by symmetry are white zeros.

    Colours compare couplings of one unit: m/m, m/rad, rad/m and rad/rad.
    """
    units = np.array(response.unit)
    inputs, under = _shorten(response.input)
    outputs, over = _shorten(response.output)
    columns = [
        f"{name}\n({unit.partition('/')[2]})" for name, unit in zip(inputs, units[0], strict=True)
    ]
    rows = [
        f"{name} ({unit.partition('/')[0]})"
        for name, unit in zip(outputs, units[:, 0], strict=True)
    ]
    whose = f", {over} (rows) per {under} (columns)" if over and under else ""
    across, shown = Across(" \n ", "linear"), []
    for value, at in zip(np.abs(response.value), response.frequency, strict=True):
        paint = partial(_draw_table, value=value, units=units, columns=columns)
        head = f"at {at:g} Hz{whose}"
        shown.append(Panel(height=2.6, title=head, across=across, rows=rows, paint=paint))
    bar = Panel(height=0.12, left=0.24 + widest(rows), paint=partial(draw_bar, tints=TINTS))
    heading = "Couplings: motion per motion of the support"
    return panels.draw(heading, title, [*shown, bar], Across(TINTS.label, "linear"))


def _draw_table(
    axes: Axes, value: Float[np.ndarray, "output input"], units: np.ndarray, columns: Sequence[str]
) -> None:
    """Draw the cells with their numbers, and white lines between the blocks of one unit."""
    largest = np.ones(value.shape)
    for unit in np.unique(units):
        own = units == unit
        largest[own] = value[own].max() or 1.0
    part = value / largest
    draw_table(axes, np.where(value > 0, np.maximum(part, 1 / RANGE), np.nan), TINTS)
    for (row, column), size in np.ndenumerate(value):
        colour = "white" if part[row, column] > DARK else INK if size else NOTE
        axes.text(
            column, row, format_raised(size), ha="center", va="center", fontsize=7.5, color=colour
        )
    for edge in np.flatnonzero((units[1:] != units[:-1]).any(1)):
        axes.axhline(edge + 0.5, color="white", linewidth=4)
    for edge in np.flatnonzero((units[:, 1:] != units[:, :-1]).any(0)):
        axes.axvline(edge + 0.5, color="white", linewidth=4)
    axes.set_xticks(range(len(columns)), [*columns])


def _shorten(names: Sequence[str]) -> tuple[list[str], str]:
    """Separate the names of motions from a common body and point, or support, if any.

    >>> _shorten(["test.x@0,0,0.001", "test.roll"])
    (['x', 'roll'], 'test@0,0,0.001')
    """
    bodies = {name.partition("@")[0].rpartition(".")[0] for name in names}
    points = {name.partition("@")[2] for name in names} - {""}
    if len(bodies) > 1 or len(points) > 1:
        return [*names], ""
    short = [name.partition("@")[0].rpartition(".")[2] for name in names]
    return short, "@".join([*bodies, *points])
