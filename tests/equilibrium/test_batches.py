"""Builds of a batch hang as single designs do."""

from dataclasses import replace

import numpy as np

from suspension_cli.equilibrium import solve
from suspension_cli.scene.pose import Pose, displace, layout, nominal_pose
from suspension_cli.scene.stack import stack_scenes
from tests.support import scenes

BUILDS = 3


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
