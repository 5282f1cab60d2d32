"""Tables of coloured cells and their colour bars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize

from suspension_cli.drawing.style import figure_of, format_raised

if TYPE_CHECKING:
    from jaxtyping import Float


@dataclass(frozen=True)
class Tints:
    """Scale of colours: map, range, quantity with unit, labelled values (by default decades)."""

    map: str
    norm: Normalize
    label: str
    ticks: Sequence[float] = ()


def draw_table(axes: Axes, value: Float[np.ndarray, "row column"], tints: Tints) -> None:
    """Draw a coloured cell per value; NaN is empty. The axes have rows from the top down."""
    rows, columns = value.shape
    edges = (-0.5, columns - 0.5, rows - 0.5, -0.5)
    axes.imshow(value, norm=tints.norm, cmap=tints.map, aspect="auto", extent=edges)
    axes.tick_params(length=0)
    axes.grid(visible=False)
    for spine in axes.spines.values():
        spine.set_visible(False)


def draw_bar(axes: Axes, tints: Tints) -> None:
    """Draw a horizontal colour bar that fills axes."""
    mappable = ScalarMappable(tints.norm, tints.map)
    bar = figure_of(axes).colorbar(mappable, cax=axes, orientation="horizontal")
    low, high = float(tints.norm.vmin or 0.0), float(tints.norm.vmax or 1.0)
    ticks = [*tints.ticks]
    if not ticks and isinstance(tints.norm, LogNorm):
        powers = np.arange(round(np.log10(low)), round(np.log10(high)) + 1)
        ticks = (10.0 ** powers[:: -max(1, -(-len(powers) // 5))]).tolist()
    bar.set_ticks(ticks, labels=[format_raised(tick) for tick in ticks])
    bar.minorticks_off()
    bar.ax.tick_params(length=2, pad=1.5)
    bar.outline.set_visible(False)
