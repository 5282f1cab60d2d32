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
    torque = wrench[..., 3:] + cross(offset, wrench[..., :3])
    force = np.broadcast_to(wrench[..., :3], torque.shape)
    return np.concatenate([force, torque], axis=-1)


def wire_wrenches(direction: Array, point: Array) -> Array:
    """Compute force and torque (..., w, 6) of a unit tension in each wire on the lower body.

    Parameters
    ----------
    direction : (..., w, 3) array
        Unit vectors from upper to lower end.
    point : (..., w, 3) array
        Lower ends from the COM, m.
    """
    return np.concatenate([-direction, cross(point, -direction)], axis=-1)


def least_energy(
    wrenches: Inexact[np.ndarray, "*batch wire 6"],
    load: Inexact[np.ndarray, "*batch 6"],
    compliance: Inexact[np.ndarray, "*batch wire wire"],
) -> tuple[Inexact[np.ndarray, "*batch wire"], Inexact[np.ndarray, "*batch 6"]]:
    """Find the tensions of least elastic energy that balance a load.

    Minimise T C T / 2 subject to sum_i T_i w_i + load = 0 (least squares if that has no solution).

    Parameters
    ----------
    wrenches
        Of unit tensions.
    load
        All else that acts on the body, N and N m.
    compliance
        C: elongation of the wires and their blades per tension, m/N.

    Returns
    -------
    tension : (..., w) array
        N.
    left_over : (..., 6) array
        Unbalanced wrench, N and N m.
    """
    # R R^T = C^-1; eigenvalues are kept above the rounding error of the largest: beside a soft
    # blade the compliance of its wires is lost in rounding
    trace = np.trace(compliance, axis1=-2, axis2=-1)[..., None, None]
    values, vectors = np.linalg.eigh(compliance / trace)
    least = np.finfo(float).eps * values[..., -1:]
    root = vectors / np.sqrt(np.maximum(values, least))[..., None, :]
    act = wrenches.swapaxes(-1, -2)

    def fit(weight: Array) -> Array:
        inverse = np.linalg.pinv(weight[:, None] * (act @ root), rcond=1e-10)
        return _sum(root, _sum(inverse, -(weight * load)))

    tension = fit(np.ones(6))
    left_over = _sum(act, tension) + load
    wrong = np.abs(left_over).max(-1) > BALANCE * np.abs(load).max(-1)
    if wrong.any():
        # where not all can be balanced, balance the forces first: what is left over reads better
        best = _sum(act, fit(np.array([1.0, 1.0, 1.0, TORQUES, TORQUES, TORQUES]))) + load
        left_over = np.where(wrong[..., None], best, left_over)
    return tension, left_over


def _sum(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    return (matrix @ vector[..., None])[..., 0]


def compliance(
    stiffness: Inexact[np.ndarray, "*batch wire"],
    direction: Inexact[np.ndarray, "*batch wire 3"],
    blade: Index,
    axes: Bool[np.ndarray, "blade 3"] | Float[np.ndarray, "0 3"],
    blade_stiffness: Inexact[np.ndarray, "*batch blade 3"],
) -> Inexact[np.ndarray, "*batch wire wire"]:
    """Compute the elongation per tension of wires in series with their blades, m/N.

    It is not diagonal where two wires hang from one blade.
    """
    result = np.eye(len(blade)) * (1.0 / stiffness)[..., None]
    for number in sorted(set(blade[blade >= 0].tolist())):
        on = blade == number
        for axis in np.flatnonzero(axes[number]):
            pull = np.where(on, direction[..., axis], 0.0)
            soft = blade_stiffness[..., number, axis, None, None]
            result += pull[..., None] * pull[..., None, :] / soft
    return result


def carry(
    lines: Wires,
    own: Index,
    blades: Blades,
    load: Inexact[np.ndarray, "*batch 6"],
    fixed: Bool[np.ndarray, " own"] | None = None,
) -> tuple[Inexact[np.ndarray, "*batch own"], Inexact[np.ndarray, "*batch 6"]]:
    """Distribute a load on a body about its COM over its wires or legs, in the nominal pose.

    `own` are their numbers. Returns their tensions, of which those that are `fixed` are the lines'
    own, and the wrench left over.
    """
    free = np.ones(len(own), dtype=bool) if fixed is None else ~fixed
    direction = lines.span[..., own, :] / lines.length[..., own, None]
    wrenches = wire_wrenches(direction, lines.lower_point[..., own, :])
    act = wrenches.swapaxes(-1, -2)
    tension = np.where(free, 0.0, lines.tension[..., own])
    left_over = load + _sum(act, tension)
    if not free.any():
        return tension, left_over
    c = compliance(
        lines.stiffness[..., own], direction, lines.blade[own], blades.axes, blades.stiffness
    )
    # Equal tensions are those of least energy if the slopes of all wires are equal, and so are the
    # elongations that they cause: then these are proportional to the wires' vertical forces.
    slope, elongation = direction[..., 2], c.sum(-1)
    equal = np.broadcast_to((load[..., 2] / slope.sum(-1))[..., None], slope.shape)
    unbalanced = load + _sum(act, equal)
    even = np.abs(unbalanced).max(-1) <= ROUNDING * np.abs(load).max(-1)
    even &= np.ptp(elongation, -1) <= ROUNDING * elongation[..., 0]
    even &= (np.ptp(slope, -1) == 0) & free.all()
    if even.all():
        return equal, unbalanced
    among = c[..., free, :][..., free]
    # A wire of given tension deflects the blade that it shares with a free wire: minimise about the
    # tensions of the free wires that this deflection corresponds to.
    held = _sum(c[..., free, :][..., ~free], tension[..., ~free])
    shift = np.linalg.solve(among, held[..., None])[..., 0]
    rest = left_over - _sum(act[..., free], shift)
    carried, left_over = least_energy(wrenches[..., free, :], rest, among)
    tension[..., free] = carried - shift
    even = even[..., None]
    return np.where(even, equal, tension), np.where(even, unbalanced, left_over)
