"""Figure of local control: poles, impulse response, loop gains, sensor noise."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.damp.solve import LocalControl
from suspension_cli.drawing.style import NOTE, PALE, PALETTE, house_style, new_figure

HIGHEST_Q = 1e5
"""Largest Q drawn; poles without loss are drawn there."""


def draw(damped: LocalControl, title: str) -> Figure:
    """Draw the figure of `pendsus damp`."""
    with house_style():
        figure = new_figure(7.2, 5.6)
        (poles, impulse), (gain, noise) = figure.subplots(2, 2)
        _draw_poles(poles, damped)
        _draw_impulse(impulse, damped)
        _draw_gains(gain, damped)
        _draw_noise(noise, damped)
        for axes in (poles, impulse, gain, noise):
            axes.grid(visible=True, which="major", color=PALE, linewidth=0.4)
        figure.suptitle(title, x=0.01, ha="left", fontsize=9)
        figure.tight_layout()
        return figure


def _draw_poles(axes: Axes, damped: LocalControl) -> None:
    for poles, marker, colour, label in (
        (damped.open, "o", NOTE, "loops open"),
        (damped.closed, "x", PALETTE[1], "loops closed"),
    ):
        oscillates = (poles.value.imag > 0) & (poles.frequency > 0)
        q = np.where(poles.q[oscillates] > 0, np.minimum(poles.q[oscillates], HIGHEST_Q), HIGHEST_Q)
        axes.loglog(
            poles.frequency[oscillates],
            q,
            marker,
            color=colour,
            label=label,
            fillstyle="none",
            markersize=5,
        )
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel(f"Q (at most {HIGHEST_Q:g} drawn)")
    axes.legend()


def _draw_impulse(axes: Axes, damped: LocalControl) -> None:
    axes.plot(damped.time, damped.undamped, color=PALE, label="loops open", linewidth=0.7)
    axes.plot(damped.time, damped.impulse, color=PALETTE[0], label="loops closed")
    axes.set_xlabel("time (s)")
    axes.set_ylabel(f"{damped.output} (SI)")
    axes.set_title(f"after a unit impulse of {damped.drive}", fontsize=7.5, loc="left")
    axes.margins(x=0, y=0.2)
    axes.legend(ncols=2, loc="upper right", fontsize=6.5)


def _draw_gains(axes: Axes, damped: LocalControl) -> None:
    for n, name in enumerate(damped.loop):
        axes.loglog(
            damped.frequency, np.abs(damped.gain[:, n]), color=PALETTE[n % len(PALETTE)], label=name
        )
    axes.axhline(1.0, color=NOTE, linewidth=0.6, linestyle="--")
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel("loop gain, others closed")
    axes.margins(x=0)
    axes.legend(fontsize=6.5)


def _draw_noise(axes: Axes, damped: LocalControl) -> None:
    unit = "m" if damped.output.split("@")[0].endswith((".x", ".y", ".z")) else "rad"
    drawn = False
    for n, name in enumerate(damped.loop):
        if damped.noise[:, n].any():
            axes.loglog(
                damped.frequency,
                np.where(damped.noise[:, n] > 0, damped.noise[:, n], np.nan),
                color=PALETTE[n % len(PALETTE)],
                label=name,
            )
            drawn = True
    if drawn:
        axes.loglog(
            damped.frequency,
            np.sqrt((damped.noise**2).sum(1)),
            color="black",
            linewidth=0.7,
            linestyle=":",
            label="sum",
        )
        axes.legend(fontsize=6.5)
    else:
        axes.text(
            0.5,
            0.5,
            "no sensor noise reaches this output",
            ha="center",
            va="center",
            transform=axes.transAxes,
            color=NOTE,
        )
        axes.set_xscale("log")
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel(f"sensor noise at {damped.output} ({unit}/√Hz)")
    axes.yaxis.label.set_fontsize(7)
    axes.margins(x=0)
