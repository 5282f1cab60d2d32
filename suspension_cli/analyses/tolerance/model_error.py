"""Error of the couplings of random builds in the string model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from suspension_cli.analyses.tolerance.solve import RandomBuilds
from suspension_cli.models.registry import BEAM
from suspension_cli.studies.relative_change import relative_change

BUILDS = 32
"""Number of random builds that are compared."""


def estimate_scatter_error(job: RandomBuilds) -> float:
    """Estimate the error of the couplings of random builds in the string model, from wire bending.

    Relative to the largest coupling of the first builds. NaN if unknown: the design lacks
    properties of its wires, or none of these builds has an equilibrium in both models.
    """
    if BEAM.unsuitable(job.design):
        return float("nan")
    first = min(job.count, BUILDS)
    old, new = (
        np.asarray(one.compute(0, first)["ratio"]) for one in (job, replace(job, level=BEAM.name))
    )
    return relative_change(old, new)
