"""A measured transfer function."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Complex, Float


@dataclass(frozen=True)
class MeasuredResponse:
    """A transfer function that was measured at some frequencies, with its uncertainty.

    Attributes
    ----------
    name
        Shown in tables and pictures: the given name, or the stem of the file.
    input, output
        Signals of the design (``"upper.force_x"``, ``"upper.x"``) or names of the actuator and the
        sensor of the file of measurements; "" where the file does not say (a bare CSV).
    frequency : (f,) array
        Hz, ascending.
    value : (f,) complex array
        Output over input, in the unit `unit`.
    uncertainty : (f,) array
        Standard deviation of the real and of the imaginary part, in the unit of `value`; NaN where
        the file says nothing of it.
    coherence : (f,) array
        From 0 to 1; NaN where it was not measured.
    unit
        Of `value`: "m/N" once all calibration is applied.
    file
        Where it was read, for errors.
    """

    name: str
    input: str
    output: str
    frequency: Float[np.ndarray, " frequency"]
    value: Complex[np.ndarray, " frequency"]
    uncertainty: Float[np.ndarray, " frequency"]
    coherence: Float[np.ndarray, " frequency"]
    unit: str = ""
    file: str = ""
