"""Weight of wires, gravity as a vector with a gradient: energies, forces, stiffness, inertia."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from suspension_cli.elements import string, weight
from suspension_cli.equilibrium import energy as tangent
from suspension_cli.models.string import mass_matrix
from suspension_cli.scene.pose import displace, layout, nominal_pose
from suspension_cli.scene.scene import Field
from tests.support import scenes
from tests.support.derivatives import complex_gradient, hessian

POINTS = np.array([0.1, 0.4, 0.8])
"""Places of point masses along each wire, from its upper end."""
KINDS = ["crooked", "blades"]


def loaded(kind, seed):
    """A random scene with a strong gradient, and the point masses of its wires."""
    rng = np.random.default_rng([KINDS.index(kind), seed, 5])
    raw = (
        scenes.crooked(rng)
        if kind == "crooked"
        else scenes.bladed_chain(rng, 2, tip_mass=True, lateral=True)
    )
    scene = scenes.scene_of(raw)
    beads = rng.uniform(0.1, 0.5, (len(scene.wires.label), 3))
    moments = [(1 - POINTS) ** 2, POINTS * (1 - POINTS), POINTS**2]
    mass = np.stack([(beads * share).sum(-1) for share in moments], axis=-1)
    slope = rng.normal(size=(3, 3)) * 0.3
    field = Field(np.array([1.0, -0.6, -9.0]), (slope + slope.T) / 2)
    wires, strength = replace(scene.wires, mass=mass), float(np.linalg.norm(field.vector))
    return replace(scene, gravity=strength, field=field, wires=wires), beads, rng


def random_pose(scene, rng):
    numbering = layout(scene)
    step = scenes.step_of(rng, numbering.name, 0.01, 0.1)
    return numbering, displace(numbering, nominal_pose(scene), step)


def potential(scene, beads, pose):
    """Energy of all masses as points, from their places alone."""
    field, bodies, wires, blades = scene.field, scene.bodies, scene.wires, scene.blades

    def of(mass, r):
        return -mass * (field.vector @ r + r @ field.gradient @ r / 2)

    def place(body, point):
        return bodies.position[body] + pose.shift[body] + pose.rotation[body] @ point

    result = 0.0
    for n, inertia in enumerate(bodies.inertia):
        # a body with these second moments: six points on the principal axes
        square, axes = np.linalg.eigh(np.trace(inertia) / 2 * np.eye(3) - inertia)
        share = bodies.mass[n] / 6
        for value, axis in zip(square, axes.T, strict=True):
            for sign in (1, -1):
                root = np.sqrt(complex(value) / 2 / share)
                assert root.imag == 0
                result += of(share, place(n + 1, sign * root.real * axis))
    for n, mass in enumerate(blades.tip_mass):
        result += of(mass, place(blades.body[n], blades.tip[n] + pose.deflection[n]))
    for n in range(len(wires.label)):
        deflection = pose.deflection[wires.blade[n]] if wires.blade[n] >= 0 else 0.0
        upper = place(wires.upper[n], wires.upper_point[n] + deflection)
        lower = place(wires.lower[n], wires.lower_point[n])
        for s, mass in zip(POINTS, beads[n], strict=True):
            result += of(mass, (1 - s) * upper + s * lower)
    return result


@pytest.mark.parametrize("kind", KINDS)
def test_energy_forces_and_stiffness(kind):
    scene, beads, rng = loaded(kind, 0)
    numbering, pose = random_pose(scene, rng)
    expected = potential(scene, beads, pose) - potential(scene, beads, nominal_pose(scene))
    assert tangent.energy(scene, pose, [weight.ELEMENT]) == pytest.approx(expected, rel=1e-11)
    gradient, stiffness = tangent.gradient_and_stiffness(scene, numbering, pose)
    derived = complex_gradient(tangent.energy, scene, numbering, pose, np.zeros(numbering.size))
    assert np.abs(gradient - derived).max() < 1e-10 * np.abs(derived).max()
    second = hessian(tangent.energy, scene, numbering, pose)
    assert np.abs(stiffness - second).max() < 1e-10 * np.abs(second).max()
    # the weights alone, which stiff wires hide
    bare = replace(scene, wires=replace(scene.wires, mass=0 * scene.wires.mass), field=None)
    first, plain = tangent.gradient_and_stiffness(bare, numbering, pose)
    alone = hessian(
        lambda s, p: tangent.energy(s, p) - tangent.energy(bare, p), scene, numbering, pose
    )
    assert np.abs(alone - (stiffness - plain)).max() < 1e-9 * np.abs(alone).max()
    assert np.abs(gradient - first).max() > 0.1


@pytest.mark.parametrize("kind", KINDS)
def test_kinetic_energy_is_that_of_the_points(kind):
    scene, beads, rng = loaded(kind, 1)
    numbering, pose = random_pose(scene, rng)
    bare = replace(scene, wires=replace(scene.wires, mass=0 * scene.wires.mass))
    extra = mass_matrix(scene, numbering, pose) - mass_matrix(bare, numbering, pose)
    now, wires = string.state(scene, pose), scene.wires
    speed = rng.normal(size=numbering.size)
    rigid = speed[: 6 * len(scene.bodies.position)].reshape(-1, 6)
    v_upper, v_lower = (
        rigid[body, :3] + np.cross(rigid[body, 3:], arm)
        for body, arm in ((wires.upper, now.upper_arm), (wires.lower, now.lower_arm))
    )
    for n in np.flatnonzero(wires.blade >= 0):
        tip = np.append(speed, 0.0)[numbering.blade[wires.blade[n]]]
        v_upper[n] += pose.rotation[wires.upper[n]] @ tip
    expected = sum(
        (beads[:, n] * (((1 - s) * v_upper + s * v_lower) ** 2).sum(-1)).sum() / 2
        for n, s in enumerate(POINTS)
    )
    assert speed @ extra @ speed / 2 == pytest.approx(expected, rel=1e-12)
