"""Least squares: the smallest chi^2 of a problem, and what its derivatives there say.

    z, chi_squared = minimise(problem, problem.unknowns.start)
    slope = problem.jacobian(z)
    covariance(problem, z, slope)

Uncertainties are those of the linear problem at the end, of which `slope` is the Jacobian J.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit.problem import Problem
from suspension_cli.errors import InputError
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Float

CONVERGED = 1e-9
"""Relative change of chi^2, unknowns and gradient at which a search ends."""
UNDETERMINED = 1e-10
"""Singular value relative to the largest, below which the data do not determine a combination."""


def minimise(
    problem: Problem,
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
        return start, problem.chi_squared(start)
    if held:
        return minimise(problem.held(start), start, loss=loss, steps=steps, tolerance=tolerance)
    _, first, low, high, _, _, scale = problem.unknowns
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
            return problem.residual(unscaled(u))
        except (InputError, np.linalg.LinAlgError):  # an invalid design: shorten the step
            return np.full(count, np.inf)

    def slope(u: Array) -> Array:
        z = unscaled(u)
        return problem.jacobian(z) * np.where(positive, z * size, size)

    begin = np.clip(start, low, high)
    count = len(problem.residual(begin))
    found = optimize.least_squares(
        residual, scaled(begin), jac=slope, loss=loss,  # pyright: ignore[reportArgumentType]
        bounds=(scaled(low), scaled(high)), max_nfev=steps,
        xtol=tolerance, ftol=tolerance, gtol=CONVERGED,
    )  # fmt: skip
    return unscaled(found.x), 2 * float(found.cost)


def covariance(problem: Problem, z: Array, slope: Array) -> Float[np.ndarray, "unknown unknown"]:
    """Compute (J^T J)^-1; infinite where not determined, NaN at a bound."""
    _, _, low, high, _, _, scale = problem.unknowns
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


def data_rows(problem: Problem, slope: Array) -> Float[np.ndarray, "row parameter"]:
    """Derivatives of the weighted data by the parameters, all other unknowns fitted to them.

    The columns of the other unknowns, with their priors, are projected out (Golub and Pereyra,
    SIAM J. Numer. Anal. 10, 413 (1973)).
    """
    p = problem.count
    known = np.isfinite(problem.unknowns.sigma)
    first = len(slope) - int(known.sum())
    rows = np.delete(slope, first + np.arange(known[:p].sum()), axis=0)
    own = rows[:, :p]
    others = rows[:, p:]
    basis = np.linalg.qr(others * problem.unknowns.scale[p:])[0]
    return own - basis @ (basis.T @ own)
