"""The problem of a fit: from unknowns to weighted residuals, with their derivatives.

    problem = start.build(texts, measured, files, "beam")
    z, chi_squared = problem.minimise(problem.unknowns.start)
    problem.residual(z), problem.jacobian(z)

Unknowns z are, in this order: the free parameters of the designs; gains, delays and mixing of
sensors and actuators; the logarithm of an added damping 1/Q of every mode in the measured band, as
losses in air are rarely known. Residuals, over their standard deviations, are measured modes;
measured quantities; real and imaginary parts of predicted less measured transfer functions; and
priors.
"""

from __future__ import annotations

import functools
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from suspension_cli.analyses import readings
from suspension_cli.analyses.analysis import Document
from suspension_cli.analyses.fit import measured_values
from suspension_cli.design import paths, reader
from suspension_cli.design.faults import suggest
from suspension_cli.design.measured import Free, MeasuredQuantity, Mode
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value
from suspension_cli.grids import parse_place
from suspension_cli.linear.mode_pairing import pair_by_overlap
from suspension_cli.measurements.resonances import Peak
from suspension_cli.measurements.transfer_function import GAIN, Channels
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.scene.arrays import Array
from suspension_cli.studies import derivatives
from suspension_cli.studies.response_matrix import Matrices, Plant, Responses

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact, Int

FORBIDDEN = 1e6
"""Cost of assigning a measurement to a mode that it cannot belong to; others cost the square of
ln(measured / computed)."""
DAMPING = 1e-3
"""Prior median of the added damping 1/Q of a mode."""
DAMPING_SIGMA = 2.5
"""Standard deviation of its logarithm: a factor of 12 either way."""
TYPICAL = 0.1
"""Typical change of a parameter without prior, relative to its value."""
SMALL = 1e-3
"""The same of a parameter of value 0, SI."""
CONVERGED = 1e-9
"""Relative change of chi^2, unknowns and gradient at which a search ends."""
LOSSES = ("loss_angle", "loss")
"""Keys whose numbers change only the frequency-dependent terms of models in which wires bend."""
LOSS_STEP = 1e-3
"""Step of derivatives by these, relative to the number; a hundredth of this for 0."""
UNDETERMINED = 1e-10
"""Singular value relative to the largest, below which the data do not determine a combination."""


@dataclass(frozen=True, eq=False)
class Build:
    """A design (TOML) on a model, with its free parameters (dotted paths) at x."""

    text: str
    level: str
    free: tuple[str, ...]
    x: tuple[float, ...]

    @cached_property
    def document(self) -> Document:
        """Parsed TOML of the design."""
        raw = tomllib.loads(self.text)
        settings = dict(zip(self.free, self.x, strict=True))
        reader.apply_overrides(raw, paths.symmetric_settings(settings))
        return raw

    @cached_property
    def design(self) -> Design:
        """The design; raises `InputError` if it is invalid."""
        return reader.convert(self.document)

    @cached_property
    def plant(self) -> Plant:
        """The design, solved."""
        return Plant.of(self.design, self.level)

    @cached_property
    def changes(self) -> list[Matrices | None]:
        """Derivatives of the matrices; None for a parameter that cannot change alone."""
        return self.plant.changes(self.free)


_build = functools.lru_cache(maxsize=16)(Build)


@functools.lru_cache(maxsize=16)
def _evaluate(build: Build, quantities: tuple[Quantity, ...]) -> Array:
    """Values of quantities of a build, SI; NaN without a value."""
    return measured_values.evaluate([build.design], quantities, build.level)[0]


@functools.lru_cache(maxsize=4)
def _differentiate(build: Build, quantities: tuple[Quantity, ...]) -> Array:
    """Derivatives of quantities of a build by its free parameters (quantity, parameter)."""
    x = np.array(build.x)
    typical = np.where(x != 0, TYPICAL * np.abs(x), SMALL)
    step = measured_values.STEP * typical
    count = len(x)
    sides = np.concatenate([x - np.diag(step), x + np.diag(step)])
    designs = [_design_or_none(replace(build, x=tuple(row.tolist()))) for row in sides]
    values = measured_values.evaluate(designs, quantities, build.level)
    middle = _evaluate(build, quantities)
    return measured_values.differentiate(values[:count], values[count:], middle, step)


def _design_or_none(build: Build) -> Design | None:
    """The design of a build; None if it is invalid."""
    try:
        return build.design
    except InputError:
        return None


@functools.lru_cache(maxsize=3)
def _respond(
    build: Build, signals: readings.Signals, grids: tuple[bytes, ...], damping: bytes
) -> list[Responses]:
    outputs, inputs = signals
    return [
        build.plant.respond(np.frombuffer(grid), inputs, outputs, np.frombuffer(damping))
        for grid in grids
    ]


@dataclass(frozen=True)
class Experiment:
    """A design (TOML) on a model that supports derivatives, with measured modes and quantities.

    `free` are dotted paths of the free parameters, `start` their starting values (SI), `where` is
    the prefix of the key paths of the modes, and `file` that of the design, in errors. `rates` is
    a build whose derivatives of the matrices, and of quantities, stand for those of all builds (see
    `Problem.held`). `quantities` are what the `measured` ones mean in the design.
    """

    text: str
    level: str
    mode: list[Mode]
    free: tuple[str, ...]
    start: Array
    where: str
    file: str
    rates: Build | None = None
    measured: tuple[MeasuredQuantity, ...] = ()
    quantities: tuple[Quantity, ...] = ()

    @cached_property
    def nominal(self) -> Plant:
        """The design where the search starts; measurements refer to the labels of its modes."""
        return self.plant(self.start)

    @cached_property
    def labels(self) -> list[str]:
        """Labels of the nominal modes."""
        return self.nominal.modes.numbered_label

    def at(self, x: Array) -> Build:
        """Put the free parameters into the design."""
        return _build(self.text, self.level, self.free, tuple(x.tolist()))

    def plant(self, x: Array) -> Plant:
        """Solve the design with the free parameters x."""
        with attribute_faults_to(self.file):
            return self.at(x).plant

    def order(self, x: Array) -> Int[np.ndarray, " mode"]:
        """Mode of the plant at x for each nominal mode."""
        overlap = self.nominal.modes.shape @ self.plant(x).modal_forces.T
        return pair_by_overlap(overlap**2)

    def frequencies(self, x: Array) -> Float[np.ndarray, " mode"]:
        """Frequencies in the order of the nominal modes, Hz; NaN for an unstable mode."""
        return self.plant(x).modes.frequency[self.order(x)]

    def changes(self, x: Array) -> list[Matrices]:
        """Differentiate the matrices by the free parameters; 0 where one cannot change alone."""
        system = self.plant(x).system
        nothing = np.zeros((system.size, system.size))
        turn = np.zeros((len(system.body) + 1, 3, 3))
        still = Matrices(nothing, nothing, nothing, nothing, turn)
        return [change or still for change in (self.rates or self.at(x)).changes]

    @cached_property
    def allowed(self) -> Bool[np.ndarray, "measured mode"]:
        """Whether a measurement may be of a nominal mode, by its label or its directions."""
        modes = self.nominal.modes
        rows: list[list[bool]] = []
        taken: set[int] = set()
        for n, item in enumerate(self.mode, 1):
            if item.label is None:
                rows.append([item.dof is None or dof in item.dof for _, dof in modes.home])
                continue
            number = self._labelled(item.label, f"{self.where}mode.{n}.label", taken)
            taken.add(number)
            rows.append([mode == number for mode in range(len(modes.home))])
        return np.array(rows, dtype=bool).reshape(len(self.mode), len(modes.home))

    def _labelled(self, label: str, where: str, taken: set[int]) -> int:
        """Find the nominal mode of a label, or of a number from 1, that is not `taken`."""
        modes = self.nominal.modes
        place = parse_place(label, len(modes.home))
        found = modes.with_label(label) if place is None else [place]
        if not found:
            remedy = suggest(label, modes.numbered_label)
            raise InputError.of(where, "is the label of no mode", remedy, format_value(label))
        if len(found) != 1 or found[0] in taken:
            problem = "does not name exactly one mode, or names that of another measurement"
            remedy = f"list labels with pendsus modes --fidelity {self.level}"
            raise InputError([Fault(where, problem, remedy, format_value(label))])
        return found[0]

    def values(self, x: Array) -> Float[np.ndarray, " quantity"]:
        """Values of the measured quantities, SI; raises `InputError` if one has none."""
        if not self.quantities:
            return np.zeros(0)
        with attribute_faults_to(self.file):
            found = _evaluate(self.at(x), self.quantities)
        measured_values.demand_values(found, self.quantities, self.where)
        return found

    def value_slopes(self, x: Array) -> Float[np.ndarray, "quantity free"]:
        """Derivatives of the measured quantities by the free parameters."""
        if not self.quantities:
            return np.zeros((0, len(self.free)))
        with attribute_faults_to(self.file):
            return _differentiate(self.rates or self.at(x), self.quantities)

    def predict(self, x: Array) -> tuple[Array, Array]:
        """Frequencies of the measured modes, Hz, and their derivatives; 0 for an unstable mode."""
        modes = self.plant(x).modes
        places = self.order(x)[self.assign_modes(x)]
        rates = [
            derivatives.frequency_rates(modes, one.of_modes(modes))[places]
            for one in self.changes(x)
        ]
        slopes = np.array(rates).reshape(-1, len(places)).T
        return np.nan_to_num(modes.frequency[places]), np.nan_to_num(slopes)

    def assign_modes(self, x: Array) -> Int[np.ndarray, " measured"]:
        """Assign a mode to each measurement.

        Measurements without a label share the modes left by the others such that the sum of
        ln(measured / computed)^2 is smallest.
        """
        from scipy.optimize import linear_sum_assignment

        measured = np.array([item.frequency for item in self.mode]).reshape(-1, 1)
        frequency = self.frequencies(x)
        cost = np.log(measured / np.where(frequency > 0, frequency, np.nan)) ** 2
        cost[[item.label is not None for item in self.mode]] = 0.0
        cost = np.where(self.allowed & np.isfinite(cost), cost, FORBIDDEN)
        spare = max(len(cost) - len(frequency), 0)
        cost = np.pad(cost, ((0, 0), (0, spare)), constant_values=FORBIDDEN)
        rows, columns = linear_sum_assignment(cost)
        for n in np.flatnonzero(cost[rows, columns] == FORBIDDEN):
            directions = self.mode[n].dof
            where = f"{self.where}mode"
            if directions is None:
                problem = f"the design has only {len(frequency)} modes, fewer than were measured"
                raise InputError.of(where, problem, "remove measurements of other modes")
            problem = "no unassigned mode moves mainly in these degrees of freedom"
            remedy = f"list modes with pendsus modes --fidelity {self.level}"
            fault = Fault(f"{where}.{n + 1}.dof", problem, remedy, format_value(directions))
            raise InputError([fault])
        return columns


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
            return _respond(build, self.signals, tuple(grids), self.damping(z).tobytes())

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

    def data_rows(self, slope: Array) -> Float[np.ndarray, "row parameter"]:
        """Derivatives of the weighted data by the parameters, all other unknowns fitted to them.

        The columns of the other unknowns, with their priors, are projected out (Golub and Pereyra,
        SIAM J. Numer. Anal. 10, 413 (1973)).
        """
        p = self.count
        known = np.isfinite(self.unknowns.sigma)
        first = len(slope) - int(known.sum())
        rows = np.delete(slope, first + np.arange(known[:p].sum()), axis=0)
        own = rows[:, :p]
        others = rows[:, p:]
        basis = np.linalg.qr(others * self.unknowns.scale[p:])[0]
        return own - basis @ (basis.T @ own)

    def covariance(self, z: Array, slope: Array) -> Float[np.ndarray, "unknown unknown"]:
        """Compute (J^T J)^-1; infinite where not determined, NaN at a bound."""
        _, _, low, high, _, _, scale = self.unknowns
        size = np.maximum(np.abs(z), scale)  # a bound may be 0
        inner = (np.abs(z - low) > 1e-8 * size) & (np.abs(z - high) > 1e-8 * size)
        result = np.full((len(z), len(z)), np.nan)
        if not inner.any():
            return result
        scaled = slope[:, inner] * scale[inner]
        norm = np.sqrt((scaled**2).sum(0))
        norm[norm == 0] = 1.0
        _, singular, direction = np.linalg.svd(np.linalg.qr(scaled / norm, mode="r"))
        whole = np.zeros(inner.sum())
        whole[: len(singular)] = singular
        good = whole > UNDETERMINED * whole.max()
        inverse = (direction[good].T / whole[good] ** 2) @ direction[good]
        lost = (np.abs(direction[~good]) > 1e-6).any(0)
        inverse[lost, :] = inverse[:, lost] = 0.0
        inverse[lost, lost] = np.inf
        result[np.ix_(inner, inner)] = inverse * np.outer(*2 * [scale[inner] / norm])
        return result

    def minimise(
        self,
        start: Array,
        *,
        loss: str = "linear",
        steps: int = 200,
        tolerance: float = CONVERGED,
        held: bool = False,
    ) -> tuple[Array, float]:
        """Minimise chi^2 of the unknowns within their bounds; return it, too.

        If `held`, the derivatives of the matrices are those at the start.

        By bounded trust regions (Branch, Coleman and Li, SIAM J. Sci. Comput. 21, 1 (1999)), over
        the typical changes of the unknowns; parameters with positive bounds in their logarithms.
        """
        from scipy import optimize

        if not len(start):
            return start, self.chi_squared(start)
        if held:
            return self.held(start).minimise(start, loss=loss, steps=steps, tolerance=tolerance)
        _, first, low, high, _, _, scale = self.unknowns
        positive = (low > 0) & (first > 0)
        size = np.where(positive, scale / np.where(positive, first, 1.0), scale)

        def scaled(z: Array) -> Array:
            with np.errstate(divide="ignore", invalid="ignore"):
                return np.where(positive, np.log(z / first), z - first) / size

        def unscaled(u: Array) -> Array:
            move = u * size
            return np.where(positive, first * np.exp(np.where(positive, move, 0.0)), first + move)

        def residual(u: Array) -> Array:
            try:
                return self.residual(unscaled(u))
            except (InputError, np.linalg.LinAlgError):  # an invalid design: shorten the step
                return np.full(count, np.inf)

        def slope(u: Array) -> Array:
            z = unscaled(u)
            return self.jacobian(z) * np.where(positive, z * size, size)

        begin = np.clip(start, low, high)
        count = len(self.residual(begin))
        found = optimize.least_squares(
            residual, scaled(begin), jac=slope, loss=loss,  # pyright: ignore[reportArgumentType]
            bounds=(scaled(low), scaled(high)), max_nfev=steps,
            xtol=tolerance, ftol=tolerance, gtol=CONVERGED,
        )  # fmt: skip
        return unscaled(found.x), 2 * float(found.cost)


def stack_parts(rows: Array) -> Array:
    """Stack real parts over imaginary parts, to make complex equations real."""
    return np.concatenate([np.real(rows), np.imag(rows)])
