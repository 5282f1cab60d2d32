"""Potential energy of a scene, its gradient and its tangent stiffness, in closed form."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements import bar, bending, blade, spring, string, weight
from suspension_cli.elements.geometric_stiffness import add_arms, rotation_hessian, sum_by
from suspension_cli.rotations import cross_matrix
from suspension_cli.scene.pose import Layout, Pose, point_jacobian
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Inexact


def energy(scene: Scene, pose: Pose) -> Inexact[np.ndarray, "*batch"]:
    """Elastic and gravitational energy (...) relative to the nominal pose, J."""
    if weight.acts(scene):
        return (
            string.energy(scene, pose)
            + (string.energy(with_struts(scene), pose) if scene.struts.label else 0.0)
            + bending.energy(scene, pose)
            + blade.energy(scene, pose)
            + spring.energy(scene, pose)
            + weight.energy(scene, pose)
        )
    blades = scene.blades
    bodies = (scene.gravity * scene.bodies.mass * pose.shift[..., 1:, 2]).sum(-1)
    tip_motion = blade.tip_arms(scene, pose) - blades.tip
    height = pose.shift[..., blades.body, 2] + tip_motion[..., 2]
    tips = (scene.gravity * blades.tip_mass * height).sum(-1)
    return (
        string.energy(scene, pose)
        + (string.energy(with_struts(scene), pose) if scene.struts.label else 0.0)
        + bar.energy(scene, pose)
        + bending.energy(scene, pose)
        + blade.energy(scene, pose)
        + spring.energy(scene, pose)
        + bodies
        + tips
    )


def gradient_and_stiffness(
    scene: Scene, numbering: Layout, pose: Pose
) -> tuple[
    Inexact[np.ndarray, "*batch coordinate"], Inexact[np.ndarray, "*batch coordinate coordinate"]
]:
    """Gradient and tangent stiffness of a scene in the generalised coordinates.

    Parameters
    ----------
    scene : Scene
    numbering : Layout
    pose : Pose

    Returns
    -------
    gradient
        Of the potential energy, N and N m; 0 at an equilibrium, except for the support's six.
    hessian
        Tangent stiffness, exactly symmetric, N/m, N and N m.
    """
    size, bodies = numbering.size, len(scene.bodies.name) + 1
    gradient = np.zeros((*scene.batch, size), dtype=scene.kind)
    # the last row and column take what belongs to rigid directions of blades
    hessian = np.zeros((*scene.batch, size + 1, size + 1), dtype=scene.kind)
    outer = np.zeros((*scene.batch, bodies, 3, 3), dtype=scene.kind)
    on_tips = np.zeros((*scene.batch, len(scene.blades.label), 3), dtype=scene.kind)
    if weight.acts(scene):
        weight.add_derivatives(scene, numbering, pose, gradient, hessian, outer, on_tips)
    else:
        gradient[..., 8 : 6 * bodies : 6] += scene.gravity * scene.bodies.mass
    if scene.wires.label:
        _add_wires(scene, numbering, pose, gradient, hessian, outer, on_tips)
        bending.add_derivatives(scene, numbering, pose, gradient, hessian, outer, on_tips)
    if scene.struts.label:
        _add_wires(with_struts(scene), numbering, pose, gradient, hessian, outer, on_tips)
    if scene.bars.label and not weight.acts(scene):
        bar.add_weight(scene, numbering, pose, gradient, outer)
    if scene.blades.label:
        _add_blades(scene, numbering, pose, gradient, hessian, outer, on_tips)
    blocks = rotation_hessian(outer)
    for n in range(bodies):
        hessian[..., 6 * n + 3 : 6 * n + 6, 6 * n + 3 : 6 * n + 6] += blocks[..., n, :, :]
    hessian = hessian[..., :-1, :-1]
    if scene.springs.label:
        _add_springs(scene, numbering, pose, gradient, hessian)
    return gradient, (hessian + np.swapaxes(hessian, -1, -2)) / 2


def with_struts(scene: Scene) -> Scene:
    """A scene whose wires are its struts, which follow the same formulas."""
    return replace(scene, wires=scene.struts, flex=None, fibres=None)


def _add_wires(
    scene: Scene,
    numbering: Layout,
    pose: Pose,
    gradient: Inexact[np.ndarray, "*batch coordinate"],
    hessian: Inexact[np.ndarray, "*batch 1+coordinate 1+coordinate"],
    outer: Inexact[np.ndarray, "*batch 1+body 3 3"],
    on_tips: Inexact[np.ndarray, "*batch blade 3"],
) -> None:
    wires, now = scene.wires, string.state(scene, pose)
    jacobian = string.span_jacobian(scene, numbering, pose, now)
    pull = now.tension[..., None] * now.direction
    over_length = now.tension / now.length
    flat = jacobian.reshape(*jacobian.shape[:-2], -1)
    gradient += (flat @ pull.reshape(*pull.shape[:-2], -1, 1))[..., 0]
    along = (jacobian * now.direction[..., None, :, :]).sum(-1)
    elastic = along * (wires.stiffness - over_length)[..., None, :]
    pendulum = flat * np.repeat(over_length, 3, axis=-1)[..., None, :]
    hessian[..., :-1, :-1] += elastic @ np.swapaxes(along, -1, -2) + pendulum @ np.swapaxes(
        flat, -1, -2
    )
    add_arms(outer, wires.lower, pull, now.lower_arm)
    add_arms(outer, wires.upper, -pull, now.upper_arm)
    on_tips -= sum_by(wires.blade, pull, on_tips.shape[-2])


def _add_blades(
    scene: Scene,
    numbering: Layout,
    pose: Pose,
    gradient: Inexact[np.ndarray, "*batch coordinate"],
    hessian: Inexact[np.ndarray, "*batch 1+coordinate 1+coordinate"],
    outer: Inexact[np.ndarray, "*batch 1+body 3 3"],
    on_tips: Inexact[np.ndarray, "*batch blade 3"],
) -> None:
    blades = scene.blades
    rows = numbering.blade[blades.axes]
    gradient[..., rows] += blade.tip_gradient(scene, pose)[..., blades.axes]
    hessian[..., rows, rows] += blades.stiffness[..., blades.axes]
    if blades.tip_mass.any():
        arm = blade.tip_arms(scene, pose)
        place = scene.bodies.position[..., blades.body, :] + pose.shift[..., blades.body, :] + arm
        force = np.zeros(arm.shape, dtype=scene.kind)
        force += weight.lift(scene, place) * blades.tip_mass[..., None]
        jacobian = point_jacobian(numbering, pose, blades.body, arm, np.arange(len(blades.label)))
        gradient += (jacobian * force[..., None, :, :]).sum((-2, -1))
        add_arms(outer, blades.body, force, arm)
        on_tips += force
        if scene.field is not None and not scene.field.is_uniform:
            turned = jacobian @ scene.field.gradient * blades.tip_mass[..., None, :, None]
            hessian[..., :-1, :-1] -= np.einsum("...awi,...bwi->...ab", jacobian, turned)
    # the gradient F at a tip, deflected by q, adds F . (t x R q) = -t . [F] R q as its body rotates
    # by t
    block = -cross_matrix(on_tips) @ pose.rotation[..., blades.body, :, :]
    turn = (6 * blades.body[:, None] + np.arange(3, 6))[:, :, None] + np.zeros(3, dtype=np.intp)
    tip = numbering.blade[:, None, :] + np.zeros((3, 1), dtype=np.intp)
    hessian[..., turn, tip] += block
    hessian[..., tip, turn] += block


def spring_stiffness(
    scene: Scene, numbering: Layout, pose: Pose
) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
    """Tangent stiffness of the springs alone, exactly symmetric, N/m, N and N m."""
    gradient = np.zeros((*scene.batch, numbering.size), dtype=scene.kind)
    hessian = np.zeros((*scene.batch, numbering.size, numbering.size), dtype=scene.kind)
    _add_springs(scene, numbering, pose, gradient, hessian)
    return (hessian + np.swapaxes(hessian, -1, -2)) / 2


def _add_springs(
    scene: Scene,
    numbering: Layout,
    pose: Pose,
    gradient: Inexact[np.ndarray, "*batch coordinate"],
    hessian: Inexact[np.ndarray, "*batch coordinate coordinate"],
) -> None:
    now = spring.state(scene, pose)
    for number in range(len(scene.springs.label)):
        jacobian = spring.strain_jacobian(scene, numbering, pose, now, number)
        transposed = np.swapaxes(jacobian, -1, -2)
        gradient += (transposed @ now.pull[..., number, :, None])[..., 0]
        hessian += transposed @ scene.springs.stiffness[..., number, :, :] @ jacobian
        spring.add_curvature(scene, pose, now, number, hessian)
