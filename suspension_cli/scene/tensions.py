"""Tensions of wires that balance a load in the nominal pose.

The wires of a stage carry everything below. Where balance alone does not determine their tensions,
they are those of least elastic energy (Castigliano's theorem).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.rotations import cross
from suspension_cli.scene.arrays import Array, Index

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact

    from suspension_cli.scene.scene import Blades, Wires

BALANCE = 1e-9
"""Residual force, over the weight, and torque, over the weight times 1 m, that count as 0."""

TORQUES = 1e-3
"""Weight (1/m) of torques relative to forces in a load that cannot be balanced."""

ROUNDING = 1e-12
"""Relative difference of numbers that are equal but for rounding."""


def move_wrench(wrench: Array, offset: Array) -> Array:
    """Transform a wrench (..., 6) to a point that lies at -offset (..., 3) from its own, m."""
    force = wrench[..., :3]
    return np.concatenate([force, wrench[..., 3:] + cross(offset, force)], axis=-1)


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
    # R R^T = C^-1; eigenvalues are kept above the rounding error of the largest: beside a soft
    # blade the compliance of its wires is lost in rounding
    values, vectors = np.linalg.eigh(compliance / np.trace(compliance))
    root = vectors / np.sqrt(np.maximum(values, np.finfo(float).eps * values[-1]))
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


def carry(
    lines: Wires,
    own: Index,
    blades: Blades,
    load: Array,
    fixed: Bool[np.ndarray, " own"] | None = None,
) -> tuple[Array, Array]:
    """Distribute a load (6,) on a body about its COM over its wires or legs, in the nominal pose.

    `own` are their numbers. Returns their tensions, of which those that are `fixed` are the lines'
    own, and the wrench (6,) left over.
    """
    free = np.ones(len(own), dtype=bool) if fixed is None else ~fixed
    direction = lines.span[own] / lines.length[own, None]
    wrenches = wire_wrenches(direction, lines.lower_point[own])
    tension = np.where(free, 0.0, lines.tension[own])
    left_over = load + wrenches.T @ tension
    if not free.any():
        return tension, left_over
    c = compliance(lines.stiffness[own], direction, lines.blade[own], blades.axes, blades.stiffness)
    # Equal tensions are those of least energy if the slopes of all wires are equal, and so are the
    # elongations that they cause: then these are proportional to the wires' vertical forces.
    slope, elongation = direction[:, 2], c.sum(1)
    if free.all() and np.ptp(slope) == 0 and np.ptp(elongation) <= ROUNDING * elongation[0]:
        equal = np.full(len(slope), load[2] / slope.sum())
        unbalanced = load + wrenches.T @ equal
        if np.abs(unbalanced).max() <= ROUNDING * np.abs(load).max():
            return equal, unbalanced
    among = c[np.ix_(free, free)]
    # A wire of given tension deflects the blade that it shares with a free wire: minimise about the
    # tensions of the free wires that this deflection corresponds to.
    shift = np.linalg.solve(among, c[np.ix_(free, ~free)] @ tension[~free])
    carried, left_over = least_energy(wrenches[free], left_over - wrenches[free].T @ shift, among)
    tension[free] = carried - shift
    return tension, left_over
