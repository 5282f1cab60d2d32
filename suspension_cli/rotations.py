"""Finite rotations as 3x3 matrices, and vector products, with any batch axes in front."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Inexact


def cross_matrix(vector: Inexact[np.ndarray, "*batch 3"]) -> Inexact[np.ndarray, "*batch 3 3"]:
    """Matrices [v] (..., 3, 3) of vectors v (..., 3), such that [v] w = v x w."""
    vector = np.asarray(vector)
    result = np.zeros((*vector.shape, 3), dtype=vector.dtype)
    x = vector[..., 0]
    y = vector[..., 1]
    z = vector[..., 2]
    result[..., 0, 1] = -z
    result[..., 0, 2] = y
    result[..., 1, 0] = z
    result[..., 1, 2] = -x
    result[..., 2, 0] = -y
    result[..., 2, 1] = x
    return result


def cross(
    a: Inexact[np.ndarray, "... 3"], b: Inexact[np.ndarray, "... 3"]
) -> Inexact[np.ndarray, "... 3"]:
    """Vector products (..., 3); several times faster than `numpy.cross` for a few vectors."""
    a1 = a[..., 0]
    a2 = a[..., 1]
    a3 = a[..., 2]
    b1 = b[..., 0]
    b2 = b[..., 1]
    b3 = b[..., 2]
    first = a2 * b3 - a3 * b2
    result = np.empty((*first.shape, 3), dtype=first.dtype)
    result[..., 0] = first
    result[..., 1] = a3 * b1 - a1 * b3
    result[..., 2] = a1 * b2 - a2 * b1
    return result


def rigid_motion(
    size: int, position: Inexact[np.ndarray, "*batch 1+body 3"]
) -> Inexact[np.ndarray, "*batch coordinate 6"]:
    """Motion (..., N, 6) of all coordinates when bodies move rigidly with the support.

    For unit motions of the support, in m and rad. Of the N = `size` coordinates, those after the
    bodies' are relative to a body, and stay 0. `position` are the COMs, m, first the support's.
    """
    position = np.asarray(position, dtype=float)
    arms = position - position[..., :1, :]
    result = np.zeros((*arms.shape[:-2], size, 6))
    for n in range(arms.shape[-2]):
        result[..., 6 * n : 6 * n + 6, :] = np.eye(6)
        result[..., 6 * n : 6 * n + 3, 3:] = -cross_matrix(arms[..., n, :])
    return result


def turn_by(vector: Inexact[np.ndarray, " 3 *batch"]) -> Inexact[np.ndarray, "3 3 *batch"]:
    """Rotation matrices minus the unit matrix of rotation vectors in rad, components first.

    Without the unit matrix, small rotations keep all their digits. Rodrigues' formula,
    sin(a)/a [v] + (1 - cos(a))/a^2 (v v^T - a^2), with both factors written as sinc: neither
    cancels for small angles a. Complex vectors are allowed (complex-step derivatives).
    """
    square = vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2
    angle = np.sqrt(square)
    sine = np.sinc(angle / np.pi)
    half = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    result = half * vector[:, None] * vector
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        result[i, i] = -half * (vector[j] ** 2 + vector[k] ** 2)
        result[i, j] -= sine * vector[k]
        result[j, i] += sine * vector[k]
    return result


def rotation_minus_identity(
    vector: Inexact[np.ndarray, "*batch 3"],
) -> Inexact[np.ndarray, "*batch 3 3"]:
    """Rotation matrices minus the unit matrix, (..., 3, 3), of rotation vectors (..., 3) in rad."""
    return np.moveaxis(turn_by(np.moveaxis(np.asarray(vector), -1, 0)), (0, 1), (-2, -1))


def rotation_matrix(vector: Inexact[np.ndarray, "*batch 3"]) -> Inexact[np.ndarray, "*batch 3 3"]:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3) in rad, exp([v])."""
    return np.eye(3) + rotation_minus_identity(vector)


def rotation_vector(turn: Inexact[np.ndarray, "*batch 3 3"]) -> Inexact[np.ndarray, "*batch 3"]:
    """Rotation vectors (..., 3), rad, of rotation matrices minus the unit matrix (..., 3, 3).

    Inverse of `rotation_minus_identity` for rotations below pi. The antisymmetric part of R is
    sin(a) [n] and its trace 1 + 2 cos(a), for the angle a about the axis n.
    """
    turn = np.asarray(turn)
    sine = (
        np.stack(
            [
                turn[..., 2, 1] - turn[..., 1, 2],
                turn[..., 0, 2] - turn[..., 2, 0],
                turn[..., 1, 0] - turn[..., 0, 1],
            ],
            axis=-1,
        )
        / 2
    )
    size = np.sqrt((sine**2).sum(-1))
    angle = np.arctan2(size, 1 + np.trace(turn, axis1=-2, axis2=-1) / 2)
    factor = np.divide(angle, size, out=np.ones_like(size), where=size > 0)
    return factor[..., None] * sine
