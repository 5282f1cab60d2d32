"""The group `tolerance` of a results file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np

from suspension_cli.analyses.sweep.solve import count_failures
from suspension_cli.analyses.tolerance.quantities import (
    STATIC,
    Quantity,
    Requirement,
    parse,
)
from suspension_cli.analyses.tolerance.solve import RandomBuilds
from suspension_cli.analyses.tolerance.statistics import (
    QUANTILES,
    RANKED,
    Spread,
    Summary,
    Yield,
    rank_correlation,
    signed,
    slopes,
    unit_ranks,
)
from suspension_cli.analyses.xcouple.solve import CouplingRequest
from suspension_cli.conventions import FRAME, GROUND, SUPPORT
from suspension_cli.design.reader import parse as parse_design
from suspension_cli.files.hdf5 import Stored, add_dataset, add_scale
from suspension_cli.linear import signals
from suspension_cli.linear.named_results import Ratio
from suspension_cli.studies import builds
from suspension_cli.studies.confidence import (
    replicate_interval,
    standard_error,
    wilson_interval,
)
from suspension_cli.studies.sample_points import SOBOL, SamplePoints
from suspension_cli.studies.sobol_indices import SobolIndices, sobol_indices

if TYPE_CHECKING:
    from jaxtyping import Bool, Int

MAX_POINTS = 4000
"""Most builds, and points of the cumulative curve, in figures."""


def fill(group: h5py.Group, job: RandomBuilds, limit: float) -> None:
    """Write names and numbers that vary, and empty datasets for statistics."""
    nominal = job.nominal
    mode = add_scale(group, "mode", np.arange(1, len(nominal.omega_squared) + 1), "1")
    add_dataset(group, "mode_label", nominal.label, "name", mode)
    add_dataset(group, "nominal_frequency", nominal.frequency, "Hz", mode)
    factor = add_scale(group, "factor", [f.label for f in job.factors], "name")
    add_dataset(group, "factor_unit", [f.unit for f in job.factors], "name", factor)
    add_dataset(group, "factor_group", [f.group for f in job.factors], "name", factor)
    add_scale(group, "coupling_frequency", np.array(job.question.frequency), "Hz")
    stage = add_scale(group, "stage", list(job.scene.bodies.name), "name")
    dof = add_scale(group, "static_dof", list(STATIC), "name")
    quantile = add_scale(group, "quantile", np.array(QUANTILES), "1")
    if job.ratios:
        name = add_scale(group, "response_name", [one.text for one in job.ratios], "name")
        add_dataset(group, "response_unit", [one.unit for one in job.ratios], "name", name)
    unit = "m; rad for rotations"
    for name in ("static_mean", "static_mean_error", "static_std"):
        _add_empty(group, name, unit, stage, dof)
    _add_empty(group, "static_quantiles", unit, stage, dof, quantile)
    if job.requirements:
        texts = [item.text for item in job.requirements]
        required = add_scale(group, "requirement", texts, "name")
        end = add_scale(group, "interval", ["low", "high"], "name")
        _add_empty(group, "yield", "1", required)
        _add_empty(group, "yield_interval", "1", required, end)
    if job.with_indices:
        tolerance = add_scale(group, "group", list(job.groups), "name")
        result = add_scale(group, "result", [one.name for one in indexed(job)], "name")
        for name in ("first", "total", "first_error", "total_error"):
            _add_empty(group, f"sobol_{name}", "1", tolerance, result)
    # as text, since not every HDF5 tool can read seeds up to 2^64 - 1 as numbers
    group.attrs["seed"] = str(job.seed)
    group.attrs["limit"] = limit
    group.attrs["sampling"] = job.method
    group.attrs["sobol_indices"] = job.with_indices
    group.attrs["status_meaning"] = list(builds.STATUS)
    for name in ("input", "over", "under"):
        group.attrs[name] = getattr(job.question, name).text


def _add_empty(group: h5py.Group, name: str, units: str, *axes: h5py.Dataset) -> None:
    """Add a dataset of NaN that `complete` fills."""
    add_dataset(group, name, np.full([axis.size or 0 for axis in axes], np.nan), units, *axes)


def complete(path: Path, job: RandomBuilds, limit: float) -> None:
    """Write the statistics into a file with all builds."""
    with h5py.File(path, "r+", locking=False) as file:
        group: Stored = file["tolerance"]
        found = summarise_group(group, job, limit, ranked=0)
        shape = (len(job.scene.bodies.name), len(STATIC))
        static = found.static
        group["static_mean"][...] = static.mean.reshape(shape)
        group["static_mean_error"][...] = static.error.reshape(shape)
        group["static_std"][...] = static.deviation.reshape(shape)
        group["static_quantiles"][...] = static.quantiles.reshape(*shape, -1)
        if found.joint is not None:
            group["yield"][...] = [one.fraction for one in found.yields]
            group["yield_interval"][...] = [(one.low, one.high) for one in found.yields]
            group.attrs["yield_of_all"] = found.joint.fraction
            group.attrs["yield_of_all_interval"] = (found.joint.low, found.joint.high)
        if found.indices is not None:
            for name, values in vars(found.indices).items():
                group[f"sobol_{name}"][...] = values


def indexed(job: RandomBuilds) -> tuple[Quantity, ...]:
    """Quantities with Sobol indices: modes, coupling, statics and those required."""
    names = job.names
    coupling = names.parse("coupling", "", {})
    required = [item.quantity for item in job.requirements]
    return tuple(dict.fromkeys((*names.every_mode(), coupling, *names.every_static(), *required)))


def reconstruct_job(group: Stored, text: str, level: str) -> RandomBuilds:
    """Reconstruct the job of a group from its design and the name of its model."""
    known = (SUPPORT, *(stage.name for stage in parse_design(text).stage), FRAME, GROUND)
    drive, over, under = (
        signals.parse(str(group.attrs[name]), name, known) for name in ("input", "over", "under")
    )
    question = CouplingRequest(
        0, 1, "", drive, over, under, tuple(group["coupling_frequency"][:].tolist())
    )
    seed = int(group.attrs["seed"])
    job = RandomBuilds(
        text,
        len(group["status"]),
        seed,
        question,
        level=level,
        method=str(group.attrs["sampling"]),
        with_indices=bool(group.attrs["sobol_indices"]),
    )
    if "requirement" not in group:
        return job
    ratios: dict[Ratio, int] = {}
    texts = group["requirement"].asstr()[:]
    return job.requiring(tuple(parse(text, job.names, ratios) for text in texts))


def summarise_group(
    group: Stored, job: RandomBuilds, limit: float, ranked: int = RANKED
) -> Summary:
    """Compute the statistics of a group, one column of results at a time.

    Rank correlations and slopes are those of the first `ranked` builds.
    """
    points, nominal = job.points, job.nominal
    status = group["status"][:]
    rows = slice(0, points.independent)
    view = _View(group, job, rows, ranked)
    kept = view.kept
    modes = view.spread(job.names.every_mode())
    static = view.spread(job.names.every_static())
    required = tuple(dict.fromkeys(item.quantity for item in job.requirements))
    with np.errstate(all="ignore"):
        sample = np.where(nominal.frequency > 0, modes.sample / nominal.frequency - 1, 0.0)
    coupling = job.names.parse("coupling", "", {})
    whole = coupling.read(group, rows)
    magnitude = whole[view.good]
    ordered = np.sort(magnitude)
    met = magnitude < limit
    thinned = (
        np.unique(
            np.linspace(0, len(ordered) - 1, min(MAX_POINTS, len(ordered))).round().astype(int)
        )
        if len(ordered)
        else np.zeros(0, dtype=int)
    )
    absolute, size = whole[: len(kept)][kept][:, None], np.abs(view.deviations)
    with_sign = signed(group["ratio"][: len(kept), -1][kept])[:, None]
    yields, joint = _yields(group, job.requirements, points)
    names = indexed(job) if job.with_indices else ()
    return Summary(
        builds=len(status),
        good=int((status == builds.GOOD).sum()),
        independent=points.independent,
        failures=count_failures(status),
        label=tuple(nominal.label),
        nominal=nominal.frequency,
        mean=modes.mean,
        mean_error=modes.error,
        spread=modes.deviation,
        quantiles=modes.quantiles,
        frequency=job.question.frequency[-1],
        limit=limit,
        under=float((ordered < limit).mean()) if len(ordered) else np.nan,
        under_interval=_interval(met, points, np.flatnonzero(view.good)),
        ratio_quantiles=np.quantile(ordered, QUANTILES)
        if len(ordered)
        else np.full(len(QUANTILES), np.nan),
        ratio_sorted=ordered[thinned],
        factor=tuple(f.label for f in job.factors),
        factor_unit=tuple(f.unit for f in job.factors),
        ratio_rank=rank_correlation(absolute, size)[0],
        signed_rank=(unit_ranks(with_sign).T @ view.ranks)[0],
        signed_slope=slopes(with_sign, view.deviations)[0],
        mode_rank=modes.rank,
        mode_slope=modes.slope,
        ranked=int(kept.sum()),
        sample=sample,
        static=static,
        required=view.spread(required),
        limits=tuple((item.low, item.high, item.magnitude) for item in job.requirements),
        required_place=tuple(required.index(item.quantity) for item in job.requirements),
        yields=yields,
        joint=joint,
        ratio=f"{job.question.over.text} / {job.question.under.text}",
        seed=job.seed,
        sampling=job.method,
        group=job.groups if job.with_indices else (),
        indexed=tuple(one.name for one in names),
        indices=_indices(group, points, names) if names else None,
    )


class _View:
    """Independent builds of a group, and deviations of those with rank correlations."""

    def __init__(self, group: Stored, job: RandomBuilds, rows: slice, ranked: int) -> None:
        self.group, self.rows, self.points = group, rows, job.points
        self.good = group["status"][rows] == builds.GOOD
        self.kept = self.good[:ranked]
        self.deviations = job.deviations(0, len(self.kept))[self.kept]
        self.ranks = unit_ranks(self.deviations)

    def spread(self, quantities: tuple[Quantity, ...]) -> Spread:
        """Compute the distributions of some quantities."""
        statistics, sample, ranked = [], [], []
        replicate = self.points.replicate(np.flatnonzero(self.good))
        for one in quantities:
            column = one.read(self.group, self.rows)
            values = column[self.good]
            error = standard_error(values, replicate if self.points.method == SOBOL else None)
            statistics.append(
                (values.mean(), error, values.std(), *np.quantile(values, QUANTILES))
                if len(values)
                else (np.nan,) * (3 + len(QUANTILES))
            )
            sample.append(values[:MAX_POINTS])
            ranked.append(column[: len(self.kept)][self.kept])
        table = np.array(statistics).reshape(-1, 3 + len(QUANTILES))
        results = np.array(ranked).reshape(len(ranked), int(self.kept.sum())).T
        return Spread(
            name=tuple(one.name for one in quantities),
            unit=tuple(one.unit for one in quantities),
            mean=table[:, 0],
            error=table[:, 1],
            deviation=table[:, 2],
            quantiles=table[:, 3:],
            rank=unit_ranks(results).T @ self.ranks,
            slope=slopes(results, self.deviations),
            sample=np.array(sample).T if sample else np.zeros((0, 0)),
        )


def _yields(
    group: Stored, requirements: tuple[Requirement, ...], points: SamplePoints
) -> tuple[tuple[Yield, ...], Yield | None]:
    """Estimate the yields of each requirement and of all together."""
    rows = slice(0, points.independent)
    every = np.ones(points.independent, dtype=bool)
    found = []
    for item in requirements:
        met = item.is_met(item.quantity.read(group, rows))
        every &= met
        found.append(_yield_of(item.shown, met, points))
    return tuple(found), _yield_of("all together", every, points) if found else None


def _yield_of(name: str, met: Bool[np.ndarray, " build"], points: SamplePoints) -> Yield:
    interval = _interval(met, points, np.arange(len(met)))
    return Yield(name, float(met.mean()), *interval)


def _interval(
    met: Bool[np.ndarray, " build"], points: SamplePoints, build: Int[np.ndarray, " build"]
) -> tuple[float, float]:
    """Estimate the confidence interval of the fraction `met` of builds given by number."""
    if points.method == SOBOL:
        return replicate_interval(met, points.replicate(build))
    return wilson_interval(int(met.sum()), len(met))


def _indices(group: Stored, points: SamplePoints, quantities: tuple[Quantity, ...]) -> SobolIndices:
    """Estimate the Sobol indices of quantities, one at a time."""
    replicate = points.replicate(np.arange(points.rows))
    found = [
        sobol_indices(one.read(group).reshape(points.blocks, points.rows, 1), replicate)
        for one in quantities
    ]
    return SobolIndices(
        *(
            np.concatenate([getattr(one, name) for one in found], axis=-1)
            for name in SobolIndices.__dataclass_fields__
        )
    )
