"""What a stiffness or damping matrix owes to this: moving everything together costs nothing.

When the support and all bodies move as one (in x, y, z or by yaw; roll and pitch turn the weights), no force arises.
So of each row of the matrix, the elements towards the row's own body follow from those towards all others:

    K_r,own = -sum over the other bodies m of K_r,m R_m,

with R the motion of each body for a unit motion of everything.  Rounded elements obey it to their last digits only, which a
slow support makes the first ones: what remains of its motion then is the square of its frequency against that of a mode.  So
the elements towards a row's own body are taken as rounded values of that sum, and what was rounded away is restored here.

(The same thought makes the GTH algorithm for Markov chains exact: Grassmann, Taksar, Heyman, Oper. Res. 33, 1107, 1985.)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.design.scene import Index
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.mechanics.twofold import Twofold

TOGETHER = (0, 1, 2, 5)
"""Motions of everything that cost nothing: x, y, z and yaw."""
ROUNDING = 1e-10
"""Share of the sum of its terms up to which the sum above counts as 0: more is no rounding error but a term (local control, dampers drawn elsewhere)."""


def completed(matrix: Any, model: LinearModel, rows: Index, known: Any = None) -> tuple[Any, Any]:
    """What rounding took from some rows of a matrix, and for which motions of everything they feel nothing.

    Parameters
    ----------
    matrix : (N, N) array
        Stiffness or damping, real.
    model : LinearModel
    rows : (r,) int array
    known : (N, N) array, optional
        What is known to be missing from the rounded elements; only those towards a row's own body follow from the others.

    Returns
    -------
    low : (r, N) array
        To be added to the rounded elements; of the order of their last digits.
    free : (6,) bool array
        Whether moving everything along each coordinate of the support costs nothing in any of these rows.
    """
    free = np.zeros(6, dtype=bool)
    low = np.zeros((len(rows), len(matrix))) if known is None else known[rows]
    if model.rigid is None:
        return low, free
    own = np.array([_own(model, model.coordinate[row]) for row in rows], dtype=np.intp)
    held = np.zeros(low.shape, dtype=bool)
    place = np.arange(len(rows))
    for dof in TOGETHER:
        column = 6 * own + dof
        moved = np.flatnonzero(model.rigid[:, dof])
        terms = Twofold(matrix[rows][:, moved], low[:, moved]) * Twofold.of(model.rigid[moved, dof])
        others = moved != column[:, None]
        rest = -Twofold(np.where(others, terms.high, 0.0), np.where(others, terms.low, 0.0)).total()
        here = matrix[rows, column]
        difference = (rest - Twofold.of(here)).value
        held[place, column] = np.abs(difference) <= ROUNDING * np.abs(terms.high).sum(1)
        low[place, column] = np.where(held[place, column], difference, low[place, column])
        free[dof] = held[place, column].all()
    return _both_ways(low, held, rows), free


def completed_forms(form: Any, rigid: Any, body: Index) -> Any:
    """What rounding took from the elements towards one body each of forms (w, N) that feel nothing when everything moves together: (w, N)."""
    low, place = np.zeros_like(form), np.arange(len(form))
    for dof in TOGETHER:
        column = 6 * body + dof
        others = np.arange(form.shape[1]) != column[:, None]
        terms = Twofold(np.where(others, form, 0.0), np.where(others, low, 0.0)) * Twofold.of(np.broadcast_to(rigid[:, dof], form.shape))
        low[place, column] = (-terms.total() - Twofold.of(form[place, column])).value
    return low


def _both_ways(low: Any, held: Any, rows: Index) -> Any:
    """The same correction on either side of the diagonal, where only one of the two elements follows from its row."""
    square, known = low[:, rows], held[:, rows]
    low[:, rows] = np.where(known.T & ~known, square.T, square)
    return low


def _own(model: LinearModel, coordinate: str) -> int:
    """The body whose coordinates a row's own elements stand at: a blade's tip goes with its stage, the frame's motion with the ground's."""
    name = coordinate.split(".", 1)[0]
    return model.body.index(name) + 1 if name in model.body else 0
