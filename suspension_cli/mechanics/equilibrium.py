"""Where a suspension really hangs: exact finite rotations, Newton with the exact tangent stiffness.

Wires are taken as linear springs while the search goes on (they may push), so that the energy is smooth; that all
of them pull is checked at the end.  A saddle point counts as an equilibrium: an unstable one is a finding, not an
error, so the search goes to the stationary point next to the nominal pose and does not slide down from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.design.scene import Scene
from suspension_cli.errors import Fault, InputError
from suspension_cli.mechanics import string
from suspension_cli.mechanics.pose import Layout, Pose, displaced, layout, nominal_pose
from suspension_cli.mechanics.tangent import tangent

BALANCED = 1e-14
"""Residual (of the weight) of a nominal pose that needs no search."""
CONVERGED = 1e-11
"""Residual (of the weight) below which a search has found its equilibrium."""
LAST_STEP = 1e-8
"""Step (m or rad) after which the error is below rounding, as convergence is quadratic."""
ITERATIONS = 60
CAP = 0.3
"""Longest step in rad, and in units of the largest lever arm."""


@dataclass(frozen=True)
class Equilibrium:
    """The pose in which a scene balances.

    Attributes
    ----------
    pose : Pose
    residual : (...) array
        Largest force left over as a share of the weight, largest torque as a share of weight times lever arm.
    iterations : int
        Newton steps taken; 0 if the nominal pose balances.
    tension : (..., w) array
        N.
    stiffness : (..., N, N) array
        The tangent stiffness in this pose.
    """

    pose: Pose
    residual: Any
    iterations: int
    tension: Any
    stiffness: Any

    @property
    def converged(self) -> Any:
        """Whether each scene of the batch has an equilibrium near its nominal pose."""
        return self.residual < CONVERGED

    def demand(self, scene: Scene) -> None:
        """Raise `InputError` unless every scene of the batch balances on taut wires."""
        if not np.all(self.converged):
            worst = float(np.max(np.nan_to_num(self.residual, nan=np.inf)))
            remedy = "check natural lengths, positions and the size of the perturbations"
            raise InputError([Fault("stage", f"no equilibrium found near the nominal pose (residual {worst:.1e} of the weight)", remedy)])
        slack = np.flatnonzero((self.tension <= 0).reshape(-1, len(scene.wires.label)).any(0))
        if slack.size:
            low = self.tension.reshape(-1, len(scene.wires.label)).min(0)
            raise InputError(
                [
                    Fault(
                        _key(scene.wires.label[n]),
                        f"wire {scene.wires.label[n]} is slack in equilibrium (tension {low[n]:.3g} N)",
                        "shorten it, or leave it out",
                    )
                    for n in slack
                ]
            )


def _key(label: str) -> str:
    return f"stage.{label.rsplit('.', 1)[0]}.wire"


def lever_arm(scene: Scene) -> Any:
    """Largest distance of an attachment from a COM, m, at least 1 mm."""
    points = np.concatenate([scene.wires.upper_point.reshape(-1), scene.wires.lower_point.reshape(-1), scene.springs.lower_point.reshape(-1)])
    return max(float(np.abs(points).max(initial=0.0)), 1e-3)


def solve(scene: Scene, numbering: Layout | None = None, start: Pose | None = None) -> Equilibrium:
    """Find the equilibrium of a scene near its nominal pose.

    Parameters
    ----------
    scene : Scene
        With any batch axes; all scenes of a batch are solved at once.
    numbering : Layout, optional
    start : Pose, optional
        Where to start from instead of the nominal pose.

    Returns
    -------
    Equilibrium
        Not necessarily converged: see `Equilibrium.demand`.
    """
    numbering = numbering or layout(scene)
    pose = start or nominal_pose(scene)
    unit = _units(scene, numbering)
    free = slice(6, None)
    gradient, hessian = tangent(scene, numbering, pose)
    residual = _size(gradient[..., free] / unit)
    if start is None and np.all(residual <= BALANCED):
        return Equilibrium(pose, residual, 0, string.state(scene, pose).tension, hessian)
    cap = CAP * np.where(_is_rotation(numbering)[free], 1.0, lever_arm(scene))
    rigid = _has_rigid_modes(hessian[..., free, free], unit)
    settled = np.zeros(scene.batch, dtype=bool)
    count = 0
    while count < ITERATIONS and not np.all(settled):
        step = _newton_step(gradient[..., free], hessian[..., free, free], unit, rigid)
        over = np.maximum(_size(step / cap), 1.0)
        step = np.where(settled[..., None], 0.0, step / over[..., None])
        settled = settled | (_size(step) < LAST_STEP)
        whole = np.concatenate([np.zeros((*step.shape[:-1], 6)), step], axis=-1)
        pose = displaced(numbering, pose, whole)
        gradient, hessian = tangent(scene, numbering, pose)
        count += 1
    residual = _size(gradient[..., free] / unit)
    return Equilibrium(pose, residual, count, string.state(scene, pose).tension, hessian)


def _units(scene: Scene, numbering: Layout) -> Any:
    """The weight for forces, weight times lever arm for torques: (..., N - 6)."""
    scale = np.where(_is_rotation(numbering)[6:], lever_arm(scene), 1.0)
    return scene.weight[..., None] * scale


def _is_rotation(numbering: Layout) -> Any:
    return np.array([name.rsplit(".", 1)[1] in ("roll", "pitch", "yaw") for name in numbering.name])


def _size(values: Any) -> Any:
    return np.abs(values).max(-1)


def _has_rigid_modes(hessian: Any, unit: Any) -> bool:
    """Whether the first scene of the batch can move without cost (a body that spins on one wire)."""
    root = np.sqrt(unit).reshape(-1, unit.shape[-1])[0]
    first = hessian.reshape(-1, *hessian.shape[-2:])[0] / np.outer(root, root)
    values = np.abs(np.linalg.eigvalsh(first)) if np.isfinite(first).all() else np.ones(1)
    return bool(values.min() < 1e-12 * values.max())


def _newton_step(gradient: Any, hessian: Any, unit: Any, rigid: bool) -> Any:
    """-K^-1 g; along rigid modes, where K has nothing to say, no step."""
    root = np.sqrt(unit)
    scaled = hessian / (root[..., :, None] * root[..., None, :])
    force = gradient / root
    if not rigid:
        try:
            return -np.linalg.solve(scaled, force[..., None])[..., 0] / root
        except np.linalg.LinAlgError:
            pass
    values, vectors = np.linalg.eigh(np.nan_to_num(scaled))
    small = np.abs(values) < 1e-12 * np.abs(values).max(-1, keepdims=True)
    inverse = np.where(small, 0.0, 1.0 / np.where(small, 1.0, values))
    return -(vectors @ (inverse * (np.swapaxes(vectors, -1, -2) @ force[..., None])[..., 0])[..., None])[..., 0] / root
