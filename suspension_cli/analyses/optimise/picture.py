"""Figure of an optimised design: modes before and after, other limits, changed numbers."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from suspension_cli.analyses.optimise.optimum import Optimum, relative_room
from suspension_cli.design.path_units import displayed_unit
from suspension_cli.drawing import curves, panels
from suspension_cli.drawing.panels import ITEM, Across, Line, Panel, Rule
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALE,
    PALETTE,
    RED,
    LineLook,
    format_raised,
    format_signed,
    single_line,
)

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

BEFORE, AFTER = PALETTE[4], PALETTE[0]
BAND = "#dcefe8"
CIRCLE: LineLook = {
    "linestyle": "none",
    "marker": "o",
    "markersize": 4,
    "markerfacecolor": "white",
    "zorder": 3,
}
DIAMOND: LineLook = {"linestyle": "none", "marker": "D", "markersize": 3.4, "zorder": 3}
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
    quantity, limits = found.limits.quantity, found.limits
    others = np.flatnonzero((found.quantities.mode[quantity] < 0) | (limits.other >= 0))
    missed = _missed(found, "Hz")
    key = [Line([], [], "allowed", BAND, {"linewidth": 6})] * bool(_bands(found))
    for wrong, name, colour, look in (
        (missed[0], "before", BEFORE, CIRCLE), (missed[1], "after", AFTER, DIAMOND)
    ):  # fmt: skip
        key += [Line([], [], name, colour, look)] * bool((~wrong).any())
        key += [Line([], [], f"{name}, not met", RED, look)] * bool(wrong.any())
    rows = [single_line(name, 30) for name in found.modes.name]
    tall = ITEM * max(len(rows), 1)
    energies = Across("energy in top\nmass (%)", "log", (MIN_FRACTION, 1.0))
    frequencies = Panel(
        height=tall, rows=rows, key=key, paint=partial(_draw_frequencies, found=found),
        across=Across("frequency (Hz)", "log", _limits(found)), width=3.3,
    )  # fmt: skip
    fractions = Panel(
        height=tall, rows=[""] * len(rows), paint=partial(_draw_fractions, found=found), left=0.1,
        right=0.23, across=energies, width=1.25,
    )  # fmt: skip
    numbers = found.numbers
    table = zip(numbers.name, numbers.before, numbers.after, strict=True)
    names = [_describe_change(*row) for row in table]
    shown: list[Panel | tuple[Panel, ...]] = [
        (frequencies, fractions),
        Panel(
            height=ITEM * max(len(names), 1), rows=names, right=0.7, left=2.68,
            paint=partial(_draw_numbers, found=found), across=Across(" ", "linear", (0.0, 1.0)),
            title="Numbers of the design between their bounds",
        ),
    ]  # fmt: skip
    if len(others):
        shown.append(
            Panel(
                height=ITEM * len(others), rows=[_name_limit(found, n) for n in others.tolist()],
                paint=partial(_draw_margins, found=found, which=others),
                across=Across("margin (% of the limit)", "linear"),
                rules=[Rule(0.0, "", True, dashes="-")],
                title="Other limits: margin before and after",
            )
        )  # fmt: skip
    unknown = f", {len(found.unknown)} unknown" if found.unknown else ""
    met = f"{int(limits.met.sum())} of {len(limits.name)} limits met"
    before = _margins_before(found)
    if "equals" not in limits.sense and np.isfinite(before).all():
        met += f", {int((before >= -MET).sum())} before"
    return panels.draw(f"Optimised: {met}{unknown}", title, shown)


def _margins_before(found: Optimum) -> Float[np.ndarray, " limit"]:
    """Margins of the original design, % of the limits; NaN for separations."""
    limits = found.limits
    before = np.where(limits.other < 0, found.quantities.before[limits.quantity], np.nan)
    return 100 * relative_room(before, limits.asked, limits.sense)


def _limits_of_modes(found: Optimum, unit: str) -> list[Int[np.ndarray, " _"]]:
    """Numbers of the limits on the quantity with this unit of the mode of each row."""
    quantity, limits = found.limits.quantity, found.limits
    alike = np.array([own == unit for own in found.quantities.unit], dtype=bool)[quantity]
    return [
        np.flatnonzero(alike & (found.quantities.mode[quantity] == number) & (limits.other < 0))
        for number in found.modes.number
    ]


def _bands(found: Optimum) -> list[tuple[int, float, float]]:
    """Row of each mode with limits on its frequency, and the range allowed."""
    limits, bands = found.limits, []
    for row, mine in enumerate(_limits_of_modes(found, "Hz")):
        least = [limits.asked[n] for n in mine if limits.sense[n] != "at_most"]
        most = [limits.asked[n] for n in mine if limits.sense[n] != "at_least"]
        if len(mine):
            bands.append((row, max(least, default=0.0), min(most, default=np.inf)))
    return bands


def _limits(found: Optimum) -> tuple[float, float]:
    """Limits of the axis of frequencies."""
    edges = [edge for _, *own in _bands(found) for edge in own]
    shown = np.array([*found.modes.before, *found.modes.after, *edges])
    shown = shown[np.isfinite(shown) & (shown > 0)]
    return (shown.min() / 1.25, shown.max() * 1.25) if len(shown) else (0.1, 10.0)


def _draw_frequencies(axes: Axes, found: Optimum) -> None:
    low, high = axes.get_xlim()
    for row, a, b in _bands(found):
        wide = 2.0 if a == b else 0.0  # an equality allows only a line
        span = [row - 0.5, row + 0.5], max(a, low), min(b, high)
        axes.fill_betweenx(*span, color=BAND, linewidth=wide, zorder=0)
    _mark(axes, found.modes.before, found.modes.after, _missed(found, "Hz"))


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
        (before, missed[0], -ASIDE, "before", BEFORE, CIRCLE),
        (after, missed[1], ASIDE, "after", AFTER, DIAMOND),
    ):
        for which, colour, text in ((~wrong, own, name), (wrong, RED, f"{name}, not met")):
            at = rows[which] + shift
            axes.plot(values[which], at, color=colour, label=text, clip_on=False, **look)


def _draw_fractions(axes: Axes, found: Optimum) -> None:
    modes, asked = found.modes, found.limits.asked
    for row, mine in enumerate(_limits_of_modes(found, "1")):
        for least in asked[mine]:
            axes.fill_betweenx([row - 0.5, row + 0.5], least, 1.0, color=BAND, lw=0, zorder=0)
    before, after = (
        np.maximum(values, MIN_FRACTION) for values in (modes.fraction_before, modes.fraction_after)
    )
    _mark(axes, before, after, _missed(found, "1"))
    axes.set_xticks([1e-4, 1e-2, 1.0], ["≤0.01", "1", "100"])


def _draw_numbers(axes: Axes, found: Optimum) -> None:
    numbers = found.numbers
    table = list(zip(numbers.name, numbers.before, numbers.after, strict=True))
    rows = np.arange(len(table))
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
    limits = found.limits
    rows = np.arange(len(which))
    values = np.nan_to_num(100 * limits.room[which], nan=-MAX_ROOM)
    shown = np.clip(values, -MAX_ROOM, MAX_ROOM)
    axes.barh(rows, shown, height=0.55, color=np.where(limits.met[which], AFTER, RED).tolist())
    before = np.clip(_margins_before(found)[which], -MAX_ROOM, MAX_ROOM)
    for value, row in zip(before, rows, strict=True):
        colour = RED if value < -MET else BEFORE
        axes.plot(value, row, "o", markersize=4, color=colour, mfc="white", clip_on=False, zorder=3)
    ends = np.nan_to_num(before, nan=0.0)
    widest = max(float(np.abs([shown, ends]).max()), 1.0)
    low, high = min(shown.min(), ends.min()), max(shown.max(), ends.max())
    span = max(widest, high - low)
    axes.set_xlim(min(-0.04 * widest, low - 0.1 * span * (low < 0)), high + 0.42 * span)
    for row, value, end in zip(rows, values, np.maximum(np.maximum(shown, ends), 0.0), strict=True):
        text = f"{format_signed(value, 2)} %" + (" →" if value > MAX_ROOM else "")
        _note(axes, text, (float(end), int(row)))
    axes.grid(visible=False)


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
