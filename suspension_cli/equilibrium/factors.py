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

LEAST_PIVOT = 1e-14
"""Pivot over the stiffness of its coordinate below which it is a rounding error: the coordinate has
no stiffness of its own, and is held."""


class Factors:
    """Factors of symmetric matrices.

    Parameters
    ----------
    matrix
        Of which the lower triangle is used; it is overwritten.
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
        self.matrix, self._rows = matrix, _eliminated(linked.tobytes(), len(linked))
        self.least = np.full(matrix.shape[-1], np.inf)
        diagonal = np.abs(np.einsum("iip->ip", matrix))
        diagonal[diagonal == 0] = 1.0
        for n in range(len(matrix) - 1, -1, -1):
            relative = matrix[n, n] / diagonal[n]
            np.minimum(self.least, relative, out=self.least)
            held = ~(np.abs(relative) > LEAST_PIVOT)
            if held.any():
                matrix[n, n, held] = diagonal[n, held]
            rows = self._rows[n]
            if rows is not None:
                row = matrix[n, rows]
                over = row / matrix[n, n]
                square = (rows, rows) if isinstance(rows, slice) else np.ix_(rows, rows)
                matrix[square] -= over[:, None] * row
                matrix[n, rows] = over

    def select(self, which: Int[np.ndarray, " build"]) -> Factors:
        """Those of some of the builds."""
        result = copy.copy(self)
        result.matrix, result.least = self.matrix[..., which], self.least[which]
        return result

    def solve(self, right: Float[np.ndarray, "row build"]) -> Float[np.ndarray, "row build"]:
        """Solve with the matrices."""
        x, matrix = right.copy(), self.matrix
        for n in range(len(x) - 1, -1, -1):
            rows = self._rows[n]
            if rows is not None:
                x[rows] -= matrix[n, rows] * x[n]
        x /= np.einsum("iip->ip", matrix)
        for n, rows in enumerate(self._rows):
            if rows is not None:
                x[n] -= (matrix[n, rows] * x[rows]).sum(0)
        return x


@lru_cache(maxsize=64)
def _eliminated(linked: bytes, size: int) -> list[slice | Int[np.ndarray, " _"] | None]:
    """Columns left of the diagonal in which each row of the factors may differ from 0."""
    full = np.frombuffer(linked, dtype=bool).reshape(size, size).copy()
    result: list[slice | Int[np.ndarray, " _"] | None] = [None] * size
    for n in range(size - 1, -1, -1):
        rows = np.flatnonzero(full[n, :n])
        full[np.ix_(rows, rows)] = True
        if len(rows):
            contiguous = rows[-1] - rows[0] == len(rows) - 1
            result[n] = slice(int(rows[0]), int(rows[-1]) + 1) if contiguous else rows
    return result
