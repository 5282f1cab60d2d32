"""Poses of imperfect builds, where a second equilibrium has two growing modes."""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np

from suspension_cli.design import reader
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.energy import gradient_and_stiffness
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.scene.pose import Pose, displace, layout, nominal_pose
from suspension_cli.scene.scene import Scene
from suspension_cli.scene.stack import stack_scenes
from tests.support.energy_minimum import Energy
from tools.stability.references import design
from tools.stability.row import SHIPPED, Row

TOO_LONG = 1e-4 * np.array([12, 14, 8, -3, 6, 6, -13, 14, -14, -8])
"""m by which the ten wires of the triple are too long: a build on which Newton's method alone ends
where two modes grow."""
FRACTION = np.array([1e-4, 1e-3, 0.01, 0.1, 0.3, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])


def build(fraction: float) -> Scene:
    """Build the shipped triple with a fraction of these errors."""
    return expand(design(_document() | {"perturbation": _errors(fraction)}))


def _document() -> dict[str, Any]:
    return tomllib.loads(reader.example("geo-silica-triple").text)


def _errors(fraction: float) -> list[dict[str, Any]]:
    labels = expand(reader.example("geo-silica-triple").design).wires.label
    return [
        {"wire": label, "length_change": float(fraction * change)}
        for label, change in zip(labels, TOO_LONG, strict=True)
    ]


def balance_by_determinant(scene: Scene) -> Pose | None:
    """Find a pose by Newton's method alone, taken for stable if its determinant is positive."""
    numbering, pose = layout(scene), nominal_pose(scene)
    for _ in range(50):
        gradient, stiffness = gradient_and_stiffness(scene, numbering, pose)
        step = np.linalg.solve(stiffness[6:, 6:], -gradient[6:])
        pose = displace(numbering, pose, np.concatenate([np.zeros(6), step]))
        if np.abs(step).max() < 1e-10:
            break
    sign, _ = np.linalg.slogdet(gradient_and_stiffness(scene, numbering, pose)[1][6:, 6:])
    return pose if sign > 0 else None


def linear_step(scene: Scene) -> Pose:
    """Find a pose by one step of Newton's method from the drawing."""
    numbering, pose = layout(scene), nominal_pose(scene)
    gradient, stiffness = gradient_and_stiffness(scene, numbering, pose)
    step = np.linalg.solve(stiffness[6:, 6:], -gradient[6:])
    return displace(numbering, pose, np.concatenate([np.zeros(6), step]))


def row(fraction: Any = FRACTION) -> Row:
    """Compute errors of the rotations of all bodies, against the lowest energy."""
    loads = expand(reader.example("geo-silica-triple").design).blades.load[:, 2]
    built = [build(float(value)) for value in fraction]
    batch = equilibrium.solve(stack_scenes(built)).pose.rotation
    error: dict[str, list[float]] = {}
    for n, scene in enumerate(built):
        energy = Energy(scene, loads)
        _, exact, _ = energy.parts(energy.lowest())
        size = np.abs(exact - np.eye(3)).max()
        alone = balance_by_determinant(scene)
        answers = {
            f"{SHIPPED}: a build alone": equilibrium.solve(scene).pose.rotation,
            f"{SHIPPED}: among others": batch[n],
            "Newton, sign of the determinant": None if alone is None else alone.rotation,
            "one linear step": linear_step(scene).rotation,
        }
        for name, found in answers.items():
            off = np.inf if found is None else float(np.abs(found - exact).max() / size)
            error.setdefault(name, []).append(off)
    return Row(
        title="Two growing modes",
        driver="errors of ten wires' lengths, over ±1.4 mm",
        quantity="rotations of the bodies",
        value=np.asarray(fraction),
        error={name: np.array(values) for name, values in error.items()},
        finding=(
            "From 0.6 on, Newton's method may end in an equilibrium at which two modes grow, and"
            " two negative eigenvalues leave the determinant positive. The program reads stability"
            " from all pivots, and follows the stable pose from the drawing in smaller steps."
        ),
        limit="none found; a build without a stable pose near the drawing is reported",
    )
