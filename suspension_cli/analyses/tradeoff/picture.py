"""Picture of `pendsus tradeoff`: error against time of the models, a chart per question."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.tradeoff.measure import Answer, Tradeoff, unit_of_time
from suspension_cli.drawing import labels, panels
from suspension_cli.drawing.panels import Across, Panel
from suspension_cli.drawing.style import NOTE, PALE, PALETTE
from suspension_cli.models.choice import TOLERANCE, percent
from suspension_cli.models.registry import FILES

COLOUR = dict(zip(FILES, (PALETTE[n] for n in (3, 2, 0, 1, 6)), strict=True))
"""Colours of the models."""
ROUNDING = 1e-12
"""Errors below this are drawn with the reference."""


def draw(found: Tradeoff, title: str) -> Figure:
    """Draw error against time of the models, a chart per question, with the advice."""
    shown, notes = [], []
    for answer in found.answers:
        name = answer.question[0].upper() + answer.question[1:]
        if answer.options:
            shown.append(_chart(answer, name))
        else:
            notes.append(f"{name}: {answer.advice}")
    if shown:
        notes.append(
            f"Left is fast, down is accurate. Shaded: {found.within}. Large: the model to use."
        )
    return panels.draw("Which model to use: error against time", title, shown, notes=notes)


def _chart(answer: Answer, name: str) -> Panel:
    """Make a panel with the models as points, and the tolerance as a band."""
    options = answer.options
    unit, size = unit_of_time(min(option.time for option in options))
    time = np.array([option.time for option in options]) / size
    error = np.nan_to_num([option.error for option in options])
    seen = np.append(error[(error > ROUNDING) & np.isfinite(error)], TOLERANCE)
    floor = float(10 ** (np.floor(np.log10(seen.min())) - 0.8))
    high = max(float(seen.max()), 10 * TOLERANCE)
    shown = np.clip(error, floor, high)
    wide = max(float(time.max() / time.min()), 2.0)
    limits = floor / 10**0.5, high * (high / floor) ** 0.25
    colours = [COLOUR.get(option.model, NOTE) for option in options]

    def paint(axes: Axes) -> None:
        decades = np.arange(np.ceil(np.log10(floor) + 0.3), np.floor(np.log10(limits[1])) + 1)
        decades = decades[:: -max(1, -(-len(decades) // 5))][::-1]
        names = {floor: "reference"} if error.min() <= ROUNDING else {}
        names |= {10.0**power: percent(10.0**power) for power in decades.tolist()}
        axes.set_yticks([*names], [*names.values()])
        axes.minorticks_off()
        axes.axhspan(limits[0], TOLERANCE, color=(PALE, 0.28), linewidth=0, zorder=0)
        for option, x, y, colour in zip(options, time, shown, colours, strict=True):
            size = 8.5 if option == answer.best else 5
            axes.plot(x, y, "o", color=colour, clip_on=False, ms=size, zorder=4)
        points = np.stack([time, shown], axis=1).tolist()
        labels.label_points(axes, points, [option.model for option in options], colours, pad=2.0)

    across = Across(
        f"processor time ({unit})", "log", (time.min() / wide**0.14, time.max() * wide**0.36)
    )
    return Panel(
        "relative error", (), 1.3, "log", limits, name, [answer.advice], across=across, paint=paint,
        left=0.86,
    )  # fmt: skip
