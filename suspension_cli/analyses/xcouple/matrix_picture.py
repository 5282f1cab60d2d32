"""Figure of the coupling matrix: every motion of a body per motion of the support."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from suspension_cli.drawing import curves
from suspension_cli.drawing.style import INK, NOTE, house_style, new_figure
from suspension_cli.linear.response import Response

RANGE = 1e8
"""Ratio of the largest coupling of a kind to the smallest with a colour."""
DARK = 1e-3
"""Fraction of the largest of its kind from which a cell is dark."""


def draw(response: Response, title: str) -> Figure:
    """Draw a coloured table for each frequency; couplings forbidden by symmetry are white zeros.

    Colours compare couplings of one unit: m/m, m/rad, rad/m and rad/rad.

    Parameters
    ----------
    response : Response
        With several outputs and inputs.
    title : str
        Names of the design and the model.
    """
    count = len(response.frequency)
    height = 2.75
    with house_style():
        figure = new_figure(5.9, curves.HEAD + count * (height + 0.55) + 0.15)
        panels = np.atleast_1d(figure.subplots(count, 1))
        curves.set_margins(figure, left=0.95, right=0.95, top=curves.HEAD + 0.25, bottom=0.42,
                           hspace=0.25)  # fmt: skip
        units = np.array(response.unit)
        norm = LogNorm(1 / RANGE, 1)
        for axes, frequency, value in zip(
            panels, response.frequency, np.abs(response.value), strict=True
        ):
            largest = np.ones(value.shape)
            for unit in np.unique(units):
                own = units == unit
                largest[own] = value[own].max() or 1.0
            part = value / largest
            shown = np.where(value > 0, np.maximum(part, 1 / RANGE), np.nan)
            axes.imshow(shown, norm=norm, cmap="Blues", aspect="auto")
            for (row, column), size in np.ndenumerate(value):
                axes.text(
                    column,
                    row,
                    _write(size),
                    ha="center",
                    va="center",
                    fontsize=6.5,
                    color="white" if part[row, column] > DARK else INK if size else NOTE,
                )
            _part_kinds(axes, units)
            inputs = [
                f"{name}\n({unit.partition('/')[2]})"
                for name, unit in zip(response.input, units[0], strict=True)
            ]
            outputs = [
                f"{name} ({unit.partition('/')[0]})"
                for name, unit in zip(response.output, units[:, 0], strict=True)
            ]
            axes.set_xticks(range(len(inputs)), inputs, fontsize=6.5)
            axes.set_yticks(range(len(outputs)), outputs, fontsize=6.5)
            axes.set_title(f"at {frequency:g} Hz", loc="left", fontsize=8)
            axes.tick_params(length=0)
            for side in ("left", "bottom"):
                axes.spines[side].set_visible(False)
            place = axes.get_position()
            bar_axes = figure.add_axes((place.x1 + 0.28 / 5.9, place.y0, 0.12 / 5.9, place.height))
            bar = figure.colorbar(ScalarMappable(norm, "Blues"), cax=bar_axes)
            bar.set_label("of the largest of its unit", fontsize=7)
            bar.ax.tick_params(labelsize=6.5)
        what = "Couplings: motion per motion of the support"
        curves.write_heading(figure, what, title)
        return figure


def _write(size: float) -> str:
    """Write a coupling with two digits; 0 where a symmetry forbids it."""
    if not size:
        return "0"
    if 0.01 <= size < 1000:
        return f"{size:.2g}"
    power = int(np.floor(np.log10(size)))
    return f"{size / 10.0**power:.1f}$\\cdot10^{{{power}}}$"


def _part_kinds(axes: Axes, units: Any) -> None:
    """Part the blocks of one unit with white lines."""
    for edge in np.flatnonzero((units[1:] != units[:-1]).any(1)):
        axes.axhline(edge + 0.5, color="white", linewidth=4)
    for edge in np.flatnonzero((units[:, 1:] != units[:, :-1]).any(0)):
        axes.axvline(edge + 0.5, color="white", linewidth=4)
