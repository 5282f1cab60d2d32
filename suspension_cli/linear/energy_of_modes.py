"""Kinetic energy of modes, by which names of modes find them in many designs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear.mode_families import Families

if TYPE_CHECKING:
    from jaxtyping import Float, Int


class EnergyOfModes:
    """Where modes of designs have their kinetic energy; the modes of each ascend in frequency.

    Attributes
    ----------
    fractions
        Of the kinetic energy of each mode, in each motion (`Modes.place`); NaN of designs without
        modes.
    of_bodies
        Those in the degrees of freedom of each body.
    """

    def __init__(self, fractions: Float[np.ndarray, "design mode place"], bodies: int) -> None:
        self.fractions = fractions
        own = fractions[..., : 6 * bodies]
        self.of_bodies = own.reshape(*own.shape[:-1], bodies, 6)
        self._ranked: dict[Families, list[Int[np.ndarray, "design rank"]]] = {}

    def ranked(self, families: Families) -> list[Int[np.ndarray, "design rank"]]:
        """Numbers of the modes of each family by rank; -1 where a design has no such modes."""
        if families not in self._ranked:
            self._ranked[families] = self._rank(families)
        return self._ranked[families]

    def _rank(self, families: Families) -> list[Int[np.ndarray, "design rank"]]:
        designs, modes, _ = self.fractions.shape
        numbers = [np.full((designs, size), -1) for size in families.size]
        if modes == sum(families.size):
            known = np.isfinite(self.fractions).all((1, 2))
            for n in np.flatnonzero(known).tolist():
                for number, own in zip(numbers, families.numbers(self.of_bodies[n]), strict=True):
                    number[n] = own
        return numbers
