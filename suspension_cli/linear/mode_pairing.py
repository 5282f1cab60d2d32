"""One-to-one pairing of the modes of two models or designs by their shapes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact, Int


def pair_by_overlap(overlap: Float[np.ndarray, "row column"]) -> Int[np.ndarray, " row"]:
    """Pair rows with columns one to one for the largest sum of overlaps.

    Returns the column of each row; -1 for rows without partner, if there are fewer columns than
    rows.

    >>> pair_by_overlap([[0.9, 0.8], [0.7, 0.1]])
    array([1, 0])
    """
    overlap = np.asarray(overlap, dtype=float)
    if not overlap.size:
        return np.full(len(overlap), -1)
    choice = overlap.argmax(1)
    if len(set(choice.tolist())) == len(choice):  # no sum exceeds that of the row maxima
        return choice
    from scipy.optimize import linear_sum_assignment

    rows, columns = linear_sum_assignment(overlap, maximize=True)
    choice = np.full(len(overlap), -1)
    choice[rows] = columns
    return choice


def pair_by_shape(
    before: Float[np.ndarray, "mode coordinate"], after: Float[np.ndarray, "mode coordinate"]
) -> tuple[Int[np.ndarray, " mode"], Float[np.ndarray, " mode"]]:
    """Pair the modes of two designs by their orthonormal shapes, as in `batch_modes.Spectrum`.

    Returns
    -------
    choice : (m,) int array
        The mode of the second design paired with each of the first.
    overlap : (m,) array
        Squared scalar products: 1 for equal shapes.
    """
    overlap = (np.asarray(before, dtype=float) @ np.asarray(after, dtype=float).T) ** 2
    choice = pair_by_overlap(overlap)
    return choice, overlap[np.arange(len(choice)), choice]


def body_overlap(
    rows: Inexact[np.ndarray, "row _"],
    columns: Inexact[np.ndarray, "column _"],
    mass: Float[np.ndarray, "moving moving"],
) -> Float[np.ndarray, "row column"]:
    """Overlaps |u^T M v| of mode shapes in the motion of bodies, with their mass matrix M.

    Models with different coordinates of blade tips or wires share these. Shapes have unit modal
    mass, in the named coordinates.
    """
    count = len(mass)
    return np.abs(rows[:, :count] @ mass @ columns[:, :count].T)
