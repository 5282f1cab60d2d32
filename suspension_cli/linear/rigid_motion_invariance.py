"""Low parts of stiffness and damping that follow from invariance under rigid motion.

No force arises when the support and all bodies move as one in x, y, z or yaw (roll and pitch turn
the weights). So in each row the elements towards the row's own body follow from those towards all
others:

    K_r,own = -sum over the other bodies m of K_r,m R_m,

with R_m the motion of body m in a unit rigid motion. Rounded elements satisfy this only to their
last digits. These matter when the support moves slowly: relative motion is then smaller by the
square of its frequency over that of a mode. So the elements towards a row's own body are taken as
rounded values of this sum, and their low parts are restored here.

(The GTH algorithm for Markov chains uses the same idea: Grassmann, Taksar and Heyman, Oper. Res.
33, 1107, 1985.)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear.double_double import DoubleDouble
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

TOGETHER = (0, 1, 2, 5)
"""Rigid motions that cause no force: x, y, z and yaw."""
ROUNDING = 1e-10
"""Fraction of its terms up to which the sum over all bodies counts as 0; a larger sum has a cause
(local control, dampers attached elsewhere)."""


def low_parts(
    matrix: Float[np.ndarray, "coordinate coordinate"],
    model: LinearSystem,
    rows: Int[np.ndarray, " row"],
    known: Float[np.ndarray, "coordinate coordinate"] | None = None,
) -> tuple[Float[np.ndarray, "row coordinate"], Bool[np.ndarray, " 6"]]:
    """Compute the low parts of some rows of a real stiffness or damping matrix (N, N).

    Returns
    -------
    low : (r, N) array
        To be added to the rounded elements. Those not towards a row's own body are `known`, or 0.
    free : (6,) bool array
        Whether rigid motion along each coordinate of the support causes no force in these rows.
    """
    free = np.zeros(6, dtype=bool)
    low = np.zeros((len(rows), len(matrix))) if known is None else known[rows]
    if model.rigid is None or model.ground is not None:
        return low, free
    own = np.array([_own_body(model, model.coordinate[row]) for row in rows], dtype=np.intp)
    derived = np.zeros(low.shape, dtype=bool)
    place = np.arange(len(rows))
    for dof in TOGETHER:
        column = 6 * own + dof
        moved = np.flatnonzero(model.rigid[:, dof])
        terms = DoubleDouble(matrix[rows][:, moved], low[:, moved]) * DoubleDouble.of(
            model.rigid[moved, dof]
        )
        others = moved != column[:, None]
        exact = -DoubleDouble(
            np.where(others, terms.high, 0.0), np.where(others, terms.low, 0.0)
        ).total()
        rounded = matrix[rows, column]
        difference = (exact - DoubleDouble.of(rounded)).value
        derived[place, column] = np.abs(difference) <= ROUNDING * np.abs(terms.high).sum(1)
        low[place, column] = np.where(derived[place, column], difference, low[place, column])
        free[dof] = derived[place, column].all()
    return _symmetrise(low, derived, rows), free


def _symmetrise(
    low: Float[np.ndarray, "row coordinate"],
    derived: Bool[np.ndarray, "row coordinate"],
    rows: Int[np.ndarray, " row"],
) -> Float[np.ndarray, "row coordinate"]:
    """Copy low parts across the diagonal where only one of two was computed."""
    square, known = low[:, rows], derived[:, rows]
    low[:, rows] = np.where(known.T & ~known, square.T, square)
    return low


def _own_body(model: LinearSystem, coordinate: str) -> int:
    """Number of a row's own body: a blade's tip belongs to its stage, the frame to the support."""
    name = coordinate.split(".", 1)[0]
    return model.body.index(name) + 1 if name in model.body else 0
