"""Figure of an optimised design: modes before and after, other limits, changed numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from suspension_cli.analyses.optimise.optimum import Optimum, relative_room
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
"""Height between panels, in."""
WIDTH = 4.5
"""Width of the figure, in."""
ASIDE = 0.17
"""Shift of markers before (up) and after (down), rows."""
MET = 1e-4
"""Violation of a limit that may be rounding, %."""
SIGN = {"at_most": "≤", "at_least": "≥", "equals": "="}
MAX_ROOM = 100.0
"""Distance from a limit in % at which bars are cut off."""
MIN_FRACTION = 1e-4
"""Least fraction of the kinetic energy on the axis; smaller ones are drawn on its edge."""


def draw(found: Optimum, title: str) -> Figure:
    """Draw the figure of `pendsus optimise`; `title` names design and model."""
    with house_style():
        quantity, limits = found.limits.quantity, found.limits
        others = np.flatnonzero((found.quantities.mode[quantity] < 0) | (limits.other >= 0))
        modes, numbers, margins = (
            ROW * max(len(rows), 1) for rows in (found.modes.name, found.numbers.name, others)
        )
        head = curves.HEAD + 0.22
        height = head + modes + BETWEEN + numbers + (BETWEEN + margins) * bool(len(others)) + 0.6
        figure = new_figure(WIDTH, height)
        frequencies = add_axes(figure, 1.3, head, 1.95, modes)
        _draw_frequencies(frequencies, found)
        _draw_fractions(add_axes(figure, 3.4, head, 0.92, modes), found)
        figure.legend(
            handles=frequencies.get_legend_handles_labels()[0],
            loc="upper left",
            bbox_to_anchor=(0.02, 1 - 0.43 / height),
            ncols=4,
            borderpad=0.1,
            handletextpad=0.3,
            columnspacing=1.0,
            fontsize=7.5,
        )
        top = head + modes + BETWEEN
        _draw_numbers(add_axes(figure, 2.68, top, 1.16, numbers), found)
        title_of_numbers = "Numbers of the design between their bounds"
        write_text(figure, 0.1, top - 0.18, title_of_numbers, 7.5)
        if len(others):
            top += numbers + BETWEEN
            _draw_margins(add_axes(figure, 2.42, top, 1.95, margins), found, others)
            write_text(figure, 0.1, top - 0.18, "Other limits: margin before and after", 7.5)
        unknown = f", {len(found.unknown)} unknown" if found.unknown else ""
        met = f"{int(limits.met.sum())} of {len(limits.name)} limits met"
        before = _margins_before(found)
        if "equals" not in limits.sense and np.isfinite(before).all():
            met += f", {int((before >= -MET).sum())} before"
        curves.write_heading(figure, f"Optimised: {met}{unknown}", title)
        return figure


def _margins_before(found: Optimum) -> Float[np.ndarray, " limit"]:
    """Margins of the original design, % of the limits; NaN for separations."""
    limits = found.limits
    before = np.where(limits.other < 0, found.quantities.before[limits.quantity], np.nan)
    return 100 * relative_room(before, limits.asked, limits.sense)


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


def _limits_of_modes(found: Optimum, unit: str) -> list[Int[np.ndarray, " _"]]:
    """Numbers of the limits on the quantity with this unit of the mode of each row."""
    quantity, limits = found.limits.quantity, found.limits
    alike = np.array([own == unit for own in found.quantities.unit], dtype=bool)[quantity]
    return [
        np.flatnonzero(alike & (found.quantities.mode[quantity] == number) & (limits.other < 0))
        for number in found.modes.number
    ]


def _draw_frequencies(axes: Axes, found: Optimum) -> None:
    modes, limits = found.modes, found.limits
    _rows(axes, [single_line(name, 30) for name in modes.name])
    bands = []
    for row, mine in enumerate(_limits_of_modes(found, "Hz")):
        least = [limits.asked[n] for n in mine if limits.sense[n] != "at_most"]
        most = [limits.asked[n] for n in mine if limits.sense[n] != "at_least"]
        if len(mine):
            bands.append((row, max(least, default=0.0), min(most, default=np.inf)))
    shown = np.array([*modes.before, *modes.after, *(edge for _, *own in bands for edge in own)])
    shown = shown[np.isfinite(shown) & (shown > 0)]
    low, high = (shown.min() / 1.25, shown.max() * 1.25) if len(shown) else (0.1, 10.0)
    for n, (row, a, b) in enumerate(bands):
        axes.fill_betweenx(
            [row - 0.5, row + 0.5],
            max(a, low),
            min(b, high),
            color=BAND,
            linewidth=2.0 if a == b else 0.0,  # an equality allows only a line
            zorder=0,
            label=None if n else "allowed",
        )
    _mark(axes, modes.before, modes.after, _missed(found, "Hz"))
    axes.set_xscale("log")
    axes.set_xlim(low, high)
    curves.label_plainly(axes.xaxis)
    axes.set_xlabel("frequency (Hz)", fontsize=7.5)


def _missed(found: Optimum, unit: str) -> tuple[Bool[np.ndarray, " row"], Bool[np.ndarray, " row"]]:
    """Whether the mode of each row misses a limit before, and after."""
    mine, before = _limits_of_modes(found, unit), _margins_before(found) < -MET
    after = ~found.limits.met
    return np.array([before[own].any() for own in mine]), np.array(
        [after[own].any() for own in mine]
    )


def _mark(
    axes: Axes,
    before: Float[np.ndarray, " row"],
    after: Float[np.ndarray, " row"],
    missed: tuple[Bool[np.ndarray, " row"], Bool[np.ndarray, " row"]],
) -> None:
    """Mark values before and after, joined by lines, in red where they miss a limit."""
    rows = np.arange(len(before))
    ends = np.stack([np.stack([before, rows - ASIDE], 1), np.stack([after, rows + ASIDE], 1)], 1)
    axes.add_collection(
        LineCollection([*ends], colors=NOTE, linewidths=0.6, zorder=2, clip_on=False)
    )
    for values, wrong, shift, name, own, look in (
        (before, missed[0], -ASIDE, "before", BEFORE, {"marker": "o", "ms": 4, "mfc": "white"}),
        (after, missed[1], ASIDE, "after", AFTER, {"marker": "D", "ms": 3.4}),
    ):
        for which, colour, remark in ((~wrong, own, ""), (wrong, RED, ", not met")):
            if which.any():
                axes.plot(
                    values[which], rows[which] + shift, color=colour, linestyle="",
                    label=name + remark, clip_on=False, zorder=3, **look,
                )  # fmt: skip


def _draw_fractions(axes: Axes, found: Optimum) -> None:
    modes, asked = found.modes, found.limits.asked
    _rows(axes, [""] * len(modes.name))
    for row, mine in enumerate(_limits_of_modes(found, "1")):
        for least in asked[mine]:
            axes.fill_betweenx([row - 0.5, row + 0.5], least, 1.0, color=BAND, lw=0, zorder=0)
    before, after = (
        np.maximum(values, MIN_FRACTION) for values in (modes.fraction_before, modes.fraction_after)
    )
    _mark(axes, before, after, _missed(found, "1"))
    axes.set_xscale("log")
    axes.set_xlim(MIN_FRACTION, 1.0)
    axes.set_xticks([1e-4, 1e-2, 1.0], ["≤0.01", "1", "100"])
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("energy in top\nmass (%)", fontsize=7.5)


def _draw_numbers(axes: Axes, found: Optimum) -> None:
    numbers = found.numbers
    table = list(zip(numbers.name, numbers.before, numbers.after, strict=True))
    rows = _rows(axes, [_describe_change(*row) for row in table])
    nearer, farther = np.sort([numbers.before, numbers.after], axis=0)
    both = np.isfinite(numbers.lower) & np.isfinite(numbers.upper)
    # a number without both bounds is drawn in the middle, without a bar
    room = np.maximum(farther - nearer, 0.1 * np.abs(farther)) + 1e-300
    low = np.where(both, numbers.lower, nearer - room)
    span = np.where(both, numbers.upper - numbers.lower, 2 * room + farther - nearer)
    axes.hlines(rows[both], 0.0, 1.0, color=PALE, linewidth=5)
    none = np.zeros(len(rows), dtype=bool)
    _mark(axes, (numbers.before - low) / span, (numbers.after - low) / span, (none, none))
    for row, (name, _, after) in enumerate(table):
        unit, factor = displayed_unit(name, after)
        for x, bound in ((0, numbers.lower[row]), (1, numbers.upper[row])):
            if np.isfinite(bound):
                text = curves.write_plainly(float(f"{factor * bound:.3g}"))
                text += f" {unit.replace('^2', '²')}" if x and unit else ""
                _note(axes, text, (x, row), "left" if x else "right", NOTE)
    axes.set_xlim(0.0, 1.0)
    axes.set_xticks([0.0, 1.0], ["lower bound", "upper"])
    axes.spines[["left", "bottom"]].set_visible(False)
    axes.tick_params(axis="y", pad=30)
    axes.tick_params(axis="x", length=0)
    axes.grid(visible=False)


def _note(
    axes: Axes, text: str, at: tuple[float, float], side: str = "left", colour: str = INK
) -> None:
    """Write beside a point of a row."""
    axes.annotate(
        text,
        at,
        (5 if side == "left" else -5, 0),
        textcoords="offset points",
        ha=side,
        va="center",
        fontsize=7.5,
        color=colour,
        annotation_clip=False,
    )


def _describe_change(path: str, before: float, after: float) -> str:
    _, factor = displayed_unit(path, after)
    values = f"{factor * before:.3g} → {factor * after:.3g}".replace("-", "−")
    name = path.removeprefix("stage.").replace(".geometry.", ".")
    return f"{single_line(name, max(36 - len(values), 8))}  {values}"


def _draw_margins(axes: Axes, found: Optimum, which: Int[np.ndarray, " row"]) -> None:
    limits = found.limits
    rows = _rows(axes, [_name_limit(found, n) for n in which])
    values = np.nan_to_num(100 * limits.room[which], nan=-MAX_ROOM)
    shown = np.clip(values, -MAX_ROOM, MAX_ROOM)
    axes.barh(rows, shown, height=0.55, color=np.where(limits.met[which], AFTER, RED).tolist())
    before = np.clip(_margins_before(found)[which], -MAX_ROOM, MAX_ROOM)
    for value, row in zip(before, rows, strict=True):
        colour = RED if value < -MET else BEFORE
        axes.plot(value, row, "o", markersize=4, color=colour, mfc="white", clip_on=False, zorder=3)
    axes.axvline(0.0, color=INK, linewidth=0.6)
    ends = np.nan_to_num(before, nan=0.0)
    widest = max(float(np.abs([shown, ends]).max()), 1.0)
    low, high = min(shown.min(), ends.min()), max(shown.max(), ends.max())
    span = max(widest, high - low)
    axes.set_xlim(min(-0.04 * widest, low - 0.1 * span * (low < 0)), high + 0.42 * span)
    for row, value, end in zip(rows, values, np.maximum(np.maximum(shown, ends), 0.0), strict=True):
        text = f"{value:+.{0 if abs(value) >= 10 else 1}f} %" + (" →" if value > MAX_ROOM else "")
        _note(axes, text.replace("-", "−"), (end, row))
    axes.grid(visible=False)
    axes.set_xlabel("margin (% of the limit)", fontsize=7.5)


def _name_limit(found: Optimum, number: int) -> str:
    """Name a limit with its size and unit; stresses in % of breaking stress."""
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
