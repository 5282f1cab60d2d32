"""Matrices, uncertainties and couplings at the smallest chi^2 (see `matrix_fit`)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit.matrix_problem import MatrixProblem
from suspension_cli.analyses.fit.osem_data import OsemData
from suspension_cli.analyses.fit.osem_matrices import OsemFit
from suspension_cli.analyses.fit.result import is_unlikely
from suspension_cli.analyses.fit.stage_responses import modes_in_band
from suspension_cli.errors import InputError
from suspension_cli.scene.arrays import Array
from suspension_cli.studies.response_matrix import Plant

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

UNDETERMINED = 0.3
"""Standard deviation of an element over the size of its row from which there is no result."""
STEP = 1e-6
"""Step of derivatives of S and D by scaled elements of A and B."""


def central_differences(function: Callable[[Array], Array], at: Array) -> Array:
    """Differentiate a vector (first axis) by unknowns of the order of 1 (second axis)."""
    moves = STEP * np.eye(len(at))
    return np.array([(function(at + one) - function(at - one)) / (2 * STEP) for one in moves]).T


@dataclass(frozen=True)
class MatrixSolution:
    """Unknowns at the smallest chi^2, and what follows from them."""

    problem: MatrixProblem
    plant: Plant
    z: Array

    @cached_property
    def chi_squared(self) -> float:
        """Sum of the squares of the residuals of data and priors."""
        return float(np.sum(self.problem.residual(self.z, self.problem.data.sigma) ** 2))

    @cached_property
    def slope(self) -> Float[np.ndarray, "residual unknown"]:
        """Derivatives of the residuals."""
        return self.problem.jacobian(self.z, self.problem.data.sigma)

    @property
    def freedom(self) -> int:
        """Number of data and priors less that of unknowns."""
        return len(self.slope) - len(self.z)

    @cached_property
    def scale(self) -> float:
        """Factor on uncertainties in a misfit: the root of chi^2 per degree of freedom."""
        if not is_unlikely(self.chi_squared, len(self.slope), len(self.z)):
            return 1.0
        return float(np.sqrt(self.chi_squared / self.freedom))

    @cached_property
    def covariance(self) -> Float[np.ndarray, "unknown unknown"]:
        """(J^T J)^-1, larger in a misfit; combinations without any weight are left out."""
        _, singular, direction = np.linalg.svd(self.slope, full_matrices=False)
        floor = np.finfo(float).eps * len(self.z) * singular.max()
        rows = direction / np.maximum(singular, floor)[:, None]
        return self.scale**2 * rows.T @ rows

    @property
    def frequency_sigma(self) -> Float[np.ndarray, " mode"]:
        """Standard deviations of the frequencies of modes, Hz."""
        own = self.problem.parts[3]
        slopes = central_differences(self.problem.responses.frequencies, self.z[own])
        return np.sqrt(np.einsum("mi,ij,mj->m", slopes, self.covariance[own, own], slopes))

    @cached_property
    def by_unknowns(self) -> Float[np.ndarray, "element unknown"]:
        """Derivatives of the elements of S and D by the unknowns."""
        return central_differences(self.problem.elements, self.z)

    @cached_property
    def of_elements(self) -> Float[np.ndarray, "element element"]:
        """Covariance of the elements of S, row by row, then of D."""
        return self.by_unknowns @ self.covariance @ self.by_unknowns.T

    def sigmas(self) -> tuple[Float[np.ndarray, "motion sensor"], Float[np.ndarray, "coil motion"]]:
        """Standard deviations of S and D."""
        sensing, driving = self.problem.inverses(self.z)
        every = np.sqrt(np.clip(np.diag(self.of_elements), 0.0, None))
        return every[: sensing.size].reshape(sensing.shape), every[sensing.size :].reshape(
            driving.shape
        )

    def demand_determined(self) -> None:
        """Raise `InputError` if the data do not determine an element of S or D."""
        motion = self.problem.motion
        nominal = self.problem.nominal_sensing, self.problem.nominal_driving.T
        found = self.problem.inverses(self.z)
        sigma = self.sigmas()
        worst = []
        for size, value, error in zip(
            nominal, (found[0], found[1].T), (sigma[0], sigma[1].T), strict=True
        ):
            norm = np.maximum(np.linalg.norm(size, axis=1), np.linalg.norm(value, axis=1))
            worst.append(error.max(axis=1) / norm)
        relative = np.maximum(*worst)
        n = int(relative.argmax())
        if relative[n] <= UNDETERMINED:
            return
        others = np.argsort(-relative)[: int((relative > UNDETERMINED).sum())]
        names = " and ".join(motion[k] for k in sorted(others.tolist()))
        known = f"an element is known to {100 * relative[n]:.0f} % only"
        if not np.isfinite(relative[n]) or relative[n] > 10:
            known = "an element is not known at all"
        what = "apart from each other" if len(others) > 1 else "from noise"
        problem = f"these data do not tell {names} of {self.problem.data.stage} {what}: {known}"
        remedy = (
            "fit the design to its modes first, or drive more strongly, average longer, or measure"
            " in a wider band"
        )
        raise InputError.of("transfer_function", problem, remedy)

    @cached_property
    def matrices(self) -> OsemFit:
        """The record of the matrices."""
        problem = self.problem
        data = problem.data
        z = self.z
        sensing, driving = problem.inverses(z)
        sensing_sigma, driving_sigma = self.sigmas()
        a, b = problem.matrices(z)
        sigma = np.sqrt(np.diag(self.covariance))
        modes = modes_in_band(self.plant, data.frequency)
        nominal = self.plant.modes.frequency[modes]
        per_delay = 1 / problem.responses.omega.max()
        given = replace(problem, sign=np.ones(len(data.sensors))).nominal_sensing
        before, _ = _couplings(given, problem.nominal_driving, data)
        after, noise = _couplings(sensing, driving, data)
        own = np.ix_(problem.resolved, problem.resolved)
        stage = problem.changed(z).stage[:, own[0], own[1]]
        suspension, _ = _pair_couplings(stage, 0 * np.abs(stage))
        first, second = np.triu_indices(len(problem.motion), 1)
        return OsemFit(
            stage=data.stage,
            reference=data.sensors[0].reference,
            sensor=tuple(one.name for one in data.sensors),
            coil=tuple(one.name for one in data.coils),
            motion=problem.motion,
            sensing_nominal=given,
            sensing=sensing,
            sensing_sigma=sensing_sigma,
            driving_nominal=problem.nominal_driving,
            driving=driving,
            driving_sigma=driving_sigma,
            covariance=self.of_elements,
            sensing_rows=a,
            driving_rows=b.T,
            mode=tuple(self.plant.modes.label[n] for n in modes),
            mode_nominal=nominal,
            mode_frequency=problem.responses.frequencies(z[problem.parts[3]]),
            mode_sigma=self.frequency_sigma,
            delay=float(z[-1] * per_delay),
            delay_sigma=float(sigma[-1] * per_delay),
            frequency=data.frequency,
            pair=tuple(
                f"{problem.motion[i]}, {problem.motion[j]}"
                for i, j in zip(first, second, strict=True)
            ),
            before=before,
            after=after,
            noise=noise,
            suspension=suspension,
        )


def _couplings(sensing: Array, driving: Array, data: OsemData) -> tuple[Array, Array]:
    """Couplings of the data with two matrices, and the standard deviations from their noise."""
    value = sensing @ data.value @ driving
    power = (sensing**2) @ (2 * data.sigma**2) @ (driving**2)
    return _pair_couplings(value, np.sqrt(power))


def _pair_couplings(
    value: Complex[np.ndarray, "frequency motion motion"],
    noise: Float[np.ndarray, "frequency motion motion"],
) -> tuple[Float[np.ndarray, "frequency pair"], Float[np.ndarray, "frequency pair"]]:
    """Off-diagonal elements of each pair of motions over the root of the diagonal ones."""
    first, second = np.triu_indices(value.shape[1], 1)
    size = np.abs(value)
    diagonal = np.einsum("fkk->fk", size)
    base = np.sqrt(diagonal[:, first] * diagonal[:, second])

    def largest(part: Array) -> Array:
        return np.maximum(part[:, first, second], part[:, second, first]) / base

    return largest(size), largest(noise)
