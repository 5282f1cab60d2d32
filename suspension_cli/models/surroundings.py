"""Dampers, light and a compliant support structure, added to the linear model of any model."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import DOF_UNITS, DOFS, FRAME, SUPPORT
from suspension_cli.design.derive import com_positions
from suspension_cli.design.schema import Design
from suspension_cli.linear.coordinates import AddedCoordinates, momentum_units
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models.cavity import with_cavity
from suspension_cli.rotations import cross_matrix

if TYPE_CHECKING:
    from jaxtyping import Float


def surrounded(
    model: LinearSystem,
    design: Design,
    position: Float[np.ndarray, "*batch 1+body 3"] | None = None,
) -> LinearSystem:
    """A linear model with the design's dampers, cavities and support structure.

    `position` has the nominal COM of the support and of all bodies, of each design of a batch;
    default: those of the one design.
    """
    if position is None:
        position = nominal_positions(design)
    damped = with_dampers(model, design, position)
    for cavity in design.cavity:
        damped = with_cavity(damped, cavity)
    return replace(with_frame(damped, design), active=design.is_active)


def nominal_positions(design: Design) -> Float[np.ndarray, "1+body 3"]:
    """Nominal COM of the support and of every body, m."""
    return np.array([*com_positions(design).values()])


def with_dampers(
    model: LinearSystem, design: Design, position: Float[np.ndarray, "*batch 1+body 3"]
) -> LinearSystem:
    """Add `[stage.damping]`: forces -c v, for the velocity v of a COM relative to another body.

    The other body (or the support) extends rigidly to that COM, so that rigid motion is not damped.
    """
    if all(stage.damping is None for stage in design.stage):
        return model
    damping = model.damping
    for number, stage in enumerate(design.stage, 1):
        if stage.damping is None:
            continue
        against = stage.damping.against
        other = 0 if against == SUPPORT else 1 + model.body.index(against)
        here = 6 * number
        there = 6 * other
        arm = position[..., number, :] - position[..., other, :]
        relative = np.zeros((*arm.shape[:-1], 6, model.size), dtype=arm.dtype)
        relative[..., here : here + 6] = np.eye(6)
        relative[..., there : there + 6] -= np.eye(6)
        relative[..., :3, there + 3 : there + 6] += cross_matrix(arm)
        coefficients = np.array([getattr(stage.damping, dof) for dof in DOFS])
        damping = damping + np.swapaxes(relative, -1, -2) @ (coefficients[:, None] * relative)
    return replace(model, damping=(damping + np.swapaxes(damping, -1, -2)) / 2)


def with_frame(model: LinearSystem, design: Design) -> LinearSystem:
    """Add `[support]`: the suspension point moves with the ground and by its own deflection.

    ``support.x`` becomes the motion of the ground; ``frame.x`` is the deflection, in every
    direction that has a stiffness. Husman et al. (2000), section 4c: their frame "still couples
    with the pendulum".
    """
    support = design.support
    if support is None:
        return model
    names = [dof for dof in DOFS if getattr(support.stiffness, dof) is not None]
    moving = [DOFS.index(dof) for dof in names]
    size = model.size
    count = len(moving)
    from_new = np.eye(size, size + count)
    from_new[moving, size + np.arange(count)] = 1.0
    weights = np.array([support.mass] * 3 + list(support.inertia))
    mass = from_new[:6].T @ (weights[:, None] * from_new[:6])
    own = [
        np.diag([*np.zeros(size), *(getattr(part, dof) for dof in names)])
        for part in (support.stiffness, support.damping)
    ]
    if support.loss_angle:
        own[0] = own[0] * (1 + 1j * support.loss_angle)
    units = tuple(DOF_UNITS[dof] for dof in moving)
    frame = AddedCoordinates(
        tuple(f"{FRAME}.{dof}" for dof in names), units, momentum_units(units), mass, own[0], own[1]
    )
    return model.widened(frame, from_new)


def surroundings_key(design: Design) -> tuple[str, ...]:
    """Support structure, all dampers and cavities, which designs of one batch share."""
    # repr of floats is exact
    dampers = [stage.damping for stage in design.stage]
    on_tips = [[table.dampers for table in stage.blade_tables] for stage in design.stage]
    return (repr(design.support), repr(dampers), repr(on_tips), repr(design.cavity))
