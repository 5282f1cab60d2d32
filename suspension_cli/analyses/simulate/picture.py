"""Picture of motions and forces in time."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.drawing import panels
from suspension_cli.drawing.panels import Across, Line, Panel
from suspension_cli.drawing.style import PALETTE, single_line

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.analyses.simulate.solve import Simulation
    from suspension_cli.drawing.style import LineLook
    from suspension_cli.scene.arrays import Array

TALL = 1.7
"""Height of panels of motions, in."""
LOW = 1.1
"""Height of panels of actuators, in."""
BUCKETS = 1500
"""Intervals of which the smallest and the largest value are drawn."""
MOST = 6
"""Most actuators of a unit."""
THIN: LineLook = {"linewidth": 0.7}
"""Look of lines."""


def draw(found: Simulation) -> Figure:
    """Draw a panel for each motion, and for each actuator, those of a unit on one scale."""
    time = Across("time (s)", "linear")
    rows = []
    for n, output in enumerate(found.output):
        line = Line(*_envelope(found.time, found.value[:, n]), "_", PALETTE[0], THIN)
        label = single_line(f"{output} ({found.unit[n]})", 30)
        title = f"RMS {found.rms[n]:.3g} {found.unit[n]}, largest {found.largest[n]:.3g}"
        rows.append(Panel(label, [line], TALL, title=title))
    for unit in dict.fromkeys(found.actuator_unit):
        every = [n for n, one in enumerate(found.actuator_unit) if one == unit]
        own = sorted(sorted(every, key=lambda n: -found.largest_force[n])[:MOST])
        largest = 1.05 * float(found.largest_force[own].max()) or 1.0
        kind = "torque" if unit == "N m" else "force"
        for n in own:
            line = Line(*_envelope(found.time, found.force[:, n]), "_", PALETTE[1], THIN)
            title = f"{kind} of {found.actuator[n]}"
            if n == own[0] and len(own) < len(every):
                title += f"; the largest {MOST} of {len(every)} are drawn"
            if found.at_limit[n]:
                title += f"; at its limit {100 * found.at_limit[n]:.3g} % of the time"
            label = f"{kind} ({unit})"
            limits = -largest, largest
            rows.append(Panel(label, [line], LOW, limits=limits, title=title))
    rows[-1] = replace(rows[-1], across=time)
    return panels.draw("Motions and forces in time", found.subtitle, rows)


def _envelope(time: Array, value: Array) -> tuple[Array, Array]:
    """Thin a line to the smallest and the largest value of each of many intervals."""
    step = len(time) // BUCKETS
    if step < 3:
        return time, value
    count = len(time) // step
    parts = value[: count * step].reshape(count, step)
    ends = np.stack([parts.min(1), parts.max(1)], axis=1).ravel()
    return np.repeat(time[: count * step : step], 2), ends
