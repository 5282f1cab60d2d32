"""Linear algebra in 50 digits, for reference values."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.linear.graded_eigenvalues import RIGID
from suspension_cli.linear.pencil import EvaluatedBlock, Pencil
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact
    from mpmath.ctx_mp import MPContext

DIGITS = 50
Number = Any
"""A number of mpmath, which has no types."""
Matrix = list[list[Number]]


@cache
def context() -> MPContext:
    """Return the mpmath context of `DIGITS` digits."""
    import mpmath

    numbers = mpmath.mp.clone()
    numbers.dps = DIGITS
    return numbers


def eliminate(matrix: Matrix, right: Matrix) -> Matrix:
    """Solve linear systems by elimination with partial pivoting; overwrites both arguments."""
    size = len(matrix)
    for n in range(size):
        pivot = max(range(n, size), key=lambda row: abs(complex(matrix[row][n])))
        for rows in (matrix, right):
            rows[n], rows[pivot] = rows[pivot], rows[n]
        beyond = [j for j in range(n + 1, size) if matrix[n][j]]
        driven = [j for j, value in enumerate(right[n]) if value]
        for row in range(n + 1, size):
            if matrix[row][n]:
                factor = matrix[row][n] / matrix[n][n]
                for j in beyond:
                    matrix[row][j] -= factor * matrix[n][j]
                for j in driven:
                    right[row][j] -= factor * right[n][j]
    for n in reversed(range(size)):
        beyond = [j for j in range(n + 1, size) if matrix[n][j]]
        for j in range(len(right[n])):
            value = right[n][j]
            for m in beyond:
                if right[m][j]:
                    value -= matrix[n][m] * right[m][j]
            right[n][j] = value / matrix[n][n] if value else value
    return right


def to_mp(matrix: Inexact[np.ndarray, "row column"]) -> Matrix:
    """Convert doubles to mpmath numbers."""
    mp = context()
    return [
        [
            mp.zero if v == 0 else mp.mpc(complex(v)) if np.imag(v) else mp.mpf(float(np.real(v)))
            for v in row
        ]
        for row in matrix
    ]


def response(
    model: LinearSystem,
    omega: Float[np.ndarray, " frequency"],
    drive: Float[np.ndarray, " coordinate"],
    row: Float[np.ndarray, " coordinate"],
) -> Complex[np.ndarray, " frequency"]:
    """Solve for the response of a linear form `row` to a motion `drive` of the support.

    The weights and functions of the model's pencil, in doubles, are summed in 50 digits; omega in
    rad/s.
    """
    result, pencil = np.zeros(len(omega), dtype=complex), Pencil.of(model)
    there = pencil.at(omega)
    for block in pencil.blocks:
        if not row[block.keep].any() or not drive[:6][block.pull].any():
            continue
        here = block.at(there)
        for n in range(len(omega)):
            whole = _equations(here, n)
            right = [[-_dot(drive[:6], line[:6])] for line in whole]
            moved = eliminate([line[6:] for line in whole], right)
            result[n] += complex(_dot(row[block.keep], [x[0] for x in moved]))
    return result + row[:6] @ drive[:6]


def _equations(here: EvaluatedBlock, n: int) -> Matrix:
    """Sum the elements of a block at its n-th frequency in 50 digits."""
    mp, size = context(), len(here.block.owner)
    result = [[mp.zero] * (6 + size) for _ in range(size)]
    for part, functions in zip(here.block.parts, here.functions, strict=True):
        values = to_mp(functions[:, n : n + 1])
        for k, i, j in zip(*np.nonzero(part.weights), strict=True):
            result[part.row[i]][part.column[j]] += (
                mp.mpf(float(part.weights[k, i, j])) * values[k][0]
            )
    return result


def _dot(factors: Float[np.ndarray, " _"], numbers: list[Number]) -> Number:
    """Scalar product of doubles with the first of some mpmath numbers."""
    mp = context()
    return sum((mp.mpf(float(a)) * b for a, b in zip(factors, numbers, strict=False) if a), mp.zero)


def driven_motion(
    matrix: Inexact[np.ndarray, "size size"], force: Float[np.ndarray, " coordinate"]
) -> Complex[np.ndarray, " coordinate"]:
    """Solve for the motion of a block under a force, from its dynamic stiffness."""
    right = np.pad(force, (0, len(matrix) - len(force)))[:, None]
    moved = eliminate(to_mp(matrix), to_mp(right))
    return np.array([complex(x[0]) for x in moved[: len(force)]])


def omega_squared(model: LinearSystem) -> Float[np.ndarray, " mode"]:
    """Solve for omega^2 of K and M, ascending, (rad/s)^2; rigid modes are exactly 0."""
    mp, found = context(), []
    for block in model.blocks:
        light = model.massless[block]
        a, b = block[~light], block[light]
        if not len(a):
            continue
        k, m = (mp.matrix(to_mp(matrix[np.ix_(a, a)])) for matrix in (model.stiffness, model.mass))
        if len(b):
            across = to_mp(model.stiffness[np.ix_(b, a)])
            followed = eliminate(
                to_mp(model.stiffness[np.ix_(b, b)]), [list(line) for line in across]
            )
            k = k - mp.matrix(across).T * mp.matrix(followed)
        lower = mp.cholesky(m) ** -1
        values = mp.eigsy(lower * k * lower.T, eigvals_only=True)
        rounded = np.array([float(value) for value in values])
        found.append(np.where(np.abs(rounded) < RIGID * np.abs(rounded).max(), 0.0, rounded))
    return np.sort(np.concatenate(found))
