"""Linear algebra in 50 digits, for reference values.

A few frequencies of blocks of a dozen coordinates take tens of milliseconds.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.linear import frequency_dependent, rigid_motion_invariance
from suspension_cli.linear.graded_eigenvalues import RIGID
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact, Int
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
    """Solve linear systems by elimination with partial pivoting, skipping zeros.

    Overwrites both arguments.
    """
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


def dynamic(
    stiffness: Inexact[np.ndarray, "row column"],
    mass: Float[np.ndarray, "row column"],
    damping: Float[np.ndarray, "row column"],
    omega: float,
    low: tuple[Complex[np.ndarray, "row column"], Float[np.ndarray, "row column"]],
) -> Matrix:
    """Compute the dynamic stiffness K + i omega C - omega^2 M, omega in rad/s, in 50 digits.

    `low` are the low parts of K and C, which rounding to doubles took from their elements.
    """
    mp = context()
    w = mp.mpf(float(omega))

    def element(k: complex, m: float, c: float, k_low: complex, c_low: float) -> Number:
        if not k and not m and not c:
            return mp.zero
        elastic = mp.mpc(complex(k)) + mp.mpc(complex(k_low))
        real = elastic.real - w * w * mp.mpf(float(m))
        imag = elastic.imag + w * (mp.mpf(float(c)) + mp.mpf(float(c_low)))
        return mp.mpc(real, imag) if imag else real

    return [
        [element(*values) for values in zip(*rows, strict=True)]
        for rows in zip(stiffness, mass, damping, *low, strict=True)
    ]


def _low_parts(
    model: LinearSystem, keep: Int[np.ndarray, " row"]
) -> tuple[Complex[np.ndarray, "row row+6"], Float[np.ndarray, "row row+6"]]:
    """Compute the low parts of the stiffness and the damping of some coordinates."""
    full = model.stiffness if model.lossy is None else model.lossy
    known = (None, None) if model.low is None else (np.real(model.low), np.imag(model.low))
    columns = np.concatenate([np.arange(6), keep])
    real, imag, damping = (
        rigid_motion_invariance.low_parts(matrix, model, keep, low)[0][:, columns]
        for matrix, low in zip(
            (np.real(full), np.imag(full), model.damping), (*known, None), strict=True
        )
    )
    return real + 1j * imag, damping


def to_mp(matrix: Inexact[np.ndarray, "row column"]) -> Matrix:
    """Convert a matrix of doubles to mpmath numbers."""
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

    Takes the matrices of the model at omega, rad/s, with their low parts if constant.
    """
    result = np.zeros(len(omega), dtype=complex)
    for block in frequency_dependent.build_blocks(model):
        if not row[block.keep].any() or not block.pulled(drive[:6, None]):
            continue
        low = None if block.terms else _low_parts(model, block.keep)
        for n, w in enumerate(omega):
            whole = (
                to_mp(block.at(omega[n : n + 1]).matrix[..., 0])
                if low is None
                else dynamic(block.constant, block.mass, block.damping, w, low)
            )
            right = [[-_dot(drive[:6], line[:6])] for line in whole]
            moved = eliminate([line[6:] for line in whole], right)
            result[n] += complex(_dot(row[block.keep], [x[0] for x in moved]))
    return result + row[:6] @ drive[:6]


def _dot(factors: Float[np.ndarray, " _"], numbers: list[Number]) -> Number:
    """Compute the scalar product of doubles with the first of some mpmath numbers."""
    mp = context()
    return sum((mp.mpf(float(a)) * b for a, b in zip(factors, numbers, strict=False) if a), mp.zero)


def driven_motion(
    matrix: Inexact[np.ndarray, "size size"], force: Float[np.ndarray, " coordinate"]
) -> Complex[np.ndarray, " coordinate"]:
    """Solve for the motion of a block under a force on its first coordinates.

    `matrix` is its dynamic stiffness.
    """
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
