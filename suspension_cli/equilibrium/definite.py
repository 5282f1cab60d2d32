"""Test of symmetric matrices for positive definiteness, by Cholesky's factorisation.

The sign of a determinant would not do: two negative eigenvalues leave it positive.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Bool, Float


def positive_definite(matrix: Float[np.ndarray, "*batch size size"]) -> Bool[np.ndarray, "*batch"]:
    """Whether each symmetric matrix (..., n, n) is positive definite, bool (...).

    A matrix with a NaN is not. No result depends on the other matrices.
    """
    matrix = np.nan_to_num(matrix, nan=0.0)
    return _factorise(matrix.reshape(-1, *matrix.shape[-2:])).reshape(matrix.shape[:-2])


def _factorise(matrix: Float[np.ndarray, "build size size"]) -> Bool[np.ndarray, " build"]:
    """Whether each matrix of a stack (p, n, n) has a Cholesky factor.

    NumPy raises if one fails, so the stack is halved until failing ones are alone.
    """
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        if len(matrix) == 1:
            return np.zeros(1, dtype=bool)
        middle = len(matrix) // 2
        return np.concatenate([_factorise(matrix[:middle]), _factorise(matrix[middle:])])
    return np.ones(len(matrix), dtype=bool)
