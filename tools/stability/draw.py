"""Pages of the atlas: a panel per row, errors against the parameter that drives them."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator

from suspension_cli.drawing.style import INK, NOTE, PALE, PALETTE, new_figure, write_text
from tools.stability.row import BROKEN, Row

OURS, *THEIRS = (colour for colour in PALETTE if colour != "#56b4e9")  # another blue
SAME = {
    "eigenvalues of M⁻¹K": THEIRS[0],
    "ω², eigenvalues of M⁻¹K": THEIRS[0],
    "modal sum": THEIRS[0],
    "difference quotients of energy": THEIRS[1],
    "symmetric eigenvalues": THEIRS[1],
    "symmetric eigenvectors": THEIRS[1],
    "state space in SI": THEIRS[2],
    "lengths from coordinates": THEIRS[2],
    "dense solve": THEIRS[3],
}
"""Colours of methods that appear in several panels."""
EPS = 2.0**-53
FLOOR, CEILING = 1e-17, 1e2
"""Errors beyond these are drawn at the edge."""
COLUMNS, LINES = 1, 3
"""Panels across and down a page."""
WIDTH, HEIGHT = 4.55, 2.9
"""Size of a panel, inches."""
ROW = 1.5
"""Height of a row of the legend, decades of error."""
KEYED = 7.5
"""Font size of legends, points."""
KEY = 0.62
"""Height of the key above the panels, in."""


def draw_pages(rows: list[Row]) -> list[Figure]:
    """Draw a panel per row, `COLUMNS` by `LINES` on a page, below a key."""
    most = COLUMNS * LINES
    return [_draw_page(rows[n : n + most], n) for n in range(0, len(rows), most)]


def count_pages(rows: list[Row]) -> int:
    """Count the pages of all panels."""
    return -(-len(rows) // (COLUMNS * LINES))


def _draw_page(rows: list[Row], start: int) -> Figure:
    lines = -(-len(rows) // COLUMNS)
    figure = new_figure(COLUMNS * WIDTH, lines * HEIGHT + KEY)
    axes = figure.subplots(lines, COLUMNS, squeeze=False).ravel()
    for number, (panel, row) in enumerate(zip(axes, rows, strict=False)):
        _panel(panel, row, f"{'abcdefghijklmnopqrstuvwxyz'[start + number]}  {row.title}")
        if number % COLUMNS == 0:
            panel.set_ylabel("relative error")
    for panel in axes[len(rows) :]:
        panel.set_axis_off()
    figure.tight_layout(w_pad=1.6, h_pad=1.4, rect=(0, 0, 1, 1 - KEY / figure.get_figheight()))
    _draw_key(figure)
    return figure


def _panel(axes: Axes, row: Row, title: str) -> None:
    backwards = row.value[0] > row.value[-1]
    room = 10 ** (ROW * len(row.error) + 0.5)  # for the legend, above all lines
    axes.set(xscale="log", yscale="log", ylim=(FLOOR / 1.5, CEILING * room))
    span = (row.value.min(), row.value.max())
    margin = (span[1] / span[0]) ** 0.03
    axes.set_xlim(
        *(
            (span[1] * margin, span[0] / margin)
            if backwards
            else (span[0] / margin, span[1] * margin)
        )
    )
    axes.axhspan(FLOOR / 10, EPS, color=PALE, alpha=0.35, linewidth=0)
    axes.axhline(BROKEN, color=NOTE, linewidth=0.5, linestyle=(0, (1, 2)))
    for name, at in row.mark.items():
        axes.vlines(at, FLOOR, CEILING, color=NOTE, linewidth=0.5, linestyle=(0, (4, 2)))
        axes.annotate(
            name,
            (at, CEILING),
            (-1.5, -4),
            textcoords="offset points",
            rotation=90,
            fontsize=7.5,
            color=NOTE,
            ha="right",
            va="top",
        )
    for name, dash in zip(row.shipped, ("-", (0, (4, 1.2)), (0, (1, 1))), strict=False):
        _line(axes, row, name, color=OURS, linewidth=2.0, linestyle=dash, zorder=5)
    free = [colour for colour in THEIRS if colour not in [SAME.get(name) for name in row.others]]
    for name in row.others:
        _line(axes, row, name, color=SAME.get(name) or free.pop(0), linewidth=0.9, zorder=3)
    axes.set_title(title, loc="left", fontweight="bold", fontsize=9)
    axes.set_xlabel(row.driver, fontsize=8)
    axes.set_yticks([1e-16, 1e-12, 1e-8, 1e-4, 1.0])
    axes.yaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_locator(LogLocator(numticks=9))
    axes.xaxis.set_minor_locator(NullLocator())
    if span[1] < 100 * span[0]:
        axes.set_xticks(row.value[::3], [f"{value:g}" for value in row.value[::3]])
    key = axes.legend(
        loc="upper left",
        fontsize=KEYED,
        handlelength=1.4,
        handletextpad=0.5,
        labelspacing=0.2,
        borderpad=0.1,
        borderaxespad=0.4,
        framealpha=0.85,
    )
    key.get_frame().set_linewidth(0.0)
    key.set_zorder(10)


def _line(axes: Axes, row: Row, name: str, **look: Any) -> None:
    """Draw one method, with a cross where it breaks."""
    error, at = _shown(row.error[name]), row.broken_at(name)
    axes.plot(row.value, error, label=name, **look)
    if at is not None:
        size = 3.5 + look["linewidth"]
        axes.plot(
            at,
            error[list(row.value).index(at)],
            "x",
            color=look["color"],
            markersize=size,
            markeredgewidth=1.2,
            zorder=look["zorder"] + 1,
        )


def _shown(error: Any) -> Any:
    return np.clip(np.nan_to_num(np.asarray(error), posinf=CEILING), FLOOR, CEILING)


def _draw_key(figure: Figure) -> None:
    """Draw the key of lines and marks above the panels."""
    looks: dict[str, dict[str, Any]] = {
        "pendsus": {"color": OURS, "linewidth": 2.0},
        "other methods": {"color": THEIRS[0], "linewidth": 0.9},
        "broken from here on": {"color": INK, "marker": "x", "markersize": 4.5, "linewidth": 0},
        "0.1 %: broken": {"color": NOTE, "linewidth": 0.5, "linestyle": (0, (1, 2))},
        "rounding": {"color": PALE, "linewidth": 6, "alpha": 0.6},
    }
    figure.legend(
        handles=[Line2D([], [], label=name, **look) for name, look in looks.items()],
        loc="upper left", bbox_to_anchor=(0.02, 1 - 0.04 / figure.get_figheight()), ncols=3,
        fontsize=KEYED, borderpad=0.1, borderaxespad=0.0, handlelength=1.6, labelspacing=0.3,
    )  # fmt: skip
    words = "Trouble grows to the right (in c both ways); beyond the frame: at its edge."
    write_text(figure, 0.1, 0.4, words, KEYED, NOTE)
