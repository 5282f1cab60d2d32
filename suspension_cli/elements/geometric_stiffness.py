"""Geometric stiffness: the change of a force's torque when the body on which it acts rotates.

A point at the arm w of a body moves to w + t x w + t x (t x w)/2 when the body rotates by a vector
t. The gradient F of an energy with respect to the point's position thus adds, to second order, F .
(t x (t x w))/2 to the energy, with the Hessian (F w^T + w F^T)/2 - (F . w) I in t. It is linear in
F w^T, as is the torque w x F, so these outer products are first summed over all points of a body
(compare Goldstein, Classical Mechanics, section 4.8).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Inexact, Int


def sum_by(
    index: Int[np.ndarray, " point"],
    values: Inexact[np.ndarray, "*batch point component"],
    count: int,
) -> Inexact[np.ndarray, "*batch count component"]:
    """Sum vectors (..., k, m) of equal index (k,) into (..., count, m); negative ones are omitted.

    >>> sum_by(np.array([1, 1, -1]), np.ones((3, 2)), 2)
    array([[0., 0.],
           [2., 2.]])
    """
    return (np.arange(count)[:, None] == index).astype(float) @ values


def add_arms(
    outer: Inexact[np.ndarray, "*batch 1+body 3 3"],
    body: Int[np.ndarray, " point"],
    force: Inexact[np.ndarray, "*#batch point 3"],
    arm: Inexact[np.ndarray, "*#batch point 3"],
) -> None:
    """Add F w^T of forces at points to the sum of each body, in place.

    Parameters
    ----------
    outer
        N m.
    force, arm
        Gradient of the energy with respect to each point (minus the force on the body), N, and
        vector from the COM to the point, m.
    """
    products = force[..., :, None] * arm[..., None, :]
    total = sum_by(body, products.reshape(*products.shape[:-2], 9), outer.shape[-3])
    outer += total.reshape(*total.shape[:-1], 3, 3)


def torques(outer: Inexact[np.ndarray, "*batch 3 3"]) -> Inexact[np.ndarray, "*batch 3"]:
    """Sum of w x F (..., 3), the gradient in the rotation of each body, N m, from that of F w^T."""
    return outer[..., [2, 0, 1], [1, 2, 0]] - outer[..., [1, 2, 0], [2, 0, 1]]


def rotation_hessian(
    outer: Inexact[np.ndarray, "*batch 3 3"],
) -> Inexact[np.ndarray, "*batch 3 3"]:
    """Hessian (..., n + 1, 3, 3) in the rotation of each body, N m, from the summed F w^T."""
    return (outer + np.swapaxes(outer, -1, -2)) / 2 - unit_trace(outer)


def unit_trace(matrix: Inexact[np.ndarray, "*batch 3 3"]) -> Inexact[np.ndarray, "*batch 3 3"]:
    """Multiply the unit matrix by the trace of a matrix."""
    return np.trace(matrix, axis1=-2, axis2=-1)[..., None, None] * np.eye(3)
