"""Picture of motions and forces in time, and of spectra."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.drawing import curves, panels
from suspension_cli.drawing.panels import FREQUENCY, Across, Line, Panel
from suspension_cli.drawing.style import PALETTE, single_line
from suspension_cli.files.mapped_arrays import release

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
PER_DECADE = 100
"""Frequencies of a spectrum that are drawn per decade."""
MOST = 6
"""Most actuators of a unit."""
THIN: LineLook = {"linewidth": 0.7}
"""Look of lines."""


def draw(found: Simulation) -> Figure:
    """Draw a panel for each motion and each actuator, those of a unit on one scale, and spectra."""
    at, motions = _envelopes(found.time, found.value)
    _, forces = _envelopes(found.time, found.force)
    rows = []
    for n, output in enumerate(found.output):
        line = Line(at, motions[:, n], "_", PALETTE[0], THIN)
        label = single_line(f"{output} ({found.unit[n]})", 30)
        title = f"RMS {found.rms[n]:.3g} {found.unit[n]}, largest {found.largest[n]:.3g}"
        rows.append(Panel(label, [line], TALL, title=title))
    for unit in dict.fromkeys(found.actuator_unit):
        every = [n for n, one in enumerate(found.actuator_unit) if one == unit]
        own = sorted(sorted(every, key=lambda n: -found.largest_force[n])[:MOST])
        largest = 1.05 * float(found.largest_force[own].max()) or 1.0
        kind = "torque" if unit == "N m" else "force"
        for n in own:
            line = Line(at, forces[:, n], "_", PALETTE[1], THIN)
            title = f"{kind} of {found.actuator[n]}"
            if n == own[0] and len(own) < len(every):
                title += f"; the largest {MOST} of {len(every)} are drawn"
            if found.at_limit[n]:
                title += f"; at its limit {100 * found.at_limit[n]:.3g} % of the time"
            label = f"{kind} ({unit})"
            limits = -largest, largest
            rows.append(Panel(label, [line], LOW, limits=limits, title=title))
    rows[-1] = replace(rows[-1], across=Across("time (s)", "linear"))
    return panels.draw("Motions and forces in time", found.subtitle, [*rows, *_spectra(found)])


def _spectra(found: Simulation) -> Iterator[Panel]:
    """Panels of the spectra of motions, one for each unit."""
    if found.frequency is None or found.density is None:
        return
    for unit in dict.fromkeys(found.unit):
        lines = []
        for n, output in enumerate(found.output):
            if found.unit[n] == unit:
                at, density = _smooth(found.frequency, found.density[:, n])
                colour = PALETTE[len(lines) % len(PALETTE)]
                lines.append(Line(at, density, single_line(output, 30), colour))
        limits = curves.limit_spectrum(np.concatenate([np.asarray(line.y) for line in lines]))
        title = f"spectrum, of {found.averages} pieces of the run"
        yield Panel(f"{unit}/√Hz", lines, TALL, "log", limits, title, across=FREQUENCY)


def _smooth(frequency: Array, density: Array) -> tuple[Array, Array]:
    """Average power over bands of equal ratio, where there are several frequencies in one."""
    _, band = np.unique(np.floor(PER_DECADE * np.log10(frequency)), return_inverse=True)
    count = np.bincount(band)
    power = np.bincount(band, density**2) / count
    return np.bincount(band, frequency) / count, np.sqrt(power)


def _envelopes(time: Array, value: Array) -> tuple[Array, Array]:
    """Thin lines, one per column, to the smallest and the largest value of many intervals each."""
    if len(time) < 3 * BUCKETS:
        return time, value
    edges = np.linspace(0, len(time), BUCKETS + 1).astype(int)
    at = np.empty((BUCKETS, 2))
    ends = np.empty((BUCKETS, 2, value.shape[1]))
    for n, (start, stop) in enumerate(pairwise(edges)):
        at[n] = time[start]
        ends[n, 0] = value[start:stop].min(0)
        ends[n, 1] = value[start:stop].max(0)
        release(time)
        release(value)
    return at.ravel(), ends.reshape(2 * BUCKETS, -1)
