"""Static condensation of massless coordinates.

Coordinates without inertia and damping, b, follow the others, a (with the support's), statically:

    x_b = K_bb^-1 (f_b - K_ba x_a),    (K_aa - K_ab K_bb^-1 K_ba) x_a + ... = f_a - K_ab K_bb^-1 f_b

(Guyan, AIAA J. 3, 380 (1965); exact here).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear.small_matrices import solve_each

if TYPE_CHECKING:
    from jaxtyping import Bool, Inexact


@dataclass(frozen=True)
class Condensed:
    """Condensed matrix; arrays with batch axes in front.

    Attributes
    ----------
    matrix
        K_aa - K_ab K_bb^-1 K_ba, towards further coordinates (the support's) and those kept.
    compliance
        K_bb^-1; NaN where K_bb is singular.
    follow
        K_bb^-1 K_ba: minus the motion of the massless coordinates per motion of the others.
    """

    matrix: Inexact[np.ndarray, "*batch kept _"]
    compliance: Inexact[np.ndarray, "*batch light light"]
    follow: Inexact[np.ndarray, "*batch light _"]


def condense(
    matrix: Inexact[np.ndarray, "*batch row column"], light: Bool[np.ndarray, " row"]
) -> Condensed:
    """Eliminate the coordinates `light` (n,) of matrices (..., n, q + n).

    Two springs of 1 and 3 N/m in series:

    >>> condense(np.array([[3.0, -3.0], [-3.0, 4.0]]), np.array([False, True])).matrix
    array([[0.75]])
    """
    extra = matrix.shape[-1] - matrix.shape[-2]
    kept, massless = np.flatnonzero(~light), np.flatnonzero(light)
    columns = np.concatenate([np.arange(extra), extra + kept])
    block = matrix[..., massless[:, None], extra + massless]
    compliance = solve_each(block, np.eye(len(massless)))
    follow = compliance @ matrix[..., massless[:, None], columns]
    result = matrix[..., kept[:, None], columns]
    if len(massless):
        result = result - matrix[..., kept[:, None], extra + massless] @ follow
        square = result[..., extra:]
        result[..., extra:] = (square + np.swapaxes(square, -1, -2)) / 2
    return Condensed(result, compliance, follow)
