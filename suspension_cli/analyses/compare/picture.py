"""Pictures of a comparison: changes of modes, responses and noises with ratios."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

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
)

MARKERS = ("o", "D", "s", "^", "v")
"""Markers of the items."""


def draw_modes(found: Comparison, modes: PairedModes) -> Figure:
    """Draw changes of mode frequencies from the first item to the others, in %."""
    shown = np.flatnonzero(np.isfinite(modes.frequency).sum(1) > 1)
    labels, frequency, rows = [modes.label[n] for n in shown], modes.frequency[shown], len(shown)
    base = np.isfinite(frequency).argmax(1)
    first = frequency[np.arange(rows), base]
    change = 100 * (frequency / first[:, None] - 1)
    change[np.arange(rows), base] = np.nan
    low, high = (end(change, axis=1, initial=0.0) for end in (np.nanmin, np.nanmax))
    lines, key = panels.stems(low, high, PALE), list[Line]()
    for n in np.flatnonzero(np.isfinite(change).any(0)):
        colour, marker = PALETTE[n % len(PALETTE)], MARKERS[n % len(MARKERS)]
        look: LineLook = {"marker": marker, "markersize": 4, "linestyle": "none"}
        lines.append(Line(change[:, n], np.arange(rows), found.name[n], colour, look))
        key += [Line([], [], found.name[n], colour, look)] if len(found.name) > 2 else []
    far = float(low.min(initial=0.0)), float(high.max(initial=0.0))
    room = 0.07 * (far[1] - far[0]) or 0.05
    panel = Panel(
        lines=lines,
        height=ITEM * max(rows, 4),
        rows=[f"{one}  {format_significant(f)} Hz" for one, f in zip(labels, first, strict=True)],
        key=key,
        rules=[Rule(0.0, vertical=True, colour=NOTE, dashes="-")],
        right=0.2,
    )
    title = "Mode frequencies"
    if np.nan_to_num(change).any():
        row, column = np.unravel_index(np.nanargmax(np.abs(change)), change.shape)
        title += f": {labels[row]} {format_signed(change[row, column])} % in "
        title += shorten(found.name[column], max(54 - len(title), 6))
    reference, *others = [single_line(name) for name in found.name]
    against = " · ".join(filter(None, (f"{', '.join(others)} against {reference}", _models(found))))
    label = f"frequency relative to {shorten(reference, 16)} (%)"
    across = Across(label, "signed", (1.4 * far[0] - room, 1.4 * far[1] + room))
    return panels.draw(title, against, [panel], across)


def draw_overlay(found: Comparison, overlay: Overlay) -> Figure:
    """Draw magnitudes (of responses also phases), and ratios below."""
    response, curves = overlay.kind == "response", _refine(overlay)
    sizes, phases, ratios = [], [], []
    for curve in curves:
        name = found.name[curve.item] + ("" if curve.value.any() else " (0 by symmetry)")
        measured = found.kind[curve.item] == "measurement"
        look: LineLook = {"linestyle": panels.DASHES[curve.item % len(panels.DASHES)]}
        look = {"linestyle": "none", "marker": ".", "markersize": 3} if measured else look
        how = PALETTE[curve.item % len(PALETTE)], look
        size, error = np.abs(curve.value), None
        if np.isfinite(curve.uncertainty).any():
            error = size - curve.uncertainty, size + curve.uncertainty
        sizes.append(Line(curve.frequency, size, name, *how, error))
        phases.append(Line(curve.frequency, curve.value, "_", *how))
        if len(curve.ratio):
            ratios.append(Line(curve.ratio_frequency, np.abs(curve.ratio), "_", *how))
    unit = overlay.unit.replace("sqrt(Hz)", "√Hz")
    quantity = "magnitude" if response else single_line(overlay.output, 30)
    shown = [Panel(f"{quantity} ({unit})", sizes, scale="log", empty=panels.ZERO)]
    if response:
        shown.append(Panel("phase (degrees)", phases, panels.PHASE, "phase", empty=" "))
    if len(curves) > 1 and any(curve.value.any() for curve in curves):
        known = np.concatenate([np.ones(1), *(np.asarray(line.y) for line in ratios)])
        known = known[np.isfinite(known) & (known > 0)]
        base = f"relative to {single_line(found.name[curves[0].item], 60)}"
        wide = "log" if known.max() > 3 * known.min() else "linear"
        rule = Rule(1.0, colour=PALE, dashes="-")
        shown.append(Panel("ratio", ratios, 1.2, wide, title=base, rules=[rule]))
    title = (
        f"Transfer function {overlay.name}" if response else f"Thermal noise of {overlay.output}"
    )
    return panels.draw(title, _models(found), shown)


def _refine(overlay: Overlay) -> list[Curve]:
    """Resolve the resonances of computed curves, and of their ratios."""
    curves: list[Curve] = []
    for curve in overlay.curves:
        if curve.fine_frequency is not None and curve.fine is not None:
            at, unknown = curve.fine_frequency, np.full(len(curve.fine), np.nan)
            curve = replace(curve, frequency=at, value=curve.fine, uncertainty=unknown)
            if curves:  # also where the reference has resonances
                more = curves[0].frequency
                at = np.union1d(at, more[(more >= at[0]) & (more <= at[-1])])
                curve = replace(curve, frequency=at, value=interpolate(at, curve))
                curve = with_ratio(curve, curves[0])
        curves.append(curve)
    return curves


def _models(found: Comparison) -> str:
    return ", ".join(f"{model} model" for model in sorted({*found.model} - {""}))
