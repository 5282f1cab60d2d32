"""Which symmetric matrices of a stack are positive definite, told from the pivots of Cholesky's factorisation.

A determinant's sign would not do: two negative eigenvalues leave it positive.
"""

from __future__ import annotations

from typing import Any

import numpy as np


def positive_definite(matrix: Any) -> Any:
    """Which symmetric matrices (..., n, n) are positive definite, bool (...), each alone; those with a NaN are not."""
    matrix = np.nan_to_num(matrix, nan=0.0)
    return _definite(matrix.reshape(-1, *matrix.shape[-2:])).reshape(matrix.shape[:-2])


def _definite(matrix: Any) -> Any:
    """LAPACK gives up on a whole stack (p, n, n) if one fails, so that is halved until the failing ones are alone."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        if len(matrix) == 1:
            return np.zeros(1, dtype=bool)
        middle = len(matrix) // 2
        return np.concatenate([_definite(matrix[:middle]), _definite(matrix[middle:])])
    return np.ones(len(matrix), dtype=bool)
