"""Taut elastic strings: straight, massless, pulling along the line between their ends.

With e = L - l the elongation beyond the nominal length l, a wire stores T0 e + k e^2 / 2.  Its gradient with respect
to the vector from the upper to the lower end is T u, with T = T0 + k e and the unit vector u; its Hessian is
k u u^T + (T / L) (I - u u^T): stiffness along the wire, and tension over length across it (a pendulum).
Source: Husman et al. (2000), section 4b, whose two terms of equation 5 these are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.design.scene import Scene
from suspension_cli.mechanics.pose import Layout, Pose, point_jacobian


@dataclass(frozen=True)
class State:
    """All wires of a scene in one pose; shapes (..., w, 3) in m or (..., w)."""

    upper_arm: Any
    lower_arm: Any
    direction: Any
    length: Any
    elongation: Any
    tension: Any


def state(scene: Scene, pose: Pose) -> State:
    """Arms, directions, elongations (m, from the nominal length) and tensions (N) in a pose."""
    wires = scene.wires
    deflection = np.where((wires.blade >= 0)[:, None], pose.deflection[..., wires.blade, :], 0.0) if pose.deflection.shape[-2] else 0.0
    upper_arm = pose.arms(wires.upper, wires.upper_point + deflection)
    lower_arm = pose.arms(wires.lower, wires.lower_point)
    turn = pose.turn
    # how the span differs from the nominal one, from displacements alone: nothing cancels
    change = (
        pose.shift[..., wires.lower, :]
        - pose.shift[..., wires.upper, :]
        + (turn[..., wires.lower, :, :] @ wires.lower_point[..., None])[..., 0]
        - (turn[..., wires.upper, :, :] @ wires.upper_point[..., None])[..., 0]
        - (pose.rotation[..., wires.upper, :, :] @ (deflection + np.zeros_like(wires.upper_point))[..., None])[..., 0]
    )
    span = wires.span + change
    length = np.sqrt((span**2).sum(-1))
    elongation = (change * (2 * wires.span + change)).sum(-1) / (length + wires.length)
    return State(upper_arm, lower_arm, span / length[..., None], length, elongation, wires.tension + wires.stiffness * elongation)


def energy(scene: Scene, pose: Pose) -> Any:
    """Elastic energy of all wires beyond that of the nominal pose, J, shape ``batch``."""
    e = state(scene, pose).elongation
    return (scene.wires.tension * e + 0.5 * scene.wires.stiffness * e**2).sum(-1)


def span_jacobian(scene: Scene, numbering: Layout, pose: Pose, now: State) -> Any:
    """Derivative (..., N, w, 3) of every span with respect to the coordinates."""
    wires = scene.wires
    lower = point_jacobian(numbering, pose, wires.lower, now.lower_arm)
    return lower - point_jacobian(numbering, pose, wires.upper, now.upper_arm, wires.blade)
