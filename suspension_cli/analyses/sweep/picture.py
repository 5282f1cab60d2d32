"""Figure of a sweep: results as lines over one parameter, or as maps over two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator

from suspension_cli.analyses.sweep import sharing
from suspension_cli.analyses.sweep.sharing import Labelled
from suspension_cli.analyses.sweep.solve import SweepResult
from suspension_cli.conventions import DOFS
from suspension_cli.drawing import curves, labels, panels
from suspension_cli.drawing.panels import Across, Line, Panel, Rule, Scale
from suspension_cli.drawing.style import (
    INK,
    SMALL,
    LineLook,
    figure_of,
    format_raised,
    single_line,
    stage_colours,
)
from suspension_cli.linear import mode_content
from suspension_cli.studies.job import Axis

if TYPE_CHECKING:
    from jaxtyping import Float

MAX_MAPS = 6
"""Maps in one figure at most: the results that change most."""
LOG_RATIO = 8.0
"""Ratio of largest to smallest value above which a scale is logarithmic."""
MOVES = 0.01
"""Relative change over the grid below which a mode is grey, if others change more."""
STILL: LineLook = {"linewidth": 0.8, "zorder": 1.5}
GREY = "#b4b9be"
MEET, MIXED = 0.05, 0.05
"""Relative distance in frequency of modes that meet, and the fraction of each other's motion from
which they mix."""
MOST_CROSSINGS = 5
"""Crossings marked at most."""
PALE = 0.7
"""Place in the colour map above which contours are dark."""
FREQUENCY = "frequency (Hz)"
FAILED = {
    1: ("#ecb999", "slack"),
    2: ("#bfc4c9", "no equilibrium"),
    3: ("#eba3b4", "unstable"),
    4: ("#bfc4c9", "impossible"),
    5: ("#bfc4c9", "other coordinates"),
}
"""Shade and name of points without results, by status."""


@dataclass(frozen=True)
class Crossing:
    """Two modes that come closest at a point of a grid.

    Attributes
    ----------
    at
        Value of the parameter, SI.
    frequency
        Mean of the two, Hz.
    mixing
        Fraction of the first one's motion there that is the other's motion far away.
    """

    at: float
    frequency: float
    modes: tuple[str, str]
    mixing: float

    def __str__(self) -> str:
        """Say which modes meet, and how the first is composed where they mix."""
        first, second = self.modes
        if self.mixing <= MIXED:
            return f"{first} crosses {second}, unmixed"
        part = 100 * self.mixing
        return f"{first} and {second} mix: {100 - part:.0f} % + {part:.0f} %"


def find_crossings(swept: SweepResult) -> list[Crossing]:
    """Find where modes of a sweep over one parameter meet, most mixed first."""
    shape, rank, names = swept.shape, swept.rank, list(swept.mode or ())
    if shape is None or rank is None or len(swept.axes) != 1 or len(swept.axes[0].values) < 3:
        return []
    by_label = swept.labelled or ()  # of the same motion at all points: they do not mix
    shown = [n for n, name in enumerate(swept.result) if name in names and name not in by_label]
    found = []
    for pair in combinations(shown, 2):
        low, high = np.sort(swept.value[:, pair], axis=1).T
        with np.errstate(invalid="ignore", divide="ignore"):
            gap = np.where(np.isfinite(high / low), high / low - 1, np.inf)
        known = np.flatnonzero(np.isfinite(gap))
        n, modes = int(gap.argmin()), (swept.result[pair[0]], swept.result[pair[1]])
        if not len(known) or n in (0, len(gap) - 1, known[0], known[-1]):
            continue
        ends, numbers = known[[0, -1]], [names.index(name) for name in modes]
        far = int(ends[np.argmax(gap[ends])])
        here, pure = (shape[place][rank[place, numbers]].astype(float) for place in (n, far))
        part = (here @ pure.T) ** 2
        mixing = float((part[[0, 1], [1, 0]] / part.sum(1)).max())
        limit = MEET if mixing <= MIXED else 10 * MEET
        if gap[n] <= min(limit, gap[ends].min() / 1.3) and gap[ends].min() > MEET / 5:
            frequency = float((low[n] + high[n]) / 2)
            found.append(Crossing(swept.axes[0].values[n], frequency, modes, mixing))
    return sorted(found, key=lambda one: -one.mixing)


def draw(
    swept: SweepResult,
    title: str,
    stages: Sequence[str] = (),
    crossings: Sequence[Crossing] | None = None,
) -> Figure:
    """Draw the figure of `pendsus sweep`; `title` names the design and the model.

    Parameters after the second are kept at the grid point nearest to the nominal design.
    Crossings of modes (by default all) are marked on lines.
    """
    rest = swept.start[2:]
    value = swept.value[(slice(None), slice(None), *rest)[: len(swept.axes)]]
    kinds = dict.fromkeys("mode frequencies" if u == "Hz" else "responses" for u in swept.unit)
    heading = " and ".join(kinds).capitalize()
    if value.ndim == 2:
        heading += f" against {swept.axes[0].name.removeprefix('stage.')}"
        met = find_crossings(swept) if crossings is None else crossings
        return _draw_lines(swept, value, heading, title, stages, met)
    kept = [
        f"{axis.name} = {axis.describe(axis.values[at])}"
        for axis, at in zip(swept.axes[2:], rest, strict=True)
    ]
    chosen = sorted(np.argsort(-swept.change, kind="stable")[:MAX_MAPS].tolist())
    maps = [_map(swept, value[:, :, n], n) for n in chosen]
    columns = min(2, len(maps))
    maps += [Panel(across=Across(""), right=0.88, paint=Axes.set_axis_off)] * (len(maps) % columns)
    rows = [tuple(maps[n : n + columns]) for n in range(0, len(maps), columns)]
    heading += " over two parameters"
    touched = (one.touched for n, one in sharing.labelled(swept).items() if n in chosen)
    notes = ["dots: two modes share the motion"] * any(some.any() for some in touched)
    subtitle = " · ".join([*kept, title])
    return panels.draw(heading, subtitle, rows, notes=notes, width=0.4 + 3.1 * columns)


def _across(axis: Axis, most: int) -> Across:
    """Horizontal axis of a parameter; logarithmic if its values are geometric over a wide range."""
    x, (unit, _) = axis.displayed, axis.displayed_unit
    label = single_line(axis.name, most) + (f" ({unit})" if unit else "")
    wide = len(x) > 2 and x.min() > 0 and x.max() > LOG_RATIO * x.min()
    geometric = wide and np.allclose(x[1:] / x[:-1], x[1] / x[0], rtol=1e-6)
    ends = (x.min(), x.max()) if len(x) > 1 else None
    return Across(label, "log" if geometric else "linear", ends)


def _is_wide(values: Float[np.ndarray, "*shape"]) -> bool:
    """Whether the largest and smallest values differ by more than `LOG_RATIO`, and none is 0."""
    known = values[np.isfinite(values)]
    return bool(known.size and known.min() > 0 and known.max() > LOG_RATIO * known.min())


def _title(swept: SweepResult, n: int) -> str:
    """Name of a result: the mode, or ``test.x / support.x at 10 Hz``."""
    name = swept.result[n]
    if swept.unit[n] == "Hz":
        return name
    signals, _, frequency = name.rpartition(":")
    return f"{signals.replace('/', ' / ')} at {frequency} Hz"


def _axis_label(swept: SweepResult, n: int) -> str:
    """Label of the axis of a result; ratios of equal units are m/m or rad/rad."""
    unit = swept.unit[n]
    if unit == "1":
        angle = swept.result[n].partition("/")[0].partition("@")[0].rpartition(".")[2] in DOFS[3:]
        unit = "rad/rad" if angle else "m/m"
    return FREQUENCY if unit == "Hz" else f"magnitude ({unit})"


def _draw_lines(
    swept: SweepResult,
    value: Float[np.ndarray, "point result"],
    heading: str,
    title: str,
    stages: Sequence[str],
    crossings: Sequence[Crossing],
) -> Figure:
    first, units = swept.axes[0], [_axis_label(swept, n) for n in range(len(swept.result))]
    per = first.displayed_unit[1]
    is_mode = np.array(swept.degree) != ""
    still = is_mode & (swept.change < MOVES)
    still &= not still[is_mode].all()
    outputs = [name.partition("/")[0].partition("@")[0] for name in swept.result]
    owners = zip(swept.degree, outputs, strict=True)
    bodies = [(degree or output).rpartition(".")[0] for degree, output in owners]
    by_stage = stage_colours([*stages, *bodies])
    colours = [GREY if still[n] else by_stage[body] for n, body in enumerate(bodies)]
    dashes = panels.dashes_of(colours)
    drawn = {swept.result[n] for n in np.flatnonzero(~still)}
    marked = [one for one in crossings if {*one.modes} & drawn][:MOST_CROSSINGS]
    bands, swatches = _failed(swept)
    shares = {n: one for n, one in sharing.labelled(swept).items() if one.curves}
    shown = []
    for unit in dict.fromkeys(units):
        own = [n for n, label in enumerate(units) if label == unit]
        ends = unit == FREQUENCY and sum(~still[own]) > 1
        lines = []
        for n in sorted(own, key=lambda n: not still[n]):
            look: LineLook = STILL if still[n] else {"linestyle": dashes[n], "linewidth": 1.4}
            name = "_" if still[n] else swept.result[n] if ends else _title(swept, n)
            if n in shares:
                lines += _both_modes(swept, shares[n], colours[n])
            x, y = _broken(first.displayed, value[:, n], shares.get(n))
            lines.append(Line(x, y, name, colours[n], look))
        rules, key = list(bands), [*swatches, *(() if ends else lines)]
        if min(first.values) <= swept.drawn[0] <= max(first.values):
            text = "" if shown else f"as designed: {first.describe(swept.drawn[0])}"
            rules.append(Rule(swept.drawn[0] * per, text, vertical=True))
        paint = partial(_mark, met=marked if unit == FREQUENCY else [], per=per)
        scale: Scale = "log" if _is_wide(value[:, own]) else "linear"
        shown.append(Panel(unit, lines, 3.0, scale, key=key, ends=ends, rules=rules, paint=paint))
    notes = [f"{chr(ord('a') + n)}: {one}" for n, one in enumerate(marked)]
    if shares:
        names = " and ".join(one.name for one in shares.values())
        notes.append(f"thin: modes that share {names}, each followed by its shape")
    if still.any():
        notes.append(f"grey: modes that change by less than {100 * MOVES:g} %")
    return panels.draw(heading, title, shown, _across(first, 60), notes)


def _both_modes(swept: SweepResult, one: Labelled, colour: str) -> list[Line]:
    """Draw the modes that share a motion, each followed by its shape, thin and without a name.

    Only where the mode that has most of it has a frequency.
    """
    assert swept.rank is not None and swept.omega_squared is not None
    look: LineLook = {"linewidth": 0.7, "zorder": 1.6}
    places = (swept.rank[:, curve].astype(np.intp) for curve in one.curves)
    each = (mode_content.frequencies(swept.omega_squared, place) for place in places)
    known = np.isfinite(one.value)
    return [
        Line(swept.axes[0].displayed, np.where(known, y, np.nan), "_", colour, look) for y in each
    ]


def _broken(
    x: Float[np.ndarray, " point"], y: Float[np.ndarray, " point"], one: Labelled | None
) -> tuple[Float[np.ndarray, " more"], Float[np.ndarray, " more"]]:
    """Break a line where it passes from one mode to another: no mode is in between."""
    if one is None:
        return x, y
    after = np.flatnonzero(one.exchanges(0)) + 1
    return np.insert(x, after, x[after]), np.insert(y, after, np.nan)


def _failed(swept: SweepResult) -> tuple[list[Rule], list[Line]]:
    """Make shades of points without results, and their names."""
    x, status = swept.axes[0].displayed, np.ravel(swept.status)
    edges = np.concatenate([x[:1], (x[1:] + x[:-1]) / 2, x[-1:]])
    starts = np.flatnonzero(np.diff(status, prepend=-1)) if len(x) > 1 else np.zeros(0, dtype=int)
    bands = [
        Rule(edges[start], "", True, FAILED[int(status[start])][0], to=edges[stop])
        for start, stop in zip(starts, [*starts[1:], len(status)], strict=False)
        if status[start]
    ]
    names = [FAILED[code] for code in np.unique(status[starts]).tolist() if code]
    return bands, [Line([], [], name, colour, {"linewidth": 6}) for colour, name in names]


def _mark(axes: Axes, met: Sequence[Crossing], per: float) -> None:
    """Mark where modes meet with letters: white where they cross, black where they mix."""
    points = [(one.at * per, one.frequency) for one in met]
    for point in points:
        axes.plot(*point, "o", markersize=5, markeredgecolor=INK, markerfacecolor="none")
    looks = [("white", INK) if one.mixing > MIXED else (INK, "white") for one in met]
    letters = [chr(ord("a") + n) for n in range(len(met))]
    texts = labels.label_points(axes, points, letters, [ink for ink, _ in looks], pad=2.5)
    for text, (_, face) in zip(texts, looks, strict=True):
        text.set_path_effects([])
        text.set_bbox(
            {"boxstyle": "circle,pad=0.15", "facecolor": face, "edgecolor": INK, "lw": 0.5}
        )


def _map(swept: SweepResult, value: Float[np.ndarray, "column row"], n: int) -> Panel:
    across, up = (_across(axis, 34) for axis in swept.axes[:2])
    x, y = (axis.displayed for axis in swept.axes[:2])
    finite, wide = np.ma.masked_invalid(value.T), _is_wide(value)
    low, high = (float(finite.min()), float(finite.max())) if finite.count() else (0.0, 1.0)
    smooth = min(value.shape) > 1 and np.ptp(value) > 1e-9 * abs(high)  # not with gaps
    high = max(high, low + (abs(low) or 1.0) * 1e-9)
    one = sharing.labelled(swept).get(n)
    touched = None if one is None else one.touched[(..., *swept.start[2:])]
    norm = LogNorm(low, high) if wide else Normalize(low, high)

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
            curves.label_plainly(bar.ax.yaxis)
        here = [
            at * axis.displayed_unit[1] for axis, at in zip(swept.axes, swept.drawn, strict=True)
        ]
        if touched is not None and touched.any():
            places = np.nonzero(touched)
            axes.plot(x[places[0]], y[places[1]], ".", color="white", markersize=2.5)
        if x.min() <= here[0] <= x.max() and y.min() <= here[1] <= y.max():
            axes.plot(*here, "+", color="white", markersize=9, markeredgewidth=2.4)
            axes.plot(*here, "+", color=INK, markersize=8, markeredgewidth=1.0)

    return Panel(
        up.label, (), 2.0, up.scale, up.limits, _title(swept, n), across=across, paint=paint,
        right=0.88,
    )  # fmt: skip


def _draw_contours(axes: Axes, x: Any, y: Any, finite: np.ndarray, norm: Normalize) -> None:
    """Draw contours at about six round numbers, labelled where there is room."""
    low, high = float(norm.vmin or 0.0), float(norm.vmax or 1.0)
    digits = (1,) if high > 1e3 * low else (1, 2, 5)
    wide = isinstance(norm, LogNorm)
    locator = LogLocator(subs=digits) if wide else MaxNLocator(6, steps=[1, 2, 2.5, 5, 10])
    levels = np.asarray(locator.tick_values(low, high))
    place = np.ma.filled(norm(np.clip(levels, low, high)), 0.0)
    levels = levels[(place > 0.04) & (place < 0.96)]  # others have no room for their label
    inks = [INK if norm(level) > PALE else "white" for level in levels] or "white"
    lines = axes.contour(x, y, finite, levels=levels, colors=inks, linewidths=0.6)
    paths = [np.reshape(path.vertices, (-1, 2)) for path in lines.get_paths() if len(path)]
    middles = [(path[(len(path) - 1) // 2] + path[len(path) // 2]) / 2 for path in paths]
    write, frame = partial(format_raised, digits=4), np.reshape(axes.bbox.extents, (2, 2))
    for text in axes.clabel(lines, fontsize=SMALL, fmt=write, manual=middles):
        box = np.reshape(text.get_window_extent().extents, (2, 2))
        text.set_visible(bool((box[0] >= frame[0]).all() and (box[1] <= frame[1]).all()))
