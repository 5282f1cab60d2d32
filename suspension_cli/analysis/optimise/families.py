"""Modes told apart without labels: by the family that the design's symmetry puts them in, and their rank there; or followed by shape.

Mirror symmetries split motions into families that do not couple: longitudinal with pitch, transverse with roll, vertical, yaw.  Within a
family frequencies do not cross but for accidents (von Neumann and Wigner, Phys. Z. 30, 467 (1929)), so that a mode's rank there names it in any design,
whatever its shape has become, and its frequency changes smoothly.  A mode that is named by its label in one design is in another the one that
it becomes on the straight way between the two (`following`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.analysis import builds, following, spectrum, variants
from suspension_cli.analysis.modes import Modes
from suspension_cli.analysis.spectrum import matched
from suspension_cli.conventions import DOFS, PARITY_X, PARITY_Y, WORDS
from suspension_cli.design.scene import Array

STEPS = 24
"""Designs on the way from one to another at which shapes are compared."""


@dataclass(frozen=True)
class Families:
    """The families of a design's motions.

    Attributes
    ----------
    member : (6,) int array
        The family of each degree of freedom.
    size : (k,) int array
        How many modes each has.
    """

    member: Any
    size: Any

    @staticmethod
    def of(mirrors: Any, energy: Any) -> Families:
        """Those of a design with some mirror symmetries (2,), whose modes have shares of kinetic energy (m, n, 6)."""
        parity = [(PARITY_X[n] if mirrors[0] else 0, PARITY_Y[n] if mirrors[1] else 0) for n in range(len(DOFS))]
        kinds = list(dict.fromkeys(parity))
        member = np.array([kinds.index(one) for one in parity])
        return Families(member, np.bincount(_held(member, energy).argmax(1), minlength=len(kinds)))

    def name(self, family: int) -> str:
        """In the field's words: ``longitudinal-pitch``."""
        return "-".join(WORDS[dof] for dof, own in zip(DOFS, self.member, strict=True) if own == family)

    def ranked(self, energy: Any) -> list[Any]:
        """Places of each family's modes, in ascending order; imperfections that mix families move no mode to another."""
        from scipy.optimize import linear_sum_assignment

        held = _held(self.member, energy)
        own = held.argmax(1)
        if (np.bincount(own, minlength=len(self.size)) != self.size).any():
            seats = np.repeat(np.arange(len(self.size)), self.size)
            rows, columns = linear_sum_assignment(held[:, seats], maximize=True)
            own = np.full(len(held), -1)
            own[rows] = seats[columns]
        return [np.flatnonzero(own == family) for family in range(len(self.size))]


def _held(member: Any, energy: Any) -> Array:
    """Share of each mode's kinetic energy in each family (m, k)."""
    return np.asarray(energy).sum(-2) @ np.eye(int(member.max()) + 1)[member]


def batched(found: spectrum.Spectrum, bodies: int) -> Any:
    """Shares of kinetic energy (p, m, n, 6) of a batch."""
    squares = np.asarray(found.shape)[..., : 6 * bodies] ** 2
    return squares.reshape(*squares.shape[:-1], bodies, 6)


def became(text: str, start: dict[str, float], end: dict[str, float], nominal: Array, found: Modes, mass: Any) -> Any:
    """Which mode of a design each mode of another has become.

    Parameters
    ----------
    text : str
        A design as TOML, for all numbers that do not change.
    start, end : dict of float
        The numbers that do, by dotted path, in the one and the other.
    nominal : (m, c) array
        Shapes at the start, as `spectrum.Spectrum` has them.
    found : Modes
        At the end.
    mass : (N, N) array
        At the end.

    Returns
    -------
    place : (m,) int array
        Among the modes found; -1 where there is no telling.
    """
    share = np.linspace(0, 1, STEPS + 1)
    way = {name: start[name] + share * (end[name] - start[name]) for name in start}
    squared, shape = np.full((STEPS + 1, len(nominal)), np.nan), np.zeros((STEPS + 1, *nominal.shape))
    good = np.zeros(STEPS + 1, dtype=bool)
    for batch, here in variants.balanced(text, way, "string", allow_unstable=True):
        if batch.model.size - 6 != nominal.shape[1]:
            continue
        solved = spectrum.solve(batch.model)
        squared[here], shape[here], good[here] = solved.omega_squared, solved.shape, batch.status == builds.GOOD
    if not good[-1]:
        return np.full(len(nominal), -1)
    rank, _ = following.follow(squared, shape, good, (0,), nominal)
    weighed = found.shape * np.sqrt(np.diag(mass)[6:])
    return matched(shape[-1], weighed)[0][rank[-1]]
