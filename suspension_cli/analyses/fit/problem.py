"""The problem of a fit: from unknowns to weighted residuals, with their derivatives.

Unknowns z are, in this order: the free parameters of the designs; gains, delays and mixing of
sensors and actuators; the logarithm of an added damping 1/Q of every mode in the measured band, as
losses in air are rarely known; a relative change of omega^2 of modes where something may rub.
Residuals, over their standard deviations, are measured modes; real and imaginary parts of predicted
less measured transfer functions; and priors.
"""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from suspension_cli.analyses.analysis import Document
from suspension_cli.analyses.fit.channels import GAIN, Channels
from suspension_cli.design import paths, reader
from suspension_cli.design.measured import Free, Mode
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value
from suspension_cli.linear import named_results
from suspension_cli.linear.mode_pairing import pair_by_overlap
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array
from suspension_cli.studies import derivatives
from suspension_cli.studies.response_matrix import LOSSES, Matrices, Plant, Responses

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

DAMPING = 1e-3
"""Prior median of the added damping 1/Q of a mode."""
DAMPING_SIGMA = 2.5
"""Standard deviation of its logarithm: a factor of 12 either way."""
STIFFENING_SIGMA = 0.1
"""Prior standard deviation of a relative change of omega^2 of a mode."""
STEP = 1e-4
"""Relative step of differences for parameters that change only frequency-dependent losses."""
TYPICAL = 0.1
"""Typical change of a parameter without prior, relative to its value."""
CONVERGED = 1e-9
"""Relative change of chi^2, unknowns and gradient at which a search ends."""
FORBIDDEN = 1e6
"""Cost of assigning a measurement to a mode that it cannot belong to; others cost the square of
ln(measured / computed)."""
KEPT = 12
"""Plants, and solved responses, that are kept."""
NEARBY = 0.5
"""Change of the parameters, over their typical changes, within which the derivatives of the
matrices are not computed again: they are smooth, and a search needs no more."""
NONE = np.zeros(0, dtype=int)
Made = TypeVar("Made")


@dataclass
class Experiment:
    """A design, its measured modes and its free parameters.

    Attributes
    ----------
    text
        The design as TOML.
    free, start, scale
        Dotted paths of the free parameters, their starting values and typical changes, SI.
    where
        Prefix of the key paths of the modes in errors.
    file
        File of the design, for errors.
    level
        Name of a model that supports derivatives.
    around
        Values of the parameters, and derivatives of the matrices there; empty if not computed.
    """

    text: str
    mode: list[Mode]
    free: list[str]
    start: Array
    scale: Array
    where: str
    file: str
    level: str
    _plants: dict[bytes, Plant] = field(default_factory=dict)
    around: list[tuple[Array, list[Matrices]]] = field(default_factory=list)

    @cached_property
    def nominal(self) -> Plant:
        """The design where the search starts; measurements refer to the labels of its modes."""
        return self.plant(self.start)

    @cached_property
    def labels(self) -> list[str]:
        """Labels of the nominal modes."""
        return named_results.labels(self.nominal.modes)

    @cached_property
    def measured(self) -> Float[np.ndarray, "2 measured"]:
        """Measured frequencies and their standard deviations, Hz."""
        return np.array([(one.frequency, one.uncertainty) for one in self.mode]).reshape(-1, 2).T

    def document(self, x: Array) -> Document:
        """Return the parsed TOML of the design with the free parameters x."""
        raw = tomllib.loads(self.text)
        values = {name: float(value) for name, value in zip(self.free, x, strict=True)}
        reader.apply_overrides(raw, paths.symmetric_settings(values))
        return raw

    def design(self, x: Array) -> Design:
        """Return the design with the free parameters x."""
        return reader.convert(self.document(x))

    def plant(self, x: Array) -> Plant:
        """Solve the design with the free parameters x."""

        def solve() -> Plant:
            with attribute_faults_to(self.file):
                return Plant.of(self.design(x), self.level)

        return _remember(self._plants, x.tobytes(), solve)

    def order(self, x: Array) -> Int[np.ndarray, " mode"]:
        """Mode of the plant at x for each nominal mode."""
        overlap = self.nominal.modes.shape @ self.plant(x).modal_forces.T
        return pair_by_overlap(overlap**2)

    def frequencies(self, x: Array) -> Float[np.ndarray, " mode"]:
        """Frequencies in the order of the nominal modes, Hz; NaN for an unstable mode."""
        return self.plant(x).modes.frequency[self.order(x)]

    def changes(self, x: Array, *, exactly: bool = False) -> list[Matrices]:
        """Differentiate the matrices by the free parameters at x, or near x unless `exactly`."""
        near = 0.0 if exactly else NEARBY
        if not self.around or (np.abs(x - self.around[0][0]) > near * self.scale).any():
            found = self.plant(x).changes(self.free)
            for name, one in zip(self.free, found, strict=True):
                if one is None:
                    problem = "a change of this number alone unbalances the suspension"
                    raise InputError([Fault(f"parameter {name}", problem, "fit another number")])
            self.around[:] = [(x.copy(), [one for one in found if one is not None])]
        return self.around[0][1]

    def slopes(self, x: Array) -> Float[np.ndarray, "mode parameter"]:
        """Differentiate `frequencies` by the free parameters; 0 for an unstable mode."""
        modes, order = self.plant(x).modes, self.order(x)
        rates = [
            derivatives.frequency_rates(modes, one.of_modes(modes))[order]
            for one in self.changes(x)
        ]
        return np.nan_to_num(np.array(rates).reshape(-1, len(order)).T)

    def assign_modes(self, x: Array) -> list[int]:
        """Assign a mode to each measurement.

        Measurements without a label share the modes left by the others such that the sum of
        ln(measured / computed)^2 is smallest.
        """
        from scipy.optimize import linear_sum_assignment

        assigned = dict(self.labelled)
        remaining = [n for n in range(len(self.mode)) if n not in assigned]
        if remaining:
            frequency = self.frequencies(x)
            left = np.setdiff1d(np.flatnonzero(frequency > 0), [*assigned.values()])
            cost = np.full((len(remaining), max(len(left), len(remaining))), FORBIDDEN)
            ratio = self.measured[0, remaining][:, None] / frequency[left]
            allowed = [[self._allows(n, mode) for mode in left] for n in remaining]
            cost[:, : len(left)] = np.where(allowed, np.log(ratio) ** 2, FORBIDDEN)
            for row, column in zip(*linear_sum_assignment(cost), strict=True):
                if cost[row, column] == FORBIDDEN:
                    raise InputError([self._unassigned(remaining[row], len(frequency))])
                assigned[remaining[row]] = int(left[column])
        return [assigned[n] for n in range(len(self.mode))]

    def _allows(self, n: int, mode: int) -> bool:
        """Whether a measurement may be of a nominal mode."""
        allowed = self.mode[n].dof
        return allowed is None or self.nominal.modes.home[mode][1] in allowed

    @cached_property
    def labelled(self) -> dict[int, int]:
        """Mode of each measurement that has a label."""
        assigned: dict[int, int] = {}
        for n, item in enumerate(self.mode):
            if item.label is not None:
                where = f"{self.where}mode.{n + 1}.label"
                found = named_results.parse([item.label], self.nominal.modes, (), where)
                numbers = [one.number for one in found if isinstance(one, named_results.Mode)]
                if len(numbers) != 1 or numbers[0] in assigned.values():
                    problem = "does not name exactly one mode, or names that of another measurement"
                    remedy = f"list labels with pendsus modes --fidelity {self.level}"
                    raise InputError([Fault(where, problem, remedy, format_value(item.label))])
                assigned[n] = numbers[0]
        return assigned

    def _unassigned(self, n: int, count: int) -> Fault:
        allowed = self.mode[n].dof
        if allowed is None:
            problem = f"the design has only {count} modes, fewer than were measured"
            return Fault(f"{self.where}mode", problem, "remove measurements of other modes")
        problem = "no unassigned mode moves mainly in these degrees of freedom"
        remedy = f"list modes with pendsus modes --fidelity {self.level}"
        return Fault(f"{self.where}mode.{n + 1}.dof", problem, remedy, format_value(allowed))


class Unknowns(NamedTuple):
    """Starting values, bounds, priors and typical changes of all unknowns.

    `sigma` is infinite where there is no prior; `scale` is that standard deviation, else a tenth of
    the value.
    """

    start: Array
    low: Array
    high: Array
    prior: Array
    sigma: Array
    scale: Array


@dataclass
class Problem:
    """Measured designs and the unknowns of a fit.

    Attributes
    ----------
    shared
        Whether a parameter belongs to an experiment.
    base
        Starting values of the parameters.
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
    channels: Channels = field(default_factory=Channels)
    damped: Int[np.ndarray, " damped"] = field(default_factory=NONE.copy)
    stiff: Int[np.ndarray, " stiff"] = field(default_factory=NONE.copy)
    _solved: dict[bytes, list[Responses]] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Number of free parameters of the designs."""
        return len(self.base)

    @cached_property
    def parts(self) -> tuple[slice, slice, slice, slice]:
        """Places of parameters, properties of channels, dampings and stiffenings in z."""
        sizes = (self.count, len(self.channels.nuisances), len(self.damped), len(self.stiff))
        ends = [*itertools.accumulate(sizes)]
        first, second, third, fourth = map(slice, [0, *ends], ends)
        return first, second, third, fourth

    @cached_property
    def unknowns(self) -> Unknowns:
        """Starting values, bounds, priors and typical changes."""
        inf = np.inf
        rows = [
            (start, *(default if value is None else value for value, default in given))
            for start, one in zip(self.base, self.free, strict=True)
            for given in [
                ((one.lower, -inf), (one.upper, inf), (one.prior, 0.0), (one.uncertainty, inf))
            ]
        ]
        rows += [
            (0.0, -0.95 if one.kind == GAIN else -inf, inf, 0.0, one.sigma)
            for one in self.channels.nuisances
        ]
        damping = np.log(DAMPING)
        rows += [(damping, np.log(1e-9), 0.0, damping, DAMPING_SIGMA)] * len(self.damped)
        rows += [(0.0, -0.9, 1.0, 0.0, STIFFENING_SIGMA)] * len(self.stiff)
        start, low, high, prior, sigma = np.array(rows, dtype=float).reshape(-1, 5).T
        scale = np.where(np.isfinite(sigma), sigma, typical_change(start))
        return Unknowns(start, low, high, prior, sigma, scale)

    def of_modes(self, modes: list[Mode]) -> Problem:
        """Set up the problem of the one design with these measured modes instead."""
        one = replace(self.experiment[0], mode=modes)
        return Problem([one], self.free, self.shared, self.base)

    def restricted(self, names: list[str], values: dict[str, float]) -> Problem:
        """Set up the problem of the one design with other free parameters, without priors."""
        base = np.array([values[name] for name in names])
        one = replace(
            self.experiment[0], free=names, start=base, scale=typical_change(base), _plants={},
            around=[],
        )  # fmt: skip
        free, shared = [Free(name=name) for name in names], np.ones((len(names), 1), dtype=bool)
        return replace(self, experiment=[one], free=free, shared=shared, base=base, _solved={})

    def added(self, z: Array) -> tuple[Array, Array]:
        """Added damping and change of omega^2 of each mode of the plant."""
        order = self.experiment[0].order(z[self.parts[0]])
        damping, stiffening = np.zeros((2, len(order)))
        damping[order[self.damped]] = np.exp(z[self.parts[2]])
        stiffening[order[self.stiff]] = z[self.parts[3]]
        return damping, stiffening

    def solve_responses(self, z: Array) -> list[Responses]:
        """Solve for the responses of all signals on each grid."""
        x, _, damped, stiff = (z[part] for part in self.parts)

        def solve() -> list[Responses]:
            outputs, inputs = self.channels.signal
            plant, added = self.experiment[0].plant(x), self.added(z)
            return [plant.respond(grid, inputs, outputs, *added) for grid, _ in self.channels.grids]

        key = b"".join(part.tobytes() for part in (x, damped, self.stiff, stiff))
        return _remember(self._solved, key, solve, 3)

    def state_derivatives(
        self, found: Responses, z: Array
    ) -> Complex[np.ndarray, "unknown frequency output input"]:
        """Differentiate responses by parameters, dampings and stiffenings."""
        one, x = self.experiment[0], z[self.parts[0]]
        order, damping = one.order(x), np.exp(z[self.parts[2]])
        rows = [found.derivative(change) for change in one.changes(x)]
        rows += [
            size * found.damping_derivative(int(mode))
            for mode, size in zip(order[self.damped], damping, strict=True)
        ]
        rows += [found.stiffening_derivative(int(mode)) for mode in order[self.stiff]]
        return np.array(rows, dtype=complex).reshape(-1, *found.value.shape)

    def readings(self, z: Array) -> list[Complex[np.ndarray, " frequency"]]:
        """Predict the readings per drive of each measured function."""
        now = self.channels.with_values(z[self.parts[1]])
        solved = zip(self.solve_responses(z), now.grids, strict=True) if now.function else ()
        return self._by_function([now.combine(one.value, grid) for one, (grid, _) in solved])

    def differentiate(self, z: Array) -> list[Complex[np.ndarray, "unknown frequency"]]:
        """Differentiate `readings`."""
        if not self.channels.function:
            return []
        values, grids = z[self.parts[1]], []
        now = self.channels.with_values(values)
        for found, (grid, _) in zip(self.solve_responses(z), now.grids, strict=True):
            rows = now.combine(self.state_derivatives(found, z), grid)
            own = self.channels.differentiate(found.value, grid, values)
            grids.append(np.concatenate([rows[: self.count], own, rows[self.count :]]))
        result = self._by_function(grids)
        one = self.experiment[0]
        for n, name in enumerate(one.free if registry.by_name(one.level).bends_wires else ()):
            if set(name.split(".")) & {*LOSSES}:
                move = STEP * (abs(z[n]) or self.unknowns.scale[n]) * np.eye(len(z))[n]
                pairs = zip(self.readings(z + move), self.readings(z - move), strict=True)
                for rows, (above, below) in zip(result, pairs, strict=True):
                    rows[n] = (above - below) / (2 * move[n])
        return result

    def _by_function(self, grids: list[np.ndarray]) -> list[np.ndarray]:
        """Select the functions from readings (... frequency sensor actuator) on each grid."""
        found: dict[int, np.ndarray] = {}
        for whole, (_, own) in zip(grids, self.channels.grids, strict=True):
            found |= {n: whole[(..., *self.channels.pairs[n])] for n in own}
        return [found[n] for n in range(len(found))]

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
        return np.concatenate([item.measured for item in self.experiment], axis=1)

    def residual(self, z: Array) -> Float[np.ndarray, " residual"]:
        """Weighted residuals of modes, functions and priors."""
        (measured, sigma), known = self.measured_modes, np.isfinite(self.unknowns.sigma)
        rows = [(self.predict_modes(z[self.parts[0]])[0] - measured) / sigma]
        for value, item in zip(self.readings(z), self.channels.function, strict=True):
            rows.append(stack_parts((value - item.value) / item.uncertainty))
        rows.append(((z - self.unknowns.prior) / self.unknowns.sigma)[known])
        return np.concatenate(rows)

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
            return start, float(np.sum(self.residual(start) ** 2))
        first, low, high, _, _, scale = self.unknowns
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
                found = self.residual(unscaled(u))
            except (InputError, np.linalg.LinAlgError):  # an invalid design: shorten the step
                return np.full(count, np.inf)
            return found if np.isfinite(found).all() else np.full(count, np.inf)

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


def _remember(
    memory: dict[bytes, Made], key: bytes, make: Callable[[], Made], most: int = KEPT
) -> Made:
    """Return what was made for a key before, or make it; forget the oldest of more than `most`."""
    if key not in memory:
        while len(memory) >= most:
            del memory[next(iter(memory))]
        memory[key] = make()
    return memory[key]


def stack_parts(rows: Array) -> Array:
    """Stack real parts over imaginary parts, to make complex equations real."""
    return np.concatenate([np.real(rows), np.imag(rows)])


def typical_change(value: Array) -> Array:
    """Typical change of parameters without prior."""
    return np.where(value != 0, TYPICAL * np.abs(value), 1e-3)
