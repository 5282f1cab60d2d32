"""First picture of `pendsus tradeoff`: time and error of models, with advice."""

from __future__ import annotations

import textwrap
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from matplotlib.ticker import NullFormatter

from suspension_cli.analyses.tradeoff.picture import COLOUR, draw_front, pixels
from suspension_cli.analyses.tradeoff.result import ROUNDING, Tradeoff, front
from suspension_cli.analyses.tradeoff.summary import MODEL_TOLERANCE, Answer, Option, choices
from suspension_cli.drawing.curves import COLUMN, label_plainly, rule, write_heading
from suspension_cli.drawing.labels import annotate
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALE,
    add_axes,
    house_style,
    new_figure,
    single_line,
    with_opacity,
    write_text,
)
from suspension_cli.scene.arrays import Array

LEFT, WIDTH = 0.86, COLUMN - 1.0
"""Left edge and width of a chart, in."""
HEAD, ABOVE, HIGH, ROW, FOOT = 0.76, 0.44, 1.5, 2.5, 0.02
"""Heights of heading, space above a chart, chart, row and foot, in."""
LINE = 0.15
"""Height of a line of notes, in."""
FONT = 8.0
STRIP = 0.8
"""Decades from the smallest error above rounding to the strip of exact models."""


def draw(found: Tradeoff, title: str) -> Figure:
    """Draw error against time of the models, a chart per quantity."""
    questions = choices(found)
    left_out = [
        (panel.title, panel.left[0].reason if panel.left else "nothing to compare")
        for panel in found.panels
        if panel.compares == "models" and not panel.entries
    ]
    rows = len(questions) + len(left_out)
    key = textwrap.wrap(
        f"Errors against the {found.top} model. Steps: none is both faster and more accurate.",
        int(COLUMN / 0.058),
    )
    head = HEAD + LINE * (len(key) - 1)
    with house_style():
        figure = new_figure(COLUMN, head + ROW * rows + FOOT)
        write_heading(figure, "Which model to use: error against time", title)
        for n, line in enumerate(key):
            write_text(figure, 0.1, 0.43 + LINE * n, line, 7.5, NOTE)
        for n, (answer, options) in enumerate(questions):
            top = head + n * ROW
            name = answer.question[0].upper() + answer.question[1:]
            write_text(figure, 0.1, top, name, 9, bold=True)
            write_text(figure, 0.1, top + 0.175, advise(answer, options), 7.8, INK)
            axes = add_axes(figure, LEFT, top + ABOVE, WIDTH, HIGH)
            _draw_chart(axes, options, answer)
            axes.set_ylabel("relative error")
        for n, (name, reason) in enumerate(left_out, len(questions)):
            top = head + n * ROW
            write_text(figure, 0.1, top, name, 9, bold=True)
            for k, line in enumerate(textwrap.wrap(f"left out: {reason}", 70)):
                down = top + 0.175 + LINE * k
                write_text(figure, 0.1, down, single_line(line), 7.5, NOTE)
    return figure


def advise(answer: Answer, options: list[Option]) -> str:
    """Advise on a model in one sentence, from times and errors.

    >>> fine, coarse = Option("fine", 0.037, 9e-5), Option("coarse", 0.007, 0.15)
    >>> advise(Answer("models", "", fine, coarse), [fine, coarse])
    'Use fine: coarse is 5.3 times faster, but off by 15 %.'
    >>> advise(Answer("models", "", fine, None), [fine])
    'Use fine: no other model is faster.'
    """
    best, other = answer.best, answer.other
    if other is not None:
        ratio = best.time / other.time
        return (
            f"Use {best.name}: {other.name} is {ratio:.{2 if ratio < 100 else 3}g} times faster,"
            f" but off by {percent(other.error)}."
        )
    if best.time <= min(option.time for option in options):
        return f"Use {best.name}: no other model is faster."
    return f"Use {best.name}: simpler models save hardly any time."


def percent(error: float) -> str:
    """Format an error with one or two digits: ``15 %``, ``0.009 %``."""
    value = 100 * error
    return f"{float(f'{value:.2g}' if value >= 10 else f'{value:.1g}'):g} %"


def _draw_chart(axes: Axes, options: list[Option], answer: Answer) -> None:
    """Draw models as points, their Pareto front and the tolerance."""
    time = 1e3 * np.array([option.time for option in options])
    error = np.array([option.error for option in options])
    seen = np.append(error[error >= ROUNDING], MODEL_TOLERANCE)
    floor = float(10 ** (np.floor(np.log10(seen.min())) - STRIP))
    shown = np.where(error < ROUNDING, floor, error)
    axes.set(xscale="log", yscale="log", xlabel="processor time (ms)")
    wide = max(float(time.max() / time.min()), 2.0)
    axes.set_xlim(time.min() / wide**0.14, time.max() * wide**0.36)
    high = max(float(seen.max()), 10 * MODEL_TOLERANCE)
    axes.set_ylim(floor / 10**0.5, high * (high / floor) ** 0.22)
    rule(axes)
    label_plainly(axes.xaxis)
    decades = np.arange(np.ceil(np.log10(floor) + 0.3), np.floor(np.log10(axes.get_ylim()[1])) + 1)
    decades = decades[:: -max(1, -(-len(decades) // 5))][::-1]
    axes.set_yticks(
        [floor, *10.0**decades], ["reference", *(percent(10.0**power) for power in decades)]
    )
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.minorticks_off()
    axes.axhspan(
        axes.get_ylim()[0], MODEL_TOLERANCE, color=with_opacity(PALE, 0.28), linewidth=0, zorder=0
    )
    path = draw_front(axes, time, shown, front(time, error))
    note = _name_band(axes, path)
    for option, x, y in zip(options, time, shown, strict=True):
        look = {"ms": 8.5 if option.name == answer.best.name else 5, "zorder": 4}
        axes.plot(x, y, "o", color=COLOUR[option.name], clip_on=False, **look)
    annotate(
        axes,
        list(zip(time.tolist(), shown.tolist(), strict=True)),
        [option.name for option in options],
        [COLOUR[option.name] for option in options],
        FONT,
        [note.get_window_extent().extents],
        [pixels(axes, ends) for ends in pairwise(path)],
    )


def _name_band(axes: Axes, path: Array) -> Annotation:
    """Name the band of accurate models at its upper edge, beside the front."""
    falls = path[:-1, 0][(path[:-1, 1] >= MODEL_TOLERANCE) & (path[1:, 1] < MODEL_TOLERANCE)]
    crossing = axes.transAxes.inverted().transform(
        axes.transData.transform([[float(falls[0]), MODEL_TOLERANCE]] if len(falls) else [[1, 1]])
    )[0, 0]
    left = bool(len(falls)) and crossing > 0.5
    return axes.annotate(
        f"accurate enough: {percent(MODEL_TOLERANCE)}",
        (0.0 if left else 1.0, MODEL_TOLERANCE),
        (3 if left else -3, -2),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        ha="left" if left else "right",
        va="top",
        fontsize=7,
        color=NOTE,
    )
