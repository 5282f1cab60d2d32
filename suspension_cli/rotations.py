"""Finite rotations as 3x3 matrices, with any batch axes in front."""

from __future__ import annotations

from typing import Any

import numpy as np


def cross_matrix(vector: Any) -> Any:
    """The matrices (..., 3, 3) that take w to v x w, for vectors v (..., 3)."""
    vector = np.asarray(vector)
    result = np.zeros((*vector.shape, 3), dtype=vector.dtype)
    result[..., 0, 1], result[..., 0, 2], result[..., 1, 2] = -vector[..., 2], vector[..., 1], -vector[..., 0]
    result[..., 1, 0], result[..., 2, 0], result[..., 2, 1] = vector[..., 2], -vector[..., 1], vector[..., 0]
    return result


def cross(a: Any, b: Any) -> Any:
    """Vector products (..., 3); several times quicker than `numpy.cross` on a few vectors."""
    a1, a2, a3, b1, b2, b3 = a[..., 0], a[..., 1], a[..., 2], b[..., 0], b[..., 1], b[..., 2]
    return np.stack([a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1], axis=-1)


def turning(vector: Any) -> Any:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3) in rad, less the unit matrix: all digits of however small a turn.

    Rodrigues' formula, sin(a)/a [v] + (1 - cos(a))/a^2 [v]^2, with both factors written through sinc so that
    neither cancels as the angle a goes to 0.  Complex vectors work too (complex-step derivatives).
    """
    vector = np.asarray(vector)
    angle = np.sqrt((vector**2).sum(-1))[..., None, None]
    cross = cross_matrix(vector)
    return np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * (cross @ cross)


def rotation_matrix(vector: Any) -> Any:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3) in rad: the exponential of `cross_matrix`."""
    return np.eye(3) + turning(vector)
