"""First derivatives of modes, responses and couplings with respect to the numbers of a design.

Given the derivatives of the matrices they are exact. For a mode K v = lambda M v with v M v = 1:

    dlambda = v (dK - lambda dM) v

(Rayleigh), also with massless coordinates. For modes V of one lambda, the derivatives are the
eigenvalues of V (dK - lambda dM) V^T, whose eigenvectors give the modes that split off (Lancaster,
Numer. Math. 6, 377 (1964)).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.optimise.mode_families import has_wire_mass, solve_modes
from suspension_cli.design import reader
from suspension_cli.linear.eigenmodes import DEGENERATE, Modes
from suspension_cli.linear.mode_pairing import pair_by_shape
from suspension_cli.linear.named_results import Mode, Ratio, Scalar
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array
from suspension_cli.studies import differences, parameters
from suspension_cli.studies.derivatives import Linear
from suspension_cli.studies.differences import DispersiveLinear
from suspension_cli.studies.natural_steps import natural_step
from suspension_cli.studies.parameters import Parameter
from suspension_cli.studies.response_derivatives import Slope

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

TOGETHER = 16
"""Numbers whose changes of matrices are in memory at once."""


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives of results with respect to a design's numbers.

    Attributes
    ----------
    parameter : tuple of str
        Dotted paths of the numbers that affect the matrices or cannot change alone.
    value : (p,) array
        Their values, SI.
    free : (p,) bool array
        Whether each can change alone, without unbalancing the nominal suspension.
    result, unit : tuple of str
        Names and units of the results, see `scalars`.
    nominal : (r,) array
        Results of the unchanged design.
    derivative : (p, r) array
        Unit of the result over that of the parameter; NaN where undefined (an unstable or rigid
        mode, a number that cannot change alone). A magnitude of 0 grows with either sign of the
        change.
    """

    parameter: tuple[str, ...]
    value: Float[np.ndarray, " parameter"]
    free: Bool[np.ndarray, " parameter"]
    result: tuple[str, ...]
    unit: tuple[str, ...]
    nominal: Float[np.ndarray, " result"]
    derivative: Float[np.ndarray, "parameter result"]

    @property
    def one_percent(self) -> Float[np.ndarray, "parameter result"]:
        """Change of each result by 1 % of each number, in % of it, or in its unit where it is 0."""
        return self._change(self.value / 100)

    @property
    def step_unit(self) -> tuple[str, ...]:
        """Step of each number: ``mm``, ``mrad`` or ``%``, see `studies.natural_steps`."""
        return tuple(unit for _, unit in self._steps)

    @property
    def step(self) -> Float[np.ndarray, " parameter"]:
        """Step of each number, SI."""
        return np.array([size for size, _ in self._steps])

    @property
    def per_step(self) -> Float[np.ndarray, "parameter result"]:
        """Change of each result by a step of each number, in the units of `one_percent`."""
        return self._change(self.step)

    @property
    def _steps(self) -> list[tuple[float, str]]:
        return [
            natural_step(name, float(value))
            for name, value in zip(self.parameter, self.value, strict=True)
        ]

    def _change(
        self, step: Float[np.ndarray, " parameter"]
    ) -> Float[np.ndarray, "parameter result"]:
        with np.errstate(invalid="ignore", divide="ignore"):
            change = self.derivative * step[:, None]
            return np.where(
                self.nominal == 0,
                np.abs(change),
                100 * change / np.where(self.nominal == 0, 1.0, self.nominal),
            )


@lru_cache(maxsize=2)
def solve_nominal(text: str, level: str) -> tuple[LinearSystem, Modes]:
    """Build the linear system of a design on a model, and solve for its modes."""
    model = registry.by_name(level).system(reader.parse(text))
    return model, solve_modes(model)


@lru_cache(maxsize=2)
def solve(text: str, results: tuple[Scalar, ...], level: str = registry.STRING.name) -> Sensitivity:
    """Differentiate results with respect to every number of a design.

    The last results are cached, as the choice of the model computes them, too.

    Parameters
    ----------
    text : str
        The design as TOML.
    results : tuple of Scalar
    level : str
        Name of a model that supports derivatives.

    Examples
    --------
    >>> from suspension_cli.linear.named_results import Mode
    >>> solve(text, (Mode("test pitch", 3),)).one_percent  # doctest: +SKIP
    """
    design, numbers = reader.parse(text), parameters.every(text, level)
    model, found = solve_nominal(text, level)
    ratios = [item for item in results if isinstance(item, Ratio)]
    omega = [2 * np.pi * item.frequency for item in ratios]
    if has_wire_mass(model):
        omega += np.sqrt(np.maximum(found.omega_squared, 0.0)).tolist()
    slopes: list[Slope] = []
    kept: list[tuple[Parameter, bool, Array]] = []
    for start in range(0, len(numbers), TOGETHER):
        some = numbers[start : start + TOGETHER]
        base, changes = differences.changes(design, some, level, omega)
        if not start:
            slopes = [
                Slope.of(replace(base, linear=differences.at(base.linear, n)), model, item)
                for n, item in enumerate(ratios)
            ]
        for item in some:
            change = changes[item.name]
            if change is None:
                kept.append((item, False, np.full(len(results), np.nan)))
            elif change.matters:
                rates = differentiate_frequencies(found, change, len(ratios))
                sizes = (slope.of_size(differences.at(change, n)) for n, slope in enumerate(slopes))
                row = [
                    rates[one.number] if isinstance(one, Mode) else next(sizes) for one in results
                ]
                kept.append((item, True, np.array(row)))
    sizes = (slope.size for slope in slopes)
    nominal = [
        found.frequency[one.number] if isinstance(one, Mode) else next(sizes) for one in results
    ]
    return Sensitivity(
        parameter=tuple(item.name for item, _, _ in kept),
        value=np.array([item.value for item, _, _ in kept]),
        free=np.array([free for _, free, _ in kept]),
        result=tuple(item.text for item in results),
        unit=tuple(item.unit for item in results),
        nominal=np.array(nominal),
        derivative=np.array([row for _, _, row in kept]).reshape(-1, len(results)),
    )


def differentiate_frequencies(
    found: Modes, change: Linear, first: int = 0
) -> Float[np.ndarray, " mode"]:
    """Differentiate the frequency of every mode, Hz per unit; NaN for rigid and unstable modes.

    Parameters
    ----------
    found : Modes
        Of unit modal mass, that of the wires included.
    change : Linear
        Derivative of the matrices.
    first : int
        Number of the first mode among the frequencies of a `DispersiveLinear`; the others follow.
    """
    squared, mass = found.omega_squared, change.mass[6:, 6:]

    def stiffness(number: int) -> Array:
        own = isinstance(change, DispersiveLinear) and len(change.dispersive) > first
        return (differences.at(change, first + number) if own else change).stiffness[6:, 6:]

    rates = np.empty(len(squared))
    for group in _degenerate(squared):
        own, common = found.shape[group], squared[group].mean()
        matrix = own @ (stiffness(int(group[0])) - common * mass) @ own.T
        values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
        rates[group] = values[pair_by_shape(np.eye(len(group)), vectors.T)[0]]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(squared > 0, rates / (8 * np.pi**2 * found.frequency), np.nan)


def _degenerate(squared: Float[np.ndarray, " mode"]) -> list[Int[np.ndarray, " group"]]:
    """Indices of modes of equal omega^2."""
    close = np.diff(squared) <= DEGENERATE * np.abs(squared[1:])
    return np.split(np.arange(len(squared)), np.flatnonzero(~close) + 1)
