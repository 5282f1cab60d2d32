"""Energy, tension and geometry of taut elastic strings: straight and massless.

At the elongation e = L - l from the nominal length l, a wire stores T0 e + k e^2 / 2. Its gradient
with respect to the span (from the upper to the lower end) is T u, with T = T0 + k e and the unit
vector u; the Hessian is k u u^T + (T / L) (I - u u^T): stiffness along the wire, tension over
length across it (a pendulum). These are the two terms of equation 5 of Husman et al. (2000),
section 4b.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.element import Derivatives, Element
from suspension_cli.scene.pose import Layout, Pose, point_jacobian
from suspension_cli.scene.scene import Scene, no_struts

if TYPE_CHECKING:
    from jaxtyping import Inexact, Int


@dataclass(frozen=True)
class State:
    """All wires of a scene in one pose; vectors along the global axes.

    Attributes
    ----------
    upper_arm, lower_arm
        From the COM of the upper and of the lower body to the ends, m.
    direction
        Unit vector from the upper to the lower end.
    length
        m.
    elongation
        From the nominal length, m.
    tension
        N.
    """

    upper_arm: Inexact[np.ndarray, "*batch wire 3"]
    lower_arm: Inexact[np.ndarray, "*batch wire 3"]
    direction: Inexact[np.ndarray, "*batch wire 3"]
    length: Inexact[np.ndarray, "*batch wire"]
    elongation: Inexact[np.ndarray, "*batch wire"]
    tension: Inexact[np.ndarray, "*batch wire"]


def tip_deflection(
    blade: Int[np.ndarray, " point"], pose: Pose
) -> Inexact[np.ndarray, "*batch point 3"]:
    """Deflection (..., k, 3) of the blade at each point, m; 0 for -1 (no blade)."""
    none = np.zeros_like(pose.deflection, shape=(*pose.deflection.shape[:-2], 1, 3))
    return np.concatenate([pose.deflection, none], axis=-2)[..., blade, :]


def state(scene: Scene, pose: Pose) -> State:
    """Geometry and tensions of all wires in a pose."""
    wires, turn, deflection = scene.wires, pose.turn, tip_deflection(scene.wires.blade, pose)
    upper_arm = pose.arms(wires.upper, wires.upper_point + deflection)
    lower_arm = pose.arms(wires.lower, wires.lower_point)
    # change of the span from displacements alone, so that nothing cancels
    change = (
        pose.shift[..., wires.lower, :]
        - pose.shift[..., wires.upper, :]
        + (turn[..., wires.lower, :, :] @ wires.lower_point[..., None])[..., 0]
        - (turn[..., wires.upper, :, :] @ wires.upper_point[..., None])[..., 0]
        - (pose.rotation[..., wires.upper, :, :] @ deflection[..., None])[..., 0]
    )
    span = wires.span + change
    length = np.sqrt((span**2).sum(-1))
    elongation = (change * (2 * wires.span + change)).sum(-1) / (length + wires.length)
    tension = wires.tension + wires.stiffness * elongation
    return State(upper_arm, lower_arm, span / length[..., None], length, elongation, tension)


def with_struts(scene: Scene) -> Scene:
    """A scene with its struts as wires: they follow the same formulas."""
    return replace(scene, wires=scene.struts, struts=no_struts(), flex=None, fibres=None)


def energy(scene: Scene, pose: Pose) -> Inexact[np.ndarray, "*batch"]:
    """Elastic energy (...) of all wires and struts relative to the nominal pose, J."""
    e = state(scene, pose).elongation
    own = (scene.wires.tension * e + 0.5 * scene.wires.stiffness * e**2).sum(-1)
    return own + energy(with_struts(scene), pose) if scene.struts.label else own


def span_jacobian(
    scene: Scene, numbering: Layout, pose: Pose, now: State
) -> Inexact[np.ndarray, "*batch coordinate wire 3"]:
    """Derivative (..., N, w, 3) of every span with respect to the N coordinates."""
    wires = scene.wires
    lower = point_jacobian(numbering, pose, wires.lower, now.lower_arm)
    return lower - point_jacobian(numbering, pose, wires.upper, now.upper_arm, wires.blade)


def add_derivatives(scene: Scene, numbering: Layout, pose: Pose, derivatives: Derivatives) -> None:
    """Add the derivatives of the energy of all wires and struts."""
    if scene.struts.label:
        add_derivatives(with_struts(scene), numbering, pose, derivatives)
    wires = scene.wires
    if not wires.label:
        return
    now = state(scene, pose)
    jacobian = span_jacobian(scene, numbering, pose, now)
    pull = now.tension[..., None] * now.direction
    derivatives.add_forces(wires.lower, pull, now.lower_arm)
    derivatives.add_forces(wires.upper, -pull, now.upper_arm, wires.blade)
    over_length = now.tension / now.length
    flat = jacobian.reshape(*jacobian.shape[:-2], -1)
    along = (jacobian * now.direction[..., None, :, :]).sum(-1)
    elastic = along * (wires.stiffness - over_length)[..., None, :]
    pendulum = flat * np.repeat(over_length, 3, axis=-1)[..., None, :]
    derivatives.hessian[..., :-1, :-1] += elastic @ np.swapaxes(
        along, -1, -2
    ) + pendulum @ np.swapaxes(flat, -1, -2)


def loss_matrix(
    scene: Scene, numbering: Layout, pose: Pose
) -> Inexact[np.ndarray, "*batch coordinate coordinate"] | float:
    """Imaginary part (..., N, N) of the stiffness against stretching of wires."""
    if not scene.wires.loss.any():
        return 0.0
    wires, now = scene.wires, state(scene, pose)
    jacobian = span_jacobian(scene, numbering, pose, now)
    along = (jacobian * now.direction[..., None, :, :]).sum(-1)
    return (along * (wires.stiffness * wires.loss)[..., None, :]) @ np.swapaxes(along, -1, -2)


ELEMENT = Element(energy, add_derivatives, loss=loss_matrix, compiled=True)
