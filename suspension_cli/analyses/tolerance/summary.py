"""Statistics of random builds, and what their results file holds besides the builds."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np
from numpy.typing import ArrayLike

from suspension_cli.analyses.tolerance.quantities import RATIO, SIGNED, STATIC, Quantity, parse
from suspension_cli.analyses.tolerance.solve import RandomBuilds
from suspension_cli.analyses.tolerance.statistics import (
    QUANTILES,
    RANKED,
    SIGNIFICANT,
    SobolIndices,
    Yield,
    replicate_interval,
    slopes,
    sobol_indices,
    standard_error,
    unit_ranks,
    wilson_interval,
)
from suspension_cli.analyses.xcouple.solve import CouplingRequest
from suspension_cli.conventions import FRAME, GROUND, SUPPORT
from suspension_cli.files import stored
from suspension_cli.files.declared import ATTRIBUTE, TEXT, in_unit
from suspension_cli.files.hdf5 import Stored, add_dataset, add_scale
from suspension_cli.linear import signals
from suspension_cli.studies import builds
from suspension_cli.studies.job import parse as parse_design
from suspension_cli.studies.sample_points import RANDOM
from suspension_cli.studies.sweep_file import Fill

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

MAX_POINTS = 4000
"""Most builds in figures."""


Table = dict[str, tuple[str, str, ArrayLike]]
"""Dimensions, unit and values of arrays by path."""


@dataclass(frozen=True, eq=False)
class Spread:
    """Distribution of one quantity over the builds, in SI units; Hz for modes.

    Attributes
    ----------
    mean, error, deviation
        Mean, its standard error, and standard deviation.
    quantiles
        At `QUANTILES`.
    rank
        Rank correlations with the deviations of numbers; of the coupling without sign, with their
        magnitudes.
    slope
        Change per unit of each deviation (least squares).
    sample
        Values of some builds, for figures.
    sobol
        Sobol indices, if requested, of the groups of the job.
    """

    quantity: Quantity
    mean: float
    error: float
    deviation: float
    quantiles: Float[np.ndarray, " quantile"]
    rank: Float[np.ndarray, " factor"]
    slope: Float[np.ndarray, " factor"]
    sample: Float[np.ndarray, " build"]
    sobol: SobolIndices | None = None

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
    """

    job: RandomBuilds
    limit: float
    good: int
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

    @property
    def independent(self) -> int:
        """Number of first builds in the statistics: all, or two blocks of those for indices."""
        return self.job.points.independent

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
        results = dict.fromkeys((*self.modes, self.coupling, *self.static, *self.required))
        found = [vars(one.sobol) for one in results if one.sobol is not None]
        return {name: np.array([one[name] for one in found]).T for name in (found or [{}])[0]}

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


def summarise(group: Stored, job: RandomBuilds, limit: float, ranked: int = RANKED) -> Summary:
    """Compute the statistics of the builds in a group of a file, one quantity at a time.

    Rank correlations and slopes are those of the first `ranked` builds.
    """
    points, rows = job.points, slice(0, job.points.independent)
    status = group["status"][:]
    good = status[rows] == builds.GOOD
    kept = np.flatnonzero(good[:ranked])
    deviations = job.deviations(0, min(ranked, len(good)))[kept]
    signed, sizes = ((some, unit_ranks(some)) for some in (deviations, np.abs(deviations)))
    replicate = None if points.method == RANDOM else points.replicate(np.flatnonzero(good))

    def describe(quantity: Quantity) -> Spread:
        every = quantity.read(group, rows)
        values, own = every[good], every[kept][:, None]
        moved, ranks = sizes if quantity == RATIO else signed
        known = len(values) > 0
        return Spread(
            quantity=quantity,
            mean=values.mean() if known else np.nan,
            error=standard_error(values, replicate),
            deviation=values.std() if known else np.nan,
            quantiles=np.quantile(values, QUANTILES) if known else np.full(len(QUANTILES), np.nan),
            rank=unit_ranks(own)[:, 0] @ ranks,
            slope=slopes(own, moved)[0],
            sample=values[:MAX_POINTS],
            sobol=indices(quantity) if job.with_indices and not quantity.signed else None,
        )

    def indices(quantity: Quantity) -> SobolIndices:
        values = quantity.read(group).reshape(points.blocks, points.rows)
        return sobol_indices(values, points.replicate(np.arange(points.rows)))

    def fraction(
        name: str, met: Bool[np.ndarray, " build"], of: Int[np.ndarray, " build"]
    ) -> Yield:
        found = (
            wilson_interval(int(met.sum()), len(met))
            if points.method == RANDOM
            else replicate_interval(met, points.replicate(of))
        )
        return Yield(name, float(met.mean()) if len(met) else np.nan, found)

    every, required = np.arange(len(good)), zip(job.requirements, job.required, strict=True)
    met = [(one.describe(own), one.is_met(own.read(group, rows))) for one, own in required]
    together = np.all([one for _, one in met], axis=0) if met else None
    spreads = {one: describe(one) for one in (*job.quantities, SIGNED)}
    return Summary(
        job=job,
        limit=limit,
        good=int((status == builds.GOOD).sum()),
        failures=builds.count_failures(status),
        modes=[own for one, own in spreads.items() if one.column == "frequency"],
        coupling=spreads[RATIO],
        static=[own for one, own in spreads.items() if one.column == "static"],
        required=[spreads[one] for one in dict.fromkeys(job.required)],
        signed=spreads[SIGNED],
        ranked=len(kept),
        under=fraction("", RATIO.read(group, rows)[good] < limit, np.flatnonzero(good)),
        yields=tuple(fraction(name, one, every) for name, one in met),
        joint=None if together is None else fraction("all together", together, every),
    )


@dataclass(frozen=True)
class Request:
    """What a results file has of the options, from which its job is made again.

    The seed is a text, since not every HDF5 tool can read seeds up to 2^64 - 1 as numbers.
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


def load(group: Stored, text: str, level: str) -> Summary:
    """Compute the statistics of a group, given its design and the name of its model."""
    known = stored.read(group, Request)
    return summarise(group, known.job(len(group["status"]), text, level), known.limit)


def describe(job: RandomBuilds, limit: float) -> Fill:
    """Write what a file has besides the builds: options, and names and numbers that vary."""
    question, nominal, factors = job.question, job.nominal, job.factors
    request = Request(
        np.array(question.frequency),
        question.input.text,
        question.over.text,
        question.under.text,
        str(job.seed),
        limit,
        job.method,
        job.with_indices,
        tuple(one.text for one in job.requirements) or None,
    )
    table: Table = {
        "mode": ("mode", "1", np.arange(1, len(nominal.label) + 1)),
        "mode_label": ("mode", TEXT, nominal.label),
        "nominal_frequency": ("mode", "Hz", nominal.frequency),
        "factor": ("factor", TEXT, [one.label for one in factors]),
        "factor_unit": ("factor", TEXT, [one.unit for one in factors]),
        "factor_group": ("factor", TEXT, [one.group for one in factors]),
        "stage": ("stage", TEXT, job.scene.bodies.name),
        "static_dof": ("static_dof", TEXT, [*STATIC]),
        "static_unit": ("static_dof", TEXT, [*STATIC.values()]),
        "interval": ("interval", TEXT, ["low", "high"]),
        "quantile": ("quantile", "1", QUANTILES),
    }
    if job.ratios:
        table["response_name"] = ("response_name", TEXT, [one.text for one in job.ratios])
        table["response_unit"] = ("response_name", TEXT, [one.unit for one in job.ratios])
    if job.with_indices:
        table["group"] = ("group", TEXT, job.groups)
        table["result"] = ("result", TEXT, [one.name for one in job.quantities])

    def fill(group: h5py.Group) -> None:
        stored.write(group, request)
        _write(group, table)

    return fill


def complete(path: Path, job: RandomBuilds, limit: float) -> None:
    """Write the statistics into a file with all builds."""
    with h5py.File(path, "r+", locking=False) as file:
        group: Stored = file["tolerance"]
        found = summarise(group, job, limit, ranked=0)
        table: Table = {}
        kinds = ("mean", "mean"), ("mean_error", "error"), ("std", "deviation"), ("quantiles",) * 2
        for name, kind in kinds:
            values = np.array([getattr(one, kind) for one in found.static])
            values = values.reshape(-1, len(STATIC), *values.shape[1:])
            dims = "stage static_dof quantile" if values.ndim > 2 else "stage static_dof"
            table[f"static_{name}"] = (dims, "{static_unit}", values)
        if found.joint is not None:
            table["yield"] = ("requirement", "1", [one.fraction for one in found.yields])
            intervals = [one.interval for one in found.yields]
            table["yield_interval"] = ("requirement interval", "1", intervals)
            group.attrs["yield_of_all"] = found.joint.fraction
            group.attrs["yield_of_all_interval"] = found.joint.interval
        for name, values in found.indices.items():
            table[f"sobol/{name}"] = ("group result", "1", values)
        _write(group, table)


def _write(group: Stored, table: Table) -> None:
    """Write arrays; each scale precedes the arrays that it belongs to."""
    for path, (dims, unit, values) in table.items():
        if dims == path:
            add_scale(group, path, values, unit)
        else:
            add_dataset(group, path, values, unit, *(group[dim] for dim in dims.split()))
