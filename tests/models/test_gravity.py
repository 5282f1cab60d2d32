"""Gravity as a vector and with a gradient, and wires with weight, against independent results."""

from __future__ import annotations

import math

import numpy as np
import pytest
import tomli_w
from scipy.special import jn_zeros

import suspension_cli as sus
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.equilibrium.solve import solve
from suspension_cli.linear import roots
from suspension_cli.models import registry
from suspension_cli.rotations import rotation_matrix
from tests.support import plants, scenes

G = 9.81


def modes(raw, model="string"):
    return registry.by_name(model).system(scenes.design_of(raw))


def frequencies(raw, model="string", highest=None):
    design = sus.parse(tomli_w.dumps(scenes.plain(raw)))
    return sus.modes(design, fidelity=model, max_frequency=highest).frequency


def pendulum(**section):
    """A body on four wires of given natural lengths, explicit so that it can be turned."""
    mass, k, height = 5.6, 2.0e4, 0.3
    wires = []
    for x in (0.02, -0.03):
        for y in (0.05, -0.05):
            upper, lower = [0.9 * x, 0.8 * y, 0.0], [x, y, 0.004]
            span = math.dist(upper, [x, y, 0.004 - height])
            wires.append(
                {"upper": upper, "lower": lower, "natural_length": span - mass * G / 4 / k, "k": k}
                | section
            )
    stage = {
        "name": "test",
        "position": [0.0, 0.0, -height],
        "body": {
            "mass": mass,
            "inertia": [[0.03, 0.001, 0.0], [0.001, 0.02, 0.002], [0.0, 0.002, 0.04]],
        },
        "wire": wires,
        "spring": [{"stiffness": np.diag([3.0, 1.0, 2.0, 0.1, 0.2, 0.3]), "at": [0.01, 0.0, 0.02]}],
    }
    return scenes.raw_of(stage)


TURN = rotation_matrix(np.array([0.05, 0.12, 0.02]))


@pytest.mark.parametrize("model", ["string", "beam"])
def test_tilted_gravity_is_a_tilted_support(model):
    section = {"material": "steel302", "radius": 150e-6} if model == "beam" else {}
    level = pendulum(**section)
    tilted = level | {"constants": {"gravity": (TURN.T @ [0.0, 0.0, -G]).tolist()}}
    found, expected = frequencies(tilted, model), frequencies(scenes.turned(level, TURN), model)
    assert found == pytest.approx(expected, rel=1e-9)
    assert np.abs(found / frequencies(level, model) - 1).max() > 1e-4
    pose = solve(expand(scenes.design_of(tilted)))
    other = solve(expand(scenes.design_of(scenes.turned(level, TURN))))
    assert pose.tension == pytest.approx(other.tension, rel=1e-11)
    assert TURN @ pose.pose.shift[1] == pytest.approx(other.pose.shift[1], abs=1e-12)


@pytest.mark.parametrize("model", ["string", "beam", "blade"])
def test_x_and_y_are_alike(model):
    """A quarter turn about the vertical of designs without any symmetry changes no mode."""
    if model == "blade":
        raw, model = plants.raw("five"), "string"
    else:
        raw = pendulum(**({"material": "steel302", "radius": 150e-6} if model == "beam" else {}))
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    found = frequencies(scenes.turned(raw, quarter), model)
    assert found == pytest.approx(frequencies(raw, model), rel=1e-9)


def test_a_number_for_the_gradient_is_that_along_the_vertical():
    """The horizontal ones are minus half of it, as no mass is near (Laplace)."""
    slope = 2e-3
    tensor = [[-slope / 2, 0, 0], [0, -slope / 2, 0], [0, 0, slope]]
    found, expected = (
        modes(pendulum() | {"constants": {"gravity_gradient": gradient}}).stiffness
        for gradient in (slope, tensor)
    )
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-9)


def hanging_wire(steps):
    """One wire of 1 m in sections, with next to nothing at its end."""
    wires = {"count": 1, "l": 1.0, "k": 1e7, "material": "thread"}
    wires["sections"] = [{"radius": [1e-3, 1e-3], "steps": steps}]
    raw = scenes.raw_of(scenes.hung(wires, 1e-6, 1e-9), constants={"wire_weight": True})
    return raw | {"materials": {"thread": {"youngs_modulus": 1.0, "density": 7900.0}}}


def test_hanging_wire_in_sections():
    """J0(2 omega sqrt(l / g)) = 0, in the violin model; the error goes with the square of h."""
    bessel = jn_zeros(0, 3) / 2 * math.sqrt(G) / (2 * math.pi)
    found = []
    for steps in (20, 40):
        model = modes(hanging_wire(steps), "violin")
        listed = roots.mode_frequencies(model, 2 * math.pi * 3.0, 1e-3) / (2 * math.pi)
        found.append([listed[np.abs(listed - f).argmin()] for f in bessel])
    coarse, fine = np.array(found)
    assert fine == pytest.approx(bessel, rel=2e-2)
    assert (np.abs((fine + (fine - coarse) / 3) / bessel - 1) < [1e-3, 2e-3, 6e-3]).all()


def test_support_carries_all():
    """Pulls on the support and on blades add up to the weight of bodies, tips and wires."""
    rng = np.random.default_rng(8)
    raw = scenes.fibred(scenes.bladed_chain(rng, 2, tip_mass=True, lateral=True))
    raw["constants"] = {"wire_weight": True, "gravity": G}
    scene = expand(scenes.design_of(raw))
    found = solve(scene)
    assert found.iterations == 0
    wires, top = scene.wires, scene.wires.upper == 0
    pull = (found.tension * -wires.span[:, 2] / wires.length)[top].sum()
    ends = G * (wires.mass[top, 0] + wires.mass[top, 1]).sum()
    tips = G * scene.blades.tip_mass[scene.blades.body == 0].sum()
    assert wires.mass.sum() > 0
    assert pull + ends + tips == pytest.approx(float(scene.weight), rel=1e-12)
    loads = scene.blades.load[scene.blades.body == 0][:, 2].sum()
    assert loads == pytest.approx(float(scene.weight), rel=1e-12)
