"""The group `tolerance` of a results file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from suspension_cli.analyses.sweep.solve import count_failures
from suspension_cli.analyses.tolerance.solve import RandomBuilds
from suspension_cli.analyses.tolerance.statistics import (
    QUANTILES,
    RANKED,
    Summary,
    rank_correlation,
)
from suspension_cli.analyses.xcouple.solve import CouplingRequest
from suspension_cli.conventions import FRAME, SUPPORT
from suspension_cli.design.reader import parse
from suspension_cli.files.hdf5 import add_dataset, add_scale, open_results
from suspension_cli.linear import signals
from suspension_cli.studies import builds

MAX_POINTS = 4000
"""Builds, and points of the cumulative curve, that figures show at most."""


def fill(group: h5py.Group, job: RandomBuilds, limit: float) -> None:
    """Write everything but the columns: nominal modes, numbers that vary, cross-coupling."""
    nominal = job.nominal
    mode = add_scale(group, "mode", np.arange(1, len(nominal.omega_squared) + 1), "1")
    add_dataset(group, "mode_label", nominal.label, "name", mode)
    add_dataset(group, "nominal_frequency", nominal.frequency, "Hz", mode)
    factor = add_scale(group, "factor", [f.label for f in job.factors], "name")
    add_dataset(group, "factor_unit", [f.unit for f in job.factors], "name", factor)
    add_scale(group, "coupling_frequency", np.array(job.question.frequency), "Hz")
    # as text: seeds reach 2^64 - 1, which not every HDF5 tool can read as a number
    group.attrs["seed"] = str(job.seed)
    group.attrs["limit"] = limit
    group.attrs["status_meaning"] = list(builds.STATUS)
    for name in ("input", "over", "under"):
        group.attrs[name] = getattr(job.question, name).text


def reconstruct_job(group: Any, text: str, level: str) -> RandomBuilds:
    """Reconstruct the job of a group from the text of its design and the name of its model."""
    known = (SUPPORT, *(stage.name for stage in parse(text).stage), FRAME)
    drive, over, under = (
        signals.parse(str(group.attrs[name]), name, known) for name in ("input", "over", "under")
    )
    question = CouplingRequest(
        0, 1, "", drive, over, under, tuple(group["coupling_frequency"][:].tolist())
    )
    seed = int(group.attrs["seed"])
    return RandomBuilds(text, len(group["status"]), seed, question, level=level)


def summarise(path: Path | str, job: RandomBuilds, limit: float) -> Summary:
    """Read a finished file and compute its statistics."""
    with open_results(path) as file:
        return summarise_group(file["tolerance"], job, limit)


def summarise_group(group: Any, job: RandomBuilds, limit: float) -> Summary:
    """Compute the statistics of a group, with one column of frequencies in memory at a time."""
    status = group["status"][:]
    good = status == builds.GOOD
    nominal, count = job.nominal, len(status)
    statistics, sample, ranked = [], [], []
    for n in range(len(nominal.omega_squared)):
        column = group["frequency"][:, n]
        values = column[good]
        statistics.append(
            (values.mean(), values.std(), *np.quantile(values, QUANTILES))
            if len(values)
            else (np.nan,) * (2 + len(QUANTILES))
        )
        sample.append(
            values[:MAX_POINTS] / nominal.frequency[n] - 1
            if nominal.frequency[n]
            else np.zeros(len(values[:MAX_POINTS]))
        )
        ranked.append(column[:RANKED])
    magnitude = np.abs(group["ratio"][:, -1])
    table = np.array(statistics)
    first = slice(0, min(RANKED, count))
    kept = good[first]
    deviations = job.deviations(0, first.stop)[kept]
    ordered = np.sort(magnitude[good])
    thinned = (
        np.unique(
            np.linspace(0, len(ordered) - 1, min(MAX_POINTS, len(ordered))).round().astype(int)
        )
        if len(ordered)
        else np.zeros(0, dtype=int)
    )
    return Summary(
        builds=count,
        good=int(good.sum()),
        failures=count_failures(status),
        label=tuple(nominal.label),
        nominal=nominal.frequency,
        mean=table[:, 0],
        spread=table[:, 1],
        quantiles=table[:, 2:],
        frequency=job.question.frequency[-1],
        limit=limit,
        under=float((ordered < limit).mean()) if len(ordered) else np.nan,
        ratio_quantiles=np.quantile(ordered, QUANTILES)
        if len(ordered)
        else np.full(len(QUANTILES), np.nan),
        ratio_sorted=ordered[thinned],
        factor=tuple(f.label for f in job.factors),
        ratio_rank=rank_correlation(magnitude[first][kept][:, None], np.abs(deviations))[0],
        mode_rank=rank_correlation(np.stack(ranked, axis=1)[kept], deviations),
        sample=np.stack(sample, axis=1),
        ratio=f"{job.question.over.text} / {job.question.under.text}",
        seed=job.seed,
    )
