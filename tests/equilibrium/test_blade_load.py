"""Blades in designs whose pose is solved for: their load is given, or follows from where the
suspension hangs and not from how it is drawn."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from tests.support import scenes

G = 9.81
MASS, STIFFNESS, WIRE = (7.0, 5.0), 900.0, 4e4


def built(aside=(0.0, 0.0, 0.0), lengths=(0.0,) * 8, load=None):
    """Two stages, each on four wires of given natural length, two on each of two blades; drawn
    `aside` of where it would hang if all wires were alike."""
    stages = []
    for n, (name, mass, drop) in enumerate(zip(("upper", "test"), MASS, (0.4, 0.6), strict=True)):
        carried = sum(MASS[n:]) * G / 4
        wires = []
        for i, (x, y) in enumerate([(1, 1), (1, -1), (-1, 1), (-1, -1)]):
            upper, lower = np.array([0.03 * x, 0.12 * y, 0.0]), np.array([0.03 * x, 0.1 * y, 0.002])
            loaded = np.linalg.norm(lower - upper - [0, 0, drop])
            tension = carried * loaded / (drop - 0.002)
            natural = loaded - tension / WIRE + lengths[4 * n + i]
            side = "left" if y > 0 else "right"
            wire = {"upper": upper, "lower": lower, "k": WIRE, "blade": side}
            wires.append(wire | {"natural_length": natural})
        given = {} if load is None else {"load": load * 2 * carried}
        blades = [
            {"name": side, "at": [0.0, y, 0.0], "stiffness": STIFFNESS} | given
            for side, y in (("left", 0.12), ("right", -0.12))
        ]
        body = {"mass": mass, "inertia": [0.05 * mass / 5, 0.02, 0.04]}
        position = [aside[0], aside[1] * (1 - 2 * n), -drop + aside[2]]
        stages.append(
            {"name": name, "body": body, "position": position, "wire": wires, "blade": blades}
        )
    return scenes.raw_of(*stages)


UNEQUAL = (1e-4, 1e-3, 0.0, 1.1e-3, -1e-3, 5e-5, -1.1e-3, 0.0)


def places(raw):
    """Where the COMs hang from the suspension point, and the modes."""
    scene = scenes.scene_of(raw)
    found = equilibrium.solve(scene)
    found.demand(scene)
    return (scene.bodies.position + found.pose.shift)[1:], eigenmodes.solve(
        registry.STRING.system(scenes.design_of(raw))
    ).frequency


@pytest.mark.parametrize("lengths", [(0.0,) * 8, UNEQUAL], ids=["equal", "unequal"])
@pytest.mark.parametrize("load", [None, 0.9], ids=["follows", "given"])
@pytest.mark.parametrize("aside", [(-0.02, 0.05, 0.02)])
def test_the_drawing_does_not_matter(aside, load, lengths):
    place, frequency = places(built(lengths=lengths, load=load))
    other_place, other = places(built(aside, lengths, load))
    np.testing.assert_allclose(other_place, place, atol=1e-10)
    np.testing.assert_allclose(other, frequency, rtol=1e-9)


def test_loads_that_follow_carry_the_weight():
    """Equal wires: each of two blades carries half of what hangs on it, and its tip is where it is
    drawn."""
    scene = scenes.scene_of(built((0.05, 0.0, -0.03)))
    found = equilibrium.solve(scene)
    np.testing.assert_allclose(scene.blades.load[:, 2], [6 * G, 6 * G, 2.5 * G, 2.5 * G], rtol=1e-9)
    assert np.abs(found.pose.deflection).max() < 1e-9


@pytest.mark.parametrize("load", [0.7, 1.0, 1.2])
def test_a_set_sags_under_more_than_its_load(load):
    """(W - load) / k of a symmetric set, on the string model, as the force model has no pose to
    solve for."""
    wires = {"count": 4, "l": 0.5, "s": 0.02, "t1": 0.1, "t2": 0.1, "k": 5e4}
    blades = {"count": 2, "stiffness": 1.5e3, "load": load * 4 * G}
    raw = scenes.raw_of(scenes.hung(wires, 8.0, 0.1, blades=blades))
    scene = scenes.scene_of(raw)
    found = equilibrium.solve(scene)
    np.testing.assert_allclose(found.pose.deflection[:, 2], -(1 - load) * 4 * G / 1.5e3, atol=1e-12)
    assert found.pose.shift[1, 2] == pytest.approx(-(1 - load) * 4 * G / 1.5e3, abs=1e-12)
    assert registry.choose(scenes.design_of(raw)).level == "string"


def test_least_energy_of_a_lopsided_pair():
    """One body on two wires of different length, each on a blade of given load: the energy written
    down here has its minimum where the program hangs it."""
    mass, k, blade, load, natural = 6.0, 3e4, 1.2e3, (25.0, 32.0), (0.497, 0.503)
    wires, blades = [], []
    for n, y in enumerate((0.1, -0.1)):
        wire = {"upper": [0, y, 0], "lower": [0, 0.8 * y, 0.01], "blade": f"b{n}"}
        wires.append(wire | {"k": k, "natural_length": natural[n]})
        blades.append({"name": f"b{n}", "at": [0, y, 0], "stiffness": blade, "load": load[n]})
    body = {"mass": mass, "inertia": [0.05, 0.05, 0.05]}
    stage = {"name": "test", "body": body, "position": [0, 0.02, -0.45]}
    stage |= {"wire": wires, "blade": blades}
    scene = scenes.scene_of(scenes.raw_of(stage))
    found = equilibrium.solve(scene)

    def energy(q):
        y, z, roll, *tips = q
        total = mass * G * z
        for n, side in enumerate((0.1, -0.1)):
            arm = np.array([0.8 * side, 0.01])
            turn = np.array([[np.cos(roll), -np.sin(roll)], [np.sin(roll), np.cos(roll)]])
            end = turn @ arm + [y, z]
            stretch = np.hypot(*(end - [side, tips[n]])) - natural[n]
            total += k * stretch**2 / 2 + blade * tips[n] ** 2 / 2 - load[n] * tips[n]
        return total

    best = minimize(energy, [0.0, -0.5, 0.0, 0.0, 0.0], method="BFGS", options={"gtol": 1e-9}).x
    place = (scene.bodies.position + found.pose.shift)[1]
    roll = np.arctan2(found.pose.rotation[1, 2, 1], found.pose.rotation[1, 1, 1])
    np.testing.assert_allclose([*place[1:], roll, *found.pose.deflection[:, 2]], best, atol=2e-6)
