"""Eigenvalues of stiffness against mass, the small ones with as many digits as the large ones.

A symmetric eigenvalue solver leaves rounding errors of the largest omega^2 in all of them: with wires 1e12 times stiffer along
than across, 1e-4 of a pendulum mode is gone.  Its vectors, though, are off the space of the soft modes only by a rounding error
d, and Rayleigh quotients feel that in second order (d^2 times the stiffness ratio).  So K and M are projected on the soft modes,
whose own scale is small, and solved again by themselves; and so on until all that is left is of one size (Parlett, The Symmetric
Eigenvalue Problem, chapter 11).  Where it is known what rounding has taken from K, it is projected in twofold arithmetic, and leaning wires or blades
with tip masses keep their soft part however stiff they are; else that stays lost: see `rounding`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.design.scene import Array
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.mechanics.twofold import Twofold

APART = 1e-3
"""Modes below this share of the largest omega^2 are solved again by themselves: they keep all but three digits at worst."""
WIDE = 1e-6
"""Share of the largest omega^2 below which the batched solver loses more than 1e-9 of a mode."""
RIGID = 64 * np.finfo(float).eps
"""omega^2 below this share of what it is a sum of is a rounding error: the mode costs nothing."""
TURNING = 1e3
"""omega^2 that tension gives a rotation over what it gives a translation, at most: m times lever arm squared over inertia."""
EPS = np.finfo(float).eps


def solve(mass: Array, stiffness: Array, low: Array | None = None) -> tuple[Any, Any]:
    """Eigenvalues (..., m), ascending, and shapes (..., c, m) of unit modal mass.

    Parameters
    ----------
    mass : (..., c, c) array
        kg, kg m^2; positive definite.
    stiffness : (..., c, c) array
        N/m, N m/rad; symmetric.
    low : (c, c) array, optional
        What rounding has taken from the elements of one stiffness (c, c).
    """
    if stiffness.ndim == 2:
        values, shapes = solve(mass[None], stiffness[None], low)
        return values[0], shapes[0]
    inverse = np.linalg.inv(np.linalg.cholesky(mass))
    dynamic = inverse @ stiffness @ np.swapaxes(inverse, -1, -2)
    values, vectors = np.linalg.eigh((dynamic + np.swapaxes(dynamic, -1, -2)) / 2)
    shapes = np.swapaxes(inverse, -1, -2) @ vectors
    soft = np.abs(values) < APART * np.abs(values).max(-1, keepdims=True)
    for kind, here in _kinds(soft):
        if not kind.any():
            continue
        own = shapes[here][:, :, kind]
        across = np.swapaxes(own, -1, -2)
        less_mass, less_stiffness = (across @ matrix[here] @ own for matrix in (mass, stiffness))
        less_low = None
        if low is not None:
            projected = Twofold.of(across[0]) @ (Twofold(stiffness[0], low) @ Twofold.of(own[0]))
            less_stiffness = projected.high[None]
            less_low = projected.low + (less_stiffness - np.swapaxes(less_stiffness, -1, -2))[0] / 2
        less_mass, less_stiffness = ((matrix + np.swapaxes(matrix, -1, -2)) / 2 for matrix in (less_mass, less_stiffness))
        found, within = solve(less_mass, less_stiffness, less_low)
        values[np.ix_(here, kind)] = found
        shapes[here[:, None], :, np.flatnonzero(kind)] = np.swapaxes(own @ within, -1, -2)
    return values, shapes


def _kinds(soft: Any) -> list[tuple[Any, Any]]:
    """Rows of (p, m) that are alike: each kind with its places, (m,) and (q,)."""
    if (soft == soft[:1]).all():
        return [(soft[0], np.arange(len(soft)))]
    kinds, which = np.unique(soft, axis=0, return_inverse=True)
    return [(kind, np.flatnonzero(which.ravel() == number)) for number, kind in enumerate(kinds)]


def quickly(mass: Array, stiffness: Array, tension: Array) -> tuple[Any, Any]:
    """Eigenvalues (p, m) and orthonormal vectors L^T v (p, c, m), M = L L^T, of many models; only those with modes that are `WIDE` apart are solved again.

    Parameters
    ----------
    mass, stiffness : (p, c, c) arrays
        As for `solve`.
    tension : (p,) array
        See `rigid`.
    """
    root = np.linalg.cholesky(mass)
    inverse = np.linalg.inv(root)
    dynamic = inverse @ stiffness @ np.swapaxes(inverse, -1, -2)
    values, vectors = np.linalg.eigh((dynamic + np.swapaxes(dynamic, -1, -2)) / 2)
    size = np.abs(values)
    wide = size.min(-1) < WIDE * size.max(-1)
    if wide.any():
        found, shapes = solve(mass[wide], stiffness[wide])
        values[wide] = rigid(found, rounding(stiffness[wide], np.swapaxes(shapes, -1, -2)), tension[wide])
        vectors[wide] = np.swapaxes(root[wide], -1, -2) @ shapes
    return values, vectors


def rigid(values: Array, error: Array, tension: Any) -> Any:
    """Eigenvalues (..., m) with those of rigid modes exactly 0.

    A mode is rigid if its omega^2 is a rounding error of what it is a sum of: of the elements of K, whose last digits make an `error` (..., m), or,
    where these have cancelled already, of what tension (...) gives a rotation (never more than the largest).
    """
    size = np.abs(values)
    made_of = np.maximum(error / EPS, np.minimum(np.asarray(tension)[..., None], size.max(-1, keepdims=True)))
    return np.where(size < RIGID * made_of, 0.0, values)


def rounding(stiffness: Array, shapes: Array) -> Array:
    """What errors in the last digit of every element of K do to omega^2 at most: eps |v|^T |K| |v| for shapes v (..., m, N) of unit modal mass, (rad/s)^2."""
    size = np.abs(shapes)
    return EPS * ((size @ np.abs(stiffness)) * size).sum(-1)


def known(model: LinearModel) -> bool:
    """Whether a model says what rounding has taken from its stiffness."""
    return model.low is not None and not model.batch


def kept(model: LinearModel, shapes: Array) -> Any:
    """What errors in the last digits of all but the wires' stretching, and of how wires stretch with the coordinates, do to omega^2 at most.

    For shapes (m, N) of unit modal mass in the model's own coordinates, (m,).
    """
    stretched, low = model.stretched, np.real(model.low)
    assert stretched is not None
    soft = stretched.added(Twofold(model.stiffness, low), -stretched.stiffness).value
    pull = np.abs(shapes @ stretched.form.T) * stretched.stiffness
    return rounding(soft, shapes) + 2 * EPS * (pull * (np.abs(shapes) @ np.abs(stretched.form).T)).sum(-1)


def hanging(model: LinearModel) -> Any:
    """omega^2 (...) of the softest translation of any body by its own stiffness: what tension over length gives, (rad/s)^2."""
    stop = 6 * (len(model.body) + 1)
    own, mass = (np.diagonal(matrix, axis1=-2, axis2=-1)[..., 6:stop] for matrix in (model.stiffness, model.mass))
    softest = np.abs(own / mass).reshape(*np.broadcast_shapes(own.shape, mass.shape)[:-1], -1, 6)[..., :3].min(-1)
    return softest.max(-1)


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
    size = kept(model, adapted) if known(model) else rounding(model.stiffness, adapted)
    return np.where(omega_squared != 0, size / (2 * np.abs(np.where(omega_squared == 0, 1.0, omega_squared))), np.inf)
