"""Compiled loops against the same formulas on arrays, on random scenes in random poses."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from suspension_cli.compiled import factorise, substitute
from suspension_cli.equilibrium import bending_wires, compiled, solve
from suspension_cli.equilibrium.energy import gradient_and_stiffness
from suspension_cli.models import registry
from suspension_cli.models import string as string_model
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


def random_pose(rng, scene):
    """A pose some mm and mrad away from the nominal one, the support's included."""
    numbering = layout(scene)
    step = rng.normal(size=(BUILDS, numbering.size)) * 3e-3
    start = nominal_pose(scene)
    moved = displace(numbering, displace(numbering, start, step), step[:, ::-1])
    axes = scene.blades.axes
    return numbering, replace(moved, deflection=np.where(axes, moved.deflection, 0.0))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(1))
def test_stiffness_and_mass(kind, seed):
    rng = np.random.default_rng([17, seed])
    scene, _, _ = batch_of(rng, kind)
    numbering, pose = random_pose(rng, scene)
    if kind == "bending":
        scene, found = bending_wires.solve_bending(scene, numbering)
        assert found.converged.all()
        pose = found.pose
    soft, form, whole, mass = compiled.tangent(scene, numbering, pose)
    k = np.broadcast_to(scene.wires.stiffness, form.shape[:2])
    stiffness = soft + (np.swapaxes(form, -1, -2) * k[:, None]) @ form
    _, expected = gradient_and_stiffness(scene, numbering, pose)
    for found in (stiffness, whole):
        assert np.abs(found - expected).max() < 1e-13 * np.abs(expected).max()
    tips = scene.blades.tip_mass
    bodies = replace(scene, blades=replace(scene.blades, tip_mass=np.zeros_like(tips)))
    inertia = string_model.mass_matrix(bodies, numbering, pose)
    assert np.abs(mass - inertia).max() < 1e-14 * np.abs(inertia).max()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(1))
def test_equilibria_are_those_of_single_designs(kind, seed):
    """The loops take other steps to the same pose."""
    rng = np.random.default_rng([23, seed])
    scene, members, design = batch_of(rng, kind)
    numbering = layout(scene)
    if kind == "bending":
        _, found = bending_wires.solve_bending(scene, numbering)
    else:
        found = solve.solve(scene, numbering)
    for n, member in enumerate(members):
        if kind == "bending":
            one = registry.BEAM.completed(member, design)
            _, expected = bending_wires.solve_bending(one, numbering)
        else:
            expected = solve.solve(member, numbering)
        assert expected.converged == found.converged[n]
        for name in ("shift", "turn", "deflection"):
            difference = getattr(found.pose, name)[n] - getattr(expected.pose, name)
            assert np.abs(difference).max() < 2e-12
        assert found.tension[n] == pytest.approx(expected.tension, rel=1e-10)


def test_factors():
    """Against LAPACK, real and complex."""
    rng = np.random.default_rng(5)
    for kind in (float, complex):
        root = rng.normal(size=(9, 9)).astype(kind)
        if kind is complex:
            root += 1j * rng.normal(size=(9, 9)) / 3
        matrix = root @ root.T + 9 * np.eye(9)
        matrix[:4, 5:] = matrix[5:, :4] = 0.0
        right = rng.normal(size=9).astype(kind)
        factor, pivot = np.zeros((9, 9), dtype=kind), np.empty(9, dtype=kind)
        least = factorise(matrix, factor, pivot, np.empty(9, dtype=np.int64), 0, 0)
        assert least == pytest.approx(np.abs(pivot / np.diag(matrix)).min(), rel=1e-14)
        assert np.prod(pivot) == pytest.approx(np.linalg.det(matrix), rel=1e-12)
        x = right.copy()
        substitute(factor, x)
        assert x == pytest.approx(np.linalg.solve(matrix, right), rel=1e-12)


def test_poses_are_not_changed():
    """The start of the search is the caller's."""
    rng = np.random.default_rng(2)
    scene, _, _ = batch_of(rng, "strings")
    numbering, pose = random_pose(rng, scene)
    kept = Pose(pose.shift.copy(), pose.turn.copy(), pose.deflection.copy())
    solve.solve(scene, numbering, start=pose)
    for name in ("shift", "turn", "deflection"):
        assert (getattr(pose, name) == getattr(kept, name)).all()
