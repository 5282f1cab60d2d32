"""Figure of the coupling matrix: every motion of a body per motion of the support."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from suspension_cli.drawing import curves
from suspension_cli.drawing.style import INK, NOTE, add_axes, house_style, new_figure, single_line
from suspension_cli.linear.response import Response

if TYPE_CHECKING:
    from jaxtyping import Float

RANGE = 1e8
"""Ratio of the largest coupling of a kind to the smallest with a colour."""
DARK = 1e-3
"""Fraction of the largest of its kind from which a cell is dark."""
LEFT, RIGHT, ABOVE, HIGH, FOOT = 0.9, 0.17, 0.3, 2.6, 0.52
"""Margins beside a table, and heights above, of and below it, in."""
BAR = 0.75
"""Height of the colour bar with its labels, in."""
FONT = 7.5


def draw(response: Response, title: str) -> Figure:
    """Draw a coloured table for each frequency; couplings forbidden by symmetry are white zeros.

    Colours compare couplings of one unit: m/m, m/rad, rad/m and rad/rad.
    """
    units, count = np.array(response.unit), len(response.frequency)
    row = ABOVE + HIGH + FOOT
    width = curves.COLUMN - LEFT - RIGHT
    with house_style():
        figure = new_figure(curves.COLUMN, curves.HEAD + count * row + BAR)
        norm = LogNorm(1 / RANGE, 1)
        for n, frequency in enumerate(response.frequency):
            axes = add_axes(figure, LEFT, curves.HEAD + n * row + ABOVE, width, HIGH)
            _draw_table(axes, np.abs(response.value[n]), units, norm)
            inputs, under = _shorten(response.input)
            outputs, over = _shorten(response.output)
            down = (
                f"{name}\n({unit.partition('/')[2]})"
                for name, unit in zip(inputs, units[0], strict=True)
            )
            across = (
                f"{name} ({unit.partition('/')[0]})"
                for name, unit in zip(outputs, units[:, 0], strict=True)
            )
            axes.set_xticks(range(len(inputs)), [*down], fontsize=FONT)
            axes.set_yticks(range(len(outputs)), [*across], fontsize=FONT)
            axes.tick_params(length=0)
            axes.spines[["left", "bottom"]].set_visible(False)
            whose = f", {over} (rows) per {under} (columns)" if over and under else ""
            axes.set_title(single_line(f"at {frequency:g} Hz{whose}", 62), loc="left", fontsize=8)
        place = curves.HEAD + count * row
        bar_axes = add_axes(figure, LEFT, place, width, 0.12)
        bar = figure.colorbar(ScalarMappable(norm, "Blues"), cax=bar_axes, orientation="horizontal")
        bar.set_label("of the largest of its unit (ratio)", fontsize=FONT, labelpad=2)
        bar.ax.tick_params(labelsize=FONT)
        bar.ax.minorticks_off()
        bar.set_ticks([10.0**power for power in range(-8, 1, 2)])
        curves.write_heading(figure, "Couplings: motion per motion of the support", title)
        return figure


def _draw_table(
    axes: Axes, value: Float[np.ndarray, "output input"], units: np.ndarray, norm: LogNorm
) -> None:
    """Draw the cells with their numbers."""
    largest = np.ones(value.shape)
    for unit in np.unique(units):
        own = units == unit
        largest[own] = value[own].max() or 1.0
    part = value / largest
    shown = np.where(value > 0, np.maximum(part, 1 / RANGE), np.nan)
    axes.imshow(shown, norm=norm, cmap="Blues", aspect="auto")
    for (row, column), size in np.ndenumerate(value):
        dark = part[row, column] > DARK
        colour = "white" if dark else INK if size else NOTE
        axes.text(column, row, _write(size), ha="center", va="center", fontsize=FONT, color=colour)
    _part_kinds(axes, units)


def _shorten(names: Sequence[str]) -> tuple[list[str], str]:
    """Separate the names of motions from a common body or support, if any.

    >>> _shorten(["test.x", "test.roll"])
    (['x', 'roll'], 'test')
    """
    bodies = {name.rpartition(".")[0] for name in names}
    if len(bodies) > 1 or any("@" in name for name in names):
        return [*names], ""
    return [name.rpartition(".")[2] for name in names], bodies.pop()


def _write(size: float) -> str:
    """Write a coupling with two digits; 0 where a symmetry forbids it."""
    if not size:
        return "0"
    if 0.01 <= size < 1000:
        return f"{size:.2g}"
    power = int(np.floor(np.log10(size)))
    return f"{size / 10.0**power:.1f}$\\cdot10^{{{power}}}$"


def _part_kinds(axes: Axes, units: np.ndarray) -> None:
    """Separate the blocks of one unit by white lines."""
    for edge in np.flatnonzero((units[1:] != units[:-1]).any(1)):
        axes.axhline(edge + 0.5, color="white", linewidth=4)
    for edge in np.flatnonzero((units[:, 1:] != units[:, :-1]).any(0)):
        axes.axvline(edge + 0.5, color="white", linewidth=4)
