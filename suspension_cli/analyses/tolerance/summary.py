"""Statistics of random builds, and their results file."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.tolerance.solve import (
    RATIO,
    SIGNED,
    STATIC,
    Quantity,
    RandomBuilds,
    parse,
)
from suspension_cli.conventions import FRAME, GROUND, SUPPORT
from suspension_cli.files import stored
from suspension_cli.files.declared import ATTRIBUTE, along, in_unit
from suspension_cli.linear import signals
from suspension_cli.linear.named_results import labels, quotient_unit
from suspension_cli.physics.couplings import CouplingRequest
from suspension_cli.studies import builds
from suspension_cli.studies.job import parse as parse_design
from suspension_cli.studies.run import Columns
from suspension_cli.studies.sampling import RANDOM

if TYPE_CHECKING:
    import h5py
    from jaxtyping import Bool, Complex, Float, Int

QUANTILES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
"""Quantiles that are reported."""
RANKED = 20_000
"""Number of first builds for rank correlations, whose error is then below 0.01."""
LEVEL = 0.95
"""Probability that an interval contains the true value."""
SIGNIFICANT = 3.0
"""Least significant correlation, in standard deviations 1/sqrt(N) of N uncorrelated builds."""
MAX_POINTS = 4000
"""Most builds in figures."""
STATIC_UNIT = in_unit("{static_unit}")


@dataclass(frozen=True)
class Yield:
    """Fraction of builds that meet a requirement, or all, and its 95 % confidence interval."""

    name: str
    fraction: float
    interval: tuple[float, float]

    @property
    def percent(self) -> str:
        """Fraction and interval as text."""
        low, high = self.interval
        return f"{100 * self.fraction:.3g} % ({100 * low:.3g} to {100 * high:.3g})"


def unit_ranks(values: Float[np.ndarray, "build column"]) -> Float[np.ndarray, "build column"]:
    """Ranks in each column, less their mean, as unit vectors; 0 for a constant column.

    Products of two such vectors are Spearman's rank correlations.
    """
    if not len(values):
        return np.zeros(values.shape)
    from scipy.stats import rankdata  # spearmanr is slower, as it tests significance

    apart = rankdata(values, axis=0) - (len(values) + 1) / 2
    size = np.sqrt((apart**2).sum(0))
    return apart / np.where(size > 0, size, 1.0)


def slopes(
    a: Float[np.ndarray, " build"], b: Float[np.ndarray, "build factor"]
) -> Float[np.ndarray, " factor"]:
    """Slopes of the least-squares lines of values over the columns of b.

    >>> slopes(np.array([1.0, 3.0, 5.0]), np.array([[0.0], [1.0], [2.0]]))
    array([2.])
    """
    if not len(a):
        return np.zeros(b.shape[1])
    apart = b - b.mean(0)
    square = (apart**2).sum(0)
    return (a - a.mean()) @ apart / np.where(square > 0, square, 1.0)


def strongest(
    correlation: Float[np.ndarray, " factors"], count: int, least: float = 0.0
) -> list[int]:
    """Numbers of the strongest correlations above a least size, strongest first."""
    order = np.argsort(-np.abs(correlation), kind="stable")[:count]
    return [int(n) for n in order if abs(correlation[n]) > least]


def confidence_interval(
    met: Bool[np.ndarray, " build"], replicate: Int[np.ndarray, " build"] | None = None
) -> tuple[float, float]:
    """Estimate the confidence interval of a fraction of independent builds, or of replicates.

    After Wilson, J. Am. Stat. Assoc. 22, 209 (1927); of replicates Student's t of their fractions,
    unless all are 0 or 1.

    >>> [round(end, 4) for end in confidence_interval(np.zeros(100, dtype=bool))]
    [0.0, 0.037]
    """
    from scipy.stats import binomtest, sem, t

    count, builds = int(met.sum()), len(met)
    if builds == 0:
        return np.nan, np.nan
    parts = np.empty(0) if replicate is None else _means(met, replicate)
    if len(parts) < 2 or count in (0, builds):
        low, high = binomtest(count, builds).proportion_ci(LEVEL, method="wilson")
    else:
        low, high = t.interval(LEVEL, len(parts) - 1, count / builds, sem(parts))
    return max(float(low), 0.0), min(float(high), 1.0)


def standard_error(
    values: Float[np.ndarray, " build"], replicate: Int[np.ndarray, " build"] | None = None
) -> float:
    """Estimate the standard error of a mean of independent values or replicates; NaN of one."""
    parts = values if replicate is None else _means(values, replicate)
    return float(parts.std(ddof=1) / np.sqrt(len(parts))) if len(parts) > 1 else np.nan


def _means(values: np.ndarray, replicate: Int[np.ndarray, " build"]) -> np.ndarray:
    """Compute the mean of the values of each replicate."""
    return np.array([values[replicate == number].mean() for number in np.unique(replicate)])


@dataclass(frozen=True)
class SobolIndices:
    """Sobol indices of results with respect to groups of numbers; NaN where a result does not vary.

    The first-order one is the fraction of the variance that a group causes alone; the total one
    that which it causes alone or together with others. Errors are standard errors.
    """

    first: Float[np.ndarray, "group result"]
    total: Float[np.ndarray, "group result"]
    first_error: Float[np.ndarray, "group result"]
    total_error: Float[np.ndarray, "group result"]


def sobol_indices(
    values: Float[np.ndarray, "group+2 sample result"], replicate: Int[np.ndarray, " sample"]
) -> SobolIndices:
    """Estimate Sobol indices from the results by block, see `sampling.SamplePoints`.

    V_i = <f(B) (f(A_B^i) - f(A))> (Saltelli et al., Comput. Phys. Commun. 181, 259 (2010), table 2
    b) and V_Ti = <(f(A) - f(A_B^i))^2>/2 (Jansen, Comput. Phys. Commun. 117, 35 (1999)), over the
    variance of f in A and B; f less its mean, which only reduces the scatter. Rows in which one of
    the three failed (NaN) are left out. Errors are from the scatter of the replicates, NaN if one
    of these has too few rows left.

    >>> a, b = np.random.default_rng(1).random((2, 4096, 1))
    >>> found = sobol_indices(np.stack([a, b, b]), np.arange(4096) // 512)
    >>> found.first.round(1), found.total.round(1)
    (array([[1.]]), array([[1.]]))
    """
    parts = [values, *(values[:, replicate == number] for number in np.unique(replicate))]
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # means of nothing
        (first, total), *scattered = map(_estimate, parts)
        errors = np.std(scattered, axis=0, ddof=1) / np.sqrt(len(scattered))
    return SobolIndices(first, total, *errors)


def _estimate(values: Float[np.ndarray, "group+2 sample result"]) -> tuple[np.ndarray, np.ndarray]:
    """Estimate first-order and total indices."""
    variance, scale = np.nanvar(values[:2], axis=(0, 1)), np.nanmax(np.abs(values[:2]), (0, 1))
    # what rounding leaves is no variance
    variance = np.where(variance > (1e-12 * scale) ** 2, variance, np.nan)
    values = values - np.nanmean(values[:2], axis=(0, 1))
    a, b, mixed = values[0], values[1], values[2:]
    first = np.nanmean(b * (mixed - a), axis=1) / variance
    return first, np.nanmean((a - mixed) ** 2 / 2, axis=1) / variance


@dataclass(frozen=True, eq=False)
class Spread:
    """Distribution of one quantity over the builds, in SI units; Hz for modes.

    Its mean, the standard error of that, standard deviation and quantiles (`QUANTILES`); rank
    correlations with the deviations of numbers (of the coupling without sign, with their
    magnitudes); slopes of the least-squares lines over these; and values of some builds.
    """

    quantity: Quantity
    mean: float
    error: float
    deviation: float
    quantiles: Float[np.ndarray, " quantile"]
    rank: Float[np.ndarray, " factor"]
    slope: Float[np.ndarray, " factor"]
    sample: Float[np.ndarray, " build"]

    @property
    def name(self) -> str:
        """Name of the quantity."""
        return self.quantity.name

    @property
    def unit(self) -> str:
        """Unit of the quantity."""
        return self.quantity.unit


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
    hanging
        Number of those among the `independent` ones, of which all but yields are statistics.
    failures
        Number of builds by reason of failure.
    modes, coupling, static, required
        Distributions of frequencies in Hz, of the magnitude of the cross-coupling, of displacements
        (m) and rotations (rad) of the stages, and of quantities with requirements.
    signed
        That of the coupling with its sign.
    ranked
        Number of builds in the correlations.
    under
        Fraction of good builds with a coupling below the limit.
    yields, joint
        Of each requirement, and of all together.
    sobol
        Sobol indices of `job.quantities` for `job.groups`, if requested.
    shared
        Number of builds in which two modes share the motion of a mode that a requirement names.
    """

    job: RandomBuilds
    limit: float
    good: int
    hanging: int
    failures: dict[str, int]
    modes: list[Spread]
    coupling: Spread
    static: list[Spread]
    required: list[Spread]
    signed: Spread
    ranked: int
    under: Yield
    yields: tuple[Yield, ...]
    joint: Yield | None
    sobol: SobolIndices | None
    shared: dict[str, int]

    @property
    def independent(self) -> int:
        """Number of first builds in the statistics: all, or two blocks of those for indices."""
        return self.job.points.independent

    @property
    def mean(self) -> Float[np.ndarray, " mode"]:
        """Mean of each mode frequency, Hz."""
        return np.array([one.mean for one in self.modes])

    @property
    def spread(self) -> Float[np.ndarray, " mode"]:
        """Standard deviation of each mode frequency, Hz."""
        return np.array([one.deviation for one in self.modes])

    @property
    def quantiles(self) -> Float[np.ndarray, "mode quantile"]:
        """Quantiles of each mode frequency at `QUANTILES`, Hz."""
        return np.array([one.quantiles for one in self.modes])

    @property
    def indices(self) -> dict[str, Float[np.ndarray, "group result"]]:
        """Sobol indices of `job.quantities` and their errors, by name; empty if not requested."""
        return {} if self.sobol is None else dict(vars(self.sobol))

    def indices_of(self, one: Spread) -> dict[str, Float[np.ndarray, " group"]] | None:
        """Sobol indices of one quantity, 0 where it does not vary.

        None if their errors are not known: so many builds failed that a replicate has none left.
        """
        n = self.job.quantities.index(one.quantity)
        own = {name: values[:, n] for name, values in self.indices.items()}
        varies = bool(one.deviation > 1e-12 * abs(one.mean)) or self.hanging < 2
        if varies and not all(np.isfinite(values).all() for values in own.values()):
            return None
        return {name: np.nan_to_num(values) for name, values in own.items()}

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


def summarise(
    columns: Mapping[str, Any], job: RandomBuilds, limit: float, ranked: int = RANKED
) -> Summary:
    """Compute the statistics of builds; correlations and slopes of the first `ranked` ones."""
    points, rows = job.points, slice(0, job.points.independent)
    status = columns["status"][:]
    good = status[rows] == builds.GOOD
    kept = np.flatnonzero(good[:ranked])
    deviations = job.deviations(0, min(ranked, len(good)))[kept]
    signed, sizes = ((some, unit_ranks(some)) for some in (deviations, np.abs(deviations)))
    every = None if points.method == RANDOM else points.replicate(np.arange(len(good)))
    replicate = None if every is None else every[good]

    def describe(quantity: Quantity) -> Spread:
        every = quantity.read(columns, rows)
        values, own = every[good], every[kept]
        moved, ranks = sizes if quantity == RATIO else signed
        known = len(values) > 0
        return Spread(
            quantity=quantity,
            mean=values.mean() if known else np.nan,
            error=standard_error(values, replicate),
            deviation=values.std() if known else np.nan,
            quantiles=np.quantile(values, QUANTILES) if known else np.full(len(QUANTILES), np.nan),
            rank=unit_ranks(own[:, None])[:, 0] @ ranks,
            slope=slopes(own, moved),
            sample=values[:MAX_POINTS],
        )

    def fraction(name: str, met: np.ndarray, replicate: np.ndarray | None) -> Yield:
        share = float(met.mean()) if len(met) else np.nan
        return Yield(name, share, confidence_interval(met, replicate))

    required = zip(job.requirements, job.required, strict=True)
    met = [(one.describe(own), one.is_met(own.read(columns, rows))) for one, own in required]
    together = np.all([one for _, one in met], axis=0) if met else None
    spreads = {one: describe(one) for one in (*job.quantities, SIGNED)}
    return Summary(
        job=job,
        limit=limit,
        good=int((status == builds.GOOD).sum()),
        hanging=int(good.sum()),
        failures=builds.count_failures(status),
        modes=[own for one, own in spreads.items() if one.column == "frequency"],
        coupling=spreads[RATIO],
        static=[own for one, own in spreads.items() if one.column == "static"],
        required=[spreads[one] for one in dict.fromkeys(job.required)],
        signed=spreads[SIGNED],
        ranked=len(kept),
        under=fraction("", RATIO.read(columns, rows)[good] < limit, replicate),
        yields=tuple(fraction(name, one, every) for name, one in met),
        joint=None if together is None else fraction("all together", together, every),
        sobol=_indices(columns, job) if job.with_indices else None,
        shared=_shared(columns, job),
    )


def _shared(columns: Mapping[str, Any], job: RandomBuilds) -> dict[str, int]:
    """Count builds in which two modes share the motion of a mode that a requirement names."""
    if "shared" not in columns:
        return {}
    counts, names = columns["shared"][:].sum(0), labels(job.nominal)
    return {names[n]: int(counts[n]) for n in sorted(job.motions) if counts[n]}


def _indices(columns: Mapping[str, Any], job: RandomBuilds) -> SobolIndices:
    """Estimate the Sobol indices of all quantities."""
    points, values = job.points, [one.read(columns) for one in job.quantities]
    blocks = np.stack(values, axis=-1).reshape(points.blocks, points.rows, -1)
    return sobol_indices(blocks, points.replicate(np.arange(points.rows)))


@dataclass(frozen=True)
class Request:
    """What a results file has of the options, from which its job is made again.

    The seed is a text, as not every HDF5 tool can read seeds up to 2^64 - 1 as numbers.
    """

    coupling_frequency: Float[np.ndarray, " coupling_frequency"] = field(metadata=in_unit("Hz"))
    input: str
    over: str
    under: str
    seed: str
    limit: float
    sampling: str
    sobol_indices: bool
    requirement: tuple[str, ...] | None = None
    status_meaning: tuple[str, ...] = field(default=builds.STATUS, metadata=ATTRIBUTE)

    def job(self, count: int, text: str, level: str) -> RandomBuilds:
        """Make the job of so many builds of a design, in the model of that name."""
        known = (SUPPORT, *(stage.name for stage in parse_design(text).stage), FRAME, GROUND)
        drive, over, under = (
            signals.parse(getattr(self, name), name, known) for name in ("input", "over", "under")
        )
        frequency = tuple(self.coupling_frequency.tolist())
        return RandomBuilds(
            text,
            count,
            int(self.seed),
            CouplingRequest(0, 1, "", drive, over, under, frequency),
            level=level,
            requirements=tuple(map(parse, self.requirement or ())),
            method=self.sampling,
            with_indices=self.sobol_indices,
        )


def load(group: Any, text: str, level: str) -> Summary:
    """Compute the statistics of a group, given its design and the name of its model."""
    known = stored.read(group, Request)
    return summarise(group, known.job(len(group["status"]), text, level), known.limit)


@dataclass(frozen=True, kw_only=True)
class FileContents(Request):
    """What the results file has: options, what varies, the builds, and statistics."""

    factor: tuple[str, ...]
    factor_unit: tuple[str, ...] = field(metadata=along("factor"))
    factor_group: tuple[str, ...] = field(metadata=along("factor"))
    mode: Int[np.ndarray, " mode"]
    mode_label: tuple[str, ...] = field(metadata=along("mode"))
    nominal_frequency: Float[np.ndarray, " mode"] = field(metadata=in_unit("Hz"))
    stage: tuple[str, ...]
    static_dof: tuple[str, ...] = tuple(STATIC)
    static_unit: tuple[str, ...] = field(
        default=tuple(STATIC.values()), metadata=along("static_dof")
    )
    response_name: tuple[str, ...] | None = None
    response_unit: tuple[str, ...] | None = field(default=None, metadata=along("response_name"))
    build: Int[np.ndarray, " build"]
    frequency: Float[np.ndarray, "build mode"] = field(metadata=in_unit("Hz"))
    shared: Bool[np.ndarray, "build mode"] | None = None
    ratio: Complex[np.ndarray, "build coupling_frequency"]
    static: Float[np.ndarray, "build stage static_dof"] = field(metadata=STATIC_UNIT)
    response: Complex[np.ndarray, "build response_name"] | None = field(
        default=None, metadata=in_unit("{response_unit}")
    )
    residual: Float[np.ndarray, " build"]
    status: Int[np.ndarray, " build"]
    slack_wire: Int[np.ndarray, " build"]
    quantile: Float[np.ndarray, " quantile"] = field(default_factory=lambda: np.array(QUANTILES))
    interval: tuple[str, ...] = ("low", "high")
    static_mean: Float[np.ndarray, "stage static_dof"] = field(metadata=STATIC_UNIT)
    static_mean_error: Float[np.ndarray, "stage static_dof"] = field(metadata=STATIC_UNIT)
    static_std: Float[np.ndarray, "stage static_dof"] = field(metadata=STATIC_UNIT)
    static_quantiles: Float[np.ndarray, "stage static_dof quantile"] = field(metadata=STATIC_UNIT)
    yields: Float[np.ndarray, " requirement"] | None = field(
        default=None, metadata=in_unit("", name="yield")
    )
    yield_interval: Float[np.ndarray, "requirement interval"] | None = None
    yield_of_all: float | None = None
    yield_of_all_interval: tuple[float, float] | None = None
    group: tuple[str, ...] | None = None
    result: tuple[str, ...] | None = None
    sobol: SobolIndices | None = None


def write(group: h5py.Group, columns: Columns, job: RandomBuilds, limit: float) -> None:
    """Write all builds and their statistics."""
    question, nominal, factors = job.question, job.nominal, job.factors
    found = summarise(columns, job, limit, ranked=0)
    more: dict[str, Any] = {}
    for name, kind in (("mean", "mean"), ("mean_error", "error"), ("std", "deviation")):
        values = np.array([getattr(one, kind) for one in found.static])
        more[f"static_{name}"] = values.reshape(-1, len(STATIC))
    quantiles = np.array([one.quantiles for one in found.static])
    if job.ratios:
        more["response_name"] = tuple(one.text for one in job.ratios)
        more["response_unit"] = tuple(one.unit for one in job.ratios)
    if found.joint is not None:
        more["requirement"] = tuple(one.text for one in job.requirements)
        more["yields"] = np.array([one.fraction for one in found.yields])
        more["yield_interval"] = np.array([one.interval for one in found.yields])
        more["yield_of_all"] = found.joint.fraction
        more["yield_of_all_interval"] = found.joint.interval
    if found.sobol is not None:
        more["group"] = job.groups
        more["result"] = tuple(one.name for one in job.quantities)
        more["sobol"] = found.sobol
    record = FileContents(
        coupling_frequency=np.array(question.frequency),
        input=question.input.text,
        over=question.over.text,
        under=question.under.text,
        seed=str(job.seed),
        limit=limit,
        sampling=job.method,
        sobol_indices=job.with_indices,
        factor=tuple(one.label for one in factors),
        factor_unit=tuple(one.unit for one in factors),
        factor_group=tuple(one.group for one in factors),
        mode=np.arange(1, len(nominal.label) + 1),
        mode_label=tuple(labels(nominal)),
        nominal_frequency=nominal.frequency,
        stage=tuple(job.scene.bodies.name),
        build=np.arange(job.count, dtype=np.uint32),
        static_quantiles=quantiles.reshape(-1, len(STATIC), len(QUANTILES)),
        **more,
        **columns,
    )
    stored.write(group, record)
    group["ratio"].attrs["units"] = quotient_unit(question.over, question.under)
