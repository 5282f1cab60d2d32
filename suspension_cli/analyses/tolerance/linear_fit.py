"""Least-squares fits of the results of random builds, linear in the deviations of their numbers::

    fit = LinearFit.of(deviations)
    constant, slope = fit.coefficients(values)  # values are about constant + deviations @ slope

Shares of the variance (`variance_shares`) and control variates (`two_level`) follow from these.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

SPARE = 3
"""Builds per fitted number below which a fit is not made: it would be a matter of chance."""
ROUNDING = 1e-12
"""Scatter of a quantity over its size that is a rounding error."""


@dataclass(frozen=True)
class LinearFit:
    """Deviations of builds, ready for fits of any results of these builds.

    Attributes
    ----------
    mean, scale
        Mean of the deviations of each number, and their scatter.
    varies
        Numbers that scatter; others have no influence.
    x
        Deviations of those from the mean, in units of their scatter.
    solved
        Rows of x C^-1, with the covariance C of x.
    """

    mean: Float[np.ndarray, " factor"]
    scale: Float[np.ndarray, " factor"]
    varies: Bool[np.ndarray, " factor"]
    x: Float[np.ndarray, "build varying"]
    solved: Float[np.ndarray, "build varying"]

    @staticmethod
    def of(deviations: Float[np.ndarray, "build factor"]) -> LinearFit:
        """Prepare the fits of results of builds with these deviations."""
        mean = deviations.mean(0)
        apart = deviations - mean
        scale = apart.std(0)
        varies = scale > 0
        x = apart[:, varies] / scale[varies]
        covariance = x.T @ x / len(x)
        solved = np.linalg.lstsq(covariance, x.T, rcond=None)[0].T
        return LinearFit(mean, scale, varies, x, solved)

    def slopes(self, values: Float[np.ndarray, " build"]) -> Float[np.ndarray, " varying"]:
        """Slopes of results over `x`."""
        return self.solved.T @ (values - values.mean()) / len(values)

    def coefficients(
        self, values: Float[np.ndarray, " build"]
    ) -> tuple[float, Float[np.ndarray, " factor"]]:
        """Value of the fit without deviations, and its slopes over these.

        >>> x = np.array([[0.0], [1.0], [2.0]])
        >>> constant, slope = LinearFit.of(x).coefficients(np.array([1.0, 3.0, 5.0]))
        >>> round(constant, 9), slope.round(9)
        (1.0, array([2.]))
        """
        slope = np.zeros(len(self.mean))
        slope[self.varies] = self.slopes(values) / self.scale[self.varies]
        return float(values.mean() - self.mean @ slope), slope


def fits_of_columns(
    values: Float[np.ndarray, "build quantity"], deviations: Float[np.ndarray, "build factor"]
) -> Iterator[tuple[int, Bool[np.ndarray, " build"], LinearFit]]:
    """Prepare the fits of quantities: the number of each, the builds that have it, and its fit.

    Quantities that do not vary, or that too few builds have, are left out. Those of the same
    builds share a fit.
    """
    known = np.isfinite(values)
    fits: dict[bytes, LinearFit] = {}
    for n in range(values.shape[1]):
        own = known[:, n]
        y = values[own, n]
        if own.sum() < SPARE * (deviations.shape[1] + 1) or y.std() <= ROUNDING * np.abs(y).max():
            continue
        key = own.tobytes()
        if key not in fits:
            fits[key] = LinearFit.of(deviations[own])
        yield n, own, fits[key]
