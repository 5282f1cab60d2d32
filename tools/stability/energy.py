"""A stage from point coordinates, with difference quotients of the energy, as in many programs.

The formulas are right, but every number is a difference of larger ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.rotations import cross, cross_matrix, rotation_matrix
from suspension_cli.scene.scene import Scene

STEP = 1e-4
"""Step of difference quotients, m and rad: about the fourth root of the rounding error."""


@dataclass(frozen=True)
class Stage:
    """One body on wires from the support.

    Attributes
    ----------
    scene : Scene
        Of one body, without blades and springs.
    centre : (3,) array
        Centre of mass from the suspension point, m.
    turn : (3, 3) array
        Rotation of the body.
    """

    scene: Scene
    centre: Any
    turn: Any

    @staticmethod
    def nominal(scene: Scene) -> Stage:
        """Build the stage in its nominal pose."""
        return Stage(scene, scene.bodies.position[1], np.eye(3))

    @property
    def natural(self) -> Any:
        """Unstretched lengths (w,), m."""
        wires = self.scene.wires
        return wires.length - wires.tension / wires.stiffness

    def displaced(self, step: Any) -> Stage:
        """Displace the body by a small step (6,)."""
        return Stage(self.scene, self.centre + step[:3], rotation_matrix(step[3:]) @ self.turn)

    @property
    def wires(self) -> tuple[Any, Any, Any, Any]:
        """Arms of the lower ends, unit vectors, lengths and tensions, from end coordinates."""
        arm = self.scene.wires.lower_point @ self.turn.T
        span = self.centre + arm - self.scene.wires.upper_point
        length = np.sqrt((span**2).sum(-1))
        return (
            arm,
            span / length[:, None],
            length,
            self.scene.wires.stiffness * (length - self.natural),
        )

    @property
    def energy(self) -> float:
        """Energy, J."""
        _, _, length, _ = self.wires
        weight = self.scene.gravity * self.scene.bodies.mass[0]
        return float(
            0.5 * (self.scene.wires.stiffness * (length - self.natural) ** 2).sum()
            + weight * self.centre[2]
        )

    @property
    def gradient(self) -> Any:
        """Gradient of the energy (6,), N and N m."""
        arm, direction, _, tension = self.wires
        force = tension[:, None] * direction
        weight = np.array([0.0, 0.0, self.scene.gravity * self.scene.bodies.mass[0]])
        return np.concatenate([force.sum(0) + weight, cross(arm, force).sum(0)])

    @property
    def stiffness(self) -> Any:
        """Tangent stiffness (6, 6) in closed form."""
        arm, direction, length, tension = self.wires
        result = np.zeros((6, 6))
        for n, e in enumerate(direction):
            jacobian = np.hstack([np.eye(3), -cross_matrix(arm[n])])
            own = tension[n] / length[n] * np.eye(3) + (
                self.scene.wires.stiffness[n] - tension[n] / length[n]
            ) * np.outer(e, e)
            pull = tension[n] * e
            turned = (np.outer(pull, arm[n]) + np.outer(arm[n], pull)) / 2 - pull @ arm[n] * np.eye(
                3
            )
            result += jacobian.T @ own @ jacobian
            result[3:, 3:] += turned
        return result

    def quotients(self, step: float = STEP) -> Any:
        """Tangent stiffness (6, 6) by second difference quotients of the energy."""
        unit = step * np.eye(6)
        result = np.zeros((6, 6))
        for i in range(6):
            for j in range(i, 6):
                plus, minus = unit[i] + unit[j], unit[i] - unit[j]
                four = (
                    self.displaced(plus).energy
                    - self.displaced(minus).energy
                    - self.displaced(-minus).energy
                    + self.displaced(-plus).energy
                )
                result[i, j] = result[j, i] = four / (4 * step**2)
        return result

    def balanced(self, most: int = 30) -> Stage:
        """Find the equilibrium by undamped Newton steps, until these are below rounding."""
        stage = self
        for _ in range(most):
            with np.errstate(all="ignore"):
                step = np.linalg.solve(stage.stiffness, -stage.gradient)
            if not np.isfinite(step).all():
                break
            stage = stage.displaced(step)
            if np.abs(step).max() < 1e-15:
                break
        return stage

    def ratio(self, frequency: float, point: Any, stiffness: Any) -> float:
        """Ratio x over z of a point of the body for vertical support motion; stiffness (6, 6)."""
        mass = np.zeros((6, 6))
        mass[:3, :3] = self.scene.bodies.mass[0] * np.eye(3)
        mass[3:, 3:] = self.turn @ self.scene.bodies.inertia[0] @ self.turn.T
        with np.errstate(all="ignore"):
            q = np.linalg.solve(stiffness - (2 * np.pi * frequency) ** 2 * mass, stiffness[:, 2])
            motion = q[:3] + np.cross(q[3:], self.turn @ point)
            return float(motion[0] / motion[2])
