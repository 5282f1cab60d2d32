"""Families of modes that do not couple, by mirror symmetry: yaw, longitudinal with pitch, ...

Within a family, frequencies generally do not cross (von Neumann and Wigner, Phys. Z. 30, 467
(1929)), so that the rank of a mode in its family identifies it in any design, and its frequency
changes smoothly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import DOF_NAMES, DOFS, PARITY_X, PARITY_Y
from suspension_cli.linear.mode_pairing import pair_by_overlap

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int


@dataclass(frozen=True)
class Families:
    """Families of motions that do not couple.

    Attributes
    ----------
    member
        Family of each degree of freedom of a body.
    size
        Number of modes of each family.
    """

    member: tuple[int, ...]
    size: tuple[int, ...]

    @staticmethod
    def of(mirrors: Bool[np.ndarray, " 2"], energy: Float[np.ndarray, "mode body 6"]) -> Families:
        """Find the families of a design that is symmetric in x and in y, or not (`mirrors`).

        `energy` are fractions of the kinetic energy of each mode.
        """
        parities = (mirrors[:, None] * np.array([PARITY_X, PARITY_Y])).T
        signs = [tuple(one) for one in parities.tolist()]
        kinds = list(dict.fromkeys(signs))
        member = tuple(kinds.index(one) for one in signs)
        alone = Families(member, (0,) * len(kinds))
        size = np.bincount(alone.energy(energy).argmax(1), minlength=len(kinds))
        return Families(member, tuple(size.tolist()))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the families: ``longitudinal-pitch``, ``yaw``."""
        motions: list[list[str]] = [[] for _ in self.size]
        for dof, family in zip(DOFS, self.member, strict=True):
            motions[family].append(DOF_NAMES[dof])
        return tuple("-".join(some) for some in motions)

    def energy(self, energy: Float[np.ndarray, "mode body 6"]) -> Float[np.ndarray, "mode family"]:
        """Fraction of the kinetic energy of each mode in each family."""
        return energy.sum(-2) @ np.eye(len(self.size))[list(self.member)]

    def numbers(
        self, energy: Float[np.ndarray, "mode body 6"]
    ) -> tuple[Int[np.ndarray, " rank"], ...]:
        """Numbers of the modes of each family, from 0, ascending in frequency.

        Where imperfections mix families, each keeps its number of modes.
        """
        slots = np.repeat(np.arange(len(self.size)), self.size)
        place = pair_by_overlap(self.energy(energy)[:, slots])
        own = np.where(place >= 0, slots[place], -1)
        return tuple(np.flatnonzero(own == family) for family in range(len(self.size)))
