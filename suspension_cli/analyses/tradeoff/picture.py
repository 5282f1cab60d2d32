"""Picture of `pendsus tradeoff`: error against time of the models, a chart per question."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from suspension_cli.analyses.tradeoff.result import Answer, Tradeoff, unit_of_time
from suspension_cli.drawing.curves import COLUMN, label_plainly, rule, wrap, write_heading
from suspension_cli.drawing.labels import annotate
from suspension_cli.drawing.style import (
    NOTE,
    PALE,
    PALETTE,
    add_axes,
    house_style,
    new_figure,
    with_opacity,
    write_text,
)
from suspension_cli.models.choice import TOLERANCE, percent
from suspension_cli.models.registry import FILES

COLOUR = dict(zip(FILES, (PALETTE[n] for n in (3, 2, 0, 1, 6)), strict=True))
"""Colours of the models."""
LEFT, WIDTH = 0.86, COLUMN - 1.0
"""Left edge and width of a chart, in."""
HEAD, ABOVE, HIGH, BELOW = 0.46, 0.26, 1.3, 0.56
"""Heights of the heading, the title of a chart, a chart, and the space below it, in."""
LINE = 0.15
"""Height of a line of notes, in."""
FONT = 7.8
ROUNDING = 1e-12
"""Errors below this are drawn with the reference."""


def draw(found: Tradeoff, title: str) -> Figure:
    """Draw error against time of the models, a chart per question, with the advice."""
    key = ""
    if any(answer.options for answer in found.answers):
        key = wrap(
            f"Left is fast, down is accurate. Shaded: {found.within}. Large: the model to use.",
            COLUMN - 0.2,
        )
    advice = [wrap(answer.advice, COLUMN - 0.2, FONT) for answer in found.answers]
    above = [ABOVE + LINE * (1 + text.count("\n")) for text in advice]
    below = [HIGH + BELOW if answer.options else LINE for answer in found.answers]
    top = HEAD + LINE * (1 + key.count("\n")) + 0.12
    with house_style():
        figure = new_figure(COLUMN, top + sum(above) + sum(below))
        write_heading(figure, "Which model to use: error against time", title)
        write_text(figure, 0.1, HEAD, key, 7.5, NOTE)
        for n, answer in enumerate(found.answers):
            name = answer.question[0].upper() + answer.question[1:]
            write_text(figure, 0.1, top, name, 8.5, bold=True)
            write_text(figure, 0.1, top + 0.18, advice[n], FONT)
            if answer.options:
                _draw_chart(add_axes(figure, LEFT, top + above[n], WIDTH, HIGH), answer)
            top += above[n] + below[n]
    return figure


def _draw_chart(axes: Axes, answer: Answer) -> None:
    """Draw models as points, and the tolerance as a band."""
    options = answer.options
    unit, size = unit_of_time(min(option.time for option in options))
    time = np.array([option.time for option in options]) / size
    error = np.nan_to_num([option.error for option in options])
    seen = np.append(error[(error > ROUNDING) & np.isfinite(error)], TOLERANCE)
    floor = float(10 ** (np.floor(np.log10(seen.min())) - 0.8))
    high = max(float(seen.max()), 10 * TOLERANCE)
    shown = np.clip(error, floor, high)
    axes.set(xscale="log", yscale="log", ylabel="relative error")
    axes.set_xlabel(f"processor time ({unit})", labelpad=1.5)
    wide = max(float(time.max() / time.min()), 2.0)
    axes.set_xlim(time.min() / wide**0.14, time.max() * wide**0.36)
    axes.set_ylim(floor / 10**0.5, high * (high / floor) ** 0.25)
    rule(axes)
    label_plainly(axes.xaxis)
    decades = np.arange(np.ceil(np.log10(floor) + 0.3), np.floor(np.log10(axes.get_ylim()[1])) + 1)
    decades = decades[:: -max(1, -(-len(decades) // 5))][::-1]
    names = {floor: "reference"} if error.min() <= ROUNDING else {}
    names |= {10.0**power: percent(10.0**power) for power in decades.tolist()}
    axes.set_yticks([*names], [*names.values()])
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.minorticks_off()
    enough = with_opacity(PALE, 0.28)
    axes.axhspan(axes.get_ylim()[0], TOLERANCE, color=enough, linewidth=0, zorder=0)
    for option, x, y in zip(options, time, shown, strict=True):
        look = {"ms": 8.5 if option == answer.best else 5, "zorder": 4}
        axes.plot(x, y, "o", color=COLOUR.get(option.model, NOTE), clip_on=False, **look)
    annotate(
        axes,
        list(zip(time.tolist(), shown.tolist(), strict=True)),
        [option.model for option in options],
        [COLOUR.get(option.model, NOTE) for option in options],
        8.0,
    )
