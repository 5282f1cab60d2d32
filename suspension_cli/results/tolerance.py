"""The group `tolerance` of a results file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from suspension_cli.analysis import builds, signals
from suspension_cli.analysis.coupling import Question
from suspension_cli.analysis.scatter import LEVELS, RANKED, Summary, rank_correlation
from suspension_cli.analysis.tolerance import Tolerances
from suspension_cli.conventions import SUPPORT
from suspension_cli.design.reader import parse
from suspension_cli.results import dataset, open_results, scale

DRAWN = 4000
"""Builds, and points of the cumulative curve, that pictures show."""


def fill(group: h5py.Group, job: Tolerances, limit: float) -> None:
    """What stands beside the columns: nominal modes, what scattered, and the question."""
    nominal = job.nominal
    mode = scale(group, "mode", np.arange(1, len(nominal.omega_squared) + 1), "1")
    dataset(group, "mode_label", nominal.label, "name", mode)
    dataset(group, "nominal_frequency", nominal.frequency, "Hz", mode)
    factor = scale(group, "factor", [f.label for f in job.factors], "name")
    dataset(group, "factor_unit", [f.unit for f in job.factors], "name", factor)
    scale(group, "coupling_frequency", np.array(job.question.frequency), "Hz")
    group.attrs["seed"] = str(job.seed)  # up to 2^64, which no attribute of HDF5 tools is sure to hold
    group.attrs["limit"] = limit
    group.attrs["status_meaning"] = list(builds.STATUS)
    for name in ("input", "over", "under"):
        group.attrs[name] = getattr(job.question, name).text


def job(group: Any, text: str) -> Tolerances:
    """The job that a group came from, with the design's text."""
    known = (SUPPORT, *(stage.name for stage in parse(text).stage), "frame")
    drive, over, under = (signals.parse(str(group.attrs[name]), name, known) for name in ("input", "over", "under"))
    question = Question(0, 1, "", drive, over, under, tuple(group["coupling_frequency"][:].tolist()))
    return Tolerances(text, len(group["status"]), int(group.attrs["seed"]), question)


def summarise(path: Path | str, job: Tolerances, limit: float) -> Summary:
    """Read a finished file and sum it up."""
    with open_results(path) as file:
        return summarised(file["tolerance"], job, limit)


def summarised(group: Any, job: Tolerances, limit: float) -> Summary:
    """Sum a finished group up, one column of frequencies at a time."""
    status = group["status"][:]
    good = status == builds.GOOD
    nominal, count = job.nominal, len(status)
    statistics, sample, ranked = [], [], []
    for n in range(len(nominal.omega_squared)):
        column = group["frequency"][:, n]
        values = column[good]
        statistics.append((values.mean(), values.std(), *np.quantile(values, LEVELS)) if len(values) else (np.nan,) * (2 + len(LEVELS)))
        sample.append(values[:DRAWN] / nominal.frequency[n] - 1 if nominal.frequency[n] else np.zeros(len(values[:DRAWN])))
        ranked.append(column[:RANKED])
    size = np.abs(group["ratio"][:, -1])
    table = np.array(statistics)
    first = slice(0, min(RANKED, count))
    kept = good[first]
    deviations = job.deviations(0, first.stop)[kept]
    ordered = np.sort(size[good])
    thin = np.unique(np.linspace(0, len(ordered) - 1, min(DRAWN, len(ordered))).round().astype(int)) if len(ordered) else np.zeros(0, dtype=int)
    return Summary(
        builds=count,
        good=int(good.sum()),
        failures={reason: int((status == code).sum()) for code, reason in enumerate(builds.STATUS) if code != builds.GOOD and (status == code).any()},
        label=tuple(nominal.label),
        nominal=nominal.frequency,
        mean=table[:, 0],
        spread=table[:, 1],
        quantiles=table[:, 2:],
        frequency=job.question.frequency[-1],
        limit=limit,
        under=float((ordered < limit).mean()) if len(ordered) else np.nan,
        ratio_quantiles=np.quantile(ordered, LEVELS) if len(ordered) else np.full(len(LEVELS), np.nan),
        ratio_sorted=ordered[thin],
        factor=tuple(f.label for f in job.factors),
        ratio_rank=rank_correlation(size[first][kept][:, None], np.abs(deviations))[0],
        mode_rank=rank_correlation(np.stack(ranked, axis=1)[kept], deviations),
        sample=np.stack(sample, axis=1),
    )
