"""Products, inverses and solutions of many small matrices at once, stacked on the last axis."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Inexact


def multiply(
    a: Inexact[np.ndarray, "row inner _"], b: Inexact[np.ndarray, "inner column _"]
) -> Inexact[np.ndarray, "row column _"]:
    """Multiply matrices, (p, r, P) = (p, q, P) (q, r, P), one of them perhaps constant (P = 1)."""
    if b.shape[-1] == 1:
        return b[..., 0].T @ a
    if a.shape[-1] == 1:
        return (a[..., 0] @ b.reshape(len(b), -1)).reshape(-1, *b.shape[1:])
    result = a[:, 0, None] * b[None, 0]
    for q in range(1, a.shape[1]):
        result += a[:, q, None] * b[None, q]
    return result


def inverse(
    matrix: Inexact[np.ndarray, "size size system"],
) -> Inexact[np.ndarray, "size size system"]:
    """Invert matrices (s, s, P) by elimination without pivoting, in closed form for s of 1 and 2.

    Small pivots cost digits, so the solutions need a check.
    """
    if len(matrix) == 1:
        return 1.0 / matrix
    if len(matrix) == 2:
        a, b, d = matrix[0, 0], matrix[0, 1], matrix[1, 1]
        inverse_determinant = 1.0 / (a * d - b * b)
        result = np.empty(matrix.shape, dtype=inverse_determinant.dtype)
        np.multiply(d, inverse_determinant, out=result[0, 0])
        np.multiply(a, inverse_determinant, out=result[1, 1])
        np.multiply(b, -inverse_determinant, out=result[0, 1])
        result[1, 0] = result[0, 1]
        return result
    result = np.array(matrix)
    for n in range(len(result)):
        pivot = 1.0 / result[n, n]
        column = result[:, n].copy()
        row = result[n] * pivot
        result -= column[:, None] * row
        result[:, n] = column * -pivot
        result[n] = row
        result[n, n] = pivot
    return result


def dense(
    matrix: Inexact[np.ndarray, "size size system"], rhs: Inexact[np.ndarray, "size column system"]
) -> Inexact[np.ndarray, "size column system"]:
    """Solve systems (s, s, P) for (s, k, P) by LU with partial pivoting (LAPACK).

    The solution is not finite where a matrix is singular to the last bit.
    """
    if len(matrix) <= 2:
        with np.errstate(divide="ignore", invalid="ignore"):
            return multiply(inverse(matrix), rhs)
    size = np.abs(matrix).max(1)
    # powers of 2: pivots do not depend on units, and scaling does not round
    scale = np.exp2(-np.rint(np.log2(np.where(size > 0, size, 1.0)) / 2))
    return scale[:, None] * _apply_to_stack(
        np.linalg.solve, matrix * scale[:, None] * scale, scale[:, None] * rhs
    )


def solve_each(
    matrix: Inexact[np.ndarray, "*batch size size"],
    right: Inexact[np.ndarray, "*#batch size column"],
) -> Inexact[np.ndarray, "*batch size column"]:
    """Solve stacked systems; NaN where they are singular."""
    try:
        return np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        if matrix.ndim == 2:
            return np.full(right.shape, np.nan)
        right = np.broadcast_to(right, (*matrix.shape[:-2], *right.shape[-2:]))
        return np.stack([solve_each(m, r) for m, r in zip(matrix, right, strict=True)])


def _apply_to_stack(
    function: Callable[..., np.ndarray],
    matrix: Inexact[np.ndarray, "size size system"],
    *rhs: Inexact[np.ndarray, "size column system"],
) -> Inexact[np.ndarray, "size _ system"]:
    """Apply a function of stacks (P, ., .) to arrays (., ., P); NaN where a matrix is singular.

    LAPACK would reject the whole stack for one singular matrix.
    """
    stack, right = np.moveaxis(matrix, -1, 0), [np.moveaxis(part, -1, 0) for part in rhs]
    try:
        result = function(stack, *right)
    except np.linalg.LinAlgError:
        singular = np.linalg.slogdet(stack)[0] == 0
        result = function(np.where(singular[:, None, None], np.nan, stack), *right)
    return np.moveaxis(result, 0, -1)
