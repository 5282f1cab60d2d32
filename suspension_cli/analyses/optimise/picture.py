"""Figure of an optimised design: modes before and after, other limits, changed numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from suspension_cli.analyses.optimise.optimum import Optimum
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALE,
    PALETTE,
    add_axes,
    house_style,
    new_figure,
    single_line,
)

BEFORE, AFTER, MISSED = PALETTE[4], PALETTE[0], PALETTE[1]
BAND = "#dcefe8"
ROW = 0.2
"""Height of a row, inches."""
MAX_ROOM = 100.0
"""Distance from a limit in % at which bars are cut off."""
MIN_FRACTION = 1e-4
"""Fraction of the kinetic energy at which the axis starts; smaller ones are drawn on its edge."""


def draw(found: Optimum, title: str) -> Figure:
    """Draw the figure of `pendsus optimise`.

    Parameters
    ----------
    found : Optimum
    title : str
    """
    with house_style():
        numbers, others = len(found.numbers.name), _other_limits(found)
        left = ROW * len(found.modes.name)
        right = ROW * (numbers + len(others)) + (0.95 if others else 0.0)
        tall = max(left, right)
        figure = new_figure(10.4, tall + 1.35)
        modes = add_axes(figure, 1.55, 0.62, 2.5, tall)
        fractions = add_axes(figure, 4.2, 0.62, 1.05, tall)
        _draw_modes(modes, found)
        _draw_fractions(fractions, found)
        room = tall - (0.95 if others else 0.0)
        part = numbers / (numbers + len(others))
        _draw_numbers(add_axes(figure, 8.0, 0.62, 2.1, room * part), found)
        if others:
            _draw_margins(
                add_axes(figure, 8.0, 0.62 + room * part + 0.95, 2.1, room * (1 - part)),
                found,
                others,
            )
        met, count, unknown = (
            int(found.limits.met.sum()),
            len(found.limits.name),
            len(found.unknown),
        )
        text = (
            f"{single_line(title, 80)}: {met} of {count} limits"
            f" met{f', {unknown} unknown' if unknown else ''}, checked with the"
            f" {found.fidelity} model"
        )
        figure.suptitle(text, x=0.01, y=1 - 0.1 / (tall + 1.35), ha="left", fontsize=9)
        return figure


def _rows(axes: Axes, names: list[str], size: float = 6.5) -> Any:
    """Label rows from the top down; return their positions."""
    rows = np.arange(len(names))
    axes.set_yticks(rows, names, fontsize=size)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.tick_params(axis="y", length=0)
    axes.grid(visible=True, axis="x", color=PALE, linewidth=0.4)
    axes.set_axisbelow(True)
    return rows


def _limits_of_row(found: Optimum, row: int, unit: str) -> list[int]:
    """Numbers of the limits on one quantity of the mode of a row, `unit` selects which."""
    mode, units = found.quantities.mode, found.quantities.unit
    mine = [
        n
        for n, k in enumerate(found.limits.quantity)
        if mode[k] == found.modes.number[row] and units[k] == unit
    ]
    return [n for n in mine if found.limits.other[n] < 0]


def _draw_modes(axes: Axes, found: Optimum) -> None:
    modes, limits = found.modes, found.limits
    rows = _rows(axes, [single_line(name, 30) for name in modes.name])
    shown = np.concatenate([modes.before, modes.after])
    shown = shown[np.isfinite(shown) & (shown > 0)]
    low, high = (shown.min() / 1.25, shown.max() * 1.25) if len(shown) else (0.1, 10.0)
    bands = []
    for row in rows:
        mine = _limits_of_row(found, row, "Hz")
        equal = [limits.asked[n] for n in mine if limits.sense[n] == "equals"]
        least = [limits.asked[n] for n in mine if limits.sense[n] == "at_least"] + equal
        most = [limits.asked[n] for n in mine if limits.sense[n] == "at_most"] + equal
        if mine:
            bands.append(
                (
                    row,
                    max(least, default=None),
                    min(most, default=None),
                    all(limits.met[n] for n in mine),
                )
            )
    edges = [edge for _, a, b, _ in bands for edge in (a, b) if edge is not None]
    low, high = (
        min([low, *(edge / 1.25 for edge in edges)]),
        max([high, *(edge * 1.25 for edge in edges)]),
    )
    missed = {row for row, _, _, met in bands if not met}
    for n, (row, a, b, _) in enumerate(bands):
        a, b = low if a is None else a, high if b is None else b
        line = 2.0 if a == b else 0.0  # an equality allows only a line
        axes.fill_betweenx(
            [row - 0.5, row + 0.5],
            a,
            b,
            color=BAND,
            linewidth=line,
            zorder=0,
            label=None if n else "allowed",
        )
    axes.hlines(rows, modes.before, modes.after, color=NOTE, linewidth=0.6, zorder=2)
    axes.plot(
        modes.before,
        rows,
        "o",
        markersize=4,
        markerfacecolor="white",
        markeredgecolor=BEFORE,
        linestyle="",
        label="before",
    )
    kept = np.array([row not in missed for row in rows])
    axes.plot(
        modes.after[kept], rows[kept], "D", markersize=3.4, color=AFTER, linestyle="", label="after"
    )
    if missed:
        axes.plot(
            modes.after[~kept],
            rows[~kept],
            "D",
            markersize=3.4,
            color=MISSED,
            linestyle="",
            label="after, not met",
        )
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("frequency (Hz)")
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=4,
        borderaxespad=0.1,
        handletextpad=0.2,
        columnspacing=0.9,
        fontsize=7,
    )


def _draw_fractions(axes: Axes, found: Optimum) -> None:
    modes, limits = found.modes, found.limits
    rows = _rows(axes, [""] * len(modes.name))
    after, before = (
        np.maximum(values, MIN_FRACTION) for values in (modes.fraction_after, modes.fraction_before)
    )
    # markers on the edge of the axes are not clipped
    edge: dict[str, Any] = {"linestyle": "", "clip_on": False, "zorder": 3}
    axes.plot(
        before, rows, "o", markersize=4, markerfacecolor="white", markeredgecolor=BEFORE, **edge
    )
    good = np.ones(len(rows), dtype=bool)
    for row in rows:
        for n in _limits_of_row(found, row, "1"):
            axes.fill_betweenx(
                [row - 0.5, row + 0.5], limits.asked[n], 1.0, color=BAND, linewidth=0, zorder=0
            )
            good[row] &= limits.met[n]
    for which, colour in ((good, AFTER), (~good, MISSED)):
        axes.plot(after[which], rows[which], "D", markersize=3.4, color=colour, **edge)
    axes.set_xscale("log")
    axes.set_xlim(MIN_FRACTION, 1.0)
    axes.set_xticks([1e-4, 1e-2, 1.0], ["≤ 0.01 %", "1 %", "100 %"], fontsize=6.5)
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("energy in top mass")


def _draw_numbers(axes: Axes, found: Optimum) -> None:
    numbers = found.numbers
    after = [
        f"{single_line(name.removeprefix('stage.'), 40)}  {value:.4g}"
        for name, value in zip(numbers.name, numbers.after, strict=True)
    ]
    rows = _rows(axes, after)
    nearer, farther = (
        np.minimum(numbers.before, numbers.after),
        np.maximum(numbers.before, numbers.after),
    )
    both = np.isfinite(numbers.lower) & np.isfinite(numbers.upper)
    # a number without both bounds is drawn in the middle, without a bar
    room = np.maximum(farther - nearer, 0.1 * np.abs(farther)) + 1e-300
    low, span = (
        np.where(both, numbers.lower, nearer - room),
        np.where(both, numbers.upper - numbers.lower, 2 * room + farther - nearer),
    )
    axes.hlines(rows[both], 0.0, 1.0, color=PALE, linewidth=3)
    axes.hlines(
        rows, (numbers.before - low) / span, (numbers.after - low) / span, color=NOTE, linewidth=0.6
    )
    axes.plot(
        (numbers.before - low) / span,
        rows,
        "o",
        markersize=4,
        markerfacecolor="white",
        markeredgecolor=BEFORE,
        linestyle="",
    )
    axes.plot((numbers.after - low) / span, rows, "D", markersize=3.4, color=AFTER, linestyle="")
    axes.set_xlim(-0.06, 1.06)
    axes.set_xticks([0.0, 1.0], ["lower bound", "upper bound"])
    axes.grid(visible=False)
    axes.set_title("numbers (SI) between their bounds", loc="left", fontsize=7.5, color=INK)


def _other_limits(found: Optimum) -> list[int]:
    """Numbers of the limits that do not refer to a single mode."""
    return [
        n
        for n, k in enumerate(found.limits.quantity)
        if found.quantities.mode[k] < 0 or found.limits.other[n] >= 0
    ]


def _draw_margins(axes: Axes, found: Optimum, which: list[int]) -> None:
    limits = found.limits
    rows = _rows(
        axes,
        [single_line(_typeset(limits.name[n].removesuffix(" of breaking")), 52) for n in which],
    )
    values = np.nan_to_num(100 * limits.room[which], nan=-MAX_ROOM)
    shown = np.clip(values, -MAX_ROOM, MAX_ROOM)
    axes.barh(rows, shown, height=0.55, color=[AFTER if limits.met[n] else MISSED for n in which])
    axes.axvline(0.0, color=INK, linewidth=0.6)
    widest = max(float(np.abs(shown).max()), 1.0)
    axes.set_xlim(
        min(-0.04 * widest, 1.15 * shown.min()), max(1.3 * float(shown.max()), 0.3 * widest)
    )
    for row, value, end in zip(rows, values, np.maximum(shown, 0.0), strict=True):
        text = f"{value:+.{0 if abs(value) >= 10 else 1}f} %" + (" →" if value > MAX_ROOM else "")
        axes.annotate(
            text, (end, row), (3, 0), textcoords="offset points", va="center", fontsize=6.5
        )
    axes.set_xlabel("margin (% of the limit)")
    axes.set_title("other limits", loc="left", fontsize=7.5, color=INK)


def _typeset(text: str) -> str:
    """Replace ASCII comparison signs of a limit by typographic ones."""
    return text.replace("<=", "≤").replace(">=", "≥")
