"""Eigenvalues of stiffness against mass, the small ones with as many digits as the large ones.

A symmetric eigenvalue solver leaves rounding errors of the largest omega^2 in all of them: with wires 1e12 times stiffer along
than across, 1e-4 of a pendulum mode is gone.  Its vectors, though, are off the space of the soft modes only by a rounding error
d, and Rayleigh quotients feel that in second order (d^2 times the stiffness ratio).  So K and M are projected on the soft modes,
whose own scale is small, and solved again by themselves; and so on until all that is left is of one size (Parlett, The Symmetric
Eigenvalue Problem, chapter 11).  What K itself has rounded away stays lost: see `rounding`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.design.scene import Array
from suspension_cli.mechanics.model import LinearModel

APART = 1e-3
"""Modes below this share of the largest omega^2 are solved again by themselves: they keep all but three digits at worst."""
EPS = np.finfo(float).eps


def solve(mass: Array, stiffness: Array) -> tuple[Any, Any]:
    """Eigenvalues (m,), ascending, and shapes (c, m) of unit modal mass.

    Parameters
    ----------
    mass : (c, c) array
        kg, kg m^2; positive definite.
    stiffness : (c, c) array
        N/m, N m/rad; symmetric.
    """
    inverse = np.linalg.inv(np.linalg.cholesky(mass))
    dynamic = inverse @ stiffness @ inverse.T
    values, vectors = np.linalg.eigh((dynamic + dynamic.T) / 2)
    shapes = inverse.T @ vectors
    soft = np.abs(values) < APART * np.abs(values).max()
    if not soft.any():
        return values, shapes
    own = shapes[:, soft]
    less_mass, less_stiffness = own.T @ mass @ own, own.T @ stiffness @ own
    values[soft], within = solve((less_mass + less_mass.T) / 2, (less_stiffness + less_stiffness.T) / 2)
    shapes[:, soft] = own @ within
    return values, shapes


def rounding(stiffness: Array, shapes: Array) -> Array:
    """What errors in the last digit of every element of K do to omega^2 at most: eps |v|^T |K| |v| for shapes v (m, N) of unit modal mass, (rad/s)^2."""
    size = np.abs(shapes)
    return EPS * np.einsum("mi,ij,mj->m", size, np.abs(stiffness), size)


def hanging(model: LinearModel) -> float:
    """omega^2 of the softest translation of any body by its own stiffness: what tension over length gives, (rad/s)^2."""
    own = np.diag(model.stiffness)[6 : 6 * (len(model.body) + 1)].reshape(-1, 6)[:, :3]
    mass = np.diag(model.mass)[6 : 6 * (len(model.body) + 1)].reshape(-1, 6)[:, :3]
    return float(np.abs(own / mass).min(1).max())


def lost(model: LinearModel, omega_squared: Array, shape: Array) -> Any:
    """Relative error (m,) of each mode's frequency that rounding in the stiffness matrix may have left; infinite for a rigid mode, which has no digit.

    Parameters
    ----------
    model : LinearModel
    omega_squared : (m,) array
        (rad/s)^2.
    shape : (m, N - 6) array
        Of unit modal mass, in the named coordinates, as `modes.Modes` has them.
    """
    adapted = np.pad(shape, ((0, 0), (6, 0))) @ model.basis  # the basis is orthogonal
    size = rounding(model.stiffness, adapted)
    return np.where(omega_squared != 0, size / (2 * np.abs(np.where(omega_squared == 0, 1.0, omega_squared))), np.inf)
