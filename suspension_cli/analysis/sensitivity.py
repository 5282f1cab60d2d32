"""What a small change of each number of a design does to its modes, responses and couplings: first derivatives, exact in those of the matrices.

For a mode K v = lambda M v with v M v = 1: dlambda = v (dK - lambda dM) v (Rayleigh; it holds with massless coordinates, too).  Modes that share a
lambda are told apart only by the change: within their space, V (dK - lambda dM) V^T has the derivatives as eigenvalues and the modes that emerge as
eigenvectors (Lancaster, Numer. Math. 6, 377 (1964)).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analysis import differences, modes, parameters
from suspension_cli.analysis.derivatives import Linear
from suspension_cli.analysis.modes import DEGENERATE, Modes
from suspension_cli.analysis.parameters import Parameter
from suspension_cli.analysis.scalars import Mode, Ratio, Scalar
from suspension_cli.analysis.slope import Slope
from suspension_cli.analysis.spectrum import matched
from suspension_cli.design import reader
from suspension_cli.design.scene import Array
from suspension_cli.models import fidelity


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives of results with respect to a design's numbers.

    Attributes
    ----------
    parameter : tuple of str
        Dotted paths of the numbers that matter or cannot change alone.
    value : (p,) array
        SI.
    free : (p,) bool array
        Whether each can change by itself; with others the suspension would not balance as it is drawn.
    result, unit : tuple of str
        See `scalars`.
    nominal : (r,) array
    derivative : (p, r) array
        Result's unit over parameter's; NaN where there is none (an unstable or rigid mode, a number that cannot change alone).
        Where a size is 0 it can only grow: then by this much for a change of either sign.
    """

    parameter: tuple[str, ...]
    value: Array
    free: Any
    result: tuple[str, ...]
    unit: tuple[str, ...]
    nominal: Array
    derivative: Array

    @property
    def one_percent(self) -> Array:
        """What 1 % of each number moves each result by, (p, r): in % of the result; in its unit where the result is 0."""
        with np.errstate(invalid="ignore", divide="ignore"):
            change = self.derivative * np.abs(self.value)[:, None] / 100 * np.where(self.value < 0, -1.0, 1.0)[:, None]
            return np.where(self.nominal == 0, np.abs(change), 100 * change / np.where(self.nominal == 0, 1.0, self.nominal))


def solve(text: str, results: tuple[Scalar, ...], level: str = "string") -> Sensitivity:
    """Derivatives of results with respect to every number of a design.

    Parameters
    ----------
    text : str
        The design as TOML.
    results : tuple of Scalar
    level : str
        ``string``, whose derivatives are exact, or ``beam`` (`differences`).
    """
    design, known = reader.parse(text), parameters.every(text, level)
    model = fidelity.linear_model(design, level)
    found = modes.solve(replace(model, terms=()))
    at = [item.frequency for item in results if isinstance(item, Ratio)]
    base, changes = differences.changes(design, known, level, [2 * np.pi * frequency for frequency in at])
    asked: list[Mode | tuple[Slope, int]] = []
    for item in results:
        place = sum(not isinstance(ask, Mode) for ask in asked)
        asked.append((Slope.of(replace(base, linear=differences.at(base.linear, place)), model, item), place) if isinstance(item, Ratio) else item)
    kept: list[tuple[Parameter, bool, Array]] = []
    for item in known:
        change = changes[item.name]
        if change is None:
            kept.append((item, False, np.full(len(results), np.nan)))
        elif change.matters:
            moved = frequencies(found, change)
            row = [moved[ask.number] if isinstance(ask, Mode) else ask[0].of_size(differences.at(change, ask[1])) for ask in asked]
            kept.append((item, True, np.array(row)))
    nominal = [found.frequency[ask.number] if isinstance(ask, Mode) else ask[0].size for ask in asked]
    return Sensitivity(
        parameter=tuple(item.name for item, _, _ in kept),
        value=np.array([item.value for item, _, _ in kept]),
        free=np.array([free for _, free, _ in kept]),
        result=tuple(item.text for item in results),
        unit=tuple(item.unit for item in results),
        nominal=np.array(nominal),
        derivative=np.array([row for _, _, row in kept]).reshape(-1, len(results)),
    )


def squares(found: Modes, change: Linear) -> Array:
    """Derivatives (m,) of omega^2, (rad/s)^2 over the parameter's unit.

    Parameters
    ----------
    found : Modes
    change : Linear
        The derivative of the matrices.
    """
    squared, shape = found.omega_squared, found.shape
    pushed = shape @ change.stiffness[6:, 6:]
    dragged = shape @ change.mass[6:, 6:]
    result = ((pushed - squared[:, None] * dragged) * shape).sum(1)
    for group in _groups(squared):
        own = shape[group]
        matrix = own @ change.stiffness[6:, 6:] @ own.T - squared[group].mean() * (own @ change.mass[6:, 6:] @ own.T)
        values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
        result[group] = values[matched(np.eye(len(group)), vectors.T)[0]]
    return result


def _groups(squared: Array) -> list[Any]:
    """Places of modes that share their omega^2, for each such group."""
    close = np.diff(squared) <= DEGENERATE * np.abs(squared[1:])
    parts = np.split(np.arange(len(squared)), np.flatnonzero(~close) + 1)
    return [part for part in parts if len(part) > 1]


def frequencies(found: Modes, change: Linear) -> Array:
    """Derivatives (m,) of frequencies, Hz over the parameter's unit; NaN for rigid and unstable modes."""
    squared = squares(found, change)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(found.omega_squared > 0, squared / (8 * np.pi**2 * found.frequency), np.nan)
