"""Sobol indices: fractions of the variance of a result that groups of uncertain numbers cause."""

from __future__ import annotations

import warnings
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
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # means of nothing
        plain = values[:2].reshape(-1, values.shape[-1])
        variance, scale = np.nanvar(plain, axis=0), np.nanmax(np.abs(plain), axis=0, initial=0.0)
        # what rounding leaves is no variance
        variance = np.where(variance > (1e-12 * scale) ** 2, variance, np.nan)
        a, b, *mixed = values - np.nanmean(plain, axis=0)
        first, total = (
            np.array([np.nanmean(product(part), axis=0) for part in mixed]) / variance
            for product in (lambda part: b * (part - a), lambda part: (a - part) ** 2 / 2)
        )
    return first, total
