"""Least-squares problem of a design and its measured transfer functions.

Unknowns are, in this order: the free numbers of the design, the nuisance parameters of sensors and
actuators, for every mode in the measured band the logarithm of an added damping 1/Q (losses of a
suspension in air are rarely known), and for some modes a relative change of omega^2 that no number
of the design makes (something rubs). Residuals are real and imaginary parts of measured less
predicted values over their standard deviations, measured modes, and priors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from suspension_cli.analyses.fit import search
from suspension_cli.analyses.fit.channels import Channels, Nuisance
from suspension_cli.analyses.fit.resonances import stack_parts
from suspension_cli.analyses.fit.search import Problem
from suspension_cli.analyses.sensitivity.solve import differentiate_frequencies
from suspension_cli.design.measured import Measured
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError
from suspension_cli.linear.mode_pairing import pair_by_overlap
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array, Index
from suspension_cli.studies import response_matrix
from suspension_cli.studies.response_matrix import Plant, Responses

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

DAMPING = 1e-3
"""Prior median of the added damping 1/Q of a mode."""
DAMPING_SIGMA = 2.5
"""Standard deviation of the logarithm of that prior: a factor of 12 either way."""
STIFFENING_SIGMA = 0.1
"""Prior standard deviation of a relative change of omega^2 of one mode alone."""
BEYOND = 1.5
"""Factor beyond the measured band up to which modes have an added damping."""
STEP = 1e-4
"""Relative step of differences for numbers that change only frequency-dependent losses."""
SHARED_PLANTS = 12
"""Plants that problems with one nominal plant keep for each other."""


@dataclass(frozen=True)
class Prediction:
    """Predicted readings at some values of the unknowns.

    Attributes
    ----------
    plant : Plant
        The design with these values.
    order : array
        Its mode for each mode of the design at the start.
    response : tuple of Responses
        Of all signals, for each grid of frequencies.
    reading : list of arrays
        One per measured function.
    """

    plant: Plant
    order: Int[np.ndarray, " mode"]
    response: tuple[Responses, ...]
    reading: list[Complex[np.ndarray, " _"]]


@dataclass
class ResponseProblem:
    """A design, its measured functions and what is unknown.

    Attributes
    ----------
    base : Problem
        Free numbers, measured modes and priors; one experiment.
    channels : Channels
        Sensors, actuators and measured functions.
    damped : array
        Modes (of the design at the start) with an added damping.
    level : str
        Name of a model that supports derivatives.
    stiff : array
        Modes with a change of omega^2 of their own.
    """

    base: Problem
    channels: Channels
    damped: Int[np.ndarray, " damped"]
    level: str
    stiff: Int[np.ndarray, " stiff"] = field(default_factory=lambda: np.zeros(0, dtype=int))
    _cache: dict[bytes, Prediction] = field(default_factory=dict)
    _plants: dict[bytes, Plant] = field(default_factory=dict)

    @property
    def nuisances(self) -> tuple[Nuisance, ...]:
        """Unknown properties of sensors and actuators."""
        return self.channels.nuisances

    @cached_property
    def nominal(self) -> Plant:
        """The design where the search starts, in whose order its modes are numbered."""
        return self._plant(self.base.start)

    @property
    def numbers(self) -> int:
        """Number of free numbers of the design."""
        return len(self.base.start)

    @cached_property
    def start(self) -> Float[np.ndarray, " unknown"]:
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
    def low(self) -> Float[np.ndarray, " unknown"]:
        """Lower bounds."""
        gains = [-0.95 if item.kind == "gain" else -np.inf for item in self.nuisances]
        least = np.full(len(self.damped), np.log(1e-9))
        return np.concatenate([self.base.low, gains, least, np.full(len(self.stiff), -0.9)])

    @cached_property
    def high(self) -> Float[np.ndarray, " unknown"]:
        """Upper bounds."""
        rest = np.full(len(self.nuisances), np.inf)
        most = np.concatenate([np.zeros(len(self.damped)), np.ones(len(self.stiff))])
        return np.concatenate([self.base.high, rest, most])

    @cached_property
    def prior(self) -> tuple[Float[np.ndarray, " unknown"], Float[np.ndarray, " unknown"]]:
        """Prior values and their standard deviations, infinite where there is none."""
        q, r = len(self.nuisances), len(self.damped)
        s = len(self.stiff)
        damping = np.full(r, np.log(DAMPING))
        center = np.concatenate([self.base.prior, np.zeros(q), damping, np.zeros(s)])
        sigma = [item.sigma for item in self.nuisances]
        modes = np.repeat([DAMPING_SIGMA, STIFFENING_SIGMA], [r, s])
        return center, np.concatenate([self.base.prior_sigma, sigma, modes])

    @cached_property
    def scale(self) -> Float[np.ndarray, " unknown"]:
        """Typical size of a change of each unknown, to scale steps of the search."""
        sigma = self.prior[1]
        size = np.abs(self.start) * 0.1
        return np.where(np.isfinite(sigma), sigma, np.where(size > 0, size, 1e-3))

    def _plant(self, x: Float[np.ndarray, " number"]) -> Plant:
        key = x.tobytes()
        if key not in self._plants:
            while len(self._plants) > 1:
                del self._plants[next(iter(self._plants))]
            item = self.base.experiment[0]
            with item.faults():
                self._plants[key] = self._shared_plant(item.design(x))
        return self._plants[key]

    def _shared_plant(self, design: Design) -> Plant:
        """Return the plant of a design.

        The last ones are shared by all problems with one nominal plant, whose searches often pass
        through the same designs.
        """
        nominal = self.__dict__.get("nominal")
        if nominal is None:
            return Plant.of(design, self.level)
        encode = msgspec.msgpack.encode
        store = nominal.__dict__.setdefault("plants", {encode(nominal.design): nominal})
        key = encode(design)
        if key not in store:
            while len(store) >= SHARED_PLANTS:
                del store[next(iter(store))]
            store[key] = Plant.of(design, self.level)
        return store[key]

    def added(
        self, z: Float[np.ndarray, " unknown"]
    ) -> tuple[Float[np.ndarray, " damped"], Float[np.ndarray, " stiff"]]:
        """Added dampings and changes of omega^2 of modes."""
        own = z[self.numbers + len(self.nuisances) :]
        return np.exp(own[: len(self.damped)]), own[len(self.damped) :]

    def nuisance_values(self, z: Float[np.ndarray, " unknown"]) -> dict[Nuisance, float]:
        """Values of the nuisance parameters."""
        own = z[self.numbers : self.numbers + len(self.nuisances)]
        return dict(zip(self.nuisances, own.tolist(), strict=True))

    def predict(self, z: Float[np.ndarray, " unknown"]) -> Prediction:
        """Predict the readings of all measured functions; the last two are cached."""
        key = z.tobytes()
        if key not in self._cache:
            while len(self._cache) > 1:
                del self._cache[next(iter(self._cache))]
            self._cache[key] = self._predict(z)
        return self._cache[key]

    def _predict(self, z: Float[np.ndarray, " unknown"]) -> Prediction:
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

    def differentiate(
        self, z: Float[np.ndarray, " unknown"]
    ) -> list[Complex[np.ndarray, "_ unknown"]]:
        """Differentiate the reading of each measured function."""
        now, values = self.predict(z), self.nuisance_values(z)
        item = self.base.experiment[0]
        changes = [now.plant.change(name) for name in item.free]
        for name, change in zip(item.free, changes, strict=True):
            if change is None:
                raise InputError(
                    [
                        Fault(
                            f"parameter {name}",
                            "changing it alone unbalances the suspension",
                            "fit another number",
                        )
                    ]
                )
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
        if self._loses():
            self._add_losses(z, result)
        return result

    def _loses(self) -> list[int]:
        """Free numbers that act on losses as functions of frequency."""
        if registry.by_name(self.level).exact_derivatives:
            return []
        free = self.base.experiment[0].free
        return [
            n for n, name in enumerate(free) if set(name.split(".")) & {*response_matrix.LOSSES}
        ]

    def _add_losses(self, z: Float[np.ndarray, " unknown"], result: list[np.ndarray]) -> None:
        for n in self._loses():
            step = STEP * (abs(z[n]) or self.scale[n])
            move = np.zeros(len(z))
            move[n] = step
            above, below = self._predict(z + move).reading, self._predict(z - move).reading
            for one, high, low in zip(result, above, below, strict=True):
                one[:, n] = (high - low) / (2 * step)

    def uncertainties(self) -> list[Array]:
        """Standard deviations of the measured functions, (f,) each."""
        return [np.asarray(item.uncertainty, dtype=float) for item in self.channels.function]

    def response_residual(
        self, z: Float[np.ndarray, " unknown"], sigma: Sequence[Array]
    ) -> Float[np.ndarray, " residual"]:
        """Residuals of all measured functions, real parts then imaginary parts of each."""
        return np.concatenate(
            [
                stack_parts((reading - item.value) / s)
                for reading, item, s in zip(
                    self.predict(z).reading, self.channels.function, sigma, strict=True
                )
            ]
        )

    def residual(
        self, z: Float[np.ndarray, " unknown"], sigma: Sequence[Array] | None = None
    ) -> Float[np.ndarray, " residual"]:
        """All residuals: functions, modes and priors of numbers, priors of the other unknowns."""
        rows = [self.response_residual(z, self.uncertainties() if sigma is None else sigma)]
        if self.base.experiment[0].mode:
            frequency, _ = self.base.predict(z[: self.numbers])
            target = self.base.experiment[0]
            rows.append((frequency - target.frequency) / target.uncertainty)
        center, width = self.prior
        known = np.isfinite(width)
        rows.append(((z - center) / width)[known])
        return np.concatenate(rows)

    def jacobian(
        self, z: Float[np.ndarray, " unknown"], sigma: Sequence[Array] | None = None
    ) -> Float[np.ndarray, "residual unknown"]:
        """Differentiate `residual`."""
        sigma = self.uncertainties() if sigma is None else sigma
        rows = [
            stack_parts(slope / s[:, None])
            for slope, s in zip(self.differentiate(z), sigma, strict=True)
        ]
        if self.base.experiment[0].mode:
            slope = np.zeros((len(self.base.experiment[0].mode), len(z)))
            slope[:, : self.numbers] = self.base.predict(z[: self.numbers])[1]
            rows.append(slope / self.base.experiment[0].uncertainty[:, None])
        width = self.prior[1]
        rows.append(np.diag(1 / width)[np.isfinite(width)])
        return np.concatenate(rows)

    def frequencies(self, z: Float[np.ndarray, " unknown"]) -> Float[np.ndarray, " mode"]:
        """Frequencies of the modes in the order of the start, Hz.

        Without changes of omega^2 that the design does not explain.
        """
        plant = self._plant(z[: self.numbers])
        return plant.modes.frequency[self._order(plant)]

    def frequency_slopes(
        self, z: Float[np.ndarray, " unknown"]
    ) -> Float[np.ndarray, "mode number"]:
        """Derivatives of `frequencies` by the numbers of the design."""
        plant = self._plant(z[: self.numbers])
        order = self._order(plant)
        slope = np.zeros((len(order), self.numbers))
        for n, name in enumerate(self.base.experiment[0].free):
            change = plant.change(name)
            if change is not None:
                slope[:, n] = differentiate_frequencies(plant.modes, change)[order]
        return np.nan_to_num(slope)

    def _order(self, plant: Plant) -> Int[np.ndarray, " mode"]:
        """Mode of a design for each mode of the design at the start."""
        return pair_by_overlap((self.nominal.modes.shape @ plant.modal_forces.T) ** 2)

    def with_channels(self, channels: Channels) -> ResponseProblem:
        """Replace sensors and actuators; unknowns stay as they are if the nuisances do."""
        made = ResponseProblem(self.base, channels, self.damped, self.level, self.stiff)
        made.__dict__["nominal"] = self.nominal
        return made


def with_stiff_modes(problem: ResponseProblem, modes: Sequence[int] | Index) -> ResponseProblem:
    """Give some modes a change of omega^2 of their own."""
    made = replace(problem, stiff=np.asarray(modes, dtype=int), _cache={}, _plants={})
    made.__dict__["nominal"] = problem.nominal
    return made


def build(
    text: str,
    measured: Measured,
    channels: Channels,
    file: str = "",
    level: str = registry.STRING.name,
) -> ResponseProblem:
    """Set up the least-squares problem of a design with measured transfer functions."""
    base = search.build_problem([text], measured, [file], level)
    made = ResponseProblem(base, channels, np.zeros(0, dtype=int), level)
    frequency = made.nominal.modes.frequency
    every = np.concatenate([grid for grid, _ in channels.grids])
    inside = (frequency > every.min() / BEYOND) & (frequency < every.max() * BEYOND)
    damped = np.flatnonzero(inside & _visible(made))
    result = replace(made, damped=damped, _cache={}, _plants={})
    result.__dict__["nominal"] = made.nominal
    return result


def _visible(problem: ResponseProblem) -> Bool[np.ndarray, " mode"]:
    """Whether each mode appears in any measured function."""
    seen = residues(problem.nominal, problem.channels)
    return (seen != 0).any(0)


def residues(plant: Plant, channels: Channels) -> Float[np.ndarray, "function mode"]:
    """Compute the residues of the measured functions: H has residue/(w_k^2 - w^2)."""
    rows = [
        np.array([plant.base.row(signal) for signal in channels.signal[side]]).reshape(
            -1, plant.base.model.size
        )
        for side in (0, 1)
    ]
    shape, stiffness = plant.modes.shape, plant.base.linear.stiffness
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
