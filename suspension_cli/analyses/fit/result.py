"""Results of a fit."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.analyses.record import Record
from suspension_cli.conventions import DOFS
from suspension_cli.design import reader
from suspension_cli.design.paths import unit_of
from suspension_cli.files.declared import ADDED, ATTRIBUTE, SI, along, derived, in_unit, scale_of
from suspension_cli.files.documents import Layout
from suspension_cli.measurements.transfer_function import TABLES, Channels

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

    from suspension_cli.design.reader import Source

SIGNIFICANCE = 1e-3
"""Probability of a chi^2 this large by chance below which a fit is a misfit."""
SAME = 1e-3
"""Relative difference of chi^2 below which two searches found the same minimum."""
FAR = 3.0
"""Standard deviations of a prior beyond which a value is listed as far from it."""
SIGN, EXCHANGE, FACTOR = "sign", "exchange", "factor"
KNOWN_FACTORS = (
    (1e6, "micro against SI units"),
    (1e3, "milli against SI units"),
    (180 / math.pi, "degrees against radians"),
    (math.sqrt(10), "the root of 10: a missing calibration, or 10 dB"),
    (10.0, "20 dB"),
    (2 * math.pi, "2 pi: Hz against rad/s"),
    (4.0, "4"),
    (2.0, "2: peak to peak, or one of two coils"),
    (math.sqrt(2), "the root of 2: peak against rms"),
)
"""Usual errors of calibrations."""
NEAR_FACTOR = 0.06
"""Difference of ln to one of these up to which it is named."""


@dataclass(frozen=True)
class Correction:
    """A change of one channel (`side` 0: a sensor, 1: an actuator), or of two that are exchanged.

    `kind` is ``"sign"``, ``"exchange"`` or ``"factor"``, `factor` that on the gain. `known` says
    whether the file of measurements claims otherwise, `also` names another channel whose change
    explains the data as well. `chi_squared` is that of the fitted parameters without this change.
    """

    in_json: ClassVar = Layout(
        names={
            "channel": "channels",
            "known": "claimed_otherwise",
            "chi_squared": "chi_squared_without",
        },
        also="text",
    )
    kind: str
    side: int
    channel: tuple[str, ...]
    factor: float = 1.0
    known: bool = True
    also: str = ""
    chi_squared: float = math.nan

    def apply(self, channels: Channels, *, undo: bool = False) -> Channels:
        """Make the change, or undo it."""
        if self.kind == EXCHANGE:
            return channels.with_exchange(self.side, *self.channel)
        name = self.channel[0]
        factor = 1 / self.factor if undo else self.factor
        gain = channels.transducer[self.side][name].gain * factor
        return channels.with_transducer(self.side, name, gain=gain)

    @property
    def what(self) -> str:
        """The channels in words."""
        return f"{TABLES[self.side]}{'s' * (len(self.channel) - 1)} {' and '.join(self.channel)}"

    @property
    def text(self) -> str:
        """The change in words."""
        if self.kind == EXCHANGE:
            other = f" (or {self.also})" if self.also else ""
            return f"{self.what} are exchanged{other}"
        what = f"{self.what} (or of {self.also})" if self.also else self.what
        if self.kind == SIGN:
            return f"the sign of {what} is {'wrong' if self.known else 'negative'}"
        return f"the gain of {what} is {name_factor(self.factor)} times the one given"


def name_factor(factor: float) -> str:
    """Name a factor and its usual cause.

    >>> name_factor(3.15)
    '3.15 (the root of 10: a missing calibration, or 10 dB)'
    """
    for value, name in KNOWN_FACTORS:
        for known, form in ((value, name), (1 / value, f"inverse of {name}")):
            if abs(math.log(abs(factor) / known)) < NEAR_FACTOR:
                return f"{factor:.3g} ({form})"
    return f"{factor:.3g}"


@dataclass(frozen=True)
class Exchange:
    """Two labels of an experiment (from 0) that fit better exchanged, and chi^2 of that fit."""

    experiment: int
    labels: tuple[str, str]
    chi_squared: float


@dataclass(frozen=True)
class SingleChange:
    """Fit with one parameter of the design free (its path, value and change, SI)."""

    name: str
    start: float
    change: float
    chi_squared: float


@dataclass(frozen=True)
class MissingLink:
    """A link that the design lacks, with which it fits better.

    `between` are its bodies, `stiffness` that along x, y, z and about these axes at the centre of
    mass of the first stage (N/m, N m/rad; 0 where the data do not show it), `chi_squared` that of
    the fit with the link.
    """

    between: tuple[str, str]
    stiffness: tuple[float, ...]
    chi_squared: float

    @property
    def text(self) -> str:
        """The link in words."""
        units = ("N/m",) * 3 + ("N m/rad",) * 3
        parts = [
            f"{size:.3g} {unit} ({dof})"
            for size, unit, dof in zip(self.stiffness, units, DOFS, strict=True)
            if size
        ]
        return f"between {' and '.join(self.between)} of stiffness {', '.join(parts)}"


@dataclass(frozen=True)
class Candidate:
    """A measurement (input and output signals, band in Hz) that would determine a parameter better.

    `sigma` is the standard deviation of that parameter with this measurement.
    """

    in_json: ClassVar = Layout(names={"band": "band_hz"})
    input: str
    output: str
    band: tuple[float, float]
    sigma: float


RESONANCE = dict.fromkeys(("measured", "sigma", "before", "after"), "Hz")
RESONANCE |= dict.fromkeys(("q", "functions"), "1")
"""Columns of measured resonances, and their units."""


@dataclass(frozen=True)
class ResponseFit:
    """Measured transfer functions and a fit to them.

    Attributes
    ----------
    function, input, output, unit
        Names of the functions and of their channels, and units of their values.
    of
        Function of each point.
    frequency, uncertainty, measured, before, after
        Hz, and readings per drive as measured, and as predicted before and after the fit.
    nuisance
        Fitted properties of sensors and actuators: keys, values (relative for gains, s for
        delays), and standard deviations after the fit and of the priors.
    mode, resonance
        Modes with a measured resonance: frequency as measured, its standard deviation, before and
        after (Hz), measured Q, number of functions with it.
    chi_squared_before
        chi^2 of the design as given, with the properties of channels fitted.
    corrections
        Wrong channels.
    changes
        Single changes that explain most, best first.
    least
        A parameter that is known least; "" if none is free.
    candidates
        Measurements that would determine it best, best first.
    links
        In a misfit, links that the design lacks and that would explain it, best first.
    """

    in_json: ClassVar = Layout(
        rows={"function": "transfer_functions", "nuisance": "channels"},
        names={
            "function": "name",
            "points": "frequencies",
            "nuisance": "name",
            "nuisance_value": "change",
            "nuisance_sigma": "sigma",
            "nuisance_prior": "prior_sigma",
            "corrections": "wrong_channels",
            "changes": "single_changes",
            "links": "missing_links",
            "least": "least_known",
            "candidates": "measure_next",
        },
        without=(
            "of frequency uncertainty measured before after mode resonance resonance_column"
            " resonance_unit"
        ),
        also="points chi_squared",
    )
    function: tuple[str, ...]
    input: tuple[str, ...] = field(metadata=along("function"))
    output: tuple[str, ...] = field(metadata=along("function"))
    unit: tuple[str, ...] = field(metadata=along("function"))
    of: Int[np.ndarray, " number"]
    frequency: Float[np.ndarray, " number"] = field(metadata=in_unit("Hz"))
    uncertainty: Float[np.ndarray, " number"] = field(metadata=in_unit(SI))
    measured: Complex[np.ndarray, " number"] = field(metadata=in_unit(SI))
    before: Complex[np.ndarray, " number"] = field(metadata=in_unit(SI))
    after: Complex[np.ndarray, " number"] = field(metadata=in_unit(SI))
    nuisance: tuple[str, ...]
    nuisance_value: Float[np.ndarray, " nuisance"] = field(metadata=in_unit(SI))
    nuisance_sigma: Float[np.ndarray, " nuisance"] = field(metadata=in_unit(SI))
    nuisance_prior: Float[np.ndarray, " nuisance"] = field(metadata=in_unit(SI))
    mode: tuple[str, ...]
    resonance: Float[np.ndarray, "mode resonance_column"] = field(
        metadata=in_unit("{resonance_unit}")
    )
    chi_squared_before: float = float("nan")
    corrections: tuple[Correction, ...] = ()
    changes: tuple[SingleChange, ...] = ()
    least: str = ""
    candidates: tuple[Candidate, ...] = ()
    links: tuple[MissingLink, ...] = ()

    @property
    @derived()
    def resonance_column(self) -> tuple[str, ...]:
        """Columns of `resonance`."""
        return tuple(RESONANCE)

    @property
    @derived(along="resonance_column")
    def resonance_unit(self) -> tuple[str, ...]:
        """Unit of each column of `resonance`."""
        return tuple(RESONANCE.values())

    @property
    def chi_squared(self) -> Float[np.ndarray, " function"]:
        """chi^2 of each function after the fit."""
        return self.chi_squared_of(self.after)

    def chi_squared_of(
        self, values: Complex[np.ndarray, " number"]
    ) -> Float[np.ndarray, " function"]:
        """chi^2 of each function with these values."""
        off = np.abs((values - self.measured) / self.uncertainty) ** 2
        return np.bincount(self.of, off, len(self.function)).astype(float)

    @property
    def points(self) -> Int[np.ndarray, " function"]:
        """Number of frequencies of each function."""
        return np.bincount(self.of, minlength=len(self.function))


@dataclass(frozen=True, eq=False)
class Fitted:
    """Parameters of designs fitted to measured modes, quantities and transfer functions.

    Attributes
    ----------
    experiment
        Names of the experiments; that of the design if there is one.
    name, shared
        Dotted paths of the fitted parameters, and the experiments to which each belongs.
    start, value, sigma, covariance
        Values before and after the fit, standard deviations (infinite where not determined, NaN at
        a bound) and covariance, SI; in a misfit larger than the given uncertainties imply.
    scale
        Factor on `sigma` in a misfit, the root of chi^2 per degree of freedom (Birge, Phys. Rev.
        40, 207 (1932)), else 1; also 1 without degrees of freedom.
    prior, prior_sigma
        Priors and their standard deviations, infinite where there is none.
    of, label
        Experiment of each measured mode, from 0, and its label.
    measured, uncertainty, before, after
        Frequencies, Hz; NaN for an unstable mode.
    value_of, quantity, quantity_unit
        Experiment of each measured quantity, from 0, its name and SI unit.
    value_measured, value_uncertainty, value_before, value_after
        Measured quantities, SI.
    chi_squared, freedom
        Sum over measurements and priors; and their number less that of unknowns not at a bound.
    singular, direction
        Singular values of the derivatives of the weighted measurements by relative changes of the
        parameters; 1/singular is the relative uncertainty of the combination `direction`.
    toml, design_before
        Designs after and before the fit as TOML.
    ends
        chi^2 at the end of each search, ascending; the first is that of this fit, not rounded.
    rounding
        By how many of its uncertainties rounding the parameters may change a residual; 0 if they
        are not rounded.
    determined
        Sentences on what the data determine without priors, and what not.
    exchange
        In a misfit, two labels that fit better exchanged.
    measurements
        Text of the file of measurements.
    title
        Title of the design, or of the measurements of several designs.
    responses
        Fit of transfer functions; None if none were measured.
    """

    in_json: ClassVar = Layout(
        rows={"parameter": "parameters", "mode": "modes", "measured_quantity": "quantities"},
        names={
            "name": "name",
            "parameter_unit": "unit",
            "of": "experiment",
            "value_of": "experiment",
            "quantity": "name",
            "quantity_unit": "unit",
            "value_measured": "measured",
            "value_uncertainty": "uncertainty",
            "value_before": "before",
            "value_after": "after",
            "value_residual": "residual",
            "freedom": "degrees_of_freedom",
            "singular": "singular_values",
            "ends": "chi_squared_of_starts",
            "prior_chi_squared": "chi_squared_of_priors",
        },
        without=(
            "experiment shared covariance direction exchange responses toml design_before rounding"
            " measurements title stem joint design_file measured_file other_parameter other_unit"
        ),
        also="prior_chi_squared",
    )
    experiment: tuple[str, ...]
    name: tuple[str, ...] = field(metadata=scale_of("parameter"))
    shared: Bool[np.ndarray, "parameter experiment"]
    start: Float[np.ndarray, " parameter"] = field(metadata=in_unit("{parameter_unit}"))
    value: Float[np.ndarray, " parameter"] = field(metadata=in_unit("{parameter_unit}"))
    sigma: Float[np.ndarray, " parameter"] = field(metadata=in_unit("{parameter_unit}"))
    prior: Float[np.ndarray, " parameter"] = field(metadata=in_unit("{parameter_unit}"))
    prior_sigma: Float[np.ndarray, " parameter"] = field(metadata=in_unit("{parameter_unit}"))
    covariance: Float[np.ndarray, "parameter other_parameter"] = field(
        metadata=in_unit("{parameter_unit} {other_unit}")
    )
    scale: float = field(metadata=in_unit("", name="sigma_scale"))
    at_bound: Bool[np.ndarray, " parameter"]
    of: Int[np.ndarray, " mode"]
    label: tuple[str, ...] = field(metadata=along("mode"))
    measured: Float[np.ndarray, " mode"] = field(metadata=in_unit("Hz"))
    uncertainty: Float[np.ndarray, " mode"] = field(metadata=in_unit("Hz"))
    before: Float[np.ndarray, " mode"] = field(metadata=in_unit("Hz"))
    after: Float[np.ndarray, " mode"] = field(metadata=in_unit("Hz"))
    value_of: Int[np.ndarray, " measured_quantity"]
    quantity: tuple[str, ...] = field(metadata=along("measured_quantity"))
    quantity_unit: tuple[str, ...] = field(metadata=along("measured_quantity"))
    value_measured: Float[np.ndarray, " measured_quantity"] = field(
        metadata=in_unit("{quantity_unit}")
    )
    value_uncertainty: Float[np.ndarray, " measured_quantity"] = field(
        metadata=in_unit("{quantity_unit}")
    )
    value_before: Float[np.ndarray, " measured_quantity"] = field(
        metadata=in_unit("{quantity_unit}")
    )
    value_after: Float[np.ndarray, " measured_quantity"] = field(
        metadata=in_unit("{quantity_unit}")
    )
    chi_squared: float
    freedom: int
    singular: Float[np.ndarray, " combination"]
    direction: Float[np.ndarray, "combination parameter"]
    toml: tuple[str, ...] = field(metadata=along("experiment", name="fitted_design"))
    design_before: tuple[str, ...] = field(metadata=along("experiment", name="design"))
    ends: Float[np.ndarray, " search"]
    rounding: float = 0.0
    determined: tuple[str, ...] = ()
    exchange: Exchange | None = None
    measurements: str = ""
    title: str = ""
    responses: ResponseFit | None = None

    @property
    @derived(along="parameter")
    def parameter_unit(self) -> tuple[str, ...]:
        """SI unit of each parameter."""
        return tuple(unit_of(name) or "1" for name in self.name)

    @property
    @derived()
    def other_parameter(self) -> tuple[str, ...]:
        """Columns of the covariance."""
        return self.name

    @property
    @derived(along="other_parameter")
    def other_unit(self) -> tuple[str, ...]:
        """SI unit of each column of the covariance."""
        return self.parameter_unit

    @property
    @derived()
    def misfit(self) -> bool:
        """Whether measurements, or priors alone, disagree with the fit beyond chance."""
        return self.unlikely or self.unlikely_priors

    @property
    def unlikely(self) -> bool:
        """Whether so large a chi^2 has a probability below `SIGNIFICANCE`."""
        unknowns = int((~self.at_bound).sum())  # others matter only where data abound
        return is_unlikely(self.chi_squared, self.freedom + unknowns, unknowns)

    @property
    def pulls(self) -> list[tuple[str, float]]:
        """Priors of parameters and channels, and the distance of the fit in standard deviations."""
        pull = (self.value - self.prior) / self.prior_sigma
        known = np.isfinite(self.prior_sigma)
        found = [(self.parameters[n], float(pull[n])) for n in np.flatnonzero(known)]
        if self.responses is not None:
            channels = self.responses.nuisance_value / self.responses.nuisance_prior
            found += zip(self.responses.nuisance, channels.tolist(), strict=True)
        return found

    @property
    def prior_chi_squared(self) -> float:
        """chi^2 of the priors alone."""
        return sum(pull**2 for _, pull in self.pulls)

    @property
    def unlikely_priors(self) -> bool:
        """Whether so large a chi^2 of the priors has a probability below `SIGNIFICANCE`.

        Parameters that the data determine are distributed as their priors say if these are right;
        all others stay at them.
        """
        return is_unlikely(self.prior_chi_squared, len(self.pulls), 0)

    @property
    def excess(self) -> float:
        """What chi^2, of all or of the priors, has too much."""
        of_priors = self.prior_chi_squared - len(self.pulls)
        return max(self.chi_squared - self.freedom, of_priors)

    @property
    def far(self) -> list[tuple[str, float]]:
        """Parameters and channels beyond `FAR` standard deviations of their priors, worst first."""
        far = [item for item in self.pulls if abs(item[1]) > FAR]
        return sorted(far, key=lambda item: -abs(item[1]))

    @property
    @derived()
    def residual(self) -> Float[np.ndarray, " mode"]:
        """Residuals after the fit over the uncertainties."""
        return (self.after - self.measured) / self.uncertainty

    @property
    @derived()
    def value_residual(self) -> Float[np.ndarray, " measured_quantity"]:
        """Residuals of quantities after the fit over the uncertainties."""
        return (self.value_after - self.value_measured) / self.value_uncertainty

    @property
    def worst(self) -> tuple[str, float]:
        """Name and residual of the mode, quantity or prior that is farthest off, over its error."""
        modes = zip(self.modes, self.residual.tolist(), strict=True)
        quantities = zip(self.quantities, self.value_residual.tolist(), strict=True)
        return max([*modes, *quantities, *self.pulls], key=lambda item: abs(item[1]))

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of the measured quantities, preceded by the experiment if there are several."""
        if len(self.experiment) == 1:
            return self.quantity
        pairs = zip(self.value_of, self.quantity, strict=True)
        return tuple(f"{self.experiment[n]}: {name}" for n, name in pairs)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters, followed by their experiments unless these are all."""
        whose = [", ".join(np.array(self.experiment)[row]) for row in self.shared]
        return tuple(
            name if row.all() else f"{name} ({who})"
            for name, row, who in zip(self.name, self.shared, whose, strict=True)
        )

    @property
    def modes(self) -> tuple[str, ...]:
        """Labels of the measured modes, preceded by the experiment if there are several."""
        if len(self.experiment) == 1:
            return self.label
        pairs = zip(self.of, self.label, strict=True)
        return tuple(f"{self.experiment[n]}: {label}" for n, label in pairs)


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Record, Fitted):
    """A fit of designs to measurements, and the run; `run.design` is the first one as given.

    Attributes
    ----------
    stem
        Stem of the names of its files.
    joint
        Whether the file of measurements names the designs.
    design_file
        File of the design of each experiment.
    measured_file
        Path of the file of measurements.
    """

    stem: str = field(default="", metadata=ADDED)
    joint: bool = field(default=False, metadata=ADDED)
    design_file: tuple[str, ...] = field(default=(), metadata=ATTRIBUTE | ADDED)
    measured_file: str = field(default="", metadata=ADDED)

    @property
    def design(self) -> Source:
        """The fitted design; of several experiments that of the first (all are in `designs`)."""
        return self.designs[0]

    @property
    def designs(self) -> tuple[Source, ...]:
        """The fitted design of each experiment."""
        return tuple(reader.with_text(self.run.design, text) for text in self.toml)


def is_unlikely(chi_squared: float, data: int, unknowns: int) -> bool:
    """Whether so large a chi^2 of data and priors has a probability below `SIGNIFICANCE`.

    Its degrees of freedom are the data less the unknowns. Where none is left, chi^2 at the best fit
    is still at most that of the true unknowns, which has one degree of freedom per datum.
    """
    from scipy.special import chdtrc

    if not data:
        return False
    freedom = data - unknowns
    return float(chdtrc(freedom if freedom > 0 else data, chi_squared)) < SIGNIFICANCE
