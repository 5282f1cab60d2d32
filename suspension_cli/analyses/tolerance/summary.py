"""Statistics of random builds, and what their results file holds."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from suspension_cli.analyses.sweep.solve import count_failures
from suspension_cli.analyses.tolerance.quantities import (
    RATIO,
    STATIC,
    STATIC_UNITS,
    Quantity,
    parse,
)
from suspension_cli.analyses.tolerance.solve import RandomBuilds
from suspension_cli.analyses.tolerance.statistics import (
    QUANTILES,
    RANKED,
    SIGNIFICANT,
    SobolIndices,
    Spread,
    Yield,
    replicate_interval,
    signed,
    slopes,
    sobol_indices,
    standard_error,
    unit_ranks,
    wilson_interval,
)
from suspension_cli.analyses.xcouple.solve import CouplingRequest
from suspension_cli.conventions import FRAME, GROUND, SUPPORT
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
from suspension_cli.studies.job import parse as parse_design
from suspension_cli.studies.sample_points import SOBOL

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

STATICS = in_unit("{static_unit}")
MAX_POINTS = 4000
"""Most builds in figures."""


@dataclass(frozen=True)
class Summary:
    """Statistics of random builds.

    Attributes
    ----------
    job
        The builds: numbers that vary, tolerances, requirements, sampling.
    limit
        Limit on the cross-coupling.
    good
        Number of builds with an equilibrium on taut wires.
    failures
        Number of builds by reason of failure.
    modes, static, required
        Frequencies in Hz, displacements (m) and rotations (rad) of the stages, and quantities with
        requirements.
    coupling
        Magnitude of the ratio; its rank correlations are those with magnitudes of deviations.
    signed
        Real part of the ratio, see `statistics.signed`.
    ranked
        Number of builds in the correlations.
    under
        Fraction of good builds with a coupling below the limit.
    yields, joint
        Of each requirement, and of all together.
    indices
        Sobol indices of the groups of the job for each of `indexed`.
    """

    job: RandomBuilds
    limit: float
    good: int
    failures: dict[str, int]
    modes: Spread
    static: Spread
    required: Spread
    coupling: Spread
    signed: Spread
    ranked: int
    under: Yield
    yields: tuple[Yield, ...]
    joint: Yield | None
    indexed: tuple[str, ...] = ()
    indices: SobolIndices | None = None

    @property
    def builds(self) -> int:
        """Number of builds."""
        return self.job.count

    @property
    def independent(self) -> int:
        """Number of first builds in the statistics: all, or two blocks of those for indices."""
        return self.job.points.independent

    @property
    def factor(self) -> tuple[str, ...]:
        """Numbers that vary."""
        return tuple(one.label for one in self.job.factors)

    @property
    def label(self) -> tuple[str, ...]:
        """Labels of the nominal modes."""
        return tuple(self.job.nominal.label)

    @property
    def nominal(self) -> Float[np.ndarray, " mode"]:
        """Frequencies of the nominal modes, Hz."""
        return self.job.nominal.frequency

    @property
    def mean(self) -> Float[np.ndarray, " mode"]:
        """Mean of each mode frequency, Hz."""
        return self.modes.mean

    @property
    def spread(self) -> Float[np.ndarray, " mode"]:
        """Standard deviation of each mode frequency, Hz."""
        return self.modes.deviation

    @property
    def quantiles(self) -> Float[np.ndarray, "mode quantile"]:
        """Quantiles of each mode frequency at `QUANTILES`, Hz."""
        return self.modes.quantiles

    @property
    def ratio(self) -> str:
        """Name of the cross-coupling, ``test.x / test.z``."""
        return f"{self.job.question.over.text} / {self.job.question.under.text}"

    @property
    def frequency(self) -> float:
        """Frequency of the cross-coupling, Hz."""
        return self.job.question.frequency[-1]

    @property
    def significant(self) -> float:
        """Least significant rank correlation, 3/sqrt(N) of N builds."""
        return SIGNIFICANT / np.sqrt(self.ranked) if self.ranked else np.inf


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
    required = [item.quantity for item in job.requirements]
    every = (*names.every_mode(), RATIO, *names.every_static(), *required)
    return tuple(dict.fromkeys(every))


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
    points, names = job.points, job.names
    status, rows = group["status"][:], slice(0, job.points.independent)
    good = status[rows] == builds.GOOD
    kept = good[:ranked]
    deviations = job.deviations(0, len(kept))[kept]
    sizes = np.abs(deviations)
    ranks, size_ranks = unit_ranks(deviations), unit_ranks(sizes)

    def read(one: Quantity) -> Float[np.ndarray, " build"]:
        return one.read(group, rows)

    def spread(
        quantities: tuple[Quantity, ...], column: Any = read, *, size: bool = False
    ) -> Spread:
        statistics, sample, correlated = [], [], []
        replicate = points.replicate(np.flatnonzero(good)) if points.method == SOBOL else None
        for one in quantities:
            own = column(one)
            values = own[good]
            statistics.append(
                (
                    values.mean(),
                    standard_error(values, replicate),
                    values.std(),
                    *np.quantile(values, QUANTILES),
                )
                if len(values)
                else (np.nan,) * (3 + len(QUANTILES))
            )
            sample.append(values[:MAX_POINTS])
            correlated.append(own[: len(kept)][kept])
        table = np.array(statistics).reshape(-1, 3 + len(QUANTILES))
        results = np.array(correlated).reshape(len(correlated), int(kept.sum())).T
        return Spread(
            name=tuple(one.name for one in quantities),
            unit=tuple(one.unit for one in quantities),
            mean=table[:, 0],
            error=table[:, 1],
            deviation=table[:, 2],
            quantiles=table[:, 3:],
            rank=unit_ranks(results).T @ (size_ranks if size else ranks),
            slope=slopes(results, sizes if size else deviations),
            sample=np.array(sample).T if sample else np.zeros((0, 0)),
        )

    def fraction(
        name: str, met: Bool[np.ndarray, " build"], build: Int[np.ndarray, " build"]
    ) -> Yield:
        if points.method == SOBOL:
            interval = replicate_interval(met, points.replicate(build))
        else:
            interval = wilson_interval(int(met.sum()), len(met))
        return Yield(name, float(met.mean()) if len(met) else np.nan, *interval)

    def with_sign(_: Quantity) -> Float[np.ndarray, " build"]:
        ratio = group["ratio"][rows, -1]
        result = np.full(len(ratio), np.nan)
        result[good] = signed(ratio[good])
        return result

    every = np.arange(len(good))
    met = [(item.shown, item.is_met(read(item.quantity))) for item in job.requirements]
    yields = tuple(fraction(name, one, every) for name, one in met)
    together = np.all([one for _, one in met], axis=0) if met else None
    below = read(RATIO)[good] < limit
    shares = indexed(job) if job.with_indices else ()
    return Summary(
        job=job,
        limit=limit,
        good=int((status == builds.GOOD).sum()),
        failures=count_failures(status),
        modes=spread(names.every_mode()),
        static=spread(names.every_static()),
        required=spread(tuple(dict.fromkeys(item.quantity for item in job.requirements))),
        coupling=spread((RATIO,), size=True),
        signed=spread((RATIO,), with_sign),
        ranked=int(kept.sum()),
        under=fraction("", below, np.flatnonzero(good)),
        yields=yields,
        joint=None if together is None else fraction("all together", together, every),
        indexed=tuple(one.name for one in shares),
        indices=_indices(group, job, shares) if shares else None,
    )


def _indices(group: Stored, job: RandomBuilds, quantities: tuple[Quantity, ...]) -> SobolIndices:
    """Estimate the Sobol indices of quantities, one at a time."""
    points = job.points
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
