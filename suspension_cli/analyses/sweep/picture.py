"""Figure of a sweep: results as lines over one parameter, or as maps over two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator

from suspension_cli.analyses.sweep import sharing
from suspension_cli.analyses.sweep.sharing import Labelled
from suspension_cli.analyses.sweep.solve import Sweep
from suspension_cli.conventions import DOFS
from suspension_cli.drawing import curves, labels, panels
from suspension_cli.drawing.panels import Across, Line, Panel, Rule, Scale
from suspension_cli.drawing.style import (
    INK,
    RED,
    SMALL,
    LineLook,
    figure_of,
    format_raised,
    single_line,
    stage_colours,
    write_unit,
)
from suspension_cli.linear import mode_content
from suspension_cli.studies.job import Axis

if TYPE_CHECKING:
    from jaxtyping import Bool, Float
    from matplotlib.typing import LineStyleType

MAX_MAPS = 6
"""Maps in one figure at most: the results that change most."""
MOST_MAPPED = 400
"""Values of each parameter in a map at most, evenly thinned out: about its pixels."""
MOST_BLENDED = 200
"""Values of each parameter up to which colours are blended between points: more points need none,
as they are as many as pixels, and 400 by 400 of them would take 200 MB."""
LOG_RATIO = 8.0
"""Ratio of largest to smallest value above which a scale is logarithmic."""
MOVES = 0.01
"""Relative change over the grid below which a mode is grey, if others change more."""
STILL: LineLook = {"linewidth": 0.8, "zorder": 1.5}
GREY = "#b4b9be"
MEET = 0.05
"""Relative distance in frequency of modes that meet."""
MIXED = 0.05
"""Fraction of each other's motion from which modes mix."""
MOST_CROSSINGS = 5
"""Crossings marked at most."""
PALE = 0.7
"""Place in the colour map above which contours are dark."""
FREQUENCY = "frequency (Hz)"
HIGH = 3.0
"""Height of up to three panels of lines, in."""
LOW = 1.8
"""Height of each of more panels."""
LIMIT = (0, (6, 2))
"""Dashes of limits of requirements."""
TEXT = 0.25
"""Fraction of the width that their texts may take."""
FAR = 10.0
"""Margin up to which margins are told apart, where those of a map are drawn."""
WORDS = {
    "N": "force",
    "Pa": "stress",
    "m": "length",
    "rad": "angle",
    "s": "time",
    "1/s": "decay rate",
    "dB": "gain margin",
    "deg": "phase margin",
}
"""What several quantities of one unit are, on their common axis."""
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


def find_crossings(swept: Sweep) -> list[Crossing]:
    """Find where modes of a sweep over one parameter meet, most mixed first."""
    shape = swept.shape
    rank = swept.rank
    names = list(swept.mode or ())
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
        closest = int(gap.argmin())
        if not len(known) or closest in (0, len(gap) - 1, known[0], known[-1]):
            continue
        modes = (swept.result[pair[0]], swept.result[pair[1]])
        numbers = [names.index(name) for name in modes]
        ends = known[[0, -1]]
        far = int(ends[np.argmax(gap[ends])])
        here, pure = (shape[place][rank[place, numbers]].astype(float) for place in (closest, far))
        part = (here @ pure.T) ** 2
        mixing = float((part[[0, 1], [1, 0]] / part.sum(1)).max())
        limit = MEET if mixing <= MIXED else 10 * MEET
        meet = gap[closest] <= min(limit, gap[ends].min() / 1.3)
        if meet and gap[ends].min() > MEET / 5:
            frequency = float((low[closest] + high[closest]) / 2)
            found.append(Crossing(swept.axes[0].values[closest], frequency, modes, mixing))
    return sorted(found, key=lambda one: -one.mixing)


def draw(
    swept: Sweep,
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
    shown = np.isfinite(value)
    if value.ndim == 2 and (swept.status == 0).any():  # no lines through what is shaded
        shown &= (swept.status == 0)[(slice(None), *rest)][:, None]
    value = np.where(shown, value, np.nan)
    heading = _heading(swept)
    if value.ndim == 2:
        heading += f" against {swept.axes[0].name.removeprefix('stage.')}"
        met = find_crossings(swept) if crossings is None else crossings
        return _draw_lines(swept, value, heading, title, stages, met)
    kept = [
        f"{axis.name} = {axis.describe(axis.values[at])}"
        for axis, at in zip(swept.axes[2:], rest, strict=True)
    ]
    chosen = sorted(np.argsort(-swept.change, kind="stable")[:MAX_MAPS].tolist())
    shares = sharing.labelled(swept)
    maps = [_map(swept, value[:, :, n], n, shares.get(n)) for n in chosen]
    columns = min(2, len(maps))
    maps += [Panel(across=Across(""), right=0.88, paint=Axes.set_axis_off)] * (len(maps) % columns)
    rows = [tuple(maps[n : n + columns]) for n in range(0, len(maps), columns)]
    heading += " over two parameters"
    notes = []
    if any(one.touched.any() for n, one in shares.items() if n in chosen):
        notes.append("dots: two modes share the motion")
    notes += _name_requirements(swept)
    subtitle = " · ".join([*kept, title])
    return panels.draw(heading, subtitle, rows, notes=notes, width=0.4 + 3.1 * columns)


def _heading(swept: Sweep) -> str:
    """What the picture is about: the kinds of results, or the only one."""
    others = [
        n
        for n in range(len(swept.result))
        if not (_is_frequency(swept, n) or _is_response(swept, n))
    ]
    if len(swept.result) == len(others) == 1:
        [name] = swept.result
        return name[0].upper() + name[1:]
    if others:
        return "Quantities"
    frequencies = [_is_frequency(swept, n) for n in range(len(swept.result))]
    kinds = {True: "mode frequencies", False: "responses"}
    return " and ".join(dict.fromkeys(kinds[one] for one in frequencies)).capitalize()


def _name_requirements(swept: Sweep) -> list[str]:
    """Say what the zero line and the shade of maps mean."""
    if swept.required is None:
        return []
    names = write_unit("; ".join(swept.required))
    return [f"pale: not met, red line: just met: {names}"]


def _across(axis: Axis, most: int) -> Across:
    """Horizontal axis of a parameter; logarithmic if its values are geometric over a wide range."""
    x = axis.displayed
    unit, _ = axis.displayed_unit
    label = single_line(axis.name, most) + (f" ({unit})" if unit else "")
    wide = len(x) > 2 and x.min() > 0 and x.max() > LOG_RATIO * x.min()
    geometric = wide and np.allclose(x[1:] / x[:-1], x[1] / x[0], rtol=1e-6)
    ends = (x.min(), x.max()) if len(x) > 1 else None
    return Across(label, "log" if geometric else "linear", ends)


def _is_wide(values: Float[np.ndarray, "*shape"]) -> bool:
    """Whether the largest and smallest values differ by more than `LOG_RATIO`, and none is 0."""
    known = values[np.isfinite(values)]
    return bool(known.size and known.min() > 0 and known.max() > LOG_RATIO * known.min())


def _is_frequency(swept: Sweep, n: int) -> bool:
    """Whether a result is a frequency."""
    return swept.unit[n] == "Hz"


def _is_response(swept: Sweep, n: int) -> bool:
    """Whether a result is the magnitude of a response at a frequency, or of a ratio of two."""
    before, slash, _ = swept.result[n].partition("/")
    return bool(slash) and " " not in before


def _title(swept: Sweep, n: int) -> str:
    """Name of a result; of a response ``test.x / support.x at 10 Hz``."""
    name = swept.result[n]
    if not _is_response(swept, n):
        return name
    signals, _, frequency = name.rpartition(":")
    return f"{signals.replace('/', ' / ')} at {frequency} Hz"


def _unit_label(swept: Sweep, n: int) -> str:
    """Unit of a result as axes have it; ratios of equal units are m/m or rad/rad, others none."""
    unit = write_unit(swept.unit[n])
    if unit:
        return unit
    if not _is_response(swept, n):
        return ""
    output = swept.result[n].partition("/")[0].partition("@")[0]
    return "rad/rad" if output.rpartition(".")[2] in DOFS[3:] else "m/m"


def _axis_label(swept: Sweep, n: int) -> str:
    """Label of the axis that a result shares with others of its unit."""
    if _is_frequency(swept, n):
        return FREQUENCY
    unit = _unit_label(swept, n)
    if _is_response(swept, n):
        return f"magnitude ({unit})"
    word = "noise" if "√Hz" in unit else WORDS.get(unit, "value")
    return f"{word} ({unit})" if unit else word


def _own_label(swept: Sweep, n: int) -> str:
    """Label of an axis that a result has for itself."""
    if _is_frequency(swept, n) or _is_response(swept, n):
        return _axis_label(swept, n)
    unit = _unit_label(swept, n)
    name = single_line(swept.result[n], 34)
    return f"{name} ({unit})" if unit else name


def _body(swept: Sweep, n: int, stages: Sequence[str]) -> str:
    """Stage that a result is about; "" if its name has none."""
    if swept.degree[n]:
        return swept.degree[n].rpartition(".")[0]
    output = swept.result[n].partition("/")[0].partition("@")[0]
    words = output.replace(".", " ").split()
    named = next((stage for stage in stages if stage in words), "")
    return named or output.rpartition(".")[0]


def _draw_lines(
    swept: Sweep,
    value: Float[np.ndarray, "point result"],
    heading: str,
    title: str,
    stages: Sequence[str],
    crossings: Sequence[Crossing],
) -> Figure:
    first = swept.axes[0]
    looks = _Looks.of(swept, stages)
    shown_results = {swept.result[n] for n in np.flatnonzero(~looks.still)}
    marked = [one for one in crossings if {*one.modes} & shown_results][:MOST_CROSSINGS]
    shares = {n: one for n, one in sharing.labelled(swept).items() if one.curves}
    labels_of_axes = [_axis_label(swept, n) for n in range(len(swept.result))]
    shown: list[Panel] = []
    distinct = dict.fromkeys(labels_of_axes)
    height = HIGH if len(distinct) <= 3 else LOW
    for label in distinct:
        own = [n for n, one in enumerate(labels_of_axes) if one == label]
        met = marked if label == FREQUENCY else []
        panel = _line_panel(swept, value, own, looks, shares, met, is_first=not shown)
        shown.append(replace(panel, height=height))
    notes = [f"{chr(ord('a') + n)}: {one}" for n, one in enumerate(marked)]
    if shares:
        names = " and ".join(one.name for one in shares.values())
        notes.append(f"thin: modes that share {names}, each followed by its shape")
    if looks.still.any():
        notes.append(f"grey: modes that change by less than {100 * MOVES:g} %")
    return panels.draw(heading, title, shown, _across(first, 60), notes)


@dataclass(frozen=True)
class _Looks:
    """Colours and dashes of the results; those that hardly change are grey."""

    still: Bool[np.ndarray, " result"]
    colours: list[str]
    dashes: list[LineStyleType]

    @staticmethod
    def of(swept: Sweep, stages: Sequence[str]) -> _Looks:
        is_mode = np.array(swept.degree) != ""
        still = is_mode & (swept.change < MOVES)
        still &= not still[is_mode].all()
        bodies = [_body(swept, n, stages) for n in range(len(swept.result))]
        by_stage = stage_colours([*stages, *bodies])
        colours = [GREY if still[n] else by_stage[body] for n, body in enumerate(bodies)]
        return _Looks(still, colours, panels.dashes_of(colours))


def _line_panel(
    swept: Sweep,
    value: Float[np.ndarray, "point result"],
    own: list[int],
    looks: _Looks,
    shares: dict[int, Labelled],
    met: Sequence[Crossing],
    *,
    is_first: bool,
) -> Panel:
    """Draw results of one unit, by number, as lines over the parameter."""
    first = swept.axes[0]
    per = first.displayed_unit[1]
    still = looks.still
    label = _axis_label(swept, own[0]) if len(own) > 1 else _own_label(swept, own[0])
    ends = label == FREQUENCY and sum(~still[own]) > 1
    lines = []
    for n in sorted(own, key=lambda n: not still[n]):
        look: LineLook = {"linestyle": looks.dashes[n], "linewidth": 1.4}
        name = swept.result[n] if ends else _title(swept, n)
        if still[n]:
            look = STILL
            name = "_"
        elif label.startswith(single_line(swept.result[n], 34)):
            name = "_"
        if n in shares:
            lines += _both_modes(swept, shares[n], looks.colours[n])
        x, y = _broken(first.displayed, value[:, n], shares.get(n))
        lines.append(Line(x, y, name, looks.colours[n], look))
    bands, swatches = _failed(swept)
    rules = [*bands, *_limits(swept, own)]
    if min(first.values) <= swept.drawn[0] <= max(first.values):
        text = f"as designed: {first.describe(swept.drawn[0])}" if is_first else ""
        rules.append(Rule(swept.drawn[0] * per, text, vertical=True))
    key = [*swatches, *(() if ends else lines)]
    paint = partial(_mark, met=met, per=per)
    scale: Scale = "log" if _is_wide(value[:, own]) else "linear"
    return Panel(label, lines, HIGH, scale, key=key, ends=ends, rules=rules, paint=paint)


def _limits(swept: Sweep, own: list[int]) -> list[Rule]:
    """Limit lines of the requirements on some results, by number."""
    names = [swept.result[n] for n in own]
    if swept.required_quantity is None or swept.at_least is None or swept.at_most is None:
        return []
    found = []
    for n, name in enumerate(swept.required_quantity):
        if name not in names:
            continue
        of_magnitude = swept.of_magnitude is not None and swept.of_magnitude[n]
        prefix = f"{name} " if len(names) > 1 else ""
        for words, limit in (("at least", swept.at_least[n]), ("at most", swept.at_most[n])):
            if not np.isfinite(limit):
                continue
            text = f"{prefix}{words} {format_raised(float(limit), 4)}"
            at_right = _is_right_clear(swept, swept.value[..., own], float(limit))
            line = Rule(float(limit), text, colour=RED, dashes=LIMIT, at_right=at_right)
            found.append(line)
            signed = of_magnitude and (swept.value[..., own[names.index(name)]] < 0).any()
            if signed:
                found.append(Rule(-float(limit), "", colour=RED, dashes=LIMIT))
    return found


def _is_right_clear(swept: Sweep, value: Float[np.ndarray, "point result"], limit: float) -> bool:
    """Whether the text of a limit line is further from the curves (p, r) at its right end.

    It keeps clear of the vertical line of the design too.
    """
    below = float(np.mean(np.array(swept.axes[0].values) < swept.drawn[0]))
    if abs(below - 0.5) > 0.5 - TEXT:
        return below < 0.5
    reach = max(int(TEXT * len(value)), 1)
    left, right = (
        np.min(np.abs(part - limit), initial=np.inf, where=np.isfinite(part))
        for part in (value[:reach], value[-reach:])
    )
    return bool(right >= left)


def _both_modes(swept: Sweep, one: Labelled, colour: str) -> list[Line]:
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


def _failed(swept: Sweep) -> tuple[list[Rule], list[Line]]:
    """Make shades of points without results, and their names."""
    x = swept.axes[0].displayed
    status = np.ravel(swept.status)
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


def _shown(swept: Sweep) -> tuple[Any, ...]:
    """Places of the points of a map: of a fine grid as many as a picture has pixels."""
    lengths = [len(axis.values) for axis in swept.axes[:2]]
    places = [np.linspace(0, one - 1, min(one, MOST_MAPPED)).round().astype(int) for one in lengths]
    return np.ix_(*places)


def _map(
    swept: Sweep, every: Float[np.ndarray, "column row"], n: int, one: Labelled | None
) -> Panel:
    across, up = (_across(axis, 34) for axis in swept.axes[:2])
    shown = _shown(swept)
    x, y = (
        axis.displayed[place.ravel()] for axis, place in zip(swept.axes[:2], shown, strict=True)
    )
    value = every[shown]
    finite = np.ma.masked_invalid(value.T)
    wide = _is_wide(every)
    known = every[np.isfinite(every)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    smooth = min(value.shape) > 1 and np.ptp(value) > 1e-9 * abs(high)  # not with gaps
    high = max(high, low + (abs(low) or 1.0) * 1e-9)
    touched = None if one is None else one.touched[(..., *swept.start[2:])][shown]
    norm = LogNorm(low, high) if wide else Normalize(low, high)

    def paint(axes: Axes) -> None:
        axes.grid(visible=False)
        axes.set_facecolor("#eeeeee")
        shading = "gouraud" if smooth and max(value.shape) <= MOST_BLENDED else "nearest"
        how = {"shading": shading, "rasterized": True}
        axes.pcolormesh(x, y, finite, norm=norm, cmap="viridis", **how)
        if smooth:
            _draw_contours(axes, x, y, finite, norm)
        _draw_feasible(axes, x, y, swept, shown)
        beside = axes.inset_axes((1.03, 0.0, 0.06, 1.0))
        bar = figure_of(axes).colorbar(ScalarMappable(norm, "viridis"), cax=beside)
        bar.set_label(_own_label(swept, n), fontsize=SMALL)
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


def _draw_feasible(
    axes: Axes,
    x: Float[np.ndarray, " column"],
    y: Float[np.ndarray, " row"],
    swept: Sweep,
    shown: tuple[Any, ...],
) -> None:
    """Shade points that do not meet all requirements, and draw where the worst one is just met.

    Of the points that are `shown`.
    """
    worst = swept.worst_margin
    met = swept.all_met
    if worst is None or met is None or min(len(x), len(y)) < 2:
        return
    margin = np.clip(worst[(..., *swept.start[2:])][shown].T, -FAR, FAR)
    unknown = np.isnan(margin)
    pale = {"cmap": ListedColormap(["white"]), "alpha": 0.55, "rasterized": True}
    if unknown.any():
        none = np.ma.masked_where(~unknown, np.zeros(margin.shape))
        axes.pcolormesh(x, y, none, shading="nearest", **pale)
    known = np.ma.masked_invalid(margin)
    if known.count() and known.min() < 0:
        axes.contourf(x, y, known, levels=[-2 * FAR, 0.0], colors=["white"], alpha=0.55)
        if known.max() > 0:
            axes.contour(x, y, known, levels=[0.0], colors=[RED], linewidths=1.4)


def _draw_contours(axes: Axes, x: Any, y: Any, finite: np.ndarray, norm: Normalize) -> None:
    """Draw contours at about six round numbers, labelled where there is room."""
    low = float(norm.vmin or 0.0)
    high = float(norm.vmax or 1.0)
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
    write = partial(format_raised, digits=4)
    frame = np.reshape(axes.bbox.extents, (2, 2))
    for text in axes.clabel(lines, fontsize=SMALL, fmt=write, manual=middles):
        box = np.reshape(text.get_window_extent().extents, (2, 2))
        text.set_visible(bool((box[0] >= frame[0]).all() and (box[1] <= frame[1]).all()))
