"""Pictures as data: panels of lines, which one function lays out, draws and labels."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from suspension_cli.drawing import curves, labels, scales
from suspension_cli.drawing.labels import widest
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    SMALL,
    LineLook,
    add_axes,
    figure_of,
    house_style,
    new_figure,
    single_line,
    text_width,
    write_text,
)
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from matplotlib.typing import LineStyleType
    from numpy.typing import ArrayLike

COLUMN = 4.55
"""Width of a figure whose text is legible in a column of 8.5 cm, in."""
HEAD = 0.5
"""Room for the heading at the top of a figure, in."""
FOOT = 0.16
"""Room for the remark on the model at the bottom of a figure, in."""
LEFT = 0.75
"""Margin left of panels with numbers, in."""
ROW = 0.15
"""Height of a line of text or names above panels, and of notes, in."""
ITEM = 0.17
"""Height of a row of a panel with named rows, in."""
PEAKS = 0.25
"""Room above axes for the frequencies of peaks, in."""
GAP = 0.16
"""Distance between panels, in."""
SAMPLE, APART = 0.22, 0.15
"""Length of the sample of a line beside its name, and distance to the next name, in."""
MANY = 12
"""Number of curves above which peaks and slopes have no labels."""
REACH = 1.5
"""Distance of a rule beyond the axes up to which these are extended, relative to their length."""
DASHES: tuple[LineStyleType, ...] = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (5, 1.4, 1.2, 1.4)))
"""Line styles, so that lines that cover each other are seen."""
PALE_SUM = 2.2
"""Sum of red, green and blue above which a colour is too pale for text."""
ERROR = "#9aa1a8"
"""Colour of error bars."""
_WIDTH = ContextVar("_WIDTH", default=COLUMN)
Limits = tuple[float, float] | None
_LIMITS: ContextVar[tuple[Limits, Limits]] = ContextVar("_LIMITS", default=(None, None))
Scale = Literal["linear", "log", "db", "phase", "signed"]


@dataclass(frozen=True)
class Line:
    """Curve or points; `y` may be complex. A name beginning with "_" is not shown.

    `error` are the lower and upper ends of error bars.
    """

    x: ArrayLike
    y: ArrayLike
    name: str = "_"
    colour: str = INK
    look: LineLook = field(default_factory=LineLook)
    error: tuple[ArrayLike, ArrayLike] | None = None


@dataclass(frozen=True)
class Across:
    """Horizontal axis; by default its limits are those of the lines, and its ticks round numbers.

    A "signed" scale is logarithmic on both sides of 0 where values are large.
    """

    label: str = "frequency (Hz)"
    scale: Scale = "log"
    limits: tuple[float, float] | None = None
    ticks: Mapping[float, str] = field(default_factory=dict)


FREQUENCY = Across()


@dataclass(frozen=True)
class Rule:
    """Line across a panel, with a text at its end; an arrow at the edge if it is far outside.

    With another end `to`, it is a band without text.
    """

    at: float
    text: str = ""
    vertical: bool = False
    colour: str = INK
    dashes: LineStyleType = (0, (4, 2))
    is_named: bool = True
    """Whether the text is shown also where the line is."""
    to: float | None = None


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Attributes
    ----------
    label
        Quantity and unit of the vertical axis.
    scale
        Of the vertical axis: "db" is 20 log10 of the size, "phase" the angle in degrees.
    limits
        Of the vertical axis; by default those of the lines, without infinite peaks.
    title, remarks
        Texts above.
    key
        Samples above; by default those of the lines with names.
    ends
        Whether the names of the lines are at their ends instead.
    peaks
        Frequency, ordinate and remark of peaks to label, or "find" for those of the lines.
    across
        Own horizontal axis; None for that of the next panel below which has one.
    rows
        Names of rows, from the top down, instead of a vertical axis.
    beside
        Texts of rows, right of the axes.
    paint
        Draws what is no line, on axes that have their limits.
    empty
        Words in the middle of a panel without lines.
    left, right
        Margins, in; by default what labels need.
    above
        Room directly above the axes, in.
    width
        Relative to the panels beside it.
    """

    label: str = ""
    lines: Sequence[Line] = ()
    height: float = 2.3
    scale: Scale = "linear"
    limits: tuple[float, float] | None = None
    title: str = ""
    remarks: Sequence[str] = ()
    key: Sequence[Line] | None = None
    ends: bool = False
    peaks: Sequence[tuple[float, float, str]] | Literal["find"] = ()
    rules: Sequence[Rule] = ()
    across: Across | None = None
    rows: Sequence[str] = ()
    beside: Sequence[str] = ()
    paint: Callable[[Axes], None] | None = None
    empty: str = ""
    left: float | None = None
    right: float | None = None
    above: float = 0.0
    width: float = 1.0

    @property
    def samples(self) -> Sequence[Line]:
        """Lines whose names are above."""
        lines = self.lines if self.key is None else self.key
        return () if self.ends and self.key is None else [one for one in lines if named(one)]

    @property
    def margins(self) -> tuple[float, float]:
        """Margins left and right, in."""
        left = max(0.24 + widest(self.rows), 0.3) if self.rows else LEFT
        names = [one.name for one in self.lines if named(one)] if self.ends else []
        right = 0.15 + widest(self.beside) if self.beside else labels.room_for(names)
        return left if self.left is None else self.left, right if self.right is None else self.right


def stems(start: ArrayLike, end: ArrayLike, colour: str, width: float = 0.8) -> list[Line]:
    """Make lines of a width in points along rows, from the start to the end of each."""
    ends = np.stack(np.broadcast_arrays(start, end), axis=1)
    look: LineLook = {"linewidth": width, "zorder": 1.5, "solid_capstyle": "butt"}
    return [Line(pair, [row, row], "_", colour, look) for row, pair in enumerate(ends)]


def dashes_of(colours: Sequence[str]) -> list[LineStyleType]:
    """Choose dashes by which lines of one colour differ."""
    return [DASHES[colours[:n].count(own) % len(DASHES)] for n, own in enumerate(colours)]


def named(line: Line) -> bool:
    """Whether the name of a line is shown."""
    return not line.name.startswith("_")


_Words = tuple[float, str, str, Line | None]
"""Words above a panel: distance from the left, in, text, colour, and the line of a sample."""


@dataclass(frozen=True)
class _Place:
    """Place of a panel: axes (left, top, width, height), and rows of words at their corner, in."""

    panel: Panel
    box: tuple[float, float, float, float]
    corner: tuple[float, float]
    words: list[list[_Words]]


@contextlib.contextmanager
def page_width(width: float) -> Iterator[None]:
    """Make figures of panels as wide as a page, in, instead of a column of a paper."""
    token = _WIDTH.set(width)
    try:
        yield
    finally:
        _WIDTH.reset(token)


@contextlib.contextmanager
def limited(x: Limits, y: Limits) -> Iterator[None]:
    """Limit the horizontal axes that are labelled as the first, and the first vertical axis."""
    token = _LIMITS.set((x, y))
    try:
        yield
    finally:
        _LIMITS.reset(token)


def draw(
    heading: str,
    subtitle: str,
    panels: Sequence[Panel | tuple[Panel, ...]],
    across: Across = FREQUENCY,
    notes: Sequence[str] = (),
    width: float | None = None,
) -> Figure:
    """Draw panels below each other; those of a tuple stand side by side.

    Parameters
    ----------
    heading, subtitle
        Quantity in bold; below it design and model.
    across
        Horizontal axis of the last panel, if it has none of its own.
    notes
        Lines of text below.
    width
        In; by default that of a column, or of `page_width`.
    """
    width = width or _WIDTH.get()
    rows = [row if isinstance(row, tuple) else (row,) for row in panels]
    last = len(rows) - 1
    owner = [
        next(m for m in range(n, len(rows)) if m == last or rows[m][0].across)
        for n in range(len(rows))
    ]
    with house_style():
        places, top = [], HEAD
        for n, row in enumerate(rows):
            own = _place_row(row, top, width)
            places.append(own)
            top = max(one.box[1] + one.box[3] for one in own)
            if owner[n] == n:
                top += max(_below(one.across or across) for one in row)
        lines = [part for note in notes for part in labels.wrap(note, width - 0.2).split("\n")]
        figure = new_figure(width, top + ROW * len(lines) + 0.05 * bool(lines) + FOOT)
        for n, line in enumerate(lines):
            write_text(figure, 0.1, top + 0.02 + ROW * n, line, SMALL, NOTE)
        write_heading(figure, heading, subtitle)
        first: dict[int, Axes] = {}
        for n, row in enumerate(places):
            for k, place in enumerate(row):
                group = [one for m, one in enumerate(rows) if owner[m] == owner[n]]
                leader = first.get(owner[n]) if len(row) == 1 else None
                axes = add_axes(figure, *place.box, sharex=leader)
                first.setdefault(owner[n], axes)
                axes.tick_params(which="both", labelbottom=owner[n] == n)
                axis = rows[owner[n]][min(k, len(rows[owner[n]]) - 1)].across or across
                alike = axis.label == (rows[owner[0]][0].across or across).label
                panel, axis = _apply_limits(place.panel, axis, first=n == k == 0, alike=alike)
                beside = [one[k] for one in group if k < len(one)]
                _draw_panel(axes, panel, axis, beside, is_lowest=owner[n] == n)
                _write_above(figure, place)
        figure.align_ylabels([axes for axes in figure.axes if axes.get_ylabel()])
        return figure


def _place_row(row: Sequence[Panel], above: float, width: float) -> list[_Place]:
    """Place panels side by side, below their texts."""
    edges = np.cumsum([0.0, *(one.width for one in row)]) * width / sum(one.width for one in row)
    above_axes, found = 0.0, []
    for n, (one, start, end) in enumerate(
        zip(row, edges[:-1].tolist(), edges[1:].tolist(), strict=True)
    ):
        left, right = one.margins
        begin = start + (0.1 if one.rows or one.left else left)
        alone = not any(other.title or other.remarks or other.samples for other in row[n + 1 :])
        words = _words_above(one, (width if alone else end) - begin, right)
        room = GAP + ROW * len(words) + _beside(one)
        above_axes = max(above_axes, room)
        found.append((one, start + left, end - start - left - right, begin, room, words))
    top = above + above_axes
    return [
        _Place(one, (left, top, wide, one.height), (begin, top - room + GAP - 0.03), words)
        for one, left, wide, begin, room, words in found
    ]


def _words_above(panel: Panel, width: float, right: float) -> list[list[_Words]]:
    """Rows of a title, remarks, and names of lines with samples; these end at the axes."""
    texts = [(panel.title, INK)] * bool(panel.title) + [(text, NOTE) for text in panel.remarks]
    rows: list[list[_Words]] = [
        [(0.0, part, colour, None)]
        for text, colour in texts
        for part in labels.wrap(text, width - 0.05).split("\n")
    ]
    left = np.inf
    for line in panel.samples:
        name = single_line(line.name, 60)
        wide = SAMPLE + 0.05 + text_width(name)
        if left + wide > width - right:
            rows.append([])
            left = 0.0
        pale = sum(to_rgb(line.colour)) > PALE_SUM
        rows[-1].append((left, name, INK if pale else line.colour, line))
        left += wide + APART
    return rows


def _beside(panel: Panel) -> float:
    """Height of the frequencies of peaks, or of the texts of rules, directly above axes, in."""
    texts = any(one.text and (one.vertical or not one.is_named) for one in panel.rules)
    return panel.above + (PEAKS if panel.peaks else 0.14 * texts)


def _below(axis: Across) -> float:
    """Height of the labels below axes, in."""
    return 0.27 + 0.15 * (axis.label.count("\n") + 1) if axis.label else 0.24


def _draw_panel(
    axes: Axes, panel: Panel, axis: Across, group: Sequence[Panel], *, is_lowest: bool
) -> None:
    scales.rule(axes)
    if axis.scale == "log":
        scales.label_plainly(axes.xaxis)
    if panel.scale == "log":
        scales.label_plainly(axes.yaxis)
    drawn = [_draw_line(axes, line, panel.scale) for line in panel.lines]
    _name_rows(axes, panel)
    _scale_across(axes, axis, group)
    _limit_upright(axes, panel, drawn)
    if panel.paint:
        panel.paint(axes)
    axes.set_ylabel(panel.label)
    if is_lowest:
        axes.set_xlabel(axis.label)
    for one in panel.rules:
        _draw_rule(axes, one)
    if panel.scale == "phase":
        scales.label_phases(axes)
    if panel.scale == "linear" and "(" in panel.label:
        scales.raise_power(axes.yaxis)
    if panel.ends:
        ends = [
            (*pair, one.name, one.colour)
            for pair, one in zip(drawn, panel.lines, strict=True)
            if named(one)
        ]
        labels.label_ends(axes, ends, most=30)
    if panel.empty and not any(np.isfinite(y).any() for _, y in drawn):
        axes.set_yticks([])
        look = {"ha": "center", "va": "center", "bbox": {"color": "white"}, "color": NOTE}
        axes.text(0.5, 0.5, panel.empty, transform=axes.transAxes, **look)
    elif panel.peaks:
        _label_peaks(axes, panel, drawn)


def _draw_line(axes: Axes, line: Line, scale: Scale) -> tuple[Array, Array]:
    """Draw one line; return its abscissas and ordinates."""
    x, y = np.asarray(line.x, dtype=float), np.asarray(line.y)
    look: LineLook = {"linewidth": 1.0, **line.look}
    if len(x) == 1 and "marker" not in look:
        look |= {"marker": "o", "markersize": 3}
    if line.error is not None:
        low, high = (_ordinates(np.asarray(end), scale) for end in line.error)
        if scale == "phase":  # an error of the size is one of the angle
            off = np.degrees(np.abs(np.asarray(line.error[1]) - y) / np.abs(y))
            low, high = low - off, high + off
        axes.vlines(x, low, high, color=ERROR, linewidth=0.6, zorder=1.5)
    if scale == "phase" and np.iscomplexobj(y) and not is_dotted(line):
        x, y = curves.phase_line(x, y)
    else:
        y = _ordinates(y, scale)
    axes.plot(x, y, color=line.colour, label=line.name, **look)
    return x, y


def is_dotted(line: Line) -> bool:
    """Whether a line is drawn as points."""
    return line.look.get("linestyle") == "none"


def _ordinates(values: Array, scale: Scale) -> Array:
    """Values on the axis; NaN where a logarithm does not exist."""
    if scale == "phase":
        complexes = np.iscomplexobj(values)
        return curves.wrap(np.degrees(np.angle(values))) if complexes else values
    if scale == "linear":
        return values.astype(float)
    size = np.abs(values) if np.iscomplexobj(values) else values.astype(float)
    size = np.where(size > 0, size, np.nan)
    return 20 * np.log10(size) if scale == "db" else size


def _apply_limits(panel: Panel, axis: Across, *, first: bool, alike: bool) -> tuple[Panel, Across]:
    """Apply the limits of `limited` to the axes that they are about."""
    x, y = _LIMITS.get()
    for option, given, scale in (("--x", x, axis.scale), ("--y", y, panel.scale)):
        if given and given[0] <= 0 and scale == "log" and (alike if given is x else first):
            problem = "is not on this logarithmic axis"
            fault = Fault(option, problem, "give limits above 0", format_value(given[0]))
            raise InputError([fault])
    if x and alike:
        axis = replace(axis, limits=x)
    return replace(panel, limits=y) if y and first else panel, axis


def _name_rows(axes: Axes, panel: Panel) -> None:
    """Write the names of rows left of axes, and their texts on the right."""
    if panel.rows:
        axes.set_yticks(range(len(panel.rows)), [*panel.rows])
        axes.set_ylim(len(panel.rows) - 0.5, -0.5)
        axes.tick_params(axis="y", length=0)
        axes.grid(visible=False, axis="y")
    for row, text in enumerate(panel.beside):
        look = {"fontsize": SMALL, "va": "center", "annotation_clip": False}
        place = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
        axes.annotate(text, (1, row), (4, 0), **place, **look)


def _scale_across(axes: Axes, axis: Across, group: Sequence[Panel]) -> None:
    """Scale the horizontal axis; by default to the lines of all panels that share it."""
    if axis.limits is not None:
        axes.set_xlim(*axis.limits)
    elif not any(one.rows for one in group):
        x = np.concatenate([[], *(np.ravel(line.x) for one in group for line in one.lines)])
        x = x[np.isfinite(x) & ((x > 0) | (axis.scale != "log"))]
        if len(x) and x.min() < x.max():
            axes.set_xlim(x.min(), x.max())
    if axis.scale == "signed":
        scales.label_signed(axes)
    if axis.ticks:
        axes.set_xticks([*axis.ticks], [*axis.ticks.values()])
        axes.xaxis.set_minor_formatter(NullFormatter())


def _limit_upright(axes: Axes, panel: Panel, drawn: Sequence[tuple[Array, Array]]) -> None:
    """Limit the vertical axis; beside infinite peaks to the values around them."""
    db = panel.scale == "db"
    if panel.limits is not None:
        axes.set_ylim(*panel.limits)
    elif panel.scale in ("db", "log"):
        kept = [np.zeros(0)]
        for x, y in drawn:
            size = 10 ** (y / 20) if db else y
            kept.append(size[curves.find_tops(x, size)[1]])
        limits = limit_sizes(np.concatenate(kept), panel.scale)
        if limits:
            axes.set_ylim(*limits)
    high = max(axes.get_ylim())
    for line, (x, y) in zip(panel.lines, drawn, strict=True):
        if is_dotted(line):
            _mark_outside(axes, x, y, line.colour)
        elif panel.limits is None and not panel.peaks:  # infinite peaks
            tops = 1 + np.flatnonzero((y[1:-1] > high) & (y[1:-1] >= np.maximum(y[:-2], y[2:])))
            _mark_outside(axes, x[tops], y[tops], line.colour)


def limit_sizes(size: Array, scale: Scale) -> tuple[float, float] | None:
    """Limits of an axis of magnitudes, "db" or "log", a little beyond them."""
    size = size[np.isfinite(size) & (size > 0)]
    if not len(size):
        return None
    low, high = 20 * np.log10(size.min()), 20 * np.log10(size.max())
    room = 0.04 * max(high - low, 6.0)
    low, high = float(low - room), float(high + room)
    return (low, high) if scale == "db" else (10 ** (low / 20), 10 ** (high / 20))


def _mark_outside(axes: Axes, x: Array, y: Array, colour: str) -> None:
    """Mark points beyond the vertical axis by arrows at its edges."""
    low, high = sorted(axes.get_ylim())
    for edge, beyond, mark in ((low, y < low, "v"), (high, y > high, "^")):
        own = np.full(int(beyond.sum()), edge)
        axes.plot(x[beyond], own, mark, color=colour, ms=3, clip_on=False, label="_beyond")


def _label_peaks(axes: Axes, panel: Panel, drawn: Sequence[tuple[Array, Array]]) -> None:
    """Write frequencies of peaks above, and power laws beside the lines."""
    if panel.peaks != "find":
        labels.label_peaks(axes, sorted(panel.peaks, key=lambda peak: peak[1]))
        return
    peaks, high = [], axes.get_ylim()[1]
    if len(drawn) > MANY or axes.get_xscale() != "log":
        return
    for line, (x, y) in zip(panel.lines, drawn, strict=True):
        size = 10 ** (y / 20) if panel.scale == "db" else y
        tops, _ = curves.find_tops(x, size)
        peaks += [(float(x[top]), min(float(y[top]), high), remark) for top, remark in tops]
        labels.label_slopes(axes, x, size, y, line.colour)
    labels.label_peaks(axes, peaks)


def _draw_rule(axes: Axes, one: Rule) -> None:
    """Draw a line across; the axes are extended to it, or have its text with an arrow."""
    if one.to is not None:
        draw_band = axes.axvspan if one.vertical else axes.axhspan
        draw_band(one.at, one.to, color=one.colour, alpha=0.45, linewidth=0, zorder=0.5)
        return
    axis = axes.xaxis if one.vertical else axes.yaxis
    limit = axes.set_xlim if one.vertical else axes.set_ylim
    transform = axis.get_transform()
    low, high = transform.transform(np.sort(axis.get_view_interval()))
    with np.errstate(divide="ignore", invalid="ignore"):
        at = float(transform.transform(np.array([one.at]))[0])
    room, span = 0.05 * (high - low), high - low
    fixed = _LIMITS.get()[0 if one.vertical else 1]
    if not (fixed or low <= at <= high) and low - REACH * span <= at <= high + REACH * span:
        low, high = min(low, at - room), max(high, at + room)
        limit(*transform.inverted().transform(np.array([low, high])))
    look = {"color": one.colour, "fontsize": SMALL, "textcoords": "offset points"}
    if low <= at <= high:
        draw_line = axes.axvline if one.vertical else axes.axhline
        draw_line(one.at, color=one.colour, linewidth=0.9, linestyle=one.dashes, zorder=1.7)
        if not (one.text and one.is_named):
            return
        if not one.vertical:
            place = {"xycoords": ("axes fraction", "data"), "va": "top"}
            axes.annotate(one.text, (0.01, one.at), (0, -2), **place, **look)
            return
        inch, figure = axes.figure.dpi, figure_of(axes)
        middle = axes.transData.transform((one.at, 1))[0] / inch
        half = text_width(one.text) / 2 + 0.03
        inside = min(max(middle, half), figure.get_figwidth() - half)
        place = {"xycoords": ("data", "axes fraction"), "ha": "center", "annotation_clip": False}
        axes.annotate(one.text, (one.at, 1), (72 * (inside - middle), 2), **place, **look)
    elif one.text:
        arrow = ("← " if at < low else "→ ") if one.vertical else ("↓ " if at < low else "↑ ")
        left = one.vertical and at < low
        place = {"xycoords": "axes fraction", "ha": "left" if left else "right"}
        axes.annotate(arrow + one.text, (0 if left else 1, 1), (0, 2), **place, **look)


def _write_above(figure: Figure, place: _Place) -> None:
    """Write title, remarks and samples of lines above axes."""
    across, up = figure.get_size_inches()
    for n, row in enumerate(place.words):
        y = 1 - (place.corner[1] + ROW * (n + 0.5)) / up
        for shift, text, colour, line in row:
            x = place.corner[0] + shift
            if line is not None:
                ends = np.array([x, x + SAMPLE / 2, x + SAMPLE]) / across
                look: LineLook = {"linewidth": 1.2, **line.look}
                sample = Line2D(ends, [y] * 3, color=line.colour, markevery=[1], **look)
                sample.set_solid_capstyle("butt")
                figure.add_artist(sample)
                x += SAMPLE + 0.05
            look_of_text = {"color": colour, "fontsize": SMALL, "va": "center_baseline"}
            figure.text(x / across, y, text, **look_of_text)


def write_heading(figure: Figure, quantity: str, design: str) -> None:
    """Write the quantity at the top of a figure; below it, smaller, the design and model."""
    across = figure.get_figwidth()
    write_text(figure, 0.1, 0.08, single_line(quantity, int(across / 0.084)), 9.5, bold=True)
    write_text(figure, 0.1, 0.27, single_line(design, int(across / 0.058)), 7.5, NOTE)
