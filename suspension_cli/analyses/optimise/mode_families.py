"""Families of modes that do not couple, and modes of bodies with and without wire mass.

Mirror symmetries split motions into families that do not couple: longitudinal with pitch,
transverse with roll, vertical, yaw. Within a family, frequencies generally do not cross (von
Neumann and Wigner, Phys. Z. 30, 467 (1929)), so that the rank of a mode identifies it in any
design, and its frequency changes smoothly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.modes import wire_modes
from suspension_cli.conventions import DOF_NAMES, DOFS, PARITY_X, PARITY_Y
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_pairing import body_overlap, pair_by_overlap
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models.choice import has_wire_mass

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

HIGHEST = 1.05
"""Highest frequency of the search for modes of bodies with wire mass, over the highest without;
wire mass lowers frequencies, except next to a violin mode."""


@dataclass(frozen=True)
class Families:
    """Families of motions that do not couple.

    Attributes
    ----------
    member : array
        Family of each degree of freedom.
    size : array
        Number of modes of each family.
    """

    member: Int[np.ndarray, " 6"]
    size: Int[np.ndarray, " family"]

    @staticmethod
    def of(mirrors: Bool[np.ndarray, " 2"], energy: Float[np.ndarray, "mode body 6"]) -> Families:
        """Find the families of a design.

        Parameters
        ----------
        mirrors : array
            Whether the design is symmetric in x and in y.
        energy : array
            Fractions of the kinetic energy of each mode, by body and degree of freedom.
        """
        signs = mirrors[:, None] * np.array([PARITY_X, PARITY_Y])
        parity = [tuple(column) for column in signs.T.tolist()]
        kinds = list(dict.fromkeys(parity))
        member = np.array([kinds.index(one) for one in parity])
        none = Families(member, np.zeros(len(kinds), dtype=int))
        return Families(member, np.bincount(none.energy(energy).argmax(1), minlength=len(kinds)))

    def energy(self, energy: Float[np.ndarray, "mode body 6"]) -> Float[np.ndarray, "mode family"]:
        """Fraction of the kinetic energy of each mode in each family."""
        return energy.sum(-2) @ np.eye(len(self.size))[self.member]

    def name(self, family: int) -> str:
        """Name a family, ``longitudinal-pitch``."""
        return "-".join(
            DOF_NAMES[dof] for dof, own in zip(DOFS, self.member, strict=True) if own == family
        )

    def ranked(self, energy: Float[np.ndarray, "mode body 6"]) -> list[Int[np.ndarray, " _"]]:
        """List the numbers of the modes of each family, ascending in frequency.

        Where imperfections mix families, each keeps its number of modes.
        """
        slots = np.repeat(np.arange(len(self.size)), self.size)
        place = pair_by_overlap(self.energy(energy)[:, slots])
        own = np.where(place >= 0, slots[place], -1)
        return [np.flatnonzero(own == family) for family in range(len(self.size))]


def solve_modes(model: LinearSystem) -> Modes:
    """Solve for the modes of the bodies; with wire mass, those most like the modes without."""
    static = eigenmodes.solve(model.constant)
    if not has_wire_mass(model):
        return static
    found = wire_modes.solve(model, HIGHEST * float(np.nanmax(static.frequency)))
    count = 6 * len(model.body)
    mass = model.mass[6 : 6 + count, 6 : 6 + count]
    pairs = pair_by_overlap(body_overlap(static.shape, found.shape, mass))
    return found.select(np.sort(pairs[pairs >= 0]))
