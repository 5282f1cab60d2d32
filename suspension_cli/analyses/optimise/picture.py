"""Figure of an optimised design: modes, numbers between their bounds, and margins of other limits.

All panels are alike: a row each, marked before and after on the range that is allowed.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from suspension_cli.analyses.optimise.optimum import Optimum, relative_room
from suspension_cli.design.paths import displayed_unit
from suspension_cli.drawing import panels
from suspension_cli.drawing.scales import label_plainly
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

BAND = "#dcefe8"
ROW = 0.17
"""Height of a row, inches."""
BETWEEN = 0.68
"""Height between panels, in."""
WIDTH = 4.5
"""Width of the figure, in."""
MARKS = (
    ("before", PALETTE[4], -0.17, {"marker": "o", "ms": 4, "mfc": "white"}),
    ("after", PALETTE[0], 0.17, {"marker": "D", "ms": 3.4}),
)
"""Name, colour, shift downwards (rows) and look of markers."""
MET = 1e-4
"""Violation of a limit that may be rounding, %."""
SIGN = {"<=": "≤", ">=": "≥", "=": "="}
MAX_ROOM = 100.0
"""Distance from a limit in % at which markers are cut off."""
MIN_FRACTION = 1e-4
"""Least fraction of the kinetic energy on the axis; smaller ones are drawn on its edge."""


def draw(found: Optimum, title: str) -> Figure:
    """Draw the figure of `pendsus optimise`; `title` names design and model."""
    with house_style():
        quantity, limits = found.limits.quantity, found.limits
        others = np.flatnonzero(found.quantities.mode[quantity] < 0)
        modes, numbers, margins = (
            ROW * max(len(rows), 1) for rows in (found.modes.name, found.numbers.name, others)
        )
        head = panels.HEAD + 0.22
        height = head + modes + BETWEEN + numbers + (BETWEEN + margins) * bool(len(others)) + 0.6
        figure = new_figure(WIDTH, height)
        frequencies = add_axes(figure, 1.3, head, 1.95, modes)
        _draw_frequencies(frequencies, found)
        _draw_fractions(add_axes(figure, 3.4, head, 0.92, modes), found)
        figure.legend(
            handles=frequencies.get_legend_handles_labels()[0],
            loc="upper left",
            bbox_to_anchor=(0.02, 1 - 0.43 / height),
            ncols=5,
            borderpad=0.1,
            handletextpad=0.3,
            columnspacing=1.0,
            fontsize=7.5,
        )
        top = head + modes + BETWEEN
        _draw_numbers(add_axes(figure, 2.68, top, 1.16, numbers), found)
        write_text(figure, 0.1, top - 0.18, "Numbers of the design between their bounds", 7.5)
        if len(others):
            top += numbers + BETWEEN
            _draw_margins(add_axes(figure, 2.42, top, 1.45, margins), found, others)
            write_text(figure, 0.1, top - 0.18, "Other limits: margin before and after", 7.5)
        unknown = f", {len(found.unknown)} unknown" if found.unknown else ""
        met = f"{int(limits.met.sum())} of {len(limits.name)} limits met"
        before = _margins_before(found)
        if "equals" not in limits.sense and np.isfinite(before).all():
            met += f", {int((before >= -MET).sum())} before"
        panels.write_heading(figure, f"Optimised: {met}{unknown}", title)
        return figure


def _margins_before(found: Optimum) -> Float[np.ndarray, " limit"]:
    """Margins of the original design, % of the limits."""
    limits, before = found.limits, found.quantities.before[found.limits.quantity]
    return 100 * relative_room(before, limits.asked, limits.sense)


def _draw_rows(
    axes: Axes,
    names: list[str],
    ends: Float[np.ndarray, "end row"],
    shown: tuple[float, float],
    allowed: Float[np.ndarray, "side row"],
    missed: Bool[np.ndarray, "end row"] | None = None,
) -> None:
    """Mark the values of rows before and after, in red where they miss a limit.

    `shown` are the ends of the axis, `allowed` those of the range that limits allow; NaN without.
    """
    rows = np.arange(len(names))
    axes.set_yticks(rows, names, fontsize=7.5)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.tick_params(labelsize=7.5)
    axes.tick_params(axis="y", length=0)
    axes.grid(visible=True, axis="x", color=PALE, linewidth=0.4)
    axes.set_axisbelow(True)
    axes.set_xlim(*shown)
    for n, row in enumerate(np.flatnonzero(np.isfinite(allowed).any(0))):
        low, high = np.clip(np.where(np.isnan(allowed[:, row]), shown, allowed[:, row]), *shown)
        edge = 2.0 if low == high else 0.0  # an equality allows only a line
        label = None if n else "allowed"
        axes.fill_betweenx(
            [row - 0.5, row + 0.5], low, high, color=BAND, linewidth=edge, zorder=0, label=label
        )
    places = np.array([rows + shift for _, _, shift, _ in MARKS])
    lines = LineCollection([*np.stack([ends, places], -1).swapaxes(0, 1)], clip_on=False)
    lines.set(colors=NOTE, linewidths=0.6, zorder=2)
    axes.add_collection(lines)
    wrong = np.zeros(ends.shape, dtype=bool) if missed is None else missed
    for (name, own, _, look), value, place, bad in zip(MARKS, ends, places, wrong, strict=True):
        for which, colour, remark in ((~bad, own, ""), (bad, RED, ", not met")):
            if which.any():
                axes.plot(
                    value[which], place[which], color=colour, linestyle="", label=name + remark,
                    clip_on=False, zorder=3, **look,
                )  # fmt: skip


def _limits_of_modes(
    found: Optimum, unit: str
) -> tuple[Float[np.ndarray, "side mode"], Bool[np.ndarray, "end mode"]]:
    """Range that limits on the quantity with this unit of each mode allow, and if it is missed."""
    limits, quantities, before = found.limits, found.quantities, _margins_before(found)
    allowed = np.full((2, len(found.modes.number)), np.nan)
    missed = np.zeros(allowed.shape, dtype=bool)
    for n, (k, sense) in enumerate(zip(limits.quantity, limits.sense, strict=True)):
        if quantities.unit[k] == unit:
            row, asked = found.modes.number == quantities.mode[k], limits.asked[n]
            missed |= row & np.array([[before[n] < -MET], [not limits.met[n]]])
            if sense != "at_most":
                allowed[0, row] = np.fmax(allowed[0, row], asked)
            if sense != "at_least":
                allowed[1, row] = np.fmin(allowed[1, row], asked)
    return allowed, missed


def _draw_frequencies(axes: Axes, found: Optimum) -> None:
    modes, (allowed, missed) = found.modes, _limits_of_modes(found, "Hz")
    ends = np.array([modes.before, modes.after])
    shown = np.concatenate([ends, allowed])
    shown = shown[np.isfinite(shown) & (shown > 0)]
    span = (shown.min() / 1.25, shown.max() * 1.25) if len(shown) else (0.1, 10.0)
    axes.set_xscale("log")
    _draw_rows(axes, [single_line(name, 30) for name in modes.name], ends, span, allowed, missed)
    label_plainly(axes.xaxis)
    axes.set_xlabel("frequency (Hz)", fontsize=7.5)


def _draw_fractions(axes: Axes, found: Optimum) -> None:
    modes, (allowed, missed) = found.modes, _limits_of_modes(found, "1")
    ends = np.maximum([modes.fraction_before, modes.fraction_after], MIN_FRACTION)
    axes.set_xscale("log")
    _draw_rows(axes, [""] * len(modes.name), ends, (MIN_FRACTION, 1.0), allowed, missed)
    axes.set_xticks([1e-4, 1e-2, 1.0], ["≤0.01", "1", "100"])
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("energy in top\nmass (%)", fontsize=7.5)


def _draw_numbers(axes: Axes, found: Optimum) -> None:
    numbers = found.numbers
    table = list(zip(numbers.name, numbers.before, numbers.after, strict=True))
    nearer, farther = np.sort([numbers.before, numbers.after], axis=0)
    both = np.isfinite(numbers.lower) & np.isfinite(numbers.upper)
    # a number without both bounds is drawn in the middle, without a bar
    room = np.maximum(farther - nearer, 0.1 * np.abs(farther)) + 1e-300
    low = np.where(both, numbers.lower, nearer - room)
    span = np.where(both, numbers.upper - numbers.lower, 2 * room + farther - nearer)
    ends = (np.array([numbers.before, numbers.after]) - low) / span
    allowed = np.where(both, [[0.0], [1.0]], np.nan)
    _draw_rows(axes, [_describe_change(*row) for row in table], ends, (0.0, 1.0), allowed)
    for row, (name, _, after) in enumerate(table):
        unit, factor = displayed_unit(name, after)
        for x, bound in ((0, numbers.lower[row]), (1, numbers.upper[row])):
            if np.isfinite(bound):
                text = format_raised(factor * bound, 3)
                text += f" {unit.replace('^2', '²')}" if x and unit else ""
                _note(axes, text, (x, row), "left" if x else "right", NOTE)
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
    limits, before = found.limits, _margins_before(found)[which]
    values = np.nan_to_num(100 * limits.room[which], nan=-MAX_ROOM)
    ends = np.clip([before, values], -MAX_ROOM, MAX_ROOM)
    least, most = np.nanmin(ends, initial=0.0), np.nanmax(ends, initial=1.0)
    shown = (least - 0.05 * (most - least), most + 0.05 * (most - least))
    allowed = np.stack([np.zeros(len(which)), np.full(len(which), np.nan)])
    missed = np.array([before < -MET, ~limits.met[which]])
    _draw_rows(axes, [_name_limit(limits.name[n]) for n in which], ends, shown, allowed, missed)
    for row, value in enumerate(values):
        text = f"{value:+.{0 if abs(value) >= 10 else 1}f} %"
        _note(axes, text.replace("-", "−"), (shown[1], row))
    axes.set_xlabel("margin (% of the limit)", fontsize=7.5)


def _name_limit(name: str) -> str:
    """Shorten the name of a limit, not its value."""
    quantity, sign, value = re.split(" (<=|>=|=) ", name)
    size, _, unit = value.partition(" ")
    tail = f" {SIGN[sign]} {format_raised(float(size), 3)} {unit}".rstrip()
    return single_line(quantity, 40 - len(tail)) + tail
