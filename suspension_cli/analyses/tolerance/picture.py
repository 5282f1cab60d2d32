"""Figure of builds: required quantities with limits and yields, causes, and what else varies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from suspension_cli.analyses.tolerance.quantities import COUPLING
from suspension_cli.analyses.tolerance.statistics import QUANTILES, Spread, Summary, strongest
from suspension_cli.design.path_units import DISPLAYED
from suspension_cli.drawing import curves
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALE,
    PALETTE,
    add_axes,
    house_style,
    new_figure,
    single_line,
)
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int
    from matplotlib.typing import LineStyleType

MET, MISSED, CAUSE = PALETTE[0], PALETTE[1], PALETTE[2]
WIDTH, LEFT = 4.5, 0.62
"""Width of the figure and of the margin left of histograms, in."""
NAMES = 1.62
"""Width of the margin left of rows, in."""
TALL, ROW = 0.95, 0.155
"""Height of a histogram, and of a row, in."""
LINE = 0.15
"""Height of a line of text above a panel, in."""
BELOW = 0.42
"""Height of the tick labels and the label below a panel, in."""
GAP = 0.13
"""Distance of one panel's label from the next panel's text, in."""
MAX_BARS = 8
"""Largest number of rank correlations or Sobol indices shown."""
MAX_ROWS = 6
"""Largest number of modes, and of statics of one unit, shown."""
LITTLE = 0.1
"""Spread relative to the largest, below which a mode or static is summed up in words."""
BINS = 40
ROOM = 0.5
"""Largest room beside a histogram for limits, as a fraction of its width."""
NEGLIGIBLE = {"Hz": 1e-3, "m": 1e-7, "rad": 1e-7}
"""Range (% for frequencies, m, rad) of the statics and modes that are not drawn."""

Panel = tuple[float, float, list[str], Callable[[Axes], None]]
"""Height (in), left margin (in), lines of text above, and the function that draws."""


def draw(summary: Summary, title: str) -> Figure:
    """Draw the figure of `pendsus tolerance`."""
    with house_style():
        panels = [
            *_requirements(summary),
            *_causes(summary),
            *_frequencies(summary),
            *_statics(summary),
        ]
        top = curves.HEAD + 0.25
        height = top + sum(LINE * len(lines) + tall + BELOW + GAP for tall, _, lines, _ in panels)
        figure = new_figure(WIDTH, height)
        builds = f"{min(summary.good, summary.independent):,} random builds"
        heading = builds
        if summary.joint is not None:
            low, high = 100 * summary.joint.low, 100 * summary.joint.high
            met = f"{100 * summary.joint.fraction:.3g} % ({low:.3g} to {high:.3g})"
            heading = f"{met} of {builds.replace('random ', '')} meet all limits"
        curves.write_heading(figure, heading, title)
        _draw_key(figure)
        for tall, left, lines, paint in panels:
            for n, line in enumerate(lines):
                figure.text(
                    0.1 / WIDTH,
                    1 - (top + LINE * n) / height,
                    single_line(line, 74),
                    va="top",
                    fontsize=7.5,
                    color=NOTE if n and left == NAMES else INK,
                )
            top += LINE * len(lines)
            paint(add_axes(figure, left, top + 0.03, WIDTH - left - 0.15, tall - 0.03))
            top += tall + BELOW + GAP
        return figure


def _draw_key(figure: Figure) -> None:
    """Draw the key of the histograms below the heading."""
    figure.legend(
        handles=[
            Patch(color=MET, label="within limits"),
            Patch(color=MISSED, label="beyond"),
            Line2D([], [], color=INK, linestyle="--", linewidth=0.9, label="limit"),
        ],
        loc="upper left",
        bbox_to_anchor=(0.02, 1 - 0.43 / figure.get_size_inches()[1]),
        ncols=3,
        fontsize=7.5,
        handlelength=1.4,
        columnspacing=1.2,
        borderpad=0.1,
    )
    at = 1 - 0.47 / figure.get_size_inches()[1]
    words = "in brackets: 95 % confidence"
    figure.text(1 - 0.15 / WIDTH, at, words, ha="right", va="top", fontsize=7.5, color=NOTE)


def _requirements(summary: Summary) -> list[Panel]:
    """Make a panel of each quantity with requirements, and of the coupling."""
    required, panels = summary.required, []
    numbers = list(dict.fromkeys(summary.required_place))
    for number in numbers:
        if required.name[number] == COUPLING:
            continue
        unit, per = DISPLAYED.get(required.unit[number], (required.unit[number], 1.0))
        values, limits, lines = per * required.sample[:, number], [], []
        for n, place in enumerate(summary.required_place):
            if place == number:
                low, high, magnitude = summary.limits[n]
                limits.append((per * low, per * high, magnitude))
                lines.append(_describe(summary, n))
        label = required.name[number] + (f" ({unit})" if unit != "1" else " (ratio)")
        panels.append((TALL, LEFT, lines, _histogram(values, limits, label)))
    own = [n for n, place in enumerate(summary.required_place) if required.name[place] == COUPLING]
    low, high = (100 * end for end in summary.under_interval)
    limits, lines = [summary.limits[n] for n in own], [_describe(summary, n) for n in own]
    marks = []
    if not own:
        # without any requirement it is one; next to others it is for comparison
        (marks if numbers else limits).append((-np.inf, summary.limit, True))
        lines.append(
            ("for comparison: " if numbers else "")
            + f"{100 * summary.under:.3g} % ({low:.3g} to {high:.3g}):"
            f" {COUPLING} < {summary.limit:g} at {summary.frequency:g} Hz"
        )
    label = f"|{single_line(summary.ratio, 52)}| ({curves.unit_of_ratio(summary.ratio)})"
    paint = _histogram(summary.ratio_sorted, limits, label, marks, logarithmic=True)
    panels.append((TALL, LEFT, lines, paint))
    return panels


def _describe(summary: Summary, number: int) -> str:
    """Yield of a requirement, with its 95 % confidence interval, and its name."""
    one = summary.yields[number]
    return (
        f"{100 * one.fraction:.3g} % ({100 * one.low:.3g} to {100 * one.high:.3g}): {one.name}"
        + (f" at {summary.frequency:g} Hz" if one.name.startswith(COUPLING) else "")
    )


def _histogram(
    values: Array,
    limits: Sequence[tuple[float, float, bool]],
    label: str,
    marks: Sequence[tuple[float, float, bool]] = (),
    *,
    logarithmic: bool = False,
) -> Callable[[Axes], None]:
    """Return a function that draws the distribution of a quantity and its limits.

    Limits are least and largest value, and whether they are of the magnitude; marks are limits
    that are no requirements.
    """

    def paint(axes: Axes) -> None:
        shown = values[np.isfinite(values) & ((values > 0) | (not logarithmic))]
        met = np.ones(len(shown), dtype=bool)
        ends: dict[float, LineStyleType] = {}
        for n, (low, high, magnitude) in enumerate((*limits, *marks)):
            size = np.abs(shown) if magnitude else shown
            if n < len(limits):
                met &= (size >= low) & (size <= high)
            own = [end for end in (low, high) if np.isfinite(end)]
            own += [-end for end in own if magnitude and (shown < 0).any()]
            ends |= dict.fromkeys(own, "--" if n < len(limits) else (0, (1, 2)))
        if len(shown) and shown.max() > shown.min():
            _draw_bins(axes, shown, met, sorted(ends), logarithmic=logarithmic)
        elif len(shown):
            axes.axvline(float(shown[0]), color=MET, linewidth=2)
        for end, dashes in ends.items():
            axes.axvline(end, color=INK, linestyle=dashes, linewidth=0.9)
        axes.set_xlabel(label, fontsize=7.5, labelpad=2)
        axes.set_ylabel("builds (%)", fontsize=7.5)
        axes.yaxis.set_major_locator(MaxNLocator(3, min_n_ticks=2))
        axes.tick_params(labelsize=7.5)
        if logarithmic and len(shown):
            curves.label_plainly(axes.xaxis)

    return paint


def _draw_bins(
    axes: Axes,
    values: Array,
    met: Bool[np.ndarray, " build"],
    ends: list[float],
    *,
    logarithmic: bool,
) -> None:
    """Draw a histogram, its builds beyond the limits on top, and leave room for near limits."""
    scale = np.log10 if logarithmic else np.asarray
    first, last = (float(scale(edge)) for edge in np.quantile(values, (0.005, 0.995)))
    room = ROOM * (last - first)
    first = max(first - room, float(scale(values.min())))
    last = min(last + room, float(scale(values.max())))
    near = [float(scale(end)) for end in ends if end > 0 or not logarithmic]
    near = [end for end in near if first - room <= end <= last + room]
    bins = np.linspace(first, last, BINS + 1)
    axes.hist(
        [values[met], values[~met]],
        bins=_raw(bins, logarithmic).tolist(),
        weights=[np.full(int(kind.sum()), 100 / len(values)) for kind in (met, ~met)],
        color=[MET, MISSED],
        stacked=True,
        histtype="stepfilled",
        linewidth=0,
    )
    if logarithmic:
        axes.set_xscale("log")
    pad = 0.03 * (last - first)
    axes.set_xlim(
        *_raw(np.array([min([first, *near]) - pad, max([last, *near]) + pad]), logarithmic)
    )


def _raw(values: Float[np.ndarray, " edge"], logarithmic: bool) -> Float[np.ndarray, " edge"]:
    return 10.0**values if logarithmic else values


def _rows(axes: Axes, labels: list[str]) -> Int[np.ndarray, " row"]:
    """Label rows from the top down; return their positions."""
    rows = np.arange(len(labels))
    axes.set_yticks(rows, [single_line(label, 26) for label in labels])
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.tick_params(labelsize=7.5)
    axes.tick_params(axis="y", length=0)
    axes.axvline(0.0, color=NOTE, linewidth=0.5)
    axes.grid(visible=True, axis="x", color=PALE, linewidth=0.4)
    axes.set_axisbelow(True)
    axes.xaxis.set_major_locator(MaxNLocator(5))
    return rows


def _causes(summary: Summary) -> list[Panel]:
    """Make the panel of the coupling's significant rank correlations or of its Sobol indices."""
    if summary.indices is not None:
        return _indices(summary)
    every = strongest(summary.signed_rank, len(summary.factor), summary.significant)
    top = every[:MAX_BARS]
    if not top:
        return []
    left_out = len(every) - len(top)
    lines = ["Deviations that the coupling depends on most, with their sign"]
    size = abs(summary.signed_rank[top[-1]]) if left_out else summary.significant
    rest = f"{left_out} more are significant" if left_out else "no other is significant"
    lines.append(f"{rest} (below {size:.2g} in size)")

    def paint(axes: Axes) -> None:
        rows = _rows(axes, [summary.factor[n] for n in top])
        axes.barh(rows, summary.signed_rank[top], color=CAUSE, height=0.6)
        axes.set_xlabel("rank correlation (−1 to 1)", fontsize=7.5, labelpad=2)

    return [(ROW * len(top) + 0.05, NAMES, lines, paint)]


def _indices(summary: Summary) -> list[Panel]:
    """Make the panel of the total and first-order Sobol indices of the coupling."""
    indices, place = summary.indices, summary.indexed.index(COUPLING)
    assert indices is not None
    total, first, error = (
        np.nan_to_num(values[:, place])
        for values in (indices.total, indices.first, indices.total_error)
    )
    top = strongest(np.maximum(total, 0.0), MAX_BARS, 0.005)

    def paint(axes: Axes) -> None:
        rows = _rows(axes, [summary.group[n] for n in top])
        axes.barh(rows, total[top], xerr=error[top], color=PALE, height=0.7, error_kw={"lw": 0.6})
        axes.barh(rows, np.maximum(first[top], 0.0), color=CAUSE, height=0.35)
        axes.set_xlabel("Sobol index (fraction of variance)", fontsize=7.5, labelpad=2)

    lines = [
        "Tolerances that cause the spread of the coupling",
        "green: alone; grey: with others, and its standard error",
    ]
    return [(ROW * max(len(top), 1) + 0.05, NAMES, lines, paint)]


def _frequencies(summary: Summary) -> list[Panel]:
    """Make the panel of the modes that vary most, in % of the nominal frequency."""
    with np.errstate(all="ignore"):
        change = 100 * (summary.quantiles / summary.nominal[:, None] - 1)
    names = [f"{name}  {f:.3g} Hz" for name, f in zip(summary.label, summary.nominal, strict=True)]
    return _spreads("Frequencies", names, change, "Hz", "frequency from nominal (%)", "%")


def _statics(summary: Summary) -> list[Panel]:
    """Make panels of the static rotations and displacements that vary most."""
    static, panels = summary.static, []
    for unit, what in (("rad", "rotations"), ("m", "displacements")):
        which = [n for n, own in enumerate(static.unit) if own == unit]
        name, per = DISPLAYED[unit]
        panels += _spreads(
            f"Static {what}", _short(static, which), per * static.quantiles[which], unit,
            f"static {what[:-1]} ({name})", name,
        )  # fmt: skip
    return panels


def _short(static: Spread, which: list[int]) -> list[str]:
    return [static.name[n].replace(" static ", " ") for n in which]


def _spreads(
    heading: str, names: list[str], quantiles: Array, kind: str, label: str, unit: str
) -> list[Panel]:
    """Make a panel of the quantiles that vary most, largest first, the others in words."""
    reach = np.nan_to_num(quantiles[:, QUANTILES.index(0.95)] - quantiles[:, QUANTILES.index(0.05)])
    order = np.argsort(-reach, kind="stable")
    least = max(NEGLIGIBLE[kind], LITTLE * float(reach.max(initial=0.0)))
    top = [int(n) for n in order if reach[n] > least][:MAX_ROWS]
    if not top:
        return []
    lines = [f"{heading}: 5, 25, 50, 75 and 95 % of builds"]
    rest = [float(reach[n]) for n in order if n not in top]
    if rest:
        lines.append(f"{len(rest)} others: {max(rest):.2g} {unit} or less between 5 and 95 %")

    def paint(axes: Axes) -> None:
        rows = _rows(axes, [names[n] for n in top])
        low, q1, middle, q3, high = (
            quantiles[top, QUANTILES.index(level)] for level in (0.05, 0.25, 0.5, 0.75, 0.95)
        )
        axes.hlines(rows, low, high, color=MET, linewidth=1.0)
        axes.hlines(rows, q1, q3, color=MET, linewidth=4.0)
        axes.plot(middle, rows, "|", color="white", markersize=6)
        axes.set_xlabel(label, fontsize=7.5, labelpad=2)

    return [(ROW * len(top) + 0.05, NAMES, lines, paint)]
