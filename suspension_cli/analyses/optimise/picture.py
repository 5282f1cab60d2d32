"""Figure of an optimised design: modes, numbers between their bounds, and margins of other limits.

All panels are alike: a row each, marked before and after on the range that is allowed.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.optimise.optimum import Optimum, relative_room
from suspension_cli.design.paths import displayed_unit
from suspension_cli.drawing import panels
from suspension_cli.drawing.labels import widest
from suspension_cli.drawing.panels import Across, Line, Panel
from suspension_cli.drawing.style import (
    NOTE,
    PALETTE,
    RED,
    SMALL,
    LineLook,
    format_raised,
    single_line,
)

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

BAND = "#dcefe8"
"""Colour of what is allowed."""
MARKS: tuple[tuple[str, str, float, LineLook], ...] = (
    ("before", PALETTE[4], -0.17, {"marker": "o", "markersize": 4, "markerfacecolor": "white"}),
    ("after", PALETTE[0], 0.17, {"marker": "D", "markersize": 3.4}),
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
    limits = found.limits
    others = np.flatnonzero(found.quantities.mode[limits.quantity] < 0)
    shown = [(_frequencies(found), _fractions(found)), _numbers(found)]
    if len(others):
        shown.append(_margins(found, others))
    unknown = f", {len(found.unknown)} unknown" if found.unknown else ""
    met = f"{int(limits.met.sum())} of {len(limits.name)} limits met"
    before = _margins_before(found)
    if "equals" not in limits.sense and np.isfinite(before).all():
        met += f", {int((before >= -MET).sum())} before"
    return panels.draw(f"Optimised: {met}{unknown}", title, shown)


def _margins_before(found: Optimum) -> Float[np.ndarray, " limit"]:
    """Margins of the original design, % of the limits."""
    limits, before = found.limits, found.quantities.before[found.limits.quantity]
    return 100 * relative_room(before, limits.asked, limits.sense)


def _panel(
    names: Sequence[str],
    ends: Float[np.ndarray, "end row"],
    across: Across,
    allowed: Float[np.ndarray, "side row"],
    missed: Bool[np.ndarray, "end row"] | None = None,
    notes: Sequence[tuple[float, int, str, str]] = (),
    **layout: Any,
) -> Panel:
    """Mark the values of rows before and after, in red where they miss a limit.

    `across` has the ends of the axis, `allowed` those of the range that limits allow; NaN without.
    `notes` are texts (last) beside points of rows, on a side.
    """
    rows, wrong = np.arange(len(names)), np.zeros(ends.shape, dtype=bool)
    wrong = wrong if missed is None else missed
    places = np.array([rows + shift for _, _, shift, _ in MARKS])
    x, y = (np.pad(part, ((0, 1), (0, 0)), constant_values=np.nan).T.ravel()
            for part in (ends, places))  # fmt: skip
    lines = [Line(x, y, "_", NOTE, {"linewidth": 0.6, "zorder": 2})]
    for (name, own, _, look), value, place, bad in zip(MARKS, ends, places, wrong, strict=True):
        for which, colour, remark in ((~bad, own, ""), (bad, RED, ", not met")):
            if which.any():
                marker: LineLook = {**look, "linestyle": "none", "zorder": 3}
                lines.append(Line(value[which], place[which], name + remark, colour, marker))

    def paint(axes: Axes) -> None:
        for row in np.flatnonzero(np.isfinite(allowed).any(0)):
            span = axes.get_xlim()
            low, high = np.clip(np.where(np.isnan(allowed[:, row]), span, allowed[:, row]), *span)
            edge = 2.0 if low == high else 0.0  # an equality allows only a line
            edges = [row - 0.5, row + 0.5]
            axes.fill_betweenx(edges, low, high, color=BAND, linewidth=edge, zorder=0)
        for line in axes.lines:
            line.set_clip_on(False)
        for x, row, side, text in notes:
            axes.annotate(
                text, (x, row), (5 if side == "left" else -5, 0), textcoords="offset points",
                ha=side, va="center", fontsize=SMALL, annotation_clip=False, color=NOTE,
            )  # fmt: skip

    height = panels.ITEM * max(len(names), 1)
    return Panel("", lines, height, rows=names, across=across, paint=paint, key=(), **layout)


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


def _frequencies(found: Optimum) -> Panel:
    modes, (allowed, missed) = found.modes, _limits_of_modes(found, "Hz")
    ends = np.array([modes.before, modes.after])
    shown = np.concatenate([ends, allowed])
    shown = shown[np.isfinite(shown) & (shown > 0)]
    span = (shown.min() / 1.25, shown.max() * 1.25) if len(shown) else (0.1, 10.0)
    names = [single_line(name, 30) for name in modes.name]
    across = Across("frequency (Hz)", "log", span)
    panel = _panel(names, ends, across, allowed, missed, width=2.3, right=0.1)
    allowed_sample = Line([], [], "allowed", BAND, {"linewidth": 7.0})
    return replace(panel, key=[allowed_sample, *filter(panels.named, panel.lines)])


def _fractions(found: Optimum) -> Panel:
    modes, (allowed, missed) = found.modes, _limits_of_modes(found, "1")
    ends = np.maximum([modes.fraction_before, modes.fraction_after], MIN_FRACTION)
    ticks = {1e-4: "≤0.01", 1e-2: "1", 1.0: "100"}
    across = Across("energy in top\nmass (%)", "log", (MIN_FRACTION, 1.0), ticks)
    return _panel([""] * len(modes.name), ends, across, allowed, missed, left=0.15, right=0.2)


def _numbers(found: Optimum) -> Panel:
    numbers = found.numbers
    table = list(zip(numbers.name, numbers.before, numbers.after, strict=True))
    nearer, farther = np.sort([numbers.before, numbers.after], axis=0)
    both = np.isfinite(numbers.lower) & np.isfinite(numbers.upper)
    # a number without both bounds is drawn in the middle, without a bar
    room = np.maximum(farther - nearer, 0.1 * np.abs(farther)) + 1e-300
    low = np.where(both, numbers.lower, nearer - room)
    span = np.where(both, numbers.upper - numbers.lower, 2 * room + farther - nearer)
    ends = (np.array([numbers.before, numbers.after]) - low) / span
    notes = []
    for row, (name, _, after) in enumerate(table):
        unit, factor = displayed_unit(name, after)
        for x, side, bound in ((0, "right", numbers.lower[row]), (1, "left", numbers.upper[row])):
            if np.isfinite(bound):
                tail = f" {unit.replace('^2', '²')}" if x and unit else ""
                notes.append((x, row, side, format_raised(factor * bound, 3) + tail))
    names = [_describe_change(*row) for row in table]
    across = Across("", "linear", (0.0, 1.0), {0.0: "lower bound", 1.0: "upper"})
    panel = _panel(
        names, ends, across, np.where(both, [[0.0], [1.0]], np.nan), None, notes,
        title="Numbers of the design between their bounds", left=0.74 + widest(names), right=0.65,
    )  # fmt: skip

    def paint(axes: Axes) -> None:
        if panel.paint:
            panel.paint(axes)
        axes.spines[["left", "bottom"]].set_visible(False)
        axes.tick_params(axis="y", pad=36)
        axes.tick_params(axis="x", length=0)
        axes.grid(visible=False)

    return replace(panel, paint=paint)


def _describe_change(path: str, before: float, after: float) -> str:
    _, factor = displayed_unit(path, after)
    values = f"{factor * before:.3g} → {factor * after:.3g}".replace("-", "−")
    name = path.removeprefix("stage.").replace(".geometry.", ".")
    return f"{single_line(name, max(36 - len(values), 8))}  {values}"


def _margins(found: Optimum, which: Int[np.ndarray, " row"]) -> Panel:
    limits, before = found.limits, _margins_before(found)[which]
    values = np.nan_to_num(100 * limits.room[which], nan=-MAX_ROOM)
    ends = np.clip([before, values], -MAX_ROOM, MAX_ROOM)
    least, most = np.nanmin(ends, initial=0.0), np.nanmax(ends, initial=1.0)
    shown = (least - 0.05 * (most - least), most + 0.05 * (most - least))
    allowed = np.stack([np.zeros(len(which)), np.full(len(which), np.nan)])
    texts = [f"{value:+.{0 if abs(value) >= 10 else 1}f} %" for value in values]
    return _panel(
        [_name_limit(limits.name[n]) for n in which], ends,
        Across("margin (% of the limit)", "linear", shown), allowed,
        np.array([before < -MET, ~limits.met[which]]),
        title="Other limits: margin before and after", right=0.6,
        beside=[text.replace("-", "−") for text in texts],
    )  # fmt: skip


def _name_limit(name: str) -> str:
    """Shorten the name of a limit, not its value."""
    quantity, sign, value = re.split(" (<=|>=|=) ", name)
    size, _, unit = value.partition(" ")
    tail = f" {SIGN[sign]} {format_raised(float(size), 3)} {unit}".rstrip()
    return single_line(quantity, 40 - len(tail)) + tail
