"""The one object of a fit: from unknowns to weighted residuals, with their Jacobian.

Unknowns z are, in this order: the free parameters of the designs; gains, delays and mixing of
sensors and actuators; the logarithm of an added damping 1/Q of every mode in the measured band, as
losses in air are rarely known; a relative change of omega^2 of modes where something may rub.
Residuals, over their standard deviations, are measured modes; real and imaginary parts of predicted
less measured transfer functions; and priors.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit.channels import GAIN, NO_CHANNELS, Channels, Nuisance
from suspension_cli.analyses.fit.experiment import Experiment
from suspension_cli.design import paths
from suspension_cli.design.faults import suggest
from suspension_cli.design.measured import Free, Measured
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.measurements.transfer_function import MeasuredResponse
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array
from suspension_cli.studies import parameters
from suspension_cli.studies.response_matrix import LOSSES, Responses

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

DAMPING = 1e-3
"""Prior median of the added damping 1/Q of a mode."""
DAMPING_SIGMA = 2.5
"""Standard deviation of its logarithm: a factor of 12 either way."""
STIFFENING_SIGMA = 0.1
"""Prior standard deviation of a relative change of omega^2 of a mode."""
BEYOND = 1.5
"""Factor by which the band of modes with added damping exceeds the measured one."""
STEP = 1e-4
"""Relative step of differences for parameters that change only frequency-dependent losses."""
TYPICAL = 0.1
"""Typical change of a parameter without prior, relative to its value."""
CONVERGED = 1e-9
"""Relative change of chi^2, unknowns and gradient at which a search ends."""
NOTHING = np.zeros(0, dtype=int)


@dataclass
class Problem:
    """Measured designs and the unknowns of a fit.

    Attributes
    ----------
    shared
        Whether a parameter belongs to an experiment.
    channels
        Sensors, actuators and measured functions of the one design; none if only modes were
        measured.
    damped, stiff
        Nominal modes with an added damping, and with a change of omega^2.
    """

    experiment: list[Experiment]
    free: Sequence[Free]
    shared: Bool[np.ndarray, "parameter experiment"]
    base: Array
    channels: Channels = NO_CHANNELS
    damped: Int[np.ndarray, " damped"] = field(default_factory=NOTHING.copy)
    stiff: Int[np.ndarray, " stiff"] = field(default_factory=NOTHING.copy)
    _solved: dict[bytes, list[Responses]] = field(default_factory=dict)

    def changed(self, **changes: object) -> Problem:
        """Replace channels or modes; keep the responses solved before."""
        return replace(self, **changes)

    @property
    def count(self) -> int:
        """Number of free parameters of the designs."""
        return len(self.base)

    @property
    def nuisances(self) -> tuple[Nuisance, ...]:
        """Unknown properties of sensors and actuators."""
        return self.channels.nuisances

    @cached_property
    def parts(self) -> tuple[slice, slice, slice, slice]:
        """Places of parameters, properties of channels, dampings and stiffenings in z."""
        sizes = (self.count, len(self.nuisances), len(self.damped), len(self.stiff))
        edges = [0, *itertools.accumulate(sizes)]
        first, second, third, fourth = (slice(a, b) for a, b in itertools.pairwise(edges))
        return first, second, third, fourth

    def join(self, parameter: Array, nuisance: float, damping: float, stiffening: float) -> Array:
        """Values of all unknowns from those of the parameters and one for each other kind."""
        sizes = [part.stop - part.start for part in self.parts[1:]]
        rest = np.repeat([nuisance, damping, stiffening], sizes)
        return np.concatenate([parameter, rest])

    def _given(self, name: str, default: float) -> Array:
        values = [getattr(item, name) for item in self.free]
        return np.array([default if value is None else value for value in values], dtype=float)

    @cached_property
    def start(self) -> Array:
        """Values where the search starts."""
        return self.join(self.base, 0.0, np.log(DAMPING), 0.0)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds."""
        low = self.join(self._given("lower", -np.inf), -np.inf, np.log(1e-9), -0.9)
        high = self.join(self._given("upper", np.inf), np.inf, 0.0, 1.0)
        gains = [item.kind == GAIN for item in self.nuisances]
        low[self.parts[1]][gains] = -0.95
        return low, high

    @cached_property
    def prior(self) -> tuple[Array, Array]:
        """Prior values and their standard deviations, infinite where there is none."""
        center = self.join(self._given("prior", 0.0), 0.0, np.log(DAMPING), 0.0)
        sigma = self.join(self._given("uncertainty", np.inf), 0.0, DAMPING_SIGMA, STIFFENING_SIGMA)
        sigma[self.parts[1]] = [item.sigma for item in self.nuisances]
        return center, sigma

    @cached_property
    def scale(self) -> Array:
        """Typical change of each unknown: standard deviation of its prior, else a tenth of it."""
        sigma = self.prior[1]
        return np.where(np.isfinite(sigma), sigma, typical_change(self.start))

    def solve_responses(self, z: Array) -> list[Responses]:
        """Solve for the responses of all signals on each grid; the last few are cached."""
        x, _, damped, stiff = (z[part] for part in self.parts)
        key = b"".join(part.tobytes() for part in (x, damped, self.stiff, stiff))
        if key not in self._solved:
            while len(self._solved) >= 3:
                del self._solved[next(iter(self._solved))]
            one = self.experiment[0]
            order = one.order(x)
            damping, stiffening = np.zeros((2, len(order)))
            damping[order[self.damped]], stiffening[order[self.stiff]] = np.exp(damped), stiff
            outputs, inputs = self.channels.signal
            self._solved[key] = [
                one.plant(x).respond(grid, inputs, outputs, damping, stiffening)
                for grid, _ in self.channels.grids
            ]
        return self._solved[key]

    def values(self, z: Array) -> dict[Nuisance, float]:
        """Values of the unknown properties of sensors and actuators."""
        return dict(zip(self.nuisances, z[self.parts[1]].tolist(), strict=True))

    def readings(self, z: Array) -> list[Complex[np.ndarray, " frequency"]]:
        """Predict the readings per drive of each measured function."""
        if not self.channels.function:
            return []
        now = self.channels.with_values(self.values(z))
        solved = zip(self.solve_responses(z), self.channels.grids, strict=True)
        return self._sorted([now.combine(one.value, grid) for one, (grid, _) in solved])

    def _sorted(self, grids: list[np.ndarray]) -> list[np.ndarray]:
        """Select the functions from readings (frequency sensor actuator ...) on each grid."""
        found: dict[int, np.ndarray] = {}
        for whole, (_, own) in zip(grids, self.channels.grids, strict=True):
            found |= {n: whole[(slice(None), *self.channels.pairs[n])] for n in own}
        return [found[n] for n in range(len(found))]

    def differentiate(self, z: Array) -> list[Complex[np.ndarray, "frequency unknown"]]:
        """Differentiate `readings`."""
        if not self.channels.function:
            return []
        one, x, grids = self.experiment[0], z[self.parts[0]], []
        now, values, order = self.channels.with_values(self.values(z)), self.values(z), one.order(x)
        for found, (grid, _) in zip(self.solve_responses(z), self.channels.grids, strict=True):
            inner = [found.derivative(change) for change in one.changes(x)]
            inner += [
                size * found.damping_derivative(int(mode))
                for mode, size in zip(order[self.damped], np.exp(z[self.parts[2]]), strict=True)
            ]
            inner += [found.stiffening_derivative(int(mode)) for mode in order[self.stiff]]
            columns = [now.combine(part, grid) for part in inner]
            columns[self.count : self.count] = [
                now.differentiate(found.value, grid, item, values[item]) for item in self.nuisances
            ]
            shape = (len(grid), len(now.names(0)), len(now.names(1)), 0)
            grids.append(np.stack(columns, -1) if columns else np.zeros(shape))
        result = self._sorted(grids)
        if registry.by_name(one.level).bends_wires:
            for n, name in enumerate(one.free):
                if not set(name.split(".")) & {*LOSSES}:
                    continue
                move = np.zeros(len(z))
                move[n] = STEP * (abs(z[n]) or self.scale[n])
                pairs = zip(self.readings(z + move), self.readings(z - move), strict=True)
                for rows, (above, below) in zip(result, pairs, strict=True):
                    rows[:, n] = (above - below) / (2 * move[n])
        return result

    def predict_modes(self, x: Array) -> tuple[Array, Array]:
        """Frequencies of the measured modes, Hz, and their derivatives; 0 for an unstable mode."""
        rows, slopes = [np.zeros(0)], [np.zeros((0, self.count))]
        for item, own in zip(self.experiment, self.shared.T, strict=True):
            if item.mode:
                places = item.assign_modes(x[own])
                rows.append(np.nan_to_num(item.frequencies(x[own])[places]))
                slopes.append(np.zeros((len(places), self.count)))
                slopes[-1][:, own] = item.slopes(x[own])[places]
        return np.concatenate(rows), np.concatenate(slopes)

    @cached_property
    def measured_modes(self) -> tuple[Array, Array]:
        """Measured frequencies of modes and their standard deviations, Hz."""
        frequency = np.concatenate([item.frequency for item in self.experiment])
        return frequency, np.concatenate([item.uncertainty for item in self.experiment])

    def prior_rows(self, z: Array) -> tuple[Array, Array]:
        """Weighted residuals of the priors, and their derivatives."""
        center, width = self.prior
        known = np.isfinite(width)
        return ((z - center) / width)[known], np.diag(1 / width)[known]

    def residual(self, z: Array, softness: float = 0.0) -> Float[np.ndarray, " residual"]:
        """Weighted residuals of modes, functions and priors.

        With a `softness`, those of a function are the logarithms of its magnitude over the measured
        one, with this relative uncertainty in addition: they know no signs, and grow only with the
        logarithm of the distance from a resonance, so a peak beside its place still attracts.
        """
        measured, sigma = self.measured_modes
        rows = [(self.predict_modes(z[self.parts[0]])[0] - measured) / sigma]
        for value, item in zip(self.readings(z), self.channels.function, strict=True):
            if softness:
                ratio = _level(value, item.uncertainty) - _level(item.value, item.uncertainty)
                rows.append(ratio / _soft_sigma(item, softness))
            else:
                rows.append(stack_parts((value - item.value) / item.uncertainty))
        return np.concatenate([*rows, self.prior_rows(z)[0]])

    def jacobian(self, z: Array, softness: float = 0.0) -> Float[np.ndarray, "residual unknown"]:
        """Differentiate `residual`."""
        slope = np.zeros((len(self.measured_modes[0]), len(z)))
        slope[:, self.parts[0]] = self.predict_modes(z[self.parts[0]])[1]
        rows = [slope / self.measured_modes[1][:, None]]
        functions = zip(
            self.differentiate(z), self.readings(z), self.channels.function, strict=True
        )
        for change, value, item in functions:
            if softness:
                weight = np.conj(value) / (np.abs(value) ** 2 + item.uncertainty**2)
                rows.append(
                    np.real(weight[:, None] * change) / _soft_sigma(item, softness)[:, None]
                )
            else:
                rows.append(stack_parts(change / item.uncertainty[:, None]))
        return np.concatenate([*rows, self.prior_rows(z)[1]])

    def minimise(
        self,
        start: Array,
        residual: Callable[[Array], Array],
        jacobian: Callable[[Array], Array],
        *,
        loss: str = "linear",
        steps: int = 200,
        tolerance: float = CONVERGED,
    ) -> tuple[Array, float]:
        """Minimise a sum of squares of the unknowns within their bounds; return it, too.

        `start` has all unknowns or the first of them. By bounded trust regions (Branch, Coleman and
        Li, SIAM J. Sci. Comput. 21, 1 (1999)), over the typical changes of the unknowns; parameters
        with positive bounds in their logarithms.
        """
        from scipy import optimize

        if not len(start):
            return start, float(np.sum(residual(start) ** 2))
        low, high, scale, first = (
            values[: len(start)] for values in (*self.bounds, self.scale, self.start)
        )
        positive = (low > 0) & (first > 0)
        size = np.where(positive, scale / np.where(positive, first, 1.0), scale)

        def scaled(z: Array) -> Array:
            with np.errstate(divide="ignore", invalid="ignore"):
                return np.where(positive, np.log(z / first), z - first) / size

        def unscaled(u: Array) -> Array:
            move = u * size
            return np.where(positive, first * np.exp(np.where(positive, move, 0.0)), first + move)

        def valid(u: Array) -> Array:
            try:
                found = residual(unscaled(u))
            except (InputError, np.linalg.LinAlgError):  # an invalid design: shorten the step
                return np.full(count, np.inf)
            return found if np.isfinite(found).all() else np.full(count, np.inf)

        def slope(u: Array) -> Array:
            z = unscaled(u)
            return jacobian(z) * np.where(positive, z * size, size)

        begin = np.clip(start, low, high)
        count = len(residual(begin))
        found = optimize.least_squares(
            valid, scaled(begin), jac=slope, loss=loss,  # pyright: ignore[reportArgumentType]
            bounds=(scaled(low), scaled(high)), max_nfev=steps,
            xtol=tolerance, ftol=tolerance, gtol=CONVERGED,
        )  # fmt: skip
        return unscaled(found.x), 2 * float(found.cost)


def _level(value: Array, sigma: Array) -> Array:
    """Logarithm of a magnitude, limited by the noise."""
    return 0.5 * np.log(np.abs(value) ** 2 + sigma**2)


def _soft_sigma(item: MeasuredResponse, softness: float) -> Array:
    return np.hypot(item.uncertainty / np.hypot(np.abs(item.value), item.uncertainty), softness)


def stack_parts(rows: Array) -> Array:
    """Stack real parts over imaginary parts, to make complex equations real."""
    return np.concatenate([np.real(rows), np.imag(rows)])


def typical_change(value: Array) -> Array:
    """Typical change of parameters without prior."""
    return np.where(value != 0, TYPICAL * np.abs(value), 1e-3)


def build(texts: Sequence[str], measured: Measured, files: Sequence[str], level: str) -> Problem:
    """Set up the problem of one or several measured designs, without transfer functions.

    Raises
    ------
    InputError
        If a design does not give a parameter, or a starting value lies outside its bounds.
    """
    free = measured.parameter
    rows = [measured.shares(n) for n in range(len(free))]
    shared = np.array(rows, dtype=bool).reshape(len(free), len(texts))
    start = _start(texts, measured, shared, level)
    for n, (item, value) in enumerate(zip(free, start, strict=True), 1):
        low = -np.inf if item.lower is None else item.lower
        high = np.inf if item.upper is None else item.upper
        if not low <= value <= high:
            problem = f"the design's value {value:g} lies outside the bounds {low:g} to {high:g}"
            remedy = "give a start between them, or widen them"
            raise InputError([Fault(f"parameter.{n}", problem, remedy)])
    given = np.array([item.uncertainty or np.inf for item in free])
    scale = np.where(np.isfinite(given), given, typical_change(start))
    experiments = [
        Experiment(
            text,
            modes,
            [item.name for item, here in zip(free, own, strict=True) if here],
            start[own],
            scale[own],
            measured.where(n),
            file,
            level,
        )
        for n, (text, modes, own, file) in enumerate(
            zip(texts, measured.modes, shared.T, files, strict=True)
        )
    ]
    _check_starts(experiments, shared)
    return Problem(experiments, free, shared, start)


def _start(
    texts: Sequence[str],
    measured: Measured,
    shared: Bool[np.ndarray, "parameter experiment"],
    level: str,
) -> Array:
    """Choose starting values: requested ones, else those of the designs, else the priors."""
    known = [{item.name: item.value for item in parameters.every(text, level)} for text in texts]
    found, bad = [], []
    for n, (item, own) in enumerate(zip(measured.parameter, shared, strict=True), 1):
        mine = [
            (table, name)
            for table, name, here in zip(known, measured.names, own, strict=True)
            if here
        ]
        given = {table.get(item.name, item.prior) for table, _ in mine}
        found.append(next(iter(given)) if item.start is None else item.start)
        problem, remedy = "", "give a start"
        if item.start is None and None in given:
            table, name = next((table, name) for table, name in mine if item.name not in table)
            problem = f"the design{f' of {name}' if name else ''} gives no such number"
            if any(item.name in other for other, _ in mine):
                remedy = "give a start, or list only experiments whose designs give it"
            else:
                member = item.name.rpartition(".")[2].isdigit()  # of a list that is missing
                remedy = f"{'' if member else 'give a start; '}{suggest(item.name, list(table))}"
        elif item.start is None and len(given) > 1:
            problem = "has different values in the designs that share it"
        if problem:
            bad.append(Fault(f"parameter.{n}.name", problem, remedy, format_value(item.name)))
    if bad:
        raise InputError(bad)
    return np.array(found, dtype=float)


def _check_starts(
    experiments: list[Experiment], shared: Bool[np.ndarray, "parameter experiment"]
) -> None:
    """Attribute errors in starting values to the file of measurements that gives them."""
    bad: dict[Fault, None] = {}
    for experiment, own in zip(experiments, shared.T, strict=True):
        try:
            experiment.design(experiment.start)
        except InputError as error:
            numbers = zip(np.flatnonzero(own), experiment.free, experiment.start, strict=True)
            for (n, name, x), fault in itertools.product(numbers, error.faults):
                if fault.key in paths.twins(name) or (fault.value or "").startswith(f'"{name}='):
                    problem = f"{name}: {fault.problem}"
                    bad[Fault(f"parameter.{n + 1}", problem, fault.remedy, f"{x:g}")] = None
    if bad:
        raise InputError(list(bad))
