"""Figure of builds: required quantities with yields, causes, and other quantities that vary."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from suspension_cli.analyses.tolerance.quantities import COUPLING
from suspension_cli.analyses.tolerance.statistics import QUANTILES, Yield, strongest
from suspension_cli.analyses.tolerance.summary import Summary
from suspension_cli.design.paths import DISPLAYED
from suspension_cli.drawing import curves, panels
from suspension_cli.drawing.panels import ITEM, Across, Line, Panel, Rule
from suspension_cli.drawing.style import PALE, PALETTE, single_line
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Int

    Limit = tuple[float, float, bool]
    """Least and largest value, and whether of the magnitude."""

MET, MISSED, CAUSE = PALETTE[0], PALETTE[1], PALETTE[2]
NAMES = 1.72
"""Width of the margin left of rows, in."""
MAX_BARS = 8
"""Largest number of rank correlations or Sobol indices shown."""
MAX_ROWS = 6
"""Largest number of modes, and of statics of one unit, shown."""
LITTLE = 0.1
"""Spread over the largest below which a mode or static is not drawn."""
BINS = 40
ROOM = 0.5
"""Largest room for rare builds beside a histogram, over its width."""
NEGLIGIBLE = {"Hz": 1e-3, "m": 1e-7, "rad": 1e-7}
"""Ranges (% for frequencies, m, rad) of modes and statics that are not drawn."""
KEY = [
    Line([], [], "within limits", MET, {"linewidth": 6}),
    Line([], [], "beyond", MISSED, {"linewidth": 6}),
    Line([], [], "limit", look={"linestyle": "--"}),
]


def draw(summary: Summary, title: str) -> Figure:
    """Draw the figure of `pendsus tolerance`."""
    first, *rest = _requirements(summary)
    rest += [*_causes(summary), *_frequencies(summary), *_statics(summary)]
    first = replace(first, key=KEY, remarks=[*first.remarks, "in brackets: 95 % confidence"])
    heading = f"{min(summary.good, summary.independent):,} random builds"
    if summary.joint is not None:
        heading = f"{summary.joint.percent} of {heading.replace('random ', '')} meet all limits"
    return panels.draw(heading, title, [first, *rest])


def _requirements(summary: Summary) -> list[Panel]:
    """Make panels of quantities with requirements, and of the coupling."""
    required, shown = summary.required, []
    pairs = [*zip(summary.job.requirements, summary.yields, strict=True)]

    def of(name: str) -> tuple[list[Limit], list[str]]:
        own = [(item, met) for item, met in pairs if item.quantity.name == name]
        limits = [(item.low, item.high, item.magnitude) for item, _ in own]
        return limits, [_describe(summary, met) for _, met in own]

    for number, name in enumerate(required.name):
        if name == COUPLING:
            continue
        unit, per = DISPLAYED.get(required.unit[number], (required.unit[number], 1.0))
        limits, lines = of(name)
        limits = [(per * low, per * high, magnitude) for low, high, magnitude in limits]
        label = name + (f" ({unit})" if unit != "1" else " (ratio)")
        shown.append(_histogram(per * required.sample[:, number], limits, label, lines))
    limits, lines = of(COUPLING)
    marks: list[Limit] = []
    if not limits:
        # without requirements this limit is one, else it is for comparison
        (marks if pairs else limits).append((-np.inf, summary.limit, True))
        under = replace(summary.under, name=f"{COUPLING} < {summary.limit:g}")
        lines.append(("for comparison: " if pairs else "") + _describe(summary, under))
    label = f"|{single_line(summary.ratio, 52)}| ({curves.unit_of_ratio(summary.ratio)})"
    ratio = summary.coupling.sample[:, 0]
    return [*shown, _histogram(ratio, limits, label, lines, marks, logarithmic=True)]


def _describe(summary: Summary, one: Yield) -> str:
    where = f" at {summary.frequency:g} Hz" if one.name.startswith(COUPLING) else ""
    return f"{one.percent}: {one.name}{where}"


def _histogram(
    values: Array,
    limits: Sequence[Limit],
    label: str,
    lines: Sequence[str],
    marks: Sequence[Limit] = (),
    *,
    logarithmic: bool = False,
) -> Panel:
    """Make the panel of the distribution of a quantity, with builds beyond limits on top.

    `marks` are limits that are no requirements.
    """
    shown = values[np.isfinite(values) & ((values > 0) | (not logarithmic))]
    met = np.ones(len(shown), dtype=bool)
    rules: dict[float, Rule] = {}
    for n, (low, high, magnitude) in enumerate((*limits, *marks)):
        size = np.abs(shown) if magnitude else shown
        if n < len(limits):
            met &= (size >= low) & (size <= high)
        ends = [end for end in (low, high) if np.isfinite(end)]
        ends += [-end for end in ends if magnitude and (shown < 0).any()]
        for end in ends:
            dashes = "--" if n < len(limits) else (0, (1, 2))
            rules[end] = Rule(end, f"limit {end:.4g}", True, dashes=dashes, is_named=False)

    def paint(axes: Axes) -> None:
        axes.yaxis.set_major_locator(MaxNLocator(3, min_n_ticks=2))
        if not len(shown) or shown.max() == shown.min():
            axes.plot(shown[:1], [50.0] * len(shown[:1]), "o", color=MET, markersize=3)
            return
        scale = np.log10 if logarithmic else np.asarray
        first, last = (float(scale(edge)) for edge in np.quantile(shown, (0.005, 0.995)))
        room = ROOM * (last - first)
        first = max(first - room, float(scale(shown.min())))
        last = min(last + room, float(scale(shown.max())))
        bins = np.linspace(first, last, BINS + 1)
        axes.hist(
            [shown[met], shown[~met]],
            bins=(10.0**bins if logarithmic else bins).tolist(),
            weights=[np.full(int(kind.sum()), 100 / len(shown)) for kind in (met, ~met)],
            color=[MET, MISSED],
            stacked=True,
            histtype="stepfilled",
            linewidth=0,
        )

    across = Across(label, "log" if logarithmic else "linear")
    title, *more = lines
    own = [*rules.values()]
    return Panel(
        "builds (%)", height=0.95, title=title, remarks=more, rules=own, across=across, paint=paint
    )


def _rows(
    names: Sequence[str],
    texts: Sequence[str],
    label: str,
    paint: Callable[[Axes, Int[np.ndarray, " row"]], object],
) -> Panel:
    """Make a panel with a name per row; `paint` draws on axes at the positions of the rows."""

    def draw_rows(axes: Axes) -> None:
        paint(axes, np.arange(len(names)))
        axes.xaxis.set_major_locator(MaxNLocator(5))

    return Panel(
        height=ITEM * max(len(names), 1), rows=[single_line(name, 26) for name in names],
        left=NAMES, title=texts[0], remarks=texts[1:], paint=draw_rows,
        across=Across(label, "linear"), rules=[Rule(0.0, "", True, dashes="-")],
    )  # fmt: skip


def _causes(summary: Summary) -> list[Panel]:
    """Make the panel of the coupling's significant rank correlations or Sobol indices."""
    if summary.indices is not None:
        return [_indices(summary)]
    rank = summary.signed.rank[0]
    every = strongest(rank, len(rank), summary.significant)
    top = every[:MAX_BARS]
    if not top:
        return []
    left_out = len(every) - len(top)
    size = abs(rank[top[-1]]) if left_out else summary.significant
    rest = f"{left_out} more are significant" if left_out else "no other is significant"
    texts = (
        "Deviations that the coupling depends on most, with their sign",
        f"{rest} (below {size:.2g} in size)",
    )

    def paint(axes: Axes, rows: Int[np.ndarray, " row"]) -> None:
        axes.barh(rows, rank[top], color=CAUSE, height=0.6)

    return [_rows([summary.factor[n] for n in top], texts, "rank correlation (−1 to 1)", paint)]


def _indices(summary: Summary) -> Panel:
    """Make the panel of the total and first-order Sobol indices of the coupling."""
    indices, place = summary.indices, summary.indexed.index(COUPLING)
    assert indices is not None
    total, first, error = (
        np.nan_to_num(values[:, place])
        for values in (indices.total, indices.first, indices.total_error)
    )
    top = strongest(np.maximum(total, 0.0), MAX_BARS, 0.005)

    def paint(axes: Axes, rows: Int[np.ndarray, " row"]) -> None:
        axes.barh(rows, total[top], xerr=error[top], color=PALE, height=0.7, error_kw={"lw": 0.6})
        axes.barh(rows, np.maximum(first[top], 0.0), color=CAUSE, height=0.35)

    texts = (
        "Tolerances that cause the spread of the coupling",
        "green: alone; grey: with others, and its standard error",
    )
    names = [summary.job.groups[n] for n in top]
    return _rows(names, texts, "Sobol index (fraction of variance)", paint)


def _frequencies(summary: Summary) -> list[Panel]:
    """Make the panel of the modes that vary most, in % of the nominal frequency."""
    with np.errstate(all="ignore"):
        change = 100 * (summary.quantiles / summary.nominal[:, None] - 1)
    names = [f"{name}  {f:.3g} Hz" for name, f in zip(summary.label, summary.nominal, strict=True)]
    return _spreads("Frequencies", names, change, "Hz", "frequency from nominal (%)", "%")


def _statics(summary: Summary) -> list[Panel]:
    """Make panels of the static rotations and displacements that vary most."""
    static, shown = summary.static, []
    for unit, what in (("rad", "rotations"), ("m", "displacements")):
        which = [n for n, own in enumerate(static.unit) if own == unit]
        name, per = DISPLAYED[unit]
        names = [static.name[n].replace(" static ", " ") for n in which]
        label = f"static {what[:-1]} ({name})"
        shown += _spreads(f"Static {what}", names, per * static.quantiles[which], unit, label, name)
    return shown


def _spreads(
    heading: str, names: list[str], quantiles: Array, kind: str, label: str, unit: str
) -> list[Panel]:
    """Make a panel of the quantities that vary most, largest first; count the others."""
    reach = np.nan_to_num(quantiles[:, QUANTILES.index(0.95)] - quantiles[:, QUANTILES.index(0.05)])
    order = np.argsort(-reach, kind="stable")
    least = max(NEGLIGIBLE[kind], LITTLE * float(reach.max(initial=0.0)))
    top = [int(n) for n in order if reach[n] > least][:MAX_ROWS]
    if not top:
        return []
    texts = [f"{heading}: 5, 25, 50, 75 and 95 % of builds"]
    rest = [float(reach[n]) for n in order if n not in top]
    if rest:
        texts.append(f"{len(rest)} others: {max(rest):.2g} {unit} or less between 5 and 95 %")

    def paint(axes: Axes, rows: Int[np.ndarray, " row"]) -> None:
        low, q1, middle, q3, high = (
            quantiles[top, QUANTILES.index(level)] for level in (0.05, 0.25, 0.5, 0.75, 0.95)
        )
        axes.hlines(rows, low, high, color=MET, linewidth=1.0)
        axes.hlines(rows, q1, q3, color=MET, linewidth=4.0)
        axes.plot(middle, rows, "|", color="white", markersize=6)

    return [_rows([names[n] for n in top], texts, label, paint)]
