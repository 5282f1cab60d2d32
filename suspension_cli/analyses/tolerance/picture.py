"""Figure of builds: required quantities with yields, causes, and other quantities that vary."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from suspension_cli.analyses.tolerance.build_statistics import strongest
from suspension_cli.analyses.tolerance.summary import QUANTILES, Spread, Tolerance
from suspension_cli.design.paths import DISPLAYED
from suspension_cli.drawing import curves, panels
from suspension_cli.drawing.panels import ITEM, Across, Line, Panel, Rule
from suspension_cli.drawing.style import INK, PALETTE, LineLook, shorten_to, single_line
from suspension_cli.quantities.requirements import Band
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from matplotlib.typing import LineStyleType

MET = PALETTE[0]
MISSED = PALETTE[1]
CAUSE = PALETTE[2]
NAMES = 2.3
"""Width of the margin left of rows, in."""
MAX_ROWS = 8, 6
"""Largest number of causes, and of modes or statics of one unit, shown."""
LEAST_SHARE = 0.005
"""Fraction of the variance below which a tolerance is not drawn."""
LITTLE = 0.1
"""Spread over the largest below which a mode or static is not drawn."""
BAR = 7.0
"""Thickness of a bar, points."""
BINS = 40
DRAWN = (0.002, 0.998)
"""Quantiles between which histograms are drawn."""
NEGLIGIBLE = {"%": 1e-3, "mm": 1e-4, "mrad": 1e-4}
"""Ranges of modes and statics that are not drawn."""
KEY = [
    Line([], [], "within limits", MET, {"linewidth": 6}),
    Line([], [], "beyond", MISSED, {"linewidth": 6}),
    Line([], [], "limit", look={"linestyle": "--"}),
]


def draw(summary: Tolerance, title: str) -> Figure:
    """Draw the figure of `pendsus tolerance`."""
    first, *rest = [
        *_requirements(summary),
        *_causes(summary),
        *_shares(summary),
        *_varying(summary),
    ]
    first = replace(first, key=KEY, remarks=[*first.remarks, "in brackets: 95 % confidence"])
    failed = summary.builds - summary.good
    heading = f"{summary.builds:,} random builds"
    if summary.joint is not None:
        heading = f"{summary.joint.percent} of {summary.builds:,} builds meet all limits"
    if failed:
        remark = f"{failed:,} builds failed: they meet no limit, and no distribution has them"
        first = replace(first, remarks=[*first.remarks, remark])
    return panels.draw(heading, title, [first, *rest])


def _requirements(summary: Tolerance) -> Iterator[Panel]:
    """Make panels of quantities with requirements, of others that vary, and of the coupling."""
    share = summary.good / summary.builds
    coupling = summary.coupling.name
    limits: dict[str, list[Band]] = {coupling: []}
    lines: dict[str, list[str]] = {coupling: []}
    rows = zip(summary.requirement_quantity or (), summary.bands, summary.yields, strict=True)
    for name, band, met in rows:
        limits.setdefault(name, []).append(band)
        lines.setdefault(name, []).append(f"{met.percent}: {met.name}")
    shown = {one.name: one for one in (*summary.required, *summary.others)}
    shown.pop(coupling, None)
    for name, one in shown.items():
        if name not in lines and one.deviation == 0:
            continue
        label = f"{name} ({one.displayed[0] or 'ratio'})"
        title = lines.get(name, [f"{name}: no limit"])
        valued = (summary.good - one.missing - one.infinite) / summary.builds
        yield _histogram(one, valued, limits.get(name, []), label, title)
    dashes: LineStyleType = "--"
    if not limits[coupling]:  # without requirements the limit is one, else for comparison
        limits[coupling].append(Band(-np.inf, summary.limit, of_magnitude=True, open=True))
        some = "" if share == 1 else " of those that hang"
        line = f"{summary.under.percent}{some}: {coupling} < {summary.limit:g}"
        if summary.requirement:
            line = f"for comparison: {line}"
            dashes = (0, (1, 2))
        lines[coupling].append(line)
    label = f"|{single_line(summary.ratio, 52)}| ({curves.unit_of_ratio(summary.ratio)})"
    said = [f"{line} at {summary.frequency:g} Hz" for line in lines[coupling]]
    yield _histogram(
        summary.coupling, share, limits[coupling], label, said, dashes, logarithmic=True
    )


def _histogram(
    one: Spread,
    share: float,
    limits: Sequence[Band],
    label: str,
    lines: Sequence[str],
    dashes: LineStyleType = "--",
    *,
    logarithmic: bool = False,
) -> Panel:
    """Make the panel of the distribution of a quantity, with builds beyond limits on top.

    `share` is the fraction of builds that have a value, of which it is a distribution. Limits that
    are not dashed are no requirements.
    """
    per = one.displayed[1]
    known = one.sample[np.isfinite(one.sample)]
    values = known[known > 0] if logarithmic else known
    met = np.ones(len(values), dtype=bool)
    shown = per * values
    ends: set[float] = set()
    for limit in limits:
        met &= limit.contains(values) | (dashes != "--")
        ends |= {limit.low, limit.high}
        if limit.of_magnitude and (values < 0).any():
            ends |= {-limit.low, -limit.high}

    def paint(axes: Axes) -> None:
        axes.yaxis.set_major_locator(MaxNLocator(3, min_n_ticks=2))
        if not len(shown) or shown.max() == shown.min():
            axes.plot(shown[:1], [50.0] * len(shown[:1]), "o", color=MET, markersize=3)
            return
        first, last = np.quantile(shown, DRAWN)
        spaced = np.geomspace if logarithmic else np.linspace
        axes.hist(
            [shown[met], shown[~met]],
            bins=spaced(first, last, BINS + 1).tolist(),
            weights=[np.full(int(kind.sum()), 100 * share / len(known)) for kind in (met, ~met)],
            color=[MET, MISSED],
            stacked=True,
            histtype="stepfilled",
            linewidth=0,
        )

    rules = [
        Rule(per * end, f"limit {per * end:.4g}", True, dashes=dashes, is_named=False)
        for end in sorted(ends)
        if np.isfinite(end)
    ]
    across = Across(label, "log" if logarithmic else "linear")
    return Panel(
        "builds (%)", height=0.95, title=lines[0], remarks=lines[1:], rules=rules, across=across,
        paint=paint,
    )  # fmt: skip


def _rows(names: Sequence[str], lines: Sequence[Line], texts: Sequence[str], label: str) -> Panel:
    """Make a panel of lines in rows with names."""
    rows = [single_line(shorten_to(name, NAMES - 0.24)) for name in names]
    return Panel(
        lines=lines, height=ITEM * max(len(names), 1), rows=rows,
        left=NAMES, title=texts[0], remarks=texts[1:], across=Across(label, "linear"),
        rules=[Rule(0.0, "", True, dashes="-")],
    )  # fmt: skip


def _causes(summary: Tolerance) -> Iterator[Panel]:
    """Make the panel of the coupling's significant rank correlations."""
    rank = summary.signed.rank
    most = MAX_ROWS[0]
    every = strongest(rank, len(rank), summary.significant)
    if not every:
        return
    top = every[:most]
    more = len(every) - most
    size = abs(rank[top[-1]]) if more > 0 else summary.significant
    rest = f"{more} more are significant" if more > 0 else "no other is significant"
    remark = f"{rest} (below {size:.2g} in size)"
    texts = ["Deviations that the coupling depends on most, with their sign", remark]
    names = [summary.factor[n] for n in top]
    lines = panels.stems(0.0, rank[top], CAUSE, BAR)
    yield _rows(names, lines, texts, "rank correlation (−1 to 1)")


def _shares(summary: Tolerance) -> Iterator[Panel]:
    """Make the panel of the tolerances that cause the variance of the coupling."""
    one = summary.signed
    if not one.r_squared > 0:
        return
    significant = np.where(one.share > 2 * one.share_error, one.share, 0.0)
    top = strongest(significant, MAX_ROWS[1], LEAST_SHARE)
    if len(top) < 2:
        return
    share = one.share[top]
    error = one.share_error[top]
    lines = panels.stems(0.0, share, CAUSE, BAR)
    lines += panels.stems(share - error, share + error, INK, 0.6)
    texts = [
        "Tolerances that cause the spread of the coupling",
        f"black: standard error; a linear fit explains {100 * one.r_squared:.3g} % of the variance",
    ]
    yield _rows([summary.group[n] for n in top], lines, texts, "fraction of variance")


def _varying(summary: Tolerance) -> Iterator[Panel]:
    """Make panels of the modes, static rotations and displacements that vary most."""
    nominal = summary.nominal_frequency
    with np.errstate(all="ignore"):
        change = 100 * (summary.quantiles / nominal[:, None] - 1)
    pairs = zip(summary.modes, nominal, strict=True)
    names = [f"{one.name}  {frequency:.3g} Hz" for one, frequency in pairs]
    yield from _spreads("Frequencies", names, change, "frequency from nominal", "%")
    for unit, what in (("rad", "rotation"), ("m", "displacement")):
        some = [one for one in summary.static if one.unit == unit]
        names = [one.name.replace(" static ", " ") for one in some]
        name, per = DISPLAYED[unit]
        quantiles = per * np.array([one.quantiles for one in some])
        yield from _spreads(f"Static {what}s", names, quantiles, f"static {what}", name)


def _spreads(
    heading: str, names: list[str], quantiles: Array, label: str, unit: str
) -> Iterator[Panel]:
    """Make a panel of the quantities that vary most, largest first; count the others."""
    edges = [QUANTILES.index(level) for level in (0.05, 0.25, 0.5, 0.75, 0.95)]
    reach = np.nan_to_num(quantiles[:, edges[-1]] - quantiles[:, edges[0]])
    order = np.argsort(-reach, kind="stable")
    least = max(NEGLIGIBLE[unit], LITTLE * float(reach.max(initial=0.0)))
    top = order[reach[order] > least][: MAX_ROWS[1]]
    if not len(top):
        return
    texts = [f"{heading}: 5, 25, 50, 75 and 95 % of builds"]
    rest = reach[order[len(top) :]]
    if len(rest):
        others = "1 other" if len(rest) == 1 else f"{len(rest)} others"
        texts.append(f"{others}: {rest.max():.2g} {unit} or less between 5 and 95 %")
    low, q1, middle, q3, high = quantiles[top][:, edges].T
    mark: LineLook = {"linestyle": "none", "marker": "|", "markersize": 6}
    lines = [*panels.stems(low, high, MET, 1.0), *panels.stems(q1, q3, MET, 4.0)]
    lines.append(Line(middle, np.arange(len(top)), "_", "white", mark))
    yield _rows([names[n] for n in top], lines, texts, f"{label} ({unit})")
