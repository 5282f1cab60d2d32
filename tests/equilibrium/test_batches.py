"""Builds of a batch hang as single designs do."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from suspension_cli.equilibrium import clamps, solve
from suspension_cli.equilibrium.newton import factorise
from suspension_cli.models import registry
from suspension_cli.scene.pose import Pose, displace, layout, nominal_pose
from suspension_cli.scene.stack import stack_scenes
from tests.support import scenes

BUILDS = 3


def bending_chain(rng):
    raw = scenes.bladed_chain(rng, 2, tip_mass=True, lateral=True)
    return scenes.perturbations(rng, scenes.fibred(raw, ribbons=bool(rng.random() < 0.5)))


KINDS = {
    "strings": lambda rng: scenes.perturbations(rng, scenes.bladed_chain(rng, 3, lateral=True)),
    "springs in a tree": scenes.crooked,
    "bending": bending_chain,
}


def batch_of(rng, kind):
    """A batch of one random design with all imperfections scaled, and the design."""
    raw = KINDS[kind](rng)
    design = scenes.design_of(raw)
    members = []
    for factor in np.linspace(0.4, 1.0, BUILDS):
        own = copy.deepcopy(raw)
        for item in own.get("perturbation", ()):
            for name in ("com_offset", "rotation", "upper_offset", "lower_offset"):
                if name in item:
                    item[name] = [factor * value for value in item[name]]
        members.append(scenes.scene_of(own))
    scene = stack_scenes(members)
    if kind == "bending":
        scene = registry.BEAM.completed(scene, design)
    return scene, members, design


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(1))
def test_equilibria_are_those_of_single_designs(kind, seed):
    rng = np.random.default_rng([23, seed])
    scene, members, design = batch_of(rng, kind)
    numbering = layout(scene)
    if kind == "bending":
        _, found = clamps.solve_bending(scene, numbering)
    else:
        found = solve.solve(scene, numbering)
    for n, member in enumerate(members):
        if kind == "bending":
            one = registry.BEAM.completed(member, design)
            _, expected = clamps.solve_bending(one, numbering)
        else:
            expected = solve.solve(member, numbering)
        assert expected.converged == found.converged[n]
        for name in ("shift", "turn", "deflection"):
            difference = getattr(found.pose, name)[n] - getattr(expected.pose, name)
            # but for what rotates freely below a single wire
            assert np.abs(difference).max() < 1e-10
        assert found.tension[n] == pytest.approx(expected.tension, rel=1e-10)


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
    scene, _, _ = batch_of(rng, "strings")
    pose = random_pose(rng, scene)
    kept = Pose(pose.shift.copy(), pose.turn.copy(), pose.deflection.copy())
    solve.solve(scene, start=pose)
    for name in ("shift", "turn", "deflection"):
        assert (getattr(pose, name) == getattr(kept, name)).all()
