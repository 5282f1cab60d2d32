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
"""Relative difference of tensions that are equal but for rounding."""


def move_wrench(wrench: Array, offset: Array) -> Array:
    """Transform a wrench (..., 6) to a point that lies at -offset (..., 3) from its own, m."""
    torque = wrench[..., 3:] + cross(offset, wrench[..., :3])
    force = np.broadcast_to(wrench[..., :3], torque.shape)
    return np.concatenate([force, torque], axis=-1)


def wire_wrenches(direction: Array, point: Array) -> Array:
    """Compute force and torque (..., w, 6) of a unit tension in each wire on the lower body.

    From unit vectors to the lower ends and the places of these from the COM, m.
    """
    return np.concatenate([-direction, cross(point, -direction)], axis=-1)


def least_energy(
    wrenches: Inexact[np.ndarray, "*batch wire 6"],
    load: Inexact[np.ndarray, "*batch 6"],
    strain: Inexact[np.ndarray, "*batch part wire"],
    given: Inexact[np.ndarray, "*batch part"] | float = 0.0,
) -> tuple[Inexact[np.ndarray, "*batch wire"], Inexact[np.ndarray, "*batch 6"]]:
    """Find the tensions of least elastic energy that balance a load.

    Minimise |S T + g|^2 / 2 subject to sum_i T_i w_i + load = 0 (least squares if that has no
    solution). With S = Q R and y = R T + Q^T g the energy is y^2 / 2 but for a constant.

    The w_i are the `wrenches` of unit tensions, S are `strains`, g is due to tensions that are
    given, sqrt(J); the load (N and N m) is all else that acts on the body. Returns the tensions (N)
    and the wrench that is left over.
    """
    orthogonal, triangle = np.linalg.qr(strain)
    root = np.linalg.inv(triangle)
    start = _product(orthogonal.swapaxes(-1, -2), given + np.zeros(strain.shape[:-1]))
    act = wrenches.swapaxes(-1, -2)
    rest = load - _product(act, _product(root, start))

    def fit(weight: Array) -> Array:
        inverse = np.linalg.pinv(weight[:, None] * (act @ root), rcond=1e-10)
        return _product(root, _product(inverse, -weight * rest) - start)

    # where not all can be balanced, forces are balanced first: what is left over reads better
    forces_first = fit(np.array([1.0, 1.0, 1.0, TORQUES, TORQUES, TORQUES]))
    return fit(np.ones(6)), _product(act, forces_first) + load


def _product(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    return (matrix @ vector[..., None])[..., 0]


def strains(
    stiffness: Inexact[np.ndarray, "*batch wire"],
    direction: Inexact[np.ndarray, "*batch wire 3"],
    blade: Index,
    axes: Bool[np.ndarray, "blade 3"] | Float[np.ndarray, "0 3"],
    blade_stiffness: Inexact[np.ndarray, "*batch blade 3"],
) -> Inexact[np.ndarray, "*batch part wire"]:
    """Compute the matrix S such that |S T|^2 / 2 is the energy of tensions T of wires and blades.

    One row per wire and per axis of a blade, in 1/sqrt(N/m).
    """
    rows = np.eye(len(blade)) / np.sqrt(stiffness)[..., None]
    for number in sorted(set(blade[blade >= 0].tolist())):
        pull = np.where((blade == number)[:, None], direction, 0.0)[..., axes[number]]
        soft = np.sqrt(blade_stiffness[..., number, :][..., axes[number]])
        rows = np.concatenate([rows, pull.swapaxes(-1, -2) / soft[..., None]], axis=-2)
    return rows


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
    tension = np.where(free, 0.0, lines.tension[..., own])
    left_over = load + _product(wrenches.swapaxes(-1, -2), tension)
    if free.any():
        strain = strains(
            lines.stiffness[..., own], direction, lines.blade[own], blades.axes, blades.stiffness
        )
        given = _product(strain, tension)
        tension[..., free], left_over = least_energy(
            wrenches[..., free, :], left_over, strain[..., free], given
        )
        # those of a symmetric set are equal, and so are exact
        equal = (load[..., 2] / direction[..., 2].sum(-1))[..., None]
        even = np.abs(tension - equal).max(-1, keepdims=True) <= ROUNDING * np.abs(equal)
        tension = np.where(even, equal, tension)
    return tension, left_over
