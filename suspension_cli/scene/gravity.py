"""Gravity other than a uniform pull along -z: a tilted table, another planet, a gradient."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.derive import gravity_field
from suspension_cli.design.schema import Design

if TYPE_CHECKING:
    from jaxtyping import Inexact


@dataclass(frozen=True)
class Field:
    """Acceleration due to gravity, vector + gradient r, at r from the suspension point.

    Attributes
    ----------
    vector
        m/s^2.
    gradient
        1/s^2, symmetric (gravity is conservative).
    """

    vector: Inexact[np.ndarray, " 3"]
    gradient: Inexact[np.ndarray, "3 3"]

    @property
    def is_uniform(self) -> bool:
        """Whether the gradient is 0."""
        return not self.gradient.any()

    def has_mirror(self, axis: int) -> bool:
        """Whether the field is its own mirror image in x (axis 0) or y (1)."""
        others = np.arange(3) != axis
        return bool(self.vector[axis] == 0 and not self.gradient[axis, others].any())


def field_of(design: Design) -> Field | None:
    """Make the field of a design; None if it is uniform along -z."""
    found = gravity_field(design)
    return None if found is None else Field(*map(np.array, found))
