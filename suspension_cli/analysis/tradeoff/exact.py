"""Arithmetic of 50 digits, for the references that double precision cannot give.

Slow and plain: a handful of frequencies and blocks of a dozen coordinates take some tens of milliseconds.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from suspension_cli.analysis.graded import RIGID
from suspension_cli.design.scene import Array
from suspension_cli.mechanics import dispersive
from suspension_cli.mechanics.model import LinearModel

DIGITS = 50


@cache
def context() -> Any:
    """The numbers (mpmath, which only this needs, so it is imported only here)."""
    import mpmath

    numbers = mpmath.mp.clone()
    numbers.dps = DIGITS
    return numbers


def eliminate(matrix: list[list[Any]], right: list[list[Any]]) -> list[list[Any]]:
    """Gaussian elimination with partial pivoting that skips zeros; both arguments are used up."""
    size = len(matrix)
    for n in range(size):
        pivot = max(range(n, size), key=lambda row: abs(matrix[row][n]))
        matrix[n], matrix[pivot], right[n], right[pivot] = matrix[pivot], matrix[n], right[pivot], right[n]
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


def dynamic(stiffness: Any, mass: Any, damping: Any, omega: float) -> list[list[Any]]:
    """K + i omega C - omega^2 M, every element exact to 50 digits."""
    mp = context()
    w = mp.mpf(float(omega))

    def element(k: complex, m: float, c: float) -> Any:
        if not k and not m and not c:
            return mp.zero
        real, imag = mp.mpf(float(k.real)) - w * w * mp.mpf(float(m)), mp.mpf(float(k.imag)) + w * mp.mpf(float(c))
        return mp.mpc(real, imag) if imag else real

    return [[element(k, m, c) for k, m, c in zip(*rows, strict=True)] for rows in zip(stiffness, mass, damping, strict=True)]


def converted(matrix: Any) -> list[list[Any]]:
    """An array of doubles, number by number."""
    mp = context()
    return [[mp.zero if v == 0 else mp.mpc(complex(v)) if np.imag(v) else mp.mpf(float(np.real(v))) for v in row] for row in matrix]


def response(model: LinearModel, omega: Array, drive: Array, row: Array) -> Any:
    """Response (f,) of a linear form (N,) of the coordinates to a motion of the support (N,), on the model's very own matrices."""
    mp = context()
    result = np.zeros(len(omega), dtype=complex)
    for block in dispersive.blocks(model):
        if not row[block.keep].any() or not block.pulled(drive[:6, None]):
            continue
        for n, w in enumerate(omega):
            now = block.at(omega[n : n + 1])
            whole = converted(now.matrix[..., 0]) if block.terms else dynamic(block.constant, block.mass, block.damping, w)
            right = [[-sum((a * mp.mpf(float(s)) for a, s in zip(line[:6], drive[:6], strict=True) if s), mp.zero)] for line in whole]
            moved = eliminate([line[6:] for line in whole], right)[: len(block.keep)]
            result[n] += complex(sum((mp.mpf(float(c)) * x[0] for c, x in zip(row[block.keep], moved, strict=True) if c), mp.zero))
    return result + row[:6] @ drive[:6]


def pushed(matrix: Any, force: Array) -> Any:
    """Motion (c,) of a block under a force (c,): the first coordinates of a dynamic stiffness (c + t, c + t)."""
    mp = context()
    moved = eliminate(converted(matrix), [[mp.mpf(float(f))] for f in np.append(force, np.zeros(len(matrix) - len(force)))])
    return np.array([complex(x[0]) for x in moved[: len(force)]])


def omega_squared(model: LinearModel) -> Array:
    """All eigenvalues of (K, M), ascending, (rad/s)^2; coordinates without mass eliminated in 50 digits too."""
    mp, found = context(), []
    for block in model.blocks:
        light = model.massless[block]
        a, b = block[~light], block[light]
        if not len(a):
            continue
        k, m = (mp.matrix(converted(matrix[np.ix_(a, a)])) for matrix in (model.stiffness, model.mass))
        if len(b):
            across = converted(model.stiffness[np.ix_(b, a)])
            followed = eliminate(converted(model.stiffness[np.ix_(b, b)]), [list(line) for line in across])
            k = k - mp.matrix(across).T * mp.matrix(followed)
        lower = mp.cholesky(m) ** -1
        values = mp.eigsy(lower * k * lower.T, eigvals_only=True)
        rounded = np.array([float(value) for value in values])
        found.append(np.where(np.abs(rounded) < RIGID * np.abs(rounded).max(), 0.0, rounded))
    return np.sort(np.concatenate(found))
