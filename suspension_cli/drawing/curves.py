"""Parts of figures with curves: headings, plain ticks, labels of lines and peaks, phases."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter

from suspension_cli.drawing.dimensions import spread
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALE,
    RC,
    LineLook,
    figure_of,
    new_figure,
    shorten,
    single_line,
    write_text,
)

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Int
    from matplotlib.typing import LineStyleType
    from numpy.typing import ArrayLike

_RENDERER = RendererAgg(1, 1, 72)

COLUMN = 4.55
"""Width of a figure whose text is legible in a column of 8.5 cm, in."""
HEAD = 0.5
"""Room for the heading at the top of a figure, in."""
ROW = 0.15
"""Height of a row of names or frequencies above axes, in."""
PEAKS = 0.25
"""Room above axes for the frequencies of peaks, in."""
LIFT = 0.1
"""Height above axes at which the frequencies of peaks stand, in."""
FARTHEST = 2.5
"""Largest distance of a frequency from its peak, in widths of the text."""
SAMPLE, APART = 0.22, 0.15
"""Length of the sample of a line beside its name, and distance to the next name, in."""
FOOT = 0.16
"""Room for the remark on the model at the bottom of a figure, in."""
DASHES: tuple[LineStyleType, ...] = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (5, 1.4, 1.2, 1.4)))
"""Line styles, so that lines that cover each other are seen."""
SMALL = 7.5
"""Font size of labels, points."""
NOISY = 0.25
"""Fraction of points with a jump of half a turn above which a phase is that of rounding errors."""
WIDE = 3.0
"""Decades from which a logarithmic axis has powers of ten as labels."""
PROMINENT = 2.0
"""Factor by which a peak must exceed the valleys on both sides to be labelled."""
STRAIGHT = 0.12
"""Largest deviation of the exponent of a power law that is labelled (or 3 % of a large one)."""
LONG = 0.25
"""Shortest part of a curve along a power law that is labelled, decades."""
MOST_PEAKS = 12
"""Largest number of labels of peaks."""


def write_heading(figure: Figure, quantity: str, design: str) -> None:
    """Write the quantity at the top of a figure; below it, smaller, the design and model."""
    across, _ = figure.get_size_inches()
    write_text(figure, 0.1, 0.08, single_line(quantity, int(across / 0.084)), 9.5, bold=True)
    write_text(figure, 0.1, 0.27, single_line(design, int(across / 0.058)), 7.5, NOTE)


def set_margins(
    figure: Figure,
    left: float = 0.75,
    right: float = 0.15,
    top: float = HEAD + 0.08,
    bottom: float = 0.45 + FOOT,
    **between: float,
) -> None:
    """Set the margins of a figure in inches; `between` are `wspace` and `hspace`."""
    across, up = figure.get_size_inches()
    figure.subplots_adjust(
        left=left / across,
        right=1 - right / across,
        top=1 - top / up,
        bottom=bottom / up,
        **between,
    )


def stack_panels(
    heights: Sequence[float],
    rooms: Sequence[float],
    left: float = 0.75,
    right: float = 0.15,
    bottom: float = 0.45,
) -> tuple[Figure, list[Axes]]:
    """Make a figure of panels below each other, which share their horizontal axis.

    `heights` of the panels, `rooms` above each, and margins are in inches.
    """
    parts = [part for both in zip(rooms, heights, strict=True) for part in both]
    figure = new_figure(COLUMN, HEAD + sum(parts) + bottom)
    set_margins(figure, left, right, HEAD, bottom, hspace=0)
    grid = figure.add_gridspec(len(parts), 1, height_ratios=[max(part, 1e-6) for part in parts])
    panels: list[Axes] = []
    for n in range(1, len(parts), 2):
        panels.append(figure.add_subplot(grid[n], sharex=panels[0] if panels else None))
        panels[-1].tick_params(which="both", labelbottom=n == len(parts) - 1)
        panels[-1].margins(x=0)
        rule(panels[-1])
    return figure, panels


def rule(axes: Axes) -> None:
    """Draw a faint grid, and tick labels that are legible in a column of 8.5 cm."""
    axes.grid(visible=True, which="major", color=PALE, linewidth=0.4)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=7.5)


def room_for(names: Sequence[str], most: int = 26) -> float:
    """Width of labels at line ends, in."""
    return 0.26 + 0.0085 * SMALL * max((min(len(name), most) for name in names), default=0)


@cache
def text_width(text: str, size: float = SMALL) -> float:
    """Width of a line of text, in."""
    font = FontProperties(family=RC["font.family"], size=size)
    return _RENDERER.get_text_width_height_descent(text, font, ismath="$" in text)[0] / 72


def wrap(text: str, width: float, size: float = SMALL) -> str:
    """Break text into lines of a width, in."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".lstrip()
        lines[-1:] = [longer] if text_width(longer, size) <= width else [lines[-1], word]
    return "\n".join(line for line in lines if line)


def place_key(names: Sequence[str], width: float = COLUMN - 0.9) -> list[tuple[float, int]]:
    """Arrange names of lines in rows of a width: the left end (in) and row of each name."""
    places, left, row = [], 0.0, 0
    for name in names:
        wide = SAMPLE + 0.05 + text_width(single_line(name, 60))
        if left > 0 and left + wide > width:
            left, row = 0.0, row + 1
        places.append((left, row))
        left += wide + APART
    return places


def key_room(names: Sequence[str]) -> float:
    """Room for the names of lines above axes, in."""
    return ROW * (place_key(names)[-1][1] + 1) + 0.03 if names else 0.0


def write_key(axes: Axes, lines: Sequence[tuple[str, str, LineLook]], above: float = 0.0) -> None:
    """Write the names of lines above axes, with samples of them.

    `lines` are name, colour and further properties of each sample; `above` is the room between axes
    and names, in.
    """
    box, (across, up) = axes.get_position(), figure_of(axes).get_size_inches()
    wide, high = box.width * across, box.height * up
    places = place_key([name for name, *_ in lines], wide)
    for (name, colour, how), (left, row) in zip(lines, places, strict=True):
        look: LineLook = {"linewidth": 1.2, **how}
        y = 1 + (above + ROW * (places[-1][1] - row) + ROW / 2 + 0.02) / high
        axes.add_line(
            Line2D(
                [left / wide, (left + SAMPLE / 2) / wide, (left + SAMPLE) / wide],
                [y] * 3,
                color=colour,
                clip_on=False,
                transform=axes.transAxes,
                markevery=[1],
                **look,
            )
        )
        axes.text(
            (left + SAMPLE + 0.05) / wide,
            y,
            single_line(name, 60),
            color=colour,
            fontsize=SMALL,
            va="center_baseline",
            transform=axes.transAxes,
        )


def mark_design(panels: Sequence[Axes], at: float, text: str = "as designed") -> None:
    """Mark a place along the horizontal axes with a line, and name it above the first."""
    for axes in panels:
        axes.axvline(at, color=INK, linewidth=0.7, linestyle=(0, (4, 2)), zorder=1.6)
    panels[0].annotate(
        text, (at, 1), (0, 2), xycoords=("data", "axes fraction"), textcoords="offset points",
        va="bottom", ha="center", color=INK, fontsize=SMALL, annotation_clip=False,
    )  # fmt: skip


def label_plainly(axis: Axis) -> None:
    """Label a logarithmic axis with 0.1, 1, 10, or with powers of ten if it is wide."""
    low, high = sorted(axis.get_view_interval())
    decades = np.log10(high / low) if low > 0 else 0.0
    if decades > WIDE and not (low >= 0.9e-3 and high <= 1.1e4):
        axis.set_major_locator(LogLocator(numticks=9))
        axis.set_minor_formatter(NullFormatter())
        return
    if decades < 2.0:
        axis.set_major_locator(
            LogLocator(subs=(1, 1.5, 2, 3, 5, 7) if decades < 0.6 else (1, 2, 5))
        )
        axis.set_minor_locator(FixedLocator([]))
    axis.set_major_formatter(FuncFormatter(lambda x, _: write_plainly(x)))
    axis.set_minor_formatter(NullFormatter())


def write_plainly(value: float) -> str:
    """Write a number as 0.05 or 200, with a power of ten only where it is very small or large.

    >>> write_plainly(0.05), write_plainly(1e-6)
    ('0.05', '$10^{-6}$')
    """
    if value == 0 or 1e-3 <= abs(value) < 1e5:
        return f"{value:g}".replace("-", "−")
    power = int(np.floor(np.log10(abs(value)) + 1e-9))
    factor = f"{value / 10.0**power:g}"
    if factor in ("1", "-1"):
        return f"${factor[:-1]}10^{{{power}}}$"
    return f"${factor}\\times10^{{{power}}}$"


def unit_of_ratio(ratio: str) -> str:
    """Unit of a ratio of two motions.

    >>> unit_of_ratio("test.pitch/test.x@0,0,0.001")
    'rad/m'
    """
    names = [end.strip().split("@")[0].rpartition(".")[2] for end in ratio.split("/")[:2]]
    return "/".join("rad" if name in ("roll", "pitch", "yaw") else "m" for name in names)


def label_phases(axes: Axes) -> None:
    """Label a vertical axis of phases at multiples of 90 degrees, or of more if it is long."""
    low, high = axes.get_ylim()
    low, high = min(low, -8.0), max(high, 8.0)
    steps = np.array([45.0, 90.0, 180.0, 360.0, 720.0, 1440.0, 3600.0])
    step = steps[1:][(high - low) / steps[1:] <= 4.6][:1]
    step = float(step[0]) if len(step) else 3600.0 * np.ceil((high - low) / 3600.0 / 4)
    axes.set_ylim(low, high)
    axes.set_yticks(np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}".replace("-", "−")))


def unwrap_phase(value: Complex[np.ndarray, " frequency"]) -> Float[np.ndarray, " frequency"]:
    """Unwrap the phase of a response along its frequencies, in degrees.

    At a pole or zero too narrow for the grid the phase jumps by half a turn between two points. As
    with a little loss, it then falls at a pole (|value| rises towards it on both sides) and rises
    at a zero. NaN where rounding errors alone make the phase: it jumps at every third point.

    >>> unwrap_phase(np.array([1.0, 2.0, 9.0, -9.0, -2.0]) + 0j).tolist()
    [0.0, 0.0, 0.0, -180.0, -180.0]
    """
    found = np.full(len(value), np.nan)
    some = np.flatnonzero(np.isfinite(value) & (value != 0))
    if not len(some):
        return found
    known = np.asarray(value)[some]
    size = np.log(np.abs(known))
    angle = np.degrees(np.angle(known))
    step = (np.diff(angle) + 180.0) % 360.0 - 180.0
    before = np.concatenate([[0.0], np.diff(size)[:-1]])
    after = np.concatenate([np.diff(size)[1:], [0.0]])
    pole = before - after > 0
    half = np.abs(step) > 120.0
    if half.sum() > max(NOISY * len(half), 12):
        return found
    step = np.where(half & pole & (step > 0), step - 360.0, step)
    step = np.where(half & ~pole & (step < 0), step + 360.0, step)
    start = angle[0] + (360.0 if angle[0] < -179.0 else 0.0)
    found[some] = start + np.concatenate([[0.0], np.cumsum(step)])
    return found


def to_branch(
    phase: Float[np.ndarray, "*shape"], near: Float[np.ndarray, "*shape"] | float
) -> Float[np.ndarray, "*shape"]:
    """Shift phases (degrees) by full turns to between 200 below and 160 above others.

    Phases scattered about half a turn from `near` then stay together.

    >>> to_branch(np.array([179.0, -179.0]), 0.0).tolist()
    [-181.0, -179.0]
    """
    return near + (phase - near + 200.0) % 360.0 - 200.0


def label_ends(
    axes: Axes, ends: Sequence[tuple[ArrayLike, ArrayLike, str, str]], most: int = 26
) -> None:
    """Write labels at the ends of lines, right of the axes, moved apart, with leaders.

    A line that ends outside the panel gets an arrow up or down. Labels follow changed limits. The
    axes have their limits and place; `ends` are abscissas, ordinates, label and colour of each
    line, `most` the characters of a label.
    """
    if not ends:
        return
    texts = [
        axes.annotate(
            "",
            (1, 0.5),
            (8, 0),
            xycoords="axes fraction",
            textcoords="offset points",
            va="center",
            ha="left",
            fontsize=SMALL,
            color=colour,
            annotation_clip=False,
        )
        for *_, colour in ends
    ]
    leaders = [
        axes.add_line(
            Line2D([], [], color=colour, linewidth=0.6, clip_on=False, transform=axes.transAxes)
        )
        for *_, colour in ends
    ]

    def place(_axes: Axes | None = None) -> None:
        box = axes.get_window_extent()
        gap = 1.18 * SMALL * axes.figure.dpi / 72
        low, high = sorted(axes.get_xlim())
        raw = []
        for abscissas, ordinates, *_ in ends:
            x, y = np.asarray(abscissas, dtype=float), np.asarray(ordinates, dtype=float)
            shown = np.flatnonzero(np.isfinite(y) & (x >= low) & (x <= high))
            last = float(y[shown[-1]]) if len(shown) else np.nan
            with np.errstate(invalid="ignore", divide="ignore"):
                at = axes.transData.transform((high, last))[1] - box.y0
            raw.append(float(at) if np.isfinite(at) else -1.0)
        inside = [float(np.clip(at, 0.0, box.height)) for at in raw]
        # below the panel the order is that of the values
        order = [at + 1e-9 * min(real, 0.0) for at, real in zip(inside, raw, strict=True)]
        places = _within(spread(order, gap), gap, box.height)
        across = 6 * axes.figure.dpi / 72 / box.width
        for text, leader, at, real, end, (_x, _y, name, _colour) in zip(
            texts, leaders, places, raw, inside, ends, strict=True
        ):
            outside = "↓ " if real < -1 else "↑ " if real > box.height + 1 else ""
            plain = name if name.startswith("$") else single_line(shorten(name, most))
            text.set_text(outside + plain)
            text.xy = (1, at / box.height)
            moved = not outside and abs(at) > 0.3 * gap
            leader.set_data(
                [1, 1 + across] if moved else [],
                [end / box.height, at / box.height] if moved else [],
            )

    place()
    for event in ("xlim_changed", "ylim_changed"):
        axes.callbacks.connect(event, place)


def _within(places: list[float], gap: float, height: float) -> list[float]:
    """Shift places at least a gap apart into 0 to a height, as far as they fit."""
    order = np.argsort(places, kind="stable")
    found = np.array(places)[order]
    found = np.minimum(found, height - gap * np.arange(len(found))[::-1])
    low = min(0.0, height - gap * (len(found) - 1))
    for n in range(len(found)):
        found[n] = max(found[n], low + n * gap if n == 0 else found[n - 1] + gap)
    result = np.empty(len(found))
    result[order] = found
    return result.tolist()


def find_peaks(
    size: Float[np.ndarray, " frequency"], prominent: float = PROMINENT
) -> Int[np.ndarray, " peak"]:
    """Indices of local maxima that exceed both valleys beside them by a factor, highest last."""
    level = np.log(np.where(np.isfinite(size) & (size > 0), size, np.nan))
    level = np.where(np.isfinite(level), level, np.nanmin(level, initial=0.0))
    tops = 1 + np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] >= level[2:]))
    found = []
    for top in tops:
        higher = np.flatnonzero(level > level[top])
        left, right = higher[higher < top], higher[higher > top]
        valley = max(
            level[left[-1] if len(left) else 0 : top].min(),
            level[top : (right[0] if len(right) else len(level)) + 1].min(),
        )
        if level[top] - valley > np.log(prominent):
            found.append((level[top] - valley, top))
    return np.array([top for _, top in sorted(found)], dtype=int)


def label_peaks(
    axes: Axes,
    peaks: Sequence[tuple[float, float, str]],
    size: float = SMALL,
    unit: str = " Hz",
) -> None:
    """Write the frequencies of peaks in a row above axes, moved apart, with leaders.

    The axes have their limits, and room of the height `PEAKS` above. `peaks` are frequency (Hz),
    ordinate and remark of each, the most important last. `size` is that of the font, points; `unit`
    follows the last frequency of the row.
    """
    chosen: list[tuple[float, float, str]] = []
    low, high = axes.get_xlim()
    for peak in reversed(peaks):
        near = any(abs(np.log(peak[0] / other[0])) < 5e-3 for other in chosen)
        if low <= peak[0] <= high and not near and len(chosen) < MOST_PEAKS:
            chosen.append(peak)
    if not chosen:
        return
    box, inch = axes.get_window_extent(), axes.figure.dpi
    texts = {peak: f"{format_frequency(peak[0])}{peak[2]}" for peak in chosen}
    wide = (max(text_width(text, size) for text in texts.values()) + 0.1) * inch
    chosen = chosen[: max(1, int((box.width) / wide))]
    while True:  # without the least important, until no label is far from its peak
        shown = sorted(chosen)
        raw = [float(axes.transData.transform((at, 1))[0] - box.x0) for at, *_ in shown]
        wanted = [x - wide / 2 for x in raw]
        places = _within(spread(wanted, wide), wide, box.width - wide)
        if len(chosen) == 1 or np.abs(np.subtract(places, wanted)).max() < FARTHEST * wide:
            break
        chosen.pop()
    foot = 1 + LIFT * inch / box.height
    texts[shown[-1]] = f"{format_frequency(shown[-1][0])}{unit}{shown[-1][2]}"
    for peak, place, x in zip(shown, places, raw, strict=True):
        middle = (place + wide / 2) / box.width
        axes.text(
            middle,
            foot,
            texts[peak],
            transform=axes.transAxes,
            ha="center",
            va="bottom",
            fontsize=size,
            color=NOTE,
        )
        top = (axes.transData.transform(peak[:2])[1] - box.y0) / box.height
        axes.add_line(
            Line2D(
                [x / box.width, x / box.width, middle],
                [min(top + 0.01, 1.0), 1.0, foot],
                transform=axes.transAxes,
                color=NOTE,
                linewidth=0.4,
                zorder=1,
                clip_on=False,
            )
        )


def format_frequency(value: float) -> str:
    """Write a frequency with three digits, ``1280``."""
    return f"{float(f'{value:.3g}'):.7g}"


def find_slopes(
    frequency: Float[np.ndarray, " frequency"], size: Float[np.ndarray, " frequency"]
) -> list[tuple[int, float, float]]:
    """Find the longest part of a curve along each power law: exponent, and its ends in Hz.

    >>> f = np.geomspace(0.1, 100, 400)
    >>> [(n, round(low)) for n, low, high in find_slopes(f, 1 / (1 + (f / 2) ** 2)) if n]
    [(-2, 8)]
    """
    good = np.isfinite(size) & (size > 0) & (frequency > 0)
    if good.sum() < 8:
        return []
    x, y = np.log10(frequency[good]), np.log10(size[good])
    grid = np.arange(x[0], x[-1], 0.02)
    if len(grid) < 8:
        return []
    slope = np.gradient(np.interp(grid, x, y), 0.02)
    whole = np.round(slope)
    off = np.abs(slope - whole)
    fits = (off < np.maximum(STRAIGHT, 0.03 * np.abs(whole))) & (whole != 0) & (np.abs(whole) <= 24)
    found: dict[int, tuple[float, float]] = {}
    start = 0
    for n in range(1, len(grid) + 1):
        if n < len(grid) and fits[n] and fits[start] and whole[n] == whole[start]:
            continue
        if fits[start]:
            own = int(whole[start])
            before = found.get(own, (0.0, 0.0))
            if grid[n - 1] - grid[start] > max(LONG, before[1] - before[0]):
                found[own] = float(grid[start]), float(grid[n - 1])
        start = n
    return [(own, float(10**low), float(10**high)) for own, (low, high) in found.items()]


def label_slopes(
    axes: Axes,
    frequency: Float[np.ndarray, " frequency"],
    size: Float[np.ndarray, " frequency"],
    drawn: Float[np.ndarray, " frequency"],
    colour: str = INK,
) -> None:
    """Write power laws beside a curve, f^-6, away from its peaks.

    The `size` follows the power law of the `frequency`, Hz; `drawn` are ordinates.
    """
    peaks = np.log(frequency[find_peaks(size)])
    for power, low, high in find_slopes(frequency, size):
        places = np.log(low) + np.array([0.5, 0.3, 0.7]) * np.log(high / low)
        free = np.abs(places[:, None] - peaks).min(1, initial=0.3)
        middle = np.exp(places[free.argmax()])
        at = np.interp(np.log(middle), np.log(frequency), drawn)
        axes.annotate(
            f"$f^{{{power}}}$",
            (middle, at),
            (5 if power < 0 else -5, 4),
            textcoords="offset points",
            ha="left" if power < 0 else "right",
            va="bottom",
            fontsize=8,
            color=colour,
            annotation_clip=True,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.4, "alpha": 0.85},
        )
