"""Statistics of random builds, as a results file has them.

Text, JSON and pictures follow from the file alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np

from suspension_cli.analyses.record import Record
from suspension_cli.analyses.tolerance.build_statistics import Yield, strongest
from suspension_cli.analyses.tolerance.estimates import QUANTILES
from suspension_cli.files import stored
from suspension_cli.files.declared import ATTRIBUTE, NOT_STORED, along, in_unit
from suspension_cli.files.documents import Layout
from suspension_cli.quantities.kinds.poses import STATIC
from suspension_cli.quantities.requirements import Band, displayed_unit
from suspension_cli.studies.builds import GOOD, STATUS

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

    from suspension_cli.analyses.record import Origin

SIGNIFICANT = 3.0
"""Least significant correlation, in standard deviations 1/sqrt(N) of N uncorrelated builds."""
MAX_POINTS = 4000
"""Most builds in figures."""
SIGNED = "coupling with its sign"
"""Name of the part of the cross-coupling along the phase in which it varies most."""
UNIT = in_unit("{result_unit}")
LEADING = 5
"""Most causes, or tolerances, of a quantity that are listed."""
STATISTICS = {
    "mean": "mean",
    "error": "mean_error",
    "deviation": "std",
    "deviation_error": "std_error",
    "quantiles": "quantiles",
    "quantile_errors": "quantile_errors",
}
"""Fields of `Spread` with statistics, and their keys in JSON."""
LISTED = " ".join(STATISTICS)


@dataclass(frozen=True, eq=False)
class Spread:
    """Distribution of one quantity over the builds that have it, in SI units; Hz for modes.

    Attributes
    ----------
    mean, error, deviation, deviation_error
        Mean and standard deviation, each with its standard error.
    quantiles, quantile_errors
        At `QUANTILES`, with their standard errors.
    rank
        Rank correlations with the deviations of numbers; of the coupling without sign, with their
        magnitudes.
    slope
        Slopes of the least-squares lines over these.
    share, share_error, r_squared
        Fraction of the variance that each tolerance causes, its standard error, and that which the
        linear fit explains (`variance_shares`).
    missing, infinite
        Numbers of builds that hang but have no value, and an infinite one.
    reason
        Why a build that hangs may have no value.
    factor
        Names of the numbers that vary.
    sample
        Values of the first builds; NaN where one has none.
    """

    in_json: ClassVar = Layout(
        only=f"name unit {LISTED} leading", names={"name": "quantity"} | STATISTICS
    )
    name: str
    unit: str
    mean: float
    error: float
    deviation: float
    deviation_error: float
    quantiles: Float[np.ndarray, " quantile"]
    quantile_errors: Float[np.ndarray, " quantile"]
    rank: Float[np.ndarray, " factor"]
    slope: Float[np.ndarray, " factor"]
    share: Float[np.ndarray, " group"]
    share_error: Float[np.ndarray, " group"]
    r_squared: float
    missing: int
    infinite: int
    reason: str
    factor: tuple[str, ...]
    sample: Float[np.ndarray, " build"]

    @property
    def displayed(self) -> tuple[str, float]:
        """Unit in which values are shown, "" for ratios, and the factor from SI to it."""
        return displayed_unit(self.unit)

    @property
    def leading(self) -> tuple[tuple[str, float], ...]:
        """Numbers with the strongest rank correlations, and these."""
        chosen = strongest(self.rank, LEADING)
        return tuple((self.factor[n], float(self.rank[n])) for n in chosen)


@dataclass(frozen=True, eq=False)
class ModeSpread(Spread):
    """Distribution of the frequency of a mode, Hz."""

    in_json: ClassVar = Layout(
        only=f"name {LISTED} nominal leading",
        names={"name": "label"} | {name: f"{key}_hz" for name, key in STATISTICS.items()},
    )
    nominal: float = field(metadata=in_unit("Hz"))


@dataclass(frozen=True, eq=False)
class CouplingSpread(Spread):
    """Distribution of the magnitude of the cross-coupling, and the fraction below the limit.

    `leading_signed` are the leading causes of the coupling with its sign; for the others see
    `Tolerance`.
    """

    in_json: ClassVar = Layout(
        only="ratio frequency limit fraction_under_limit fraction_under_limit_interval"
        f" fraction_under_limit_error {LISTED} leading leading_signed",
        names=STATISTICS,
    )
    ratio: str
    frequency: float = field(metadata=in_unit("Hz"))
    limit: float
    fraction_under_limit: float
    fraction_under_limit_interval: tuple[float, float]
    fraction_under_limit_error: float
    leading_signed: tuple[tuple[str, float], ...]


@dataclass(frozen=True, eq=False)
class CountedSpread(Spread):
    """Distribution of a quantity that some builds may not have."""

    in_json: ClassVar = Layout(
        only=f"name unit {LISTED} missing infinite reason leading",
        names={"name": "quantity"} | STATISTICS,
    )


AnySpread = TypeVar("AnySpread", bound=Spread)


@dataclass(frozen=True, eq=False)
class VarianceShares:
    """Fractions of the variance of each result that each tolerance causes; see `Spread`."""

    in_json: ClassVar = Layout(names={"group": "tolerances", "result": "results"})
    group: tuple[str, ...]
    result: tuple[str, ...]
    share: Float[np.ndarray, "result group"]
    share_error: Float[np.ndarray, "result group"]
    r_squared: Float[np.ndarray, " result"]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Tolerance(Record):
    """Statistics of random builds.

    Attributes
    ----------
    seed, builds, good
        Seed of the random numbers, number of builds, and of those that hang on taut wires.
    factor, factor_unit, factor_group, group
        Numbers that vary, and the tolerance that each belongs to.
    coupling_frequency, input, over_signal, under_signal
        The cross-coupling.
    limit, fraction_under_limit, fraction_under_limit_interval, fraction_under_limit_error
        Limit on the cross-coupling, and the fraction with a smaller one among the builds that hang
        and have one, with its 95 % confidence interval and its standard error.
    precision, largest_error, largest_error_of
        The standard error that was asked for (0: none); the largest one of the coupling, of
        quantities with requirements and of those asked for, over the spread of each, or of a yield;
        and of what it is.
    quantity
        Names of the quantities of builds: modes, coupling, static poses, and others.
    result
        Those names, and the coupling with its sign.
    missing, infinite, missing_reason
        How many builds that hang have no value or an infinite one, and why they may have none.
    result_mean, result_std, result_quantiles
        Statistics over the builds with a finite value.
    result_error, result_std_error, result_quantile_errors
        Their standard errors.
    ranked
        Number of first builds in `rank`, `slope` and `share`.
    requirement, requirement_name, requirement_quantity, low, high, of_magnitude, open
        What is required: as for ``--require``, in usual units, of which quantity, and its limits.
    yields, yield_interval, yield_error
        Fractions of builds that meet each requirement, with 95 % confidence intervals and standard
        errors.
    yield_of_all, yield_of_all_interval, yield_of_all_error
        The same for all requirements together.
    labelled, shared_count
        Modes that are meant by their motion, and in how many builds another mode shares that.
    sample
        Quantities of the first builds, for histograms.
    """

    in_json: ClassVar = Layout(
        only="builds good failures seed_number wanted_precision largest_error largest_error_of"
        " quantile significant modes coupling static others yields joint variance_shares",
        names={
            "seed_number": "seed",
            "wanted_precision": "precision",
            "quantile": "levels",
            "significant": "significant_correlation",
            "static": "statics",
            "others": "results",
            "yields": "requirements",
            "joint": "all_requirements",
        },
    )
    seed: str  # not every HDF5 tool can read seeds up to 2^64 - 1 as numbers
    builds: int
    good: int
    status_meaning: tuple[str, ...] = field(default=STATUS, metadata=ATTRIBUTE)
    status_count: tuple[int, ...]
    input: str
    over_signal: str = field(metadata=in_unit("", name="over"))
    under_signal: str = field(metadata=in_unit("", name="under"))
    limit: float
    fraction_under_limit: float
    fraction_under_limit_interval: tuple[float, float]
    fraction_under_limit_error: float
    precision: float
    largest_error: float
    largest_error_of: str
    ranked: int
    coupling_frequency: Float[np.ndarray, " coupling_frequency"] = field(metadata=in_unit("Hz"))
    factor: tuple[str, ...]
    factor_unit: tuple[str, ...] = field(metadata=along("factor"))
    factor_group: tuple[str, ...] = field(metadata=along("factor"))
    group: tuple[str, ...]
    mode: Int[np.ndarray, " mode"]
    mode_label: tuple[str, ...] = field(metadata=along("mode"))
    nominal_frequency: Float[np.ndarray, " mode"] = field(metadata=in_unit("Hz"))
    stage: tuple[str, ...]
    quantity: tuple[str, ...]
    quantity_unit: tuple[str, ...] = field(metadata=along("quantity"))
    result: tuple[str, ...]
    result_unit: tuple[str, ...] = field(metadata=along("result"))
    missing: Int[np.ndarray, " result"]
    infinite: Int[np.ndarray, " result"]
    missing_reason: tuple[str, ...] = field(metadata=along("result"))
    quantile: Float[np.ndarray, " quantile"] = field(default_factory=lambda: np.array(QUANTILES))
    result_mean: Float[np.ndarray, " result"] = field(metadata=UNIT)
    result_error: Float[np.ndarray, " result"] = field(metadata=UNIT)
    result_std: Float[np.ndarray, " result"] = field(metadata=UNIT)
    result_std_error: Float[np.ndarray, " result"] = field(metadata=UNIT)
    result_quantiles: Float[np.ndarray, "result quantile"] = field(metadata=UNIT)
    result_quantile_errors: Float[np.ndarray, "result quantile"] = field(metadata=UNIT)
    rank: Float[np.ndarray, "result factor"]
    slope: Float[np.ndarray, "result factor"] = field(
        metadata=in_unit("{result_unit}/{factor_unit}")
    )
    share: Float[np.ndarray, "result group"]
    share_error: Float[np.ndarray, "result group"]
    r_squared: Float[np.ndarray, " result"]
    interval: tuple[str, ...] = ("low", "high")
    requirement: tuple[str, ...] | None = None
    requirement_name: tuple[str, ...] | None = field(default=None, metadata=along("requirement"))
    requirement_quantity: tuple[str, ...] | None = field(
        default=None, metadata=along("requirement")
    )
    low: Float[np.ndarray, " requirement"] | None = field(default=None, metadata=in_unit("SI"))
    high: Float[np.ndarray, " requirement"] | None = field(default=None, metadata=in_unit("SI"))
    of_magnitude: Bool[np.ndarray, " requirement"] | None = None
    open: Bool[np.ndarray, " requirement"] | None = None
    yield_: Float[np.ndarray, " requirement"] | None = field(
        default=None, metadata=in_unit("", name="yield")
    )
    yield_interval: Float[np.ndarray, "requirement interval"] | None = None
    yield_error: Float[np.ndarray, " requirement"] | None = None
    yield_of_all: float | None = None
    yield_of_all_interval: tuple[float, float] | None = None
    yield_of_all_error: float | None = None
    labelled: tuple[str, ...] | None = None
    shared_count: Int[np.ndarray, " labelled"] | None = None
    sample: Float[np.ndarray, "build quantity"] | None = field(default=None, metadata=NOT_STORED)

    @property
    def failures(self) -> dict[str, int]:
        """Number of builds by reason of failure."""
        counts = zip(self.status_meaning, self.status_count, strict=True)
        return {
            reason: count
            for number, (reason, count) in enumerate(counts)
            if number != GOOD and count
        }

    @property
    def seed_number(self) -> int:
        """Seed of the random numbers."""
        return int(self.seed)

    @property
    def wanted_precision(self) -> float | None:
        """The standard error that was asked for; None if none was."""
        return self.precision or None

    @property
    def modes(self) -> tuple[ModeSpread, ...]:
        """Distributions of the frequencies of modes, Hz."""
        return tuple(
            self._spread(n, ModeSpread, nominal=nominal)
            for n, nominal in enumerate(self.nominal_frequency.tolist())
        )

    @property
    def coupling(self) -> CouplingSpread:
        """Distribution of the magnitude of the cross-coupling."""
        return self._spread(
            len(self.mode),
            CouplingSpread,
            ratio=self.ratio,
            frequency=self.frequency,
            limit=self.limit,
            fraction_under_limit=self.fraction_under_limit,
            fraction_under_limit_interval=self.fraction_under_limit_interval,
            fraction_under_limit_error=self.fraction_under_limit_error,
            leading_signed=self.signed.leading,
        )

    @property
    def signed(self) -> Spread:
        """Distribution of the cross-coupling with its sign."""
        return self.spread_of(SIGNED)

    @property
    def static(self) -> tuple[Spread, ...]:
        """Distributions of static displacements (m) and rotations (rad) of the stages."""
        start = len(self.mode) + 1
        stop = start + len(STATIC) * len(self.stage)
        return tuple(self._spread(n, Spread) for n in range(start, stop))

    @property
    def others(self) -> tuple[CountedSpread, ...]:
        """Distributions of the quantities that are asked for, beside all these."""
        start = len(self.mode) + 1 + len(STATIC) * len(self.stage)
        return tuple(self._spread(n, CountedSpread) for n in range(start, len(self.quantity)))

    @property
    def variance_shares(self) -> VarianceShares:
        """Fractions of variances that tolerances cause."""
        return VarianceShares(self.group, self.result, self.share, self.share_error, self.r_squared)

    @property
    def required(self) -> list[Spread]:
        """Distributions of the quantities with requirements, each once."""
        names = dict.fromkeys(self.requirement_quantity or ())
        return [self.spread_of(name) for name in names]

    @property
    def bands(self) -> list[Band]:
        """Values that meet each requirement."""
        if self.low is None or self.high is None or self.of_magnitude is None or self.open is None:
            return []
        columns = self.low, self.high, self.of_magnitude, self.open
        rows = zip(*(column.tolist() for column in columns), strict=True)
        return [Band(*row) for row in rows]

    @property
    def under(self) -> Yield:
        """Fraction of the builds that hang with a coupling below the limit."""
        return Yield(
            "",
            self.fraction_under_limit,
            self.fraction_under_limit_interval,
            self.fraction_under_limit_error,
        )

    @property
    def yields(self) -> tuple[Yield, ...]:
        """Yield of each requirement."""
        if self.yield_ is None or self.yield_interval is None or self.yield_error is None:
            return ()
        columns = self.yield_, self.yield_interval, self.yield_error
        rows = zip(
            self.requirement_name or (), *(column.tolist() for column in columns), strict=True
        )
        return tuple(
            Yield(name, share, (low, high), error) for name, share, (low, high), error in rows
        )

    @property
    def joint(self) -> Yield | None:
        """Yield of all requirements together; None without requirements."""
        interval = self.yield_of_all_interval
        if self.yield_of_all is None or interval is None or self.yield_of_all_error is None:
            return None
        return Yield("all together", self.yield_of_all, interval, self.yield_of_all_error)

    @property
    def shared(self) -> dict[str, int]:
        """Number of builds in which another mode shares the motion of a mode, where any does."""
        if self.labelled is None or self.shared_count is None:
            return {}
        pairs = zip(self.labelled, self.shared_count.tolist(), strict=True)
        return {name: count for name, count in pairs if count}

    @property
    def mean(self) -> Float[np.ndarray, " mode"]:
        """Mean of each mode frequency, Hz."""
        return self.result_mean[: len(self.mode)]

    @property
    def spread(self) -> Float[np.ndarray, " mode"]:
        """Standard deviation of each mode frequency, Hz."""
        return self.result_std[: len(self.mode)]

    @property
    def quantiles(self) -> Float[np.ndarray, "mode quantile"]:
        """Quantiles of each mode frequency at `QUANTILES`, Hz."""
        return self.result_quantiles[: len(self.mode)]

    @property
    def ratio(self) -> str:
        """Name of the cross-coupling, ``test.x / test.z``."""
        return f"{self.over_signal} / {self.under_signal}"

    @property
    def frequency(self) -> float:
        """Frequency of the cross-coupling, Hz."""
        return float(self.coupling_frequency[-1])

    @property
    def significant(self) -> float:
        """Least significant rank correlation, 3/sqrt(N) of N builds."""
        return SIGNIFICANT / np.sqrt(self.ranked) if self.ranked else np.inf

    def spread_of(self, name: str) -> Spread:
        """Distribution of one quantity by its name."""
        return self._spread(self.result.index(name), Spread)

    def _spread(self, n: int, kind: type[AnySpread], **more: Any) -> AnySpread:
        """Distribution of the quantity of a number; `more` are fields of its class."""
        empty = np.zeros(0)
        has_sample = self.sample is not None and n < len(self.quantity)
        return kind(
            name=self.result[n],
            unit=self.result_unit[n],
            mean=float(self.result_mean[n]),
            error=float(self.result_error[n]),
            deviation=float(self.result_std[n]),
            deviation_error=float(self.result_std_error[n]),
            quantiles=self.result_quantiles[n],
            quantile_errors=self.result_quantile_errors[n],
            rank=self.rank[n],
            slope=self.slope[n],
            share=self.share[n],
            share_error=self.share_error[n],
            r_squared=float(self.r_squared[n]),
            missing=int(self.missing[n]),
            infinite=int(self.infinite[n]),
            reason=self.missing_reason[n],
            factor=self.factor,
            sample=self.sample[:, n] if has_sample and self.sample is not None else empty,
            **more,
        )


def load(group: Any, run: Origin) -> Tolerance:
    """Read the statistics of a group, with the first builds for figures."""
    sample = np.asarray(group["value"][:MAX_POINTS])
    return stored.read(group, Tolerance, sample=sample, run=run)
