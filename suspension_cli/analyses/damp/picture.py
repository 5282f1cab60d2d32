"""Figure of local control."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from suspension_cli.analyses.damp import control
from suspension_cli.analyses.damp.margins import Margins
from suspension_cli.analyses.damp.solve import LocalControl
from suspension_cli.drawing import curves, labels, panels
from suspension_cli.drawing.added_points import add_from_model
from suspension_cli.drawing.panels import Across, Line, Panel, Rule
from suspension_cli.drawing.style import (
    DOF_COLOUR,
    INK,
    NOTE,
    PALE,
    PALETTE,
    RED,
    LineLook,
    format_raised,
    single_line,
)
from suspension_cli.linear.poles import Poles

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact, Int
    from matplotlib.typing import LineStyleType

    from suspension_cli.analyses.analysis import Result
    from suspension_cli.drawing.added_points import Solve
    from suspension_cli.scene.arrays import Array

TALL = 1.45
"""Height of panels, in."""
OPEN = "#9aa1a8"
"""Colour of the open loop."""
ALIKE, SIMILAR = 0.08, 0.35
"""Relative distances in frequency and in rate up to which poles are drawn as one."""
SHOWN = 3
"""Number of loops whose gains are drawn: the most critical ones."""
NEAR = 40.0
"""Range of gains in the Nichols chart, dB to both sides of 1."""
NICHOLS = -270.0
"""Least phase in the Nichols chart, degrees."""
DASHES: tuple[LineStyleType, ...] = (*panels.DASHES, (0, (8, 1.5)), (0, (2, 2)))
"""Line styles of the loops, to see one under another."""
PROBE: LineLook = {"linestyle": "none", "marker": "o", "markersize": 4, "fillstyle": "none"}
"""Marks of poles of the open loop."""
CROSS: LineLook = {
    "zorder": 4,
    "linestyle": "none",
    "marker": "x",
    "markersize": 4.5,
    "markeredgewidth": 1.1,
}
"""Marks of poles of the closed loop."""


@dataclass(frozen=True)
class _Line:
    name: str
    gain: Complex[np.ndarray, " frequency"]
    look: tuple[str, LineStyleType]
    margin: Margins | None

    def line(
        self, frequency: Float[np.ndarray, " frequency"], value: Inexact[np.ndarray, " frequency"]
    ) -> Line:
        """Line of a quantity of the loop."""
        return Line(frequency, value, self.name, self.look[0], {"linestyle": self.look[1]})


def draw(
    damped: LocalControl,
    title: str,
    gains: tuple[Float[np.ndarray, " frequency"], Complex[np.ndarray, "frequency loop"]]
    | None = None,
    chosen: Sequence[int] = (),
) -> Figure:
    """Draw the figure of `pendsus damp`; `title` names design and model.

    `gains` are frequencies (f,) in Hz and loop gains (f, l) with resonances resolved; by default
    those of `damped`. `chosen` are the loops whose gains are drawn; by default the most critical.
    """
    frequency, gain = gains or (damped.frequency, damped.gain)
    looks, margins = _looks(damped.loop), damped.margin or [None] * len(damped.loop)
    growing = {
        damped.closed.state[n].rpartition(".")[2] for n in np.flatnonzero(damped.closed.growth_rate)
    }
    drawn = chosen or find_critical(gain, [name in growing for name in damped.loop]).tolist()
    lines = [_Line(damped.loop[n], gain[:, n], looks[n], margins[n]) for n in drawn]
    which = f" of {len(lines)} of {len(damped.loop)} loops"
    if not chosen:
        which = f" of the {SHOWN} most critical of {len(damped.loop)} loops"
    which *= len(damped.loop) > len(lines)
    over = Across()
    sizes = [one.line(frequency, np.abs(one.gain)) for one in lines]
    shown = [
        _poles(damped),
        _impulse(damped),
        _noise(damped, looks),
        Panel(
            "|loop gain| (ratio)", sizes, TALL, "log", title=f"loop gain{which}, others closed",
            ends=True, across=over, rules=[Rule(1.0)],
        ),
        Panel(
            "phase (degrees)", [one.line(frequency, one.gain) for one in lines], TALL, "phase",
            title="phase of the loop gain; dots: phase margins", ends=True, across=over,
            paint=partial(_mark_margins, frequency=frequency, lines=lines),
        ),
        Panel(
            "loop gain (dB)", (), TALL, limits=(-NEAR, NEAR),
            paint=partial(_draw_nichols, frequency=frequency, lines=lines),
            title=f"±{NEAR:g} dB around −1 (+); dots: margins", rules=[Rule(0.0, dashes="-")],
            across=Across("phase of the loop gain (degrees)", "linear", (NICHOLS, NICHOLS + 360)),
        ),
    ]  # fmt: skip
    return panels.draw(_heading_text(damped), title, shown)


def refine_gains(
    result: Result,
) -> tuple[Float[np.ndarray, " frequency"], Complex[np.ndarray, "frequency loop"]]:
    """Add the frequencies that resolve resonances to loop gains, the other loops closed."""

    def build() -> tuple[Solve, Array]:
        plant = control.build_plant(result.design, result.choice.model.system(result.design))
        return (lambda at: control.compute_loop_gains(plant, at)[:, None]), np.empty(0)

    frequency, gain = add_from_model(build, result.data.frequency, result.data.gain[:, None])
    return frequency, gain[:, 0]


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


def _poles(damped: LocalControl) -> Panel:
    """Make the panel of poles by rate (symmetric log) and frequency (log)."""
    both = (damped.open, damped.closed)
    real = np.concatenate([np.real(poles.value) for poles in both])
    sizes = np.abs(real[real != 0])
    high = 10 ** np.ceil(np.log10(sizes.max(initial=1.0)))
    least = 10 ** np.floor(np.log10(max(sizes.min(initial=high), 1e-9 * high)))
    frequency = np.concatenate([poles.frequency for poles in both])
    frequency = frequency[frequency > 0]
    grows = bool((real > 0).any())
    right = 10 ** np.ceil(np.log10(max(real.max(), least))) if grows else 2 * least
    every = np.arange(round(np.log10(high)), round(np.log10(least)) - 1, -1.0)
    step = int(np.ceil(len(every) / (3 if grows else 4)))

    def paint(axes: Axes) -> None:
        axes.set_xscale("symlog", linthresh=least, linscale=0.8)
        axes.set_xlim(-2 * high, right)
        axes.axvspan(0, right * 10, color=RED, alpha=0.08, linewidth=0)
        axes.axvline(0, color=INK, linewidth=0.6)
        points, names, inks, marks = [], [], [], []
        for power in range(0, 12, 2):
            at = np.array(
                [max(low, least * 10.0**power / np.pi), min(top, high * 10.0**power / np.pi)]
            )
            if at[0] < at[1]:
                axes.plot(-np.pi * at / 10.0**power, at, color=PALE, linewidth=0.7, zorder=1)
            if at[0] < at[1] == top:
                points.append((float(-np.pi * top / 10.0**power), top / 1.3))
                names.append(f"Q {format_raised(10.0**power)}")
                inks.append(NOTE)
        for poles, look, colour in ((damped.open, PROBE, OPEN), (damped.closed, CROSS, PALETTE[0])):
            for rate, at, count in _group(poles):
                ink = RED if rate > 0 and look is CROSS else colour
                axes.plot(rate, at, color=ink, **look)
                marks.append((rate, at))
                if count > 1 and look is CROSS:
                    points.append((rate, at))
                    names.append(f"×{count}")
                    inks.append(ink)
        labels.label_points(axes, points, names, inks, marks=marks)
        for powers, minor in ((every[:-1:step], False), (every, True)):
            ticks = [*(-(10.0**powers)), *([] if minor else [0.0]), *(10.0**powers)]
            axes.set_xticks([tick for tick in ticks if tick <= right * grows], minor=minor)
        axes.xaxis.set_major_formatter(lambda x, _: format_raised(x))

    low, top = float(frequency.min() / 1.5), float(frequency.max() * 4.0)
    return Panel(
        "|pole|/2π (Hz)", (), TALL, "log", (low, top), "poles", paint=paint,
        key=[Line([], [], "open", OPEN, PROBE), Line([], [], "closed", PALETTE[0], CROSS)],
        across=Across("Re pole (1/s), unstable right of 0", "linear"),
    )  # fmt: skip


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


def _impulse(damped: LocalControl) -> Panel:
    return Panel(
        single_line(f"{damped.output} ({damped.unit})", 30),
        [
            Line(damped.time, damped.undamped, "open", OPEN, {"linewidth": 0.5}),
            Line(damped.time, damped.impulse, "closed", PALETTE[0], {"linewidth": 1.1}),
        ],
        TALL,
        title=f"response to 1 {damped.drive_unit} s of {damped.drive}",
        ends=True,
        across=Across("time (s)", "linear"),
    )


def _noise(damped: LocalControl, looks: list[tuple[str, LineStyleType]]) -> Panel:
    total = np.sqrt((damped.noise**2).sum(1))
    lines = [Line(damped.frequency, total, "sum", INK, {"linewidth": 2.0})]
    for name, noise, (colour, dashes) in zip(damped.loop, damped.noise.T, looks, strict=True):
        if noise.any():
            lines.append(Line(damped.frequency, noise, name, colour, {"linestyle": dashes}))
    return Panel(
        single_line(f"{damped.output} ({damped.unit}/√Hz)", 32),
        lines,
        TALL,
        "log",
        curves.limit_spectrum(total),
        "sensor noise at the output",
        ends=total.any(),
        key=(),
        across=Across(),
        empty="no sensor noise reaches this output",
    )


def _mark_margins(
    axes: Axes, frequency: Float[np.ndarray, " frequency"], lines: Sequence[_Line]
) -> None:
    """Mark phase margins on the phases of loop gains."""
    for one in lines:
        where = one.margin.phase_frequency if one.margin is not None else np.nan
        if frequency[0] <= where <= frequency[-1]:
            near = one.gain[np.abs(frequency - where).argmin()]
            at = curves.wrap(np.degrees(np.angle(near)))
            axes.plot(where, at, "o", color=one.look[0], markersize=3.5, zorder=4)


def _draw_nichols(
    axes: Axes, frequency: Float[np.ndarray, " frequency"], lines: Sequence[_Line]
) -> None:
    """Draw loop gains against phases, once around, with margins."""
    turn = np.linspace(0, 2 * np.pi, 181)[1:-1]
    circle = -1 + 0.5 * np.exp(1j * turn)
    phase = curves.wrap(np.degrees(np.angle(circle)), NICHOLS)
    axes.plot(phase, 20 * np.log10(np.abs(circle)), color=NOTE, linewidth=0.7, linestyle="--")
    axes.plot(-180, 0, "+", color=INK, markersize=7)
    for one in lines:
        colour, dashes = one.look
        with np.errstate(divide="ignore"):
            size = 20 * np.log10(np.abs(one.gain))
        size, phase = curves.phase_line(size, one.gain, NICHOLS)
        axes.plot(phase, size, color=colour, linestyle=dashes, linewidth=0.8)
        for edge, marker in ((NEAR, "^"), (-NEAR, "v")):  # where a curve leaves the chart
            left = np.flatnonzero((size[:-1] - edge) * (size[1:] - edge) < 0)
            look = {"color": colour, "markersize": 2.5, "clip_on": False}
            axes.plot(phase[left], np.full(len(left), edge), marker, **look)
        if one.margin is None:
            continue
        dot = {"marker": "o", "color": colour, "markersize": 3.5, "zorder": 4}
        for factor in (one.margin.gain_up, one.margin.gain_down):
            if 0 < factor < np.inf:
                axes.plot(-180, -20 * np.log10(factor), **dot)
        where = one.margin.phase_frequency
        if frequency[0] <= where <= frequency[-1]:
            near = one.gain[np.abs(frequency - where).argmin()]
            side = np.sign(np.angle(-near)) or 1.0
            axes.plot(curves.wrap(np.array(-180 + side * one.margin.phase), NICHOLS), 0, **dot)
    axes.set_xticks([-270, -180, -90, 0, 90])
    axes.annotate(
        "$|1+L|=\\frac{1}{2}$", (-180, 6.5), ha="center", va="bottom", fontsize=7.5, color=NOTE
    )
