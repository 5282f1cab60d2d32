"""Figure of cross-coupling against frequency or imperfections (Figure 6 of Husman et al.)."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, to_hex
from matplotlib.figure import Figure

from suspension_cli.analyses.xcouple.imperfect_builds import PARAMETERS
from suspension_cli.analyses.xcouple.solve import Coupling
from suspension_cli.conventions import DOFS
from suspension_cli.design.imperfections import AXES
from suspension_cli.drawing import curves, panels
from suspension_cli.drawing.curves import Tints, draw_bar, draw_table
from suspension_cli.drawing.labels import widest
from suspension_cli.drawing.panels import Across, Line, Panel, Rule
from suspension_cli.drawing.style import INK, NOTE, PALETTE, RED, format_raised, single_line
from suspension_cli.linear.response import Response
from suspension_cli.studies.job import Axis

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

MOST_CURVES = 9
"""Curves at most; more values of the second axis are thinned out evenly."""
FINE = 64
"""Points per interval of the first axis, interpolated, so that zeros are sharp."""
COLOURS = "viridis"
"""Colour map of the second axis."""
PEAKED = 100.0
"""Ratio of the largest coupling to the median above which the scale is logarithmic."""
RANGE = 1e8
"""Ratio of the largest coupling of a unit to the smallest with a colour."""
DARK = 1e-3
"""Fraction of the largest of its unit from which a cell is dark."""
TINTS = Tints("Blues", LogNorm(1 / RANGE, 1), "of the largest of its unit (ratio)")


def draw(coupling: Coupling, title: str, limit: float | None = None) -> Figure:
    """Draw the figure of `pendsus xcouple`: a curve per value of the second axis.

    With several frequencies: largest and median ratio of all builds against frequency. `title`
    names the design and the model; `limit` is the largest ratio allowed.
    """
    several = len(coupling.frequency) > 1
    size = np.abs(coupling.ratio)
    worst = coupling.worst
    most = float(size[worst]) if worst else np.nan
    rules = [Rule(limit, f"limit {limit:g}", colour=RED, dashes=(0, (6, 2)))] if limit else []
    said = [f"coupling: |{coupling.over} / {coupling.under}| for {coupling.input}"]
    if coupling.wire:
        said.append(f"wire {coupling.wire}, {coupling.hold.replace('-', ' ')} held")
    if coupling.failures:
        said.append("gaps: " + "; ".join(coupling.failures))
    remarks = [single_line("; ".join(said))]
    peaked = False
    if several:
        limits = None
        across = panels.FREQUENCY
        lines = _lines_over_frequency(coupling)
        if worst and coupling.status.size > 1:
            at = ", ".join(
                f"{axis.name} = {_format_value(axis, n)}"
                for axis, n in zip(coupling.axes, worst[:-1], strict=True)
            )
            where = f"{coupling.frequency[worst[-1]]:.3g} Hz: {at}"
            remarks.append(single_line(f"{coupling.status.size} builds; largest at {where}"))
    else:
        median = float(np.nanmedian(size)) if worst else np.nan
        peaked = most > PEAKED * median > 0
        limits = (0.0, 1.05 * most) if most > 0 else (0.0, 1.0)
        if peaked:
            limits = (median / PEAKED, 2 * most)
        first = coupling.axes[0]
        lines = _lines_over_axes(coupling)
        across = Across(_label(first), "linear")
        if len(coupling.axes) > 1:
            remarks.append(f"lines: {_label(coupling.axes[1])}")
        if first.name in PARAMETERS:
            at = PARAMETERS[first.name][0].neutral
            if min(first.values) < at < max(first.values):
                rules.append(Rule(at, "as designed", vertical=True))
    panel = Panel(
        f"coupling ({curves.unit_of_ratio(f'{coupling.over} / {coupling.under}')})",
        lines,
        2.5,
        "log" if several or peaked else "linear",
        limits,
        remarks=remarks,
        ends=True,
        rules=rules,
        empty="no build has an equilibrium",
    )
    heading = "Cross-coupling" + ("" if several else f" at {coupling.frequency[0]:g} Hz")
    heading += f": at most {format_raised(most)}" if worst else ""
    return panels.draw(heading, title, [panel], across)


def _lines_over_frequency(coupling: Coupling) -> list[Line]:
    """Largest and median ratio of the builds."""
    size = np.abs(coupling.ratio).reshape(-1, len(coupling.frequency))
    size = size[np.isfinite(size).all(1)]
    at = coupling.frequency
    if len(size) < 2:
        return [Line(at, one, "_only", PALETTE[1]) for one in size]
    largest = Line(at, size.max(axis=0), "largest", PALETTE[1])
    return [largest, Line(at, np.median(size, axis=0), "median", PALETTE[0])]


def _lines_over_axes(coupling: Coupling) -> list[Line]:
    """A curve per value of the second axis."""
    ratio = coupling.ratio[..., 0]
    x = coupling.axes[0].displayed
    while ratio.ndim > 2:  # worst case over further axes
        ratio = np.nanmax(np.abs(ratio), axis=-1)
    if ratio.ndim == 1:
        return [Line(*interpolate(x, ratio), "_only", PALETTE[0], {"linewidth": 1.2})]
    second = coupling.axes[1]
    lines = []
    values = np.array(second.values)
    span = float(np.ptp(values)) or 1.0
    shown = np.linspace(0, len(values) - 1, min(MOST_CURVES, len(values))).round().astype(int)
    if coupling.worst:  # the curve that the heading is about
        shown[np.argmin(np.abs(shown - coupling.worst[1]))] = coupling.worst[1]
    for n in np.unique(shown).tolist():
        place = 0.88 * (values[n] - values.min()) / span  # the rest is too pale
        colour = to_hex(matplotlib.colormaps[COLOURS](place))
        curve = interpolate(x, ratio[:, n])
        lines.append(Line(*curve, _format_value(second, n), colour, {"linewidth": 1.2}))
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
    x = np.asarray(x)[order]
    ratio = np.asarray(ratio)[order]
    weights = np.linspace(0, 1, FINE, endpoint=False)
    at = np.append((x[:-1, None] + np.diff(x)[:, None] * weights).ravel(), x[-1])
    return at, np.abs(np.interp(at, x, np.real(ratio)) + 1j * np.interp(at, x, np.imag(ratio)))


def _label(axis: Axis) -> str:
    """Describe an axis, with its unit."""
    name = single_line(axis.name, 50)
    unit, _ = axis.displayed_unit
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


def draw_matrix(response: Response, title: str) -> Figure:
    """Draw a coloured table for each frequency; couplings forbidden by symmetry are white zeros.

    Colours compare couplings of one unit: m/m, m/rad, rad/m and rad/rad.
    """
    units = np.array(response.unit)
    under = [unit.partition("/")[2] for unit in units[0]]
    columns = [f"{dof}\n({unit})" for dof, unit in zip(DOFS, under, strict=True)]
    over = [unit.partition("/")[0] for unit in units[:, 0]]
    rows = [f"{dof} ({unit})" for dof, unit in zip(DOFS, over, strict=True)]
    body, _, point = response.output[0].partition(".x")
    across = Across(" \n ", "linear")
    shown = []
    for value, at in zip(np.abs(response.value), response.frequency, strict=True):
        paint = partial(_draw_table, value=value, units=units, columns=columns)
        head = f"at {at:g} Hz, {body}{point} (rows) per support (columns)"
        shown.append(Panel(height=2.6, title=head, across=across, rows=rows, paint=paint))
    bar = Panel(height=0.12, left=0.24 + widest(rows), paint=partial(draw_bar, tints=TINTS))
    heading = "Couplings: motion per motion of the support"
    return panels.draw(heading, title, [*shown, bar], Across(TINTS.label, "linear"))


def _draw_table(
    axes: Axes, value: Float[np.ndarray, "output input"], units: np.ndarray, columns: list[str]
) -> None:
    """Draw the cells with their numbers, and white lines between the blocks of one unit."""
    largest = np.ones(value.shape)
    for unit in np.unique(units):
        own = units == unit
        largest[own] = value[own].max() or 1.0
    part = value / largest
    draw_table(axes, np.where(value > 0, np.maximum(part, 1 / RANGE), np.nan), TINTS)
    for (row, column), size in np.ndenumerate(value):
        colour = INK if size else NOTE
        if part[row, column] > DARK:
            colour = "white"
        look = {"ha": "center", "va": "center", "fontsize": 7.5}
        axes.text(column, row, format_raised(size), color=colour, **look)
    axes.axhline(2.5, color="white", linewidth=4)
    axes.axvline(2.5, color="white", linewidth=4)
    axes.set_xticks(range(len(columns)), columns)
