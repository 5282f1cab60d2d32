"""Which coordinates of a linear system couple: its matrices without rounding errors.

Elements that a symmetry forbids, and sums that cancel, are exactly 0 here, so that coordinates fall
into blocks that can be solved apart.

>>> from suspension_cli.design import reader
>>> from suspension_cli.models import registry
>>> model = registry.STRING.system(reader.parse(reader.template("single", "single")))
>>> [[model.coordinate[n] for n in block] for block in Structure(model).blocks]
[['test.x', 'test.pitch'], ['test.y', 'test.roll'], ['test.z'], ['test.yaw']]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elimination import connected_groups, rounding
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.arrays import Index

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int


@dataclass(frozen=True)
class Structure:
    """Couplings and blocks of a linear system, or of the systems of a batch."""

    system: LinearSystem

    @cached_property
    def place(self) -> Int[np.ndarray, " coordinate"]:
        """Place of each coordinate, see `elimination.sizes`."""
        number = np.arange(self.system.size)
        of_bodies = number < 6 * (len(self.system.body) + 1)
        return np.where(of_bodies, number // 3, number)

    @cached_property
    def weights(self) -> list[Float[np.ndarray, "function column column"]]:
        """A_n of each term among its columns, without rounding errors."""
        result = []
        for term in self.system.terms:
            small = term.rounding(self.place[term.columns])
            allowed = self.system.allowed[term.columns[:, None], term.columns]
            kept = (np.abs(term.compact) > small) & allowed
            result.append(np.where(kept, term.compact, 0.0))
        return result

    @cached_property
    def coupled(self) -> Bool[np.ndarray, "coordinate coordinate"]:
        """Whether coordinates couple by more than rounding errors; in any of many builds, at all.

        What one wire exerts, an equal one may cancel, so equal wires of one design are taken
        together.
        """
        system = self.system
        if system.batch:
            moved = _is_nonzero(system.elongation)
            matrices = (system.mass, system.damping, system.soft)
            used = np.any([_is_nonzero(matrix) for matrix in matrices], axis=0)
            return (system.allowed & (moved.T @ moved)) | used
        result = np.zeros((system.size, system.size), dtype=bool)
        for matrix in (system.mass, system.damping, np.real(system.soft), np.imag(system.soft)):
            if matrix.any():
                result |= np.abs(matrix) > rounding(matrix, self.place)
        for k in dict.fromkeys(system.k.tolist()):
            equal = system.elongation[system.k == k]
            moved = np.flatnonzero(equal.any(0))
            here = moved[:, None], moved
            squares = np.where(system.allowed[here], equal[:, moved].T @ equal[:, moved], 0.0)
            result[here] |= np.abs(squares) > rounding(squares, self.place[moved])
        for term, weights in zip(system.terms, self.weights, strict=True):
            result[term.columns[:, None], term.columns] |= (weights != 0).any(0)
        return result

    @cached_property
    def blocks(self) -> tuple[Index, ...]:
        """Groups of coordinates that do not couple, without the support's, by first coordinate.

        A damper may sense one body and push another.
        """
        return tuple(6 + group for group in connected_groups(self.coupled[6:, 6:]))


def _is_nonzero(matrix: np.ndarray) -> Bool[np.ndarray, "row column"]:
    """Mark elements that are not 0 in some build."""
    return (matrix != 0).any(tuple(range(matrix.ndim - 2)))
