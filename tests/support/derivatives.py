"""Derivatives to rounding, for tests: complex steps, and high-order differences of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.scene.pose import Layout, Pose, displace
from suspension_cli.scene.scene import Scene

TINY = 1e-30
STENCIL = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
"""Eighth-order central difference."""


def complex_gradient(function: Any, scene: Scene, numbering: Layout, pose: Pose, step: Any) -> Any:
    """Gradient (..., N) of function(scene, pose displaced by q) at q = step (..., N), by complex
    steps."""
    probes = step[..., None, :] + 1j * TINY * np.eye(numbering.size)
    return np.imag(function(scene, displace(numbering, pose, probes))) / TINY


def hessian(function: Any, scene: Scene, numbering: Layout, pose: Pose, h: float = 1e-3) -> Any:
    """Hessian (N, N) of function(scene, pose displaced by q) at q = 0."""
    steps = np.array([n * h for n in STENCIL])[:, None, None] * np.eye(numbering.size)
    up, down = (
        complex_gradient(function, scene, numbering, pose, sign * steps) for sign in (1, -1)
    )
    weights = np.array(list(STENCIL.values()))[:, None, None]
    return (weights * (up - down)).sum(0) / h
