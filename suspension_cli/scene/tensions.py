"""Tensions of wires that balance a load in the nominal pose.

The wires of a stage carry everything below. Where balance alone does not determine their tensions,
they are those of least elastic energy (Castigliano's theorem).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.errors import Fault
from suspension_cli.rotations import cross
from suspension_cli.scene.arrays import Array, Index

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact

BALANCE = 1e-9
"""Residual force, over the weight, and torque, over the weight times 1 m, that count as 0."""

TORQUES = 1e-3
"""Weight (1/m) of torques relative to forces in a load that cannot be balanced."""

ROUNDING = 1e-12
"""Relative difference of tensions that are equal but for rounding."""

_NAMES = (
    "force along x",
    "force along y",
    "force along z",
    "roll torque",
    "pitch torque",
    "yaw torque",
)


def move_wrench(wrench: Array, offset: Array) -> Array:
    """Transform a wrench (..., 6) to a point that lies at -offset (..., 3) from its own, m."""
    force = wrench[..., :3]
    return np.concatenate([force, wrench[..., 3:] + cross(offset, force)], axis=-1)


def weight_wrench(weight: float, point: Array) -> Array:
    """Compute the wrench (6,) of a weight (N) at a point (3,) about the origin."""
    return move_wrench(np.array([0.0, 0.0, -weight, 0.0, 0.0, 0.0]), point)


def wire_wrenches(direction: Array, point: Array) -> Array:
    """Compute force and torque (w, 6) of a unit tension in each wire on the lower body.

    Parameters
    ----------
    direction : (w, 3) array
        Unit vectors from upper to lower end.
    point : (w, 3) array
        Lower ends from the COM, m.
    """
    return np.concatenate([-direction, cross(point, -direction)], axis=-1)


def least_energy(
    wrenches: Array, load: Array, compliance: Array
) -> tuple[Inexact[np.ndarray, " wire"], Inexact[np.ndarray, " 6"]]:
    """Find the tensions of least elastic energy that balance a load.

    Minimise T C T / 2 subject to sum_i T_i w_i + load = 0 (least squares if that has no solution).

    Parameters
    ----------
    wrenches : (w, 6) array
        Of unit tensions.
    load : (6,) array
        All else that acts on the body, N and N m.
    compliance : (w, w) array
        C: elongation of the wires and their blades per tension, m/N.

    Returns
    -------
    tension : (w,) array
        N.
    left_over : (6,) array
        Unbalanced wrench, N and N m.
    """
    scaled = compliance / np.trace(compliance)
    root = _inverse_root(scaled)
    tension = root @ (np.linalg.pinv(wrenches.T @ root, rcond=1e-10) @ -load)
    left_over = wrenches.T @ tension + load
    # where not all can be balanced, balance the forces first: what is left over reads better
    if np.abs(left_over).max() > BALANCE * np.abs(load).max():
        rows = np.array([1.0, 1.0, 1.0, TORQUES, TORQUES, TORQUES])
        best = root @ (
            np.linalg.pinv(rows[:, None] * (wrenches.T @ root), rcond=1e-10) @ -(rows * load)
        )
        left_over = wrenches.T @ best + load
    return tension, left_over


def _inverse_root(matrix: Array) -> Array:
    """Compute R with R R^T = C^-1 for a positive definite C.

    Eigenvalues are kept above the rounding error of the largest: beside a soft blade the compliance
    of its wires is lost in rounding.
    """
    try:
        return np.asarray(np.linalg.inv(np.linalg.cholesky(matrix)).T, dtype=np.float64)
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(matrix)
        return vectors / np.sqrt(np.maximum(values, np.finfo(float).eps * values[-1]))


def compliance(
    stiffness: Array,
    direction: Array,
    blade: Index,
    axes: Bool[np.ndarray, "blade 3"] | Float[np.ndarray, "0 3"],
    blade_stiffness: Array,
) -> Array:
    """Compute the elongation per tension of wires in series with their blades, (w, w), m/N.

    It is not diagonal where two wires hang from one blade.
    """
    result = np.diag(1.0 / stiffness)
    for number in sorted(set(blade[blade >= 0].tolist())):
        on = blade == number
        for axis in np.flatnonzero(axes[number]):
            pull = np.where(on, direction[:, axis], 0.0)
            result += np.outer(pull, pull) / blade_stiffness[number, axis]
    return result


def equalise_mirrored(tension: Array, upper: Array, lower: Array, stiffness: Array) -> Array:
    """Make tensions (w,) of mirror-image wires exactly equal where they differ by rounding."""
    for axis in (0, 1):
        flip = np.ones(3)
        flip[axis] = -1.0
        wires = np.concatenate([upper, lower, stiffness[:, None]], axis=1)
        images = np.concatenate([upper * flip, lower * flip, stiffness[:, None]], axis=1)
        same = (wires[:, None, :] == images[None, :, :]).all(-1)
        if (same.sum(0) == 1).all():
            even = (tension + tension[same.argmax(0)]) / 2
            if np.abs(even - tension).max() <= ROUNDING * np.abs(tension).max():
                tension = even
    return tension


def report_imbalance(left_over: Array, weight: float, key: str, remedy: str) -> list[Fault]:
    """Report the largest forces and torques of a residual wrench (6,), if any, as a fault."""
    found = [
        f"{left_over[axis]:.3g} {'N' if axis < 3 else 'N m'} of {_NAMES[axis]}"
        for axis in np.argsort(-np.abs(left_over))
        if abs(left_over[axis]) > max(BALANCE * weight, 1e-3 * np.abs(left_over).max())
    ]
    if not found:
        return []
    return [
        Fault(key, f"cannot balance in the nominal pose: {', '.join(found[:3])} left over", remedy)
    ]
