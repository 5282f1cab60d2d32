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

from suspension_cli.elements import loss
from suspension_cli.elements.gas import surface_drag
from suspension_cli.linear.frequency_terms import LossTerm
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.composition import Fibre, Gas

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Int


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
    """Dynamic stiffness of all wires in many builds.

    Attributes
    ----------
    fibre
        The wires in the nominal pose.
    massive
        Whether they have mass.
    size
        Number of coordinates N of the scene.
    place, sections, geometry
        See `elements.compiled_wire.WireArrays`.
    basis
        The scene's coordinates in terms of the system's own, if these differ.
    """

    fibre: tuple[Fibre, ...]
    massive: bool
    surrounded: Gas | None
    size: int
    place: Int[np.ndarray, "wire 15"]
    sections: Float[np.ndarray, "wire section 10"]
    geometry: Float[np.ndarray, "all_builds wire 25"]
    basis: Float[np.ndarray, "own coordinate"] | None = None

    def add(
        self,
        dynamic: Complex[np.ndarray, "build coordinate coordinate"],
        compliance: Complex[np.ndarray, "build wire"],
        omega: Float[np.ndarray, " build"],
        which: Int[np.ndarray, " build"],
    ) -> None:
        """Add the bending and twisting; set the compliances."""
        from suspension_cli.compiled import constant  # takes half a second
        from suspension_cli.elements import compiled_wire

        values, number = np.unique(omega, return_inverse=True)
        whole = dynamic
        if self.basis is not None:
            whole = np.zeros((len(which), self.size, self.size), dtype=complex)
        compiled_wire.add_dynamic(
            which,
            constant(omega),
            number,
            compiled_wire.WireArrays(self.place, self.sections, self.geometry),
            compiled_wire.Losses(*self._losses(values)),
            self.massive,
            whole,
            compliance,
        )
        if self.basis is not None:
            changed = self.basis.T @ whole @ self.basis
            dynamic += (changed + np.swapaxes(changed, -1, -2)) / 2

    def _losses(
        self, omega: Float[np.ndarray, " frequency"]
    ) -> tuple[
        Float[np.ndarray, "frequency wire section 6"],
        Float[np.ndarray, "wire section 2"],
        Float[np.ndarray, "wire section 4"],
    ]:
        """Loss angles, thermoelastic coefficients and drag, see `compiled_wire.Losses`."""
        wires, most = self.sections.shape[:2]
        angles, slopes = np.zeros((len(omega), wires, most, 6)), np.zeros((wires, most, 2))
        drag, known = np.zeros((wires, most, 4)), {}
        for n, fibre in enumerate(self.fibre):
            temperature = sum(fibre.temperature) / 2
            for m, section in enumerate(fibre.sections):
                key = (section, temperature)
                if key not in known:
                    known[key] = n, m
                    for plane in (0, 1):
                        parts = loss.bending_angle_parts(section, plane, omega, temperature)
                        angles[:, n, m, plane], angles[:, n, m, 4 + plane], *slopes[n, m] = parts
                    angles[:, n, m, 2] = loss.stretching_angle(section, omega)
                    angles[:, n, m, 3] = loss.twisting_angle(section, omega)
                    if self.surrounded is not None:
                        drag[n, m] = section.shape.drag(*surface_drag(self.surrounded))
                else:
                    first = known[key]
                    angles[:, n, m], slopes[n, m] = angles[:, *first], slopes[first]
                    drag[n, m] = drag[first]
        return angles, slopes, drag

    def spread(self, from_new: Float[np.ndarray, "coordinate new"]) -> WireBatchTerm:
        """Transform it to new coordinates."""
        return replace(self, basis=from_new if self.basis is None else self.basis @ from_new)


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
