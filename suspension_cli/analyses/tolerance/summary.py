"""What a results file of random builds holds, and the statistics of its builds."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np

from suspension_cli.analyses.sweep.solve import count_failures
from suspension_cli.analyses.tolerance.quantities import (
    STATIC,
    STATIC_UNITS,
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
from suspension_cli.files.declared import (
    ATTRIBUTE,
    Contents,
    along,
    derived,
    in_unit,
    pack,
    unpack,
)
from suspension_cli.files.hdf5 import Stored, read_contents, write_contents
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
    from jaxtyping import Bool, Float, Int

STATICS = in_unit("{static_unit}")
MAX_POINTS = 4000
"""Most builds, and points of the cumulative curve, in figures."""


@dataclass(frozen=True)
class Recorded:
    """What a results file has besides the builds; statistics are None until all builds are done.

    Attributes
    ----------
    factor, factor_unit, factor_group
        Numbers that vary, their units, and the tolerances that they belong to.
    seed
        As text, since not every HDF5 tool can read seeds up to 2^64 - 1 as numbers.
    static_mean, static_mean_error, static_std, static_quantiles
        Mean, its standard error, standard deviation and quantiles of the static pose.
    yields, yield_interval, yield_of_all, yield_of_all_interval
        Fraction of builds that meet each requirement, or all, and confidence intervals.
    group, result, sobol
        Tolerances and results with Sobol indices, and these.
    """

    mode_label: tuple[str, ...] = field(metadata=along("mode"))
    nominal_frequency: Float[np.ndarray, " mode"] = field(metadata=in_unit("Hz"))
    factor: tuple[str, ...]
    factor_unit: tuple[str, ...] = field(metadata=along("factor"))
    factor_group: tuple[str, ...] = field(metadata=along("factor"))
    coupling_frequency: Float[np.ndarray, " coupling_frequency"] = field(metadata=in_unit("Hz"))
    stage: tuple[str, ...]
    input: str
    over: str
    under: str
    seed: str
    limit: float
    sampling: str
    sobol_indices: bool
    response_name: tuple[str, ...] | None = None
    response_unit: tuple[str, ...] | None = field(default=None, metadata=along("response_name"))
    requirement: tuple[str, ...] | None = None
    group: tuple[str, ...] | None = None
    result: tuple[str, ...] | None = None
    static_mean: Float[np.ndarray, "stage static_dof"] | None = field(
        default=None, metadata=STATICS
    )
    static_mean_error: Float[np.ndarray, "stage static_dof"] | None = field(
        default=None, metadata=STATICS
    )
    static_std: Float[np.ndarray, "stage static_dof"] | None = field(default=None, metadata=STATICS)
    static_quantiles: Float[np.ndarray, "stage static_dof quantile"] | None = field(
        default=None, metadata=STATICS
    )
    yields: tuple[float, ...] | None = field(
        default=None, metadata=in_unit("1", "requirement", "yield")
    )
    yield_interval: tuple[tuple[float, float], ...] | None = field(
        default=None, metadata=in_unit("1", "requirement interval")
    )
    yield_of_all: float | None = None
    yield_of_all_interval: tuple[float, float] | None = None
    sobol: SobolIndices | None = None
    status_meaning: tuple[str, ...] = field(default=builds.STATUS, metadata=ATTRIBUTE)

    @property
    @derived()
    def static_dof(self) -> tuple[str, ...]:
        """Coordinates of the static pose."""
        return STATIC

    @property
    @derived(along="static_dof")
    def static_unit(self) -> tuple[str, ...]:
        """Unit of each coordinate of the static pose."""
        return STATIC_UNITS

    @property
    @derived()
    def interval(self) -> tuple[str, ...]:
        """Ends of a confidence interval."""
        return "low", "high"

    @property
    @derived()
    def quantile(self) -> Float[np.ndarray, " quantile"]:
        """Fractions of the builds."""
        return np.array(QUANTILES)


def record(job: RandomBuilds, limit: float) -> Recorded:
    """Return the names and numbers that vary."""
    question, factors = job.question, job.factors
    return Recorded(
        mode_label=tuple(job.nominal.label),
        nominal_frequency=job.nominal.frequency,
        factor=tuple(one.label for one in factors),
        factor_unit=tuple(one.unit for one in factors),
        factor_group=tuple(one.group for one in factors),
        coupling_frequency=np.array(question.frequency),
        stage=tuple(job.scene.bodies.name),
        input=question.input.text,
        over=question.over.text,
        under=question.under.text,
        seed=str(job.seed),
        limit=limit,
        sampling=job.method,
        sobol_indices=job.with_indices,
        response_name=tuple(one.text for one in job.ratios) or None,
        response_unit=tuple(one.unit for one in job.ratios) or None,
        requirement=tuple(item.text for item in job.requirements) or None,
        group=tuple(job.groups) if job.with_indices else None,
        result=tuple(one.name for one in indexed(job)) if job.with_indices else None,
    )


def complete(path: Path, job: RandomBuilds, limit: float) -> None:
    """Write the statistics into a file with all builds."""
    with h5py.File(path, "r+", locking=False) as file:
        group: Stored = file["tolerance"]
        found = summarise_group(group, job, limit, ranked=0)
        known = record(job, limit)
        shape, static = (len(known.stage), len(STATIC)), found.static
        joint = found.joint
        whole = replace(
            known,
            static_mean=static.mean.reshape(shape),
            static_mean_error=static.error.reshape(shape),
            static_std=static.deviation.reshape(shape),
            static_quantiles=static.quantiles.reshape(*shape, -1),
            sobol=found.indices,
        )
        if joint is not None:
            whole = replace(
                whole,
                yields=tuple(one.fraction for one in found.yields),
                yield_interval=tuple((one.low, one.high) for one in found.yields),
                yield_of_all=joint.fraction,
                yield_of_all_interval=(joint.low, joint.high),
            )
        contents = pack(whole)
        new = {path: one for path, one in contents.variables.items() if path not in group}
        write_contents(group, Contents(new, contents.attributes))


def indexed(job: RandomBuilds) -> tuple[Quantity, ...]:
    """Quantities with Sobol indices: modes, coupling, statics and those required."""
    names = job.names
    coupling = names.parse("coupling", "", {})
    required = [item.quantity for item in job.requirements]
    return tuple(dict.fromkeys((*names.every_mode(), coupling, *names.every_static(), *required)))


def load(group: Stored, text: str, level: str) -> Summary:
    """Compute the statistics of a group, given its design and the name of its model."""
    known = unpack(Recorded, read_contents(group))
    return summarise_group(group, reconstruct_job(group, known, text, level), known.limit)


def reconstruct_job(group: Stored, recorded: Recorded, text: str, level: str) -> RandomBuilds:
    """Reconstruct the job of a group."""
    known = (SUPPORT, *(stage.name for stage in parse_design(text).stage), FRAME, GROUND)
    drive, over, under = (
        signals.parse(getattr(recorded, name), name, known) for name in ("input", "over", "under")
    )
    frequency = tuple(recorded.coupling_frequency.tolist())
    job = RandomBuilds(
        text,
        len(group["status"]),
        int(recorded.seed),
        CouplingRequest(0, 1, "", drive, over, under, frequency),
        level=level,
        method=recorded.sampling,
        with_indices=recorded.sobol_indices,
    )
    ratios: dict[Ratio, int] = {}
    texts = recorded.requirement or ()
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
