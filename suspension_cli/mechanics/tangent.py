"""Potential energy of a scene, its gradient and its tangent stiffness, summed over the elements in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.design.scene import Scene
from suspension_cli.mechanics import blade, flexure, spring, string
from suspension_cli.mechanics.geometric import add_arms, rotation_hessian
from suspension_cli.mechanics.pose import Layout, Pose, point_jacobian
from suspension_cli.rotations import cross_matrix


def energy(scene: Scene, pose: Pose) -> Any:
    """Potential energy beyond that of the nominal pose, J, shape ``batch``; elastic and gravitational."""
    weight = scene.gravity * scene.bodies.mass
    lift = (weight * pose.shift[..., 1:, 2]).sum(-1)
    turned = blade.tip_arms(scene, pose) - scene.blades.tip
    tips = (scene.gravity * scene.blades.tip_mass * (pose.shift[..., scene.blades.body, 2] + turned[..., 2])).sum(-1)
    return string.energy(scene, pose) + flexure.energy(scene, pose) + blade.energy(scene, pose) + spring.energy(scene, pose) + lift + tips


def tangent(scene: Scene, numbering: Layout, pose: Pose) -> tuple[Any, Any]:
    """Gradient and Hessian of the potential energy in the generalised coordinates.

    Parameters
    ----------
    scene : Scene
    numbering : Layout
    pose : Pose

    Returns
    -------
    gradient : (..., N) array
        N and N m; 0 at an equilibrium, except for the support's six.
    hessian : (..., N, N) array
        The tangent stiffness, exactly symmetric.
    """
    size, bodies = numbering.size, len(scene.bodies.name) + 1
    gradient = np.zeros((*scene.batch, size), dtype=scene.kind)
    hessian = np.zeros((*scene.batch, size + 1, size + 1), dtype=scene.kind)  # the last row takes what belongs to rigid directions of blades
    outer = np.zeros((*scene.batch, bodies, 3, 3), dtype=scene.kind)
    on_tips = np.zeros((*scene.batch, len(scene.blades.label), 3), dtype=scene.kind)
    gradient[..., 8 : 6 * bodies : 6] += scene.gravity * scene.bodies.mass
    if scene.wires.label:
        _add_wires(scene, numbering, pose, gradient, hessian, outer, on_tips)
        flexure.add(scene, numbering, pose, gradient, hessian, outer, on_tips)
    if scene.blades.label:
        _add_blades(scene, numbering, pose, gradient, hessian, outer, on_tips)
    blocks = rotation_hessian(outer)
    for n in range(bodies):
        hessian[..., 6 * n + 3 : 6 * n + 6, 6 * n + 3 : 6 * n + 6] += blocks[..., n, :, :]
    hessian = hessian[..., :-1, :-1]
    if scene.springs.label:
        _add_springs(scene, numbering, pose, gradient, hessian)
    return gradient, (hessian + np.swapaxes(hessian, -1, -2)) / 2


def _add_wires(scene: Scene, numbering: Layout, pose: Pose, gradient: Any, hessian: Any, outer: Any, on_tips: Any) -> None:
    wires, now = scene.wires, string.state(scene, pose)
    jacobian = string.span_jacobian(scene, numbering, pose, now)
    pull = now.tension[..., None] * now.direction
    over_length = now.tension / now.length
    flat = jacobian.reshape(*jacobian.shape[:-2], -1)
    gradient += (flat @ pull.reshape(*pull.shape[:-2], -1, 1))[..., 0]
    along = (jacobian * now.direction[..., None, :, :]).sum(-1)
    stretch = along * (wires.stiffness - over_length)[..., None, :]
    across = flat * np.repeat(over_length, 3, axis=-1)[..., None, :]
    hessian[..., :-1, :-1] += stretch @ np.swapaxes(along, -1, -2) + across @ np.swapaxes(flat, -1, -2)
    add_arms(outer, wires.lower, pull, now.lower_arm)
    add_arms(outer, wires.upper, -pull, now.upper_arm)
    on_tips -= (np.arange(on_tips.shape[-2])[:, None] == wires.blade).astype(float) @ pull


def _add_blades(scene: Scene, numbering: Layout, pose: Pose, gradient: Any, hessian: Any, outer: Any, on_tips: Any) -> None:
    blades = scene.blades
    rows = numbering.blade[blades.axes]
    gradient[..., rows] += blade.tip_pull(scene, pose)[..., blades.axes]
    hessian[..., rows, rows] += blades.stiffness[..., blades.axes]
    if blades.tip_mass.any():
        arm = blade.tip_arms(scene, pose)
        weight = (scene.gravity * blades.tip_mass)[..., None] * np.array([0.0, 0.0, 1.0]) + np.zeros_like(arm)
        jacobian = point_jacobian(numbering, pose, blades.body, arm, np.arange(len(blades.label)))
        gradient += (jacobian * weight[..., None, :, :]).sum((-2, -1))
        add_arms(outer, blades.body, weight, arm)
        on_tips += weight
    # A force F (gradient) on a tip that is deflected by q as its body turns by t holds F . (t x R q) = -t . [F] R q.
    block = -cross_matrix(on_tips) @ pose.rotation[..., blades.body, :, :]
    turn = (6 * blades.body[:, None] + np.arange(3, 6))[:, :, None] + np.zeros(3, dtype=np.intp)
    tip = numbering.blade[:, None, :] + np.zeros((3, 1), dtype=np.intp)
    hessian[..., turn, tip] += block
    hessian[..., tip, turn] += block


def _add_springs(scene: Scene, numbering: Layout, pose: Pose, gradient: Any, hessian: Any) -> None:
    now = spring.state(scene, pose)
    for number in range(len(scene.springs.label)):
        jacobian = spring.strain_jacobian(scene, numbering, pose, now, number)
        transposed = np.swapaxes(jacobian, -1, -2)
        gradient += (transposed @ now.pull[..., number, :, None])[..., 0]
        hessian += transposed @ scene.springs.stiffness[..., number, :, :] @ jacobian
        spring.add_curvature(scene, pose, now, number, hessian)
