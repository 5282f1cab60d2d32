"""Many small systems at once, the last axis counting them: products, inverses, solutions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np


def multiply(a: Any, b: Any) -> Any:
    """Matrix products (p, r, P) of (p, q, P) and (q, r, P), system by system."""
    if a.shape[1] > 3:
        return np.einsum("pqf,qrf->prf", a, b)
    result = a[:, 0, None] * b[None, 0]
    for q in range(1, a.shape[1]):
        result += a[:, q, None] * b[None, q]
    return result


def inverse(matrix: Any) -> Any:
    """Inverses (s, s, P) of symmetric matrices, in closed form for s of 1 and 2."""
    if len(matrix) == 1:
        return 1.0 / matrix
    if len(matrix) == 2:
        a, b, d = matrix[0, 0], matrix[0, 1], matrix[1, 1]
        over = 1.0 / (a * d - b * b)
        result = np.empty(matrix.shape, dtype=over.dtype)
        np.multiply(d, over, out=result[0, 0])
        np.multiply(a, over, out=result[1, 1])
        np.multiply(b, -over, out=result[0, 1])
        result[1, 0] = result[0, 1]
        return result
    return _stacked(np.linalg.inv, matrix)


def dense(matrix: Any, rhs: Any) -> Any:
    """Solve by LU with partial pivoting, one system at a time (LAPACK); what is singular to the last bit gives no finite number."""
    if len(matrix) <= 2:
        with np.errstate(divide="ignore", invalid="ignore"):
            return multiply(inverse(matrix), rhs)
    size = np.abs(matrix).max(1)
    scale = np.exp2(-np.rint(np.log2(np.where(size > 0, size, 1.0)) / 2))  # pivots are chosen whatever the units, and nothing is rounded
    return scale[:, None] * _stacked(np.linalg.solve, matrix * scale[:, None] * scale, scale[:, None] * rhs)


def _stacked(function: Callable[..., Any], matrix: Any, *rhs: Any) -> Any:
    """A function of stacks (P, ., .) on arrays (., ., P); NaN for a matrix that is singular to the last bit, where LAPACK gives up on all."""
    stack, right = np.moveaxis(matrix, -1, 0), [np.moveaxis(part, -1, 0) for part in rhs]
    try:
        result = function(stack, *right)
    except np.linalg.LinAlgError:
        singular = np.linalg.slogdet(stack)[0] == 0
        result = function(np.where(singular[:, None, None], np.nan, stack), *right)
    return np.moveaxis(result, 0, -1)
