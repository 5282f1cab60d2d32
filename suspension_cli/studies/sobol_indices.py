"""Sobol indices: fractions of the variance of a result that groups of uncertain numbers cause."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Float, Int


@dataclass(frozen=True)
class SobolIndices:
    """Sobol indices of results with respect to groups of numbers; NaN where a result does not vary.

    Attributes
    ----------
    first
        Fraction of the variance that each group causes alone.
    total
        Fraction that it causes alone or together with others.
    first_error, total_error
        Standard errors.
    """

    first: Float[np.ndarray, "group result"]
    total: Float[np.ndarray, "group result"]
    first_error: Float[np.ndarray, "group result"]
    total_error: Float[np.ndarray, "group result"]


def sobol_indices(
    values: Float[np.ndarray, "group+2 sample result"], replicate: Int[np.ndarray, " sample"]
) -> SobolIndices:
    """Estimate Sobol indices from the results by block, see `sample_points.SamplePoints`.

    V_i = <f(B) (f(A_B^i) - f(A))> (Saltelli et al., Comput. Phys. Commun. 181, 259 (2010), table 2
    b) and V_Ti = <(f(A) - f(A_B^i))^2>/2 (Jansen, Comput. Phys. Commun. 117, 35 (1999)), over the
    variance of f in A and B; f less its mean, which only reduces the scatter. Rows in which one of
    the three failed (NaN) are left out. Errors are from the scatter of the replicates.

    >>> a, b = np.random.default_rng(1).random((2, 4096, 1))
    >>> found = sobol_indices(np.stack([a, b, b]), np.arange(4096) // 512)
    >>> found.first.round(1), found.total.round(1)
    (array([[1.]]), array([[1.]]))
    """
    first, total = _estimate(values)
    parts = np.array(
        [_estimate(values[:, replicate == number]) for number in np.unique(replicate)]
    )  # replicate, first or total, group, result
    with np.errstate(all="ignore"):
        first_error, total_error = parts.std(0, ddof=1) / np.sqrt(len(parts))
    return SobolIndices(first, total, first_error, total_error)


def _estimate(
    values: Float[np.ndarray, "group+2 sample result"],
) -> tuple[Float[np.ndarray, "group result"], Float[np.ndarray, "group result"]]:
    """Estimate first-order and total indices."""
    plain = values[:2].reshape(-1, values.shape[-1])
    known = np.isfinite(plain)
    count = known.sum(0)
    with np.errstate(all="ignore"):
        mean = np.where(known, plain, 0.0).sum(0) / count
        scale = np.abs(np.where(known, plain, 0.0)).max(0, initial=0.0)
        variance = np.where(known, plain - mean, 0.0).__pow__(2).sum(0) / count
        # what rounding leaves is no variance
        variance = np.where(variance > (1e-12 * scale) ** 2, variance, np.nan)
        a, b, mixed = values[0] - mean, values[1] - mean, values[2:] - mean
        return (
            _mean(b * (mixed - a)) / variance,
            _mean((a - mixed) ** 2) / (2 * variance),
        )


def _mean(products: Float[np.ndarray, "group sample result"]) -> Float[np.ndarray, "group result"]:
    """Average over the rows in which nothing failed."""
    known = np.isfinite(products)
    return np.where(known, products, 0.0).sum(1) / known.sum(1)
