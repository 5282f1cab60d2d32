"""Viscous dampers and a compliant support structure, added to the linear model of any model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from suspension_cli.conventions import DOFS, FRAME, SUPPORT
from suspension_cli.design.derive import com_positions
from suspension_cli.design.schema import Design, Support
from suspension_cli.linear.system import LinearSystem
from suspension_cli.rotations import cross_matrix


def surrounded(model: LinearSystem, design: Design) -> LinearSystem:
    """A linear model with the design's dampers and its support structure."""
    return replace(with_frame(with_dampers(model, design), design), active=design.is_active)


def with_dampers(model: LinearSystem, design: Design) -> LinearSystem:
    """Add `[stage.damping]`: forces -c v, for the velocity v of a COM relative to another body.

    The other body (or the support) extends rigidly to that COM, so that rigid motion is not damped.
    """
    if all(stage.damping is None for stage in design.stage):
        return model
    positions = com_positions(design)
    damping = model.damping.copy()
    for stage in design.stage:
        if stage.damping is None:
            continue
        against = stage.damping.against
        here = model.index(stage.name, "x")
        there = 0 if against == SUPPORT else model.index(against, "x")
        arm = np.array(positions[stage.name]) - np.array(positions[against])
        relative = np.zeros((6, model.size), dtype=arm.dtype)
        relative[:, here : here + 6] = np.eye(6)
        relative[:, there : there + 6] -= np.eye(6)
        relative[:3, there + 3 : there + 6] += cross_matrix(arm)
        coefficients = np.array([getattr(stage.damping, dof) for dof in DOFS])
        damping = damping + relative.T @ (coefficients[:, None] * relative)
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
    moving = _compliant(support)
    names = [DOFS[n] for n in moving]
    size, count = model.size, len(moving)
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
    names = [f"{FRAME}.{dof}" for dof in names]
    return model.widened(names, mass, *own, from_new=from_new)


def _compliant(support: Support) -> list[int]:
    """Directions in which the support structure is compliant."""
    return [n for n, dof in enumerate(DOFS) if getattr(support.stiffness, dof) is not None]


def surroundings_key(design: Design) -> tuple[str, ...]:
    """Support structure, dampers and their positions, which designs of one batch share."""
    dampers = tuple(stage.damping for stage in design.stage)
    if all(own is None for own in dampers):
        return (repr(design.support),)
    # repr of floats is exact
    return (repr(design.support), repr(dampers), repr(com_positions(design)))
