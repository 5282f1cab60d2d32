"""Bode plots of frequency responses, and of measured transfer functions over modelled ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.drawing import curves, panels
from suspension_cli.drawing.panels import Across, Line, Panel, Rule, Scale
from suspension_cli.drawing.style import PALETTE, LineLook, lighten, stage_colours

if TYPE_CHECKING:
    from suspension_cli.analyses.response.solve import Comparison
    from suspension_cli.linear.response import Response
    from suspension_cli.scene.arrays import Array

MANY_POINTS = 300
"""Number of measured points above which they are drawn small and without error bars."""
MARKERS = ("o", "D", "^", "s", "v")
"""Markers of points of different functions."""
TALL = 2.0
ALL = 6.0
"""Largest height of a panel of measured magnitudes, and of all of them together, in."""


def draw(response: Response, title: str, scale: str = "db", stages: Sequence[str] = ()) -> Figure:
    """Draw magnitudes, a panel per unit, and phases against frequency.

    Curves have the colours of the stages of their outputs. `scale` is "db" (20 log10 of the SI
    value) or "absolute" (on a log axis).
    """
    pairs = [(o, i) for o in range(len(response.output)) for i in range(len(response.input))]
    body = [_body_of(output) for output in response.output]
    many = len(pairs) > 1
    by_stage = stage_colours([*stages, *body])
    colours = [by_stage[body[o]] for o, _ in pairs]
    lines = list[Line]()
    by_unit = dict[str, list[Line]]()
    for (o, i), colour, dashes in zip(pairs, colours, panels.dashes_of(colours), strict=True):
        value = response.value[:, o, i]
        name = f"{response.output[o]} / {response.input[i]}"
        name += "" if value.any() else " = 0 by symmetry"
        lines.append(Line(response.frequency, value, name, colour, {"linestyle": dashes}))
        by_unit.setdefault(response.unit[o][i], []).append(lines[-1])
    kind = _scale(scale)
    shown = []
    for unit, own in by_unit.items():
        label = _label_magnitude(unit, kind)
        key = None if many else ()
        shown.append(Panel(label, own, scale=kind, key=key, peaks="find", empty=panels.ZERO))
    shown.append(Panel("phase (degrees)", lines, panels.PHASE, "phase", key=(), empty=" "))
    logarithmic = response.frequency[0] > 0 and len(response.frequency) > 1
    heading = "Transfer functions" if many else f"Transfer function {lines[0].name}"
    heading += ", loops closed" if response.closed_loop else ""
    return panels.draw(heading, title, shown, Across(scale="log" if logarithmic else "linear"))


def _scale(scale: str) -> Scale:
    return "db" if scale == "db" else "log"


def _body_of(signal: str) -> str:
    """Body of a signal: ``test`` of ``test.x@0,0,0.001``."""
    return signal.partition("@")[0].rpartition(".")[0]


def _label_magnitude(unit: str, kind: Scale) -> str:
    """Label of an axis of magnitudes with its unit."""
    if kind == "db":
        return "magnitude (dB)" if unit in ("m/m", "") else f"magnitude (dB re 1 {unit})"
    return f"magnitude ({unit})" if unit else "magnitude"


def draw_measured(
    measured: Sequence[Comparison],
    title: str,
    scale: str = "db",
    stages: Sequence[str] = (),
) -> Figure:
    """Draw magnitudes (a panel per unit), phases, and the ratio of magnitudes.

    Curves have the colours of the stages of their outputs, if these differ.
    """
    kind = _scale(scale)
    many = len(measured) > 1
    both = [*zip(measured, _looks(measured, stages), strict=True)]
    models = [Line(one.curve_frequency, one.curve, "_model", look[0]) for one, look in both]
    points = [_points(one, look, one.data.value) for one, look in both]
    units = list(dict.fromkeys(one.data.unit for one in measured))
    shown = []
    for unit in units:
        own = [n for n, one in enumerate(measured) if one.data.unit == unit]
        lines = [lines[n] for lines in (models, points) for n in own]
        key = [Line([], [], one.data.name, *look) for one, look in both if one.data.unit == unit]
        limits = curves.limit_sizes(np.concatenate([_nearby(measured[n]) for n in own]), kind)
        peaks = [peak for n in own for peak in _peaks(measured[n], kind)]
        height = float(np.clip(ALL / len(units), 1.1, TALL))
        label = _label_magnitude(unit, kind)
        key = key if many else ()
        shown.append(Panel(label, lines, height, kind, limits, key=key, peaks=peaks))
    shown.append(Panel("phase (degrees)", [*models, *points], panels.PHASE, "phase", key=()))
    ratios = [_points(one, look, one.ratio) for one, look in both]
    clear = np.concatenate([np.ones(1), *(np.abs(one.ratio[one.clear]) for one in measured)])
    rule = Rule(0.0 if kind == "db" else 1.0, dashes="-")
    label = "meas./model (dB)" if kind == "db" else "|meas./model|"
    limits = curves.limit_sizes(clear, kind)
    shown.append(Panel(label, ratios, 1.3, kind, limits, key=(), rules=[rule]))
    name = "Transfer functions" if many else f"Transfer function {measured[0].data.name}"
    return panels.draw(f"{name}: points measured, lines modelled", title, shown)


def _looks(measured: Sequence[Comparison], stages: Sequence[str]) -> list[tuple[str, LineLook]]:
    """Colour and marker of each function; the colours of the stages if these differ."""
    body = [_body_of(one.data.output) for one in measured]
    colours = [stage_colours([*stages, *body])[name] for name in body]
    if len({*colours}) < len(colours):
        colours = [PALETTE[n % len(PALETTE)] for n in range(len(body))]
    return [(colour, _open_marker(n, colour)) for n, colour in enumerate(colours)]


def _open_marker(n: int, colour: str) -> LineLook:
    """Look of measured points: open and pale, so that the model's line shows on top of them."""
    return {
        "marker": MARKERS[n % len(MARKERS)],
        "markersize": 3.4,
        "markerfacecolor": "white",
        "markeredgecolor": lighten(colour, 0.4),
        "markeredgewidth": 0.7,
    }


def _peaks(one: Comparison, kind: Scale) -> list[tuple[float, float, str]]:
    """Frequencies and ordinates of measured resonances."""
    near = [int(np.abs(one.data.frequency - peak).argmin()) for peak in one.peak]
    sizes = np.abs(one.data.value[near])
    heights = 20 * np.log10(np.where(sizes > 0, sizes, 1.0)) if kind == "db" else sizes
    every = zip(one.peak.tolist(), heights.tolist(), sizes.tolist(), strict=True)
    return [(at, height, "") for at, height, size in every if size > 0]


def _points(one: Comparison, look: tuple[str, LineLook], value: Array) -> Line:
    """Points with error bars; of many points without these."""
    data = one.data
    good = (data.frequency > 0) & (data.value != 0)
    at = data.frequency[good]
    value = value[good]
    sigma = data.uncertainty[good]
    relative = np.where(np.isfinite(sigma), sigma / np.abs(data.value[good]), np.nan)
    how: LineLook = {**look[1], "linestyle": "none", "zorder": 1.6}
    if len(at) > MANY_POINTS:
        return Line(at, value, "_points", look[0], how | {"markersize": 2.0})
    ends = value * (1 - np.clip(relative, 0, 0.999)), value * (1 + relative)
    return Line(at, value, "_points", look[0], how, ends)


def _nearby(one: Comparison) -> Array:
    """Sizes measured, and those of the model within the measured band."""
    at = one.curve_frequency
    band = one.data.frequency
    return np.abs([*one.data.value, *one.curve[(at >= band[0]) & (at <= band[-1])]])
