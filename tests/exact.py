"""Responses in arithmetic of 50 digits, and how much the last digit of a model's numbers changes them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.analysis import response, signals
from suspension_cli.analysis.tradeoff.exact import context, dynamic, eliminate
from suspension_cli.mechanics.model import LinearModel

MP = context()


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
    full = model.stiffness if model.lossy is None else model.lossy
    matrix = dynamic(full, model.mass, model.damping, omega)
    given = [[MP.zero if act else MP.mpf(float(v)) for v in drive[:6]] for drive, act in zip(drives, acts, strict=True)]
    size = model.size - 6
    right: list[list[Any]] = [[] for _ in range(size)]
    for n in range(size):
        for drive, act, moved in zip(drives, acts, given, strict=True):
            value = MP.mpf(float(drive[6 + n])) if act else MP.zero
            right[n].append(value - sum((a * s for a, s in zip(matrix[6 + n][:6], moved, strict=True) if s), MP.zero))
        right[n] += [MP.mpf(float(row[6 + n])) for row in rows]  # D is symmetric, so that D y = c gives the condition
    solved = eliminate([row[6:] for row in matrix[6:]], right)
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
