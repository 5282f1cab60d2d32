"""Builds of a batch hang as single designs do."""

from dataclasses import replace

import numpy as np

from suspension_cli.equilibrium import solve
from suspension_cli.equilibrium.newton import factorise
from suspension_cli.scene.pose import Pose, displace, layout, nominal_pose
from suspension_cli.scene.stack import stack_scenes
from tests.support import scenes

BUILDS = 3


def test_factors():
    """Against LAPACK; a coordinate without stiffness stays where it is."""
    rng = np.random.default_rng(5)
    root = rng.normal(size=(4, 9, 9))
    matrix = root @ np.swapaxes(root, -1, -2) + 9 * np.eye(9)
    matrix[:, :4, 5:] = matrix[:, 5:, :4] = 0.0
    linked = (matrix != 0).any(0)
    right = rng.normal(size=(4, 9))

    def solve():
        found, order = np.empty_like(right.T), factors.pattern.order
        found[order] = factors.solve(right.T[order, None])[:, 0]
        return found.T

    factors = factorise(np.moveaxis(matrix, 0, -1), linked)
    expected = np.linalg.solve(matrix, right[..., None])[..., 0]
    np.testing.assert_allclose(solve(), expected, rtol=1e-12)
    assert (factors.least > 0).all()
    matrix[0, 6] = matrix[0, :, 6] = right[0, 6] = 0.0
    matrix[1, 2, 2] -= 100.0
    factors = factorise(np.moveaxis(matrix, 0, -1), linked)
    assert ((factors.least > 0) == [False, False, True, True]).all()
    found = solve()
    np.testing.assert_allclose(matrix[:2] @ found[:2, :, None], right[:2, :, None], atol=1e-10)
    assert found[0, 6] == 0


def random_pose(rng, scene):
    """A pose some mm and mrad away from the nominal one."""
    numbering = layout(scene)
    step = rng.normal(size=(BUILDS, numbering.size)) * 3e-3
    moved = displace(numbering, nominal_pose(scene), step)
    return replace(moved, deflection=np.where(scene.blades.axes, moved.deflection, 0.0))


def test_poses_are_not_changed():
    """The start of the search is the caller's."""
    rng = np.random.default_rng(2)
    raw = scenes.perturbations(rng, scenes.bladed_chain(rng, 3, lateral=True))
    scene = stack_scenes([scenes.scene_of(raw)] * BUILDS)
    pose = random_pose(rng, scene)
    kept = Pose(pose.shift.copy(), pose.turn.copy(), pose.deflection.copy())
    solve.solve(scene, start=pose)
    for name in ("shift", "turn", "deflection"):
        assert (getattr(pose, name) == getattr(kept, name)).all()
