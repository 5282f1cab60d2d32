"""Measured transfer functions over those of a model: magnitude, phase and ratio."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.analyses.response.measured import Comparison
from suspension_cli.analyses.response.picture import PHASE, body_of, label_magnitude
from suspension_cli.drawing import panels
from suspension_cli.drawing.panels import Line, Panel, Rule, Scale
from suspension_cli.drawing.style import PALETTE, LineLook, stage_colours

if TYPE_CHECKING:
    from suspension_cli.scene.arrays import Array

MANY = 300
"""Number of points above which they are drawn small and without error bars."""
MARKERS = ("o", "D", "^", "s", "v")
"""Markers of points of different functions."""
TALL, ALL = 2.0, 6.0
"""Largest height of a panel of magnitudes, and of all of them together, in."""


def draw(
    measured: Sequence[Comparison],
    title: str,
    scale: str = "db",
    stages: Sequence[str] = (),
    outputs: Sequence[str] = (),
) -> Figure:
    """Draw magnitudes (a panel per unit), phases, and the ratio of magnitudes.

    Curves have the colours of the stages of their outputs, if these differ; `outputs` are the
    motions of stages that sensors observe. `scale` is "db" (20 log10 of the SI value) or
    "absolute" (on a log axis).
    """
    kind: Scale = "db" if scale == "db" else "log"
    units, many = list(dict.fromkeys(one.data.unit for one in measured)), len(measured) > 1
    looks, shown = _looks(measured, stages, outputs), []
    for unit in units:
        own = [n for n, one in enumerate(measured) if one.data.unit == unit]
        models = [_model(measured[n], looks[n]) for n in own]
        points = [_points(measured[n], looks[n], measured[n].data.value) for n in own]
        key = [Line([], [], measured[n].data.name, *looks[n]) for n in own if many]
        near = np.concatenate([_nearby(measured[n]) for n in own])
        peaks = []
        for one, peak in ((measured[n], peak) for n in own for peak in measured[n].peak.tolist()):
            size = float(abs(one.data.value[np.abs(one.data.frequency - peak).argmin()]))
            if size > 0:
                peaks.append((peak, 20 * np.log10(size) if kind == "db" else size, ""))
        height = float(np.clip(ALL / len(units), 1.1, TALL))
        limits = panels.limit_sizes(near, kind)
        label = label_magnitude(unit, kind == "db")
        shown.append(Panel(label, [*models, *points], height, kind, limits, key=key, peaks=peaks))
    both = [*zip(measured, looks, strict=True)]
    phases = [_model(*one) for one in both]
    phases += [_points(one, look, one.data.value) for one, look in both]
    shown.append(Panel("phase (degrees)", phases, PHASE, "phase", key=()))
    ratios = [_points(one, look, one.ratio) for one, look in both]
    clear = np.concatenate([np.ones(1), *(np.abs(one.ratio[one.clear]) for one in measured)])
    rule = Rule(0.0 if kind == "db" else 1.0, dashes="-")
    label = "meas./model (dB)" if kind == "db" else "|meas./model|"
    limits = panels.limit_sizes(clear, kind)
    shown.append(Panel(label, ratios, 1.3, kind, limits, key=(), rules=[rule]))
    name = "Transfer functions" if many else f"Transfer function {measured[0].data.name}"
    return panels.draw(f"{name}: points measured, lines modelled", title, shown)


def _looks(
    measured: Sequence[Comparison], stages: Sequence[str], outputs: Sequence[str]
) -> list[tuple[str, LineLook]]:
    """Colour and marker of each function; the colours of the stages if these differ.

    Sensors have the colour of the stage that they observe if all observe the same.
    """
    body = [body_of(one.data.output) for one in measured]
    seen = {body_of(output) for output in outputs}
    if len(seen) == 1:
        body = [name if name in stages else min(seen) for name in body]
    colours = [stage_colours([*stages, *body])[name] for name in body]
    if len({*colours}) < len(colours):
        colours = [PALETTE[n % len(PALETTE)] for n in range(len(body))]
    return [
        (colour, {"marker": MARKERS[n % len(MARKERS)], "markersize": 3})
        for n, colour in enumerate(colours)
    ]


def _model(one: Comparison, look: tuple[str, LineLook]) -> Line:
    return Line(one.curve_frequency, one.curve, "_model", look[0])


def _points(one: Comparison, look: tuple[str, LineLook], value: Array) -> Line:
    """Points with error bars; of many points without these."""
    data = one.data
    good = (data.frequency > 0) & (data.value != 0)
    at, value, sigma = data.frequency[good], value[good], data.uncertainty[good]
    relative = np.where(np.isfinite(sigma), sigma / np.abs(data.value[good]), np.nan)
    how: LineLook = {**look[1], "linestyle": "none", "markersize": 2.4, "markeredgewidth": 0.0}
    if len(at) > MANY:
        return Line(at, value, "_points", look[0], how | {"marker": ".", "markersize": 1.8})
    ends = value * (1 - np.clip(relative, 0, 0.999)), value * (1 + relative)
    return Line(at, value, "_points", look[0], how, ends)


def _nearby(one: Comparison) -> Array:
    """Sizes measured, and those of the model within the measured band."""
    at, band = one.curve_frequency, one.data.frequency
    return np.abs([*one.data.value, *one.curve[(at >= band[0]) & (at <= band[-1])]])
