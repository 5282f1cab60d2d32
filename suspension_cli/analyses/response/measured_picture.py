"""Measured transfer functions over those of a model: magnitude, phase and ratio."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.response.measured import Comparison
from suspension_cli.analyses.response.picture import body_of, draw_magnitude, label_magnitude
from suspension_cli.drawing import curves
from suspension_cli.drawing.style import INK, LineLook, house_style, shade, stage_colours

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

MANY = 300
"""Number of points above which they are drawn small and without error bars."""

BAR = "#9aa1a8"
"""Colour of error bars."""
MARKERS = ("o", "D", "^", "s", "v")
"""Markers of points of outputs of one stage."""


def draw(
    measured: Sequence[Comparison],
    title: str,
    scale: str = "db",
    stages: Sequence[str] = (),
    outputs: Sequence[str] = (),
) -> Figure:
    """Draw magnitudes (a panel per unit), unwrapped phases, and the ratio of magnitudes.

    Curves have the colours of the stages of their outputs, in shades where several have the same;
    `outputs` are the motions of stages that sensors observe. `scale` is "db" (20 log10 of the SI
    value) or "absolute" (on a log axis).
    """
    decibels, units = scale == "db", list(dict.fromkeys(one.data.unit for one in measured))
    many = len(measured) > 1
    looks = _looks(measured, stages, outputs)
    with house_style():
        own = [[n for n, one in enumerate(measured) if one.data.unit == unit] for unit in units]
        keys = [[(measured[n].data.name, *looks[n]) for n in part] if many else [] for part in own]
        rooms = [curves.key_room([key[0] for key in part]) + curves.PEAKS + 0.05 for part in keys]
        heights = [*[2.0] * len(units), 1.3, 1.3]
        figure, panels = curves.stack_panels(heights, [*rooms, 0.12, 0.12])
        phases, ratios = panels[-2:]
        for axes in panels:
            axes.set_xscale("log")
            axes.margins(x=0.015)
        ratios.axhline(0 if decibels else 1, color=INK, linewidth=0.6)
        if not decibels:
            ratios.set_yscale("log")
        for axes, unit, part, key in zip(panels, units, own, keys, strict=False):
            for n in part:
                one, (colour, how) = measured[n], looks[n]
                draw_magnitude(axes, one.curve_frequency, one.curve, scale, colour, "_model")
                phase = curves.unwrap_phase(one.curve)
                phases.plot(one.curve_frequency, phase, color=colour)
                _draw_measured(
                    (axes, phases, ratios), one, phase, decibels, colour, how.get("marker", "")
                )
            axes.set_ylabel(label_magnitude(unit, decibels))
            _limit(axes, [np.abs(_nearby(measured[n])) for n in part], decibels)
            if not decibels:
                curves.label_plainly(axes.yaxis)
            _label_resonances(axes, [measured[n] for n in part], decibels)
            curves.write_key(axes, key, above=curves.PEAKS)
        phases.set_ylabel("phase (degrees)")
        curves.label_phases(phases)
        ratios.set_ylabel("meas./model (dB)" if decibels else "|meas./model|")
        ratios.set_xlabel("frequency (Hz)")
        _limit(ratios, [np.ones(1), *(np.abs(one.ratio[one.clear]) for one in measured)], decibels)
        for one, (colour, _) in zip(measured, looks, strict=True):
            _mark_outside(ratios, one, decibels, colour)
        if not decibels:
            curves.label_plainly(ratios.yaxis)
        figure.align_ylabels(panels)
        one = f"Transfer function {measured[0].data.name}" if not many else "Transfer functions"
        curves.write_heading(figure, f"{one}: points measured, lines modelled", title)
        return figure


def _looks(
    measured: Sequence[Comparison], stages: Sequence[str], outputs: Sequence[str]
) -> list[tuple[str, LineLook]]:
    """Shade of the colour of each output's stage, and the marker of its points.

    Sensors have the colour of the stage that they observe if all observe the same.
    """
    body = [body_of(one.data.output) for one in measured]
    seen = {body_of(output) for output in outputs}
    if len(seen) == 1:
        body = [name if name in stages else min(seen) for name in body]
    colours = stage_colours([*stages, *body])
    before = [body[:n].count(name) for n, name in enumerate(body)]
    return [
        (shade(colours[name], k), {"marker": MARKERS[k % len(MARKERS)], "markersize": 3})
        for name, k in zip(body, before, strict=True)
    ]


def _mark_outside(axes: Axes, one: Comparison, decibels: bool, colour: str) -> None:
    """Mark points beyond the vertical axis by arrows at its edge."""
    with np.errstate(divide="ignore"):
        size = np.abs(one.ratio)
        size = 20 * np.log10(size) if decibels else size
    low, high = axes.get_ylim()
    for edge, beyond, mark in ((low, size < low, "v"), (high, size > high, "^")):
        at = one.data.frequency[beyond & (one.data.frequency > 0)]
        axes.plot(at, np.full(len(at), edge), mark, color=colour, markersize=3, clip_on=False)


def _label_resonances(axes: Axes, measured: Sequence[Comparison], decibels: bool) -> None:
    """Write the measured frequencies of resonances above them."""
    found = []
    for one in measured:
        for peak in one.peak:
            size = float(np.abs(one.data.value[np.abs(one.data.frequency - peak).argmin()]))
            if size > 0:
                found.append((float(peak), 20 * np.log10(size) if decibels else size, ""))
    curves.label_peaks(axes, sorted(found, key=lambda peak: peak[1]))


def _draw_measured(
    panels: tuple[Axes, Axes, Axes],
    one: Comparison,
    modelled: Float[np.ndarray, " frequency"],
    decibels: bool,
    colour: str,
    mark: str,
) -> None:
    """Draw points of magnitude, phase and ratio, with grey error bars where they are known."""
    data = one.data
    positive = (data.frequency > 0) & (data.value != 0)
    at, value, sigma = data.frequency[positive], data.value[positive], data.uncertainty[positive]
    size, ratio = np.abs(value), np.abs(one.ratio[positive])
    relative = np.where(np.isfinite(sigma), sigma / size, np.nan)
    phase = _phase_near(np.degrees(np.angle(value)), at, one.curve_frequency, modelled)
    few = len(at) <= MANY
    for axes, values, errors in (
        (panels[0], *_scaled(size, relative, decibels)),
        (panels[1], phase, np.stack([np.minimum(np.degrees(relative), 180.0)] * 2)),
        (panels[2], *_scaled(ratio, relative, decibels)),
    ):
        if few:
            known = np.isfinite(errors).all(0)
            low, high = values - errors[0], values + errors[1]
            axes.vlines(at[known], low[known], high[known], color=BAR, linewidth=0.6, zorder=1.5)
            axes.plot(at, values, mark, color=colour, markersize=2.4, markeredgewidth=0)
        else:
            axes.plot(at, values, ".", color=colour, markersize=1.8, markeredgewidth=0, alpha=0.7)


def _phase_near(
    phase: Float[np.ndarray, " point"],
    at: Float[np.ndarray, " point"],
    frequency: Float[np.ndarray, " frequency"],
    modelled: Float[np.ndarray, " frequency"],
) -> Float[np.ndarray, " point"]:
    """Shift measured phases (degrees) to the branch of the model, also beside its steps.

    An offset of all points remains, as of a sensor with the opposite sign.
    """
    around = [np.interp(at * factor, frequency, modelled) for factor in (1.0, 0.97, 1.03)]
    mean = np.exp(1j * np.radians(phase - around[0])).sum()
    offset = curves.to_branch(np.degrees(np.angle(mean)), 0.0)
    away = np.abs([(phase - offset - near + 180.0) % 360.0 - 180.0 for near in around])
    away[1:] += 30.0  # the point itself, unless another is much nearer
    return curves.to_branch(phase - offset, np.choose(away.argmin(0), around)) + offset


def _nearby(one: Comparison) -> Complex[np.ndarray, " value"]:
    """Measured values, and those of the model within the measured band."""
    at, band = one.curve_frequency, one.data.frequency
    return np.concatenate([one.data.value, one.curve[(at >= band[0]) & (at <= band[-1])]])


def _limit(axes: Axes, sizes: Sequence[Float[np.ndarray, " _"]], decibels: bool) -> None:
    """Set the vertical axis to magnitudes, whatever error bars extend to."""
    whole = np.concatenate(sizes)
    whole = whole[np.isfinite(whole) & (whole > 0)]
    if not len(whole):
        return
    low, high = 20 * np.log10(whole.min()), 20 * np.log10(whole.max())
    edge = 0.06 * (high - low) + 1.0
    ends = np.array([low - edge, high + edge])
    axes.set_ylim(*(ends if decibels else 10 ** (ends / 20)))


def _scaled(
    size: Float[np.ndarray, " point"], relative: Float[np.ndarray, " point"], decibels: bool
) -> tuple[Float[np.ndarray, " point"], Float[np.ndarray, "2 point"]]:
    """Values on the axis, and the lengths (2, f) of their error bars below and above."""
    below, above = np.clip(relative, 0, 0.999), relative
    if decibels:
        with np.errstate(divide="ignore", invalid="ignore"):
            values = 20 * np.log10(np.where(size > 0, size, np.nan))
        return values, np.stack([-20 * np.log10(1 - below), 20 * np.log10(1 + above)])
    return size, np.stack([size * below, size * above])
