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

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

SPARE = 3
"""Builds per fitted number below which a fit is not made: its R^2 would be a matter of chance."""
ROUNDING = 1e-12
"""Scatter of a quantity over its size that is a rounding error."""


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
    known = np.isfinite(values)
    fits: dict[bytes, _Fit] = {}
    for n in range(quantities):
        own = known[:, n]
        if own.sum() < SPARE * (len(group) + 1):
            continue
        key = own.tobytes()
        if key not in fits:
            fits[key] = _Fit.of(deviations[own], group, count)
        y = values[own, n]
        if y.std() > ROUNDING * np.abs(y).max():
            share[n], error[n], r_squared[n] = fits[key].shares(y)
    return Shares(share, error, r_squared)


@dataclass(frozen=True)
class _Fit:
    """Deviations of builds in units of their scatter, ready for fits of quantities.

    Numbers that do not scatter have no influence. `solved` is x C^-1 of each build.
    """

    x: Float[np.ndarray, "build factor"]
    solved: Float[np.ndarray, "build factor"]
    members: Bool[np.ndarray, "group factor"]

    @staticmethod
    def of(deviations: Float[np.ndarray, "build factor"], group: np.ndarray, count: int) -> _Fit:
        apart = deviations - deviations.mean(0)
        scale = apart.std(0)
        varies = scale > 0
        x = apart[:, varies] / scale[varies]
        covariance = x.T @ x / len(x)
        solved = np.linalg.lstsq(covariance, x.T, rcond=None)[0].T
        return _Fit(x, solved, np.arange(count)[:, None] == group[varies])

    def shares(
        self, values: Float[np.ndarray, " build"]
    ) -> tuple[Float[np.ndarray, " group"], Float[np.ndarray, " group"], float]:
        """Compute the shares of one quantity, their standard errors, and R^2."""
        count, factors = self.x.shape
        y = values - values.mean()
        slope = self.solved.T @ y / count
        left = y - self.x @ slope
        variance = float((y**2).mean())
        freedom = (count - 1) / (count - 1 - factors)
        unexplained = float((left**2).mean()) * freedom
        share = np.zeros(len(self.members))
        error = np.zeros(len(self.members))
        moved = self.solved * left[:, None] * np.sqrt(freedom)  # influence of builds on slopes
        for n, member in enumerate(self.members):
            x = self.x[:, member]
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
