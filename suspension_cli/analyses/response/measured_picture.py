"""Measured transfer functions over those of a model: magnitude, phase and ratio."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.response.measured import Comparison
from suspension_cli.analyses.response.picture import draw_magnitude, insert_gaps, label_magnitude
from suspension_cli.drawing import curves
from suspension_cli.drawing.style import INK, PALETTE, house_style, new_figure

MANY = 300
"""Number of points above which they are drawn small and without error bars."""


def draw(measured: Sequence[Comparison], title: str, scale: str = "db") -> Figure:
    """Draw magnitudes (a panel per unit) and unwrapped phases, and below the ratio of magnitudes.

    Parameters
    ----------
    measured : sequence of Comparison
    title : str
        Names of the design and the model.
    scale : {"db", "absolute"}
        Magnitude axis: 20 log10 of the SI value, or the value itself on a log axis.
    """
    decibels, units = scale == "db", list(dict.fromkeys(one.data.unit for one in measured))
    with house_style():
        heights = [*[2.2] * len(units), 1.3, 1.3]
        names = [one.data.name for one in measured]
        many = len(measured) > 1
        right = curves.room_for(names) if many else 0.2
        figure = new_figure(curves.COLUMN, sum(heights) + 0.15 * len(heights) + 0.95)
        panels = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
        curves.set_margins(figure, right=right, top=curves.HEAD, bottom=0.45, hspace=0.1)
        phases, ratios = panels[-2:]
        for axes in panels:
            axes.set_xscale("log")
            axes.margins(x=0)
            curves.rule(axes)
        ratios.axhline(0 if decibels else 1, color=INK, linewidth=0.6)
        if not decibels:
            ratios.set_yscale("log")
        for axes, unit in zip(panels, units, strict=False):
            own = [n for n, one in enumerate(measured) if one.data.unit == unit]
            for n in own:
                one, colour = measured[n], PALETTE[n % len(PALETTE)]
                at = one.curve_frequency
                draw_magnitude(axes, at, one.curve, scale, colour, "_model")
                phase = curves.unwrap_phase(one.curve)
                phases.plot(at, phase, color=colour)
                _draw_measured((axes, phases, ratios), one, phase, decibels, colour)
            axes.set_ylabel(label_magnitude(unit, decibels))
            _limit(axes, [np.abs(_nearby(measured[n])) for n in own], decibels, room=0.15)
            if not decibels:
                curves.label_plainly(axes.yaxis)
            _label_resonances(axes, [measured[n] for n in own], decibels)
        phases.set_ylabel("phase (degrees)")
        curves.label_phases(phases)
        ratios.set_ylabel("meas./model (dB)" if decibels else "|meas./model|")
        ratios.set_xlabel("frequency (Hz)")
        _limit(ratios, [np.ones(1), *(np.abs(one.ratio[one.clear]) for one in measured)], decibels)
        if not decibels:
            curves.label_plainly(ratios.yaxis)
        figure.align_ylabels(panels)
        if many:
            for axes, unit in zip(panels, units, strict=False):
                _label_names(axes, measured, unit, decibels)
        one = f"Transfer function {names[0]}" if not many else "Transfer functions"
        curves.write_heading(figure, f"{one}: points measured, lines modelled", title)
        return figure


def _label_names(axes: Axes, measured: Sequence[Comparison], unit: str, decibels: bool) -> None:
    """Name the curves of one unit at their ends."""
    ends = []
    for n, one in enumerate(measured):
        if one.data.unit == unit:
            with np.errstate(divide="ignore"):
                size = np.abs(one.curve)
                size = 20 * np.log10(size) if decibels else size
            ends.append((one.curve_frequency, size, one.data.name, PALETTE[n % len(PALETTE)]))
    curves.label_ends(axes, ends)


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
    panels: tuple[Axes, Axes, Axes], one: Comparison, modelled: Any, decibels: bool, colour: str
) -> None:
    """Draw points of magnitude, phase and ratio, with error bars where they are known."""
    data = one.data
    positive = (data.frequency > 0) & (data.value != 0)
    at, value, sigma = data.frequency[positive], data.value[positive], data.uncertainty[positive]
    size, ratio = np.abs(value), np.abs(one.ratio[positive])
    relative = np.where(np.isfinite(sigma), sigma / size, np.nan)
    turn = np.interp(at, one.curve_frequency, modelled)
    phase = curves.to_branch(np.degrees(np.angle(value)), turn)
    few = len(at) <= MANY
    for axes, values, errors in (
        (panels[0], *_scaled(size, relative, decibels)),
        (panels[1], phase, np.stack([np.minimum(np.degrees(relative), 180.0)] * 2)),
        (panels[2], *_scaled(ratio, relative, decibels)),
    ):
        if few:
            bars = np.where(np.isfinite(errors), errors, np.nan)
            axes.errorbar(
                at,
                values,
                yerr=bars if np.isfinite(bars).any() else None,
                fmt="o",
                markersize=2.4,
                markeredgewidth=0,
                linewidth=0.6,
                color=colour,
            )
        else:
            drawn = insert_gaps(values) if axes is panels[1] else values
            axes.plot(at, drawn, ".", color=colour, markersize=1.8, markeredgewidth=0, alpha=0.7)


def _nearby(one: Comparison) -> Any:
    """Measured values, and those of the model within the measured band."""
    at, band = one.curve_frequency, one.data.frequency
    return np.concatenate([one.data.value, one.curve[(at >= band[0]) & (at <= band[-1])]])


def _limit(axes: Axes, sizes: Sequence[Any], decibels: bool, room: float = 0.0) -> None:
    """Set the vertical axis to magnitudes, whatever error bars extend to, with room above."""
    whole = np.concatenate(sizes)
    whole = whole[np.isfinite(whole) & (whole > 0)]
    if not len(whole):
        return
    low, high = 20 * np.log10(whole.min()), 20 * np.log10(whole.max())
    edge = 0.06 * (high - low) + 1.0
    ends = np.array([low - edge, high + edge + room * (high - low)])
    axes.set_ylim(*(ends if decibels else 10 ** (ends / 20)))


def _scaled(size: Any, relative: Any, decibels: bool) -> tuple[Any, Any]:
    """Values on the axis, and the lengths (2, f) of their error bars below and above."""
    below, above = np.clip(relative, 0, 0.999), relative
    if decibels:
        with np.errstate(divide="ignore", invalid="ignore"):
            values = 20 * np.log10(np.where(size > 0, size, np.nan))
        return values, np.stack([-20 * np.log10(1 - below), 20 * np.log10(1 + above)])
    return size, np.stack([size * below, size * above])
