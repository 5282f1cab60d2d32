"""Figure of sensitivities: a coloured table of the changes per step of every number."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure

from suspension_cli.analyses.sensitivity.solve import Sensitivity
from suspension_cli.design.path_units import format_with_unit
from suspension_cli.drawing.style import INK, NOTE, house_style, new_figure, single_line

LEAST = 0.005
"""Change in % below which a cell stays empty; rows with only such cells are left out."""
LARGEST = 100.0
"""Change in % at which the colour scale ends."""
DARK = 0.3
"""Distance from the middle of the colour scale beyond which text is white."""
CELL = 0.235, 0.17
"""Width and height of a cell, inches."""


def draw(found: Sensitivity, title: str) -> Figure:
    """Draw the figure of `pendsus sensitivity`.

    Parameters
    ----------
    found : Sensitivity
    title : str
    """
    with house_style():
        change = np.nan_to_num(found.per_step)
        relative = found.nominal != 0
        rows = np.flatnonzero(
            (np.abs(change[:, relative]) >= LEAST).any(1) | (change[:, ~relative] != 0).any(1)
        )
        shown = np.where(relative & (np.abs(change[rows]) >= LEAST), change[rows], np.nan)
        width = 1.9 * CELL[0] if len(found.result) < 12 else 1.35 * CELL[0]
        figure = new_figure(3.4 + width * len(found.result), 1.7 + CELL[1] * max(len(rows), 4))
        axes = figure.subplots()
        top = min(max(float(np.nanmax(np.abs(shown), initial=0.0)), 1.0), LARGEST)
        # an empty table still needs a height
        extent = (-0.5, len(found.result) - 0.5, max(len(rows), 1) - 0.5, -0.5)
        drawn = axes.imshow(
            shown,
            norm=SymLogNorm(0.05, vmin=-top, vmax=top),
            cmap="RdBu_r",
            aspect="auto",
            extent=extent,
        )
        strength = np.abs(np.asarray(drawn.norm(change[rows])) - 0.5)
        for (row, column), value in np.ndenumerate(change[rows]):
            if not relative[column] and value:
                axes.text(
                    column, row, f"{value:.0e}", ha="center", va="center", fontsize=4.5, color=INK
                )
            elif abs(value) >= LEAST:
                colour = "white" if strength[row, column] > DARK else INK
                text = (f"{value:+.2f}" if abs(value) < 100 else f"{value:+.3g}").replace("-", "−")
                axes.text(column, row, text, ha="center", va="center", fontsize=4.8, color=colour)
        steps = found.step_unit
        axes.set_yticks(
            range(len(rows)),
            [
                f"{single_line(name, 48)}  {format_with_unit(name, found.value[n])}  per {steps[n]}"
                for n, name in ((n, found.parameter[n]) for n in rows)
            ],
            fontsize=6,
        )
        labels = [
            f"{single_line(name, 40)}  {value:.4g}" + ("" if unit == "1" else f" {unit}")
            for name, value, unit in zip(found.result, found.nominal, found.unit, strict=True)
        ]
        axes.set_xticks(range(len(labels)), labels, fontsize=6, rotation=90)
        axes.xaxis.tick_top()
        axes.tick_params(length=0)
        for spine in axes.spines.values():
            spine.set_visible(False)
        ticks = [tick for tick in (-100, -10, -1, -0.1, 0, 0.1, 1, 10, 100) if abs(tick) <= top]
        bar = figure.colorbar(drawn, ax=axes, pad=0.02, aspect=40, ticks=ticks)
        bar.ax.set_yticklabels([f"{tick:g}".replace("-", "−") for tick in ticks])
        bar.set_label("change of the result (%)\nper mm, mrad or %", fontsize=6.5)
        bar.ax.tick_params(labelsize=6)
        bar.outline.set_visible(False)  # pyright: ignore[reportCallIssue]
        figure.suptitle(single_line(title, 90), x=0.01, ha="left", fontsize=9)
        figure.text(
            0.01,
            0.008,
            f"empty: less than {LEAST:g} %",
            fontsize=6,
            color=NOTE,
        )
        for _ in range(2):  # the layout changes the bar, whose label then needs another pass
            figure.tight_layout(rect=(0, 0.015, 1, 0.99))
        return figure
