"""Maps of a coupling from few solutions, as wide as resonances and poles of the ratio allow."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.interpolate import RectBivariateSpline

from bench.sweeps import TRIPLE, sweep
from suspension_cli.analyses.xcouple.imperfect_builds import ImperfectBuilds
from suspension_cli.studies.interpolated import interpolated
from suspension_cli.studies.job import Axis
from tools.chebyshev_grid import surface_of
from tools.stability.row import SHIPPED, Array, Row, relative

WIDTH = np.array([0.01, 0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6])
"""Half ranges of the stiffness of a wire, relative."""
OFFSET = 2e-3
"""Half range of the place of its end, m."""
COMPARED = 50
INTERVALS = 20
"""Between the points of each axis that other methods solve: 441 in all."""


def _map(width: float) -> ImperfectBuilds:
    axes = (
        Axis("k", tuple(np.linspace(1 - width, 1 + width, 101))),
        Axis("offset", tuple(np.linspace(-OFFSET, OFFSET, 61))),
    )
    return replace(sweep(TRIPLE), axes=axes)


def _values(job: ImperfectBuilds, number: Any) -> tuple[Array, Array]:
    """Stiffness and offset of points."""
    k, offset = (np.array(axis.values) for axis in job.axes)
    rows, columns = np.unravel_index(number, job.shape)
    return k[rows], offset[columns]


def _polynomial(job: ImperfectBuilds, k: Array, offset: Array) -> Array:
    """The ratio itself, as a polynomial through Chebyshev points."""

    def compute(values: Any) -> Array:
        return job.compute_at(values)["ratio"]

    surface = surface_of(job.axes, compute, INTERVALS)
    return surface.at(np.stack([k, offset], axis=1))[:, 0]


def _spline(job: ImperfectBuilds, k: Array, offset: Array) -> Array:
    """The ratio as a cubic spline through an even grid."""
    across = np.linspace(job.axes[0].values[0], job.axes[0].values[-1], INTERVALS + 1)
    up = np.linspace(-OFFSET, OFFSET, INTERVALS + 1)
    grid = dict(zip(("k", "offset"), (one.ravel() for one in np.meshgrid(across, up)), strict=True))
    ratio = job.compute_at(grid)["ratio"].real.reshape(len(up), len(across))
    return RectBivariateSpline(up, across, ratio).ev(offset, k)


def compute(widths: Any = WIDTH) -> Row:
    """Compute errors of maps of horizontal over vertical motion at 50 Hz."""
    error: dict[str, list[float]] = {}
    for width in widths:
        job = _map(float(width))
        number = np.random.default_rng(1).integers(job.count, size=COMPARED)
        k, offset = _values(job, number)
        exact = job.compute_at({"k": k, "offset": offset})["ratio"][:, 0]
        map_of_few = interpolated(job)
        whole = (job if map_of_few is None else map_of_few).compute(0, job.count)["ratio"][:, 0]
        found = {
            SHIPPED: whole[number],
            "polynomial in the ratio": _polynomial(job, k, offset),
            "spline of the ratio": _spline(job, k, offset),
        }
        for name, values in found.items():
            error.setdefault(name, []).append(float(relative(values, exact).max()))
    return Row(
        title="Maps from few solutions",
        driver="half range of the stiffness of a wire",
        quantity="longitudinal to vertical at 50 Hz, triple pendulum",
        value=np.asarray(widths, dtype=float),
        error={name: np.array(one) for name, one in error.items()},
        finding=(
            "Where a mode crosses the frequency, the ratio has poles, which no polynomial"
            " follows. The program interpolates both motions times the determinant of the dynamic"
            " stiffness."
        ),
        limit=(
            "none found: where the comparison is off by more than 10⁻⁶, or points fail, it solves"
            " every point"
        ),
    )
