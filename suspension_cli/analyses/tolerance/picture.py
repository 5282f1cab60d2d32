"""Figure of builds: spread of modes and statics, coupling, requirements, and what matters."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.tolerance.quantities import SHOWN
from suspension_cli.analyses.tolerance.statistics import QUANTILES, Summary, strongest
from suspension_cli.drawing.style import (
    NOTE,
    PALE,
    PALETTE,
    house_style,
    new_figure,
    single_line,
)
from suspension_cli.scene.arrays import Array

MAX_BARS = 12
"""Most rank correlations or Sobol indices that are shown."""
ACROSS = 3
"""Panels side by side."""
ROW = 1.75
"""Height of a row of histograms, inches."""
ROOM = 0.5
"""Room beside a histogram for limits, as a fraction of its width."""
NEGLIGIBLE = 1e-7
"""Standard deviation of statics (m or rad) below which they are not drawn."""


def draw(summary: Summary, title: str, ratio: str) -> Figure:
    """Draw the figure of `pendsus tolerance`.

    Parameters
    ----------
    summary : Summary
    title : str
    ratio : str
        Name of the cross-coupling: ``test.x / test.z``.
    """
    required = [
        n for n, name in enumerate(summary.required.name) if name != "coupling"
    ]  # the coupling has its own panel
    statics = {unit: _moving(summary, unit) for unit in ("rad", "m")}
    with house_style():
        heights = [max(3.4, 0.24 * len(summary.label) + 0.8)]
        second = any(map(len, statics.values())) or summary.indices is not None
        if second:
            heights.append(max(1.9, 0.16 * max(map(len, statics.values())) + 0.9))
        last = -(-len(required) // ACROSS)
        heights += [ROW] * last
        figure = new_figure(9.0, sum(heights) + 0.4)
        grid = figure.add_gridspec(
            len(heights), ACROSS, height_ratios=heights, width_ratios=[1.25, 1, 1]
        )
        _draw_modes(figure.add_subplot(grid[0, 0]), summary)
        _draw_coupling(figure.add_subplot(grid[0, 1]), summary, ratio)
        _draw_ranks(figure.add_subplot(grid[0, 2]), summary)
        if second:
            for column, (unit, rows) in enumerate(statics.items()):
                if len(rows):
                    _draw_statics(figure.add_subplot(grid[1, column]), summary, unit, rows)
            if summary.indices is not None:
                _draw_indices(figure.add_subplot(grid[1, 2]), summary)
        for place, n in enumerate(required):
            row, column = divmod(place, ACROSS)
            _draw_required(figure.add_subplot(grid[len(heights) - last + row, column]), summary, n)
        builds = f"{title}: {min(summary.good, summary.independent):,} builds"
        if summary.joint is not None:
            builds += f"; {summary.joint.percent} meet all requirements"
        figure.suptitle(single_line(builds, 150), x=0.01, ha="left", fontsize=9)
        figure.tight_layout()
        return figure


def _moving(summary: Summary, unit: str) -> Any:
    """Numbers of the statics of a unit that vary."""
    static = summary.static
    same = np.array([own == unit for own in static.unit], dtype=bool)
    return np.flatnonzero(same & (static.deviation > NEGLIGIBLE))


def _draw_quantiles(axes: Axes, quantiles: Array, labels: list[str]) -> None:
    """Draw 5, 25, 50, 75 and 95 % quantiles of each row, from the top down."""
    low, q1, mid, q3, high = (
        quantiles[:, QUANTILES.index(level)] for level in (0.05, 0.25, 0.5, 0.75, 0.95)
    )
    rows = np.arange(len(labels))
    axes.hlines(rows, low, high, color=PALETTE[0], linewidth=1.0)
    axes.hlines(rows, q1, q3, color=PALETTE[0], linewidth=4.0)
    axes.plot(mid, rows, "|", color="white", markersize=6)
    axes.set_yticks(rows, labels, fontsize=6.5)
    axes.invert_yaxis()
    axes.axvline(0.0, color=NOTE, linewidth=0.5)
    axes.grid(visible=True, axis="x", color=PALE, linewidth=0.4)


def _draw_modes(axes: Axes, summary: Summary) -> None:
    """Draw quantiles of each mode, in % of the nominal frequency."""
    names = zip(summary.label, summary.nominal, strict=True)
    with np.errstate(all="ignore"):
        change = 100 * (summary.quantiles / summary.nominal[:, None] - 1)
    _draw_quantiles(axes, change, [f"{label}  {f:#.4g} Hz" for label, f in names])
    axes.set_xlabel("frequency, % from nominal\n(5, 25, 50, 75, 95 % of builds)")


def _draw_statics(axes: Axes, summary: Summary, unit: str, rows: Any) -> None:
    """Draw quantiles of static displacements or rotations."""
    name, per = SHOWN[unit]
    labels = [summary.static.name[n].replace(" static ", " ") for n in rows]
    _draw_quantiles(axes, per * summary.static.quantiles[rows], labels)
    axes.locator_params(axis="x", nbins=5)
    what = "rotation" if unit == "rad" else "displacement"
    axes.set_xlabel(f"static {what} ({name})\n(5, 25, 50, 75, 95 % of builds)")


def _draw_coupling(axes: Axes, summary: Summary, ratio: str) -> None:
    fraction = np.linspace(0, 1, len(summary.ratio_sorted))
    axes.semilogx(np.maximum(summary.ratio_sorted, 1e-300), 100 * fraction, color=PALETTE[0])
    axes.axvline(summary.limit, color=PALETTE[1], linestyle="--", linewidth=0.8)
    low, high = (100 * end for end in summary.under_interval)
    titles = [
        f"{100 * summary.under:.3g} % of builds below {summary.limit:g}",
        f"(95 % confidence: {low:.3g} to {high:.3g} %)",
    ]
    for n, place in enumerate(summary.required_place):
        if summary.required.name[place] == "coupling":
            _draw_limits(axes, summary.limits[n])
            one = summary.yields[n]
            titles.append(f"{one.name}: {100 * one.fraction:.3g} %")
    axes.set_title("\n".join(titles), loc="left", fontsize=7.5)
    if len(summary.ratio_sorted):
        axes.set_xlim(
            max(summary.ratio_quantiles[0] / 3, 1e-300),
            max(summary.limit, summary.ratio_sorted[-1]) * 2,
        )
    axes.set_ylim(0, 100)
    axes.set_xlabel(f"|{ratio}| at {summary.frequency:g} Hz")
    axes.set_ylabel("fraction of builds (%)")
    axes.grid(visible=True, color=PALE, linewidth=0.4)


def _draw_ranks(axes: Axes, summary: Summary) -> None:
    """Draw the significant rank correlations of the coupling."""
    top = strongest(summary.signed_rank, MAX_BARS, summary.significant)
    rows = np.arange(len(top))
    axes.set_axisbelow(True)
    axes.barh(rows, summary.signed_rank[top], color=PALETTE[2], height=0.6)
    axes.set_yticks(rows, [summary.factor[n] for n in top], fontsize=6.5)
    axes.set_ylim(MAX_BARS - 0.4, -0.6)
    axes.axvline(0.0, color=NOTE, linewidth=0.5)
    axes.set_title(
        f"significant: above {summary.significant:.2g}" if top else "none is significant",
        loc="left",
        fontsize=7.5,
    )
    axes.set_xlabel("rank correlation of the coupling\n(with its sign) with the deviation")
    axes.grid(visible=True, axis="x", color=PALE, linewidth=0.4)


def _draw_indices(axes: Axes, summary: Summary) -> None:
    """Draw the total and first-order Sobol indices of the coupling."""
    assert summary.indices is not None
    place = summary.indexed.index("coupling")
    total, first = (
        np.nan_to_num(values[:, place]) for values in (summary.indices.total, summary.indices.first)
    )
    error = np.nan_to_num(summary.indices.total_error[:, place])
    top = strongest(np.maximum(total, 0.0), MAX_BARS, 0.005)
    rows = np.arange(len(top))
    axes.set_axisbelow(True)
    axes.barh(rows, total[top], xerr=error[top], color=PALE, height=0.7, error_kw={"lw": 0.6})
    axes.barh(rows, np.maximum(first[top], 0.0), color=PALETTE[2], height=0.35)
    axes.set_yticks(rows, [summary.group[n] for n in top], fontsize=6.5)
    axes.invert_yaxis()
    axes.set_xlabel("Sobol indices of the coupling\n(grey: total, with std error;\ngreen: alone)")
    axes.grid(visible=True, axis="x", color=PALE, linewidth=0.4)


def _draw_required(axes: Axes, summary: Summary, number: int) -> None:
    """Draw the distribution of a quantity, and its requirements."""
    required = summary.required
    unit, per = SHOWN.get(required.unit[number], (required.unit[number], 1.0))
    values = per * required.sample[:, number]
    values = values[np.isfinite(values)]
    titles = []
    signed = bool((values < 0).any())
    for n, place in enumerate(summary.required_place):
        if place == number:
            _draw_limits(axes, summary.limits[n], per, signed=signed)
            one = summary.yields[n]
            titles.append(f"{one.name}:\n{one.percent}")
    if len(values) and values.max() > values.min():
        first, end = (float(edge) for edge in np.quantile(values, (0.002, 0.998)))
        axes.hist(values, bins=40, range=(first, end), color=PALETTE[0], alpha=0.6)
        # a limit far from all builds is left to the title
        room = ROOM * (end - first)
        axes.set_xlim(max(axes.get_xlim()[0], first - room), min(axes.get_xlim()[1], end + room))
    axes.set_title("\n".join(titles), loc="left", fontsize=6.5)
    axes.set_yticks([])
    axes.set_ylabel("builds", fontsize=7)
    axes.set_xlabel(required.name[number] + (f" ({unit})" if unit != "1" else ""), fontsize=7)


def _draw_limits(
    axes: Axes, limits: tuple[float, float, bool], per: float = 1.0, *, signed: bool = False
) -> None:
    """Draw the ends of a requirement; of a limit on the size of a signed quantity, both signs."""
    low, high, magnitude = limits
    ends = {end for end in (low, high) if np.isfinite(end)}
    if magnitude and signed:
        ends |= {-end for end in ends}
    for end in sorted(ends):
        axes.axvline(per * end, color=PALETTE[1], linestyle="--", linewidth=0.9)
