"""Figure of local control: poles, impulse response, sensor noise, loop gains and Nichols chart."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.damp.solve import LocalControl
from suspension_cli.drawing.style import NOTE, PALE, PALETTE, house_style, new_figure

HIGHEST_Q = 1e5
"""Largest Q drawn; poles without loss are drawn there."""
LOWEST = -80.0
"""Lowest gain in the Nichols chart, dB."""


def draw(damped: LocalControl, title: str) -> Figure:
    """Draw the figure of `pendsus damp`."""
    with house_style():
        figure = new_figure(7.2, 8.0)
        (poles, impulse), (gain, noise), (phase, nichols) = figure.subplots(3, 2)
        _draw_poles(poles, damped)
        _draw_impulse(impulse, damped)
        _draw_gains(gain, damped)
        _draw_noise(noise, damped)
        _draw_phases(phase, damped)
        _draw_nichols(nichols, damped)
        for axes in (poles, impulse, gain, noise, phase, nichols):
            axes.grid(visible=True, which="major", color=PALE, linewidth=0.4)
        figure.suptitle(title, x=0.01, ha="left", fontsize=9)
        figure.tight_layout()
        return figure


def _draw_poles(axes: Axes, damped: LocalControl) -> None:
    for poles, marker, colour, label in (
        (damped.open, "o", NOTE, "loops open"),
        (damped.closed, "x", PALETTE[1], "loops closed"),
    ):
        oscillates = (np.imag(poles.value) > 0) & (poles.frequency > 0)
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
    dof = damped.drive.partition("@")[0].rpartition(".")[2]
    units = {"force_": "N", "torque_": "N m"}
    unit = next((units[kind] for kind in units if dof.startswith(kind)), _unit(damped.drive))
    axes.set_ylabel(f"{damped.output} ({_unit(damped.output)})")
    axes.set_title(f"after an impulse of 1 {unit} s of {damped.drive}", fontsize=7.5, loc="left")
    axes.margins(x=0, y=0.2)
    axes.legend(ncols=2, loc="upper right", fontsize=6.5)


def _draw_gains(axes: Axes, damped: LocalControl) -> None:
    for n, name in enumerate(damped.loop):
        axes.loglog(
            damped.frequency, np.abs(damped.gain[:, n]), color=PALETTE[n % len(PALETTE)], label=name
        )
    axes.axhline(1.0, color=NOTE, linewidth=0.6, linestyle="--")
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel("|loop gain|, other loops closed")
    axes.margins(x=0)
    axes.legend(fontsize=6.5)


def _draw_phases(axes: Axes, damped: LocalControl) -> None:
    """Draw unwrapped phases, with a dot at each phase margin."""
    for n in range(len(damped.loop)):
        phase = np.degrees(np.unwrap(np.angle(damped.gain[:, n])))
        colour = PALETTE[n % len(PALETTE)]
        axes.semilogx(damped.frequency, phase, color=colour)
        if damped.margin is not None:
            where = damped.margin[n].phase_frequency
            if damped.frequency[0] <= where <= damped.frequency[-1]:
                at = np.interp(np.log(where), np.log(damped.frequency), phase)
                axes.plot(where, at, "o", color=colour, markersize=3.5)
    low, high = axes.get_ylim()
    axes.set_yticks(_quarters(low, high))
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel("phase of the loop gain (degrees)")
    axes.set_title("dots: smallest phase margins", fontsize=7, loc="left")
    axes.margins(x=0)


def _quarters(low: float, high: float) -> np.ndarray:
    """Multiples of 90 degrees, or of more where these are many."""
    step = 90.0 * max(1.0, np.ceil((high - low) / 90.0 / 8))
    return np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step


def _draw_nichols(axes: Axes, damped: LocalControl) -> None:
    """Draw loop gains against phases from -270 to 90 degrees, with -1 and the gain margins."""
    turn = np.linspace(0, 2 * np.pi, 181)[1:-1]
    circle = -1 + 0.5 * np.exp(1j * turn)
    axes.plot(*_nichols(circle), color=NOTE, linewidth=0.7, linestyle="--")
    axes.plot(-180, 0, "+", color=NOTE, markersize=7)
    for n in range(len(damped.loop)):
        colour = PALETTE[n % len(PALETTE)]
        phase, size = _nichols(damped.gain[:, n])
        jumps = (np.abs(np.diff(phase)) > 60) | (np.abs(np.diff(size)) > 20)
        phase[1:][jumps] = np.nan  # across a resonance narrower than the grid, or the edge
        axes.plot(phase, size, color=colour, linewidth=0.8)
        if damped.margin is None:
            continue
        margin = damped.margin[n]
        for factor in (margin.gain_up, margin.gain_down):
            if 0 < factor < np.inf:
                axes.plot(-180, -20 * np.log10(factor), "o", color=colour, markersize=3.5)
        where = margin.phase_frequency
        if damped.frequency[0] <= where <= damped.frequency[-1]:
            near = damped.gain[np.abs(damped.frequency - where).argmin(), n]
            side = np.sign(np.angle(-near)) or 1.0
            at = (-180 + side * margin.phase + 270) % 360 - 270
            axes.plot(at, 0, "o", color=colour, markersize=3.5)
    axes.axhline(0.0, color=NOTE, linewidth=0.4)
    axes.set_xlim(-270, 90)
    axes.set_xticks([-270, -180, -90, 0, 90])
    low, high = axes.get_ylim()
    axes.set_ylim(max(low, LOWEST), min(high, -LOWEST))
    axes.set_xlabel("phase of the loop gain (degrees)")
    axes.set_ylabel("loop gain (dB)")
    axes.set_title("dots: margins; dashed: |1 + L| = 1/2", fontsize=7, loc="left")


def _nichols(gain: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Phases from -270 to 90 degrees and magnitudes in dB of complex gains."""
    phase = (np.degrees(np.angle(gain)) + 270) % 360 - 270
    return phase, 20 * np.log10(np.maximum(np.abs(gain), np.finfo(float).tiny))


def _unit(motion: str) -> str:
    return "m" if motion.split("@")[0].endswith((".x", ".y", ".z")) else "rad"


def _draw_noise(axes: Axes, damped: LocalControl) -> None:
    unit = _unit(damped.output)
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
