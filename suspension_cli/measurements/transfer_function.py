"""A measured transfer function."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.files.declared import in_unit

if TYPE_CHECKING:
    from jaxtyping import Complex, Float


@dataclass(frozen=True)
class MeasuredResponse:
    """A measured transfer function with its uncertainty.

    Attributes
    ----------
    name
        Given, or the stem of the file.
    input, output
        Signals of the design (``"upper.force_x"``, ``"upper.x"``), or the actuator and the sensor
        of the file of measurements; "" if unknown (a bare CSV).
    frequency : (f,) array
        Hz, ascending.
    value : (f,) complex array
        Output over input, in the unit `unit`.
    uncertainty : (f,) array
        Standard deviation of real and imaginary part, in the unit of `value`; NaN where unknown.
    coherence : (f,) array
        From 0 to 1; NaN where not measured.
    unit
        Of `value`: "m/N" once all calibration is applied.
    file
        Where it was read, for errors.
    """

    name: str
    input: str
    output: str
    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    value: Complex[np.ndarray, " frequency"] = field(metadata=in_unit("{unit}"))
    uncertainty: Float[np.ndarray, " frequency"] = field(metadata=in_unit("{unit}"))
    coherence: Float[np.ndarray, " frequency"]
    unit: str = ""
    file: str = ""
