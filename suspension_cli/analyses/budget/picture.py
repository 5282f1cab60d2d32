"""Figure of a budget: spectra by cause, their sum, cumulative RMS and the requirement."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from suspension_cli.analyses.budget.solve import Budget
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALE,
    PALETTE,
    house_style,
    new_figure,
    shorten,
    single_line,
)

WIDTH, HEIGHT = 7.4, 3.7
"""Width of the figure and height of a panel, in."""
FAINT = 1e-3
"""Fraction of the sum that a cause must reach somewhere to be drawn."""
ROOM = (30.0, 3.0)
"""Factors of room below the lowest sum and above the highest."""
DECADES = 16
"""Largest number of decades in a panel."""
SMALL = 6.5
"""Font size of labels, points."""
MOST = 99.0
"""Part of the mean square, per cent, from which one cause is named alone."""
APART = 0.045
"""Smallest distance between two labels, fraction of the panel's height."""


def draw(budgets: list[Budget], title: str) -> Figure:
    """Draw one panel per output, whose title says what it shows."""
    with house_style():
        figure = new_figure(WIDTH, HEIGHT * len(budgets) + 0.2)
        panels = figure.subplots(len(budgets), 1, squeeze=False)[:, 0]
        colours = _colours(budgets)
        for axes, one in zip(panels, budgets, strict=True):
            _panel(axes, one, colours)
        figure.suptitle(single_line(title, 80), x=0.01, ha="left", fontsize=9)
        figure.tight_layout(rect=(0, 0, 0.86, 1 - 0.08 / figure.get_figheight()))
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
    total, labels = one.amplitude, []
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
        labels.append((one.parts[name][-1], name, colour))
    if np.isfinite(one.rms).all():
        axes.plot(one.frequency, _positive(one.rms), color=NOTE, linewidth=0.7)
        labels.append((one.rms[0], f"RMS above f ({one.unit})", NOTE))
    if one.requirement is not None:
        axes.plot(
            one.requirement.frequency,
            _positive(one.requirement.density),
            color="#cc0000",
            linewidth=1.1,
            linestyle="--",
        )
        inside = one.requirement.frequency <= one.frequency[-1]
        name = shorten(single_line(Path(one.requirement.name).stem), 16)
        labels.append((one.requirement.density[inside][-1], name, "#cc0000"))
    axes.set_xlim(one.frequency[0], one.frequency[-1] * (1 + 1e-9 + (len(one.frequency) == 1)))
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel(f"{single_line(one.output, 40)} ({one.unit}/√Hz)")
    axes.set_title(write_message(one), loc="left", fontsize=8, color=INK)
    axes.yaxis.set_major_locator(LogLocator(numticks=9))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.grid(visible=True, which="major", color=PALE, linewidth=0.4)
    _label(axes, [*labels, (total[-1], "all", INK)])
    faint = [name for name in one.cause if name not in drawn]
    if faint:
        axes.annotate(
            textwrap.fill(
                f"not drawn, below {FAINT:g} of the sum everywhere: {', '.join(faint)}", 105
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


def _label(axes: Axes, labels: list[tuple[float, str, str]]) -> None:
    """Write labels at the right ends of lines, moved apart; the RMS ends on the left."""
    low, high = np.log10(axes.get_ylim())
    places = []
    for value, name, colour in labels:
        left = name.startswith("RMS")
        at = (np.log10(value) - low) / (high - low) if value > 0 else -1.0
        if left:
            axes.annotate(
                name,
                (0.01, min(at, 0.97)),
                (0, -2),
                xycoords="axes fraction",
                textcoords="offset points",
                va="top",
                fontsize=SMALL,
                color=colour,
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.8},
            )
        else:
            places.append([float(np.clip(at, 0.0, 1.0)), name, colour])
    places.sort(key=lambda place: place[0])
    heights = np.array([place[0] for place in places])
    for n in range(1, len(heights)):
        heights[n] = max(heights[n], heights[n - 1] + APART)
    heights -= max(heights[-1] - 1.0, 0.0)
    for n in range(len(heights) - 2, -1, -1):
        heights[n] = min(heights[n], heights[n + 1] - APART)
    for height, (_, name, colour) in zip(heights, places, strict=True):
        axes.text(
            1.01,
            height,
            shorten(name, 22),
            transform=axes.transAxes,
            va="center",
            fontsize=SMALL,
            color=colour,
            fontweight="bold" if name == "all" else "normal",
        )
