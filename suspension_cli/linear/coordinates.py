"""Coordinates that are added to a linear system: their names, units and matrices.

>>> frame = AddedCoordinates(
...     name=("frame.x",), unit=("m",), momentum_unit=("N s",),
...     mass=np.diag([50.0]), stiffness=np.diag([1e6]), damping=np.diag([0.0]),
... )
>>> frame.count
1
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from jaxtyping import Float, Inexact

MOMENTUM_UNIT = {"m": "N s", "rad": "N m s"}
"""Unit of the momentum of a displacement, and of a rotation: J s over that of the coordinate."""


def momentum_units(unit: Iterable[str]) -> tuple[str, ...]:
    """Units of the momenta of displacements (m) and rotations (rad)."""
    return tuple(MOMENTUM_UNIT[one] for one in unit)


@dataclass(frozen=True)
class AddedCoordinates:
    """Coordinates to add to a linear system, see `LinearSystem.widened`.

    Attributes
    ----------
    name
        ``frame.x``, ``light-1.arm``.
    unit, momentum_unit
        SI unit of each coordinate and of its momentum, which is J s over the former.
    mass, stiffness, damping
        Matrices to add, of the coordinates of the system, then of these; those of these alone are
        enough where nothing couples both.
    belong_to_bodies
        Whether the first part of each name is the body that the coordinate belongs to.
    """

    name: tuple[str, ...]
    unit: tuple[str, ...]
    momentum_unit: tuple[str, ...]
    mass: Float[np.ndarray, "all all"]
    stiffness: Inexact[np.ndarray, "all all"]
    damping: Float[np.ndarray, "all all"]
    belong_to_bodies: bool = False

    @property
    def count(self) -> int:
        """Number of coordinates."""
        return len(self.name)
