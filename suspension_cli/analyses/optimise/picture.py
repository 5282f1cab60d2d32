"""Figure of an optimised design: modes before and after, other limits, changed numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from suspension_cli.analyses.optimise.optimum import Optimum
from suspension_cli.design.path_units import displayed_unit
from suspension_cli.drawing import curves
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALE,
    PALETTE,
    RED,
    add_axes,
    format_raised,
    house_style,
    new_figure,
    single_line,
    write_text,
)

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

BEFORE, AFTER = PALETTE[4], PALETTE[0]
BAND = "#dcefe8"
ROW = 0.17
"""Height of a row, inches."""
BETWEEN = 0.68
"""Height between panels, for labels, in."""
WIDTH = 4.5
"""Width of the figure, in."""
ASIDE = 0.17
"""Shift of markers up before and down after, so that equal values are both seen, rows."""
MET = 1e-4
"""Margin below a limit that counts as rounding, %."""
SIGN = {"at_most": "≤", "at_least": "≥", "equals": "="}
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
        Names of the design and the model.
    """
    with house_style():
        others = _other_limits(found)
        modes, numbers, margins = (
            ROW * max(len(rows), 1) for rows in (found.modes.name, found.numbers.name, others)
        )
        head = curves.HEAD + 0.22
        height = head + modes + BETWEEN + numbers + (BETWEEN + margins if others else 0.0) + 0.6
        figure = new_figure(WIDTH, height)
        frequencies = add_axes(figure, 1.3, head, 1.95, modes)
        _draw_modes(frequencies, found)
        _draw_fractions(add_axes(figure, 3.4, head, 0.92, modes), found)
        _draw_key(figure, frequencies)
        top = head + modes + BETWEEN
        _draw_numbers(add_axes(figure, 2.68, top, 1.16, numbers), found)
        _write_above(figure, top, "Numbers of the design between their bounds")
        if others:
            top += numbers + BETWEEN
            _draw_margins(add_axes(figure, 2.42, top, 1.95, margins), found, others)
            _write_above(figure, top, "Other limits: margin before and after")
        met, count = int(found.limits.met.sum()), len(found.limits.name)
        unknown = f", {len(found.unknown)} unknown" if found.unknown else ""
        said = f"Optimised: {met} of {count} limits met{_say_before(found)}{unknown}"
        curves.write_heading(figure, said, title)
        return figure


def _say_before(found: Optimum) -> str:
    """Say how many limits the original design missed, where all are simple ones."""
    margins = np.array([_margin_before(found, n) for n in range(len(found.limits.name))])
    if "equals" in found.limits.sense or not np.isfinite(margins).all():
        return ""
    return f", {int((margins >= -MET).sum())} before"


def _draw_key(figure: Figure, axes: Axes) -> None:
    """Draw the key of all panels below the heading."""
    figure.legend(
        handles=axes.get_legend_handles_labels()[0],
        loc="upper left",
        bbox_to_anchor=(0.02, 1 - 0.43 / figure.get_size_inches()[1]),
        ncols=4,
        borderpad=0.1,
        handletextpad=0.3,
        columnspacing=1.0,
        fontsize=7.5,
    )


def _write_above(figure: Figure, top: float, text: str) -> None:
    write_text(figure, 0.1, top - 0.18, text, 7.5)


def _rows(axes: Axes, names: list[str]) -> Int[np.ndarray, " row"]:
    """Label rows from the top down; return their positions."""
    rows = np.arange(len(names))
    axes.set_yticks(rows, names, fontsize=7.5)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.tick_params(axis="y", length=0)
    axes.tick_params(labelsize=7.5)
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
    _join(axes, modes.before, modes.after, rows)
    _mark(axes, modes.before, modes.after, rows, _missed(found, "Hz"))
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    curves.label_plainly(axes.xaxis)
    axes.set_xlabel("frequency (Hz)", fontsize=7.5)


def _join(
    axes: Axes,
    before: Float[np.ndarray, " row"],
    after: Float[np.ndarray, " row"],
    rows: Int[np.ndarray, " row"],
) -> None:
    """Draw a line from each value before to that after, below it."""
    ends = np.stack([np.stack([before, rows - ASIDE], 1), np.stack([after, rows + ASIDE], 1)], 1)
    axes.add_collection(
        LineCollection([*ends], colors=NOTE, linewidths=0.6, zorder=2, clip_on=False)
    )


def _missed(found: Optimum, unit: str) -> tuple[Bool[np.ndarray, " row"], Bool[np.ndarray, " row"]]:
    """Whether the mode of each row misses a limit, before and after."""
    mine = [_limits_of_row(found, row, unit) for row in range(len(found.modes.name))]
    before = [any(_margin_before(found, n) < -MET for n in own) for own in mine]
    return np.array(before), np.array([any(not found.limits.met[n] for n in own) for own in mine])


def _mark(
    axes: Axes,
    before: Float[np.ndarray, " row"],
    after: Float[np.ndarray, " row"],
    rows: Int[np.ndarray, " row"],
    missed: tuple[Bool[np.ndarray, " row"], Bool[np.ndarray, " row"]],
) -> None:
    """Mark values before and after, those that miss a limit in red, not clipped at an edge."""
    for values, wrong, shift, name, look in (
        (before, missed[0], -ASIDE, "before", {"marker": "o", "markersize": 4, "mfc": "white"}),
        (after, missed[1], ASIDE, "after", {"marker": "D", "markersize": 3.4}),
    ):
        own = BEFORE if name == "before" else AFTER
        for which, colour, remark in ((~wrong, own, ""), (wrong, RED, ", not met")):
            if which.any():
                axes.plot(
                    values[which], rows[which] + shift, color=colour, linestyle="",
                    label=name + remark, clip_on=False, zorder=3, **look,
                )  # fmt: skip


def _draw_fractions(axes: Axes, found: Optimum) -> None:
    modes, limits = found.modes, found.limits
    rows = _rows(axes, [""] * len(modes.name))
    after, before = (
        np.maximum(values, MIN_FRACTION) for values in (modes.fraction_after, modes.fraction_before)
    )
    _join(axes, before, after, rows)
    for row in rows:
        for n in _limits_of_row(found, row, "1"):
            axes.fill_betweenx(
                [row - 0.5, row + 0.5], limits.asked[n], 1.0, color=BAND, linewidth=0, zorder=0
            )
    _mark(axes, before, after, rows, _missed(found, "1"))
    axes.set_xscale("log")
    axes.set_xlim(MIN_FRACTION, 1.0)
    axes.set_xticks([1e-4, 1e-2, 1.0], ["≤0.01", "1", "100"])
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("energy in top\nmass (%)", fontsize=7.5)


def _draw_numbers(axes: Axes, found: Optimum) -> None:
    numbers = found.numbers
    rows = _rows(
        axes,
        [
            _describe_change(name, before, after)
            for name, before, after in zip(numbers.name, numbers.before, numbers.after, strict=True)
        ],
    )
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
    before, after = (numbers.before - low) / span, (numbers.after - low) / span
    axes.hlines(rows[both], 0.0, 1.0, color=PALE, linewidth=5)
    _join(axes, before, after, rows)
    none = np.zeros(len(rows), dtype=bool)
    _mark(axes, before, after, rows, (none, none))
    for row, (name, lower, upper) in enumerate(
        zip(numbers.name, numbers.lower, numbers.upper, strict=True)
    ):
        unit, factor = displayed_unit(name, numbers.after[row])
        unit = unit.replace("^2", "²")
        for x, bound, side in ((0.0, lower, "right"), (1.0, upper, "left")):
            if np.isfinite(bound):
                text = curves.write_plainly(float(f"{factor * bound:.3g}"))
                text += f" {unit}" if side == "left" and unit else ""
                shift = -5 if side == "right" else 5
                axes.annotate(
                    text,
                    (x, row),
                    (shift, 0),
                    textcoords="offset points",
                    ha=side,
                    va="center",
                    fontsize=7.5,
                    color=NOTE,
                    annotation_clip=False,
                )
    axes.set_xlim(0.0, 1.0)
    axes.set_xticks([0.0, 1.0], ["lower bound", "upper"])
    axes.spines[["left", "bottom"]].set_visible(False)
    axes.tick_params(axis="y", pad=30)
    axes.tick_params(axis="x", length=0)
    axes.grid(visible=False)


def _describe_change(path: str, before: float, after: float) -> str:
    """Name of a number, shortened, and its values before and after."""
    _, factor = displayed_unit(path, after)
    values = f"{factor * before:.3g} → {factor * after:.3g}".replace("-", "−")
    name = path.removeprefix("stage.").replace(".geometry.", ".")
    return f"{single_line(name, max(36 - len(values), 8))}  {values}"


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
        [_name_limit(found, n) for n in which],
    )
    values = np.nan_to_num(100 * limits.room[which], nan=-MAX_ROOM)
    shown = np.clip(values, -MAX_ROOM, MAX_ROOM)
    colours = [AFTER if limits.met[n] else RED for n in which]
    axes.barh(rows, shown, height=0.55, color=colours)
    before = np.array([_margin_before(found, n) for n in which])
    for value, row in zip(np.clip(before, -MAX_ROOM, MAX_ROOM), rows, strict=True):
        colour = RED if value < -MET else BEFORE
        axes.plot(value, row, "o", markersize=4, color=colour, mfc="white", clip_on=False, zorder=3)
    axes.axvline(0.0, color=INK, linewidth=0.6)
    ends = np.nan_to_num(np.clip(before, -MAX_ROOM, MAX_ROOM), nan=0.0)
    widest = max(float(np.abs(shown).max()), float(np.abs(ends).max()), 1.0)
    low, high = min(shown.min(), ends.min()), max(shown.max(), ends.max())
    span = max(widest, high - low)
    axes.set_xlim(min(-0.04 * widest, low - 0.1 * span * (low < 0)), high + 0.42 * span)
    ends = np.maximum(np.maximum(shown, 0.0), np.maximum(ends, 0.0))
    for row, value, end in zip(rows, values, ends, strict=True):
        text = f"{value:+.{0 if abs(value) >= 10 else 1}f} %" + (" →" if value > MAX_ROOM else "")
        axes.annotate(
            text.replace("-", "−"),
            (end, row),
            (5, 0),
            textcoords="offset points",
            va="center",
            fontsize=7.5,
        )
    axes.grid(visible=False)
    axes.set_xlabel("margin (% of the limit)", fontsize=7.5)


def _margin_before(found: Optimum, number: int) -> float:
    """Margin of the original design from a limit, in % of it; NaN for a separation of modes."""
    limits = found.limits
    if limits.other[number] >= 0:
        return np.nan
    value = found.quantities.before[limits.quantity[number]]
    margin = 100 * (value / limits.asked[number] - 1)
    sense = limits.sense[number]
    return -abs(margin) if sense == "equals" else -margin if sense == "at_most" else margin


def _name_limit(found: Optimum, number: int) -> str:
    """Name a limit with its size and unit; a stress in % of that at which it breaks."""
    limits, quantities = found.limits, found.quantities
    if limits.other[number] >= 0:
        return single_line(limits.name[number].replace("<=", "≤").replace(">=", "≥"), 40)
    k, size = limits.quantity[number], float(limits.asked[number])
    name, unit = quantities.name[k], quantities.unit[k]
    if unit == "of breaking":
        name, size, unit = name.removeprefix("stress of "), 100 * size, "% of breaking stress"
    elif unit == "1" and name.startswith("|"):
        unit = curves.unit_of_ratio(name.split("|")[1])
    tail = f" {SIGN[limits.sense[number]]} {format_raised(size, 3)} {unit.removeprefix('1')}"
    return single_line(name, 40 - len(tail)) + tail.rstrip()
