"""The results file of random builds: the builds themselves, and their statistics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.tolerance.build_statistics import slopes, unit_ranks
from suspension_cli.analyses.tolerance.estimates import Estimates, Statistics, signed_coupling
from suspension_cli.analyses.tolerance.solve import RandomBuilds
from suspension_cli.analyses.tolerance.summary import SIGNED, Tolerance
from suspension_cli.analyses.tolerance.variance_shares import fit
from suspension_cli.files import stored
from suspension_cli.files.declared import in_unit
from suspension_cli.files.mapped_arrays import copy_column
from suspension_cli.studies.builds import GOOD, STATUS
from suspension_cli.studies.run import Columns

if TYPE_CHECKING:
    import h5py
    from jaxtyping import Bool, Complex, Float, Int

    from suspension_cli.analyses.record import Origin

RANKED = 20_000
"""Number of first builds for rank correlations and shares, whose errors are then below 0.01."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FileContents(Tolerance):
    """What the results file has: statistics, and the builds themselves."""

    build: Int[np.ndarray, " build"]
    value: Float[np.ndarray, "build quantity"] = field(metadata=in_unit("{quantity_unit}"))
    complex_ratio: Complex[np.ndarray, "build coupling_frequency"] = field(
        metadata=in_unit("", name="ratio")
    )
    shared_motion: Bool[np.ndarray, "build labelled"] | None = field(
        default=None, metadata=in_unit("", name="shared")
    )
    residual: Float[np.ndarray, " build"]
    status: Int[np.ndarray, " build"]
    slack_wire: Int[np.ndarray, " build"]


def write(
    group: h5py.Group,
    columns: Columns,
    job: RandomBuilds,
    run: Origin,
    *,
    limit: float,
    precision: float,
    estimates: Estimates,
) -> Tolerance:
    """Write all builds and their statistics, and return these.

    `precision` is the standard error that was asked for, or 0.
    """
    largest, of_what = estimates.largest_error(job)
    record = FileContents(
        **_describe(job, limit),
        **_summarise(columns, job, estimates),
        **_yields(columns, job, estimates),
        precision=precision,
        largest_error=largest,
        largest_error_of=of_what,
        build=np.arange(job.count, dtype=np.uint32),
        value=columns["value"],
        complex_ratio=columns["ratio"],
        shared_motion=columns.get("shared"),
        residual=columns["residual"],
        status=columns["status"],
        slack_wire=columns["slack_wire"],
        run=run,
    )
    stored.write(group, record)
    group["ratio"].attrs["units"] = job.coupling.unit
    return record


def _describe(job: RandomBuilds, limit: float) -> dict[str, Any]:
    """What a summary says of the builds before they are computed."""
    question = job.question
    quantities = job.quantities
    return {
        "seed": str(job.seed),
        "builds": job.count,
        "limit": limit,
        "input": question.input.text,
        "over_signal": question.over.text,
        "under_signal": question.under.text,
        "coupling_frequency": np.array(question.frequency),
        "factor": tuple(one.label for one in job.factors),
        "factor_unit": tuple(one.unit for one in job.factors),
        "factor_group": tuple(one.group for one in job.factors),
        "group": job.groups,
        "mode": np.arange(1, len(job.modes) + 1),
        "mode_label": tuple(job.nominal.label),
        "nominal_frequency": job.nominal.frequency,
        "stage": tuple(job.scene.bodies.name),
        "quantity": tuple(one.text for one in quantities),
        "quantity_unit": tuple(one.unit for one in quantities),
        "result": (*(one.text for one in quantities), SIGNED),
        "result_unit": (*(one.unit for one in quantities), job.coupling.unit),
        "missing_reason": (*(one.missing for one in quantities), job.coupling.missing),
    }


def _summarise(
    columns: Mapping[str, Any], job: RandomBuilds, estimates: Estimates
) -> dict[str, Any]:
    """Statistics of all quantities."""
    found: dict[str, Any] = {}
    status = columns["status"]
    good = status == GOOD
    found["good"] = int(good.sum())
    found["status_count"] = tuple(int((status == code).sum()) for code in range(len(STATUS)))
    under = estimates.under
    found["fraction_under_limit"] = under.fraction
    found["fraction_under_limit_interval"] = under.interval
    found["fraction_under_limit_error"] = under.error
    for name, values in Statistics.columns(estimates.results).items():
        found[f"result_{name}"] = values
    missing = []
    infinite = []
    first = []
    signed = np.real(signed_coupling(columns))
    every = columns["value"]
    each = (copy_column(every, n) for n in range(every.shape[1]))
    for result in chain(each, [signed]):  # one after another, as there may be many builds
        missing.append(int(np.isnan(result[good]).sum()))
        infinite.append(int(np.isinf(result[good]).sum()))
        first.append(result[:RANKED].copy())
    found["missing"] = np.array(missing)
    found["infinite"] = np.array(infinite)
    kept = np.flatnonzero(good[:RANKED])
    found["ranked"] = len(kept)
    value = np.stack(first, axis=1)[kept]
    deviations = job.deviations(0, min(RANKED, job.count))[kept]
    return found | _find_causes(value, deviations, job)


def _find_causes(
    value: Float[np.ndarray, "build result"],
    deviations: Float[np.ndarray, "build factor"],
    job: RandomBuilds,
) -> dict[str, Any]:
    """Correlations, slopes and shares of all quantities with the numbers that vary."""
    coupling = job.quantities.index(job.coupling)
    rank = np.zeros((value.shape[1], deviations.shape[1]))
    slope = np.zeros(rank.shape)
    ranks: dict[tuple[bytes, bool], np.ndarray] = {}
    for n, column in enumerate(value.T):
        known = np.isfinite(column)
        moved = np.abs(deviations[known]) if n == coupling else deviations[known]
        key = known.tobytes(), n == coupling
        if key not in ranks:
            ranks[key] = unit_ranks(moved)
        rank[n] = unit_ranks(column[known, None])[:, 0] @ ranks[key]
        slope[n] = slopes(column[known], moved)
    shares = fit(value, deviations, [job.groups.index(one.group) for one in job.factors])
    return {
        "rank": rank,
        "slope": slope,
        "share": shares.share,
        "share_error": shares.error,
        "r_squared": shares.r_squared,
    }


def _yields(columns: Mapping[str, Any], job: RandomBuilds, estimates: Estimates) -> dict[str, Any]:
    """Limits of requirements, and fractions of builds that meet them."""
    found: dict[str, Any] = {}
    if job.labelled:
        found["labelled"] = tuple(one.text for one in job.labelled)
        found["shared_count"] = columns["shared"].sum(0)
    if not job.requirements:
        return found
    required = [
        replace(one, quantity=quantity)
        for one, quantity in zip(job.requirements, job.required, strict=True)
    ]
    bands = [one.band for one in required]
    found["requirement"] = tuple(one.limits.text for one in required)
    found["requirement_name"] = tuple(one.description for one in required)
    found["requirement_quantity"] = tuple(one.quantity.text for one in required)
    found["low"] = np.array([band.low for band in bands])
    found["high"] = np.array([band.high for band in bands])
    found["of_magnitude"] = np.array([band.of_magnitude for band in bands])
    found["open"] = np.array([band.open for band in bands])
    *each, joint = estimates.met
    found["yield_"] = np.array([one.fraction for one in each])
    found["yield_interval"] = np.array([one.interval for one in each])
    found["yield_error"] = np.array([one.error for one in each])
    found["yield_of_all"] = joint.fraction
    found["yield_of_all_interval"] = joint.interval
    found["yield_of_all_error"] = joint.error
    return found
