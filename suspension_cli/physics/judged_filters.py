"""Filters of a loop judged with all modes of its plant: settling, sensitivity, noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.foton import Filter
from suspension_cli.linear.statespace import StateSpace
from suspension_cli.physics import closed_loop, loop_realisation
from suspension_cli.physics.modal_plants import PlantModes
from suspension_cli.physics.wanted_loops import Wanted

if TYPE_CHECKING:
    from jaxtyping import Complex, Float


STILL = 1e-9
"""Growth over frequency up to which a pole without loss grows by rounding errors."""
POINTS = 600
"""Frequencies of a logarithmic grid for the sensitivity; others are around the modes."""
WIDTHS = (-10.0, -3.0, -1.0, -0.3, 0.0, 0.3, 1.0, 3.0, 10.0)
"""Distances from modes, in widths of these."""


@dataclass(frozen=True)
class TriedFilter:
    """A filter, the frequency of its roll-off (Hz), and its noise (see `OptimalLoop`).

    `place` are the numbers of roll-off, rate, weights and bound in the table of what is tried.
    """

    filter: Filter
    roll_off: float
    noise: float
    place: tuple[int, ...]


@dataclass(frozen=True)
class Judge:
    """The plant with all modes, for the sensitivity and the noise of a filter.

    Attributes
    ----------
    frequency
        Hz, with points around all modes; the last is that of the noise.
    reading, moved
        Responses of reading and output to the force, there.
    heard
        Response of the sensor, by which its noise, a motion, becomes a reading.
    others
        Poles that are left out: the closed-loop poles nearest to them are not judged.
    """

    opened: StateSpace
    frequency: Float[np.ndarray, " frequency"]
    reading: Complex[np.ndarray, " frequency"]
    moved: complex
    heard: complex
    highest: float
    highest_mode: float
    others: Complex[np.ndarray, " pole"]

    @staticmethod
    def of(opened: StateSpace, modes: PlantModes, wanted: Wanted, heard: complex) -> Judge:
        """Prepare the judgement of filters."""
        own = modes.frequency[modes.kept]
        centre = np.abs(np.imag(modes.value)) / (2 * np.pi)
        width = np.abs(np.real(modes.value)) / (2 * np.pi)
        around = np.concatenate([centre + side * width for side in WIDTHS])
        grid = np.geomspace(own.min() / 30, 30 * own.max(), POINTS)
        some = np.append(np.union1d(grid, around[around > 0]), wanted.quiet_at)
        value = opened.at(some)[:, :, 0]
        return Judge(
            opened,
            some,
            value[:, 0],
            complex(value[-1, 1]),
            heard,
            wanted.highest,
            float(own.max()),
            modes.value[~modes.kept],
        )

    def rate(self, made: Filter) -> tuple[float, float]:
        """Compute the largest sensitivity, and the noise, of a filter."""
        through = made.at(self.frequency)
        sensitivity = 1 / (1 + through * self.reading)
        noise = abs(self.moved * through[-1] * self.heard * sensitivity[-1])
        return float(np.abs(sensitivity).max()), float(noise)

    def accepts(self, one: TriedFilter, wanted: Wanted) -> bool:
        """Whether a closed loop is stable, and its settling and sensitivity are as wanted."""
        closed = self.close(one)
        if closed is None:
            return False
        settling, sensitivity = closed
        return settling <= wanted.settling and sensitivity <= wanted.sensitivity

    def close(self, one: TriedFilter) -> tuple[float, float] | None:
        """Close the loop with all modes: settling (s) and sensitivity; None if it is unstable."""
        node = closed_loop.Node("", one.filter)
        made = loop_realisation.realise(node)
        plant = self.opened
        forward = -made.C
        a = np.block([[plant.a, plant.b @ forward], [made.B @ plant.c[:1], made.A]])
        count = len(plant.a)
        a[count:, count:] += made.B @ plant.d[:1] @ forward
        poles = np.linalg.eigvals(a)
        if not (np.real(poles) < STILL * np.abs(poles)).all():
            return None
        upper = poles[np.imag(poles) >= 0]
        left = [int(np.abs(upper - other).argmin()) for other in self.others]
        low = np.abs(upper) <= 2 * np.pi * self.highest
        low[left] = False
        settling = float(-1 / np.real(upper[low]).max(initial=-np.inf))
        return settling, self.rate(one.filter)[0]
