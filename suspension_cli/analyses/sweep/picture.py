"""Figure of a sweep: results as lines over one parameter, or as maps over two."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator

from suspension_cli.analyses.sweep.crossings import Crossing
from suspension_cli.analyses.sweep.solve import SweepResult
from suspension_cli.conventions import DOFS
from suspension_cli.drawing import labels, panels, scales
from suspension_cli.drawing.panels import Across, Line, Panel, Rule, Scale
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    SMALL,
    LineLook,
    figure_of,
    format_raised,
    single_line,
    stage_colours,
    text_width,
)
from suspension_cli.studies.job import Axis

if TYPE_CHECKING:
    from jaxtyping import Float
    from matplotlib.typing import LineStyleType

MAX_MAPS = 6
"""Maps in one figure at most: the results that change most."""
LOG_RATIO = 8.0
"""Ratio of largest to smallest value above which a scale is logarithmic."""
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
PALE = 0.7
"""Place in the colour map above which contours are dark."""
FREQUENCY = "frequency (Hz)"
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
) -> Figure:
    """Draw the figure of `pendsus sweep`; `title` names the design and the model.

    Parameters after the second are kept at the grid point nearest to the nominal design.
    `crossings` are marked on lines.
    """
    rest = swept.start[2:]
    value = swept.value[(slice(None), slice(None), *rest)[: len(swept.axes)]]
    if value.ndim == 3:
        kept = [
            f"{axis.name} = {axis.describe(axis.values[at])}"
            for axis, at in zip(swept.axes[2:], rest, strict=True)
        ]
        return _draw_maps(swept, value, " · ".join([*kept, title]))
    return _draw_lines(swept, value, title, stages, crossings)


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
    return FREQUENCY if unit == "Hz" else f"magnitude ({unit})"


def _quantity(swept: SweepResult) -> str:
    kinds = dict.fromkeys("mode frequencies" if u == "Hz" else "responses" for u in swept.unit)
    return " and ".join(kinds).capitalize()


def _draw_lines(
    swept: SweepResult,
    value: Float[np.ndarray, "point result"],
    title: str,
    stages: Sequence[str],
    crossings: Sequence[Crossing],
) -> Figure:
    units = [_axis_label(swept, n) for n in range(len(swept.result))]
    first, looks = swept.axes[0], _looks(swept, stages)
    x = np.array(first.values) * first.displayed_unit[1]
    marked = [one for one in crossings if {*one.modes} & {swept.result[n] for n in looks}]
    marked, shown, remarks = marked[:MOST_CROSSINGS], [], []
    for unit in dict.fromkeys(units):
        own = [n for n, label in enumerate(units) if label == unit]
        still = [n for n in own if n not in looks]
        limits, beyond = _limits(swept, value, own, still)
        if still:
            remarks.append(f"grey: modes that change by less than {100 * MOVES:g} %")
        if beyond:
            at = ", ".join(f"{swept.nominal[n]:.3g}" for n in beyond)
            remarks[-1] += f"; not drawn of these: {at} Hz"
        grey: LineLook = {"linewidth": 0.8, "zorder": 1.5}
        lines = [Line(x, value[:, n], "_", STILL, grey) for n in still if n not in beyond]
        moving = [n for n in own if n in looks]
        ends = unit == FREQUENCY and len(moving) > 1
        for n in moving:
            name = swept.result[n] if ends else _title(swept, n)
            look: LineLook = {"linestyle": looks[n][1], "linewidth": 1.4}
            lines.append(Line(x, value[:, n], name, looks[n][0], look))
        rules, text = [], f"as designed: {first.describe(swept.drawn[0])}"
        if min(first.values) <= swept.drawn[0] <= max(first.values):
            at = swept.drawn[0] * first.displayed_unit[1]
            rules.append(Rule(at, "" if shown else text, vertical=True))
        met = [(one.at * first.displayed_unit[1], one) for one in marked if unit == FREQUENCY]
        paint = partial(_paint, swept=swept, x=x, met=met, named=not shown)
        kind: Scale = "log" if limits else "linear"
        shown.append(Panel(unit, lines, 3.0, kind, limits, ends=ends, rules=rules, paint=paint))
    notes = [f"{LETTERS[n]}: {one}" for n, one in enumerate(marked)] + remarks[:1]
    scale: Scale = "log" if _is_geometric(first.values) else "linear"
    across = Across(_parameter_label(first, 60), scale)
    heading = f"{_quantity(swept)} against {first.name.removeprefix('stage.')}"
    return panels.draw(heading, title, shown, across, notes)


def _looks(swept: SweepResult, stages: Sequence[str]) -> dict[int, tuple[str, LineStyleType]]:
    """Colour of the stage, and dashes, of the results that change."""
    modes = [n for n, home in enumerate(swept.degree) if home]
    most = max((swept.change[n] for n in modes), default=0.0)
    limit = min(MOVES, 0.3 * most)
    bodies = [_body(swept, n) for n in range(len(swept.result))]
    by_stage = stage_colours([*stages, *bodies])
    changing = [
        n for n, home in enumerate(swept.degree)
        if not home or swept.change[n] >= limit > 0 or len(modes) <= 3
    ]  # fmt: skip
    colours = [by_stage[bodies[n]] for n in changing]
    looks = zip(colours, panels.dashes_of(colours), strict=True)
    return dict(zip(changing, looks, strict=True))


def _limits(
    swept: SweepResult,
    value: Float[np.ndarray, "point result"],
    own: Sequence[int],
    still: Sequence[int],
) -> tuple[tuple[float, float] | None, list[int]]:
    """Limits of a logarithmic axis about the results that change, and which others are outside.

    None for a linear axis.
    """
    if not _is_wide(value[:, own]) or (value[:, own] == 0).all(0).any():
        return None, []
    moving = [n for n in own if n not in still]
    good = value[:, moving or own]
    good = good[np.isfinite(good) & (good > 0)]
    room = BEYOND if still else 1.1
    low, high = float(good.min() / room), float(good.max() * room)
    return (low, high), [n for n in still if not low < swept.nominal[n] < high]


def _paint(
    axes: Axes,
    swept: SweepResult,
    x: Float[np.ndarray, " point"],
    met: Sequence[tuple[float, Crossing]],
    named: bool,
) -> None:
    """Shade points without results, and mark where modes meet with letters."""
    status = np.asarray(swept.status)
    edges = np.concatenate([x[:1], (x[1:] + x[:-1]) / 2, x[-1:]])
    starts = np.flatnonzero(np.diff(status, prepend=-1)) if status.ndim == 1 and len(x) > 1 else []
    for start, stop in zip(starts, [*starts[1:], len(status)], strict=True):
        if code := int(status[start]):
            low, high = sorted((edges[start], edges[stop]))
            shade, text = FAILED[code]
            axes.axvspan(low, high, color=shade, linewidth=0, zorder=0.5)
            ends = axes.transData.transform([(low, 1), (high, 1)])[:, 0] / axes.figure.dpi
            if named:
                place = {"xycoords": ("data", "axes fraction"), "ha": "center", "va": "bottom"}
                upright = np.ptp(ends) < text_width(text) + 0.05
                box = {"facecolor": shade, "edgecolor": "none", "pad": 0.8}
                axes.annotate(
                    text, ((low + high) / 2, 0.02), **place, fontsize=SMALL, color=NOTE,
                    rotation=90 if upright else 0, bbox=box,
                )  # fmt: skip
    points = [(at, one.frequency) for at, one in met]
    for point in points:
        axes.plot(*point, "o", markersize=5, markeredgecolor=INK, markerfacecolor="none")
    inks = ["white" if one.is_avoided else INK for _, one in met]
    found = labels.label_points(axes, points, LETTERS[: len(met)], inks, pad=2.5)
    for text, ink in zip(found, inks, strict=True):
        face = INK if ink == "white" else "white"
        text.set_path_effects([])
        text.set_bbox(
            {"boxstyle": "circle,pad=0.15", "facecolor": face, "edgecolor": INK, "lw": 0.5}
        )


def _draw_maps(
    swept: SweepResult, value: Float[np.ndarray, "column row result"], title: str
) -> Figure:
    chosen = sorted(np.argsort(-swept.change, kind="stable")[:MAX_MAPS].tolist())
    maps = [_map(swept, value[:, :, n], n) for n in chosen]
    columns = min(2, len(maps))
    maps += [Panel(across=Across(""), right=0.88, paint=Axes.set_axis_off)] * (len(maps) % columns)
    rows = [tuple(maps[n : n + columns]) for n in range(0, len(maps), columns)]
    heading = f"{_quantity(swept)} over two parameters"
    return panels.draw(heading, title, rows, width=0.4 + 3.1 * columns)


def _map(swept: SweepResult, value: Float[np.ndarray, "column row"], n: int) -> Panel:
    first, second = swept.axes[:2]
    scaled: list[Scale] = [
        "log" if _is_geometric(axis.values) else "linear" for axis in (first, second)
    ]
    x, y = (np.array(axis.values) * axis.displayed_unit[1] for axis in (first, second))
    ends = [(one.min(), one.max()) if len(one) > 1 else None for one in (x, y)]
    across = Across(_parameter_label(first, 34), scaled[0], ends[0])
    finite = np.ma.masked_invalid(value.T)
    low, high = (float(finite.min()), float(finite.max())) if finite.count() else (0.0, 1.0)
    wide = _is_wide(value) and low > 0
    smooth = min(value.shape) > 1 and np.ptp(value) > 1e-9 * abs(high)  # not with gaps
    high = max(high, low + (abs(low) or 1.0) * 1e-9)
    norm = LogNorm(low, high) if wide else Normalize(low, high)
    drawn = [*zip(swept.axes, swept.drawn[:2], strict=False)]

    def paint(axes: Axes) -> None:
        axes.grid(visible=False)
        axes.set_facecolor("#eeeeee")
        how = {"shading": "gouraud" if smooth else "nearest", "rasterized": True}
        axes.pcolormesh(x, y, finite, norm=norm, cmap="viridis", **how)
        if smooth:
            _draw_contours(axes, x, y, finite, norm)
        beside = axes.inset_axes((1.03, 0.0, 0.06, 1.0))
        bar = figure_of(axes).colorbar(ScalarMappable(norm, "viridis"), cax=beside)
        bar.set_label(_axis_label(swept, n), fontsize=SMALL)
        bar.ax.tick_params(labelsize=SMALL)
        if wide:
            scales.label_plainly(bar.ax.yaxis)
        if all(min(axis.values) <= at <= max(axis.values) for axis, at in drawn):
            here = [at * axis.displayed_unit[1] for axis, at in drawn]
            axes.plot(*here, "+", color="white", markersize=9, markeredgewidth=2.4)
            axes.plot(*here, "+", color=INK, markersize=8, markeredgewidth=1.0)

    return Panel(
        _parameter_label(second, 34), (), 2.0, scaled[1], ends[1], _title(swept, n),
        across=across, paint=paint, right=0.88,
    )  # fmt: skip


def _draw_contours(
    axes: Axes,
    x: Float[np.ndarray, " column"],
    y: Float[np.ndarray, " row"],
    finite: Float[np.ndarray, "row column"],
    norm: Normalize,
) -> None:
    """Draw labelled contours at about six round numbers."""
    low, high = float(norm.vmin or 0.0), float(norm.vmax or 1.0)
    digits = (1,) if high > 1e3 * low else (1, 2, 5)
    wide = isinstance(norm, LogNorm)
    locator = LogLocator(subs=digits) if wide else MaxNLocator(6, steps=[1, 2, 2.5, 5, 10])
    found = np.asarray(locator.tick_values(low, high))
    place = np.ma.filled(norm(np.clip(found, low, high)), 0.0)
    levels = found[(place > 0.04) & (place < 0.96)]  # others have no room for their label
    inks = [INK if norm(level) > PALE else "white" for level in levels] or "white"
    lines = axes.contour(x, y, finite, levels=levels, colors=inks, linewidths=0.6)
    paths = [np.reshape(path.vertices, (-1, 2)) for path in lines.get_paths() if len(path)]
    middles = [(path[(len(path) - 1) // 2] + path[len(path) // 2]) / 2 for path in paths]
    write, frame = partial(format_raised, digits=4), np.reshape(axes.bbox.extents, (2, 2))
    for text in axes.clabel(lines, fontsize=SMALL, fmt=write, manual=middles):
        box = np.reshape(text.get_window_extent().extents, (2, 2))
        text.set_visible(bool((box[0] >= frame[0]).all() and (box[1] <= frame[1]).all()))
