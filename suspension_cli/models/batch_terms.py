"""Frequency-dependent parts of the linear models of many builds at once.

No two wires of imperfect builds are equal, so these models add to K + i omega C - omega^2 M

    sum over wires of G (F(omega) - F(0)) G^T,      F(0) without loss,

with the dynamic stiffness F of a wire against the motion of its ends, and the linear forms G of
that motion. The stretching stiffness of a wire is replaced (its inverse, see `linear.stretching`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from suspension_cli.elements.dynamic_wire import PARTS, TautWire, fit_to_equilibrium
from suspension_cli.linear.frequency_terms import LossTerm
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Int

CHUNK = 256
"""Builds at a time, whose arrays fit into the cache."""


class BatchTerm(Protocol):
    """A frequency-dependent part of the model of many builds."""

    def add(
        self,
        dynamic: Complex[np.ndarray, "build coordinate coordinate"],
        compliance: Complex[np.ndarray, "build wire"],
        omega: Float[np.ndarray, " build"],
        which: Int[np.ndarray, " build"],
    ) -> None:
        """Add it in place to the stiffness (q, N, N) of builds, each at its frequency in rad/s.

        Or set the compliance (q, w) of wires against stretching, m/N.
        """
        ...

    def spread(self, from_new: Float[np.ndarray, "coordinate new"]) -> BatchTerm:
        """Transform it to new coordinates q' with q = `from_new` (N, N') q'."""
        ...


@dataclass(frozen=True)
class WireBatchTerm:
    """Wires of the same sections between the same bodies, in many builds.

    Attributes
    ----------
    strand
        Any of them as it hangs in the nominal pose.
    number
        Their numbers among the wires of the scene.
    geometry
        Length, stretching stiffness, tension, and torsional stiffness (0 where the design gives
        none) of each, in SI units.
    place
        The coordinates that move them.
    forms
        Motions of their ends per such coordinate, all wires of one motion after the other: those of
        `TautWire.change`, of bending in both planes, twisting, and stretching if they have mass.
    """

    strand: TautWire
    number: Int[np.ndarray, " wire"]
    geometry: Float[np.ndarray, "4 all_builds wire"]
    place: Int[np.ndarray, " moving"]
    forms: Float[np.ndarray, "all_builds motion moving"]

    def add(
        self,
        dynamic: Complex[np.ndarray, "build coordinate coordinate"],
        compliance: Complex[np.ndarray, "build wire"],
        omega: Float[np.ndarray, " build"],
        which: Int[np.ndarray, " build"],
    ) -> None:
        """Add the bending and twisting; set the compliances."""
        runs = _runs(self.place)
        for start in range(0, len(which), CHUNK):
            some = slice(start, start + CHUNK)
            block, yielding = self._evaluate(omega[some], which[some])
            compliance[some, self.number] = yielding
            for rows, own_rows in runs:
                for columns, own_columns in runs:
                    dynamic[some, rows, columns] += block[:, own_rows, own_columns]

    def _evaluate(
        self, omega: Float[np.ndarray, " build"], which: Int[np.ndarray, " build"]
    ) -> tuple[Complex[np.ndarray, "build moving moving"], Complex[np.ndarray, "build wire"]]:
        """Stiffness (q, n, n) on the coordinates that move the wires, and their compliances."""
        length, k, tension, torsion = self.geometry[:, which].swapaxes(1, 2)
        fibre = fit_to_equilibrium(self.strand.fibre, length, k, tension, torsion)
        moving = replace(self.strand, fibre=fibre, tension=tension).at(omega)
        forms = self.forms[which]
        forces = np.empty(forms.shape, dtype=complex)
        first, wires, massive = 0, len(self.number), self.strand.massive
        for part in PARTS if massive else ("bend-1", "bend-2", "twist"):
            change = moving.change(part)
            if not part.startswith("bend"):
                # springs; that between both ends of a stretched wire is left to its tension
                change = change[1:] if part == "stretch" else change[: 3 if massive else 1]
            size = len(change)
            blocks = [slice(first + n * wires, first + (n + 1) * wires) for n in range(size)]
            first += size * wires
            for i in range(size):
                own = change[i, i] if part.startswith("bend") else change[i]
                into = forces[:, blocks[i]]
                np.multiply(own.T[..., None], forms[:, blocks[i]], out=into)
                for j in range(size) if part.startswith("bend") else ():
                    if j != i and change[i, j].any():
                        into += change[i, j].T[..., None] * forms[:, blocks[j]]
        block = (forms.swapaxes(1, 2) @ forces.view(float)).view(complex)
        return block, 1 / moving.change("stretch")[0].T

    def spread(self, from_new: Float[np.ndarray, "coordinate new"]) -> WireBatchTerm:
        """Transform it to new coordinates."""
        moved = from_new[self.place]
        place = np.flatnonzero(moved.any(0))
        return replace(self, place=place, forms=self.forms @ moved[:, place])


def _runs(place: Int[np.ndarray, " moving"]) -> list[tuple[slice, slice]]:
    """Runs of consecutive coordinates, and where each stands among all of `place`."""
    parts = np.split(place, np.flatnonzero(np.diff(place) > 1) + 1)
    starts = np.cumsum([0, *map(len, parts)]).tolist()
    return [
        (slice(part[0], part[-1] + 1), slice(start, start + len(part)))
        for part, start in zip(parts, starts, strict=False)
    ]


@dataclass(frozen=True)
class LossBatchTerm:
    """A `LossTerm` of many builds, with a matrix (p, N, N), or (N, N) for all."""

    term: LossTerm

    def add(
        self,
        dynamic: Complex[np.ndarray, "build coordinate coordinate"],
        compliance: Complex[np.ndarray, "build wire"],
        omega: Float[np.ndarray, " build"],
        which: Int[np.ndarray, " build"],
    ) -> None:
        """Add it to the stiffness (q, N, N) of builds, in place."""
        del compliance
        matrix = self.term.matrix
        rows, columns = np.nonzero(matrix.reshape(-1, *matrix.shape[-2:]).any(0))
        own = matrix[..., rows, columns]
        own = own[which] if matrix.ndim > 2 else own
        value = 1j * self.term.angle(omega)
        if self.term.storage is not None:
            value = value + self.term.storage(omega)
        dynamic[:, rows, columns] += value[:, None] * own

    def spread(self, from_new: Float[np.ndarray, "coordinate new"]) -> LossBatchTerm:
        """Transform it to new coordinates."""
        return LossBatchTerm(self.term.spread(from_new))


def with_ground_terms(
    model: LinearSystem, terms: tuple[LossTerm, ...], *, split: bool
) -> LinearSystem:
    """Give the ground of many builds its terms; in the coordinates of the system if `split`."""
    if model.ground is None:
        return model
    made = [LossBatchTerm(term) for term in terms]
    made = [term.spread(model.basis) for term in made] if split else made
    return replace(model, ground=replace(model.ground, terms=tuple(made)))
