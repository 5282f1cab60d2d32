"""Pictures of a comparison: changes of modes, responses and noises with ratios."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.analyses.compare.items import Curve, Quantity, curves_of
from suspension_cli.analyses.compare.solve import (
    Comparison,
    Overlay,
    PairedModes,
    interpolate,
    with_ratio,
)
from suspension_cli.analyses.response import picture as response_picture
from suspension_cli.analyses.response.picture import PHASE, ZERO
from suspension_cli.analyses.thermal import picture as thermal_picture
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

if TYPE_CHECKING:
    from jaxtyping import Float

MARKERS = ("o", "D", "s", "^", "v")
"""Markers of the items."""


def draw_modes(found: Comparison, modes: PairedModes) -> Figure:
    """Draw changes of mode frequencies from the first item to the others, in %."""
    shown = np.flatnonzero(np.isfinite(modes.frequency).sum(1) > 1)
    labels, frequency = [modes.label[n] for n in shown], modes.frequency[shown]
    base = np.isfinite(frequency).argmax(1)
    first = frequency[np.arange(len(shown)), base]
    change = 100 * (frequency / first[:, None] - 1)
    change[np.arange(len(shown)), base] = np.nan
    looks: list[tuple[str, LineLook]] = [
        (
            PALETTE[n % len(PALETTE)],
            {"marker": MARKERS[n % len(MARKERS)], "markersize": 4, "linestyle": "none"},
        )
        for n in range(len(found.name))
    ]
    items = [n for n in range(len(found.name)) if np.isfinite(change[:, n]).any()]
    rows = np.arange(len(shown))
    lines = [Line(change[:, n], rows, found.name[n], *looks[n]) for n in items]
    low, high = (end(change, axis=1, initial=0.0) for end in (np.nanmin, np.nanmax))
    lines += panels.stems(low, high, PALE)
    far = float(low.min(initial=0.0)), float(high.max(initial=0.0))
    room = 0.07 * (far[1] - far[0]) or 0.05

    panel = Panel(
        lines=lines,
        height=ITEM * max(len(shown), 4),
        rows=[
            f"{label}  {format_significant(f)} Hz" for label, f in zip(labels, first, strict=True)
        ],
        key=[Line([], [], found.name[n], *looks[n]) for n in items if len(found.name) > 2],
        rules=[Rule(0.0, vertical=True, colour=NOTE, dashes="-")],
        right=0.2,
    )
    models = _model_line(found)
    base, *others = [single_line(name) for name in found.name]
    against = f"{', '.join(others)} against {base}{f' · {models}' if models else ''}"
    title = f"Mode frequencies: {_modes_title(found, change, labels)}"
    label = f"frequency relative to {shorten(base, 16)} (%)"
    across = Across(label, "signed", (1.4 * far[0] - room, 1.4 * far[1] + room))
    return panels.draw(title, against, [panel], across)


def _modes_title(
    found: Comparison, change: Float[np.ndarray, "mode design"], labels: list[str]
) -> str:
    if not np.isfinite(change).any():
        return "none in common"
    row, column = np.unravel_index(np.nanargmax(np.abs(change)), change.shape)
    if change[row, column] == 0:
        return "none differs"
    text = f"{labels[row]} {format_signed(change[row, column])} % in "
    return text + shorten(found.name[column], max(54 - len("Mode frequencies: " + text), 6))


def draw_overlay(found: Comparison, overlay: Overlay) -> Figure:
    """Draw magnitudes (of responses also phases), and ratios below."""
    response, curves = overlay.kind == "response", _refine(overlay)
    nonzero = any(curve.value.any() for curve in curves)
    sizes, phases, ratios = [], [], []
    for curve in curves:
        name = found.name[curve.item] + ("" if curve.value.any() else " (0 by symmetry)")
        look = PALETTE[curve.item % len(PALETTE)], _look(found, curve)
        size, error = np.abs(curve.value), None
        if np.isfinite(curve.uncertainty).any():
            error = size - curve.uncertainty, size + curve.uncertainty
        sizes.append(Line(curve.frequency, size, name, *look, error))
        phases.append(Line(curve.frequency, curve.value, "_", *look))
        if len(curve.ratio):
            ratios.append(Line(curve.ratio_frequency, np.abs(curve.ratio), "_", *look))
    unit = overlay.unit.replace("sqrt(Hz)", "√Hz")
    quantity = "magnitude" if response else single_line(overlay.output, 30)
    shown = [Panel(f"{quantity} ({unit})", sizes, scale="log", empty=ZERO)]
    if response:
        shown.append(Panel("phase (degrees)", phases, PHASE, "phase", empty=" "))
    if len(curves) > 1 and nonzero:
        known = np.concatenate([np.ones(1), *(np.asarray(line.y) for line in ratios)])
        known = known[np.isfinite(known) & (known > 0)]
        base = f"relative to {single_line(found.name[curves[0].item], 60)}"
        wide = "log" if known.max() > 3 * known.min() else "linear"
        rule = Rule(1.0, colour=PALE, dashes="-")
        shown.append(Panel("ratio", ratios, 1.2, wide, title=base, rules=[rule]))
    heading = (
        f"Transfer function {overlay.name}" if response else f"Thermal noise of {overlay.output}"
    )
    return panels.draw(heading, _model_line(found), shown)


def _refine(overlay: Overlay) -> list[Curve]:
    """Resolve the resonances of computed curves, and of their ratios."""
    curves = []
    for curve in overlay.curves:
        result = overlay.source.get(curve.item)
        if result is not None:
            module = response_picture if overlay.kind == "response" else thermal_picture
            found = curves_of(replace(result, data=module.refine(result)))
            finer, _ = found[Quantity(overlay.kind, overlay.output, overlay.input)]
            curve = replace(finer, item=curve.item)
        curves.append(curve)
    first, *others = curves
    for n, curve in enumerate(others):
        if curve.item in overlay.source:
            low, high = curve.frequency[[0, -1]]
            at = np.union1d(curve.frequency, first.frequency)
            at = at[(at >= low) & (at <= high)]
            others[n] = with_ratio(
                replace(curve, frequency=at, value=interpolate(at, curve)), first
            )
    return [first, *others]


def _look(found: Comparison, curve: Curve) -> LineLook:
    if found.kind[curve.item] == "measurement":
        return {"linestyle": "none", "marker": ".", "markersize": 3}
    return {"linestyle": panels.DASHES[curve.item % len(panels.DASHES)]}


def _model_line(found: Comparison) -> str:
    models = {model for model in found.model if model}
    return ", ".join(f"{model} model" for model in sorted(models))
