"""One page of panels of speed against accuracy, from the stored measurements."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.tradeoff.measure import COLOUR, format_time
from suspension_cli.drawing.curves import label_plainly, rule
from suspension_cli.drawing.labels import label_points
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PAGE_HEIGHT,
    PAGE_WIDTH,
    PALE,
    PALETTE,
    RAISED,
    SMALL,
    add_axes,
    house_style,
    new_figure,
    text_width,
    write_heading,
    write_text,
)
from suspension_cli.models.choice import percent
from tools.tradeoff import many, methods, models, peers
from tools.tradeoff.measurement import Measurement, select

HEAD = 0.52
"""Room for the heading and the key, in."""
WIDE = PAGE_WIDTH / 2
"""Width of a panel with its margins, in."""
TALL = (PAGE_HEIGHT - HEAD) / 5
"""Height of a panel with its texts, in."""
LEFT, RIGHT = 0.86, 0.14
"""Margins beside the axes of a panel, in."""
ABOVE, BELOW = 0.41, 0.46
"""Room for title and note of a panel, and for its horizontal axis, in."""
FLOOR = 1e-7
"""Error of models at which the reference is drawn, and smaller ones."""
LOW = "response from 0.1 to 10 Hz, 200 frequencies"
HIGH = "response from 50 to 1000 Hz, 200 frequencies"
NOISE = "thermal noise from 10 to 100 Hz, 200 frequencies"
COUPLING = "cross-coupling at 50 Hz, each of 205 imperfect builds"
COMMON = NOTE
"""Colour of other programs."""


def worst(rows: Sequence[Measurement]) -> float:
    """Find the largest error that is known."""
    return max(row.error for row in rows if row.error is not None)


def span(rows: Sequence[Measurement]) -> str:
    """Write the smallest and the largest error that are known: ``1.6 to 3.9 %``."""
    least = min(row.error for row in rows if row.error is not None)
    return f"{percent(least).removesuffix(' %')} to {percent(worst(rows))}"


def draw(rows: Sequence[Measurement]) -> Figure:
    """Draw the page."""
    panels = (
        _draw_modes,
        _draw_low,
        _draw_high,
        _draw_noise,
        _draw_coupling,
        _draw_methods,
        _draw_map,
        _draw_builds,
        _draw_growth,
        _draw_peers,
    )
    with house_style():
        figure = new_figure(PAGE_WIDTH, PAGE_HEIGHT)
        note = "Left is fast, down is accurate; processor times on one core."
        write_heading(figure, "Speed against accuracy", note)
        _write_key(figure)
        for number, paint in enumerate(panels):
            down, across = divmod(number, 2)
            paint(_Place(figure, across * WIDE, HEAD + down * TALL), rows)
    return figure


def _write_key(figure: Figure) -> None:
    """Write the names of the models in their colours, at the right of the heading."""
    left = PAGE_WIDTH - RIGHT
    for name, colour in reversed(COLOUR.items()):
        left -= text_width(name, 8.0) + 0.2
        write_text(figure, left, 0.26, name, 8.0, colour, bold=True)


class _Place:
    """Place of a panel on the page."""

    def __init__(self, figure: Figure, left: float, top: float) -> None:
        self.figure = figure
        self.left = left
        self.top = top

    def add(self, title: str, note: str, margin: float = LEFT) -> Axes:
        """Write title and note, and add axes below them."""
        write_text(self.figure, self.left + 0.1, self.top, title, 8.2, bold=True)
        write_text(self.figure, self.left + 0.1, self.top + 0.17, note, 7.0, NOTE)
        wide = WIDE - margin - RIGHT
        axes = add_axes(
            self.figure, self.left + margin, self.top + ABOVE, wide, TALL - ABOVE - BELOW
        )
        axes.xaxis.labelpad = 1.0
        axes.yaxis.labelpad = 2.0
        return axes


def _draw_models(axes: Axes, rows: Sequence[Measurement], mark: str) -> None:
    """Draw the models of all designs, joined by design, with rings about the chosen."""
    time = np.array([row.time for row in rows]) * 1e3
    error = np.array([np.nan if row.error is None else row.error for row in rows])
    shown = np.clip(error, FLOOR, 10.0)
    axes.set(xscale="log", yscale="log", ylim=(FLOOR / 3, 30))
    axes.set(xlim=(time.min() / 1.6, time.max() * 1.6))
    rule(axes)
    axes.set(xlabel="processor time (ms)", ylabel="relative error")
    decades = [1e-4, 1e-2, 1.0]
    axes.set_yticks([FLOOR, *decades], ["reference", *map(percent, decades)])
    axes.minorticks_off()
    label_plainly(axes.xaxis)
    for design in dict.fromkeys(row.design for row in rows):
        own = [n for n, row in enumerate(rows) if row.design == design]
        axes.plot(time[own], shown[own], color=PALE, lw=0.5, zorder=1)
    for row, x, y in zip(rows, time, shown, strict=True):
        axes.plot(x, y, "o", color=COLOUR[row.method], ms=3.2, zorder=3)
        if row.chosen == mark:
            axes.plot(x, y, "o", mfc="none", mec=INK, mew=0.7, ms=6.5, zorder=4)


def _draw_modes(place: _Place, rows: Sequence[Measurement]) -> None:
    own = select(rows, models.EVERY_MODE)
    chosen = [row for row in own if row.chosen == "auto"]
    title = f"Modes: auto is within {percent(worst(chosen))} of the reference"
    note = f"{len(chosen)} designs; ringed: taken by auto; dashed: program start"
    axes = place.add(title, note)
    _draw_models(axes, own, "auto")
    [start] = select(rows, many.START)
    axes.axvline(start.time * 1e3, color=NOTE, lw=0.8, ls=(0, (4, 2)))


def _question(
    place: _Place, rows: Sequence[Measurement], work: str, say: Callable[[Any], str], note: str
) -> None:
    """Draw the models for one question; `say` makes the title from the rows by model."""
    own = select(rows, work)
    by_model = {name: [row for row in own if row.method == name] for name in COLOUR}
    _draw_models(place.add(say(by_model), note), own, "best")


def _draw_low(place: _Place, rows: Sequence[Measurement]) -> None:
    def say(by_model: dict[str, list[Measurement]]) -> str:
        ratio = np.median(
            [
                exact.time / beam.time
                for exact, beam in zip(by_model["violin"], by_model["beam"], strict=True)
            ]
        )
        return f"To 10 Hz violin takes {ratio:.2g} times as long as beam"

    note = "0.1 to 10 Hz, 200 frequencies; ringed: the fastest within 0.1 %"
    _question(place, rows, LOW, say, note)


def _draw_high(place: _Place, rows: Sequence[Measurement]) -> None:
    def say(by_model: dict[str, list[Measurement]]) -> str:
        others = [row for name, own in by_model.items() if name != "violin" for row in own]
        return f"From 50 Hz on all but violin are off by {span(others)}"

    note = "50 to 1000 Hz, 200 frequencies: modes of wires; ringed as before"
    _question(place, rows, HIGH, say, note)


def _draw_noise(place: _Place, rows: Sequence[Measurement]) -> None:
    def say(by_model: dict[str, list[Measurement]]) -> str:
        return f"Thermal noise: beam is off by {span(by_model['beam'])}"

    note = "10 to 100 Hz, 200 frequencies; other models know no loss"
    _question(place, rows, NOISE, say, note)


def _draw_coupling(place: _Place, rows: Sequence[Measurement]) -> None:
    def say(by_model: dict[str, list[Measurement]]) -> str:
        size = worst(by_model["string"] + by_model["beam"])
        return f"Couplings: string and beam are off by up to {percent(size)}"

    note = "each of 205 imperfect builds, at 50 Hz; ringed as before"
    _question(place, rows, COUPLING, say, note)


def _draw_methods(place: _Place, rows: Sequence[Measurement]) -> None:
    found = by_method(select(rows, methods.WORK))
    digits = {name: max(0, int(-np.log10(worst(own)))) for name, own in found.items()}
    others = [count for name, count in digits.items() if name != methods.OURS]
    title = f"{methods.OURS.capitalize()} keeps {digits[methods.OURS]} digits, others"
    title += f" {max(others)} to {min(others)}"
    few = {
        name: max(row.time for row in own if row.size == methods.FEW) for name, own in found.items()
    }
    note = f"{methods.MANY:,} frequencies, {len(methods.DESIGNS)} designs; begins in"
    note += f" {format_time(few[methods.OURS])}, dense in {format_time(few['dense solve'])}"
    axes = place.add(title, note)
    axes.set(xscale="log", yscale="log", ylim=(1e-17, 3e3), xlim=(1, 3000))
    rule(axes)
    axes.set(xlabel="processor time (ms)", ylabel="relative error")
    axes.set_yticks([1e-16, 1e-12, 1e-8, 1e-4, 1.0])
    axes.minorticks_off()
    label_plainly(axes.xaxis)
    for (name, own), colour in zip(found.items(), PALETTE, strict=False):
        places = [(1e3 * row.time, row.error) for row in own if row.size == methods.MANY]
        axes.plot(*zip(*places, strict=True), "o-", color=colour, ms=3.5, lw=0.7, label=name)
    axes.legend(loc="upper right", fontsize=SMALL, borderaxespad=0.1, labelspacing=0.2)


def _draw_map(place: _Place, rows: Sequence[Measurement]) -> None:
    own = select(rows, many.MAP)
    names = list(dict.fromkeys(row.design for row in own))
    interpolated = [select(own, many.MAP, design=name, method=many.INTERPOLATED) for name in names]
    every = [select(own, many.MAP, design=name, method=many.EVERY_POINT)[0].time for name in names]
    alone = [select(own, many.MAP, design=name, method=many.ALONE)[0].time for name in names]
    enough = next(
        row.size
        for row in interpolated[0]
        if max(_error_at(one, row.size) for one in interpolated) < 1e-9
    )
    title = f"A map of a million points follows from {enough}"
    longest = max(row.time for one in interpolated for row in one)
    note = (
        f"in {format_time(longest)} at most; every point: {format_time(max(every))},"
        f" one at a time: {max(alone) / 3600:.1f} h"
    )
    axes = place.add(title, note)
    axes.set(xscale="log", yscale="log", ylim=(1e-14, 30), xlim=(6, 8000))
    rule(axes)
    axes.set(xlabel="points solved", ylabel="relative error")
    axes.set_yticks([1e-12, 1e-8, 1e-4, 1.0])
    axes.minorticks_off()
    sizes = [row.size for row in interpolated[0]]
    axes.set_xticks(sizes, [f"{size:,}" for size in sizes])
    for name, one, colour in zip(names, interpolated, PALETTE, strict=False):
        errors = [worst([row]) for row in one]
        axes.plot([row.size for row in one], errors, "o-", color=colour, ms=3.5, lw=1, label=name)
    axes.legend(loc="upper right", fontsize=SMALL, borderaxespad=0.1)


def _error_at(one: Sequence[Measurement], size: int) -> float:
    """Error of the map from so many points."""
    return worst([row for row in one if row.size == size])


def _draw_builds(place: _Place, rows: Sequence[Measurement]) -> None:
    mean = select(rows, many.MEAN)
    plain = select(mean, many.MEAN, method=many.PLAIN)
    controlled = select(mean, many.MEAN, method=many.CONTROLLED)
    # without control variates time x error^2 is constant
    effort = plain[-1].time * worst(plain[-1:]) ** 2
    pays = next(row.time for row in controlled if row.time * worst([row]) ** 2 < effort)
    title = f"Random builds: control variates pay from {format_time(pays)} on"
    first, last = (f"{plain[end].size:,}" for end in (0, -1))
    note = f"mean of |coupling| of triple-tolerance, from {first} to {last} builds"
    axes = place.add(title, note)
    axes.set(xscale="log", yscale="log", ylim=(3e-4, 0.5), xlim=(0.03, 60))
    rule(axes)
    axes.set(xlabel="processor time (s)", ylabel="standard error")
    ticks = [1e-3, 1e-2, 0.1]
    axes.set_yticks(ticks, list(map(percent, ticks)))
    axes.minorticks_off()
    label_plainly(axes.xaxis)
    for name, own, colour in zip(
        (many.PLAIN, many.CONTROLLED), (plain, controlled), PALETTE, strict=False
    ):
        error = [worst([row]) for row in own]
        axes.plot([row.time for row in own], error, "o-", color=colour, ms=3.5, lw=1, label=name)
    axes.legend(loc="upper right", fontsize=SMALL, borderaxespad=0.1)


def exponent(line: Sequence[Measurement]) -> float:
    """Power of the size with which the time grows, over the last step."""
    before, last = line[-2:]
    return float(np.log(last.time / before.time) / np.log(last.size / before.size))


def raised(power: float) -> str:
    """Write an exponent: 0.8 as small digits above the line."""
    return f"{power:.1f}".translate(RAISED).replace(".", "·")


def by_method(rows: Sequence[Measurement]) -> dict[str, list[Measurement]]:
    """Group measurements by method."""
    names = dict.fromkeys(row.method for row in rows)
    return {name: [row for row in rows if row.method == name] for name in names}


def _draw_growth(place: _Place, rows: Sequence[Measurement]) -> None:
    lines = by_method(select(rows, many.GROWTH))
    steepest = max(lines, key=lambda name: exponent(lines[name]))
    power, unit = exponent(lines[steepest]), lines[steepest][0].design
    title = f"Cost grows at most with power {power:.1f}, of {unit}"
    axes = place.add(title, "raised: the power of the size with which each grows at its end")
    axes.set(xscale="log", yscale="log", xlim=(2, 1e9), ylim=(1e-3, 60))
    rule(axes)
    axes.set(xlabel="points, builds, stages or frequencies", ylabel="processor time (s)")
    axes.minorticks_off()
    label_plainly(axes.yaxis)
    points, texts, colours = [], [], []
    for (name, line), colour in zip(lines.items(), PALETTE, strict=False):
        size, time = ([getattr(row, key) for row in line] for key in ("size", "time"))
        axes.plot(size, time, "o-", color=colour, ms=3, lw=1)
        between = np.linspace(0, len(line) - 1, 30)[:-3]
        dots = [np.exp(np.interp(between, range(len(line)), np.log(one))) for one in (size, time)]
        points += [(size[-1], time[-1]), *zip(*dots, strict=True)]  # labels keep off the lines
        texts += [f"{name}{raised(exponent(line))}", *[""] * len(between)]
        colours += [colour] * (1 + len(between))
    label_points(axes, points, texts, colours)


def _draw_peers(place: _Place, rows: Sequence[Measurement]) -> None:
    groups = {
        "response, one model": select(rows, peers.RESPONSE),
        "thermal noise": select(rows, peers.NOISE),
    }
    response, noise = groups.values()
    title = (
        f"Others: {min(row.time for row in response[1:]) / response[0].time:.2g} times slower;"
        f" in 1D {noise[0].time / noise[1].time:.2g} times faster"
    )
    axes = place.add(title, "quadruple, 1,000 frequencies; pygwinc has one dimension", margin=1.95)
    count = sum(map(len, groups.values())) + len(groups)
    longest = max(row.time for own in groups.values() for row in own) * 1e3
    axes.set(xscale="log", xlabel="processor time (ms)", ylim=(count - 0.5, -0.5), yticks=[])
    axes.set_xlim(1, 8 * longest)
    label_plainly(axes.xaxis)
    axes.minorticks_off()
    axes.spines["left"].set_visible(False)
    beside: dict[str, Any] = {"textcoords": "offset points", "va": "center", "size": 7.0}
    left = {"xycoords": ("axes fraction", "data"), "annotation_clip": False, **beside}
    shift = -72 * 1.85
    row = 0
    for name, own in groups.items():
        axes.annotate(name, (0, row), (shift, 0), color=NOTE, **left)
        for one in own:
            row += 1
            colour = PALETTE[0] if one.method.startswith(peers.OURS) else COMMON
            axes.barh(row, one.time * 1e3 - 1, 0.6, left=1, color=colour)
            axes.annotate(one.method, (0, row), (shift, 0), color=INK, **left)
            text = format_time(one.time)
            axes.annotate(text, (one.time * 1e3, row), (4, 0), color=INK, **beside)
        row += 1
