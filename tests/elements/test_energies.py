"""Energies, forces, tangent stiffness and inertia belong together, in any pose of any scene."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from suspension_cli.design import reader
from suspension_cli.elements.known_elements import elements_of
from suspension_cli.elements.resting import principal_planes
from suspension_cli.equilibrium.energy import gradient_and_stiffness, sum_forms
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.rotations import rigid_motion, rotation_matrix
from suspension_cli.scene.pose import Pose, displace, layout, nominal_pose
from suspension_cli.scene.scene import Field, Flex
from tests.models.test_whole_tower import DESIGN as TOWER
from tests.support import scenes
from tests.support.derivatives import TINY, complex_gradient, hessian
from tests.support.energies import energy, place_of, points


def imperfect(rng):
    return scenes.scene_of(scenes.perturbations(rng, scenes.chain(rng, 2)))


def crooked(rng):
    return scenes.scene_of(scenes.crooked(rng))


def bladed(rng):
    raw = scenes.bladed_chain(rng, 2, tip_mass=True, lateral=True)
    return scenes.scene_of(scenes.perturbations(rng, raw))


def heavy(rng, scene=None):
    """Wires of any distribution of mass in a strong gradient."""
    scene = scene or crooked(rng)
    beads, place = rng.uniform(0.1, 0.5, (len(scene.wires.label), 3)), np.array([0.1, 0.4, 0.8])
    moments = [(1 - place) ** 2, place * (1 - place), place**2]
    mass = np.stack([beads @ moment for moment in moments], axis=-1)
    slope = rng.normal(size=(3, 3)) * 0.3
    field = Field(np.array([1.0, -0.6, -9.0]), (slope + slope.T) / 2)
    wires, strength = replace(scene.wires, mass=mass), float(np.linalg.norm(field.vector))
    return replace(scene, gravity=strength, field=field, wires=wires)


def bending(rng, scene=None):
    """Wires that are stiff in random planes, and clamped a little off their direction."""
    scene = scene or crooked(rng)
    count, chord = len(scene.wires.label), scene.wires.span / scene.wires.length[:, None]
    clamp = chord[:, None] + 0.2 * rng.normal(size=(count, 2, 3))
    clamp /= np.linalg.norm(clamp, axis=-1, keepdims=True)
    planes = principal_planes(rng.normal(size=(count, 1, 3)), clamp)
    root = rng.normal(size=(count, 2, 2, 2))
    form = 3.0 * root @ np.swapaxes(root, -1, -2)
    bend = np.stack([form[..., 0, 0], form[..., 0, 1], form[..., 1, 1]], axis=-1)
    twist = rng.uniform(0.5, 5.0, count)
    return replace(scene, flex=Flex(planes[:, 0], planes[:, 1], bend, twist))


def twisting(rng):
    """Strings of given torsion."""
    scene = crooked(rng)
    torsion = rng.uniform(2.0, 5.0, len(scene.wires.label))
    return replace(scene, wires=replace(scene.wires, torsion=torsion))


def tower(rng, text=TOWER):
    del rng
    return expand(reader.parse(text))


SCENES = {
    "imperfect": imperfect,
    "crooked": crooked,
    "bladed": bladed,
    "heavy": heavy,
    "heavy on blades": lambda rng: heavy(rng, bladed(rng)),
    "bending": bending,
    "bending on blades": lambda rng: bending(rng, bladed(rng)),
    "twisting": twisting,
    "tower": tower,
    "tower without coupled masses": lambda rng: tower(rng, TOWER.replace("mass_coupling", "#")),
}
every = pytest.mark.parametrize("kind", SCENES)


@cache
def posed(kind, angle=0.3):
    """A scene, the numbering of its coordinates, and a random pose."""
    rng = np.random.default_rng([4, list(SCENES).index(kind)])
    scene = SCENES[kind](rng)
    numbering = layout(scene)
    step = scenes.step_of(rng, numbering.name, 0.02, angle)
    return scene, numbering, displace(numbering, nominal_pose(scene), step)


@every
def test_forces_and_stiffness_are_derivatives_of_the_energy(kind):
    """Of each element alone, so that weak ones are not hidden behind stiff ones; they add up."""
    scene, numbering, pose = posed(kind)
    total = [energy(scene, pose), *gradient_and_stiffness(scene, numbering, pose)]
    left, acting = [*total], 0
    for element in elements_of(scene):
        gradient, stiffness = gradient_and_stiffness(scene, numbering, pose, [element])
        assert np.array_equal(stiffness, stiffness.T)

        def alone(scene, pose, own=(element,)):
            return energy(scene, pose, own)

        slope = complex_gradient(alone, scene, numbering, pose, np.zeros(numbering.size))
        assert np.abs(gradient - slope).max() <= 1e-10 * np.abs(slope).max()
        curve = hessian(alone, scene, numbering, pose)
        assert np.abs(stiffness - curve).max() <= 1e-8 * np.abs(curve).max()
        found = [alone(scene, pose), gradient, stiffness]
        left, acting = [a - b for a, b in zip(left, found, strict=True)], acting + slope.any()
    assert acting >= 2
    for rest, whole in zip(left, total, strict=True):
        assert np.abs(rest).max() < 1e-12 * np.abs(whole).max()


@every
def test_moving_everything_as_one_costs_nothing(kind):
    """Without weight, however far, the support included: forces and stiffness turn with the scene,
    and no force or torque is left over."""
    scene, numbering, pose = posed(kind)
    free = replace(scene, gravity=0.0, field=None)
    rng = np.random.default_rng(5)
    turn, shift = rotation_matrix(rng.normal(size=3)), rng.uniform(-1, 1, 3)
    place = scene.bodies.position + pose.shift
    moved = Pose(
        place @ turn.T + shift - scene.bodies.position,
        turn @ pose.rotation - np.eye(3),
        pose.deflection,
    )
    assert energy(free, moved) == pytest.approx(energy(free, pose), rel=1e-9)
    (before, stiff), (after, turned) = (
        gradient_and_stiffness(free, numbering, at) for at in (pose, moved)
    )
    bodies, frame = len(scene.bodies.name) + 1, np.eye(numbering.size)
    frame[: 6 * bodies, : 6 * bodies] = np.kron(np.eye(2 * bodies), turn)
    assert np.abs(frame @ before - after).max() < 1e-10 * np.abs(before).max()
    assert np.abs(frame @ stiff @ frame.T - turned).max() < 1e-10 * np.abs(stiff).max()
    motions = before[: 6 * bodies].reshape(bodies, 2, 3)
    force, torque = motions[:, 0].sum(0), (np.cross(place, motions[:, 0]) + motions[:, 1]).sum(0)
    assert np.abs([force, torque]).max() < 1e-11 * np.abs(before).max()


@every
def test_nothing_that_moves_as_one_is_lost_or_damped(kind):
    """Loss and damping of each element, in the pose at rest."""
    scene, numbering, _ = posed(kind)
    rng, pose = np.random.default_rng(6), nominal_pose(scene)
    wires, springs = scene.wires, scene.springs
    root = rng.normal(size=(len(springs.label), 6, 6))
    scene = replace(
        scene,
        wires=replace(wires, loss=rng.uniform(0.1, 1.0, len(wires.label))),
        springs=replace(
            springs,
            loss=rng.uniform(0.1, 1.0, len(springs.label)),
            damping=root @ np.swapaxes(root, -1, -2),
        ),
    )
    motion = rigid_motion(numbering.size, np.vstack([scene.bodies.position]))
    for element in elements_of(scene):
        for part in (element.add_loss, element.add_damping):
            form = sum_forms(scene, numbering, pose, [part])
            assert np.abs(form @ motion).max() <= 1e-12 * np.abs(form).max()
            assert np.linalg.eigvalsh(form)[0] >= -1e-12 * np.abs(form).max()


@every
def test_mass_matrix_is_that_of_the_kinetic_energy_of_points(kind):
    """Velocities by complex steps."""
    scene, numbering, pose = posed(kind)
    rates = displace(numbering, pose, TINY * 1j * np.eye(numbering.size))
    expected = np.zeros((numbering.size, numbering.size))
    for mass, parts in points(scene):
        velocity = np.imag(place_of(scene, rates, parts)) / TINY
        expected += mass * velocity @ velocity.T
    found = sum_forms(scene, numbering, pose, [item.add_mass for item in elements_of(scene)])
    root = np.sqrt(np.maximum(np.diag(expected), 1e-3))
    assert np.array_equal(found, found.T)
    assert np.abs((found - expected) / np.outer(root, root)).max() < 1e-12
