"""Figure of sensitivities: a coloured table of the numbers that matter most."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure

from suspension_cli.analyses.sensitivity.solve import Sensitivity
from suspension_cli.design.imperfections import AXES, named, perturbed_part
from suspension_cli.drawing import panels
from suspension_cli.drawing.curves import Tints, draw_bar, draw_table
from suspension_cli.drawing.labels import widest
from suspension_cli.drawing.panels import Across, Panel
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALE,
    SMALL,
    format_raised,
    format_signed,
    shorten_to,
    single_line,
)

if TYPE_CHECKING:
    from suspension_cli.design.schema import Perturbation

LEAST = 0.005
"""Change in % below which a cell is empty; empty rows are left out."""
TICKS = (0.1, 1, 10)
"""Changes in % at which the colour bar is labelled."""
LARGEST = 100.0
"""Change in % at which the colour scale ends."""
MAX_ROWS = 24
"""Most numbers shown."""
MAX_COLUMNS = 17
"""Most results shown."""
CELL = 0.15
"""Height of a cell, in."""
WIDTH = 1.87
"""Width of the table, in."""
NAMES = 1.5
"""Largest width of the name of a number, in."""
MAX_RESULT = 28
"""Longest name of a result, characters."""


def draw(found: Sensitivity, title: str, perturbations: Sequence[Perturbation] = ()) -> Figure:
    """Draw the figure of `pendsus sensitivity`, with names of the perturbations of the design.

    A result of 0 has no change in %; a dot marks what changes it.
    """
    change = np.nan_to_num(found.per_step)
    relative = found.nominal != 0
    percent = np.where(relative, change, 0.0)
    largest = np.abs(percent).max(1, initial=0.0)
    matters = (largest >= LEAST) | (change[:, ~relative] != 0).any(1)
    order = [n for n in np.argsort(-largest, kind="stable").tolist() if matters[n]]
    rows = order[:MAX_ROWS]
    left_out = largest[order[MAX_ROWS:]]
    columns = np.sort(np.argsort(-np.abs(change).max(0, initial=0.0), kind="stable")[:MAX_COLUMNS])
    cells = change[rows][:, columns]
    dots = np.argwhere(~relative[columns] & (cells != 0))
    shown = np.where(relative[columns] & (np.abs(cells) >= LEAST), cells, np.nan)
    top = min(max(float(np.nanmax(np.abs(shown), initial=0.0)), 1.0), LARGEST)
    ticks = [at for at in TICKS if at <= top]
    norm = SymLogNorm(0.05, vmin=-top, vmax=top)
    tints = Tints("RdBu_r", norm, "change of the result (%)", [*(-at for at in ticks), 0, *ticks])
    names = [shorten_to(name_number(found.parameter[n], perturbations), NAMES) for n in rows]
    results = [_name_result(found, n) for n in columns.tolist()]
    most = [percent[n, np.abs(percent[n]).argmax()] for n in rows]
    beside = [
        f"{format_signed(own)} per {found.step_unit[n]}" if own else "from 0"
        for n, own in zip(rows, most, strict=True)
    ]
    left = max(0.16 + widest(names), 0.6)
    right = 0.1 + widest(["largest (%)", *beside])

    def paint(axes: Axes) -> None:
        draw_table(axes, shown if len(rows) else np.full((1, len(columns)), np.nan), tints)
        axes.plot(dots[:, 1], dots[:, 0], "o", markersize=2.5, color=INK)
        axes.xaxis.tick_top()
        axes.set_xticks(range(len(results)), results, fontsize=SMALL, rotation=90)
        axes.set_xticks(np.arange(len(columns) + 1) - 0.5, minor=True)
        axes.set_yticks(np.arange(max(len(rows), 1) + 1) - 0.5, minor=True)
        axes.grid(visible=True, which="minor", color=PALE, linewidth=0.3)
        axes.tick_params(which="minor", length=0)
        look = {"textcoords": "offset points", "fontsize": SMALL, "color": NOTE}
        axes.annotate("largest (%)", (1, 1), (4, 3), xycoords="axes fraction", **look)

    width = max(left + WIDTH + right, panels.COLUMN)
    right = width - left - WIDTH
    table = Panel(
        height=CELL * max(len(rows), 4), rows=names, beside=beside, paint=paint, left=left,
        right=right, across=Across("", "linear"), above=widest(results),
    )  # fmt: skip
    scale = Panel(height=0.09, left=left, right=right, paint=partial(draw_bar, tints=tints))
    notes = [f"empty: less than {LEAST:g} %"]
    if len(left_out):
        more = f"more numbers ({len(left_out)})"
        notes.append(f"{more} change no result by more than {left_out[0]:.2g} %")
    if len(found.result) > len(columns):
        rest = len(found.result) - len(columns)
        notes.append(f"results that change less ({rest}) are left out")
    if not relative.all():
        notes.append("dot: a result of 0, which changes")
    heading = "Change of results per mm, mrad or % of a number"
    return panels.draw(heading, title, [table, scale], Across(tints.label, "linear"), notes, width)


def name_number(path: str, perturbations: Sequence[Perturbation] = ()) -> str:
    """Name a number without its table, an imperfection by its wire or body and in words.

    >>> from suspension_cli.design.schema import Perturbation
    >>> name_number("perturbation.1.lower_offset.3", [Perturbation(wire="test.4")])
    'test.4 lower z'
    """
    table, _, rest = path.partition(".")
    if table != "perturbation":
        return path.removeprefix("stage.").removeprefix("materials.")
    number, key, *axis = rest.split(".")
    part, name = perturbed_part(perturbations[int(number) - 1])
    words = [name, named(part, key).spread or key, *(AXES[int(n) - 1] for n in axis)]
    return single_line(" ".join(words))


def _name_result(found: Sensitivity, n: int) -> str:
    value = format_raised(float(found.nominal[n]), 3)
    value += "" if found.unit[n] == "1" else f" {found.unit[n]}"
    return f"{single_line(found.result[n], MAX_RESULT - len(value))} {value}"
