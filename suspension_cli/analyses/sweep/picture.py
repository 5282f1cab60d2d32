"""Figure of a sweep: results as lines over one parameter, or as maps over two."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from suspension_cli.analyses.sweep.crossing_shapes import Shapes, Strip
from suspension_cli.analyses.sweep.crossings import Crossing
from suspension_cli.analyses.sweep.result import SweepResult
from suspension_cli.conventions import DOFS
from suspension_cli.drawing import curves
from suspension_cli.drawing.canvas import full_canvas
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    RAISED,
    LineLook,
    house_style,
    new_figure,
    single_line,
    stage_colours,
)
from suspension_cli.studies.axes import Axis

if TYPE_CHECKING:
    from jaxtyping import Float
    from matplotlib.contour import QuadContourSet
    from matplotlib.typing import LineStyleType

MAX_MAPS = 6
"""Maps in one figure at most: the results that change most."""
LOG_RATIO = 8.0
"""Ratio of largest to smallest value above which a scale is logarithmic."""
DASHES: tuple[LineStyleType, ...] = ("-", (0, (5, 1.5)), (0, (1.2, 1.3)), (0, (6, 1.4, 1.2, 1.4)))
"""Line styles of moving modes of one stage."""
MOVES = 0.01
"""Relative change over the grid from which a mode is drawn in colour."""
STILL = "#b4b9be"
"""Colour of results that do not change."""
BEYOND = 1.6
"""Factor of room around the changing modes; modes farther off are not drawn."""
MOST_CROSSINGS = 5
"""Crossings marked at most."""
LETTERS = "abcdefgh"
"""Names of crossings."""
LETTER_SHIFTS = ((0, -13), (9, -13), (-9, -13), (0, 13), (9, 13), (-9, 13), (15, -4), (-15, -4))
"""Places of a letter from its point, points, best first."""
LINE = 0.14
"""Height of a line of remarks, in."""
MOST_CHARACTERS = 76
"""Largest number of characters in a line of remarks."""
PARTS = np.array([0.5, 0.3, 0.7, 0.15, 0.85])
"""Places along a contour where its label may stand."""
CLEAR = 0.25
"""Smallest distance of the label of a contour from a mark, in."""
EDGE = 0.15
"""Smallest distance of the label of a contour from the frame, in."""
FAILED = {
    1: ("#f3d9c9", "slack"),
    2: ("#e3e3e3", "no equilibrium"),
    3: ("#f6d5dc", "unstable"),
    4: ("#e3e3e3", "impossible"),
    5: ("#e3e3e3", "other coordinates"),
}
"""Shade and name of points without results, by status."""


def draw(
    swept: SweepResult,
    title: str,
    stages: Sequence[str] = (),
    crossings: Sequence[Crossing] = (),
    shapes: Sequence[Shapes] = (),
) -> Figure:
    """Draw the figure of `pendsus sweep`; `title` names the design and the model.

    Parameters after the second are kept at the grid point nearest to the nominal design.
    `crossings` are marked on lines, and `shapes` of some are drawn below.
    """
    with house_style():
        rest = swept.start[2:]
        value = swept.value[(slice(None), slice(None), *rest)[: len(swept.axes)]]
        if value.ndim == 3:
            kept = [
                f"{axis.name} = {_with_unit(axis, axis.values[at])}"
                for axis, at in zip(swept.axes[2:], rest, strict=True)
            ]
            return _draw_maps(swept, value, " · ".join([*kept, title]))
        return _draw_lines(swept, value, title, stages, crossings, shapes)


def _is_geometric(values: Sequence[float]) -> bool:
    """Whether values are spaced geometrically over a wide range."""
    x = np.asarray(values)
    if len(x) < 3 or x.min() <= 0 or x.max() < LOG_RATIO * x.min():
        return False
    ratio = np.diff(np.log(x))
    return bool(np.allclose(ratio, ratio[0], rtol=1e-6))


def _is_wide(values: Float[np.ndarray, "*shape"]) -> bool:
    """Whether the largest and smallest positive values differ by more than `LOG_RATIO`."""
    positive = values[np.isfinite(values) & (values > 0)]
    return bool(positive.size and positive.max() > LOG_RATIO * positive.min())


def _with_unit(axis: Axis, value: float, digits: int = 4) -> str:
    unit, factor = axis.displayed_unit
    return f"{value * factor:.{digits}g} {unit}".rstrip().replace("-", "−")


def _parameter_label(axis: Axis, most: int) -> str:
    unit = axis.displayed_unit[0]
    return single_line(axis.name, most) + (f" ({unit})" if unit else "")


def _title(swept: SweepResult, n: int) -> str:
    """Name of a result: the mode, or ``test.x / support.x at 10 Hz``."""
    name = swept.result[n]
    if swept.unit[n] == "Hz":
        return name
    signals, _, frequency = name.rpartition(":")
    return f"{signals.replace('/', ' / ')} at {frequency} Hz"


def _body(swept: SweepResult, n: int) -> str:
    """Stage of a mode, or of the output of a response."""
    output = swept.degree[n] or swept.result[n].partition("/")[0].partition("@")[0]
    return output.rpartition(".")[0]


def _axis_label(swept: SweepResult, n: int) -> str:
    """Label of the axis of a result; ratios of equal units are m/m or rad/rad."""
    unit = swept.unit[n]
    if unit == "1":
        angle = swept.result[n].partition("/")[0].partition("@")[0].rpartition(".")[2] in DOFS[3:]
        unit = "rad/rad" if angle else "m/m"
    return "frequency (Hz)" if unit == "Hz" else f"magnitude ({unit})"


def _quantity(swept: SweepResult) -> str:
    kinds = dict.fromkeys("mode frequencies" if u == "Hz" else "responses" for u in swept.unit)
    return " and ".join(kinds).capitalize()


def _draw_lines(
    swept: SweepResult,
    value: Float[np.ndarray, "point result"],
    title: str,
    stages: Sequence[str],
    crossings: Sequence[Crossing],
    shapes: Sequence[Shapes],
) -> Figure:
    labels = [_axis_label(swept, n) for n in range(len(swept.result))]
    units = list(dict.fromkeys(labels))
    first = swept.axes[0]
    looks = _looks(swept, stages)
    named = [swept.result[n] for n in looks]
    at_ends = [n for n in looks if swept.unit[n] == "Hz"]
    at_ends = at_ends if len(at_ends) > 1 else []
    keys: list[list[tuple[str, str, LineLook]]] = [
        [(_title(swept, n), looks[n][0], {"linestyle": looks[n][1]}) for n in looks
         if labels[n] == unit and n not in at_ends]
        for unit in units
    ]  # fmt: skip
    right = curves.room_for([swept.result[n] for n in at_ends], 30) if at_ends else 0.15
    marked = [one for one in crossings if {*one.modes} & {*named}][:MOST_CROSSINGS]
    strips = {id(one.crossing): Strip(one, curves.COLUMN - 0.2) for one in shapes}
    height = 3.0
    below = [
        *(LINE + (strips[id(one)].height if id(one) in strips else 0.0) for one in marked),
        2 * LINE * (len(looks) < len(swept.result)),
    ]
    foot = 0.45 + sum(below) + 0.24
    rooms = [curves.key_room([name for name, *_ in key]) + 0.12 for key in keys]
    rooms[0] += 0.1
    figure, panels = curves.stack_panels([height] * len(units), rooms, right=right, bottom=foot)
    x = np.array(first.values) * first.displayed_unit[1]
    remarks = []
    for axes, unit, key in zip(panels, units, keys, strict=True):
        chosen = [n for n, own in enumerate(labels) if own == unit]
        remarks += _panel(axes, swept, value, chosen, looks, x)
        axes.set_ylabel(unit)
        if axes.get_yscale() == "linear":
            _scale(axes, unit)
        curves.write_key(axes, key, above=0.15 if axes is panels[0] else 0.0)
    ends = [(x, value[:, n], swept.result[n], looks[n][0]) for n in at_ends]
    curves.label_ends(panels[units.index("frequency (Hz)")] if ends else panels[0], ends, most=30)
    figure.align_ylabels(panels)
    _mark_failures(panels, swept, x)
    if min(first.values) <= swept.drawn[0] <= max(first.values):
        text = f"as designed: {_with_unit(first, swept.drawn[0])}"
        curves.mark_design(panels, swept.drawn[0] * first.displayed_unit[1], text)
    if marked:
        _mark_crossings(panels[units.index("frequency (Hz)")], marked, first)
    panels[-1].set_xlabel(_parameter_label(first, 60))
    lines = [f"{LETTERS[n]}: {one}" for n, one in enumerate(marked)]
    lines += textwrap.wrap(remarks[0], MOST_CHARACTERS)[:2] if remarks else []
    across, up = figure.get_size_inches()
    tops = foot - 0.43 - np.cumsum([0.0, *below[:-1], LINE])
    for top, text in zip(tops, lines, strict=False):
        figure.text(
            0.1 / across,
            top / up,
            single_line(text, MOST_CHARACTERS),
            va="top",
            fontsize=7.5,
            color=NOTE,
        )
    if strips:
        colours = {swept.result[n]: look[0] for n, look in looks.items()}
        canvas = full_canvas(figure)
        for top, one in zip(tops, marked, strict=False):
            if id(one) in strips:
                values = [_with_unit(first, point.at, 3) for point in one.around]
                ink = [colours.get(name, NOTE) for name in one.modes]
                strips[id(one)].draw(canvas, 0.1, top - LINE, ink, values)
        canvas.flush()
    heading = f"{_quantity(swept)} against {first.name.removeprefix('stage.')}"
    curves.write_heading(figure, heading, title)
    return figure


def _looks(swept: SweepResult, stages: Sequence[str]) -> dict[int, tuple[str, LineStyleType]]:
    """Colour of the stage, and dashes, of the results that change."""
    modes = [n for n, home in enumerate(swept.degree) if home]
    most = max((swept.change[n] for n in modes), default=0.0)
    limit = min(MOVES, 0.3 * most)
    bodies = [_body(swept, n) for n in range(len(swept.result))]
    colours = stage_colours([*stages, *bodies])
    used: dict[str, int] = {}
    looks: dict[int, tuple[str, LineStyleType]] = {}
    for n, home in enumerate(swept.degree):
        if home and not (swept.change[n] >= limit > 0 or len(modes) <= 3):
            continue
        colour = colours[bodies[n]]
        number = used[colour] = used.get(colour, -1) + 1
        looks[n] = colour, DASHES[number % len(DASHES)]
    return looks


def _panel(
    axes: Axes,
    swept: SweepResult,
    value: Float[np.ndarray, "point result"],
    chosen: Sequence[int],
    looks: dict[int, tuple[str, LineStyleType]],
    x: Float[np.ndarray, " point"],
) -> list[str]:
    """Draw the results of one unit; return remarks on what is grey or beyond the axes."""
    marker = "o" if len(x) == 1 else None
    if _is_geometric(swept.axes[0].values):
        axes.set_xscale("log")
        curves.label_plainly(axes.xaxis)
    moving = [n for n in chosen if n in looks]
    still = [n for n in chosen if n not in looks]
    logarithmic = _is_wide(value[:, chosen]) and not (value[:, chosen] == 0).all(0).any()
    beyond = []
    if logarithmic:
        axes.set_yscale("log", nonpositive="mask")  # lines end where they reach 0
        good = value[:, moving or chosen]
        good = good[np.isfinite(good) & (good > 0)]
        low, high = good.min() / BEYOND, good.max() * BEYOND
        if not still:
            low, high = low * BEYOND / 1.1, high / BEYOND * 1.1
        beyond = [n for n in still if not low < swept.nominal[n] < high]
        axes.set_ylim(low, high)
    for n in still:
        if n not in beyond:
            axes.plot(x, value[:, n], color=STILL, linewidth=0.8, marker=marker, zorder=1.5)
    for n in moving:
        colour, dashes = looks[n]
        axes.plot(
            x, value[:, n], color=colour, linestyle=dashes, linewidth=1.4, marker=marker,
            markersize=3, label=swept.result[n],
        )  # fmt: skip
    if len(x) > 1:
        axes.set_xlim(x.min(), x.max())
    if logarithmic:
        curves.label_plainly(axes.yaxis)
    if not still:
        return []
    text = f"grey: modes that change by less than {100 * MOVES:g} %"
    if beyond:
        at = [f"{swept.nominal[n]:.3g}" for n in beyond]
        text += f"; not drawn of these: {', '.join(at)} Hz"
    return [text]


def _scale(axes: Axes, label: str) -> None:
    """Put the power of ten of small or large values into the label of their axis."""
    top = float(np.abs(axes.get_ylim()).max())
    if 0.01 <= top < 1e4:
        return
    power = int(np.floor(np.log10(top)))
    axes.set_ylabel(label.replace("(", f"(10{str(power).translate(RAISED)} "))
    axes.yaxis.set_major_formatter(lambda y, _: f"{y / 10.0**power:.6g}".replace("-", "−"))


def _mark_failures(
    panels: Sequence[Axes], swept: SweepResult, x: Float[np.ndarray, " point"]
) -> None:
    """Shade the points without results, and name the reason above them."""
    status = np.asarray(swept.status)
    if status.ndim != 1 or len(x) < 2 or not status.any():
        return
    edges = np.concatenate([x[:1], (x[1:] + x[:-1]) / 2, x[-1:]])
    start = 0
    for n in range(1, len(status) + 1):
        if n < len(status) and status[n] == status[start]:
            continue
        if code := int(status[start]):
            low, high = sorted((edges[start], edges[n]))
            shade, text = FAILED[code]
            for axes in panels:
                axes.axvspan(low, high, color=shade, linewidth=0, zorder=0.5)
            axes, middle = panels[0], (low + high) / 2
            ends = axes.transData.transform([(low, 1), (high, 1)])[:, 0] / axes.figure.dpi
            axes.annotate(
                text,
                (middle, 0.02),
                xycoords=("data", "axes fraction"),
                ha="center",
                va="bottom",
                fontsize=7.5,
                color=NOTE,
                rotation=0 if np.ptp(ends) > curves.text_width(text) + 0.05 else 90,
                bbox={"facecolor": shade, "edgecolor": "none", "pad": 0.8},
            )
        start = n


def _mark_crossings(axes: Axes, crossings: Sequence[Crossing], first: Axis) -> None:
    """Mark where modes meet, with letters that the remarks explain."""
    axes.autoscale_view()
    points = [(one.at * first.displayed_unit[1], one.frequency) for one in crossings]
    marks = axes.transData.transform(points) * 72 / axes.figure.dpi
    taken: list[Float[np.ndarray, " 2"]] = []
    for n, (one, point) in enumerate(zip(crossings, points, strict=True)):
        others = [*np.delete(marks, n, axis=0), *taken]
        around = [marks[n] + shift for shift in LETTER_SHIFTS]
        room = [min((float(np.hypot(*(at - k))) for k in others), default=99.0) for at in around]
        best = next((k for k, free in enumerate(room) if free > 10.0), int(np.argmax(room)))
        taken.append(around[best])
        face = INK if one.is_avoided else "white"
        axes.plot(*point, "o", markersize=5, markeredgecolor=INK, markerfacecolor="none")
        axes.annotate(
            LETTERS[n],
            point,
            LETTER_SHIFTS[best],
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=7.5,
            color="white" if one.is_avoided else INK,
            bbox={"boxstyle": "circle,pad=0.15", "facecolor": face, "edgecolor": INK, "lw": 0.5},
            arrowprops={"arrowstyle": "-", "lw": 0.5, "shrinkA": 0, "shrinkB": 2.5},
        )


def _draw_maps(
    swept: SweepResult, value: Float[np.ndarray, "column row result"], title: str
) -> Figure:
    shown = sorted(np.argsort(-swept.change, kind="stable")[:MAX_MAPS].tolist())
    columns = min(2, len(shown))
    rows = -(-len(shown) // columns)
    figure = new_figure(0.4 + 3.1 * columns, 0.55 + 2.6 * rows)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in panels[len(shown) :]:
        axes.set_visible(False)
    for axes, result in zip(panels, shown, strict=False):
        _draw_map(axes, swept, value[:, :, result], result)
    curves.write_heading(figure, f"{_quantity(swept)} over two parameters", title)
    figure.tight_layout(rect=(0, 0, 1, 1 - 0.45 / figure.get_figheight()))
    return figure


def _draw_map(
    axes: Axes, swept: SweepResult, value: Float[np.ndarray, "column row"], n: int
) -> None:
    first, second = swept.axes[:2]
    x, y = (np.array(axis.values) * axis.displayed_unit[1] for axis in (first, second))
    finite = np.ma.masked_invalid(value.T)
    low, high = (float(finite.min()), float(finite.max())) if finite.count() else (0.0, 1.0)
    wide = _is_wide(value) and low > 0
    if high <= low:
        high = low + (abs(low) or 1.0) * 1e-9
    norm = LogNorm(low, high) if wide else Normalize(low, high)
    axes.set_facecolor("#eeeeee")
    lines, marks = None, []
    if min(value.shape) > 1 and finite.count() and np.ptp(finite) > 1e-9 * abs(high):
        lines = _draw_surface(axes, x, y, finite, norm)
    else:
        axes.pcolormesh(x, y, finite, norm=norm, cmap="viridis", shading="nearest", rasterized=True)
    bar = axes.figure.colorbar(ScalarMappable(norm, "viridis"), ax=axes, pad=0.02)
    bar.set_label(_axis_label(swept, n), fontsize=7.5)
    bar.ax.tick_params(labelsize=7.5)
    if wide:
        curves.label_plainly(bar.ax.yaxis)
    for axis, own in ((axes.xaxis, first), (axes.yaxis, second)):
        if _is_geometric(own.values):
            (axes.set_xscale if axis is axes.xaxis else axes.set_yscale)("log")
            curves.label_plainly(axis)
    drawn = [*zip((first, second), swept.drawn[:2], strict=True)]
    if all(min(axis.values) <= at <= max(axis.values) for axis, at in drawn):
        here = [at * axis.displayed_unit[1] for axis, at in drawn]
        marks.append(here)
        axes.plot(*here, "+", color="white", markersize=9, markeredgewidth=2.4)
        axes.plot(*here, "+", color=INK, markersize=8, markeredgewidth=1.0, label="as designed")
    axes.set_title(curves.wrap(single_line(_title(swept, n), 70), 2.4), loc="left", fontsize=7.5)
    axes.set_xlabel(_parameter_label(first, 34), fontsize=7.5)
    axes.set_ylabel(_parameter_label(second, 34), fontsize=7.5)
    if lines is not None:
        _label_contours(axes, lines, marks)


def _label_contours(axes: Axes, lines: QuadContourSet, marks: Sequence[Sequence[float]]) -> None:
    """Label contours in their middle, or away from it where a mark or the frame is near."""
    taken = axes.transData.transform(np.reshape(marks, (-1, 2)))
    inside, places = axes.bbox.padded(-EDGE * axes.figure.dpi), []
    for path in lines.get_paths():
        vertices = np.asarray(path.vertices)
        if not len(vertices):
            continue
        line = axes.transData.transform(vertices)
        place, number = PARTS * (len(line) - 1), np.arange(len(line))
        at = np.stack([np.interp(place, number, own) for own in line.T], axis=-1)
        at = at[((at > inside.min) & (at < inside.max)).all(-1)]
        room = [np.hypot(*(taken - one).T).min(initial=np.inf) / axes.figure.dpi for one in at]
        if room:
            places.append(at[next((k for k, free in enumerate(room) if free > CLEAR), 0)])
    where = axes.transData.inverted().transform(np.reshape(places, (-1, 2)))
    axes.clabel(lines, fontsize=7.5, fmt=curves.write_plainly, manual=where.tolist())


def _draw_surface(
    axes: Axes,
    x: Float[np.ndarray, " column"],
    y: Float[np.ndarray, " row"],
    finite: Float[np.ndarray, "row column"],
    norm: Normalize,
) -> QuadContourSet:
    """Draw smooth colours, and contours, which are returned."""
    low, high = float(norm.vmin or 0.0), float(norm.vmax or 1.0)
    spaced = np.geomspace if isinstance(norm, LogNorm) else np.linspace
    levels = spaced(low, high, 48)
    levels[0], levels[-1] = low, high
    drawn = axes.contourf(x, y, finite, levels=levels, norm=norm, cmap="viridis", extend="both")
    drawn.set_rasterized(True)
    drawn.set_edgecolor("face")
    return axes.contour(
        x, y, finite, levels=_round_levels(low, high, norm), colors="white", linewidths=0.6
    )


def _round_levels(
    low: float, high: float, norm: Normalize
) -> Float[np.ndarray, " level"] | list[float]:
    """Round numbers between the limits, about six."""
    from matplotlib.ticker import LogLocator, MaxNLocator

    if isinstance(norm, LogNorm):
        many = np.log10(high / low) > 3
        levels = LogLocator(subs=(1,) if many else (1, 2, 5)).tick_values(low, high)
    else:
        levels = MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
    found = np.asarray(levels)
    inside = found[(found > low) & (found < high)]
    return inside if len(inside) else [(low + high) / 2]
