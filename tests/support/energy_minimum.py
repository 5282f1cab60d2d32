"""Where a suspension hangs, from its energy alone: springs, weights and finite rotations, minimised
by scipy.

Independent of `mechanics`: no force or stiffness is written down, gradients are complex steps
through the energy.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import minimize

STEP, DIFFERENCE = 1e-30, 1e-6


class Energy:
    """Potential energy of a scene without springs and tip masses; coordinates are shift and
    rotation vector of each body, then vertical deflections of blades.

    `load` (b,) is the weight on each blade at which its tip is where it is drawn; None holds all
    tips there instead.
    """

    def __init__(self, scene: Any, load: Any = None):
        w = scene.wires
        self.place, self.weight = scene.bodies.position, scene.gravity * scene.bodies.mass
        self.upper, self.lower, self.blade = w.upper, w.lower, w.blade
        self.upper_point, self.lower_point = w.upper_point, w.lower_point
        self.k, self.natural = w.stiffness, w.length - w.tension / w.stiffness
        self.load, self.soft = load, scene.blades.stiffness[:, 2]
        self.size = 6 * len(self.weight) + (0 if load is None else len(load))

    def parts(self, x: Any) -> tuple[Any, Any, Any]:
        """Places (..., n + 1, 3), rotation matrices and deflections (..., b)."""
        count = len(self.weight)
        motion = np.concatenate(
            [np.zeros((*x.shape[:-1], 1, 6)), x[..., : 6 * count].reshape(*x.shape[:-1], count, 6)],
            axis=-2,
        )
        v, zero = motion[..., 3:], np.zeros(motion.shape[:-1])
        a, b, c = v[..., 0], v[..., 1], v[..., 2]
        cross = np.stack(
            [np.stack([zero, -c, b], -1), np.stack([c, zero, -a], -1), np.stack([-b, a, zero], -1)],
            -2,
        )
        angle = np.sqrt((v**2).sum(-1) + 1e-60)[..., None, None]
        turn = (
            np.eye(3)
            + np.sin(angle) / angle * cross
            + 2 * (np.sin(angle / 2) / angle) ** 2 * (cross @ cross)
        )
        bent = (
            x[..., 6 * count :]
            if self.load is not None
            else np.zeros((*x.shape[:-1], len(self.soft)))
        )
        return self.place + motion[..., :3], turn, bent

    def lengths(self, x: Any) -> Any:
        """Lengths of the wires (..., w), m."""
        place, turn, bent = self.parts(x)
        lift = (
            np.where(self.blade >= 0, bent[..., self.blade], 0.0)[..., None]
            * np.array([0.0, 0.0, 1.0])
            if bent.shape[-1]
            else 0.0
        )
        upper = (
            place[..., self.upper, :]
            + (turn[..., self.upper, :, :] @ (self.upper_point + lift)[..., None])[..., 0]
        )
        lower = (
            place[..., self.lower, :]
            + (turn[..., self.lower, :, :] @ self.lower_point[..., None])[..., 0]
        )
        return np.sqrt(((lower - upper) ** 2).sum(-1))

    def __call__(self, x: Any) -> Any:
        """J, of coordinates (..., n)."""
        place, _, bent = self.parts(x)
        stretch = self.lengths(x) - self.natural
        blades = 0.0 if self.load is None else (self.soft * bent**2 / 2 - self.load * bent).sum(-1)
        return (
            (self.k * stretch**2 / 2).sum(-1)
            + (self.weight * (place[..., 1:, 2] - self.place[1:, 2])).sum(-1)
            + blades
        )

    def gradient(self, x: Any) -> Any:
        """N and N m, (..., n)."""
        return self(x[..., None, :] + 1j * STEP * np.eye(self.size)).imag / STEP

    def stiffness(self, x: Any) -> Any:
        """Matrix (n, n)."""
        steps = DIFFERENCE * np.eye(self.size)
        matrix = (self.gradient(x + steps) - self.gradient(x - steps)) / (2 * DIFFERENCE)
        return (matrix + matrix.T) / 2

    def lowest(self, x: Any = None) -> Any:
        """Coordinates of the minimum next to a place (default: as drawn)."""
        x = np.zeros(self.size) if x is None else x
        scale = 1 / np.sqrt(np.abs(np.diag(self.stiffness(x))) + 1.0)
        found = minimize(
            lambda y: float(self(scale * y)),
            x / scale,
            jac=lambda y: scale * self.gradient(scale * y),
            hess=lambda y: scale[:, None] * self.stiffness(scale * y) * scale,
            method="trust-exact",
            options={
                "initial_trust_radius": 0.3,
                "max_trust_radius": 3.0,
                "gtol": 1e-9,
                "maxiter": 400,
            },
        )
        x = scale * found.x
        for _ in range(3):
            x = x - np.linalg.solve(self.stiffness(x), self.gradient(x))
        return x
