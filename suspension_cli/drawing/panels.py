"""Pictures as data: panels of lines, which one function lays out, draws and labels."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from suspension_cli.drawing import curves, labels
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
    write_heading,
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
"""Room for the heading at the top, in."""
FOOT = 0.16
"""Room for the remark on the model at the bottom, in."""
LEFT = 0.75
"""Margin left of panels with numbers, in."""
GAP = 0.16
"""Distance between panels, in."""
ROW = 0.15
"""Height of a line of text above panels and of notes, in."""
ITEM = 0.17
"""Height of a row of a panel of rows, in."""
PEAKS = 0.25
"""Room above axes for the frequencies of peaks, in."""
RULES = 0.14
"""Room above axes for the texts of rules, in."""
SAMPLE = 0.22
"""Length of the sample of a line beside its name, in."""
APART = 0.15
"""Distance from a name to the next sample, in."""
PHASE = 1.1
"""Height of a panel of phases, in."""
ZERO = "0 by symmetry at all frequencies"
"""Remark in a panel whose curves all vanish."""
MANY = 12
"""Number of curves above which peaks have no labels."""
REACH = 1.5
"""Distance of a rule beyond the axes up to which these are extended, relative to their length."""
DASHES: tuple[LineStyleType, ...] = ("-", (0, (5, 1.5)), (0, (1.2, 1.2)), (0, (5, 1.4, 1.2, 1.4)))
"""Line styles, so that lines that cover each other are seen."""
PALE_SUM = 2.2
"""Sum of red, green and blue above which a colour is too pale for text."""
ERROR = "#9aa1a8"
"""Colour of error bars."""
Limits = tuple[float, float] | None
_WIDTH = ContextVar("_WIDTH", default=COLUMN)
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

    @property
    def is_dotted(self) -> bool:
        """Whether it is drawn as points."""
        return self.look.get("linestyle") == "none"


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

    With another end `to`, it is a band without text. `is_named`: the text is shown also where the
    line is, not only where it is outside; that of a horizontal line is `at_right` or left.
    """

    at: float
    text: str = ""
    vertical: bool = False
    colour: str = INK
    dashes: LineStyleType = (0, (4, 2))
    is_named: bool = True
    to: float | None = None
    at_right: bool = False


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Attributes
    ----------
    label, scale, limits
        Of the vertical axis: "db" is 20 log10 of the size, "phase" the angle in degrees; limits are
        by default those of the lines, without infinite peaks.
    title, remarks, key
        Texts above, and samples of lines, by default of those with names.
    ends
        Whether the names of the lines are at their ends instead.
    peaks
        Frequency, ordinate and remark of peaks to label, or "find" for those of the lines.
    across
        Own horizontal axis; None for that of the next panel below which has one.
    rows, beside
        Names of rows, from the top down, instead of a vertical axis; their texts on the right.
    paint, empty
        Draws what is no line, on axes that have their limits; words in a panel without lines.
    left, right, above, width
        Margins, in, by default what labels need; width relative to the panels beside it.
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

    @property
    def room(self) -> float:
        """Height of texts of peaks or rules directly above the axes, in."""
        texts = any(one.text and (one.vertical or not one.is_named) for one in self.rules)
        return self.above + (PEAKS if self.peaks else RULES * texts)

    def words(self, width: float) -> list[list[tuple[float, str, str, Line | None]]]:
        """Rows of title, remarks, and names of lines; names end at the axes, `width` in long.

        Each text has its distance from the left, in, its colour, and the line of its sample.
        """
        texts = [(self.title, INK)] * bool(self.title) + [(text, NOTE) for text in self.remarks]
        rows: list[list[tuple[float, str, str, Line | None]]] = [
            [(0.0, part, colour, None)]
            for text, colour in texts
            for part in labels.wrap(text, width - 0.05)
        ]
        left = np.inf
        for line in self.samples:
            name = single_line(line.name, 60)
            wide = SAMPLE + 0.05 + text_width(name)
            if left + wide > width - self.margins[1]:
                rows.append([])
                left = 0.0
            pale = sum(to_rgb(line.colour)) > PALE_SUM
            rows[-1].append((left, name, INK if pale else line.colour, line))
            left += wide + APART
        return rows


def named(line: Line) -> bool:
    """Whether the name of a line is shown."""
    return not line.name.startswith("_")


def stems(start: ArrayLike, end: ArrayLike, colour: str, width: float = 0.8) -> list[Line]:
    """Make lines of a width in points along rows, from the start to the end of each."""
    ends = np.stack(np.broadcast_arrays(start, end), axis=1)
    look: LineLook = {"linewidth": width, "zorder": 1.5, "solid_capstyle": "butt"}
    return [Line(pair, [row, row], "_", colour, look) for row, pair in enumerate(ends)]


def dashes_of(colours: Sequence[str]) -> list[LineStyleType]:
    """Choose dashes by which lines of one colour differ."""
    return [DASHES[colours[:n].count(own) % len(DASHES)] for n, own in enumerate(colours)]


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

    The heading is in bold, the subtitle (design and model) below it, notes at the bottom. `across`
    is the horizontal axis of the last panel, if it has none of its own. The width, in, is by
    default that of a column, or of `page_width`.
    """
    width = width or _WIDTH.get()
    rows = [row if isinstance(row, tuple) else (row,) for row in panels]
    last = len(rows) - 1
    owner = [
        next(m for m in range(n, len(rows)) if m == last or rows[m][0].across)
        for n in range(len(rows))
    ]
    with house_style():
        places = [_place(row, width) for row in rows]
        tops = []
        end = HEAD
        for n, row in enumerate(rows):
            above = [ROW * len(one.words(room)) + one.room for one, *_, room in places[n]]
            tops.append(end + GAP + max(above))
            end = tops[-1] + max(one.height for one in row)
            if owner[n] == n:
                end += max(_height_below(one.across or across) for one in row)
        lines = [part for note in notes for part in labels.wrap(note, width - 0.2)]
        figure = new_figure(width, end + ROW * len(lines) + 0.05 * bool(lines) + FOOT)
        for n, line in enumerate(lines):
            write_text(figure, 0.1, end + 0.02 + ROW * n, line, SMALL, NOTE)
        write_heading(figure, heading, subtitle)
        first: dict[int, Axes] = {}
        for n, row in enumerate(rows):
            group = [one for m, one in enumerate(rows) if owner[m] == owner[n]]
            for k, (panel, start, wide, begin, room) in enumerate(places[n]):
                left, right = panel.margins
                leader = first.get(owner[n]) if len(row) == 1 else None
                box = start + left, tops[n], wide - left - right, panel.height
                axes = add_axes(figure, *box, sharex=leader)
                first.setdefault(owner[n], axes)
                axes.tick_params(which="both", labelbottom=owner[n] == n)
                axis = rows[owner[n]][min(k, len(rows[owner[n]]) - 1)].across or across
                alike = axis.label == (rows[owner[0]][0].across or across).label
                shown, axis = _apply_limits(panel, axis, first=n == k == 0, alike=alike)
                beside = [one[k] for one in group if k < len(one)]
                _draw_panel(axes, shown, axis, beside, is_lowest=owner[n] == n)
                _write_above(figure, panel, tops[n], begin, room)
        figure.align_ylabels([axes for axes in figure.axes if axes.get_ylabel()])
        return figure


def _place(row: Sequence[Panel], width: float) -> list[tuple[Panel, float, float, float, float]]:
    """Panels side by side: left end and width of each, and of the words above it, in.

    Words reach as far as the figure, if there are none further right.
    """
    wide = np.array([one.width for one in row]) * width / sum(one.width for one in row)
    ends = wide.cumsum()
    spoken = [bool(one.title or one.remarks or one.samples) for one in row]
    result = []
    for k, one in enumerate(row):
        start = float(ends[k] - wide[k])
        end = float(ends[k])
        begin = start + (0.1 if one.rows or one.left else one.margins[0])
        room = (end if any(spoken[k + 1 :]) else width) - begin
        result.append((one, start, end - start, begin, room))
    return result


def _height_below(axis: Across) -> float:
    """Height of the labels below axes, in."""
    return 0.27 + 0.15 * (axis.label.count("\n") + 1) if axis.label else 0.24


def _write_above(figure: Figure, panel: Panel, top: float, left: float, width: float) -> None:
    """Write title, remarks and samples of lines above axes, from `left` on, in."""
    across, up = figure.get_size_inches()
    rows = panel.words(width)
    for n, row in enumerate(rows):
        y = 1 - (top - panel.room - 0.03 - ROW * (len(rows) - n - 0.5)) / up
        for shift, text, colour, line in row:
            x = left + shift
            if line is not None:
                ends = np.array([x, x + SAMPLE / 2, x + SAMPLE]) / across
                look: LineLook = {"linewidth": 1.2, **line.look}
                sample = Line2D(ends, [y] * 3, color=line.colour, markevery=[1], **look)
                sample.set_solid_capstyle("butt")
                figure.add_artist(sample)
                x += SAMPLE + 0.05
            words = {"color": colour, "fontsize": SMALL, "va": "center_baseline"}
            figure.text(x / across, y, text, **words)


def _apply_limits(panel: Panel, axis: Across, *, first: bool, alike: bool) -> tuple[Panel, Across]:
    """Apply the limits of `limited` to the axes that they are about."""
    x, y = _LIMITS.get()
    if not alike:
        x = None
    if not first:
        y = None
    for option, given, scale in (("--x", x, axis.scale), ("--y", y, panel.scale)):
        if given and given[0] <= 0 and scale == "log":
            problem = "is not on this logarithmic axis"
            fault = Fault(option, problem, "give limits above 0", format_value(given[0]))
            raise InputError([fault])
    return replace(panel, limits=y or panel.limits), replace(axis, limits=x or axis.limits)


def _draw_panel(
    axes: Axes, panel: Panel, axis: Across, group: Sequence[Panel], *, is_lowest: bool
) -> None:
    """Draw a panel; `group` are all with this horizontal axis, the lowest of which labels it."""
    curves.rule(axes)
    if axis.scale == "log":
        curves.label_plainly(axes.xaxis)
    if panel.scale == "log":
        curves.label_plainly(axes.yaxis)
    drawn = [_draw_line(axes, line, panel.scale) for line in panel.lines]
    _name_rows(axes, panel)
    _scale_across(axes, axis, group)
    _limit_upright(axes, panel, drawn)
    if panel.paint:
        panel.paint(axes)
    for one in panel.rules:
        _draw_rule(axes, one)
    _label_axes(axes, panel, axis, is_lowest=is_lowest)
    if panel.ends:
        pairs = zip(drawn, panel.lines, strict=True)
        ends = [(*points, one.name, one.colour) for points, one in pairs if named(one)]
        labels.label_ends(axes, ends, most=30)
    if panel.empty and not any(np.isfinite(y).any() for _, y in drawn):
        axes.set_yticks([])
        look: Any = {"ha": "center", "va": "center", "bbox": {"color": "white"}, "color": NOTE}
        axes.text(0.5, 0.5, panel.empty, transform=axes.transAxes, **look)
    elif panel.peaks == "find":
        _find_peaks(axes, panel, drawn)
    elif panel.peaks:
        labels.label_peaks(axes, sorted(panel.peaks, key=lambda peak: peak[1]))


def _label_axes(axes: Axes, panel: Panel, axis: Across, *, is_lowest: bool) -> None:
    """Label the axes and their ticks; they have their limits."""
    axes.set_ylabel(panel.label)
    if is_lowest:
        axes.set_xlabel(axis.label)
    if axis.scale == "linear" and not axis.ticks:
        labels.thin_ticks(axes.xaxis)
    if panel.scale == "phase":
        curves.label_phases(axes, panel.limits)
    if panel.scale == "linear" and "(" in panel.label:
        curves.raise_power(axes.yaxis)


def _draw_line(axes: Axes, line: Line, scale: Scale) -> tuple[Array, Array]:
    """Draw one line; return its abscissas and ordinates."""
    x = np.asarray(line.x, dtype=float)
    y = np.asarray(line.y)
    look: LineLook = {"linewidth": 1.0, **line.look}
    if len(x) == 1 and "marker" not in look:
        look |= {"marker": "o", "markersize": 3}
    if line.error is not None:
        low, high = (curves.ordinates(np.asarray(end), scale) for end in line.error)
        if scale == "phase":  # an error of the size is one of the angle
            off = np.degrees(np.abs(np.asarray(line.error[1]) - y) / np.abs(y))
            low = low - off
            high = high + off
        axes.vlines(x, low, high, color=ERROR, linewidth=0.6, zorder=1.5)
    if scale == "phase" and np.iscomplexobj(y) and not line.is_dotted:
        x, y = curves.phase_line(x, y)
    else:
        y = curves.ordinates(y, scale)
    axes.plot(x, y, color=line.colour, label=line.name, **look)
    return x, y


def _name_rows(axes: Axes, panel: Panel) -> None:
    """Write the names of rows left of axes, and their texts on the right."""
    if panel.rows:
        axes.set_yticks(range(len(panel.rows)), [*panel.rows])
        axes.set_ylim(len(panel.rows) - 0.5, -0.5)
        axes.tick_params(axis="y", length=0)
        axes.grid(visible=False, axis="y")
    look: Any = {"fontsize": SMALL, "va": "center", "annotation_clip": False}
    look |= {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
    for row, text in enumerate(panel.beside):
        axes.annotate(text, (1, row), (4, 0), **look)


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
        curves.label_signed(axes)
    if axis.ticks:
        axes.set_xticks([*axis.ticks], [*axis.ticks.values()])
        axes.xaxis.set_minor_formatter(NullFormatter())


def _limit_upright(axes: Axes, panel: Panel, drawn: Sequence[tuple[Array, Array]]) -> None:
    """Limit the vertical axis, beside infinite peaks to the values around them; mark what is out.

    Arrows at the edges mark points and infinite peaks beyond.
    """
    limits = panel.limits
    if limits is None and panel.scale in ("db", "log"):
        sizes = [(x, 10 ** (y / 20) if panel.scale == "db" else y) for x, y in drawn]
        kept = [size[curves.find_tops(x, size)[1]] for x, size in sizes]
        limits = curves.limit_sizes(np.concatenate([np.zeros(0), *kept]), panel.scale)
    if limits is not None:
        axes.set_ylim(*limits)
    low, high = sorted(axes.get_ylim())
    for line, (x, y) in zip(panel.lines, drawn, strict=True):
        below = np.zeros(len(y), dtype=bool)
        above = y > high
        if line.is_dotted:
            below = y < low
        elif panel.limits is None and not panel.peaks:
            above[1:-1] &= y[1:-1] >= np.maximum(y[:-2], y[2:])
            above[[0, -1] if len(y) else []] = False
        else:
            continue
        for edge, beyond, mark in ((low, below, "v"), (high, above, "^")):
            look: Any = {"color": line.colour, "ms": 3, "clip_on": False, "label": "_beyond"}
            axes.plot(x[beyond], np.full(int(beyond.sum()), edge), mark, **look)


def _find_peaks(axes: Axes, panel: Panel, drawn: Sequence[tuple[Array, Array]]) -> None:
    """Write the frequencies of the peaks of lines above."""
    if len(drawn) > MANY or axes.get_xscale() != "log":
        return
    peaks = []
    high = axes.get_ylim()[1]
    for x, y in drawn:
        size = 10 ** (y / 20) if panel.scale == "db" else y
        tops, _ = curves.find_tops(x, size)
        peaks += [(float(x[top]), min(float(y[top]), high), remark) for top, remark in tops]
    labels.label_peaks(axes, peaks)


def _draw_rule(axes: Axes, one: Rule) -> None:
    """Draw a line across; the axes are extended to it, or have its text with an arrow."""
    if one.to is not None:
        draw_band = axes.axvspan if one.vertical else axes.axhspan
        draw_band(one.at, one.to, color=one.colour, alpha=0.45, linewidth=0, zorder=0.5)
        return
    axis = axes.xaxis if one.vertical else axes.yaxis
    transform = axis.get_transform()
    low, high = transform.transform(np.sort(axis.get_view_interval()))
    with np.errstate(divide="ignore", invalid="ignore"):
        at = float(transform.transform(np.array([one.at]))[0])
    room = 0.05 * (high - low)
    span = high - low
    fixed = _LIMITS.get()[0 if one.vertical else 1]
    if not (fixed or low <= at <= high) and low - REACH * span <= at <= high + REACH * span:
        low = min(low, at - room)
        high = max(high, at + room)
        limit = axes.set_xlim if one.vertical else axes.set_ylim
        limit(*transform.inverted().transform(np.array([low, high])))
    look: Any = {"color": one.colour, "fontsize": SMALL, "textcoords": "offset points"}
    if not low <= at <= high:
        below = at < low
        towards_low, towards_high = ("← ", "→ ") if one.vertical else ("↓ ", "↑ ")
        arrow = towards_low if below else towards_high
        left = one.vertical and below
        look |= {"xycoords": "axes fraction", "ha": "left" if left else "right"}
        axes.annotate(arrow + one.text if one.text else "", (0 if left else 1, 1), (0, 2), **look)
        return
    draw_line = axes.axvline if one.vertical else axes.axhline
    draw_line(one.at, color=one.colour, linewidth=0.9, linestyle=one.dashes, zorder=1.7)
    if one.is_named and one.text and one.vertical:  # within the figure
        middle = axes.transData.transform((one.at, 1))[0] / axes.figure.dpi
        half = text_width(one.text) / 2 + 0.03
        shift = min(max(middle, half), figure_of(axes).get_figwidth() - half) - middle
        look |= {"xycoords": ("data", "axes fraction"), "ha": "center", "annotation_clip": False}
        axes.annotate(one.text, (one.at, 1), (72 * shift, 2), **look)
    elif one.is_named and one.text:
        look |= {"xycoords": ("axes fraction", "data"), "va": "top"}
        look["ha"] = "right" if one.at_right else "left"
        axes.annotate(one.text, (0.99 if one.at_right else 0.01, one.at), (0, -2), **look)
