"""Pictures of a comparison: changes of modes and quantities, responses and noises with ratios."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.analyses.compare.compared_quantities import ComparedQuantities
from suspension_cli.analyses.compare.items import Curve
from suspension_cli.analyses.compare.solve import (
    Comparison,
    Overlay,
    PairedModes,
    interpolate,
    with_ratio,
)
from suspension_cli.drawing import panels
from suspension_cli.drawing.panels import ITEM, Across, Line, Panel, Rule
from suspension_cli.drawing.style import (
    NOTE,
    PALE,
    PALETTE,
    LineLook,
    format_signed,
    format_significant,
    shorten,
    single_line,
    write_unit,
)
from suspension_cli.quantities.requirements import displayed_unit

if TYPE_CHECKING:
    from jaxtyping import Float

MARKERS = ("o", "D", "s", "^", "v")
"""Markers of the items."""
AVERAGED = 0.05
"""Half width of the band of frequencies over which a drawn ratio of curves is averaged, relative
to the frequency."""
LONGEST = 34
"""Longest names of quantities, characters."""


def draw_modes(found: Comparison, modes: PairedModes) -> Figure:
    """Draw changes of mode frequencies from the first item to the others, in %."""
    shown = np.flatnonzero(np.isfinite(modes.frequency).sum(1) > 1)
    labels = [modes.label[n] for n in shown]
    frequency = modes.frequency[shown]
    base = np.isfinite(frequency).argmax(1)
    every = np.arange(len(shown))
    first = frequency[every, base]
    change = 100 * (frequency / first[:, None] - 1)
    change[every, base] = np.nan
    rows = [f"{one}  {format_significant(f)} Hz" for one, f in zip(labels, first, strict=True)]
    return _draw_changes(found, change, labels, rows, "Mode frequencies", "frequency")


def draw_quantities(found: Comparison, quantities: ComparedQuantities) -> Figure:
    """Draw changes of quantities from the first item to the others, in %."""
    shown = np.flatnonzero(np.isfinite(quantities.change).any(1)).tolist()
    rows = []
    beside = []
    for n in shown:
        unit, factor = displayed_unit(quantities.quantity_unit[n])
        values = quantities.value[n]
        first = factor * values[np.isfinite(values).argmax()]
        name = single_line(quantities.name[n], LONGEST)
        rows.append(f"{name}  {format_significant(first)} {write_unit(unit)}".rstrip())
        failing = [
            found.name[one.item] for one in quantities.verdict if one.quantity == n and not one.met
        ]
        beside.append(f"not met: {', '.join(dict.fromkeys(failing))}" if failing else "")
    labels = [quantities.name[n] for n in shown]
    change = quantities.change[shown]
    return _draw_changes(found, change, labels, rows, "Quantities", "value", beside)


def _draw_changes(
    found: Comparison,
    change: Float[np.ndarray, "row item"],
    labels: Sequence[str],
    rows: Sequence[str],
    title: str,
    what: str,
    beside: Sequence[str] = (),
) -> Figure:
    """Draw changes from the first item to the others in %, a row for each label."""
    low = np.nanmin(change, axis=1, initial=0.0)
    high = np.nanmax(change, axis=1, initial=0.0)
    lines = panels.stems(low, high, PALE)
    key: list[Line] = []
    for n in np.flatnonzero(np.isfinite(change).any(0)):
        colour = PALETTE[n % len(PALETTE)]
        marker = MARKERS[n % len(MARKERS)]
        look: LineLook = {"marker": marker, "markersize": 4, "linestyle": "none"}
        lines.append(Line(change[:, n], np.arange(len(rows)), found.name[n], colour, look))
        if len(found.name) > 2:
            key.append(Line([], [], found.name[n], colour, look))
    least = float(low.min(initial=0.0))
    most = float(high.max(initial=0.0))
    room = 0.07 * (most - least) or 0.05
    panel = Panel(
        lines=lines,
        height=ITEM * max(len(rows), 4),
        rows=rows,
        beside=beside,
        key=key,
        rules=[Rule(0.0, vertical=True, colour=NOTE, dashes="-")],
        right=None if any(beside) else 0.2,
    )
    if np.nan_to_num(change).any():
        largest = int(np.nanargmax(np.abs(change)))
        row, column = divmod(largest, change.shape[1])
        title += f": {labels[row]} {format_signed(change[row, column])} %"
        if len(found.name) > 2:  # else the line below names it
            title += f" in {shorten(found.name[column], max(50 - len(title), 6))}"
    reference, *others = [single_line(name) for name in found.name]
    against = " · ".join(filter(None, (f"{', '.join(others)} against {reference}", _models(found))))
    label = f"{what} relative to {shorten(reference, 16)} (%)"
    across = Across(label, "signed", (1.4 * least - room, 1.4 * most + room))
    return panels.draw(title, against, [panel], across)


def draw_overlay(found: Comparison, overlay: Overlay) -> Figure:
    """Draw magnitudes (of responses also phases), and ratios below."""
    response = overlay.kind == "response"
    curves = _refine(overlay)
    sizes: list[Line] = []
    phases: list[Line] = []
    ratios: list[Line] = []
    for curve in curves:
        name = found.name[curve.item] + ("" if curve.value.any() else " (0 by symmetry)")
        measured = found.kind[curve.item] == "measurement"
        look: LineLook = {"linestyle": panels.DASHES[curve.item % len(panels.DASHES)]}
        if measured:
            look = {"linestyle": "none", "marker": ".", "markersize": 3}
        how = (PALETTE[curve.item % len(PALETTE)], look)
        size = np.abs(curve.value)
        error = None
        if np.isfinite(curve.uncertainty).any():
            error = size - curve.uncertainty, size + curve.uncertainty
        sizes.append(Line(curve.frequency, size, name, *how, error))
        phases.append(Line(curve.frequency, curve.value, "_", *how))
        if len(curve.ratio):
            ratio = np.abs(curve.ratio)
            ratio = ratio if measured else average_ratio(curve.ratio_frequency, ratio)
            ratios.append(Line(curve.ratio_frequency, ratio, "_", *how))
    unit = overlay.unit.replace("sqrt(Hz)", "√Hz")
    quantity = "magnitude" if response else single_line(overlay.output, 30)
    shown = [Panel(f"{quantity} ({unit})", sizes, scale="log", empty=panels.ZERO)]
    if response:
        shown.append(Panel("phase (degrees)", phases, panels.PHASE, "phase", empty=" "))
    if len(curves) > 1 and any(curve.value.any() for curve in curves):
        known = np.concatenate([np.ones(1), *(np.asarray(line.y) for line in ratios)])
        known = known[np.isfinite(known) & (known > 0)]
        base = f"relative to {single_line(found.name[curves[0].item], 30)}"
        base += f", lines: geometric mean over ±{100 * AVERAGED:g} % in frequency"
        wide = "log" if known.max() > 3 * known.min() else "linear"
        rule = Rule(1.0, colour=PALE, dashes="-")
        shown.append(Panel("ratio", ratios, 1.2, wide, title=base, rules=[rule]))
    title = (
        f"Transfer function {overlay.name}" if response else f"Thermal noise of {overlay.output}"
    )
    return panels.draw(title, _models(found), shown)


def average_ratio(
    frequency: Float[np.ndarray, " point"], ratio: Float[np.ndarray, " point"]
) -> Float[np.ndarray, " point"]:
    """Geometric mean of a ratio over a band around each frequency (Hz).

    Two designs differ by their Q where a resonance has moved by less than its width: a spike that
    says little. The mean of the logarithm over a wider band does not depend on Q.

    >>> average_ratio(np.geomspace(1.0, 2.0, 50), np.full(50, 3.0)).round(6).tolist() == [3.0] * 50
    True
    """
    known = np.isfinite(ratio) & (ratio > 0) & (frequency > 0)
    if known.sum() < 2:
        return ratio
    at = np.log(frequency[known])
    level = np.log(ratio[known])
    steps = np.diff(at) * (level[1:] + level[:-1]) / 2
    integral = np.append(0.0, np.cumsum(steps))
    low = np.clip(at - AVERAGED, at[0], at[-1])
    high = np.clip(at + AVERAGED, at[0], at[-1])
    total = np.interp(high, at, integral) - np.interp(low, at, integral)
    result = np.full(len(ratio), np.nan)
    result[known] = np.exp(total / (high - low))
    return result


def _refine(overlay: Overlay) -> list[Curve]:
    """Resolve the resonances of computed curves, and of their ratios."""
    curves: list[Curve] = []
    for curve in overlay.curves:
        if curve.fine_frequency is not None and curve.fine is not None:
            at = curve.fine_frequency
            unknown = np.full(len(curve.fine), np.nan)
            curve = replace(curve, frequency=at, value=curve.fine, uncertainty=unknown)
            if curves:  # also where the reference has resonances
                more = curves[0].frequency
                at = np.union1d(at, more[(more >= at[0]) & (more <= at[-1])])
                curve = replace(curve, frequency=at, value=interpolate(at, curve))
                curve = with_ratio(curve, curves[0])
        curves.append(curve)
    return curves


def _models(found: Comparison) -> str:
    return ", ".join(f"{model} model" for model in sorted({*found.models} - {""}))
