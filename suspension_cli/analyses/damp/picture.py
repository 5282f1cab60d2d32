"""Figure of local control."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter

from suspension_cli.analyses.damp.margins import Margins
from suspension_cli.analyses.damp.solve import LocalControl
from suspension_cli.drawing import curves
from suspension_cli.drawing.style import (
    DOF_COLOUR,
    INK,
    NOTE,
    PALE,
    PALETTE,
    RED,
    add_axes,
    house_style,
    new_figure,
    single_line,
)
from suspension_cli.linear.poles import Poles

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact, Int
    from matplotlib.typing import LineStyleType

LEFT, WIDE, TALL, APART = 0.72, 3.1, 1.45, 2.08
"""Left margin, size and distance of panels, in."""
OPEN = "#9aa1a8"
"""Colour of the open loop."""
ALIKE, SIMILAR = 0.08, 0.35
"""Relative distances in frequency and in rate up to which poles are drawn as one."""
SHOWN = 3
"""Number of loops whose gains are drawn: the most critical ones."""
STRIP = 0.14
"""Height above the poles for labels of Q, as a fraction of the panel."""
NEAR = 40.0
"""Range of gains in the Nichols chart, dB to both sides of 1."""
DECADES = 12
"""Largest number of decades of sensor noise."""
DASHES: tuple[LineStyleType, ...] = (
    "-",
    (0, (5, 1.5)),
    (0, (1.2, 1.2)),
    (0, (5, 1.4, 1.2, 1.4)),
    (0, (8, 1.5)),
    (0, (2, 2)),
)
"""Line styles of the loops, to see one under another."""


COUNT_SHIFTS = np.array(
    [(9, 4), (-9, 4), (9, -5), (-9, -5), (0, 9), (0, -9), (13, 9), (-13, 9), (13, -10), (-13, -10),
     (0, 17), (0, -17), (18, 0), (-18, 0), (18, 16), (-18, 16), (18, -16), (-18, -16)], float
)  # fmt: skip
"""Offsets of the count of poles from its mark, points, best first."""


@dataclass(frozen=True)
class _Line:
    name: str
    gain: Complex[np.ndarray, " frequency"]
    look: tuple[str, LineStyleType]
    margin: Margins | None

    @property
    def colour(self) -> str:
        return self.look[0]


def draw(
    damped: LocalControl,
    title: str,
    gains: tuple[Float[np.ndarray, " frequency"], Complex[np.ndarray, "frequency loop"]]
    | None = None,
) -> Figure:
    """Draw the figure of `pendsus damp`; `title` names design and model.

    `gains` are frequencies (f,) in Hz and loop gains (f, l) with resonances resolved; by default
    those of `damped`.
    """
    frequency, gain = gains or (damped.frequency, damped.gain)
    looks = _looks(damped.loop)
    growing = {
        damped.closed.state[n].rpartition(".")[2] for n in np.flatnonzero(damped.closed.growth_rate)
    }
    critical = find_critical(gain, [name in growing for name in damped.loop])
    with house_style():
        figure = new_figure(curves.COLUMN, 0.62 + 6 * APART)
        poles, impulse, size, noise, phase, nichols = (
            add_axes(figure, LEFT, 0.8 + row * APART, WIDE, TALL) for row in (0, 1, 3, 2, 4, 5)
        )
        for axes in (poles, impulse, size, noise, phase, nichols):
            curves.rule(axes)
        margins = damped.margin or [None] * len(damped.loop)
        lines = [_Line(damped.loop[n], gain[:, n], looks[n], margins[n]) for n in critical]
        _draw_poles(poles, damped)
        _draw_impulse(impulse, damped)
        _draw_gains(size, frequency, lines, len(damped.loop))
        _draw_noise(noise, damped, looks)
        _draw_phases(phase, frequency, lines)
        _draw_nichols(nichols, frequency, lines)
        curves.write_heading(figure, _heading_text(damped), title)
        return figure


def _heading_text(damped: LocalControl) -> str:
    """Write the heading: whether the closed loop is stable, or what grows fastest."""
    if damped.stable:
        return "Local control: closed loop stable"
    rate = damped.closed.growth_rate
    worst = int(rate.argmax())
    where = single_line(damped.closed.state[worst], 14)
    return f"Local control UNSTABLE: {where} grows at {rate[worst]:.3g}/s"


def find_critical(
    gain: Inexact[np.ndarray, "frequency loop"], first: Sequence[bool]
) -> Int[np.ndarray, " critical"]:
    """Find the loops marked in `first` (l), then those whose gains (f, l) come nearest to -1.

    >>> find_critical(np.array([[-0.9, 0.1, -0.5, -0.8]]), [False, True, False, False]).tolist()
    [0, 1, 3]
    """
    distance = np.where(first, -1.0, np.nanmin(np.abs(1 + gain), axis=0))
    return np.sort(distance.argsort(kind="stable")[:SHOWN])


def _looks(loops: Sequence[str]) -> list[tuple[str, LineStyleType]]:
    """Colour and dashes of each loop; the colour of its motion if all are named after motions."""
    colours = (
        [DOF_COLOUR[name] for name in loops]
        if all(name in DOF_COLOUR for name in loops)
        else [PALETTE[n % len(PALETTE)] for n in range(len(loops))]
    )
    return [(colour, DASHES[n % len(DASHES)]) for n, colour in enumerate(colours)]


def _name(axes: Axes, text: str) -> None:
    axes.set_title(text, loc="left", fontsize=8, color=INK, pad=3)


def _draw_poles(axes: Axes, damped: LocalControl) -> None:
    """Draw poles by rate (symmetric log) and frequency (log)."""
    both = (damped.open, damped.closed)
    real = np.concatenate([np.real(poles.value) for poles in both])
    sizes = np.abs(real[real != 0])
    high = 10 ** np.ceil(np.log10(sizes.max(initial=1.0)))
    least = 10 ** np.floor(np.log10(max(sizes.min(initial=high), 1e-9 * high)))
    frequency = np.concatenate([poles.frequency for poles in both])
    frequency = frequency[frequency > 0]
    axes.set_xscale("symlog", linthresh=least, linscale=0.8)
    axes.set_yscale("log")
    grows = bool((real > 0).any())
    right = 10 ** np.ceil(np.log10(max(real.max(), least))) if grows else 2 * least
    axes.set_xlim(-2 * high, right)
    low, top = frequency.min() / 1.5, frequency.max() * 1.5
    axes.set_ylim(low, top * (top / low) ** (STRIP / (1 - STRIP)))
    axes.axvspan(0, right * 10, color=RED, alpha=0.08, linewidth=0)
    axes.axvline(0, color=INK, linewidth=0.6)
    _draw_q(axes, least, high)
    counts: list[tuple[float, float, str, str]] = []
    for poles, marker, size, wide, label in (
        (damped.open, "o", 4.0, 0.7, "open"),
        (damped.closed, "x", 4.5, 1.1, "closed"),
    ):
        colour = OPEN if marker == "o" else PALETTE[0]
        for rate, at, count in _group(poles):
            own = RED if rate > 0 and marker == "x" else colour
            axes.plot(
                rate,
                at,
                marker,
                color=own,
                fillstyle="none",
                markersize=size,
                markeredgewidth=wide,
                linestyle="none",
                label=label,
                zorder=3 + (marker == "x"),
            )
            label = ""
            if count > 1 and marker == "x":
                counts.append((rate, at, f"×{count}", own))
    _write_counts(axes, counts, [*_group(damped.open), *_group(damped.closed)])
    every = np.arange(round(np.log10(high)), round(np.log10(least)) - 1, -1.0)
    step = int(np.ceil(len(every) / (3 if grows else 4)))
    for powers, minor in ((every[:-1:step], False), (every, True)):
        ticks = [*(-(10.0**powers)), *([] if minor else [0.0]), *(10.0**powers)]
        axes.set_xticks([tick for tick in ticks if tick <= right * grows], minor=minor)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: curves.write_plainly(x)))
    curves.label_plainly(axes.yaxis)
    axes.set_xlabel("Re pole (1/s), unstable right of 0")
    axes.set_ylabel("|pole|/2π (Hz)")
    _name(axes, "poles")
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.02, 1.0), ncols=2, fontsize=7.5, handletextpad=0.1,
        columnspacing=0.8, borderaxespad=0.0,
    )  # fmt: skip


def _write_counts(
    axes: Axes,
    counts: Sequence[tuple[float, float, str, str]],
    poles: Sequence[tuple[float, float, int]],
) -> None:
    """Write counts of poles beside their marks, clear of other counts and marks."""
    pixel = 72 / axes.figure.dpi

    def place(points: Sequence[tuple[float, float]]) -> Float[np.ndarray, "point 2"]:
        return axes.transData.transform(np.reshape(points, (-1, 2))) * pixel

    marks = place([(rate, at) for rate, at, _ in poles])
    taken = np.zeros((0, 2))
    frame = np.array(axes.get_window_extent().extents) * pixel + np.array([9.0, 6.0, -9.0, -6.0])
    for rate, at, text, colour in counts:
        middle = place([(rate, at)])[0] + COUNT_SHIFTS
        room = [
            min(_distance(marks - one, (8.0, 6.0)), _distance(taken - one, (16.0, 9.0)))
            * ((one >= frame[:2]) & (one <= frame[2:])).all()
            for one in middle
        ]
        best = next((n for n, free in enumerate(room) if free >= 1.0), int(np.argmax(room)))
        taken = np.vstack([taken, middle[best]])
        axes.annotate(
            text, (rate, at), COUNT_SHIFTS[best], textcoords="offset points", ha="center",
            va="center", fontsize=7.5, color=colour,
            path_effects=[withStroke(linewidth=1.6, foreground="white")],  # over lines of Q
        )  # fmt: skip


def _distance(apart: Float[np.ndarray, "point 2"], size: tuple[float, float]) -> float:
    """Smallest of distances (k, 2) in units of `size`; at most 9."""
    return float(np.abs(apart / size).max(1).min(initial=9.0)) if len(apart) else 9.0


def _group(poles: Poles) -> list[tuple[float, float, int]]:
    """Rates (1/s), frequencies (Hz) and counts of poles, similar ones as one."""
    found: list[list[float]] = []
    for rate, at in zip(np.real(poles.value), poles.frequency, strict=True):
        if at <= 0:
            continue
        for one in found:
            alike = abs(one[1] / at - 1) < ALIKE and abs(one[0] - rate) <= SIMILAR * abs(rate)
            if alike:
                one[2] += 1
                break
        else:
            found.append([float(rate), float(at), 1])
    return [(rate, at, int(count)) for rate, at, count in found]


def _draw_q(axes: Axes, least: float, high: float) -> None:
    """Draw lines of constant Q, labelled above the poles where there is room."""
    (low, top), free = axes.get_ylim(), -np.inf
    pixel = axes.figure.dpi / 72
    for power in range(0, 12, 2):
        q = 10.0**power
        at = np.array([max(low, least * q / np.pi), min(top, high * q / np.pi)])
        if at[0] >= at[1]:
            continue
        rate = -np.pi * at / q
        axes.plot(rate, at, color=PALE, linewidth=0.7, zorder=1)
        text = f"Q {curves.write_plainly(q)}"
        start = axes.transData.transform((rate[1], top))[0] / pixel
        if rate[1] < -least and top * 0.98 <= at[1] and start > free:
            free = start + 4.5 * (len(text) - 5 * ("{" in text)) + 3.0
            axes.annotate(
                text,
                (rate[1], top),
                (2, -2),
                textcoords="offset points",
                fontsize=7.5,
                color=NOTE,
                va="top",
                ha="left",
                annotation_clip=True,
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.3},
            )


def _draw_impulse(axes: Axes, damped: LocalControl) -> None:
    axes.plot(damped.time, damped.undamped, color=OPEN, alpha=0.55, linewidth=0.5)
    axes.plot(damped.time, damped.impulse, color=PALETTE[0], linewidth=1.1)
    axes.set_xlabel("time (s)")
    dof = damped.drive.partition("@")[0].rpartition(".")[2]
    units = {"force_": "N", "torque_": "N m"}
    unit = next((units[kind] for kind in units if dof.startswith(kind)), _unit(damped.drive))
    axes.set_ylabel(single_line(f"{damped.output} ({_unit(damped.output)})", 30))
    _name(axes, single_line(f"response to 1 {unit} s of {damped.drive}", 44))
    axes.margins(x=0, y=0.05)
    ends = [
        (damped.time, damped.impulse, "closed", PALETTE[0]),
        (damped.time, damped.undamped, "open", OPEN),
    ]
    curves.label_ends(axes, ends)


def _draw_gains(
    axes: Axes, frequency: Float[np.ndarray, " frequency"], lines: Sequence[_Line], loops: int
) -> None:
    axes.set_yscale("log")
    sizes = [np.abs(line.gain) for line in lines]
    which = f" of the {SHOWN} most critical of {loops} loops" if loops > len(lines) else ""
    _draw_over_frequency(axes, frequency, sizes, lines, f"loop gain{which}, others closed")
    axes.axhline(1.0, color=INK, linewidth=0.6, linestyle="--")
    axes.set_ylabel("|loop gain| (ratio)")
    curves.label_plainly(axes.yaxis)
    _label_lines(axes, frequency, sizes, lines)


def _draw_phases(
    axes: Axes, frequency: Float[np.ndarray, " frequency"], lines: Sequence[_Line]
) -> None:
    phases = [curves.unwrap_phase(line.gain) for line in lines]
    title = "phase of the loop gain; dots: phase margins"
    _draw_over_frequency(axes, frequency, phases, lines, title)
    for phase, line in zip(phases, lines, strict=True):
        where = line.margin.phase_frequency if line.margin is not None else np.nan
        if frequency[0] <= where <= frequency[-1]:
            at = np.interp(np.log(where), np.log(frequency), phase)
            axes.plot(where, at, "o", color=line.colour, markersize=3.5, zorder=4)
    axes.set_ylabel("phase (degrees)")
    curves.label_phases(axes)
    _label_lines(axes, frequency, phases, lines)


def _draw_over_frequency(
    axes: Axes,
    frequency: Float[np.ndarray, " frequency"],
    values: Sequence[Float[np.ndarray, " frequency"]],
    lines: Sequence[_Line],
    title: str,
) -> None:
    axes.set_xscale("log")
    for value, line in zip(values, lines, strict=True):
        colour, dashes = line.look
        axes.plot(frequency, value, color=colour, linestyle=dashes, linewidth=0.9)
    axes.set_xlabel("frequency (Hz)")
    axes.margins(x=0)
    _name(axes, title)


def _label_lines(
    axes: Axes,
    frequency: Float[np.ndarray, " frequency"],
    values: Sequence[Float[np.ndarray, " frequency"]],
    lines: Sequence[_Line],
) -> None:
    pairs = zip(values, lines, strict=True)
    ends = [(frequency, value, line.name, line.colour) for value, line in pairs]
    curves.label_ends(axes, ends, most=10)


def _draw_nichols(
    axes: Axes, frequency: Float[np.ndarray, " frequency"], lines: Sequence[_Line]
) -> None:
    """Draw loop gains against phases from -270 to 90 degrees, with margins."""
    turn = np.linspace(0, 2 * np.pi, 181)[1:-1]
    circle = -1 + 0.5 * np.exp(1j * turn)
    phase = (np.degrees(np.angle(circle)) + 270) % 360 - 270
    axes.plot(phase, 20 * np.log10(np.abs(circle)), color=NOTE, linewidth=0.7, linestyle="--")
    axes.plot(-180, 0, "+", color=INK, markersize=7)
    for line in lines:
        _draw_branches(axes, line)
        if line.margin is None:
            continue
        for factor in (line.margin.gain_up, line.margin.gain_down):
            if 0 < factor < np.inf:
                axes.plot(-180, -20 * np.log10(factor), "o", color=line.colour, markersize=3.5)
        where = line.margin.phase_frequency
        if frequency[0] <= where <= frequency[-1]:
            near = line.gain[np.abs(frequency - where).argmin()]
            side = np.sign(np.angle(-near)) or 1.0
            at = (-180 + side * line.margin.phase + 270) % 360 - 270
            axes.plot(at, 0, "o", color=line.colour, markersize=3.5, zorder=4)
    axes.axhline(0.0, color=INK, linewidth=0.4)
    axes.set_xlim(-270, 90)
    axes.set_xticks([-270, -180, -90, 0, 90])
    axes.set_ylim(-NEAR, NEAR)
    axes.set_xlabel("phase of the loop gain (degrees)")
    axes.set_ylabel("loop gain (dB)")
    _name(axes, f"±{NEAR:g} dB around −1 (+); dots: margins")
    axes.annotate(
        "$|1+L|=\\frac{1}{2}$", (-180, 6.5), ha="center", va="bottom", fontsize=7.5, color=NOTE
    )


def _draw_branches(axes: Axes, line: _Line) -> None:
    """Draw a loop gain in the Nichols chart, once per turn of its phase."""
    phase = curves.unwrap_phase(line.gain)
    size = 20 * np.log10(np.maximum(np.abs(line.gain), np.finfo(float).tiny))
    turns = np.floor((phase[np.isfinite(phase)] + 270) / 360)
    for number in range(int(turns.min(initial=0)), int(turns.max(initial=-1)) + 1):
        own = phase - 360 * number
        seen = (own > -300) & (own < 120) & (np.abs(size) < 1.5 * NEAR)
        if seen.any():
            seen = seen | np.roll(seen, 1) | np.roll(seen, -1)  # so that lines reach the edges
            kept = seen | np.roll(seen, 1)  # and one gap after each part
            axes.plot(
                np.where(seen, own, np.nan)[kept], size[kept], color=line.colour,
                linestyle=line.look[1], linewidth=0.8,
            )  # fmt: skip
            _mark_exits(axes, own, size, line.colour)


def _mark_exits(
    axes: Axes,
    phase: Float[np.ndarray, " frequency"],
    size: Float[np.ndarray, " frequency"],
    colour: str,
) -> None:
    """Mark with arrowheads where a curve leaves the chart."""
    for edge, marker in ((NEAR, "^"), (-NEAR, "v")):
        crossed = np.flatnonzero((size[:-1] - edge) * (size[1:] - edge) < 0)
        crossed = crossed[np.abs(phase[crossed] + 90) < 180]
        if len(crossed):
            axes.plot(
                phase[crossed], np.full(len(crossed), edge), marker, color=colour, markersize=2.5,
                clip_on=False,
            )  # fmt: skip


def _unit(motion: str) -> str:
    return "m" if motion.split("@")[0].endswith((".x", ".y", ".z")) else "rad"


def _draw_noise(axes: Axes, damped: LocalControl, looks: list[tuple[str, LineStyleType]]) -> None:
    axes.set_xscale("log")
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel(single_line(f"{damped.output} ({_unit(damped.output)}/√Hz)", 32))
    _name(axes, "sensor noise at the output")
    total = np.sqrt((damped.noise**2).sum(1))
    if not total.any():
        text = "no sensor noise reaches this output"
        where = axes.transAxes
        axes.text(0.5, 0.5, text, ha="center", va="center", transform=where, color=NOTE)
        return
    axes.set_yscale("log")
    axes.plot(damped.frequency, total, color=INK, linewidth=2.0)
    ends = [(damped.frequency, total, "sum", INK)]
    for name, noise, (colour, dashes) in zip(damped.loop, damped.noise.T, looks, strict=True):
        if noise.any():
            part = np.where(noise > 0, noise, np.nan)
            axes.plot(damped.frequency, part, color=colour, linestyle=dashes, linewidth=0.9)
            ends.append((damped.frequency, part, name, colour))
    top = 3 * total.max()
    axes.set_ylim(max(total[total > 0].min() / 30, top / 10**DECADES), top)
    axes.margins(x=0)
    curves.label_plainly(axes.yaxis)
    curves.label_ends(axes, ends, most=10)
