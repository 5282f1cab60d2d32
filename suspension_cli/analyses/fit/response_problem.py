"""Least-squares problem of a design and its measured transfer functions.

Unknowns z are, in this order: the free numbers of the design; the nuisance parameters of sensors
and actuators; the logarithm of an added damping 1/Q of every mode in the measured band, as losses
in air are rarely known; a relative change of omega^2 of modes where something may rub. Residuals,
over their standard deviations, are real and imaginary parts of predicted less measured values,
measured modes, and priors.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from suspension_cli.analyses.fit import search
from suspension_cli.analyses.fit.channels import Channels, Nuisance
from suspension_cli.analyses.fit.experiment import unbalanced
from suspension_cli.analyses.fit.resonances import Peak, find_peaks, stack_parts
from suspension_cli.analyses.fit.search import Problem
from suspension_cli.design.measured import Measured
from suspension_cli.linear.mode_pairing import pair_by_overlap
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array
from suspension_cli.studies import response_matrix
from suspension_cli.studies.derivatives import frequency_rates
from suspension_cli.studies.response_matrix import Plant, Responses

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Int

    from suspension_cli.analyses.fit.array_types import ModeIndex, ModeValues, Numbers, Unknowns

DAMPING = 1e-3
"""Prior median of the added damping 1/Q of a mode."""
DAMPING_SIGMA = 2.5
"""Standard deviation of its logarithm: a factor of 12 either way."""
STIFFENING_SIGMA = 0.1
"""Prior standard deviation of a relative change of omega^2 of a mode."""
BEYOND = 1.5
"""Factor by which the band of modes with added damping exceeds the measured one."""
STEP = 1e-4
"""Relative step of differences for numbers that change only frequency-dependent losses."""
SHARED_PLANTS = 12
"""Most plants kept by problems made from one another."""


@dataclass(frozen=True)
class Prediction:
    """Predicted readings at some values of the unknowns.

    Attributes
    ----------
    order
        Mode of `plant` for each mode of the design at the start.
    response
        Of all signals, per grid of frequencies.
    reading
        Per measured function.
    """

    plant: Plant
    order: ModeIndex
    response: tuple[Responses, ...]
    reading: list[Complex[np.ndarray, " _"]]


@dataclass
class ResponseProblem:
    """A design, its measured functions and the unknowns.

    Attributes
    ----------
    base
        Free numbers, measured modes and priors of one experiment.
    level
        Name of a model that supports derivatives.
    nominal
        The design where the search starts, whose order of modes numbers them.
    peaks
        Resonances of each measured function.
    damped, stiff
        Modes with an added damping, and with a change of omega^2.
    """

    base: Problem
    channels: Channels
    level: str
    nominal: Plant
    peaks: list[list[Peak]]
    damped: Int[np.ndarray, " damped"] = field(default_factory=lambda: np.zeros(0, dtype=int))
    stiff: Int[np.ndarray, " stiff"] = field(default_factory=lambda: np.zeros(0, dtype=int))
    _plants: dict[bytes, Plant] = field(default_factory=dict)
    _predictions: dict[bytes, Prediction] = field(default_factory=dict)

    def changed(self, **changes: object) -> ResponseProblem:
        """Replace channels, numbers or modes; keep the plants solved before."""
        return replace(self, **changes, _predictions={})

    @property
    def nuisances(self) -> tuple[Nuisance, ...]:
        """Unknown properties of sensors and actuators."""
        return self.channels.nuisances

    @property
    def numbers(self) -> int:
        """Number of free numbers of the design."""
        return len(self.base.start)

    @cached_property
    def start(self) -> Unknowns:
        """Values where the search starts."""
        return np.concatenate(
            [
                self.base.start,
                np.zeros(len(self.nuisances)),
                np.full(len(self.damped), np.log(DAMPING)),
                np.zeros(len(self.stiff)),
            ]
        )

    @cached_property
    def low(self) -> Unknowns:
        """Lower bounds."""
        gains = [-0.95 if item.kind == "gain" else -np.inf for item in self.nuisances]
        least = np.full(len(self.damped), np.log(1e-9))
        return np.concatenate([self.base.low, gains, least, np.full(len(self.stiff), -0.9)])

    @cached_property
    def high(self) -> Unknowns:
        """Upper bounds."""
        rest = np.full(len(self.nuisances), np.inf)
        most = np.concatenate([np.zeros(len(self.damped)), np.ones(len(self.stiff))])
        return np.concatenate([self.base.high, rest, most])

    @cached_property
    def prior(self) -> tuple[Unknowns, Unknowns]:
        """Prior values and their standard deviations, infinite where there is none."""
        q, r = len(self.nuisances), len(self.damped)
        s = len(self.stiff)
        damping = np.full(r, np.log(DAMPING))
        center = np.concatenate([self.base.prior, np.zeros(q), damping, np.zeros(s)])
        sigma = [item.sigma for item in self.nuisances]
        modes = np.repeat([DAMPING_SIGMA, STIFFENING_SIGMA], [r, s])
        return center, np.concatenate([self.base.prior_sigma, sigma, modes])

    @cached_property
    def scale(self) -> Unknowns:
        """Typical change of each unknown: standard deviation of its prior, else a tenth of it."""
        sigma = self.prior[1]
        size = np.abs(self.start) * 0.1
        return np.where(np.isfinite(sigma), sigma, np.where(size > 0, size, 1e-3))

    def _plant(self, x: Numbers) -> Plant:
        item = self.base.experiment[0]
        with item.faults():
            design = item.design(x)
            key = msgspec.msgpack.encode(design)
            if key not in self._plants:
                _drop_oldest(self._plants, SHARED_PLANTS)
                self._plants[key] = Plant.of(design, self.level)
            return self._plants[key]

    def added(
        self, z: Unknowns
    ) -> tuple[Float[np.ndarray, " damped"], Float[np.ndarray, " stiff"]]:
        """Added dampings and changes of omega^2 of modes."""
        own = z[self.numbers + len(self.nuisances) :]
        return np.exp(own[: len(self.damped)]), own[len(self.damped) :]

    def nuisance_values(self, z: Unknowns) -> dict[Nuisance, float]:
        """Values of the nuisance parameters."""
        own = z[self.numbers : self.numbers + len(self.nuisances)]
        return dict(zip(self.nuisances, own.tolist(), strict=True))

    def predict(self, z: Unknowns) -> Prediction:
        """Predict the readings of all measured functions; the last two results are cached."""
        key = z.tobytes()
        if key not in self._predictions:
            _drop_oldest(self._predictions, 2)
            self._predictions[key] = self._predict(z)
        return self._predictions[key]

    def _predict(self, z: Unknowns) -> Prediction:
        plant = self._plant(z[: self.numbers])
        order = self._order(plant)
        damping, stiffening = np.zeros((2, len(order)))
        damping[order[self.damped]], stiffening[order[self.stiff]] = self.added(z)
        values = self.nuisance_values(z)
        inputs, outputs = self.channels.signal[1], self.channels.signal[0]
        reading = [np.zeros(0, dtype=complex)] * len(self.channels.function)
        found = []
        for frequency, own in self.channels.grids:
            response = plant.respond(frequency, inputs, outputs, damping, stiffening)
            readings = self.channels.combine(response.value, response.omega, values)
            for n in own:
                reading[n] = readings[(slice(None), *self.channels.pair(n))]
            found.append(response)
        return Prediction(plant, order, tuple(found), reading)

    def differentiate(self, z: Unknowns) -> list[Complex[np.ndarray, "_ unknown"]]:
        """Differentiate the reading of each measured function."""
        now, values = self.predict(z), self.nuisance_values(z)
        item = self.base.experiment[0]
        changes = now.plant.changes(item.free)
        for name, change in zip(item.free, changes, strict=True):
            if change is None:
                raise unbalanced(name)
        result = [np.zeros((0, 0), dtype=complex)] * len(self.channels.function)
        for response, (_, own) in zip(now.response, self.channels.grids, strict=True):
            columns, omega = [], response.omega

            def read(part: np.ndarray, omega: Array = omega) -> np.ndarray:
                return self.channels.combine(part, omega, values)

            for change in changes:
                assert change is not None
                columns.append(read(response.derivative(change)))
            for nuisance in self.nuisances:
                columns.append(self.channels.differentiate(response.value, omega, values, nuisance))
            for mode, size in zip(now.order[self.damped], self.added(z)[0], strict=True):
                columns.append(size * read(response.damping_derivative(int(mode))))
            for mode in now.order[self.stiff]:
                columns.append(read(response.stiffening_derivative(int(mode))))
            whole = np.stack(columns, -1) if columns else np.zeros((*response.value.shape, 0))
            for n in own:
                result[n] = whole[(slice(None), *self.channels.pair(n))]
        if registry.by_name(self.level).bends_wires:
            self._add_losses(z, result)
        return result

    def _add_losses(self, z: Unknowns, result: list[np.ndarray]) -> None:
        """Differentiate by numbers of frequency-dependent losses, with central differences."""
        for n, name in enumerate(self.base.experiment[0].free):
            if not set(name.split(".")) & {*response_matrix.LOSSES}:
                continue
            step = STEP * (abs(z[n]) or self.scale[n])
            move = np.zeros(len(z))
            move[n] = step
            above, below = self._predict(z + move).reading, self._predict(z - move).reading
            for one, high, low in zip(result, above, below, strict=True):
                one[:, n] = (high - low) / (2 * step)

    def residual(self, z: Unknowns) -> Float[np.ndarray, " residual"]:
        """Residuals of functions (real parts, imaginary parts of each), modes and priors."""
        pairs = zip(self.predict(z).reading, self.channels.function, strict=True)
        rows = [stack_parts((reading - item.value) / item.uncertainty) for reading, item in pairs]
        target = self.base.experiment[0]
        frequency, _ = target.predict(z[: self.numbers])
        rows.append((frequency - target.frequency) / target.uncertainty)
        center, width = self.prior
        rows.append(((z - center) / width)[np.isfinite(width)])
        return np.concatenate(rows)

    def jacobian(self, z: Unknowns) -> Float[np.ndarray, "residual unknown"]:
        """Differentiate `residual`."""
        rows = [
            stack_parts(slope / np.asarray(item.uncertainty)[:, None])
            for slope, item in zip(self.differentiate(z), self.channels.function, strict=True)
        ]
        target = self.base.experiment[0]
        slope = np.zeros((len(target.mode), len(z)))
        slope[:, : self.numbers] = target.predict(z[: self.numbers])[1]
        rows.append(slope / target.uncertainty[:, None])
        width = self.prior[1]
        rows.append(np.diag(1 / width)[np.isfinite(width)])
        return np.concatenate(rows)

    def frequencies(self, z: Unknowns) -> ModeValues:
        """Frequencies of the design's modes in the order of the start, Hz, without `stiff`."""
        plant = self._plant(z[: self.numbers])
        return plant.modes.frequency[self._order(plant)]

    def frequency_slopes(self, z: Unknowns) -> Float[np.ndarray, "mode number"]:
        """Differentiate `frequencies` by the numbers of the design."""
        plant = self._plant(z[: self.numbers])
        order = self._order(plant)
        slope = np.zeros((len(order), self.numbers))
        for n, change in enumerate(plant.changes(self.base.experiment[0].free)):
            if change is not None:
                slope[:, n] = frequency_rates(plant.modes, change.of_modes(plant.modes))[order]
        return np.nan_to_num(slope)

    def _order(self, plant: Plant) -> ModeIndex:
        """Mode of a design for each mode of the design at the start."""
        return pair_by_overlap((self.nominal.modes.shape @ plant.modal_forces.T) ** 2)


def _drop_oldest(store: dict[bytes, Plant] | dict[bytes, Prediction], most: int) -> None:
    """Delete the oldest entries until there are fewer than `most`."""
    while len(store) >= most:
        del store[next(iter(store))]


def build(
    text: str,
    measured: Measured,
    channels: Channels,
    file: str = "",
    level: str = registry.STRING.name,
) -> ResponseProblem:
    """Set up the least-squares problem of a design with measured transfer functions."""
    base = search.build_problem([text], measured, [file], level)
    item = base.experiment[0]
    with item.faults():
        nominal = Plant.of(item.design(base.start), level)
    plants = {msgspec.msgpack.encode(nominal.design): nominal}
    every = np.concatenate([item.frequency for item in channels.function])
    frequency = nominal.modes.frequency
    inside = (frequency > every.min() / BEYOND) & (frequency < every.max() * BEYOND)
    visible = (residues(nominal, channels) != 0).any(0)
    damped = np.flatnonzero(inside & visible)
    peaks = [
        find_peaks(np.asarray(one.frequency), one.value, np.asarray(one.uncertainty))
        for one in channels.function
    ]
    return ResponseProblem(base, channels, level, nominal, peaks, damped, _plants=plants)


def residues(plant: Plant, channels: Channels) -> Float[np.ndarray, "function mode"]:
    """Compute the residues of the measured functions: H has residue/(w_k^2 - w^2)."""
    rows = [
        np.array([plant.row(signal) for signal in channels.signal[side]]).reshape(
            -1, plant.system.size
        )
        for side in (0, 1)
    ]
    shape, stiffness = plant.modes.shape, plant.matrices.stiffness
    seen = shape @ rows[0][:, 6:].T
    pushed = shape @ rows[1][:, 6:].T
    for n, signal in enumerate(channels.signal[1]):
        if not signal.acts:
            pushed[:, n] = -shape @ stiffness[6:, :6] @ rows[1][n, :6]
    (sensors, read), (actuators, drive) = channels.matrices(np.zeros(1), {})
    seen = seen @ sensors.T * np.real(read[:, 0])
    pushed = pushed @ actuators.T * np.real(drive[:, 0])
    pairs = [channels.pair(n) for n in range(len(channels.function))]
    return np.array([seen[:, one] * pushed[:, other] for one, other in pairs])
