"""The problem of a fit: from unknowns to weighted residuals, with their derivatives.

Unknowns z are, in this order: the free parameters of the designs; gains, delays and mixing of
sensors and actuators; the logarithm of an added damping 1/Q of every mode in the measured band, as
losses in air are rarely known. Residuals, over their standard deviations, are measured modes; real
and imaginary parts of predicted less measured transfer functions; and priors.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from suspension_cli.analyses import readings
from suspension_cli.analyses.fit.experiment import Experiment
from suspension_cli.design import paths, reader
from suspension_cli.design.faults import suggest
from suspension_cli.design.measured import Free, Measured, Mode
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.measurements.transfer_function import GAIN, Channels
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array
from suspension_cli.studies import derivatives, parameters
from suspension_cli.studies.response_matrix import LOSSES, Plant, Responses

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact, Int

DAMPING = 1e-3
"""Prior median of the added damping 1/Q of a mode."""
DAMPING_SIGMA = 2.5
"""Standard deviation of its logarithm: a factor of 12 either way."""
STEP = 1e-4
"""Relative step of differences for parameters that change only frequency-dependent losses."""
TYPICAL = 0.1
"""Typical change of a parameter without prior, relative to its value."""
CONVERGED = 1e-9
"""Relative change of chi^2, unknowns and gradient at which a search ends."""

ABSOLUTE = {
    1e-3: ("d", "d_upper", "l"),
    0.3e-3: ("s", "s_upper", "s_lower"),
    0.5e-3: ("t1", "t2", "upper", "lower", "com_offset", "upper_offset", "lower_offset"),
}
"""Usual errors of careful building, m, of keys: prior standard deviations of default parameters."""
RELATIVE = {
    "mass": 0.002,
    "density": 0.005,
    "inertia": 0.02,
    "stiffness": 0.03,
    "uncoupled_frequency": 0.015,
    "thickness": 0.01,
    "youngs_modulus": 0.02,
    "k": 0.02,
}
"""The same of masses and bought materials, relative to the value."""


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

    Attributes
    ----------
    shared
        Whether a parameter belongs to an experiment.
    base
        Starting values of the parameters.
    channels, signals
        Sensors, actuators and measured functions of the one design, and its signals in them; none
        if only modes were measured.
    damped
        Nominal modes with an added damping.
    """

    experiment: list[Experiment]
    free: Sequence[Free]
    shared: Bool[np.ndarray, "parameter experiment"]
    base: Array
    channels: Channels = field(default_factory=Channels)
    signals: readings.Signals = ((), ())
    damped: Int[np.ndarray, " damped"] = field(default_factory=lambda: np.zeros(0, dtype=int))

    @property
    def count(self) -> int:
        """Number of free parameters of the designs."""
        return len(self.base)

    @property
    def parts(self) -> tuple[slice, slice, slice]:
        """Places of parameters, properties of channels, and dampings in z."""
        first, second = self.count, self.count + len(self.channels.nuisances)
        return slice(first), slice(first, second), slice(second, second + len(self.damped))

    @cached_property
    def unknowns(self) -> Unknowns:
        """Names, starting values, bounds, priors and typical changes."""
        inf, damping = np.inf, float(np.log(DAMPING))
        rows = []
        for start, one in zip(self.base, self.free, strict=True):
            low, high = one.lower, one.upper
            bounds = -inf if low is None else low, inf if high is None else high
            rows.append((one.name, start, *bounds, one.prior or 0.0, one.uncertainty or inf))
        for one in self.channels.nuisances:
            rows.append((one.name, 0.0, -0.95 if one.kind == GAIN else -inf, inf, 0.0, one.sigma))
        for mode in self.damped:
            limits = np.log(1e-9), 0.0
            rows.append((f"damping.{mode}", damping, *limits, damping, DAMPING_SIGMA))
        names = tuple(row[0] for row in rows)
        columns = np.array([row[1:] for row in rows], dtype=float).reshape(-1, 5).T
        start, low, high, prior, sigma = columns
        scale = np.where(np.isfinite(sigma), sigma, typical_change(start))
        return Unknowns(names, start, low, high, prior, sigma, scale)

    def of_modes(self, modes: list[Mode]) -> Problem:
        """Set up the problem of the one design with these measured modes instead."""
        one = replace(self.experiment[0], mode=modes)
        return Problem([one], self.free, self.shared, self.base)

    def restricted(self, names: list[str], values: dict[str, float]) -> Problem:
        """Set up the problem of the one design with other free parameters, without priors."""
        base = np.array([values[name] for name in names])
        one = replace(self.experiment[0], free=tuple(names), start=base, latest=[])
        free, shared = [Free(name=name) for name in names], np.ones((len(names), 1), dtype=bool)
        return replace(self, experiment=[one], free=free, shared=shared, base=base)

    def solve_responses(self, z: Array) -> list[Responses]:
        """Solve for the responses of all signals on each grid."""
        grids = [grid for grid, _ in self.channels.grids]
        x, one = z[self.parts[0]], self.experiment[0]
        return one.respond(x, self.signals, grids, self.damping(z)) if grids else []

    def residues(self, plant: Plant) -> Inexact[np.ndarray, "function mode"]:
        """Compute the residues of the measured functions (`readings.residues`)."""
        return readings.residues(self.channels, self.signals, plant.system, plant.modes)

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
        one, x = self.experiment[0], z[self.parts[0]]
        order, damping = one.order(x), np.exp(z[self.parts[2]])
        rows = [found.derivative(change) for change in one.changes(x)]
        rows += [
            size * found.damping_derivative(int(mode))
            for mode, size in zip(order[self.damped], damping, strict=True)
        ]
        return np.array(rows, dtype=complex).reshape(-1, *found.value.shape)

    def readings(self, z: Array) -> list[Complex[np.ndarray, " frequency"]]:
        """Predict the readings per drive of each measured function."""
        now = self.channels.with_values(z[self.parts[1]])
        solved = zip(self.solve_responses(z), now.grids, strict=True)
        return now.by_function([now.combine(one.value, grid) for one, (grid, _) in solved])

    def differentiate(self, z: Array) -> list[Complex[np.ndarray, "unknown frequency"]]:
        """Differentiate `readings`."""
        values, grids = z[self.parts[1]], []
        now = self.channels.with_values(values)
        for found, (grid, _) in zip(self.solve_responses(z), now.grids, strict=True):
            rows = now.combine(self.state_derivatives(found, z), grid)
            own = self.channels.differentiate(found.value, grid, values)
            grids.append(np.concatenate([rows[: self.count], own, rows[self.count :]]))
        result = now.by_function(grids)
        one = self.experiment[0]
        for n, name in enumerate(one.free if registry.by_name(one.level).bends_wires else ()):
            if set(name.split(".")) & {*LOSSES}:
                move = STEP * (abs(z[n]) or self.unknowns.scale[n]) * np.eye(len(z))[n]
                pairs = zip(self.readings(z + move), self.readings(z - move), strict=True)
                for rows, (above, below) in zip(result, pairs, strict=True):
                    rows[n] = (above - below) / (2 * move[n])
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
    def measured_modes(self) -> Float[np.ndarray, "2 measured"]:
        """Measured frequencies of modes and their standard deviations, Hz."""
        modes = [(one.frequency, one.uncertainty) for item in self.experiment for one in item.mode]
        return np.array(modes).reshape(-1, 2).T

    def residual(self, z: Array) -> Float[np.ndarray, " residual"]:
        """Weighted residuals of modes, functions and priors."""
        (measured, sigma), known = self.measured_modes, np.isfinite(self.unknowns.sigma)
        rows = [(self.predict_modes(z[self.parts[0]])[0] - measured) / sigma]
        for value, item in zip(self.readings(z), self.channels.function, strict=True):
            rows.append(stack_parts((value - item.value) / item.uncertainty))
        rows.append(((z - self.unknowns.prior) / self.unknowns.sigma)[known])
        return np.concatenate(rows)

    def chi_squared(self, z: Array) -> float:
        """Sum of the squares of the residuals."""
        return float(np.sum(self.residual(z) ** 2))

    def jacobian(self, z: Array) -> Float[np.ndarray, "residual unknown"]:
        """Differentiate `residual`."""
        slope, known = np.zeros((len(self.measured_modes[0]), len(z))), self.unknowns.sigma < np.inf
        slope[:, self.parts[0]] = self.predict_modes(z[self.parts[0]])[1]
        rows = [slope / self.measured_modes[1][:, None]]
        for change, item in zip(self.differentiate(z), self.channels.function, strict=True):
            rows.append(stack_parts((change / item.uncertainty).T))
        return np.concatenate([*rows, np.diag(1 / self.unknowns.sigma)[known]])

    def minimise(
        self, start: Array, *, loss: str = "linear", steps: int = 200, tolerance: float = CONVERGED
    ) -> tuple[Array, float]:
        """Minimise chi^2 of the unknowns within their bounds; return it, too.

        By bounded trust regions (Branch, Coleman and Li, SIAM J. Sci. Comput. 21, 1 (1999)), over
        the typical changes of the unknowns; parameters with positive bounds in their logarithms.
        """
        from scipy import optimize

        if not len(start):
            return start, self.chi_squared(start)
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


def typical_change(value: Array) -> Array:
    """Typical change of parameters without prior."""
    return np.where(value != 0, TYPICAL * np.abs(value), 1e-3)


def default_parameters(text: str, level: str = registry.STRING.name) -> list[Free]:
    """List parameters of a design that are uncertain in a build, with priors around its values.

    >>> [item.name for item in default_parameters(text)]  # doctest: +SKIP
    ['stage.test.body.mass', 'stage.test.body.inertia.1', ..., 'materials.steel302.youngs_modulus']
    """
    found = [item for item in parameters.every(text, level) if default_sigma(item.name, item.value)]
    around = derivatives.differentiate(reader.parse(text), found, level)
    return [
        Free(name=item.name, prior=item.value, uncertainty=default_sigma(item.name, item.value))
        for item, matters in zip(found, around.balanced & around.matters, strict=True)
        if matters
    ]


def default_sigma(name: str, value: float) -> float | None:
    """Prior standard deviation of a parameter, SI; None for one that is not free by default.

    >>> default_sigma("stage.test.wires.d", 0.002), default_sigma("stage.test.body.mass", 10.0)
    (0.001, 0.02)
    """
    keys = [key for key in name.split(".") if not key.isdigit()]
    if keys[0] not in ("stage", "perturbation", "materials"):
        return None
    lengths = [sigma for sigma, some in ABSOLUTE.items() if keys[-1] in some]
    return lengths[0] if lengths else RELATIVE.get(keys[-1], 0.0) * abs(value) or None


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
    _, _, low, high, *_ = Problem([], free, shared, start).unknowns
    for n in np.flatnonzero((start < low) | (start > high))[:1]:
        bounds = f"{low[n]:g} to {high[n]:g}"
        problem = f"the design's value {start[n]:g} lies outside the bounds {bounds}"
        remedy = "give a start between them, or widen them"
        raise InputError([Fault(f"parameter.{n + 1}", problem, remedy)])
    experiments = [
        Experiment(
            text, modes, tuple(item.name for item, here in zip(free, own, strict=True) if here),
            start[own], measured.where(n), file, level,
        )
        for n, (text, modes, own, file) in enumerate(
            zip(texts, measured.modes, shared.T, files, strict=True)
        )
    ]  # fmt: skip
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
    names, found, bad = measured.names, [], []
    for n, (item, own) in enumerate(zip(measured.parameter, shared, strict=True), 1):
        mine, where = np.flatnonzero(own), f"parameter.{n}.name"
        given = {known[e].get(item.name, item.prior) for e in mine}
        given = given if item.start is None else {item.start}
        problem, remedy = "", "give a start"
        if None in given:
            missing = next(e for e in mine if item.name not in known[e])
            problem = (
                f"the design{' of ' * bool(names[missing])}{names[missing]} gives no such number"
            )
            if any(item.name in known[e] for e in mine):
                remedy += ", or list only experiments whose designs give it"
            else:
                member = item.name.rpartition(".")[2].isdigit()  # of a list that is missing
                also = suggest(item.name, list(known[missing]))
                remedy = also if member else f"{remedy}; {also}"
        elif len(given) > 1:
            problem = "has different values in the designs that share it"
        if problem:
            bad.append(Fault(where, problem, remedy, format_value(item.name)))
        found.append(next(iter(given)))
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
            reader.convert(experiment.document(experiment.start))
        except InputError as error:
            numbers = zip(np.flatnonzero(own), experiment.free, experiment.start, strict=True)
            for (n, name, x), fault in itertools.product(numbers, error.faults):
                if fault.key in paths.twins(name) or (fault.value or "").startswith(f'"{name}='):
                    problem = f"{name}: {fault.problem}"
                    bad[Fault(f"parameter.{n + 1}", problem, fault.remedy, f"{x:g}")] = None
    if bad:
        raise InputError(list(bad))
