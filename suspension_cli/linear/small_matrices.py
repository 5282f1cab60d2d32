"""Solutions of many small systems at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Inexact


def dense(
    matrix: Inexact[np.ndarray, "size size system"], rhs: Inexact[np.ndarray, "size column system"]
) -> Inexact[np.ndarray, "size column system"]:
    """Solve systems, stacked on the last axis, by LU with partial pivoting (LAPACK).

    The solution is not finite where a matrix is singular to the last bit.
    """
    size = np.abs(matrix).max(1)
    # powers of 2: pivots do not depend on units, and scaling does not round
    scale = np.exp2(-np.rint(np.log2(np.where(size > 0, size, 1.0)) / 2))[:, None]
    stacked = (np.moveaxis(part, -1, 0) for part in (matrix * scale * scale[:, 0], scale * rhs))
    return scale * np.moveaxis(solve_each(*stacked), 0, -1)


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
