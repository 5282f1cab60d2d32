"""Responses in arithmetic of 50 digits, and how much the last digit of a model's numbers changes them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mpmath
import numpy as np

from suspension_cli.analysis import response, signals
from suspension_cli.mechanics.model import LinearModel

MP = mpmath.mp.clone()
MP.dps = 50


@dataclass(frozen=True)
class Compared:
    """A response against the exact one, all (f, o, i).

    Attributes
    ----------
    exact : complex array
        Rounded to double precision at the end.
    error : array
        |found - exact| / |exact|, the difference taken in 50 digits; where exact is 0, found must be 0 too and this is 0.
    condition : array
        |y|^T (|K| + omega |C| + omega^2 |M|) |x| / |H| + |c| |x| / |H| for H = c x, D x = b, D y = c: what relative errors of 1 in every
        element of K, C, M and c (each by itself) would do to H, to first order (Higham 2002, section 7.2).
    """

    exact: Any
    error: Any
    condition: Any


def compare(model: LinearModel, frequency: Any, inputs: list[Any], outputs: list[Any]) -> Compared:
    """`response.solve` against LU with partial pivoting in 50 digits of the very same matrices, tips without mass included."""
    omega = 2 * np.pi * np.asarray(frequency, dtype=float)
    drives, rows = (np.array([signals.row(signal, model) for signal in group]) for group in (inputs, outputs))
    acts = [signal.acts for signal in inputs]
    found, _ = response.transfer(model, omega, drives, acts, rows)
    parts = [_at(model, w, drives, acts, rows, found[n]) for n, w in enumerate(omega)]
    return Compared(*(np.array([part[k] for part in parts]) for k in range(3)))


def _at(model: LinearModel, omega: float, drives: Any, acts: list[bool], rows: Any, found: Any) -> tuple[Any, Any, Any]:
    w = MP.mpf(float(omega))
    full = model.stiffness if model.lossy is None else model.lossy
    dynamic = _dynamic(full, model.mass, model.damping, w)
    given = [[MP.zero if act else MP.mpf(float(v)) for v in drive[:6]] for drive, act in zip(drives, acts, strict=True)]
    size = model.size - 6
    right: list[list[Any]] = [[] for _ in range(size)]
    for n in range(size):
        for drive, act, moved in zip(drives, acts, given, strict=True):
            value = MP.mpf(float(drive[6 + n])) if act else MP.zero
            right[n].append(value - sum((a * s for a, s in zip(dynamic[6 + n][:6], moved, strict=True) if s), MP.zero))
        right[n] += [MP.mpf(float(row[6 + n])) for row in rows]  # D is symmetric, so that D y = c gives the condition
    solved = eliminate([row[6:] for row in dynamic[6:]], right)
    k, exact, error = len(drives), np.zeros(found.shape, dtype=complex), np.zeros(found.shape)
    whole = [[moved[n] for moved in given] for n in range(6)] + [row[:k] for row in solved]
    for o, row in enumerate(rows):
        for i in range(k):
            value = sum((MP.mpf(float(c)) * whole[n][i] for n, c in enumerate(row) if c), MP.zero)
            exact[o, i] = complex(value)
            difference = abs(MP.mpc(complex(found[o, i])) - value)
            error[o, i] = float(difference / abs(value)) if value else (0.0 if found[o, i] == 0 else np.inf)
    x, y = (abs(np.array([[complex(v) for v in row] for row in part])) for part in (whole, [row[k:] for row in solved]))
    size = abs(full.real) + abs(full.imag) + omega * abs(model.damping) + omega**2 * abs(model.mass)
    moved = y.T @ size[6:] @ x + abs(rows) @ x
    return exact, error, moved / np.where(exact == 0, 1.0, abs(exact))


def _dynamic(stiffness: Any, mass: Any, damping: Any, w: Any) -> list[list[Any]]:
    """K + i w C - w^2 M, every element exact to 50 digits."""

    def element(k: complex, m: float, c: float) -> Any:
        if not k and not m and not c:
            return MP.zero
        real, imag = MP.mpf(float(k.real)) - w * w * MP.mpf(float(m)), MP.mpf(float(k.imag)) + w * MP.mpf(float(c))
        return MP.mpc(real, imag) if imag else real

    return [[element(k, m, c) for k, m, c in zip(*rows, strict=True)] for rows in zip(stiffness, mass, damping, strict=True)]


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
