"""What bending and twisting wires add to strings: energy, forces and tangent stiffness belong
together, in any pose of any scene."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from suspension_cli.elements import bending, string
from suspension_cli.elements.resting import principal_planes
from suspension_cli.equilibrium import energy
from suspension_cli.rotations import rotation_matrix
from suspension_cli.scene.pose import Pose, nominal_pose
from suspension_cli.scene.scene import Flex
from tests.elements.test_elements import KINDS, random_pose, random_scene
from tests.support import beam_mp
from tests.support.derivatives import complex_gradient, hessian

bending_energy = partial(energy.energy, elements=[bending.ELEMENT])
every = pytest.mark.parametrize("seed", range(1))
of_each_kind = pytest.mark.parametrize("kind", KINDS)


def bending_scene(kind, seed, *, crooked=True):
    """A random scene whose wires are stiff in random planes; clamped along themselves, or a little
    off."""
    scene, rng = random_scene(kind, seed)
    wires, count = scene.wires, len(scene.wires.label)
    chord = wires.span / wires.length[:, None]
    ends = []
    for n in range(count):
        plane = np.cross(chord[n], rng.normal(size=3))
        clamps = [chord[n] + (0.2 * rng.normal(size=3) if crooked else 0.0) for _ in range(2)]
        ends.append(
            [
                principal_planes(plane / np.linalg.norm(plane), clamp / np.linalg.norm(clamp))
                for clamp in clamps
            ]
        )
    root = rng.normal(size=(count, 2, 2, 2))
    form = 3.0 * root @ np.swapaxes(root, -1, -2)
    bend = np.stack([form[..., 0, 0], form[..., 0, 1], form[..., 1, 1]], axis=-1)
    flex = Flex(
        np.array([e[0] for e in ends]),
        np.array([e[1] for e in ends]),
        bend,
        rng.uniform(0.5, 5.0, count),
    )
    return replace(scene, flex=flex), rng


def alone(scene):
    """Bending and twisting only: no weight, no tension, no springs."""
    wires = replace(
        scene.wires, stiffness=0 * scene.wires.stiffness, tension=0 * scene.wires.tension
    )
    blades = replace(
        scene.blades,
        stiffness=0 * scene.blades.stiffness,
        load=0 * scene.blades.load,
        tip_mass=0 * scene.blades.tip_mass,
    )
    springs = replace(
        scene.springs, stiffness=0 * scene.springs.stiffness, preload=0 * scene.springs.preload
    )
    return replace(scene, gravity=0.0, wires=wires, blades=blades, springs=springs)


@every
@of_each_kind
def test_gradient_is_that_of_the_energy(kind, seed):
    scene, rng = bending_scene(kind, seed)
    numbering, pose = random_pose(scene, rng, length=0.02, angle=0.4)
    gradient, _ = energy.gradient_and_stiffness(alone(scene), numbering, pose)
    derived = complex_gradient(bending_energy, scene, numbering, pose, np.zeros(numbering.size))
    assert np.abs(derived).max() > 0.1
    assert np.abs(gradient - derived).max() < 1e-12 * np.abs(derived).max()


@every
@of_each_kind
def test_tangent_stiffness_is_that_of_the_energy(kind, seed):
    scene, rng = bending_scene(kind, seed)
    numbering, pose = random_pose(scene, rng, length=0.02, angle=0.4)
    _, stiffness = energy.gradient_and_stiffness(alone(scene), numbering, pose)
    derived = hessian(bending_energy, scene, numbering, pose)
    assert np.array_equal(stiffness, stiffness.T)
    assert np.abs(stiffness - derived).max() < 1e-10 * np.abs(derived).max()


@every
@of_each_kind
def test_they_add_to_all_else(kind, seed):
    scene, rng = bending_scene(kind, seed)
    numbering, pose = random_pose(scene, rng)
    for whole, bent, rest in zip(
        *(
            energy.gradient_and_stiffness(each, numbering, pose)
            for each in (scene, alone(scene), replace(scene, flex=None))
        ),
        strict=True,
    ):
        assert np.abs(whole - bent - rest).max() < 1e-13 * np.abs(whole).max()
    whole, rest = (energy.energy(each, pose) for each in (scene, replace(scene, flex=None)))
    assert bending_energy(scene, pose) > 0
    assert whole - rest == pytest.approx(bending_energy(scene, pose), rel=1e-9)


@every
@of_each_kind
def test_moving_everything_as_one_costs_nothing(kind, seed):
    """However far, the support included; forces turn with the scene, and rigid motions are free of
    stiffness but for turned forces."""
    scene, rng = bending_scene(kind, seed)
    numbering, pose = random_pose(scene, rng, length=0.02, angle=0.4)
    turn, shift = rotation_matrix(rng.normal(size=3)), rng.uniform(-1, 1, 3)
    place = scene.bodies.position + pose.shift
    moved = Pose(
        place @ turn.T + shift - scene.bodies.position,
        turn @ pose.rotation - np.eye(3),
        pose.deflection,
    )
    assert bending_energy(scene, moved) == pytest.approx(bending_energy(scene, pose), rel=1e-12)
    (before, stiff), (after, turned) = (
        energy.gradient_and_stiffness(alone(scene), numbering, at) for at in (pose, moved)
    )
    bodies = len(scene.bodies.name) + 1
    frame = np.eye(numbering.size)
    frame[: 6 * bodies, : 6 * bodies] = np.kron(np.eye(2 * bodies), turn)
    assert np.abs(frame @ before - after).max() < 1e-12 * np.abs(before).max()
    assert np.abs(frame @ stiff @ frame.T - turned).max() < 1e-12 * np.abs(stiff).max()
    motions = before[: 6 * bodies].reshape(bodies, 2, 3)
    force, torque = motions[:, 0].sum(0), (np.cross(place, motions[:, 0]) + motions[:, 1]).sum(0)
    assert np.abs([force, torque]).max() < 1e-12 * np.abs(before).max()


@every
def test_batches_are_scenes_side_by_side(seed):
    scene, rng = bending_scene("crooked", seed)
    numbering, one = random_pose(scene, rng)
    _, other = random_pose(scene, rng)
    both = Pose(
        *(
            np.stack([getattr(one, name), getattr(other, name)])
            for name in ("shift", "turn", "deflection")
        )
    )
    two = replace(scene, bodies=replace(scene.bodies, mass=np.stack([scene.bodies.mass] * 2)))
    together = energy.gradient_and_stiffness(two, numbering, both)
    for n, pose in enumerate((one, other)):
        for found, single in zip(
            together, energy.gradient_and_stiffness(scene, numbering, pose), strict=True
        ):
            assert np.abs(found[n] - single).max() <= 1e-13 * np.abs(single).max()


@every
@of_each_kind
def test_a_wire_clamped_along_itself_is_free_of_forces(kind, seed):
    scene, _ = bending_scene(kind, seed, crooked=False)
    pose = nominal_pose(scene)
    assert bending_energy(scene, pose) < 1e-28
    numbering, _ = random_pose(scene, np.random.default_rng(0))
    gradient, stiffness = energy.gradient_and_stiffness(alone(scene), numbering, pose)
    assert np.abs(gradient).max() < 1e-12 * np.abs(stiffness).max()
    moments = np.linalg.eigvalsh(stiffness)
    assert moments.min() > -1e-12 * moments.max()


def test_one_wire_has_the_stiffness_of_a_beam_and_a_rod():
    """String and bending together, in the nominal pose: the 4 x 4 of a static beam in each plane,
    EA/L along it and GJ/L about it."""
    scene, rng = random_scene("crooked", 1)
    wires = scene.wires
    keep = {name: getattr(wires, name)[:1] for name in vars(wires) if name != "label"} | {
        "blade": np.array([-1])
    }
    wires = replace(wires, label=wires.label[:1], **keep)
    tension, length, chord = (
        float(wires.tension[0]),
        float(wires.length[0]),
        wires.span[0] / wires.length[0],
    )
    rigidity, twisting = (3e-2, 0.4), 0.7
    plane = np.cross(chord, rng.normal(size=3))
    normals = principal_planes(plane / np.linalg.norm(plane), chord)
    exact = []
    for value in rigidity:
        with beam_mp.exact(200):
            exact.append(
                beam_mp.doubles(beam_mp.Bent(value, tension, 0.0, length, 0).stiffness()).real
            )
    bend = np.array([[[e[1, 1], e[1, 3], e[3, 3]] for e in exact]])
    scene = replace(
        scene,
        wires=wires,
        flex=Flex(normals[None], normals[None], bend, np.array([twisting / length])),
    )
    numbering, _ = random_pose(scene, rng)
    _, whole = energy.gradient_and_stiffness(
        replace(alone(scene), wires=wires), numbering, nominal_pose(scene)
    )
    rest = np.zeros_like(whole)
    forms = []  # displacement and rotation of both ends along each axis
    for body, point in (
        (wires.upper[0], wires.upper_point[0]),
        (wires.lower[0], wires.lower_point[0]),
    ):
        at, turn = np.zeros((3, numbering.size)), np.zeros((3, numbering.size))
        at[:, 6 * body : 6 * body + 3] = turn[:, 6 * body + 3 : 6 * body + 6] = np.eye(3)
        at[:, 6 * body + 3 : 6 * body + 6] = [
            [0, point[2], -point[1]],
            [-point[2], 0, point[0]],
            [point[1], -point[0], 0],
        ]
        forms.append((at, turn))
    for normal, stiffness in zip(normals, exact, strict=True):
        about = np.cross(chord, normal)  # a turn about it tilts the chord towards the normal
        rows = np.vstack([part for at, turn in forms for part in (normal @ at, about @ turn)])
        rest += rows.T @ stiffness @ rows
    apart, turned = (chord @ (forms[1][k] - forms[0][k]) for k in (0, 1))
    rest += wires.stiffness[0] * np.outer(apart, apart) + twisting / length * np.outer(
        turned, turned
    )
    for (_, turn), pull, arm in zip(
        forms,
        (-tension * chord, tension * chord),
        (wires.upper_point[0], wires.lower_point[0]),
        strict=True,
    ):
        # the pull as its arm turns
        rest += (
            turn.T
            @ ((np.outer(pull, arm) + np.outer(arm, pull)) / 2 - pull @ arm * np.eye(3))
            @ turn
        )
    scale = np.sqrt(np.outer(np.diag(np.abs(rest)) + 1e-30, np.diag(np.abs(rest)) + 1e-30))
    assert np.abs((whole - rest) / scale).max() < 1e-12
    assert string.state(scene, nominal_pose(scene)).tension[0] == tension
