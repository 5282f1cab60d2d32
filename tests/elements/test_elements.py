"""Energies, forces and tangent stiffness belong together, in any pose of any scene."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from suspension_cli.elements import blade, spring, string
from suspension_cli.equilibrium import energy as tangent
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.models.string import mass_matrix
from suspension_cli.rotations import rotation_matrix
from suspension_cli.scene.pose import Pose, displace, layout, nominal_pose
from tests.support import scenes
from tests.support.derivatives import complex_gradient, hessian

KINDS = ["crooked", "perturbed chain", "blades with tip masses"]


def random_scene(kind, seed):
    rng = np.random.default_rng([KINDS.index(kind), seed])
    if kind == "crooked":
        raw = scenes.crooked(rng)
    elif kind == "perturbed chain":
        raw = scenes.perturbations(rng, scenes.chain(rng, 2))
    else:
        raw = scenes.perturbations(rng, scenes.bladed_chain(rng, 2, tip_mass=True, lateral=True))
    return scenes.scene_of(raw), rng


def random_pose(scene, rng, length=0.01, angle=0.1):
    numbering = layout(scene)
    return numbering, displace(
        numbering, nominal_pose(scene), scenes.step_of(rng, numbering.name, length, angle)
    )


def every(function):
    return pytest.mark.parametrize("seed", range(1))(
        pytest.mark.parametrize("kind", KINDS)(function)
    )


def separate_energy(scene, pose):
    """Energy beyond the nominal pose, element by element, from stretched lengths and heights
    alone."""
    nominal = nominal_pose(scene)

    def total(at):
        def place(body, point):
            return scene.bodies.position[body] + at.shift[body] + at.rotation[body] @ point

        result = 0.0
        w, b, s = scene.wires, scene.blades, scene.springs
        for n in range(len(w.label)):
            deflection = at.deflection[w.blade[n]] if w.blade[n] >= 0 else 0.0
            length = np.linalg.norm(
                place(w.lower[n], w.lower_point[n])
                - place(w.upper[n], w.upper_point[n] + deflection)
            )
            natural = w.length[n] - w.tension[n] / w.stiffness[n]
            result += w.stiffness[n] / 2 * (length - natural) ** 2
        for n in range(len(b.label)):
            for axis in np.flatnonzero(b.axes[n]):
                rest = b.load[n, axis] / b.stiffness[n, axis]
                result += b.stiffness[n, axis] / 2 * (at.deflection[n, axis] - rest) ** 2
            result += (
                scene.gravity * b.tip_mass[n] * place(b.body[n], b.tip[n] + at.deflection[n])[2]
            )
        for n in range(len(s.label)):
            turn = at.rotation[s.upper[n]]
            delta = turn.T @ (
                place(s.lower[n], s.lower_point[n]) - place(s.upper[n], s.upper_point[n])
            )
            q = turn.T @ at.rotation[s.lower[n]]
            strain = np.array(
                [*delta, *(np.array([q[2, 1] - q[1, 2], q[0, 2] - q[2, 0], q[1, 0] - q[0, 1]]) / 2)]
            )
            result += strain @ s.stiffness[n] @ strain / 2 - s.preload[n] @ strain
        for n in range(len(scene.bodies.name)):
            result += scene.gravity * scene.bodies.mass[n] * place(n + 1, np.zeros(3))[2]
        return result

    return total(pose) - total(nominal)


@every
def test_energy_is_that_of_the_elements(kind, seed):
    scene, rng = random_scene(kind, seed)
    _, pose = random_pose(scene, rng)
    energy = tangent.energy(scene, pose)
    assert abs(energy) > 1e-3
    assert energy == pytest.approx(separate_energy(scene, pose), rel=1e-11)
    assert tangent.energy(scene, nominal_pose(scene)) == 0


@every
def test_gradient_is_that_of_the_energy(kind, seed):
    scene, rng = random_scene(kind, seed)
    numbering, pose = random_pose(scene, rng)
    gradient, _ = tangent.gradient_and_stiffness(scene, numbering, pose)
    derived = complex_gradient(tangent.energy, scene, numbering, pose, np.zeros(numbering.size))
    assert np.abs(gradient[6:]).min() > 0
    assert np.abs(gradient - derived).max() < 1e-10 * np.abs(derived).max()


@every
def test_tangent_stiffness_is_that_of_the_energy(kind, seed):
    scene, rng = random_scene(kind, seed)
    numbering, pose = random_pose(scene, rng)
    _, stiffness = tangent.gradient_and_stiffness(scene, numbering, pose)
    derived = hessian(tangent.energy, scene, numbering, pose)
    assert np.array_equal(stiffness, stiffness.T)
    assert np.abs(stiffness - derived).max() < 1e-10 * np.abs(derived).max()


@pytest.mark.parametrize("element", [string, blade, spring], ids=["string", "blade", "spring"])
@pytest.mark.parametrize("seed", range(1))
def test_each_kind_of_element_alone(element, seed):
    """The others are taken out, so that weak elements are not hidden behind stiff ones."""
    scene, rng = random_scene("crooked", seed)
    keep = {
        string: {"springs": _none(scene.springs)},
        blade: {"springs": _none(scene.springs), "wires": _none(scene.wires)},
        spring: {
            "wires": _none(scene.wires),
            "blades": replace(
                scene.blades, stiffness=0 * scene.blades.stiffness, load=0 * scene.blades.load
            ),
        },
    }[element]
    if element is not blade:
        keep["blades"] = replace(
            scene.blades,
            stiffness=0 * scene.blades.stiffness,
            load=0 * scene.blades.load,
            tip_mass=0 * scene.blades.tip_mass,
        )
    alone = replace(scene, gravity=0.0, **keep)
    numbering, pose = random_pose(alone, rng, length=0.01, angle=0.4)
    gradient, stiffness = tangent.gradient_and_stiffness(alone, numbering, pose)
    energy = energy_of(element)
    derived = complex_gradient(energy, alone, numbering, pose, np.zeros(numbering.size))
    assert np.abs(derived).max() > 0
    assert np.abs(gradient - derived).max() < 1e-12 * np.abs(derived).max()
    second = hessian(energy, alone, numbering, pose)
    assert np.abs(second).max() > 0
    assert np.abs(stiffness - second).max() < 1e-10 * np.abs(second).max()


def energy_of(element):
    return partial(tangent.energy, elements=[element.ELEMENT])


def _none(elements):
    """No element of a kind: every array cut to none along the axis of the elements."""
    return replace(elements, **{key: value[:0] for key, value in vars(elements).items()})


@every
def test_moving_everything_as_one_costs_no_elastic_energy(kind, seed):
    scene, rng = random_scene(kind, seed)
    _, pose = random_pose(scene, rng)
    turn, shift = rotation_matrix(rng.normal(size=3)), rng.uniform(-1, 1, 3)
    place = scene.bodies.position + pose.shift
    moved = Pose(
        place @ turn.T + shift - scene.bodies.position,
        turn @ pose.rotation - np.eye(3),
        pose.deflection,
    )
    weights = []
    for element in (string, blade, spring):
        before, after = (energy_of(element)(scene, each) for each in (pose, moved))
        weights.append(before)
        assert after == pytest.approx(before, rel=1e-12, abs=1e-15)
    assert sum(map(abs, weights)) > 1e-3


@every
def test_moving_everything_as_one_leaves_the_forces(kind, seed):
    """They turn with the scene; the rigid motions are in the null space of the elastic stiffness,
    but for turned forces."""
    scene, rng = random_scene(kind, seed)
    weightless = replace(scene, gravity=0.0)
    numbering, pose = random_pose(scene, rng)
    gradient, stiffness = tangent.gradient_and_stiffness(weightless, numbering, pose)
    bodies = len(scene.bodies.name) + 1
    along = np.zeros((numbering.size, 3))
    along[: 6 * bodies] = np.tile(np.vstack([np.eye(3), np.zeros((3, 3))]), (bodies, 1))
    assert np.abs(along.T @ gradient).max() < 1e-12 * np.abs(gradient).max()
    assert np.abs(stiffness @ along).max() < 1e-12 * np.abs(stiffness).max()
    place = scene.bodies.position + pose.shift
    torque = sum(
        np.cross(place[n], gradient[6 * n : 6 * n + 3]) + gradient[6 * n + 3 : 6 * n + 6]
        for n in range(bodies)
    )
    assert np.abs(torque).max() < 1e-12 * np.abs(gradient).max()


@every
def test_mass_matrix_is_that_of_the_kinetic_energy(kind, seed):
    """Every body replaced by six points with the same mass and inertia, every tip by one;
    velocities by complex steps."""
    scene, rng = random_scene(kind, seed)
    numbering, pose = random_pose(scene, rng, angle=0.5)
    rates = displace(numbering, pose, 1e-30j * np.eye(numbering.size))
    derived = np.zeros((numbering.size, numbering.size))

    def add(mass, body, point, deflection=0.0):
        velocity = (
            np.imag(
                rates.shift[:, body]
                + rates.rotation[:, body] @ point
                + (rates.rotation[:, body] @ deflection[..., None])[..., 0]
            )
            / 1e-30
        )
        return mass * velocity @ velocity.T

    for n, (mass, inertia) in enumerate(
        zip(scene.bodies.mass, scene.bodies.inertia, strict=True), 1
    ):
        moments, axes = np.linalg.eigh(inertia)
        # mean of the square of the distance along each principal axis
        squares = (moments.sum() / 2 - moments) / mass
        for axis in range(3):
            for sign in (1, -1):
                derived += add(
                    mass / 6, n, sign * np.sqrt(3 * squares[axis]) * axes[:, axis], np.zeros(3)
                )
    for n in range(len(scene.blades.label)):
        derived += add(
            scene.blades.tip_mass[n],
            scene.blades.body[n],
            scene.blades.tip[n],
            rates.deflection[:, n],
        )
    mass = mass_matrix(scene, numbering, pose)
    root = np.sqrt(np.maximum(np.diag(derived), 1e-3))
    assert np.array_equal(mass, mass.T)
    assert np.abs((mass - derived) / np.outer(root, root)).max() < 1e-12


def test_order_of_wires_is_of_no_account():
    for seed in range(5):
        scene, rng = random_scene("crooked", seed)
        order = rng.permutation(len(scene.wires.label))
        assert not np.array_equal(order, np.arange(len(order)))
        wires = replace(
            scene.wires,
            label=tuple(scene.wires.label[n] for n in order),
            **{key: value[order] for key, value in vars(scene.wires).items() if key != "label"},
        )
        numbering, pose = random_pose(scene, rng)
        one, other = (
            tangent.gradient_and_stiffness(each, numbering, pose)
            for each in (scene, replace(scene, wires=wires))
        )
        for a, b in zip(one, other, strict=True):
            assert np.abs(a - b).max() <= 1e-13 * np.abs(a).max()


def test_swapping_identical_wires():
    """What happened to wire 1 happens to wire 4 instead, seen from behind: the half turn about z
    that takes one to the other."""
    raw = scenes.single(np.random.default_rng(7))
    both = []
    half_turn = np.tile([-1, -1, 1, -1, -1, 1], 2)
    for wire, sign in (("test.1", 1), ("test.4", -1)):
        bent = raw | {
            "perturbation": [
                {
                    "wire": wire,
                    "k_factor": 1.2,
                    "lower_offset": [sign * 1e-3, sign * 2e-3, 1e-3],
                    "hold": "natural-length",
                }
            ]
        }
        scene = expand(scenes.design_of(bent))
        numbering = layout(scene)
        both.append(tangent.gradient_and_stiffness(scene, numbering, nominal_pose(scene)))
    (gradient, stiffness), (other_gradient, other_stiffness) = both
    assert np.abs(gradient).max() > 1e-3
    assert np.abs(gradient - half_turn * other_gradient).max() <= 1e-13 * np.abs(gradient).max()
    assert (
        np.abs(stiffness - np.outer(half_turn, half_turn) * other_stiffness).max()
        <= 1e-13 * np.abs(stiffness).max()
    )
