"""Figure of a budget: spectra by cause, their sum, cumulative RMS and the requirement."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.budget.solve import Budget
from suspension_cli.drawing import curves
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALETTE,
    house_style,
    new_figure,
    single_line,
)

HEIGHT, BETWEEN = 2.4, 0.95
"""Width of the figure without labels, height of a panel and distance to the next, in."""
LIMIT = "#cc0000"
"""Colour of requirements."""
FAINT = 1e-3
"""Fraction of the sum that a cause must reach somewhere to be drawn."""
ROOM = (10.0, 3.0)
"""Factors of room below the lowest sum and above the highest."""
DECADES = 22
"""Largest number of decades in a panel."""
SMALL = 7.5
"""Font size of labels, points."""
MOST = 99.0
"""Part of the mean square, per cent, from which one cause is named alone."""


def draw(budgets: list[Budget], title: str) -> Figure:
    """Draw one panel per output, whose title says what it shows."""
    with house_style():
        right = curves.room_for([name for one in budgets for name in ["all", *_drawn(one)]], 22)
        head = curves.HEAD + 0.36
        height = head + (HEIGHT + BETWEEN) * len(budgets) - 0.1
        figure = new_figure(curves.COLUMN, height)
        panels = figure.subplots(len(budgets), 1, squeeze=False)[:, 0]
        curves.set_margins(
            figure, right=right, top=head, bottom=BETWEEN - 0.1, hspace=BETWEEN / HEIGHT
        )
        colours = _colours(budgets)
        for axes, one in zip(panels, budgets, strict=True):
            _panel(axes, one, colours)
        figure.align_ylabels(panels)
        outputs = ", ".join(one.output for one in budgets)
        curves.write_heading(figure, f"Noise budget of {outputs}", title)
        return figure


def write_message(one: Budget) -> str:
    """Write in one sentence what a panel shows: the RMS, its cause, the requirement."""
    square = one.square[:, 0]
    rms = one.rms[0]
    if np.isfinite(rms) and rms > 0:
        by = int(square.argmax())
        part = 100 * square[by] / square.sum()
        most = "nearly all" if part >= MOST else f"{part:.0f} % of its square"
        text = f"{one.output} moves by {rms:.2g} {one.unit} RMS, {most} due to {one.cause[by]}"
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


def _colours(budgets: list[Budget]) -> dict[str, tuple[str, Any]]:
    """Choose a colour and line style for each cause, the same in all panels."""
    drawn = dict.fromkeys(name for one in budgets for name in _drawn(one))
    styles = ("-", (0, (4, 1.6)), (0, (1, 1.4)))
    return {
        name: (PALETTE[n % len(PALETTE)], styles[n // len(PALETTE) % len(styles)])
        for n, name in enumerate(drawn)
    }


def _drawn(one: Budget) -> list[str]:
    """Causes that come near the sum somewhere."""
    total = one.amplitude
    return [name for name, part in one.parts.items() if (part > FAINT * total).any()]


def _panel(axes: Axes, one: Budget, colours: dict[str, tuple[str, Any]]) -> None:
    mark = "" if len(one.frequency) > 8 else "o"
    total = one.amplitude
    ends = [(one.frequency, _positive(total), "all", INK)]
    if total.any():
        axes.set_ylim(*_limits(one))
    axes.loglog(
        one.frequency, _positive(total), color=INK, linewidth=2.0, marker=mark, markersize=3
    )
    drawn = _drawn(one)
    for name in drawn:
        colour, style = colours[name]
        axes.plot(
            one.frequency,
            _positive(one.parts[name]),
            color=colour,
            linestyle=style,
            linewidth=0.9,
            marker=mark,
            markersize=2,
        )
        ends.append((one.frequency, _positive(one.parts[name]), name, colour))
    if np.isfinite(one.rms).all():
        axes.plot(one.frequency, _positive(one.rms), color=NOTE, linewidth=0.7)
        axes.annotate(
            f"RMS above f ({one.unit})",
            (one.frequency[0], one.rms[0]),
            (3, 2),
            textcoords="offset points",
            fontsize=SMALL,
            color=NOTE,
        )
    if one.requirement is not None:
        axes.plot(
            one.requirement.frequency,
            _positive(one.requirement.density),
            color=LIMIT,
            linewidth=1.1,
            linestyle="--",
        )
        name = single_line(Path(one.requirement.name).stem)
        ends.append((one.requirement.frequency, _positive(one.requirement.density), name, LIMIT))
    axes.set_xlim(one.frequency[0], one.frequency[-1] * (1 + 1e-9 + (len(one.frequency) == 1)))
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel(f"{single_line(one.output, 40)} ({one.unit}/√Hz)")
    message = textwrap.fill(write_message(one), 78)
    axes.set_title(message, loc="left", fontsize=7.5, color=INK)
    curves.rule(axes)
    curves.label_plainly(axes.yaxis)
    curves.label_ends(axes, ends, most=22)
    faint = [name for name in one.cause if name not in drawn]
    if faint:
        axes.annotate(
            textwrap.fill(
                f"not drawn, below {FAINT:g} of the sum everywhere: {', '.join(faint)}", 64
            ),
            (0, 0),
            (0, -28),
            xycoords="axes fraction",
            textcoords="offset points",
            va="top",
            fontsize=SMALL,
            color=NOTE,
        )


def _positive(values: Any) -> Any:
    return np.where(values > 0, values, np.nan)


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
