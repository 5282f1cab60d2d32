"""Overview of the atlas: how far each trouble can be driven before a method breaks."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.drawing.panels import COLUMN
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALETTE,
    add_axes,
    new_figure,
    shorten,
    write_text,
)
from tools.stability.row import BROKEN, SHIPPED, Row

OURS, COMMON = PALETTE[0], PALETTE[1]
WIDTH, SIDE, BARS = COLUMN, 0.1, 2.1
"""Widths of the figure, of its margin and of the bars, in."""
CHARACTERS = 76
"""Longest line that describes a parameter."""
LONGEST = 30
"""Characters of the name of a method."""
TOP, PITCH = 1.14, 0.7
"""Heights above the first row and of a row, in."""
THICK = 0.17
"""Thickness of a bar, in rows."""


def format_number(value: float) -> str:
    """Format a number: plain from 1e-3 to 1e4, otherwise as mantissa and power of ten."""
    if value == 0 or not np.isfinite(value):
        return "0" if value == 0 else "∞"
    if 1e-3 <= abs(value) < 1e4:
        return f"{float(f'{value:.3g}'):g}"
    exponent = int(np.floor(np.log10(abs(value))))
    mantissa = f"{value / 10.0**exponent:.1f}"
    raised = str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return ("" if mantissa == "1.0" else f"{mantissa.removesuffix('.0')} × ") + f"10{raised}"


def split_unit(driver: str) -> tuple[str, str]:
    """Split the name of a parameter from its unit.

    >>> split_unit("frequency (Hz)")
    ('frequency', ' Hz')
    """
    found = re.fullmatch(r"(.*) \((m|Hz|kg)\)", driver)
    return (found[1], f" {found[2]}") if found else (driver, "")


def progress(row: Row, value: float | None) -> float:
    """Position of a value between the first and the last of a row, on a logarithmic scale."""
    if value is None:
        return 1.0
    first, last = np.log(row.value[[0, -1]])
    return float((np.log(value) - first) / (last - first))


def describe_range(row: Row) -> str:
    """Name the parameter of a row with its first and last value: ``frequency, 0.1 to 10⁵ Hz``."""
    name, unit = split_unit(row.driver)
    first, last = (format_number(float(value)) for value in row.value[[0, -1]])
    values = f"{first} to {last}{unit}"
    return f"{name},{chr(10) if len(name + values) > CHARACTERS else ' '}{values}"


def first_break(row: Row, names: Iterable[str]) -> tuple[float, str]:
    """Find which of some methods breaks first: how far it gets (0 to 1), and a label.

    Examples
    --------
    >>> import numpy as np
    >>> value, error = np.array([1.0, 10.0, 100.0]), np.array([0.0, 1.0, 1.0])
    >>> row = Row("", "load (kg)", "", value, {"sum": error}, "", "")
    >>> first_break(row, ["sum"])
    (0.5, 'sum: 10 kg')
    """
    at, _, name = min(
        (progress(row, row.broken_at(name)), row.broken_at(name) is None, name) for name in names
    )
    value = row.broken_at(name)
    if value is not None:
        short = re.sub(rf"^{SHIPPED}[:,]? ?", "", name)
        short = short if len(short) <= LONGEST else shorten(short.partition(", ")[0], LONGEST)
        text = f"{format_number(value)}{split_unit(row.driver)[1]}"
        return at, f"{short}: {text}" if short else text
    worst = max(row.worst(name) for name in names)
    return 1.0, "" if worst <= BROKEN else f"off by {100 * worst:.2g} % before the end"


def breaks(row: Row, names: Iterable[str]) -> bool:
    """Whether one of some methods breaks, be it at the last value."""
    return any(row.broken_at(name) is not None for name in names)


def draw_overview(rows: list[Row]) -> Figure:
    """Draw two bars per row: the worst and the best common method, and pendsus."""
    high = TOP + PITCH * len(rows) + 0.42
    figure = new_figure(WIDTH, high)
    count = sum(not breaks(row, row.shipped) for row in rows)
    best = sum(all(breaks(row, [name]) for name in row.others) for row in rows)
    built = sum(any(row.is_real(row.broken_at(name)) for name in row.others) for row in rows)
    heading = (
        f"In built suspensions (grey) a method breaks in {built} of {len(rows)} troubles;",
        f"at the extremes the best breaks in {best}, pendsus in {len(rows) - count}",
    )
    for n, line in enumerate(heading):
        write_text(figure, SIDE, 0.08 + 0.17 * n, line, 8.5, bold=True)
    text = "A method breaks where its relative error exceeds 0.1 % and stays there."
    write_text(figure, SIDE, 0.45, text, 8, NOTE)
    axes = add_axes(figure, SIDE, TOP, BARS, PITCH * len(rows))
    axes.set(xlim=(0, 1), ylim=(len(rows) - 0.5, -0.5), yticks=[])
    axes.set_xticks([0, 0.5, 1], ["harmless", "in decades", "extreme"])
    axes.tick_params(labelsize=8, length=0, pad=4)
    for label, side in zip(axes.get_xticklabels()[::2], ("left", "right"), strict=True):
        label.set_horizontalalignment(side)
    for spine in axes.spines.values():
        spine.set_visible(False)
    for n, row in enumerate(rows):
        _draw_row(axes, n, row)
    _draw_key(figure)
    return figure


def _draw_row(axes: Axes, n: int, row: Row) -> None:
    """Draw the names of a row and, below, its bars and where they end."""
    letter = "abcdefghijklmnopqrstuvwxyz"[n]
    place: Any = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
    for text, up, look in (
        (f"{letter}  {row.title}", 0.3, {"weight": "bold", "size": 8.2, "color": INK}),
        (describe_range(row), 0.1, {"size": 7.5, "color": NOTE}),
    ):
        axes.annotate(text, (0, n - up), (0, 0), va="center", **look, **place)
    for names, colour, at in (
        (row.others, COMMON, n + 0.12),
        (row.shipped, OURS, n + 0.3),
    ):
        if row.real:
            low, high = (min(max(progress(row, value), 0), 1) for value in row.real)
            low, high = sorted((low, high))
            axes.barh(n + 0.21, high - low, 0.42, low, color="0.9", zorder=0)
        end, label = first_break(row, names)
        longest = max(progress(row, row.broken_at(name)) for name in names)
        if longest > end:
            axes.barh(at, longest - end, THICK, end, color=(colour, 0.25))
        axes.barh(at, end, THICK, color=colour)
        if breaks(row, names):
            axes.plot(end, at, "x", color=INK, markersize=4.5, markeredgewidth=1.3, clip_on=False)
        look = {"va": "center", "size": 7.5, "color": INK if breaks(row, names) else NOTE}
        axes.annotate(label or "no break", (1, at), (8, 0), **place, **look)


def _draw_key(figure: Figure) -> None:
    """Explain bars and crosses above the chart."""
    axes = add_axes(figure, SIDE, 0.64, WIDTH - 2 * SIDE, 0.46)
    axes.set(xlim=(0, WIDTH - 2 * SIDE), ylim=(0, 2))
    axes.set_axis_off()
    items = (
        (0.0, 1.5, COMMON, 1.0, "common method that breaks first (the worst)"),
        (2.9, 1.5, COMMON, 0.22, "the best one"),
        (0.0, 0.5, OURS, 1.0, "pendsus"),
    )
    for x, y, colour, strength, text in items:
        axes.barh(y, 0.22, 0.5, x, color=(colour, strength))
        axes.text(x + 0.29, y, text, va="center", size=7.8)
    axes.plot(2.55, 0.5, "x", color=INK, markersize=4.5, markeredgewidth=1.3)
    axes.text(2.74, 0.5, "breaks: method, value", va="center", size=7.8)
