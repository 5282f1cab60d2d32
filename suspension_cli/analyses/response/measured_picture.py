"""Measured transfer functions over those of a model: magnitude, phase and ratio."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.response.measured import Comparison
from suspension_cli.analyses.response.picture import draw_magnitude, insert_gaps
from suspension_cli.drawing.style import (
    INK,
    NOTE,
    PALE,
    PALETTE,
    house_style,
    new_figure,
    single_line,
)

MANY = 300
"""Number of points above which they are drawn as a thin line without error bars."""


def draw(measured: Sequence[Comparison], title: str, scale: str = "db") -> Figure:
    """Draw magnitude and phase, measured and modelled, and below the magnitude of their ratio.

    Parameters
    ----------
    measured : sequence of Comparison
    title : str
    scale : {"db", "absolute"}
        Magnitude axis: 20 log10 of the SI value, or the value itself on a log axis.
    """
    with house_style():
        figure = new_figure(6.3, 6.2)
        upper, middle, lower = figure.subplots(3, 1, sharex=True, height_ratios=[2, 1, 1])
        decibels, units = scale == "db", {one.data.unit for one in measured}
        for n, one in enumerate(measured):
            colour = PALETTE[n % len(PALETTE)]
            _draw_model(upper, middle, one, scale, colour)
            unit = one.data.unit if len(units) > 1 else ""
            label = single_line(one.data.name, 60) + (f" ({unit})" if unit else "")
            _draw_measured((upper, middle, lower), one, decibels, colour, label)
        lower.axhline(0 if decibels else 1, color=INK, linewidth=0.6)
        upper.set_ylabel(_magnitude_label(units, decibels))
        middle.set_ylabel("phase (degrees)")
        middle.set_ylim(-190, 190)
        middle.set_yticks([-180, -90, 0, 90, 180])
        lower.set_ylabel("measured/model (dB)" if decibels else "|measured/model|")
        lower.set_xlabel("frequency (Hz)")
        lower.set_xscale("log")
        if not decibels:
            lower.set_yscale("log")
        _limit(upper, [np.abs(_nearby(one)) for one in measured], decibels)
        _limit(lower, [np.abs(one.ratio[one.clear]) for one in measured], decibels)
        for axes in (upper, middle, lower):
            axes.grid(visible=True, which="major", color=PALE, linewidth=0.4)
            axes.margins(x=0)
        upper.set_title(single_line(title), loc="left", color=INK)
        upper.legend(fontsize=7, title="points: measured; lines: model", title_fontsize=6.5)
        upper.get_legend().get_title().set_color(NOTE)
        figure.tight_layout()
        return figure


def _draw_model(upper: Axes, middle: Axes, one: Comparison, scale: str, colour: str) -> None:
    at = one.curve_frequency
    draw_magnitude(upper, at, one.curve, scale, colour, "_model")
    middle.plot(at, insert_gaps(np.degrees(np.angle(one.curve))), color=colour)


def _draw_measured(
    panels: tuple[Axes, Axes, Axes], one: Comparison, decibels: bool, colour: str, name: str
) -> None:
    """Draw points of magnitude, phase and ratio, with error bars where they are known."""
    data = one.data
    positive = (data.frequency > 0) & (data.value != 0)
    at, value, sigma = data.frequency[positive], data.value[positive], data.uncertainty[positive]
    size, ratio = np.abs(value), np.abs(one.ratio[positive])
    relative = np.where(np.isfinite(sigma), sigma / size, np.nan)
    phase = np.degrees(np.angle(value))
    few = len(at) <= MANY
    for axes, values, errors in (
        (panels[0], *_scaled(size, relative, decibels)),
        (panels[1], phase, np.stack([np.degrees(relative)] * 2)),
        (panels[2], *_scaled(ratio, relative, decibels)),
    ):
        label = name if axes is panels[0] else None
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
                label=label,
            )
        else:
            drawn = insert_gaps(values) if axes is panels[1] else values
            axes.plot(at, drawn, color=colour, linewidth=0.5, alpha=0.7, label=label)


def _nearby(one: Comparison) -> Any:
    """Measured values, and those of the model within the measured band."""
    at, band = one.curve_frequency, one.data.frequency
    return np.concatenate([one.data.value, one.curve[(at >= band[0]) & (at <= band[-1])]])


def _limit(axes: Axes, sizes: Sequence[Any], decibels: bool) -> None:
    """Set the vertical axis to magnitudes, whatever error bars extend to."""
    whole = np.concatenate(sizes)
    whole = whole[np.isfinite(whole) & (whole > 0)]
    if not len(whole):
        return
    low, high = 20 * np.log10(whole.min()), 20 * np.log10(whole.max())
    room = 0.06 * (high - low) + 1.0
    ends = np.array([low - room, high + room])
    axes.set_ylim(*(ends if decibels else 10 ** (ends / 20)))


def _scaled(size: Any, relative: Any, decibels: bool) -> tuple[Any, Any]:
    """Values on the axis, and the lengths (2, f) of their error bars below and above."""
    below, above = np.clip(relative, 0, 0.999), relative
    if decibels:
        with np.errstate(divide="ignore", invalid="ignore"):
            values = 20 * np.log10(np.where(size > 0, size, np.nan))
        return values, np.stack([-20 * np.log10(1 - below), 20 * np.log10(1 + above)])
    return size, np.stack([size * below, size * above])


def _magnitude_label(units: set[str], decibels: bool) -> str:
    unit = next(iter(units)) if len(units) == 1 else ""
    if decibels:
        return f"magnitude (dB re 1 {unit})" if unit not in ("", "m/m") else "magnitude (dB)"
    return f"magnitude ({unit})" if unit else "magnitude"
