"""Figure of the coupling matrix: every motion of a body per motion of the support."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from suspension_cli.drawing import panels
from suspension_cli.drawing.labels import widest
from suspension_cli.drawing.panels import Across, Panel
from suspension_cli.drawing.style import INK, NOTE, format_raised
from suspension_cli.drawing.tints import Tints, draw_bar, draw_table
from suspension_cli.linear.response import Response

if TYPE_CHECKING:
    from jaxtyping import Float

RANGE = 1e8
"""Ratio of the largest coupling of a kind to the smallest with a colour."""
DARK = 1e-3
"""Fraction of the largest of its kind from which a cell is dark."""
TINTS = Tints("Blues", LogNorm(1 / RANGE, 1), "of the largest of its unit (ratio)")


def draw(response: Response, title: str) -> Figure:
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
    """Separate the names of motions from a common body or support, if any.

    >>> _shorten(["test.x", "test.roll"])
    (['x', 'roll'], 'test')
    """
    bodies = {name.rpartition(".")[0] for name in names}
    if len(bodies) > 1 or any("@" in name for name in names):
        return [*names], ""
    return [name.rpartition(".")[2] for name in names], bodies.pop()
