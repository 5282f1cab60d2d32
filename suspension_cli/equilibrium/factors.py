"""Factors L^T D L of the tangent stiffness of builds, and solutions with them.

Coordinates are eliminated from the last to the first, tips of blades and lower bodies before those
above, so that the factors stay as sparse as the tree of bodies. A stable equilibrium has positive
pivots D alone.
"""

from __future__ import annotations

import copy
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

    Rows = slice | Int[np.ndarray, " row"] | None
    Square = tuple[slice | np.ndarray, ...] | None

LEAST_PIVOT = 1e-14
"""Pivot over the stiffness of its coordinate below which it is a rounding error: the coordinate has
no stiffness of its own, and is held."""


class Factors:
    """Factors of symmetric matrices.

    Parameters
    ----------
    matrix
        Of which the lower triangle is used.
    linked
        Elements that may differ from 0.

    Attributes
    ----------
    least
        Least pivot over its diagonal element.
    """

    def __init__(
        self,
        matrix: Float[np.ndarray, "row row build"],
        linked: Bool[np.ndarray, "row row"],
    ) -> None:
        self._rows = _eliminated(linked.tobytes(), len(linked))
        self._matrix, self._pivot = matrix.copy(), np.empty(matrix.shape[1:])
        diagonal = np.abs(np.einsum("iip->ip", matrix))
        diagonal[diagonal == 0] = 1.0
        self._eliminate(None)
        relative = self._pivot / diagonal
        self.least = relative.min(0)
        if not np.abs(relative).min(initial=1.0) > LEAST_PIVOT:
            self._matrix = matrix.copy()
            self._eliminate(diagonal)

    @np.errstate(all="ignore")
    def _eliminate(self, diagonal: Float[np.ndarray, "row build"] | None) -> None:
        """Factorise; coordinates are held by their stiffness, if `diagonal` gives it."""
        matrix = self._matrix
        for n in range(len(matrix) - 1, -1, -1):
            pivot, (rows, square) = matrix[n, n], self._rows[n]
            if diagonal is not None:
                pivot = np.where(np.abs(pivot) > LEAST_PIVOT * diagonal[n], pivot, diagonal[n])
            self._pivot[n] = pivot
            if rows is not None:
                row = matrix[n, rows]
                over = row / pivot
                matrix[square] -= over[:, None] * row
                matrix[n, rows] = over

    def select(self, which: Int[np.ndarray, " build"]) -> Factors:
        """Those of some of the builds, or of the one that all share."""
        if len(self.least) == 1:
            return self
        result = copy.copy(self)
        result._matrix, result._pivot = self._matrix[..., which], self._pivot[:, which]
        result.least = self.least[which]
        return result

    def solve(self, right: Float[np.ndarray, "row build"]) -> Float[np.ndarray, "row build"]:
        """Solve with the matrices."""
        x, matrix = right.copy(), self._matrix
        for n in range(len(x) - 1, -1, -1):
            rows, _ = self._rows[n]
            if rows is not None:
                x[rows] -= matrix[n, rows] * x[n]
        x /= self._pivot
        for n, (rows, _) in enumerate(self._rows):
            if rows is not None:
                x[n] -= (matrix[n, rows] * x[rows]).sum(0)
        return x


@lru_cache(maxsize=64)
def _eliminated(linked: bytes, size: int) -> list[tuple[Rows, Square]]:
    """Columns left of the diagonal in which each row of the factors may differ from 0."""
    full = np.frombuffer(linked, dtype=bool).reshape(size, size).copy()
    result: list[tuple[Rows, Square]] = [(None, None)] * size
    for n in range(size - 1, -1, -1):
        rows = np.flatnonzero(full[n, :n])
        full[np.ix_(rows, rows)] = True
        if len(rows) and rows[-1] - rows[0] == len(rows) - 1:
            near = slice(int(rows[0]), int(rows[-1]) + 1)
            result[n] = near, (near, near)
        elif len(rows):
            result[n] = rows, np.ix_(rows, rows)
    return result
