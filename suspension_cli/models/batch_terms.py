"""Frequency-dependent parts of the linear models of many builds at once.

No two wires of imperfect builds are alike, so a model of many builds adds to K + i omega C -
omega^2 M

    sum over wires of G (F(omega) - F(0)) G^T,      F(0) without loss,

with the dynamic stiffness F (12, 12) of a wire against the motion of its ends and the forms G (N,
12) of those; builds and their frequencies run together along the last axis of
`elements.dynamic_wire`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from suspension_cli.elements.dynamic_wire import COORDINATES, PARTS, TautWire, fit_to_equilibrium
from suspension_cli.linear.frequency_terms import LossTerm
from suspension_cli.scene.arrays import Index
from suspension_cli.scene.composition import Fibre, Gas

ENDS = sum(COORDINATES.values())
"""Coordinates of the two ends of a wire."""


class BatchTerm(Protocol):
    """A frequency-dependent part of the model of many builds."""

    def add(self, dynamic: Any, omega: Any, which: Index) -> None:
        """Add it to dynamic stiffnesses (q, N, N) of builds (q,) at a frequency (q,) each, rad/s,
        in place.
        """
        ...

    def spread(self, from_new: Any) -> BatchTerm:
        """Transform it to new coordinates q' with q = `from_new` (N, N') q'."""
        ...


@dataclass(frozen=True)
class WireBatchTerm:
    """Dynamic stiffness of one wire in many builds.

    Attributes
    ----------
    fibre : Fibre
        In the nominal pose.
    length, tension, stiffness, torsion : (p,) arrays
        In equilibrium: m, N, N/m (stretching), N m/rad (torsion where the design gives it, else 0).
    massive : bool
        Whether it has mass.
    surrounded : Gas or None
    rows : (r,) int array
        Coordinates that move its ends.
    forms : (p, r, 12) array
        Motion of its ends with these coordinates, for all of `dynamic_wire.PARTS`.
    """

    fibre: Fibre
    length: Any
    tension: Any
    stiffness: Any
    torsion: Any
    massive: bool
    surrounded: Gas | None
    rows: Index
    forms: Any

    def add(self, dynamic: Any, omega: Any, which: Index) -> None:
        """Add it to dynamic stiffnesses (q, N, N) of builds, in place."""
        tension = self.tension[which]
        fibre = fit_to_equilibrium(
            self.fibre, self.length[which], self.stiffness[which], tension, self.torsion[which]
        )
        strand = TautWire(fibre, tension, self.massive, lossy=True, surrounded=self.surrounded)
        moving = strand.at(omega)
        ends = np.zeros((len(which), ENDS, ENDS), dtype=complex)
        start = 0
        for part in PARTS:
            own = slice(start, start + COORDINATES[part])
            ends[:, own, own] = np.moveaxis(moving.stiffness(part) - strand.resting(part), -1, 0)
            start = own.stop
        forms = self.forms[which]
        dynamic[:, self.rows[:, None], self.rows] += forms @ ends @ np.swapaxes(forms, -1, -2)

    def spread(self, from_new: Any) -> WireBatchTerm:
        """Transform it to new coordinates."""
        some = from_new[self.rows]
        rows = np.flatnonzero(some.any(0))
        return replace(self, rows=rows, forms=some[:, rows].T @ self.forms)


@dataclass(frozen=True)
class LossBatchTerm:
    """A `LossTerm` of many builds, with a matrix (p, N, N), or (N, N) for all."""

    term: LossTerm

    def add(self, dynamic: Any, omega: Any, which: Index) -> None:
        """Add it to dynamic stiffnesses (q, N, N) of builds, in place."""
        matrix = self.term.matrix
        own = matrix[which] if matrix.ndim > 2 else matrix
        dynamic += 1j * self.term.angle(omega)[:, None, None] * own

    def spread(self, from_new: Any) -> LossBatchTerm:
        """Transform it to new coordinates."""
        return LossBatchTerm(self.term.spread(from_new))
