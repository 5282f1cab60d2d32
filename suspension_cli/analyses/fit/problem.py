"""The problem of a fit: from unknowns to weighted residuals, with their derivatives.

    problem = start.build(texts, measured, files, "beam")
    z = problem.unknowns.start
    problem.residual(z), problem.jacobian(z)

Unknowns z are, in this order: the free parameters of the designs; gains, delays and mixing of
sensors and actuators; the logarithm of an added damping 1/Q of every mode in the measured band, as
losses in air are rarely known. Residuals, over their standard deviations, are measured modes;
measured quantities; real and imaginary parts of predicted less measured transfer functions; and
priors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from suspension_cli.analyses import readings
from suspension_cli.analyses.fit.experiment import SMALL, TYPICAL, Experiment, respond
from suspension_cli.design.measured import Free
from suspension_cli.errors import attribute_faults_to
from suspension_cli.measurements.resonances import Peak
from suspension_cli.measurements.transfer_function import GAIN, Channels
from suspension_cli.scene.arrays import Array
from suspension_cli.studies.response_matrix import Plant, Responses

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact, Int

DAMPING = 1e-3
"""Prior median of the added damping 1/Q of a mode."""
DAMPING_SIGMA = 2.5
"""Standard deviation of its logarithm: a factor of 12 either way."""
LOSSES = ("loss_angle", "loss")
"""Keys whose numbers change only the frequency-dependent terms of models in which wires bend."""
LOSS_STEP = 1e-3
"""Step of derivatives by these, relative to the number; a hundredth of this for 0."""


class Unknowns(NamedTuple):
    """Names, starting values, bounds, priors and typical changes of all unknowns.

    `sigma` is infinite where there is no prior; `scale` is that standard deviation, else a tenth of
    the value.
    """

    name: tuple[str, ...]
    start: Array
    low: Array
    high: Array
    prior: Array
    sigma: Array
    scale: Array


@dataclass(frozen=True)
class Problem:
    """Measured designs and the unknowns of a fit.

    `shared` says whether a parameter belongs to an experiment, `base` are starting values. Measured
    functions are those of the one experiment: their channels, its signals in these, the resonances
    of each function, and nominal modes with an added damping (`damped`).
    """

    experiment: list[Experiment]
    free: Sequence[Free]
    shared: Bool[np.ndarray, "parameter experiment"]
    base: Array
    channels: Channels = field(default_factory=Channels)
    signals: readings.Signals = ((), ())
    peaks: Sequence[list[Peak]] = ()
    damped: Int[np.ndarray, " damped"] = field(default_factory=lambda: np.zeros(0, dtype=int))

    @property
    def count(self) -> int:
        """Number of free parameters of the designs."""
        return len(self.base)

    @property
    def parts(self) -> tuple[slice, slice, slice]:
        """Places of parameters, properties of channels, and dampings in z."""
        first = self.count
        second = first + len(self.channels.nuisances)
        return slice(first), slice(first, second), slice(second, second + len(self.damped))

    @cached_property
    def unknowns(self) -> Unknowns:
        """Names, starting values, bounds, priors and typical changes."""
        inf = np.inf
        damping = float(np.log(DAMPING))
        rows = []
        for start, one in zip(self.base, self.free, strict=True):
            low = -inf if one.lower is None else one.lower
            high = inf if one.upper is None else one.upper
            rows.append((one.name, start, low, high, one.prior or 0.0, one.uncertainty or inf))
        for one in self.channels.nuisances:
            low = -0.95 if one.kind == GAIN else -inf
            rows.append((one.name, 0.0, low, inf, 0.0, one.sigma))
        for mode in self.damped:
            low = np.log(1e-9)
            rows.append((f"damping.{mode}", damping, low, 0.0, damping, DAMPING_SIGMA))
        columns = np.array([row[1:] for row in rows], dtype=float).reshape(-1, 5).T
        start, low, high, prior, sigma = columns
        typical = np.where(start != 0, TYPICAL * np.abs(start), SMALL)
        scale = np.where(np.isfinite(sigma), sigma, typical)
        return Unknowns(tuple(row[0] for row in rows), start, low, high, prior, sigma, scale)

    def restricted(self, names: Sequence[str], values: dict[str, float]) -> Problem:
        """Set up the problem of the one design with other free parameters, without priors."""
        base = np.array([values[name] for name in names])
        one = replace(self.experiment[0], free=tuple(names), start=base)
        free = [Free(name=name) for name in names]
        shared = np.ones((len(names), 1), dtype=bool)
        return replace(self, experiment=[one], free=free, shared=shared, base=base)

    def held(self, z: Array) -> Problem:
        """Hold the derivatives of the matrices at their values at z.

        They hardly change from there, and cost most of the time of a step. With them a search is a
        chord method (Kelley, Iterative Methods for Linear and Nonlinear Equations (1995), section
        5.4): residuals are exact, slopes nearly so.
        """
        pairs = zip(self.experiment, self.shared.T, strict=True)
        rates = [replace(one, rates=one.at(z[: self.count][own])) for one, own in pairs]
        return replace(self, experiment=rates)

    def residues(self, plant: Plant) -> Inexact[np.ndarray, "function mode"]:
        """Compute the residues of the measured functions (`readings.residues`)."""
        return readings.residues(self.channels, self.signals, plant.system, plant.modes)

    def solve_responses(self, z: Array) -> list[Responses]:
        """Solve for the responses of all signals on each grid."""
        one = self.experiment[0]
        grids = [grid.tobytes() for grid, _ in self.channels.grids]
        if not grids:
            return []
        with attribute_faults_to(one.file):
            build = one.at(z[self.parts[0]])
            return respond(build, self.signals, tuple(grids), self.damping(z).tobytes())

    def damping(self, z: Array) -> Float[np.ndarray, " mode"]:
        """Added damping 1/Q of each mode of the plant."""
        order = self.experiment[0].order(z[self.parts[0]])
        damping = np.zeros(len(order))
        damping[order[self.damped]] = np.exp(z[self.parts[2]])
        return damping

    def state_derivatives(
        self, found: Responses, z: Array
    ) -> Complex[np.ndarray, "unknown frequency output input"]:
        """Differentiate responses by parameters and dampings."""
        one = self.experiment[0]
        x = z[self.parts[0]]
        rows = [found.derivative(change) for change in one.changes(x)]
        if found.plant.system.terms:
            for n, name in enumerate(one.free):
                if name.rpartition(".")[2] in LOSSES:
                    rows[n] = self._loss_derivative(found, z, n)
        dampings = zip(one.order(x)[self.damped], np.exp(z[self.parts[2]]), strict=True)
        rows += [size * found.damping_derivative(int(mode)) for mode, size in dampings]
        return np.array(rows, dtype=complex).reshape(-1, *found.value.shape)

    def _loss_derivative(
        self, found: Responses, z: Array, n: int
    ) -> Complex[np.ndarray, "frequency output input"]:
        """Differentiate responses by the loss number n, which no static matrix depends on."""
        sides = np.tile(z[self.parts[0]], (2, 1))
        step = LOSS_STEP * (sides[0, n] or 0.01)
        sides[0, n] += step
        sides[1, n] = max(sides[1, n] - step, 0.0)
        above, below = (
            self.experiment[0]
            .plant(x)
            .respond(found.omega / (2 * np.pi), found.inputs, found.outputs, self.damping(z))
            .value
            for x in sides
        )
        return (above - below) / (sides[0, n] - sides[1, n])

    def readings(self, z: Array) -> list[Complex[np.ndarray, " frequency"]]:
        """Predict the readings per drive of each measured function."""
        now = self.channels.with_values(z[self.parts[1]])
        solved = zip(self.solve_responses(z), now.grids, strict=True)
        return now.by_function([now.combine(one.value, grid) for one, (grid, _) in solved])

    def differentiate(self, z: Array) -> list[Complex[np.ndarray, "unknown frequency"]]:
        """Differentiate `readings`."""
        values = z[self.parts[1]]
        grids = []
        now = self.channels.with_values(values)
        for found, (grid, _) in zip(self.solve_responses(z), now.grids, strict=True):
            rows = now.combine(self.state_derivatives(found, z), grid)
            own = self.channels.differentiate(found.value, grid, values)
            grids.append(np.concatenate([rows[: self.count], own, rows[self.count :]]))
        return now.by_function(grids)

    def predict_modes(self, x: Array) -> tuple[Array, Array]:
        """Frequencies of the measured modes, Hz, and their derivatives; 0 for an unstable mode."""
        rows = [np.zeros(0)]
        slopes = [np.zeros((0, self.count))]
        for item, own in zip(self.experiment, self.shared.T, strict=True):
            if item.mode:
                frequency, slope = item.predict(x[own])
                rows.append(frequency)
                slopes.append(np.zeros((len(frequency), self.count)))
                slopes[-1][:, own] = slope
        return np.concatenate(rows), np.concatenate(slopes)

    def predict_values(self, x: Array) -> Float[np.ndarray, " measured_value"]:
        """Values of the measured quantities, SI; raises `InputError` if one has none."""
        pairs = zip(self.experiment, self.shared.T, strict=True)
        return np.concatenate([np.zeros(0), *(item.values(x[own]) for item, own in pairs)])

    def value_slopes(self, x: Array) -> Float[np.ndarray, "measured_value parameter"]:
        """Derivatives of the measured quantities."""
        slopes = [np.zeros((0, self.count))]
        for item, own in zip(self.experiment, self.shared.T, strict=True):
            slope = np.zeros((len(item.quantities), self.count))
            slope[:, own] = item.value_slopes(x[own])
            slopes.append(slope)
        return np.concatenate(slopes)

    @cached_property
    def measured_values(self) -> Float[np.ndarray, "2 measured_value"]:
        """Measured values of quantities and their standard deviations, SI."""
        values = [(one.value, one.uncertainty) for item in self.experiment for one in item.measured]
        return np.array(values).reshape(-1, 2).T

    @cached_property
    def measured_modes(self) -> Float[np.ndarray, "2 measured"]:
        """Measured frequencies of modes and their standard deviations, Hz."""
        modes = [(one.frequency, one.uncertainty) for item in self.experiment for one in item.mode]
        return np.array(modes).reshape(-1, 2).T

    def residual(self, z: Array) -> Float[np.ndarray, " residual"]:
        """Weighted residuals of modes, quantities, functions and priors."""
        x = z[self.parts[0]]
        frequency, spread = self.measured_modes
        value, sigma = self.measured_values
        known = np.isfinite(self.unknowns.sigma)
        rows = [
            (self.predict_modes(x)[0] - frequency) / spread,
            (self.predict_values(x) - value) / sigma,
        ]
        for predicted, item in zip(self.readings(z), self.channels.function, strict=True):
            rows.append(stack_parts((predicted - item.value) / item.uncertainty))
        rows.append(((z - self.unknowns.prior) / self.unknowns.sigma)[known])
        return np.concatenate(rows)

    def chi_squared(self, z: Array) -> float:
        """Sum of the squares of the residuals."""
        return float(np.sum(self.residual(z) ** 2))

    def jacobian(self, z: Array) -> Float[np.ndarray, "residual unknown"]:
        """Differentiate `residual`."""
        x = z[self.parts[0]]
        known = self.unknowns.sigma < np.inf
        slopes = np.concatenate([self.predict_modes(x)[1], self.value_slopes(x)])
        sigma = np.concatenate([self.measured_modes[1], self.measured_values[1]])
        weighted = np.zeros((len(slopes), len(z)))
        weighted[:, self.parts[0]] = slopes / sigma[:, None]
        rows = [weighted]
        for change, item in zip(self.differentiate(z), self.channels.function, strict=True):
            rows.append(stack_parts((change / item.uncertainty).T))
        return np.concatenate([*rows, np.diag(1 / self.unknowns.sigma)[known]])


def stack_parts(rows: Array) -> Array:
    """Stack real parts over imaginary parts, to make complex equations real."""
    return np.concatenate([np.real(rows), np.imag(rows)])
