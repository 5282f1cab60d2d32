"""Sensing and driving matrices from the measured responses of all sensors to all coils of a stage.

    data = collect(design, functions)
    found = solve(data, Plant.of(design, "beam"))
    found.matrices.sensing, found.chi_squared

The measured functions are H(f) = exp(-2 pi i f T) A G(f) B: G the responses of the six motions of
the stage to forces along and about its axes in the model, A the readings of the sensors per motion,
B the forces and torques per force of the coils, T a delay that all share. A and B are real
constants, whatever the errors of gains, places and directions are. They, T, and changes of the
modes in the band (the model's are off by some per cent, more than the data) follow from weighted
least squares. With G off its diagonal only where the suspension itself
couples motions, S = A^-1 and D = B^-1 make S H D diagonal but for that.

A K and K^-1 B with K = diag(k) give the same H for K^-1 G K, which differs from G only where the
suspension couples motions, and by errors of calibration. So the scale of each motion is a
convention, that the nominal sensing matrix reads it right, (S_nominal A)_kk = 1, after sensors with
a wrong sign are turned, and the relative scales K of coupled motions are fitted beside A and B.

What the sensors and the coils of two coupled motions have in common, as if both were turned, is
seen in the stiffness alone: inertia is the same for all turned coordinates of unit kinetic energy.
So it is known as well as the stiffness of the model, whose errors the shifts of the frequencies of
all coupled modes show (`stiffness_sigma`): a design that was fitted to its modes gives the
smallest uncertainties.

Peaks of a model with slightly wrong frequencies are at the wrong places, where a search would stop.
So it begins with data whose uncertainty includes that of the frequencies and dampings (`LADDER`).
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit.osem_matrices import OsemFit
from suspension_cli.analyses.fit.problem import stack_parts
from suspension_cli.analyses.fit.result import Fitted, is_unlikely
from suspension_cli.conventions import DOFS
from suspension_cli.design import reader
from suspension_cli.design.control import Osem
from suspension_cli.design.faults import suggest
from suspension_cli.design.measured import Measured
from suspension_cli.design.reader import Source
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value
from suspension_cli.linear import response
from suspension_cli.linear.signals import Signal, linear_form
from suspension_cli.measurements.transfer_function import OSEM, MeasuredResponse
from suspension_cli.physics import local_control
from suspension_cli.scene.arrays import Array
from suspension_cli.studies.response_matrix import Plant

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

SCALE_SIGMA = 0.3
"""Prior standard deviation of K, around 1: of what all sensors of a motion share."""
STIFFNESS_SIGMA = 0.2
"""Prior standard deviation of the changes e of the stiffness between modes: 10 % of a frequency."""
LEAST_STIFFNESS_SIGMA = 0.005
"""The least that is taken for it from the frequencies of the modes."""
ALIKE = 1e-6
"""Overlap of the coordinates that two modes move from which they may be coupled."""
DAMPING_SIGMA = 0.1
"""The same of their added 1/Q."""
BEYOND = 1.5
"""Factor by which the band of modes that are fitted exceeds the measured one."""
LADDER = (1.0, 0.2, 0.04, 0.0)
"""Fractions of these uncertainties in that of the data, in the order of the searches."""
ROUNDS = 400
"""Most alternating linear fits of A and B before the first search; they converge linearly."""
SETTLED = 1e-5
"""Largest relative change of A in a round at which these end."""
UNDETERMINED = 0.3
"""Standard deviation of an element over the size of its row from which there is no result."""
CLOSE = 1e-3
CONVERGED = 1e-12
"""Relative changes at which searches end, those with widened uncertainties and the last one."""
STEP = 1e-6
"""Step of derivatives of S and D by scaled elements of A and B."""


@dataclass(frozen=True)
class OsemData:
    """Measured responses of all sensors to all coils of the OSEMs of a stage, SI.

    `sigma` is the standard deviation of real and imaginary part.
    """

    sensors: tuple[Osem, ...]
    coils: tuple[Osem, ...]
    frequency: Float[np.ndarray, " frequency"]
    value: Complex[np.ndarray, "frequency sensor coil"]
    sigma: Float[np.ndarray, "frequency sensor coil"]

    @property
    def stage(self) -> str:
        """The stage of all OSEMs."""
        return self.sensors[0].stage


def demand_functions_alone(given: Measured) -> None:
    """Raise `InputError` if a file of measurements has other than transfer functions."""
    for key in ("parameter", "mode", "quantity", "experiment"):
        if getattr(given, key):
            problem = "is not used with --matrices, which changes no parameter"
            remedy = "fit the design to it first, without --matrices, and then take the fitted one"
            raise InputError.of(key, problem, remedy)


def fit_design(source: Source, functions: Sequence[MeasuredResponse], level: str) -> Fitted:
    """Find the matrices of the OSEMs of a design, and put them into its `[[control.osem]]`."""
    data = collect(source.design, functions)
    with attribute_faults_to(source.file):
        plant = Plant.of(source.design, level)
    found = solve(data, plant)
    raw = tomllib.loads(source.text)
    rows = found.matrices
    for osem in raw["control"]["osem"]:
        if osem["name"] in rows.sensor:
            osem["sensing"] = _rounded(rows.sensing_rows[rows.sensor.index(osem["name"])])
        if osem["name"] in rows.coil:
            osem["driving"] = _rounded(rows.driving_rows[rows.coil.index(osem["name"])])
    none = np.zeros(0)
    whole = np.zeros(0, dtype=int)
    return Fitted(
        experiment=(source.name,),
        name=(),
        shared=np.zeros((0, 1), dtype=bool),
        start=none,
        value=none,
        sigma=none,
        prior=none,
        prior_sigma=none,
        covariance=np.zeros((0, 0)),
        scale=found.scale,
        at_bound=np.zeros(0, dtype=bool),
        of=whole,
        label=(),
        measured=none,
        uncertainty=none,
        before=none,
        after=none,
        value_of=whole,
        quantity=(),
        quantity_unit=(),
        value_measured=none,
        value_uncertainty=none,
        value_before=none,
        value_after=none,
        chi_squared=found.chi_squared,
        freedom=found.freedom,
        singular=none,
        direction=np.zeros((0, 0)),
        toml=(reader.write_toml(raw, source.text),),
        design_before=(),
        ends=np.array([found.chi_squared]),
        matrices=rows,
    )


def _rounded(row: Float[np.ndarray, " 6"]) -> list[float]:
    """Round to nine digits, more than any measurement has."""
    return [float(f"{value:.9g}") for value in row.tolist()]


def collect(design: Design, functions: Sequence[MeasuredResponse]) -> OsemData:
    """Arrange measured functions by sensor and coil.

    Raises `InputError` if the functions are not those of all sensors to all coils of one stage at
    the same frequencies, or have no uncertainty.
    """
    known = {} if design.control is None else {one.name: one for one in design.control.osem}
    if not known:
        problem = "has none, so there are no matrices to find"
        raise InputError.of("control.osem", problem, "add [[control.osem]] to the design")
    bad = [
        fault
        for n, item in enumerate(functions, 1)
        for fault in _faults(f"transfer_function.{n}", item, known)
    ]
    if bad:
        raise InputError(bad)
    pairs = {(_osem(item.output), _osem(item.input)): item for item in functions}
    sensors = [known[name] for name in dict.fromkeys(sensor for sensor, _ in pairs)]
    coils = [known[name] for name in dict.fromkeys(coil for _, coil in pairs)]
    places = dict.fromkeys((one.stage, one.reference) for one in (*sensors, *coils))
    if len(places) > 1:
        listed = " and ".join(f"{stage} ({reference})" for stage, reference in places)
        problem = f"has OSEMs of {listed}"
        raise InputError.of("transfer_function", problem, "give each stage a file of its own")
    if len(pairs) < len(functions):
        problem = "gives a sensor and a coil twice"
        raise InputError.of("transfer_function", problem, "keep one function of each pair")
    every = [(one.name, other.name) for one in sensors for other in coils]
    missing = [
        f"{OSEM}{one} over {OSEM}{other}" for one, other in every if (one, other) not in pairs
    ]
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        problem = f"lacks {', '.join(missing[:3])}{more}"
        remedy = "matrices need the functions of all sensors to all coils"
        raise InputError.of("transfer_function", problem, remedy)
    grid = functions[0].frequency
    for n, item in enumerate(functions, 1):
        if not np.array_equal(item.frequency, grid):
            problem = f"{item.name} has other frequencies than {functions[0].name}"
            remedy = "give all functions the same frequencies, or the same band"
            raise InputError.of(f"transfer_function.{n}", problem, remedy)
    size = (len(sensors), len(coils), len(grid))
    ordered = [pairs[pair] for pair in every]
    value = np.reshape([item.value for item in ordered], size)
    sigma = np.reshape([item.uncertainty for item in ordered], size)
    order = (2, 0, 1)
    return OsemData(
        tuple(sensors), tuple(coils), grid, value.transpose(order), sigma.transpose(order)
    )


def _osem(name: str) -> str:
    return name.removeprefix(OSEM)


def _faults(key: str, item: MeasuredResponse, known: dict[str, Osem]) -> list[Fault]:
    """List what is wrong with one function: its names, or its uncertainty."""
    found = []
    for end, name in (("input", item.input), ("output", item.output)):
        if not name.startswith(OSEM):
            remedy = (
                f"write {OSEM}{next(iter(known))} for the {'coil' if end == 'input' else 'sensor'}"
            )
            problem = "is not an OSEM, between which --matrices needs all functions"
            found.append(Fault(f"{key}.{end}", problem, remedy, format_value(name)))
        elif _osem(name) not in known:
            remedy = suggest(_osem(name), list(known))
            problem = "names no [[control.osem]] of the design"
            found.append(Fault(f"{key}.{end}", problem, remedy, format_value(name)))
    sigma = np.asarray(item.uncertainty, dtype=float)
    if not (np.isfinite(sigma) & (sigma > 0)).all():
        problem = f"{item.name} gives no uncertainty at some frequencies, so they have no weight"
        remedy = "give uncertainty, or coherence above 0 and averages; or --relative-uncertainty"
        found.append(Fault(key, problem, remedy))
    return found


@dataclass(frozen=True)
class StageResponses:
    """Responses of the motions of a stage to forces on it, with changed modes of its suspension.

    With the momenta p_j = M v_j of modes, errors of the stiffness of the model and an added damping
    1/Q = eta_j add the sum of p_j C_jk p_k^T to its dynamic stiffness, C_jk = omega_j omega_k e_jk
    + i omega omega_j eta_j delta_jk. With the responses of and to the modes this is inverted
    exactly (Woodbury): G = G0 - U C (1 + Q C)^-1 W. Only modes that move the same coordinates are
    coupled: other couplings need parts that break the symmetry of the design.
    """

    omega: Float[np.ndarray, " frequency"]
    stage: Complex[np.ndarray, "frequency 6 6"]
    from_modes: Complex[np.ndarray, "frequency 6 mode"]
    to_modes: Complex[np.ndarray, "frequency mode 6"]
    between_modes: Complex[np.ndarray, "frequency mode mode"]
    mode_omega: Float[np.ndarray, " mode"]

    first: Int[np.ndarray, " change"]
    second: Int[np.ndarray, " change"]

    @staticmethod
    def of(plant: Plant, stage: str, frequency: Float[np.ndarray, " frequency"]) -> StageResponses:
        """Solve the model with its loops open; modes beyond the band stay as they are."""
        modes = modes_in_band(plant, frequency)
        ends = [Signal("", stage, dof, (0.0, 0.0, 0.0), acts=True) for dof in range(6)]
        forms = np.array([linear_form(end, plant.system) for end in ends])
        momenta = np.pad(plant.modal_forces[modes], ((0, 0), (6, 0)))
        both = np.concatenate([forms, momenta])
        omega = 2 * np.pi * frequency
        found, _ = response.transfer(plant.system, omega, both, [True] * len(both), both)
        moves = np.abs(plant.modal_forces[modes]) @ np.abs(plant.modes.shape[modes]).T
        first, second = np.nonzero(np.triu(moves > ALIKE))
        return StageResponses(
            omega,
            found[:, :6, :6],
            found[:, :6, 6:],
            found[:, 6:, :6],
            found[:, 6:, 6:],
            np.sqrt(plant.modes.omega_squared[modes]),
            first,
            second,
        )

    def stiffness(self, change: Float[np.ndarray, " change"]) -> Float[np.ndarray, "mode mode"]:
        """Stiffness between modes that relative changes e add."""
        w = self.mode_omega
        matrix = np.zeros((len(w), len(w)))
        matrix[self.first, self.second] = matrix[self.second, self.first] = change
        return w[:, None] * matrix * w

    def typical_change(self, change: Float[np.ndarray, " change"]) -> Float[np.ndarray, " change"]:
        """Typical size of each change e: the root mean square of those of coupled modes' own."""
        count = len(self.mode_omega)
        coupled = np.zeros((count, count))
        coupled[self.first, self.second] = coupled[self.second, self.first] = 1.0
        own = change[self.first == self.second]
        size = np.sqrt(coupled @ own**2 / coupled.sum(1))
        size = np.clip(size, LEAST_STIFFNESS_SIGMA, STIFFNESS_SIGMA)
        return np.sqrt(size[self.first] * size[self.second])

    def frequencies(self, change: Float[np.ndarray, " change"]) -> Float[np.ndarray, " mode"]:
        """Frequencies of the modes with relative changes e, Hz; NaN for an unstable one."""
        squared = np.linalg.eigvalsh(np.diag(self.mode_omega**2) + self.stiffness(change))
        with np.errstate(invalid="ignore"):
            return np.sqrt(squared) / (2 * np.pi)

    def at(
        self, change: Float[np.ndarray, " change"], damping: Float[np.ndarray, " mode"]
    ) -> ChangedModes:
        """Responses with relative changes e of the stiffness and an added 1/Q of the modes."""
        w = self.mode_omega
        lossy = 1j * self.omega[:, None] * w
        added = self.stiffness(change) + (lossy * damping)[:, None, :] * np.eye(len(w))
        mixed = np.eye(len(w)) + self.between_modes @ added
        to_modes = np.linalg.solve(mixed, self.to_modes)
        from_modes = np.linalg.solve(mixed, self.from_modes.swapaxes(1, 2)).swapaxes(1, 2)
        stage = self.stage - self.from_modes @ (added @ to_modes)
        return ChangedModes(stage, from_modes, to_modes)


@dataclass(frozen=True)
class ChangedModes:
    """Responses of a stage with changed modes; dG/dC_jk = -from_modes_j to_modes_k^T."""

    stage: Complex[np.ndarray, "frequency 6 6"]
    from_modes: Complex[np.ndarray, "frequency 6 mode"]
    to_modes: Complex[np.ndarray, "frequency mode 6"]

    def scaled(self, by: Float[np.ndarray, " 6"]) -> ChangedModes:
        """Responses in other units of each motion, of its forces in the inverse ones."""
        return ChangedModes(
            by[:, None] * self.stage / by, by[:, None] * self.from_modes, self.to_modes / by
        )


def modes_in_band(
    plant: Plant, frequency: Float[np.ndarray, " frequency"]
) -> Int[np.ndarray, " mode"]:
    """Number the modes whose frequencies are fitted."""
    hz = plant.modes.frequency
    with np.errstate(invalid="ignore"):
        inside = (hz > frequency.min() / BEYOND) & (hz < frequency.max() * BEYOND)
    return np.flatnonzero(inside)


@dataclass(frozen=True)
class MatrixProblem:
    """Least squares for A, B, the modes and the delay.

    Unknowns are, in this order: what the columns of A have beside the nominal ones and orthogonal
    to the rows of the nominal sensing matrix (motion, number), and the elements of B (motion,
    coil), over the scales of the motions; K - 1; the changes e of the stiffness and the added
    dampings of the modes; the delay in units of the inverse of the highest omega. Elements of
    motions that the OSEMs do not resolve are nominal. `sign` is that of each sensor,
    `stiffness_sigma` the prior standard deviation of each change e.
    """

    data: OsemData
    responses: StageResponses
    sign: Float[np.ndarray, " sensor"]
    stiffness_sigma: Float[np.ndarray, " change"]

    @cached_property
    def nominal(self) -> tuple[Float[np.ndarray, "sensor 6"], Float[np.ndarray, "6 coil"]]:
        """A and B of the design, with the signs of the sensors."""
        return (
            self.sign[:, None] * local_control.sensing_rows(self.data.sensors),
            local_control.driving_rows(self.data.coils).T,
        )

    @cached_property
    def resolved(self) -> Bool[np.ndarray, " 6"]:
        """Whether sensors and coils resolve each motion."""
        a, b = self.nominal
        _, read = local_control.compute_weights(np.eye(6), a)
        _, pushed = local_control.compute_weights(np.eye(6), b.T)
        return read & pushed

    @property
    def motion(self) -> tuple[str, ...]:
        """Names of the motions that are resolved."""
        return tuple(dof for dof, one in zip(DOFS, self.resolved, strict=True) if one)

    @cached_property
    def size(self) -> tuple[Float[np.ndarray, " motion"], Float[np.ndarray, " motion"]]:
        """Norms of the nominal columns of A and rows of B: scales of their elements."""
        a, b = self.nominal
        return np.linalg.norm(a, axis=0)[self.resolved], np.linalg.norm(b, axis=1)[self.resolved]

    @cached_property
    def parts(self) -> tuple[slice, slice, slice, slice, slice, int]:
        """Places of A, B, K, changes of frequencies, dampings, and the delay in z."""
        motions = len(self.motion)
        counts = {
            "a": motions * (len(self.data.sensors) - 1),
            "b": motions * len(self.data.coils),
            "scale": motions,
            "change": len(self.responses.first),
            "damping": len(self.responses.mode_omega),
        }
        ends = [0, *np.cumsum(list(counts.values())).tolist()]
        of_a, of_b, of_scale, of_change, of_damping = (slice(*pair) for pair in pairwise(ends))
        return of_a, of_b, of_scale, of_change, of_damping, ends[-1]

    @cached_property
    def free_columns(self) -> Float[np.ndarray, "motion sensor number"]:
        """Orthonormal changes of each column of A that the nominal sensing matrix does not read."""
        from scipy import linalg

        return np.array([linalg.null_space(row[None]) for row in self.nominal_sensing])

    @cached_property
    def nominal_sensing(self) -> Float[np.ndarray, "motion sensor"]:
        """The sensing matrix of the design, with the signs of the sensors."""
        return local_control.compute_weights(np.eye(6), self.nominal[0])[0][self.resolved]

    @cached_property
    def nominal_driving(self) -> Float[np.ndarray, "coil motion"]:
        """The driving matrix of the design."""
        return local_control.compute_weights(np.eye(6), self.nominal[1].T)[0][self.resolved].T

    def pack(self, a: Array, b: Array) -> Array:
        """Turn A and B into unknowns with modes of the design, without delay.

        The scale of each motion becomes that of the convention.
        """
        z = np.zeros(self.parts[-1] + 1)
        own = self.resolved
        scale = self.scales(a)
        columns = (a[:, own] / scale - self.nominal[0][:, own]) / self.size[0]
        z[self.parts[0]] = np.einsum("ksn,sk->kn", self.free_columns, columns).ravel()
        z[self.parts[1]] = (b[own] * (scale / self.size[1])[:, None]).ravel()
        z[self.parts[2]] = scale - 1
        return z

    def scales(self, a: Array) -> Float[np.ndarray, " motion"]:
        """Scale at which the nominal sensing matrix reads each motion of sensors A."""
        return np.einsum("ks,sk->k", self.nominal_sensing, a[:, self.resolved])

    def signs(self, a: Array) -> Float[np.ndarray, " sensor"]:
        """Sign of each sensor of A against the design."""
        own = self.resolved
        along = (a[:, own] * self.nominal[0][:, own] / self.size[0] ** 2).sum(1)
        return np.where(along < 0, -1.0, 1.0)

    def matrices(
        self, z: Array
    ) -> tuple[Float[np.ndarray, "sensor 6"], Float[np.ndarray, "6 coil"]]:
        """A and B of unknowns."""
        a, b = (part.copy() for part in self.nominal)
        own = len(self.motion)
        moved = np.einsum("ksn,kn->sk", self.free_columns, z[self.parts[0]].reshape(own, -1))
        a[:, self.resolved] += moved * self.size[0]
        b[self.resolved] = z[self.parts[1]].reshape(own, -1) * self.size[1][:, None]
        return a, b

    def inverses(self, z: Array) -> tuple[Array, Array]:
        """S and D."""
        a, b = self.matrices(z)
        sensing, _ = local_control.compute_weights(np.eye(6)[self.resolved], a)
        driving, _ = local_control.compute_weights(np.eye(6)[self.resolved], b.T)
        return sensing, driving.T

    def elements(self, z: Array) -> Float[np.ndarray, " element"]:
        """Elements of S and D."""
        return np.concatenate([part.ravel() for part in self.inverses(z)])

    @property
    def prior(self) -> Float[np.ndarray, " unknown"]:
        """Inverse standard deviations of the priors; 0 without."""
        _, _, scale, change, damping, delay = self.parts
        weight = np.zeros(delay + 1)
        weight[scale] = 1 / SCALE_SIGMA
        weight[change] = 1 / self.stiffness_sigma
        weight[damping] = 1 / DAMPING_SIGMA
        return weight

    def changed(self, z: Array) -> ChangedModes:
        """Responses of the stage with the modes and the relative scales of unknowns."""
        scale = np.ones(6)
        scale[self.resolved] += z[self.parts[2]]
        return self.responses.at(z[self.parts[3]], z[self.parts[4]]).scaled(scale)

    def delayed(self, z: Array) -> Complex[np.ndarray, "frequency 1 1"]:
        """Factor of the delay."""
        omega = self.responses.omega
        return np.exp(-1j * omega / omega.max() * z[-1])[:, None, None]

    def predict(self, z: Array) -> Complex[np.ndarray, "frequency sensor coil"]:
        """Compute the functions of unknowns."""
        a, b = self.matrices(z)
        return self.delayed(z) * (a @ self.changed(z).stage @ b)

    def differentiate(self, z: Array) -> Complex[np.ndarray, "unknown frequency sensor coil"]:
        """Differentiate `predict`."""
        a, b = self.matrices(z)
        now = self.changed(z)
        late = self.delayed(z)
        own = self.resolved
        pushed = late * (now.stage @ b)  # motions per drive
        read = late * (a @ now.stage)  # readings per force along each motion
        result = np.zeros((len(z), *self.data.value.shape), dtype=complex)
        moved = self.free_columns * self.size[0][:, None, None]
        by_a = np.einsum("ksn,fkc->knfsc", moved, pushed[:, own])
        result[self.parts[0]] = by_a.reshape(-1, *self.data.value.shape)
        by_b = result[self.parts[1]].reshape(len(self.motion), -1, *self.data.value.shape)
        for n in range(by_b.shape[1]):
            by_b[:, n, :, :, n] = self.size[1][:, None, None] * read[:, :, own].transpose(2, 0, 1)
        read_modes = late * (a @ now.from_modes)
        pushed_modes = now.to_modes @ b
        through = np.einsum("fsj,fkc->jkfsc", read_modes, pushed_modes)
        w = self.responses.mode_omega
        one, other = self.responses.first, self.responses.second
        both = through[one, other] + through[other, one]
        both[one == other] /= 2
        result[self.parts[3]] = -(w[one] * w[other])[:, None, None, None] * both
        lossy = 1j * self.responses.omega[:, None, None] * w[:, None, None, None]
        modes = np.arange(len(w))
        result[self.parts[4]] = -lossy * through[modes, modes]
        # K G K^-1: a row more, a column less
        by_row = np.einsum("sk,fkc->kfsc", a[:, own], pushed[:, own])
        by_column = np.einsum("fsk,kc->kfsc", read[:, :, own], b[own])
        scale = (1 + z[self.parts[2]])[:, None, None, None]
        result[self.parts[2]] = (by_row - by_column) / scale
        omega = self.responses.omega
        turn = (-1j * omega / omega.max())[:, None, None]
        result[-1] = turn * late * (a @ now.stage @ b)
        return result

    def residual(self, z: Array, sigma: Array) -> Float[np.ndarray, " residual"]:
        """Residuals of data and priors over their standard deviations."""
        off = ((self.predict(z) - self.data.value) / sigma).ravel()
        weight = self.prior
        return np.concatenate([stack_parts(off), (weight * z)[weight > 0]])

    def jacobian(self, z: Array, sigma: Array) -> Float[np.ndarray, "residual unknown"]:
        """Differentiate `residual`."""
        slopes = (self.differentiate(z) / sigma).reshape(len(z), -1).T
        weight = self.prior
        return np.concatenate([stack_parts(slopes), np.diag(weight)[weight > 0]])

    def widened(self, z: Array, fraction: float) -> Float[np.ndarray, "frequency sensor coil"]:
        """Standard deviations of the data with that of the modes, times a fraction."""
        if not fraction:
            return self.data.sigma
        slopes = self.differentiate(z)
        _, _, _, change, damping, _ = self.parts
        power = np.einsum("k,kfsc->fsc", self.stiffness_sigma**2, np.abs(slopes[change]) ** 2)
        power = power + DAMPING_SIGMA**2 * (np.abs(slopes[damping]) ** 2).sum(0)
        return np.sqrt(self.data.sigma**2 + fraction**2 * power)


def solve(data: OsemData, plant: Plant) -> MatrixSolution:
    """Fit A, B, the modes and the delay.

    Raises `InputError` if the OSEMs resolve no motion, or if the data do not determine an element.
    """
    responses = StageResponses.of(plant, data.stage, data.frequency)
    wide = np.full(len(responses.first), STIFFNESS_SIGMA)
    problem = MatrixProblem(data, responses, np.ones(len(data.sensors)), wide)
    if not problem.motion:
        where = f"the OSEMs of {data.stage}"
        text = f"{where} that were measured resolve no motion alone"
        raise InputError.of("transfer_function", text, "measure more of its OSEMs")
    count = 2 * data.value.size
    unknowns = problem.parts[-1] + 1
    if count < unknowns:
        measured = len(data.frequency)
        each = "1 frequency gives" if measured == 1 else f"{measured} frequencies give"
        text = f"{each} {count} numbers for {unknowns} unknowns"
        raise InputError.of("transfer_function", text, "measure at more frequencies")
    a, b = _alternate(problem)
    problem = replace(problem, sign=problem.signs(a))
    z = problem.pack(a, b)
    for fraction in LADDER:
        z = _minimise(problem, z, problem.widened(z, fraction), CLOSE if fraction else CONVERGED)
    problem = replace(problem, stiffness_sigma=responses.typical_change(z[problem.parts[3]]))
    z = _minimise(problem, z, data.sigma, CONVERGED)
    found = MatrixSolution(problem, plant, z)
    found.demand_determined()
    return found


def _alternate(problem: MatrixProblem) -> tuple[Array, Array]:
    """Fit B to the data with A, then A with B, some times: a start with any signs and gains."""
    a, b = (part.copy() for part in problem.nominal)
    z = problem.pack(a, b)
    weight = 1 / problem.widened(z, 1.0)
    stage = problem.changed(z).stage
    own = problem.resolved
    for _ in range(ROUNDS):
        read = a @ stage
        rest = problem.data.value - read[..., ~own] @ b[~own]
        b[own] = _real_fits(read[..., own], rest, weight)
        pushed = (stage @ b).swapaxes(1, 2)
        rest = problem.data.value.swapaxes(1, 2) - pushed[..., ~own] @ a[:, ~own].T
        last = a.copy()
        a[:, own] = _real_fits(pushed[..., own], rest, weight.swapaxes(1, 2)).T
        if np.linalg.norm((a - last)[:, own] / problem.size[0]) < SETTLED:
            break
    return a, b


def _real_fits(
    columns: Complex[np.ndarray, "frequency channel motion"],
    value: Complex[np.ndarray, "frequency channel other"],
    weight: Float[np.ndarray, "frequency channel other"],
) -> Float[np.ndarray, "motion other"]:
    """Fit real factors of complex columns to complex data, by normal equations: a mere start."""
    motions = columns.shape[-1]
    rows = columns.reshape(-1, motions)
    power = weight.reshape(len(rows), -1) ** 2
    size = np.linalg.norm(rows, axis=0)
    size[size == 0] = 1.0
    rows = rows / size
    products = np.real(rows.conj()[:, :, None] * rows[:, None, :]).reshape(len(rows), -1)
    normal = (power.T @ products).reshape(-1, motions, motions)
    right = np.real(rows.conj().T @ (power * value.reshape(len(rows), -1))).T
    inverse = np.linalg.pinv(normal, hermitian=True)
    return (inverse @ right[..., None])[..., 0].T / size[:, None]


def _minimise(problem: MatrixProblem, z: Array, sigma: Array, tolerance: float) -> Array:
    from scipy import optimize

    found = optimize.least_squares(
        problem.residual, z, jac=problem.jacobian, args=(sigma,), method="lm", max_nfev=200,  # pyright: ignore[reportArgumentType]
        x_scale="jac", xtol=tolerance, ftol=tolerance, gtol=tolerance,
    )  # fmt: skip
    return found.x


def central_differences(function: Callable[[Array], Array], at: Array) -> Array:
    """Differentiate a vector (first axis) by unknowns of the order of 1 (second axis)."""
    moves = STEP * np.eye(len(at))
    return np.array([(function(at + one) - function(at - one)) / (2 * STEP) for one in moves]).T


@dataclass(frozen=True)
class MatrixSolution:
    """Unknowns at the smallest chi^2, and what follows from them."""

    problem: MatrixProblem
    plant: Plant
    z: Array

    @cached_property
    def chi_squared(self) -> float:
        """Sum of the squares of the residuals of data and priors."""
        return float(np.sum(self.problem.residual(self.z, self.problem.data.sigma) ** 2))

    @cached_property
    def slope(self) -> Float[np.ndarray, "residual unknown"]:
        """Derivatives of the residuals."""
        return self.problem.jacobian(self.z, self.problem.data.sigma)

    @property
    def freedom(self) -> int:
        """Number of data and priors less that of unknowns."""
        return len(self.slope) - len(self.z)

    @cached_property
    def scale(self) -> float:
        """Factor on uncertainties in a misfit: the root of chi^2 per degree of freedom."""
        if not is_unlikely(self.chi_squared, len(self.slope), len(self.z)):
            return 1.0
        return float(np.sqrt(self.chi_squared / self.freedom))

    @cached_property
    def covariance(self) -> Float[np.ndarray, "unknown unknown"]:
        """(J^T J)^-1, larger in a misfit; combinations without any weight are left out."""
        _, singular, direction = np.linalg.svd(self.slope, full_matrices=False)
        floor = np.finfo(float).eps * len(self.z) * singular.max()
        rows = direction / np.maximum(singular, floor)[:, None]
        return self.scale**2 * rows.T @ rows

    @property
    def frequency_sigma(self) -> Float[np.ndarray, " mode"]:
        """Standard deviations of the frequencies of modes, Hz."""
        own = self.problem.parts[3]
        slopes = central_differences(self.problem.responses.frequencies, self.z[own])
        return np.sqrt(np.einsum("mi,ij,mj->m", slopes, self.covariance[own, own], slopes))

    @cached_property
    def by_unknowns(self) -> Float[np.ndarray, "element unknown"]:
        """Derivatives of the elements of S and D by the unknowns."""
        return central_differences(self.problem.elements, self.z)

    @cached_property
    def of_elements(self) -> Float[np.ndarray, "element element"]:
        """Covariance of the elements of S, row by row, then of D."""
        return self.by_unknowns @ self.covariance @ self.by_unknowns.T

    def sigmas(self) -> tuple[Float[np.ndarray, "motion sensor"], Float[np.ndarray, "coil motion"]]:
        """Standard deviations of S and D."""
        sensing, driving = self.problem.inverses(self.z)
        every = np.sqrt(np.clip(np.diag(self.of_elements), 0.0, None))
        return every[: sensing.size].reshape(sensing.shape), every[sensing.size :].reshape(
            driving.shape
        )

    def demand_determined(self) -> None:
        """Raise `InputError` if the data do not determine an element of S or D."""
        motion = self.problem.motion
        nominal = self.problem.nominal_sensing, self.problem.nominal_driving.T
        found = self.problem.inverses(self.z)
        sigma = self.sigmas()
        worst = []
        for size, value, error in zip(
            nominal, (found[0], found[1].T), (sigma[0], sigma[1].T), strict=True
        ):
            norm = np.maximum(np.linalg.norm(size, axis=1), np.linalg.norm(value, axis=1))
            worst.append(error.max(axis=1) / norm)
        relative = np.maximum(*worst)
        n = int(relative.argmax())
        if relative[n] <= UNDETERMINED:
            return
        others = np.argsort(-relative)[: int((relative > UNDETERMINED).sum())]
        names = " and ".join(motion[k] for k in sorted(others.tolist()))
        known = f"an element is known to {100 * relative[n]:.0f} % only"
        if not np.isfinite(relative[n]) or relative[n] > 10:
            known = "an element is not known at all"
        what = "apart from each other" if len(others) > 1 else "from noise"
        problem = f"these data do not tell {names} of {self.problem.data.stage} {what}: {known}"
        remedy = (
            "fit the design to its modes first, or drive more strongly, average longer, or measure"
            " in a wider band"
        )
        raise InputError.of("transfer_function", problem, remedy)

    @cached_property
    def matrices(self) -> OsemFit:
        """The record of the matrices."""
        problem = self.problem
        data = problem.data
        z = self.z
        sensing, driving = problem.inverses(z)
        sensing_sigma, driving_sigma = self.sigmas()
        a, b = problem.matrices(z)
        sigma = np.sqrt(np.diag(self.covariance))
        modes = modes_in_band(self.plant, data.frequency)
        nominal = self.plant.modes.frequency[modes]
        per_delay = 1 / problem.responses.omega.max()
        given = replace(problem, sign=np.ones(len(data.sensors))).nominal_sensing
        before, _ = _couplings(given, problem.nominal_driving, data)
        after, noise = _couplings(sensing, driving, data)
        own = np.ix_(problem.resolved, problem.resolved)
        stage = problem.changed(z).stage[:, own[0], own[1]]
        suspension, _ = _pair_couplings(stage, 0 * np.abs(stage))
        first, second = np.triu_indices(len(problem.motion), 1)
        return OsemFit(
            stage=data.stage,
            reference=data.sensors[0].reference,
            sensor=tuple(one.name for one in data.sensors),
            coil=tuple(one.name for one in data.coils),
            motion=problem.motion,
            sensing_nominal=given,
            sensing=sensing,
            sensing_sigma=sensing_sigma,
            driving_nominal=problem.nominal_driving,
            driving=driving,
            driving_sigma=driving_sigma,
            covariance=self.of_elements,
            sensing_rows=a,
            driving_rows=b.T,
            mode=tuple(self.plant.modes.label[n] for n in modes),
            mode_nominal=nominal,
            mode_frequency=problem.responses.frequencies(z[problem.parts[3]]),
            mode_sigma=self.frequency_sigma,
            delay=float(z[-1] * per_delay),
            delay_sigma=float(sigma[-1] * per_delay),
            frequency=data.frequency,
            pair=tuple(
                f"{problem.motion[i]}, {problem.motion[j]}"
                for i, j in zip(first, second, strict=True)
            ),
            before=before,
            after=after,
            noise=noise,
            suspension=suspension,
        )


def _couplings(sensing: Array, driving: Array, data: OsemData) -> tuple[Array, Array]:
    """Couplings of the data with two matrices, and the standard deviations from their noise."""
    value = sensing @ data.value @ driving
    power = (sensing**2) @ (2 * data.sigma**2) @ (driving**2)
    return _pair_couplings(value, np.sqrt(power))


def _pair_couplings(
    value: Complex[np.ndarray, "frequency motion motion"],
    noise: Float[np.ndarray, "frequency motion motion"],
) -> tuple[Float[np.ndarray, "frequency pair"], Float[np.ndarray, "frequency pair"]]:
    """Off-diagonal elements of each pair of motions over the root of the diagonal ones."""
    first, second = np.triu_indices(value.shape[1], 1)
    size = np.abs(value)
    diagonal = np.einsum("fkk->fk", size)
    base = np.sqrt(diagonal[:, first] * diagonal[:, second])

    def largest(part: Array) -> Array:
        return np.maximum(part[:, first, second], part[:, second, first]) / base

    return largest(size), largest(noise)
