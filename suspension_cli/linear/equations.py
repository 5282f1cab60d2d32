"""Equations of one block of a pencil: weights of functions of frequency, element by element."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

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
class Part:
    """Weights of some functions of frequency in elements of the equations of a block.

    Attributes
    ----------
    row, column
        Equation of each element, and its unknown with the support's motions before them.
    weights
        Of many builds there is only one function.
    """

    row: Int[np.ndarray, " element"]
    column: Int[np.ndarray, " element"]
    weights: Inexact[np.ndarray, "element function #build"]

    @staticmethod
    def of(weights: Inexact[np.ndarray, "function row column"]) -> Part:
        """Take the elements of one design that are not 0."""
        row, column = np.nonzero(weights.any(0))
        return Part(row, column, weights[:, row, column].T[..., None])

    def followed_by(
        self,
        row: Int[np.ndarray, " added"],
        column: Int[np.ndarray, " added"],
        weights: Inexact[np.ndarray, "added function #build"],
    ) -> Part:
        """Append elements."""
        if not len(row):
            return self
        shape = np.broadcast_shapes(self.weights.shape[1:], weights.shape[1:])
        both = [np.broadcast_to(own, (len(own), *shape)) for own in (self.weights, weights)]
        row, column = np.append(self.row, row), np.append(self.column, column)
        return Part(row, column, np.concatenate(both))

    @cached_property
    def dense(
        self,
    ) -> tuple[
        Int[np.ndarray, " row"],
        Int[np.ndarray, " column"],
        Inexact[np.ndarray, "function row column"],
    ]:
        """The rows and columns that have elements, and the weights in these, of one design."""
        (rows, i), (columns, j) = (
            np.unique(n, return_inverse=True) for n in (self.row, self.column)
        )
        result = np.zeros((self.weights.shape[1], len(rows), len(columns)), self.weights.dtype)
        result[:, i, j] = self.weights[..., 0].T
        return rows, columns, result

    def apply(
        self,
        functions: Inexact[np.ndarray, "function frequency"],
        motion: Inexact[np.ndarray, "unknown vector frequency"],
        result: Inexact[np.ndarray, "unknown vector frequency"],
    ) -> None:
        """Add the product with motions of one design's unknowns, the support at rest."""
        rows, columns, weights = self.dense
        own = columns >= 6
        x = motion[columns[own] - 6]
        for weight, values in zip(weights[..., own], functions, strict=True):
            if len(x) and values.any():
                moved = multiply_real(weight, x.reshape(len(x), -1))
                result[rows] += values * moved.reshape(len(rows), *x.shape[1:])

    def transformed(
        self,
        to_absolute: Float[np.ndarray, "all all"],
        place: Int[np.ndarray, " all"],
        error: Float[np.ndarray, "unknown all"] | float = 0.0,
    ) -> Part:
        """Change unknowns: old = `to_absolute` @ new. Rounding errors become 0.

        `error` is a bound of other errors of the new elements.
        """
        rows, columns, weights = self.dense
        if not len(rows):
            return self
        left, right = to_absolute[6 + rows, 6:], to_absolute[columns]
        terms = np.abs(left).T @ sizes(weights, place[6 + rows], place[columns]) @ np.abs(right)
        result = left.T @ weights @ right
        return Part.of(np.where(np.abs(result) > ROUNDING * terms + error, result, 0.0))


@dataclass(frozen=True)
class Equations:
    """Equations of one block in one choice of coordinates q, with x = T q.

    Attributes
    ----------
    to_absolute
        T (6 + c, 6 + c) with the support's coordinates; None if q = x.
    pattern
        Order of elimination of the coordinates and tensions.
    parts
        For each part, elements of the pattern and the weights of its functions in them.
    support
        For each part, its elements in the columns of each motion of the support.
    """

    to_absolute: Float[np.ndarray, "coordinate coordinate"] | None
    pattern: elimination.Pattern
    parts: list[tuple[Int[np.ndarray, " element"], Inexact[np.ndarray, "element function #build"]]]
    support: list[list[Part]]

    @staticmethod
    def of(
        parts: list[Part],
        owner: Sequence[int],
        to_absolute: Float[np.ndarray, "coordinate coordinate"] | None = None,
    ) -> Equations:
        """Order the equations for elimination body by body."""
        size = len(owner)
        coupled = np.eye(size, 6 + size, 6, dtype=bool)
        for part in parts:
            coupled[part.row, part.column] = True
        pattern = elimination.by_body(np.array(owner, dtype=int), coupled[:, 6:])
        number = np.full((size, 6 + size), -1)
        number[pattern.row, 6 + pattern.column] = np.arange(len(pattern.row))
        elements, support = [], []
        for part in parts:
            place = number[part.row, part.column]
            elements.append((place[place >= 0], part.weights[place >= 0]))
            columns = (np.flatnonzero(part.column == motion) for motion in range(6))
            support.append([Part(part.row[n], part.column[n], part.weights[n]) for n in columns])
        return Equations(to_absolute, pattern, elements, support)

    def elements(
        self, functions: list[Inexact[np.ndarray, "function system"]]
    ) -> Inexact[np.ndarray, "element system"]:
        """Evaluate the elements of the pattern."""
        kind = np.result_type(*functions, *(own for _, own in self.parts if own.size))
        result = np.zeros((len(self.pattern.row), functions[0].shape[1]), dtype=kind)
        for (place, own), values in zip(self.parts, functions, strict=True):
            if len(place) and values.any():
                result[place] += _multiply(own, values)
        return result

    def solve(
        self,
        functions: list[Inexact[np.ndarray, "function system"]],
        moves: Float[np.ndarray, "6 input #system"],
        forces: Float[np.ndarray, "own input #system"],
    ) -> Inexact[np.ndarray, "own input system"]:
        """Solve for coordinates q, given support motions and forces on x."""
        elements, (own, inputs) = self.elements(functions), forces.shape[:2]
        shape = self.pattern.size, inputs, functions[0].shape[1]
        right = np.zeros(shape, dtype=elements.dtype)
        if self.to_absolute is not None:
            forces = np.tensordot(self.to_absolute[6 : 6 + own, 6 : 6 + own].T, forces, 1)
        right[:own] = forces
        for motion in np.flatnonzero(moves.any((1, 2))):
            driven = np.flatnonzero(moves[motion].any(1))
            for columns, values in zip(self.support, functions, strict=True):
                if len(row := columns[motion].row):
                    pull = _multiply(columns[motion].weights, values)[:, None]
                    right[row[:, None], driven] -= pull * moves[motion, driven]
        return self.pattern.solve(elements, right)[:own]


def _multiply(
    weights: Inexact[np.ndarray, "*rows function #build"],
    functions: Inexact[np.ndarray, "function system"],
) -> Inexact[np.ndarray, "*rows system"]:
    if len(functions) == 1:
        return weights[..., 0, :] * functions[0]
    return multiply_real(weights[..., 0], functions)
