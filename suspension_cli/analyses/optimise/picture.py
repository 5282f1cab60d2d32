"""Figure of an optimised design: modes, numbers between their bounds, and margins of other limits.

All panels are alike: a row each, marked before and after on the range that is allowed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.analyses.optimise.optimum import Optimum
from suspension_cli.design.paths import displayed_unit
from suspension_cli.drawing import panels
from suspension_cli.drawing.panels import ITEM, Across, Line, Panel
from suspension_cli.drawing.style import (
    NOTE,
    PALETTE,
    RED,
    LineLook,
    format_raised,
    format_signed,
    single_line,
    write_unit,
)

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int
    from numpy.typing import ArrayLike

BAND = "#dcefe8"
"""Colour of what is allowed."""
MARKS: tuple[tuple[str, str, LineLook], ...] = (
    ("before", PALETTE[4], {"marker": "o", "markersize": 5, "markerfacecolor": "none"}),
    ("after", PALETTE[0], {"marker": "D", "markersize": 3}),
)
"""Name, colour and look of markers."""
MET = 1e-6
"""Relative violation of a limit that may be rounding."""
MAX_ROOM = 100.0
"""Distance from a limit in % at which markers are cut off."""
MIN_FRACTION = 1e-4
"""Least fraction of the kinetic energy on the axis; smaller ones are drawn on its edge."""


def draw(found: Optimum, title: str) -> Figure:
    """Draw the figure of `pendsus optimise`; `title` names design and model."""
    limits = found.limits
    others = np.flatnonzero(found.quantities.mode[limits.quantity] < 0)
    shown = [_modes(found), _numbers(found), *([_margins(found, others)] if len(others) else [])]
    heading = "Optimised: no limits"
    if limits.name:
        heading = f"Optimised: {int(limits.met.sum())} of {len(limits.name)} limits met"
        heading += f", {int((limits.room_before >= -MET).sum())} before"
    heading += f", {len(found.unknown)} unknown" if found.unknown else ""
    return panels.draw(heading, title, shown, notes=list(_objectives(found)))


def _objectives(found: Optimum) -> Iterator[str]:
    """Say what quantities that were minimised or maximised are before and after."""
    each = found.quantities
    rows = zip(each.name, each.unit, each.before, each.after, each.weight, strict=True)
    for name, unit, before, after, weight in rows:
        if weight:
            word = "minimised" if weight > 0 else "maximised"
            values = f"{format_raised(before, 4)} → {format_raised(after, 4)}"
            yield f"{word}: {name}, {values} {write_unit(unit)}".rstrip()


def _rows(
    names: Sequence[str],
    ends: ArrayLike,
    allowed: ArrayLike,
    missed: Bool[np.ndarray, "end row"],
    across: Across,
    **layout: Any,
) -> Panel:
    """Mark the values of rows before and after (`ends`), in red where they miss a limit.

    `across` has the ends of the axis, `allowed` those of the range that limits allow.
    """
    ends, (low, high) = np.asarray(ends), np.clip(allowed, *(across.limits or (0, 1)))
    thin = np.where(low == high, 0.02 * low, 0.0)  # an equality
    bands = panels.stems(low - thin, high + thin, BAND, 72 * ITEM)
    lines = [replace(one, look={**one.look, "zorder": 0}) for one in bands]
    lines += panels.stems(ends[0], ends[1], NOTE, 0.6)
    for (name, own, look), value, bad in zip(MARKS, ends, missed, strict=True):
        for which, colour, remark in ((~bad, own, ""), (bad, RED, ", not met")):
            if which.any():
                marker: LineLook = {**look, "linestyle": "none", "zorder": 3}
                lines.append(
                    Line(value[which], np.flatnonzero(which), name + remark, colour, marker)
                )

    height = ITEM * len(names)
    return Panel("", lines, height, rows=names, across=across, **layout)


def _modes(found: Optimum) -> tuple[Panel, Panel]:
    """Frequencies of the modes, and their fractions of energy in the top mass."""
    modes = found.modes
    allowed, missed = _limits_of_modes(found, "Hz")
    ends = np.array([modes.before, modes.after])
    known = np.concatenate([ends, allowed])
    known = known[np.isfinite(known) & (known > 0)]
    span = (known.min() / 1.25, known.max() * 1.25) if len(known) else (0.1, 10.0)
    names = [single_line(name, 30) for name in modes.name]
    across = Across("frequency (Hz)", "log", span)
    hertz = _rows(names, ends, allowed, missed, across, width=2.3, right=0.1)
    sample = Line([], [], "allowed", BAND, {"linewidth": 7.0})
    hertz = replace(hertz, key=[sample, *filter(panels.named, hertz.lines)])
    ends = np.maximum([modes.fraction_before, modes.fraction_after], MIN_FRACTION)
    ticks = {1e-4: "≤0.01", 1e-2: "1", 1.0: "100"}
    across = Across("energy in top\nmass (%)", "log", (MIN_FRACTION / 1.6, 1.6), ticks)
    nameless = [""] * len(names)
    limits = _limits_of_modes(found, "1")
    return hertz, _rows(nameless, ends, *limits, across, key=(), left=0.15, right=0.2)


def _limits_of_modes(
    found: Optimum, unit: str
) -> tuple[Float[np.ndarray, "side mode"], Bool[np.ndarray, "end mode"]]:
    """Range that limits on the quantity with this unit of each mode allow, and if it is missed."""
    limits = found.limits
    quantities = found.quantities
    before = limits.room_before
    rows = len(found.modes.number)
    allowed = np.array([[0.0] * rows, [np.inf] * rows])
    missed = np.zeros((2, rows), dtype=bool)
    limited = np.zeros(rows, dtype=bool)
    for n, (k, sense) in enumerate(zip(limits.quantity, limits.sense, strict=True)):
        if quantities.unit[k] == unit:
            row = found.modes.number == quantities.mode[k]
            limited |= row
            missed |= row & np.array([[before[n] < -MET], [not limits.met[n]]])
            if sense != "at_most":
                allowed[0, row] = np.maximum(allowed[0, row], limits.asked[n])
            if sense != "at_least":
                allowed[1, row] = np.minimum(allowed[1, row], limits.asked[n])
    return np.where(limited, allowed, np.nan), missed


def _numbers(found: Optimum) -> Panel:
    """Numbers of the design between their bounds; without one, between before and after."""
    numbers = found.numbers
    names: list[str] = []
    bounds: list[str] = []
    ends = np.array([numbers.before, numbers.after])
    low = np.fmin(ends.min(0), numbers.lower)
    high = np.fmax(ends.max(0), numbers.upper)
    place = (ends - low) / np.where(high > low, high - low, 1.0)
    for n, path in enumerate(numbers.name):
        unit, factor = displayed_unit(path, numbers.after[n])
        before, after = (format_raised(factor * one, 3) for one in ends[:, n])
        values = f"{before} → {after}"
        name = path.removeprefix("stage.").replace(".geometry.", ".")
        names.append(f"{single_line(name, max(36 - len(values), 8))}  {values}")
        bounds.append(_write_bounds(factor * numbers.lower[n], factor * numbers.upper[n], unit))
    both = np.isfinite(numbers.lower) & np.isfinite(numbers.upper)
    across = Across("", "linear", (-0.03, 1.03), {0.0: "lower bound", 1.0: "upper"})
    allowed = np.where(both, [[0.0], [1.0]], np.nan)
    title = "Numbers of the design between their bounds"
    missed = np.zeros(ends.shape, dtype=bool)
    return _rows(names, place, allowed, missed, across, title=title, beside=bounds, key=())


def _write_bounds(lower: float, upper: float, unit: str) -> str:
    """Write the bounds of a number of the design; either may be infinite or NaN: it has none."""
    low = format_raised(lower, 3)
    high = format_raised(upper, 3)
    if np.isfinite(lower) and np.isfinite(upper):
        text = f"{low} to {high}"
    elif np.isfinite(lower):
        text = f"from {low}"
    elif np.isfinite(upper):
        text = f"up to {high}"
    else:
        return f"no bounds; {unit}" if unit else "no bounds"
    return f"{text} {unit}".replace("^2", "²").rstrip()


def _write_limit(name: str) -> str:
    """Write a limit as pictures have it: ``thermal test.x:10 ≤ 1e-19 m/√Hz``."""
    return single_line(write_unit(name).replace("<=", "≤").replace(">=", "≥"), 40)


def _margins(found: Optimum, which: Int[np.ndarray, " row"]) -> Panel:
    """Room between values and limits, other than those on modes."""
    limits = found.limits
    before = limits.room_before[which]
    after = 100 * np.nan_to_num(limits.room[which], nan=-1.0)
    ends = np.clip([100 * before, after], -MAX_ROOM, MAX_ROOM)
    least = np.nanmin(ends, initial=0.0)
    most = np.nanmax(ends, initial=1.0)
    room = 0.05 * (most - least)
    across = Across("margin (% of the limit)", "linear", (least - room, most + room))
    allowed = np.tile([[0.0], [np.inf]], len(which))
    return _rows(
        [_write_limit(limits.name[n]) for n in which],
        ends,
        allowed,
        np.array([before < -MET, ~limits.met[which]]),
        across,
        title="Other limits: margin before and after",
        beside=[f"{format_signed(value * (abs(value) > 0.05), 2)} %" for value in after],
        key=(),
    )
