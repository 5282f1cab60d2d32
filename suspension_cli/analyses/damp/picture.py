"""Figure of local control."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.drawing import curves, panels
from suspension_cli.drawing.panels import Across, Line, Panel, Rule
from suspension_cli.drawing.style import (
    DOF_COLOUR,
    INK,
    NOTE,
    PAGE_WIDTH,
    PALETTE,
    RED,
    LineLook,
    single_line,
)

if TYPE_CHECKING:
    from matplotlib.typing import LineStyleType

    from suspension_cli.analyses.damp.solve import Damped, LocalControl

TALL = 1.7
"""Height of panels, in."""
OPEN = "#9aa1a8"
"""Colour of the open loop."""
SHOWN = 3
"""Number of loops whose gains are drawn: the most critical ones."""
NEAR = 40.0
"""Range of gains in the Nichols chart, dB to both sides of 1."""
NICHOLS = -270.0
"""Least phase in the Nichols chart, degrees."""
HIGHEST = 1e9
"""Largest Q with a place of its own."""
DASHES: tuple[LineStyleType, ...] = (*panels.DASHES, (0, (8, 1.5)), (0, (2, 2)))
"""Line styles of the loops, to see one under another."""
CIRCLE: LineLook = {"linestyle": "none", "marker": "o", "markersize": 4, "fillstyle": "none"}
"""Marks of poles of the open loop."""
CROSS: LineLook = {"linestyle": "none", "marker": "x", "markersize": 4.5, "zorder": 4}
"""Marks of poles of the closed loop."""
DOT: LineLook = {"linestyle": "none", "marker": "o", "markersize": 3.5, "zorder": 4}
"""Marks of margins."""


def draw(damped: Damped, chosen: Sequence[int] = ()) -> Figure:
    """Draw the figure of `pendsus damp`.

    `chosen` are the loops whose gains are drawn; by default the most critical.
    """
    frequency, gain = damped.curve
    nearest = np.nanmin(np.abs(1 + gain), axis=0)  # to -1
    drawn = chosen or sorted(np.argsort(nearest, kind="stable")[:SHOWN].tolist())
    which = f" of {'' if chosen else 'the '}{len(drawn)}{'' if chosen else ' most critical'}"
    which = f"{which} of {len(damped.loop)} loops" * (len(damped.loop) > len(drawn))
    looks = _looks(damped.loop)
    sizes: list[Line] = []
    phases: list[Line] = []
    nichols = [_circle()]
    for n in drawn:
        own = gain[:, n]
        colour = looks[n][0]
        look: LineLook = {"linestyle": looks[n][1]}
        sizes.append(Line(frequency, np.abs(own), damped.loop[n], colour, look))
        angles = curves.continuous_phase(own)
        phases.append(Line(frequency, angles, damped.loop[n], colour, look))
        with np.errstate(divide="ignore"):
            size, phase = curves.phase_line(20 * np.log10(np.abs(own)), own, NICHOLS)
        nichols.append(Line(phase, size, "_", colour, {**look, "linewidth": 0.8}))
        if damped.margin is not None:
            places = [damped.margin[n].phase_frequency, *damped.margin[n].gain_frequencies]
            places = [at for at in places if frequency[0] <= at <= frequency[-1]]
            nearest_points = [int(np.abs(frequency - at).argmin()) for at in places]
            there = own[nearest_points]
            angle = curves.wrap(np.degrees(np.angle(there)), NICHOLS)
            phases.append(Line(places, angles[nearest_points], "_", colour, DOT))
            nichols.append(Line(angle, 20 * np.log10(np.abs(there)), "_", colour, DOT))
    gains = Panel(
        "|loop gain| (ratio)", sizes, TALL, "log", title=f"loop gain{which}",
        remarks=["others closed"], ends=True, across=Across(), rules=[Rule(1.0)],
    )  # fmt: skip
    angles_of_gains = Panel(
        "phase (degrees)", phases, TALL, "phase", curves.limit_phases([one.y for one in phases]),
        title="phase of the loop gain; dots: margins", ends=True, across=Across(),
    )  # fmt: skip
    rows = [
        (_poles(damped), _impulse(damped)),
        (gains, _noise(damped)),
        (angles_of_gains, _nichols(nichols)),
    ]
    return panels.draw(_heading_text(damped), damped.subtitle, rows, width=PAGE_WIDTH)


def _nichols(lines: Sequence[Line]) -> Panel:
    """Make the panel of gains against their phases, around -1."""
    return Panel(
        "loop gain (dB)", lines, TALL, limits=(-NEAR, NEAR),
        title="dots: margins; dashed: |1 + L| = 1/2",
        rules=[Rule(0.0, dashes="-"), Rule(-180.0, vertical=True, dashes="-")],
        across=Across(
            "phase of the loop gain (degrees)", "linear", (NICHOLS, NICHOLS + 360),
            {at: f"{at}".replace("-", "−") for at in range(-270, 91, 90)},
        ),
    )  # fmt: skip


def _heading_text(damped: LocalControl) -> str:
    """Write the heading: whether the closed loop is stable, or what grows fastest."""
    if damped.stable:
        return "Local control: closed loop stable"
    rate = damped.closed.growth_rate
    worst = int(rate.argmax())
    where = single_line(damped.closed.state[worst], 14)
    return f"Local control UNSTABLE: {where} grows at {rate[worst]:.3g}/s"


def _looks(loops: Sequence[str]) -> list[tuple[str, LineStyleType]]:
    """Colour and dashes of each loop; one that is named after a motion has its colour."""
    return [
        (DOF_COLOUR.get(name, PALETTE[n % len(PALETTE)]), DASHES[n % len(DASHES)])
        for n, name in enumerate(loops)
    ]


def _poles(damped: LocalControl) -> Panel:
    """Make the panel of the Q of poles; of one that grows it is |p| / (2 Re p)."""
    lines = []
    for poles, grows, name, colour, look in (
        (damped.open, None, "open", OPEN, CIRCLE),
        (damped.closed, False, "closed", PALETTE[0], CROSS),
        (damped.closed, True, "closed, grows", RED, CROSS),
    ):
        some = poles.frequency > 0
        if grows is not None:
            some &= (poles.growth_rate > 0) == grows
        if some.any():
            q = np.abs(poles.q[some])
            lines.append(Line(poles.frequency[some], q, name, colour, look))
    every, q = (np.concatenate([getattr(line, axis) for line in lines]) for axis in "xy")
    high = 3 * q[np.isfinite(q)].max(initial=1.0)
    return Panel(
        "Q of poles (ratio)", lines, TALL, "log", (0.3, min(high, HIGHEST)),
        "poles" + "; ▲: no loss" * bool((q > high).any()),
        across=Across("|pole|/2π (Hz)", limits=(every.min() / 1.3, every.max() * 1.3)),
    )  # fmt: skip


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


def _noise(damped: LocalControl) -> Panel:
    total = np.sqrt((damped.noise**2).sum(1))
    lines = [Line(damped.frequency, total, "sum", INK, {"linewidth": 2.0})]
    for name, noise, (colour, dashes) in zip(
        damped.sensor, damped.noise.T, _looks(damped.sensor), strict=True
    ):
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


def _circle() -> Line:
    """Circle |1 + L| = 1/2 in the Nichols chart."""
    circle = -1 + 0.5 * np.exp(1j * np.linspace(0, 2 * np.pi, 181)[1:-1])
    phase = curves.wrap(np.degrees(np.angle(circle)), NICHOLS)
    look: LineLook = {"linewidth": 0.7, "linestyle": "--"}
    return Line(phase, 20 * np.log10(np.abs(circle)), "_", NOTE, look)
