"""What a loop whose filter is to be found has to do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.foton import Filter

if TYPE_CHECKING:
    pass

REACHED = 1e-4
"""Strength of a mode between force and reading, over that of the strongest, from which it is damped
unless another limit is given."""
SMALL = 0.01
"""Difference of two margins to requirements that is none."""


@dataclass(frozen=True)
class Wanted:
    """What a loop has to do.

    Attributes
    ----------
    settling
        Longest time in which the amplitude of a mode falls to 1/e, s.
    sensitivity
        Largest magnitude of the sensitivity.
    output
        Motion whose noise from the sensor is to be least.
    quiet_at
        Frequency of that noise, Hz.
    highest
        Frequency up to which modes are damped, Hz.
    reached
        Strength of a mode, over that of the strongest, from which it is damped.
    margins
        Computes the margins to all that the design requires, of a filter; these count instead of
        the noise.
    """

    settling: float
    sensitivity: float
    output: str
    quiet_at: float
    highest: float
    reached: float = REACHED
    margins: Callable[[Filter], Sequence[float]] | None = None


def rank_margins(wanted: Wanted, made: Filter) -> list[float]:
    """Sort the margins of a filter to what is required, the smallest first, in steps of `SMALL`."""
    assert wanted.margins is not None
    steps = np.round(np.array(wanted.margins(made)) / SMALL)
    return np.sort(SMALL * steps).tolist()
