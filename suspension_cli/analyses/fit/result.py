"""Results of a fit."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.analyses.fit.explanations import Exchange
from suspension_cli.analyses.fit.osem_matrices import OsemFit
from suspension_cli.analyses.fit.response_fit import ResponseFit
from suspension_cli.analyses.record import Record
from suspension_cli.design import reader
from suspension_cli.design.paths import unit_of
from suspension_cli.files.declared import ADDED, ATTRIBUTE, along, derived, in_unit, scale_of
from suspension_cli.files.documents import Layout

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

    from suspension_cli.design.reader import Source

SIGNIFICANCE = 1e-3
"""Probability of a chi^2 this large by chance below which a fit is a misfit."""
SAME = 1e-3
"""Relative difference of chi^2 below which two searches found the same minimum."""
FAR = 3.0
"""Standard deviations of a prior beyond which a value is listed as far from it."""


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
    digits
        Significant digits to which the parameters in `toml` are rounded; 0 if they are not.
    ends
        chi^2 at the end of each search, ascending; the first is that of this fit, not rounded.
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
    matrices
        Sensing and driving matrices; None if not asked for.
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
            "experiment shared covariance direction exchange responses matrices toml design_before"
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
    determined: tuple[str, ...] = ()
    exchange: Exchange | None = None
    measurements: str = ""
    title: str = ""
    responses: ResponseFit | None = None
    matrices: OsemFit | None = None
    digits: int = 0

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
