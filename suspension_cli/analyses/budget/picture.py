"""Figure of a budget: spectra by cause, their sum, cumulative RMS and the requirement."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.budget.solve import Budget
from suspension_cli.drawing import curves
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALETTE,
    LineLook,
    format_raised,
    house_style,
    single_line,
)
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from matplotlib.typing import LineStyleType

Line = tuple[str, str, LineLook, Array, Array]
"""Name, colour, look, frequencies and values of a line."""
HEIGHT = 2.4
"""Height of a panel, in."""
LIMIT = "#cc0000"
"""Colour of requirements."""
FAINT = 1e-3
"""Fraction of the sum that a cause must reach somewhere to be drawn."""
ROOM = (10.0, 3.0)
"""Factors of room below the lowest sum and above the highest."""
DECADES = 22
"""Largest number of decades in a panel."""
MOST = 99.0
"""Part of the mean square, per cent, from which one cause is named alone."""


def draw(budgets: list[Budget], title: str) -> Figure:
    """Draw one panel per output, below a sentence that says what it shows."""
    with house_style():
        colours = _colours(budgets)
        lines = [_lines(one, colours) for one in budgets]
        keys = [[line[:3] for line in own] for own in lines]
        words = [(_wrapped(write_message(one)), _wrapped(_name_faint(one))) for one in budgets]
        rooms = [
            curves.key_room([name for name, *_ in key])
            + curves.ROW * sum(text.count("\n") + 1 for text in said if text)
            + 0.14
            for key, said in zip(keys, words, strict=True)
        ]
        figure, panels = curves.stack_panels([HEIGHT] * len(budgets), rooms)
        for axes, one, own, key, said in zip(panels, budgets, lines, keys, words, strict=True):
            _panel(axes, one, own)
            curves.write_key(axes, key)
            above = curves.key_room([name for name, *_ in key]) + 0.05
            for text, colour in zip(reversed(said), (NOTE, INK), strict=True):
                if text:
                    axes.text(
                        0, 1 + above / HEIGHT, text, transform=axes.transAxes,
                        fontsize=curves.SMALL, color=colour, va="bottom", linespacing=1.25,
                    )  # fmt: skip
                    above += curves.ROW * (text.count("\n") + 1)
        panels[-1].set_xlabel("frequency (Hz)")
        figure.align_ylabels(panels)
        outputs = ", ".join(one.output for one in budgets)
        curves.write_heading(figure, f"Noise budget of {outputs}", title)
        return figure


def _wrapped(text: str) -> str:
    return curves.wrap(text, curves.COLUMN - 0.9)


def _name_faint(one: Budget) -> str:
    """Name the causes that are not drawn."""
    drawn = _drawn(one)
    faint = ", ".join(name for name in one.cause if name not in drawn)
    return f"not drawn, below {FAINT:g} of the sum everywhere: {faint}" if faint else ""


def _lines(one: Budget, colours: dict[str, tuple[str, LineStyleType]]) -> list[Line]:
    """List the lines of a panel."""
    at = one.frequency
    lines: list[Line] = [("all", INK, {"linewidth": 2.0}, at, one.amplitude)]
    for name in _drawn(one):
        colour, style = colours[name]
        look: LineLook = {"linestyle": style, "linewidth": 0.9}
        lines.append((name, colour, look, at, one.parts[name]))
    if np.isfinite(one.rms).all():
        lines.append((f"RMS above f ({one.unit})", NOTE, {"linewidth": 0.7}, at, one.rms))
    if one.requirement is not None:
        given, look = one.requirement, LineLook(linestyle="--", linewidth=1.1)
        lines.append((Path(given.name).stem, LIMIT, look, given.frequency, given.density))
    return lines


def write_message(one: Budget) -> str:
    """Write in one sentence what a panel shows: the RMS, its cause, the requirement."""
    square, rms = one.square[:, 0], one.rms[0]
    if np.isfinite(rms) and rms > 0:
        by = int(square.argmax())
        part = 100 * square[by] / square.sum()
        most = "nearly all" if part >= MOST else f"{part:.0f} % of its square"
        size = f"{format_raised(rms)} {one.unit}"
        text = f"{one.output} moves by {size} RMS, {most} due to {one.cause[by]}"
    elif np.isinf(rms):
        text = f"{one.output} has an infinite RMS: a resonance without loss is driven"
    else:
        text = f"{one.output}"
    found = one.requirement
    if found is None:
        return text
    if found.met:
        margin = f", smallest margin {found.margin:.3g}" if np.isfinite(found.margin) else ""
        return f"{text}; the requirement is met{margin} at {found.at:.3g} Hz"
    return f"{text}; the requirement is exceeded {found.excess:.2g} times at {found.at:.3g} Hz"


def _colours(budgets: list[Budget]) -> dict[str, tuple[str, LineStyleType]]:
    """Choose a colour and line style for each cause, the same in all panels."""
    drawn = dict.fromkeys(name for one in budgets for name in _drawn(one))
    styles: tuple[LineStyleType, ...] = ("-", (0, (4, 1.6)), (0, (1, 1.4)))
    return {
        name: (PALETTE[n % len(PALETTE)], styles[n // len(PALETTE) % len(styles)])
        for n, name in enumerate(drawn)
    }


def _drawn(one: Budget) -> list[str]:
    """Causes that come near the sum somewhere."""
    total = one.amplitude
    return [name for name, part in one.parts.items() if (part > FAINT * total).any()]


def _panel(axes: Axes, one: Budget, lines: list[Line]) -> None:
    mark = "" if len(one.frequency) > 8 else "o"
    if one.amplitude.any():
        axes.set_ylim(*_limits(one))
    for _, colour, look, at, value in lines:
        shown = np.where(value > 0, value, np.nan)
        marker = mark if at is one.frequency else ""
        marked: LineLook = {"marker": marker, "markersize": 3, **look}
        axes.loglog(at, shown, color=colour, **marked)
    axes.set_xlim(one.frequency[0], one.frequency[-1] * (1 + 1e-9 + (len(one.frequency) == 1)))
    axes.set_ylabel(f"{single_line(one.output, 40)} ({one.unit}/√Hz)")
    curves.label_plainly(axes.yaxis)


def _limits(one: Budget) -> tuple[float, float]:
    """Limits of the y axis: the range of the sum and the RMS, with room for parts."""
    total = one.amplitude
    rms = one.rms[np.isfinite(one.rms)]
    top = max(total.max(), rms.max(initial=0.0)) * ROOM[1]
    least = total[total > 0].min()
    if one.requirement is not None:
        positive = one.requirement.density[one.requirement.density > 0]
        least = min(least, positive.min(initial=least))
    return max(least / ROOM[0], top / 10**DECADES), top
