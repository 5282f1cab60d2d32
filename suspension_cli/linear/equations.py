"""Equations of one block of a pencil: weights of functions of frequency, element by element."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli import elimination
from suspension_cli.linear.frequency_terms import multiply_real

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact, Int

ROUNDING = 4e-15
"""Fraction of its terms up to which a sum is a rounding error."""


def sizes(
    matrix: Float[np.ndarray, "*rows row column"],
    of_row: Int[np.ndarray, " row"] | None,
    of_column: Int[np.ndarray, " column"],
) -> Float[np.ndarray, "*rows row column"]:
    """Largest absolute element over the rows and columns of equal, neighbouring places.

    A place is the translation of a body, its rotation, a blade tip, or a tension.
    """
    result = np.abs(matrix)
    for axis, place in ((-2, of_row), (-1, of_column)):
        if place is not None:
            starts = np.flatnonzero(np.diff(place, prepend=-1))
            result = np.maximum.reduceat(result, starts, axis)
            result = np.repeat(result, np.diff(np.append(starts, len(place))), axis)
    return result


def rounding(
    matrix: Inexact[np.ndarray, "row row"], place: Int[np.ndarray, " row"]
) -> Float[np.ndarray, "row row"]:
    """Largest rounding errors of the elements of a matrix of the forms of several parts."""
    size = sizes(matrix, place, place)
    own = np.sqrt(np.diag(size))
    return ROUNDING * np.maximum(size, own[:, None] * own)


@dataclass(frozen=True)
class Elements:
    """Elements of the equations of a block, by row; the columns of the support come first.

    Attributes
    ----------
    weights
        Of the functions of frequency in each element; of many builds, the elements themselves.
    """

    row: Int[np.ndarray, " element"]
    column: Int[np.ndarray, " element"]
    weights: Inexact[np.ndarray, "element function"]

    @staticmethod
    def of(pieces: list[tuple[Any, Any, int, Any]], functions: int) -> Elements:
        """Sum pieces: rows, columns, the first function that they have weights of, and these."""
        row, column = (np.concatenate([piece[n] for piece in pieces]) for n in (0, 1))
        places, member = np.unique(np.stack([row, column]), axis=1, return_inverse=True)
        kind = np.result_type(*(piece[3] for piece in pieces))
        weights, start = np.zeros((places.shape[1], functions), dtype=kind), 0
        for rows, _, first, own in pieces:
            span = slice(first, first + own.shape[1])
            weights[member[start : start + len(rows)], span] += own
            start += len(rows)
        return Elements(*places, weights)

    def at(
        self, functions: Inexact[np.ndarray, "function system"]
    ) -> Inexact[np.ndarray, "element system"]:
        """Evaluate the elements."""
        return multiply_real(self.weights, functions) if len(functions) else self.weights

    def multiply(
        self,
        functions: Inexact[np.ndarray, "function system"],
        motion: Inexact[np.ndarray, "unknown vector system"],
    ) -> Inexact[np.ndarray, "unknown vector system"]:
        """Multiply motions of the unknowns, the support at rest."""
        own = self.column >= 6
        values, result = self.at(functions)[own, None], np.zeros(motion.shape, dtype=complex)
        rows, starts = np.unique(self.row[own], return_index=True)
        result[rows] = np.add.reduceat(values * motion[self.column[own] - 6], starts)
        return result

    def transformed(
        self,
        to_absolute: Float[np.ndarray, "all all"],
        place: Int[np.ndarray, " all"],
        error: Float[np.ndarray, "unknown all"],
    ) -> Elements:
        """Change unknowns: old = `to_absolute` @ new. Rounding errors become 0.

        `error` is a bound of other errors of the new elements of the first function.
        """
        pieces = []
        for n, weights in enumerate(self.weights.T):
            own = np.flatnonzero(weights)
            rows, i = np.unique(self.row[own], return_inverse=True)
            columns, j = np.unique(self.column[own], return_inverse=True)
            if not len(own):
                continue
            matrix = np.zeros((len(rows), len(columns)))
            matrix[i, j] = weights[own]
            left, right = to_absolute[6 + rows, 6:], to_absolute[columns]
            terms = np.abs(left).T @ sizes(matrix, place[6 + rows], place[columns]) @ np.abs(right)
            result = left.T @ matrix @ right
            kept = np.nonzero(np.abs(result) > ROUNDING * terms + (error if n == 0 else 0.0))
            pieces.append((*kept, n, result[kept][:, None]))
        return Elements.of(pieces, self.weights.shape[1])


@dataclass(frozen=True)
class Equations:
    """Equations of one block in one choice of coordinates q, with x = T q.

    Attributes
    ----------
    owner
        Number of the body of each unknown.
    to_absolute
        T (6 + c, 6 + c) with the support's coordinates; None if q = x.
    """

    elements: Elements
    owner: list[int]
    to_absolute: Float[np.ndarray, "coordinate coordinate"] | None = None

    @cached_property
    def pattern(self) -> elimination.Pattern:
        """Order of elimination, and the elements that it needs."""
        coupled = np.eye(len(self.owner), 6 + len(self.owner), 6, dtype=bool)
        coupled[self.elements.row, self.elements.column] = True
        return elimination.by_body(np.array(self.owner, dtype=int), coupled[:, 6:])

    @cached_property
    def place(self) -> Int[np.ndarray, " element"]:
        """Number of each element in the pattern; -1 for mirrored ones and those of the support."""
        number = np.full((len(self.owner), 6 + len(self.owner)), -1)
        number[self.pattern.row, 6 + self.pattern.column] = np.arange(len(self.pattern.row))
        return number[self.elements.row, self.elements.column]

    def solve(
        self,
        functions: Inexact[np.ndarray, "function system"],
        moves: Float[np.ndarray, "6 input #system"],
        forces: Float[np.ndarray, "own input #system"],
    ) -> Inexact[np.ndarray, "own input system"]:
        """Solve for coordinates q, given support motions and forces on x."""
        values, (own, inputs) = self.elements.at(functions), forces.shape[:2]
        shape = self.pattern.size, inputs, values.shape[1]
        right = np.zeros(shape, dtype=values.dtype)
        if self.to_absolute is not None:
            forces = np.tensordot(self.to_absolute[6 : 6 + own, 6 : 6 + own].T, forces, 1)
        right[:own] = forces
        for motion in np.flatnonzero(moves.any((1, 2))):
            driven = np.flatnonzero(moves[motion].any(1))
            pull = np.flatnonzero(self.elements.column == motion)
            rows = self.elements.row[pull, None]
            right[rows, driven] -= values[pull, None] * moves[motion, driven]
        return self.pattern.solve(self.in_pattern(values), right)[:own]

    def in_pattern(
        self, values: Inexact[np.ndarray, "element system"]
    ) -> Inexact[np.ndarray, "element system"]:
        """The elements of the pattern."""
        result = np.zeros((len(self.pattern.row), values.shape[1]), dtype=values.dtype)
        result[self.place[self.place >= 0]] = values[self.place >= 0]
        return result
