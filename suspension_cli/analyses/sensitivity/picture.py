"""Figure of sensitivities: a coloured table of the numbers of a design that matter most."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure

from suspension_cli.analyses.sensitivity.solve import Sensitivity
from suspension_cli.design.imperfections import AXES, named, perturbed_part
from suspension_cli.drawing import curves
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALE,
    add_axes,
    format_raised,
    house_style,
    new_figure,
    shorten,
    single_line,
)
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Int
    from matplotlib.colorbar import Colorbar
    from matplotlib.image import AxesImage

    from suspension_cli.design.schema import Perturbation

LEAST = 0.005
"""Change in % below which a cell stays empty; rows with only such cells are left out."""
LARGEST = 100.0
"""Change in % at which the colour scale ends."""
MAX_ROWS, MAX_COLUMNS = 24, 18
"""Largest number of numbers and of results shown."""
CELL = 0.11, 0.15
"""Width of a cell if there are many, and its height, in."""
MAX_WIDTH = 1.98
"""Width of the table, in."""
NAMES, CHANGES = 1.62, 0.86
"""Width of the names of numbers left of the table, and of the largest changes right of it, in."""
MAX_NAME = 27
"""Characters of the name of a number."""
LETTER = 0.058
"""Height of a letter of the names of results above the table, in."""
FOOT = 0.85
"""Height of the colour scale below the table, in."""


def draw(found: Sensitivity, title: str, perturbations: Sequence[Perturbation] = ()) -> Figure:
    """Draw the figure of `pendsus sensitivity`.

    Parameters
    ----------
    found : Sensitivity
    title : str
        Names of the design and the model.
    perturbations : sequence of Perturbation
        Of the design.
    """
    with house_style():
        change, relative = np.nan_to_num(found.per_step), found.nominal != 0
        size = np.where(relative, np.abs(change), 0.0)
        largest = size.max(1, initial=0.0)
        matters = (largest >= LEAST) | (change[:, ~relative] != 0).any(1)
        order = [int(n) for n in np.argsort(-largest, kind="stable") if matters[n]]
        rows = order[:MAX_ROWS]
        kept = np.argsort(-np.abs(change).max(0, initial=0.0), kind="stable")[:MAX_COLUMNS]
        columns = np.sort(kept)
        wide = max(CELL[0] * len(columns), min(MAX_WIDTH, 0.4 * len(columns)))
        tall = CELL[1] * max(len(rows), 4)
        notes = _notes(found, largest[order[MAX_ROWS:]], len(columns))
        labels = [_name_result(found, n) for n in columns]
        top = curves.HEAD + 0.1 + LETTER * max(map(len, labels), default=0)
        figure = new_figure(
            max(NAMES + wide + CHANGES + 0.1, 4.5), top + tall + FOOT + 0.13 * len(notes)
        )
        curves.write_heading(figure, "Change of results per mm, mrad or % of a number", title)
        axes = add_axes(figure, NAMES, top, wide, tall)
        drawn = _draw_table(axes, found, change, rows, columns)
        axes.set_yticks(
            range(len(rows)),
            [shorten(name_number(found.parameter[n], perturbations), MAX_NAME) for n in rows],
            fontsize=7.5,
        )
        axes.set_xticks(range(len(labels)), labels, fontsize=7.5, rotation=90)
        bar = figure.colorbar(
            drawn, cax=add_axes(figure, NAMES, top + tall + 0.12, MAX_WIDTH, 0.09),
            orientation="horizontal",
        )  # fmt: skip
        _label_scale(bar, float(drawn.get_clim()[1] or 1.0))
        height = figure.get_size_inches()[1]
        for n, note in enumerate(notes):
            at = (FOOT - 0.32 + 0.13 * (len(notes) - n)) - 0.25
            figure.text(0.02, at / height, note, fontsize=7.5, color=NOTE, va="top")
        return figure


def name_number(path: str, perturbations: Sequence[Perturbation] = ()) -> str:
    """Name a number without its table; an imperfection by its wire or body and in words.

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
    unit = "" if found.unit[n] == "1" else f" {found.unit[n]}"
    return f"{single_line(found.result[n], 20)} {value}{unit}"


def _draw_table(
    axes: Axes,
    found: Sensitivity,
    change: Array,
    rows: list[int],
    columns: Int[np.ndarray, " column"],
) -> AxesImage:
    """Draw the coloured cells and label rows and columns; return the image."""
    relative = found.nominal[columns] != 0
    cells = change[np.ix_(rows, columns.tolist())]
    shown = np.where(relative & (np.abs(cells) >= LEAST), cells, np.nan)
    top = min(max(float(np.nanmax(np.abs(shown), initial=0.0)), 1.0), LARGEST)
    count = max(len(rows), 1)  # an empty table still needs a height
    drawn = axes.imshow(
        shown,
        norm=SymLogNorm(0.05, vmin=-top, vmax=top),
        cmap="RdBu_r",
        aspect="auto",
        extent=(-0.5, len(columns) - 0.5, count - 0.5, -0.5),
    )
    # a result of 0 has no change in %
    low, across = np.nonzero(~relative & (cells != 0))
    axes.plot(across, low, "o", markersize=2.5, color=INK, linestyle="")
    axes.xaxis.tick_top()
    axes.tick_params(length=0, pad=2)
    axes.set_xticks(np.arange(len(columns) + 1) - 0.5, minor=True)
    axes.set_yticks(np.arange(count + 1) - 0.5, minor=True)
    axes.grid(visible=True, which="minor", color=PALE, linewidth=0.3)
    axes.tick_params(which="minor", length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
    for row, n in enumerate(rows):
        values = np.where(found.nominal != 0, change[n], 0.0)
        most = float(values[np.argmax(np.abs(values))])
        text = ("+" * (most > 0) + format_raised(most, 3)).replace("-", "−")
        axes.annotate(
            f"{text} per {found.step_unit[n]}" if most else "from 0",
            (1, row),
            (4, 0),
            xycoords=("axes fraction", "data"),
            textcoords="offset points",
            va="center",
            fontsize=7.5,
            annotation_clip=False,
        )
    axes.annotate(
        "largest (%)",
        (1, -0.5),
        (4, 3),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        va="bottom",
        fontsize=7.5,
        color=NOTE,
        annotation_clip=False,
    )
    return drawn


def _label_scale(bar: Colorbar, top: float) -> None:
    """Label the colour scale at powers of ten."""
    ticks = [tick for tick in (-100, -10, -1, -0.1, 0, 0.1, 1, 10, 100) if abs(tick) <= top]
    # 10 beside 100 has no room
    bar.set_ticks(
        ticks,
        labels=[
            "" if abs(tick) == 10 and top >= LARGEST else curves.write_plainly(tick)
            for tick in ticks
        ],
    )
    bar.minorticks_off()
    bar.ax.tick_params(labelsize=7.5, length=2, pad=1)
    bar.set_label("change of the result (%)", fontsize=7.5, labelpad=1)
    bar.outline.set_visible(False)


def _notes(found: Sensitivity, rest: Array, columns: int) -> list[str]:
    """Sum up in words what the table leaves out."""
    notes = [f"empty: less than {LEAST:g} %"]
    if len(rest):
        notes.append(f"{len(rest)} more numbers change no result by more than {rest[0]:.2g} %")
    if len(found.result) > columns:
        notes.append(f"{len(found.result) - columns} results that change less are left out")
    if (found.nominal == 0).any():
        notes.append("dot: a result of 0, which changes")
    return notes
