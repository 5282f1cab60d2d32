"""What a fit says of measured transfer functions."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.analyses.fit.explanations import Correction, MissingLink, SingleChange
from suspension_cli.files.declared import SI, along, derived, in_unit
from suspension_cli.files.documents import Layout

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Int

RESONANCE = dict.fromkeys(("measured", "sigma", "before", "after"), "Hz")
RESONANCE |= dict.fromkeys(("q", "functions"), "1")
"""Columns of measured resonances, and their units."""


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
