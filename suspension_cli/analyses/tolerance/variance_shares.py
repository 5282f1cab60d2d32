"""Shares of the variance of quantities that tolerances cause, from a linear fit over builds::

    found = fit(values, deviations, groups=[0, 0, 1])
    found.share  # (quantity, group)

A quantity y of builds is fitted by a + b x, with the independent deviations x of its numbers. The
numbers of tolerance g cause the share

    S_g = b_g^T C_g b_g / V,

with the covariance C_g of their deviations and the variance V of y. What the fit leaves of the
variance, 1 - R^2, is due to curvature and to numbers that act together; where that is much, shares
do not tell the whole story.

Standard errors follow from the influence of each build on S_g (the infinitesimal jackknife; Efron,
The Jackknife, the Bootstrap and Other Resampling Plans, SIAM (1982), chapter 6), which needs
neither normal deviations nor an exact fit. With D the covariance of b_g, of the same origin, the
square of b_g is larger than that of the true slopes by tr(C_g D) in the mean, which is subtracted.
It scatters by the variance t = 2 tr(C_g D C_g D) even where the true slopes are 0, while the first
order, of the slopes as fitted, then has 2 t in the mean instead of 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.tolerance.linear_fit import LinearFit, fits_of_columns

if TYPE_CHECKING:
    from jaxtyping import Bool, Float


@dataclass(frozen=True)
class Shares:
    """Shares of the variance of quantities, from 0 to 1 but for their standard errors.

    NaN where a quantity does not vary, or of too few builds.
    """

    share: Float[np.ndarray, "quantity group"]
    error: Float[np.ndarray, "quantity group"]
    r_squared: Float[np.ndarray, " quantity"]


def fit(
    values: Float[np.ndarray, "build quantity"],
    deviations: Float[np.ndarray, "build factor"],
    groups: Sequence[int],
) -> Shares:
    """Fit quantities of builds; those that are not finite in a build are fitted to the others.

    `groups` has the number of the tolerance of each factor.

    >>> x = np.random.default_rng(1).normal(size=(1000, 2))
    >>> found = fit(x[:, :1] + 2 * x[:, 1:], x, [0, 1])
    >>> found.share.round(1), found.r_squared.round(6)
    (array([[0.2, 0.8]]), array([1.]))
    """
    group = np.asarray(groups, dtype=int)
    count = int(group.max(initial=-1)) + 1
    quantities = values.shape[1]
    share = np.full((quantities, count), np.nan)
    error = np.full((quantities, count), np.nan)
    r_squared = np.full(quantities, np.nan)
    members = np.arange(count)[:, None] == group
    for n, own, prepared in fits_of_columns(values, deviations):
        of_group = members[:, prepared.varies]
        share[n], error[n], r_squared[n] = _shares(prepared, of_group, values[own, n])
    return Shares(share, error, r_squared)


def _shares(
    prepared: LinearFit,
    members: Bool[np.ndarray, "group varying"],
    values: Float[np.ndarray, " build"],
) -> tuple[Float[np.ndarray, " group"], Float[np.ndarray, " group"], float]:
    """Compute the shares of one quantity, their standard errors, and R^2."""
    count, factors = prepared.x.shape
    y = values - values.mean()
    slope = prepared.slopes(values)
    left = y - prepared.x @ slope
    variance = float((y**2).mean())
    freedom = (count - 1) / (count - 1 - factors)
    unexplained = float((left**2).mean()) * freedom
    share = np.zeros(len(members))
    error = np.zeros(len(members))
    moved = prepared.solved * left[:, None] * np.sqrt(freedom)  # influence of builds on slopes
    for n, member in enumerate(members):
        x = prepared.x[:, member]
        b = slope[member]
        covariance = x.T @ x / count
        noise = covariance @ (moved[:, member].T @ moved[:, member]) / count**2
        caused = float(b @ covariance @ b)
        influence = 2 * moved[:, member] @ (covariance @ b)
        influence += (x @ b) ** 2 - caused - caused / variance * (y**2 - variance)
        share[n] = (caused - np.trace(noise)) / variance
        first_order = float((influence**2).mean()) / count
        second_order = 2 * float(np.trace(noise @ noise))
        scatter = max(first_order - second_order, second_order)
        error[n] = np.sqrt(scatter) / variance
    return share, error, 1 - unexplained / variance
