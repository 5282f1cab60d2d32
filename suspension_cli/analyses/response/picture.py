"""Bode plots of frequency responses."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.drawing.style import INK, NOTE, PALE, PALETTE, house_style, new_figure
from suspension_cli.linear.response import Response

MANY = 8
"""Number of curves per column of the legend."""


def draw(response: Response, title: str, scale: str = "db") -> Figure:
    """Draw magnitude and phase of every response against frequency.

    Parameters
    ----------
    response : Response
    title : str
    scale : {"db", "absolute"}
        Magnitude axis: 20 log10 of the SI value, or the value itself on a log axis.
    """
    with house_style():
        figure = new_figure(6.3, 4.8)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
        curves = [(o, i) for o in range(len(response.output)) for i in range(len(response.input))]
        for n, (o, i) in enumerate(curves):
            draw_magnitude(
                upper,
                response.frequency,
                response.value[:, o, i],
                scale,
                PALETTE[n % len(PALETTE)],
                f"{response.output[o]} / {response.input[i]}",
            )
            phase = np.degrees(np.angle(response.value[:, o, i]))
            lower.plot(response.frequency, insert_gaps(phase), color=PALETTE[n % len(PALETTE)])
        upper.set_ylabel(_magnitude_label(response, scale))
        lower.set_ylabel("phase (degrees)")
        lower.set_xlabel("frequency (Hz)")
        lower.set_ylim(-190, 190)
        lower.set_yticks([-180, -90, 0, 90, 180])
        for axes in (upper, lower):
            axes.set_xscale(
                "log" if response.frequency[0] > 0 and len(response.frequency) > 1 else "linear"
            )
            axes.grid(visible=True, which="major", color=PALE, linewidth=0.4)
            axes.margins(x=0)
        upper.set_title(title, loc="left", color=INK)
        if len(curves) > 1:
            upper.legend(fontsize=6.5 if len(curves) > MANY else 7.5, ncols=1 + len(curves) // MANY)
        else:
            upper.text(
                0.99,
                0.95,
                f"{response.output[0]} / {response.input[0]}",
                transform=upper.transAxes,
                ha="right",
                va="top",
                color=NOTE,
            )
        figure.tight_layout()
        return figure


def draw_magnitude(
    axes: Axes, frequency: np.ndarray, value: np.ndarray, scale: str, colour: str, label: str
) -> None:
    """Draw the magnitude of one response; exact zeros are left out."""
    size = np.where(value == 0, np.nan, np.abs(value))
    if scale == "db":
        axes.plot(frequency, 20 * np.log10(size), color=colour, label=label)
    else:
        axes.semilogy(frequency, size, color=colour, label=label)


def insert_gaps(phase: np.ndarray) -> np.ndarray:
    """Insert a gap where the phase (degrees) wraps, so that no vertical line is drawn there."""
    result = phase.astype(float).copy()
    result[1:][np.abs(np.diff(phase)) > 270] = np.nan
    return result


def _magnitude_label(response: Response, scale: str) -> str:
    units = {unit for row in response.unit for unit in row}
    unit = units.pop() if len(units) == 1 else "SI units"
    if scale == "db":
        return "magnitude (dB)" if unit == "m/m" else f"magnitude (dB re 1 {unit})"
    return f"magnitude ({unit})"
