"""Numbers of a design learned from measured frequencies: least squares with exact derivatives.

Minimised is the sum of ((f - measured) / uncertainty)^2 over modes and ((p - prior) / uncertainty)^2 over numbers that were known before, within
bounds (trust region; Branch, Coleman and Li, SIAM J. Sci. Comput. 21, 1 (1999)).  The covariance is the inverse of J^T J at the end, J the weighted
derivatives; what the data alone can tell apart are the singular values of their part of J, for relative changes of the numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from suspension_cli.analysis import derivatives, modes, parameters, scalars, spectrum
from suspension_cli.analysis.parameters import twins
from suspension_cli.analysis.sensitivity import frequencies
from suspension_cli.design import reader
from suspension_cli.design.faults import suggestion
from suspension_cli.design.measured import Free, Measured
from suspension_cli.design.scene import Array
from suspension_cli.errors import Fault, InputError, shown
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.models import fidelity

ROUNDS = 8
"""Times that modes without a label are matched anew."""
CONVERGED = 1e-9
BLIND = 1e-10
"""Singular value, of the largest, below which the data say nothing of a combination."""


@dataclass(frozen=True)
class Fit:
    """What measured modes say of a design.

    Attributes
    ----------
    name : tuple of str
        Numbers learned, as dotted paths.
    start, value, sigma : (p,) arrays
        Before, after, and standard deviation (infinite where the data say nothing, NaN at a bound); SI.
    covariance : (p, p) array
    at_bound : (p,) bool array
    label : tuple of str
        Of the measured modes.
    measured, uncertainty, before, after : (k,) arrays
        Hz.
    chi_squared : float
        Of modes and priors.
    freedom : int
        Modes and priors less numbers.
    singular : (s,) array
        Of the modes' derivatives in units of their uncertainties, for relative changes of the numbers: 1/singular is the relative
        uncertainty of a combination.
    direction : (s, p) array
        The combinations, as relative changes.
    design : str
        The fitted design as TOML.
    """

    name: tuple[str, ...]
    start: Array
    value: Array
    sigma: Array
    covariance: Array
    at_bound: Any
    label: tuple[str, ...]
    measured: Array
    uncertainty: Array
    before: Array
    after: Array
    chi_squared: float
    freedom: int
    singular: Array
    direction: Array
    design: str

    @property
    def residual(self) -> Array:
        """After the fit, in units of the uncertainty, (k,)."""
        return (self.after - self.measured) / self.uncertainty


@dataclass
class _Problem:
    """Frequencies and their derivatives as functions of the numbers to be learned."""

    text: str
    free: list[Free]
    start: Array
    known: dict[bytes, tuple[Array, Array]] = field(default_factory=dict)

    @cached_property
    def drawn(self) -> LinearModel:
        """The model that the search starts from."""
        return fidelity.linear_model(reader.parse(self.design_text(self.start)), "string")

    @cached_property
    def names(self) -> modes.Modes:
        """Its modes, whose labels measurements bear."""
        return modes.solve(self.drawn)

    @cached_property
    def shape(self) -> Array:
        """Their shapes, by which they are followed."""
        return spectrum.of_one(self.drawn).shape[0]

    def design_text(self, x: Array) -> str:
        """The design with these numbers."""
        import tomllib

        raw = tomllib.loads(self.text)
        reader.apply_overrides(raw, tuple(f"{path}={float(value)!r}" for item, value in zip(self.free, x, strict=True) for path in twins(item.name)))
        return reader.dump(raw)

    def solved(self, x: Array) -> tuple[Array, Array]:
        """All frequencies (m,) in the order of the design as drawn, and their derivatives (m, p)."""
        key = np.asarray(x, dtype=float).tobytes()
        if key not in self.known:
            design = reader.parse(self.design_text(x))
            base, model = derivatives.prepared(design), fidelity.linear_model(design, "string")
            found, shape = modes.solve(model), spectrum.of_one(model).shape[0]
            order = spectrum.matched(self.shape, shape)[0]
            columns = []
            for item in self.free:
                change = derivatives.of(base, item.name)
                if change is None:
                    raise InputError([Fault(f"parameter {item.name}", "cannot change alone: the suspension would not balance", "fit another number")])
                columns.append(frequencies(found, base.linear, change)[order])
            self.known = {key: (found.frequency[order], np.stack(columns, axis=1))}
        return self.known[key]


def solve(text: str, measured: Measured) -> Fit:
    """Learn numbers of a design from measured modes.

    Parameters
    ----------
    text : str
        The design as TOML.
    measured : Measured

    Raises
    ------
    InputError
        If a number or a label is not the design's.
    """
    start = _start(text, measured.parameter)
    problem = _Problem(text, measured.parameter, start)
    low = np.array([-np.inf if item.lower is None else item.lower for item in measured.parameter])
    high = np.array([np.inf if item.upper is None else item.upper for item in measured.parameter])
    if not ((low <= start) & (start <= high)).all():
        n = int(np.flatnonzero(~((low <= start) & (start <= high)))[0])
        raise InputError([Fault(f"parameter.{n + 1}", f"the design's value {start[n]:g} lies outside the bounds", "give a start within them")])
    before, _ = problem.solved(start)
    value, places = start, _places(problem, start, measured)
    for _ in range(ROUNDS):
        value, again = _least_squares(problem, measured, places, value, (low, high))
        now = _places(problem, value, measured)
        if now == places or not again:
            break
        places = now
    return _summed_up(problem, measured, places, start, value, before[places], (low, high))


def _start(text: str, free: list[Free]) -> Array:
    known = {item.name: item.value for item in parameters.every(text)}
    found, bad = [], []
    for n, item in enumerate(free, 1):
        value = item.start if item.start is not None else known.get(item.name, item.prior)
        if value is None:
            remedy = suggestion(item.name, list(known)) + "; or give a start"
            bad.append(Fault(f"parameter.{n}.name", "is no number that the design gives", remedy, shown(item.name)))
        found.append(value)
    if bad:
        raise InputError(bad)
    return np.array(found, dtype=float)


def _places(problem: _Problem, x: Array, measured: Measured) -> list[int]:
    """Which mode each measurement is of: by its label, or the nearest frequencies that are left, all together."""
    from scipy.optimize import linear_sum_assignment

    given: dict[int, int] = {}
    for n, item in enumerate(measured.mode):
        if item.label is not None:
            found = scalars.parse([item.label], problem.names, (), f"mode.{n + 1}.label")
            numbers = [one.number for one in found if isinstance(one, scalars.Mode)]
            if len(numbers) != 1 or numbers[0] in given.values():
                raise InputError([Fault(f"mode.{n + 1}.label", "is not one mode, or was measured before", "see pendsus modes", shown(item.label))])
            given[n] = numbers[0]
    left = [n for n in range(len(measured.mode)) if n not in given]
    frequency, _ = problem.solved(x)
    open_modes = [m for m in range(len(frequency)) if m not in given.values() and frequency[m] > 0]
    if len(left) > len(open_modes):
        raise InputError([Fault("mode", f"the design has {len(frequency)} modes, fewer than were measured", "leave some out")])
    if left:
        apart = np.abs(np.log(np.array([measured.mode[n].frequency for n in left])[:, None] / frequency[open_modes])) ** 2
        rows, columns = linear_sum_assignment(apart)
        given |= {left[r]: open_modes[c] for r, c in zip(rows, columns, strict=True)}
    return [given[n] for n in range(len(measured.mode))]


def _least_squares(problem: _Problem, measured: Measured, places: list[int], value: Array, bounds: tuple[Array, Array]) -> tuple[Array, bool]:
    """The numbers that fit best; and whether modes may have to be matched anew."""
    from scipy.optimize import least_squares

    scale = np.array([abs(v) or item.uncertainty or 1.0 for v, item in zip(value, measured.parameter, strict=True)])
    positive = (bounds[0] > 0) & (value > 0)  # a stiffness, say, is looked for over decades

    def number(u: Array) -> Array:
        return scale * np.where(positive, np.exp(np.where(positive, u, 0.0)), u)

    count = len(_weighted(problem, measured, places, value)[0])

    def residual(u: Array) -> Array:
        try:
            return _weighted(problem, measured, places, number(u))[0]
        except InputError:  # no such design: the search takes a smaller step
            return np.full(count, np.inf)

    def jacobian(u: Array) -> Array:
        return _weighted(problem, measured, places, number(u))[1] * np.where(positive, number(u), scale)

    with np.errstate(divide="ignore", invalid="ignore"):
        begin, low, high = (np.where(positive, np.log(edge / scale), edge / scale) for edge in (value, *bounds))
    how: dict[str, Any] = {"x_scale": "jac", "xtol": CONVERGED, "ftol": CONVERGED, "gtol": CONVERGED, "max_nfev": 200}
    found: Any = least_squares(residual, np.clip(begin, low, high), jac=jacobian, bounds=(low, high), **how)  # pyright: ignore[reportArgumentType]
    return number(found.x), any(item.label is None for item in measured.mode)


def _weighted(problem: _Problem, measured: Measured, places: list[int], x: Array) -> tuple[Array, Array]:
    """Residuals and their derivatives in units of the uncertainties: modes, then priors."""
    frequency, slope = problem.solved(x)
    sigma = np.array([item.uncertainty for item in measured.mode])
    away = np.nan_to_num(frequency[places], nan=0.0) - np.array([item.frequency for item in measured.mode])
    rows, slopes = [away / sigma], [np.nan_to_num(slope[places]) / sigma[:, None]]
    for n, item in enumerate(measured.parameter):
        if item.prior is not None and item.uncertainty is not None:
            rows.append(np.array([(x[n] - item.prior) / item.uncertainty]))
            slopes.append(np.eye(len(x))[n : n + 1] / item.uncertainty)
    return np.concatenate(rows), np.concatenate(slopes)


def _summed_up(problem: _Problem, measured: Measured, places: list[int], start: Array, value: Array, before: Array, bounds: tuple[Array, Array]) -> Fit:
    count = len(measured.mode)
    residual, slope = _weighted(problem, measured, places, value)
    scale = np.where(value != 0, np.abs(value), 1.0)
    at_bound = np.zeros(len(value), dtype=bool)
    for bound in bounds:
        at_bound |= np.isfinite(bound) & (np.abs(value - np.where(np.isfinite(bound), bound, 0.0)) <= 1e-8 * scale)
    inner = ~at_bound
    covariance = np.full((len(value), len(value)), np.nan)
    covariance[np.ix_(inner, inner)] = _inverse(slope[:, inner] * scale[inner]) * np.outer(scale[inner], scale[inner])
    _, singular, direction = np.linalg.svd(slope[:count] * scale, full_matrices=False)
    labels = scalars.labels(problem.names)
    return Fit(
        name=tuple(item.name for item in measured.parameter),
        start=start,
        value=value,
        sigma=np.sqrt(np.diag(covariance)),
        covariance=covariance,
        at_bound=at_bound,
        label=tuple(labels[n] for n in places),
        measured=np.array([item.frequency for item in measured.mode]),
        uncertainty=np.array([item.uncertainty for item in measured.mode]),
        before=before,
        after=problem.solved(value)[0][places],
        chi_squared=float(residual @ residual),
        freedom=len(residual) - int(inner.sum()),
        singular=singular,
        direction=direction * np.where(direction[np.arange(len(direction)), np.abs(direction).argmax(1)] < 0, -1.0, 1.0)[:, None],
        design=problem.design_text(value),
    )


def _inverse(slope: Array) -> Array:
    """(J^T J)^-1; infinite on the diagonal for numbers that J does not tell."""
    if not slope.shape[1]:
        return np.zeros((0, 0))
    _, singular, direction = np.linalg.svd(slope, full_matrices=True)
    whole = np.zeros(slope.shape[1])
    whole[: len(singular)] = singular
    told = whole > BLIND * whole.max()
    result = (direction[told].T / whole[told] ** 2) @ direction[told]
    blind = (np.abs(direction[~told]) > 1e-6).any(0)
    result[np.ix_(blind, blind)] = np.where(np.eye(int(blind.sum())) > 0, np.inf, result[np.ix_(blind, blind)])
    return result
