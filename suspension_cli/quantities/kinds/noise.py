"""Noise of motions by all causes together, and its RMS: those of `pendsus budget`.

The causes are motions of the support, noise of sensors and actuators, and thermal noise, with the
loops closed. What moves the support is that of `[analysis.budget]`.
"""

from __future__ import annotations

import contextlib
import math
from abc import abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.errors import InputError, format_value, suggest
from suspension_cli.linear import signals
from suspension_cli.linear.signals import Signal
from suspension_cli.models import registry
from suspension_cli.physics import local_control, noise_budget
from suspension_cli.physics.noise_budget import MotionBudget, Noises, Surroundings
from suspension_cli.quantities.kind import Kind
from suspension_cli.quantities.kinds.responses import parse_numbers, write_number
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

UNSTABLE = "has no steady state: the closed loop is unstable"
POINTS = 60
"""Frequencies at which the search for the RMS starts; it adds those that the integral needs."""


@dataclass(frozen=True)
class _FromBudget(Quantity):
    """A number of the noise budget of each design."""

    surroundings: Surroundings = field(compare=False)
    motion: Signal

    bends: ClassVar[bool] = True
    slow: ClassVar[bool] = True
    of_loops: ClassVar[bool] = True
    within: ClassVar[tuple[float, float]] = (0.0, math.inf)
    missing = UNSTABLE

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Compute the budget of each design, with thermal noise where losses are known."""
        if registry.BEAM.unsuitable(solved.designs[0]):
            return self._read(solved)
        return solved.with_bending(self._read)

    def _read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        result = np.full(solved.count, np.nan)
        for n in np.flatnonzero(solved.hangs).tolist():
            with contextlib.suppress(InputError):  # a resonance without loss
                result[n] = self._compute(solved, n)
        return result

    def _compute(self, solved: Solved, number: int) -> float:
        design = solved.designs[number]
        poles = np.zeros(0, dtype=complex)
        if design.control is not None or self.needs_poles:
            plant, found = solved.closed_loops(number)
            if not found.stable:
                return np.nan
            poles = found.value
        else:
            plant = local_control.build_plant(design, solved.solver(number))
        warm = None if registry.BEAM.unsuitable(design) else design.constants.temperature
        around = self.surroundings
        noises = Noises(plant, [self.motion], around.motion, warm, around.mirrors)
        return self.number(noises, poles)

    needs_poles: ClassVar[bool] = False

    @abstractmethod
    def number(self, noises: Noises, poles: Complex[np.ndarray, " pole"]) -> float:
        """Take the number from the noises of one design."""


@dataclass(frozen=True)
class Noise(_FromBudget):
    """Amplitude spectral density of a motion by all causes at a frequency in Hz."""

    frequency: float

    def number(self, noises: Noises, poles: Complex[np.ndarray, " pole"]) -> float:
        """Sum the densities of all causes."""
        del poles
        return float(np.sqrt(noises.density(np.array([self.frequency]))[0].sum()))


@dataclass(frozen=True)
class Rms(_FromBudget):
    """RMS of a motion by all causes over a band, Hz."""

    low: float
    high: float

    needs_poles = True

    def budget(self, noises: Noises, poles: Complex[np.ndarray, " pole"]) -> MotionBudget:
        """Compute the budget of the motion over the band."""
        grid = np.geomspace(self.low, self.high, POINTS)
        [found] = noise_budget.solve(noises, grid, poles, {}, added=True)
        return found

    def number(self, noises: Noises, poles: Complex[np.ndarray, " pole"]) -> float:
        """Integrate the densities over the band."""
        return self.budget(noises, poles).total_rms


@dataclass(frozen=True)
class CoilRms(Rms):
    """RMS of the force that the loops demand of a coil over a band, Hz.

    The motion is any one: a budget has at least one.
    """

    coil: str

    def number(self, noises: Noises, poles: Complex[np.ndarray, " pole"]) -> float:
        """Take the drive of the coil."""
        budget = self.budget(noises, poles)
        drives = {drive.coil: drive.force for drive in budget.drive or ()}
        return drives[self.coil]


def parse_noise(text: str, names: Names, option: str) -> Quantity | None:
    """Parse ``noise test.x:10``."""
    if not text.startswith("noise "):
        return None
    given = parse_numbers(text.removeprefix("noise "), 1)
    if given is None or not 0 < given[1][0] < 1e9:
        remedy = "write noise MOTION:FREQUENCY, in Hz: noise test.x:10"
        raise InputError.of(option, "has no frequency", remedy, format_value(text))
    written, [frequency] = given
    motion = signals.parse_output(written, names.signals, option)
    return Noise(
        f"noise {written}:{write_number(frequency)}",
        f"{motion.unit}/Hz^0.5",
        names.surroundings,
        motion,
        frequency,
    )


def parse_rms(text: str, names: Names, option: str) -> Quantity | None:
    """Parse ``rms test.x``, ``rms test.x:0.05:10`` and ``rms coil UL:0.05:10``."""
    if not text.startswith("rms "):
        return None
    rest = text.removeprefix("rms ")
    given = parse_numbers(rest, 2)
    written, (low, high) = given or (rest, names.surroundings.band)
    if not 0 < low < high < 1e9:
        remedy = "write rms MOTION:LOW:HIGH, in Hz: rms test.x:0.05:10"
        raise InputError.of(option, "has no band of frequencies", remedy, format_value(text))
    band = f":{write_number(low)}:{write_number(high)}" if given else ""
    name = f"rms {written}{band}"
    around = names.surroundings
    if written.startswith("coil "):
        coil = written.removeprefix("coil ")
        coils = [] if names.design.control is None else names.design.control.osem
        known = [one.name for one in coils]
        if coil not in known:
            remedy = suggest(coil, known) if known else "give [[control.osem]] tables"
            raise InputError.of(option, "names no OSEM", remedy, format_value(text))
        motion = signals.parse_output(f"{names.stages[-1]}.x", names.signals, option)
        return CoilRms(name, "N", around, motion, low, high, coil)
    motion = signals.parse_output(written, names.signals, option)
    return Rms(name, motion.unit, around, motion, low, high)


KINDS = (
    Kind(
        "noise MOTION:FREQUENCY",
        "noise test.x:10",
        "m/Hz^0.5, rad/Hz^0.5",
        "noise of a motion by all causes of the budget at a frequency in Hz",
        parse_noise,
    ),
    Kind(
        "rms MOTION, rms MOTION:LOW:HIGH, rms coil OSEM",
        "rms test.x:0.05:10",
        "m, rad, N",
        "RMS by all causes of the budget, of a motion or of the force of a coil, over a band in Hz",
        parse_rms,
    ),
)
