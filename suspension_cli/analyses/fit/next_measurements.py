"""Measurements that would determine the least known parameters of a fit best."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit.least_squares import covariance
from suspension_cli.analyses.fit.problem import Problem, stack_parts
from suspension_cli.analyses.fit.response_fit import Candidate
from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.linear import signals

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.scene.arrays import Array

GAIN = 0.05
"""Relative calibration error of a candidate measurement."""
PER_BAND = 24
"""Frequencies of a candidate measurement."""
BANDS = tuple(0.1 * 10 ** (n / 3) for n in range(7))
"""Edges of the bands of candidate measurements, Hz."""
ZERO = 1e-8
"""Size of a response over others of its drive and sensor below which it is a rounding error."""
LEAST = 8
"""Number of the least known parameters for which measurements are sought."""
IMPROVES = 0.7
"""Factor on a standard deviation below which a measurement is an improvement."""
LISTED = 6
"""Most measurements that are listed, the best first."""


def find(problem: Problem, z: Array, slope: Array) -> tuple[str, tuple[Candidate, ...]]:
    """Find the drives, sensors and bands that would determine a little known parameter best.

    The parameter is the first of the least known ones that a measurement improves by `IMPROVES`,
    else the one that it improves most. Candidates have the median relative noise of the measured
    functions, and a calibration error of `GAIN`. The information J^T J of a candidate is added to
    that of the fit (Fisher).
    """
    p = problem.count
    scale = problem.unknowns.scale
    scaled = slope * scale
    whole = scaled.T @ scaled
    spread = np.linalg.inv(whole + 1e-12 * np.diag(whole).max() * np.eye(len(whole)))
    at_bound = np.isnan(np.diag(covariance(problem, z, slope)))
    order = np.argsort(-np.diag(spread)[:p], kind="stable")
    least = [int(n) for n in order if not at_bound[n]][:LEAST]
    if not least:
        return "", ()
    plant = problem.experiment[0].plant(z[:p])
    known = signals.bodies_with_signals(plant.system)
    body = plant.system.body
    drives = [f"{SUPPORT}.{dof}" for dof in DOFS]
    drives += [f"{name}.{force}" for name in body for force in signals.FORCES]
    inputs = [signals.parse_input(text, known) for text in drives]
    outputs = [signals.parse_output(f"{name}.{dof}", known) for name in body for dof in DOFS]
    bands = [np.geomspace(a, b, PER_BAND, endpoint=False) for a, b in itertools.pairwise(BANDS)]
    response = plant.respond(np.concatenate(bands), inputs, outputs, problem.damping(z))
    value = response.value
    places = np.delete(np.arange(len(z)), problem.parts[1])
    rate = np.moveaxis(problem.state_derivatives(response, z), 0, -1) * scale[places]
    functions = problem.channels.function
    noise = [item.uncertainty / np.maximum(np.abs(item.value), 1e-300) for item in functions]
    relative = float(np.clip(np.median(np.concatenate(noise)), 1e-4, 1.0))
    part = spread[np.ix_(places, places)]
    own = np.diag(spread)[least]
    found: list[tuple[Float[np.ndarray, " least"], str, str, int]] = []
    for band in range(len(bands)):
        span = slice(band * PER_BAND, (band + 1) * PER_BAND)
        typical = np.median(np.abs(value[span]), axis=0)
        sigma = relative * np.maximum(np.abs(value[span]), 0.3 * typical)
        live = typical > ZERO * np.sqrt(np.outer(typical.max(1), typical.max(0)))
        for o, i in zip(*np.nonzero(live), strict=True):
            weight = 1 / sigma[:, o, i, None]
            rows = stack_parts(rate[span, o, i] * weight)
            gain = GAIN * stack_parts(value[span, o, i, None] * weight)
            # Woodbury's identity for the variances of interest
            middle = np.eye(len(rows)) + rows @ part @ rows.T + gain @ gain.T
            seen = rows @ part[:, least]
            gained = (seen * np.linalg.solve(middle, seen)).sum(0)
            found.append((own - gained, inputs[i].text, outputs[o].text, band))
    ratio = np.sqrt(np.min([item[0] / own for item in found], axis=0).clip(0.0))
    good = np.flatnonzero(ratio < IMPROVES)
    chosen = int(good[0]) if len(good) else int(ratio.argmin())
    best: dict[tuple[str, str], Candidate] = {}
    for variance, drive, sensor, band in sorted(found, key=lambda item: float(item[0][chosen])):
        if (drive, sensor) not in best and len(best) < LISTED:
            sigma = scale[least[chosen]] * float(np.sqrt(max(variance[chosen], 0.0)))
            best[drive, sensor] = Candidate(drive, sensor, (BANDS[band], BANDS[band + 1]), sigma)
    return problem.free[least[chosen]].name, tuple(best.values())
