"""Sensing and driving matrices from the measured responses of all sensors to all coils of a stage.

    data = collect(design, functions)
    found = solve(data, Plant.of(design, "beam"))
    found.matrices.sensing, found.chi_squared

The measured functions are H(f) = exp(-2 pi i f T) A G(f) B: G the responses of the six motions of
the stage to forces along and about its axes in the model, A the readings of the sensors per motion,
B the forces and torques per force of the coils, T a delay that all share. A and B are real
constants, whatever the errors of gains, places and directions are. They, T, and changes of the
modes in the band (the model's are off by some per cent, more than the data) follow from weighted
least squares. With G off its diagonal only where the suspension itself
couples motions, S = A^-1 and D = B^-1 make S H D diagonal but for that.

A K and K^-1 B with K = diag(k) give the same H for K^-1 G K, which differs from G only where the
suspension couples motions, and by errors of calibration. So the scale of each motion is a
convention, that the nominal sensing matrix reads it right, (S_nominal A)_kk = 1, after sensors with
a wrong sign are turned, and the relative scales K of coupled motions are fitted beside A and B.

What the sensors and the coils of two coupled motions have in common, as if both were turned, is
seen in the stiffness alone: inertia is the same for all turned coordinates of unit kinetic energy.
So it is known as well as the stiffness of the model, whose errors the shifts of the frequencies of
all coupled modes show (`stiffness_sigma`): a design that was fitted to its modes gives the
smallest uncertainties.

Peaks of a model with slightly wrong frequencies are at the wrong places, where a search would stop.
So it begins with data whose uncertainty includes that of the frequencies and dampings (`LADDER`).
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit.matrix_problem import MatrixProblem
from suspension_cli.analyses.fit.matrix_solution import MatrixSolution
from suspension_cli.analyses.fit.osem_data import OsemData, collect
from suspension_cli.analyses.fit.result import Fitted
from suspension_cli.analyses.fit.stage_responses import STIFFNESS_SIGMA, StageResponses
from suspension_cli.design import reader
from suspension_cli.design.measured import Measured
from suspension_cli.design.reader import Source
from suspension_cli.errors import InputError, attribute_faults_to
from suspension_cli.measurements.transfer_function import MeasuredResponse
from suspension_cli.scene.arrays import Array
from suspension_cli.studies.response_matrix import Plant

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

LADDER = (1.0, 0.2, 0.04, 0.0)
"""Fractions of these uncertainties in that of the data, in the order of the searches."""
ROUNDS = 400
"""Most alternating linear fits of A and B before the first search; they converge linearly."""
SETTLED = 1e-5
"""Largest relative change of A in a round at which these end."""
CLOSE = 1e-3
CONVERGED = 1e-12
"""Relative changes at which searches end, those with widened uncertainties and the last one."""


def demand_functions_alone(given: Measured) -> None:
    """Raise `InputError` if a file of measurements has other than transfer functions."""
    for key in ("parameter", "mode", "quantity", "experiment"):
        if getattr(given, key):
            problem = "is not used with --matrices, which changes no parameter"
            remedy = "fit the design to it first, without --matrices, and then take the fitted one"
            raise InputError.of(key, problem, remedy)


def fit_design(source: Source, functions: Sequence[MeasuredResponse], level: str) -> Fitted:
    """Find the matrices of the OSEMs of a design, and put them into its `[[control.osem]]`."""
    data = collect(source.design, functions)
    with attribute_faults_to(source.file):
        plant = Plant.of(source.design, level)
    found = solve(data, plant)
    raw = tomllib.loads(source.text)
    rows = found.matrices
    for osem in raw["control"]["osem"]:
        if osem["name"] in rows.sensor:
            osem["sensing"] = _rounded(rows.sensing_rows[rows.sensor.index(osem["name"])])
        if osem["name"] in rows.coil:
            osem["driving"] = _rounded(rows.driving_rows[rows.coil.index(osem["name"])])
    none = np.zeros(0)
    whole = np.zeros(0, dtype=int)
    return Fitted(
        experiment=(source.name,),
        name=(),
        shared=np.zeros((0, 1), dtype=bool),
        start=none,
        value=none,
        sigma=none,
        prior=none,
        prior_sigma=none,
        covariance=np.zeros((0, 0)),
        scale=found.scale,
        at_bound=np.zeros(0, dtype=bool),
        of=whole,
        label=(),
        measured=none,
        uncertainty=none,
        before=none,
        after=none,
        value_of=whole,
        quantity=(),
        quantity_unit=(),
        value_measured=none,
        value_uncertainty=none,
        value_before=none,
        value_after=none,
        chi_squared=found.chi_squared,
        freedom=found.freedom,
        singular=none,
        direction=np.zeros((0, 0)),
        toml=(reader.write_toml(raw, source.text),),
        design_before=(),
        ends=np.array([found.chi_squared]),
        matrices=rows,
    )


def _rounded(row: Float[np.ndarray, " 6"]) -> list[float]:
    """Round to nine digits, more than any measurement has."""
    return [float(f"{value:.9g}") for value in row.tolist()]


def solve(data: OsemData, plant: Plant) -> MatrixSolution:
    """Fit A, B, the modes and the delay.

    Raises `InputError` if the OSEMs resolve no motion, or if the data do not determine an element.
    """
    responses = StageResponses.of(plant, data.stage, data.frequency)
    wide = np.full(len(responses.first), STIFFNESS_SIGMA)
    problem = MatrixProblem(data, responses, np.ones(len(data.sensors)), wide)
    if not problem.motion:
        where = f"the OSEMs of {data.stage}"
        text = f"{where} that were measured resolve no motion alone"
        raise InputError.of("transfer_function", text, "measure more of its OSEMs")
    count = 2 * data.value.size
    unknowns = problem.parts[-1] + 1
    if count < unknowns:
        measured = len(data.frequency)
        each = "1 frequency gives" if measured == 1 else f"{measured} frequencies give"
        text = f"{each} {count} numbers for {unknowns} unknowns"
        raise InputError.of("transfer_function", text, "measure at more frequencies")
    a, b = _alternate(problem)
    problem = replace(problem, sign=problem.signs(a))
    z = problem.pack(a, b)
    for fraction in LADDER:
        z = _minimise(problem, z, problem.widened(z, fraction), CLOSE if fraction else CONVERGED)
    problem = replace(problem, stiffness_sigma=responses.typical_change(z[problem.parts[3]]))
    z = _minimise(problem, z, data.sigma, CONVERGED)
    found = MatrixSolution(problem, plant, z)
    found.demand_determined()
    return found


def _alternate(problem: MatrixProblem) -> tuple[Array, Array]:
    """Fit B to the data with A, then A with B, some times: a start with any signs and gains."""
    a, b = (part.copy() for part in problem.nominal)
    z = problem.pack(a, b)
    weight = 1 / problem.widened(z, 1.0)
    stage = problem.changed(z).stage
    own = problem.resolved
    for _ in range(ROUNDS):
        read = a @ stage
        rest = problem.data.value - read[..., ~own] @ b[~own]
        b[own] = _real_fits(read[..., own], rest, weight)
        pushed = (stage @ b).swapaxes(1, 2)
        rest = problem.data.value.swapaxes(1, 2) - pushed[..., ~own] @ a[:, ~own].T
        last = a.copy()
        a[:, own] = _real_fits(pushed[..., own], rest, weight.swapaxes(1, 2)).T
        if np.linalg.norm((a - last)[:, own] / problem.size[0]) < SETTLED:
            break
    return a, b


def _real_fits(
    columns: Complex[np.ndarray, "frequency channel motion"],
    value: Complex[np.ndarray, "frequency channel other"],
    weight: Float[np.ndarray, "frequency channel other"],
) -> Float[np.ndarray, "motion other"]:
    """Fit real factors of complex columns to complex data, by normal equations: a mere start."""
    motions = columns.shape[-1]
    rows = columns.reshape(-1, motions)
    power = weight.reshape(len(rows), -1) ** 2
    size = np.linalg.norm(rows, axis=0)
    size[size == 0] = 1.0
    rows = rows / size
    products = np.real(rows.conj()[:, :, None] * rows[:, None, :]).reshape(len(rows), -1)
    normal = (power.T @ products).reshape(-1, motions, motions)
    right = np.real(rows.conj().T @ (power * value.reshape(len(rows), -1))).T
    inverse = np.linalg.pinv(normal, hermitian=True)
    return (inverse @ right[..., None])[..., 0].T / size[:, None]


def _minimise(problem: MatrixProblem, z: Array, sigma: Array, tolerance: float) -> Array:
    from scipy import optimize

    found = optimize.least_squares(
        problem.residual, z, jac=problem.jacobian, args=(sigma,), method="lm", max_nfev=200,  # pyright: ignore[reportArgumentType]
        x_scale="jac", xtol=tolerance, ftol=tolerance, gtol=tolerance,
    )  # fmt: skip
    return found.x
