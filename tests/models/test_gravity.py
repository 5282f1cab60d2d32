"""Gravity as a vector and with a gradient, and wires with weight, against independent results."""

from __future__ import annotations

import math

import numpy as np
import pytest
import tomli_w
from scipy.linalg import eigh
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
                {
                    "upper": upper,
                    "lower": lower,
                    "natural_length": span - mass * G / 4 / k,
                    "k": k,
                }
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


def bob(gradient, **constants):
    """A body on one wire at its COM, with so little inertia that its turning does not matter."""
    body = {"mass": 2.0, "inertia": [1e-3, 2e-3, 3e-3]}
    wires = {"count": 1, "l": 0.7, "k": 1e12, "d": 0.05}
    stage = {"name": "bob", "body": body, "wires": wires}
    return scenes.raw_of(stage, constants={"gravity_gradient": gradient} | constants)


def test_gradient_of_a_pendulum():
    """omega^2 of x from T / l - dg_x/dx with T = m (g + G h): a rod pivoted above its COM."""
    slope = 2e-3
    height = 0.7 + 0.05
    model = modes(bob(slope))
    rows = [model.index("bob", "x"), model.index("bob", "pitch")]
    k, m = (matrix[np.ix_(rows, rows)] for matrix in (model.stiffness, model.mass))
    t, d, l = 2.0 * (G + slope * height), 0.05, 0.7
    moments = np.array([1e-3, 2e-3, 3e-3])
    second = moments.sum() / 2 - moments
    # lower end: x - d pitch ... the tension pulls at l, the body turns in the gradient
    tide = (second[0] - second[2]) * (-slope / 2 - slope)
    expected = np.array(
        [
            [t / l + 2.0 * slope / 2, t * d / l],
            [t * d / l, t * d + t * d**2 / l + tide],
        ]
    )
    assert np.abs(k - expected).max() < 1e-8 * np.abs(expected).max()
    assert m == pytest.approx(np.diag([2.0, 2e-3]))
    sheared = bob([[-slope / 2, 0, 0], [0, -slope / 2, 0], [0, 0, slope]])
    assert modes(sheared).stiffness == pytest.approx(model.stiffness, rel=1e-12, abs=1e-9)


def heavy_chain(count, mass=1e-6, **section):
    """A chain of `count` equal wires, 1 m together, on bodies of next to no mass."""
    wires = {
        "count": 1,
        "l": 1.0 / count,
        "k": 1e7,
        "material": "steel302",
        "radius": 1e-3,
    } | section
    body = {"mass": mass, "inertia": [1e-9] * 3}
    stages = [{"name": f"s{n}", "body": body, "wires": wires} for n in range(count)]
    return scenes.raw_of(*stages, constants={"wire_weight": True, "gravity": G})


def swings(count, mass=1e-6):
    model = modes(heavy_chain(count, mass))
    rows = [model.index(f"s{n}", "x") for n in range(count)]
    k, m = (matrix[np.ix_(rows, rows)] for matrix in (model.stiffness, model.mass))
    return np.sqrt(eigh(k, m, eigvals_only=True)), k, m


def linear_elements(count, mass, line):
    """Linear finite elements of a hanging chain with beads, assembled from their energies."""
    h, k, m = 1.0 / count, np.zeros((count + 1,) * 2), np.zeros((count + 1,) * 2)
    for n in range(count):
        below = (count - n) * mass + (count - n - 0.5) * h * line
        k[n : n + 2, n : n + 2] += G * below / h * np.array([[1, -1], [-1, 1]])
        m[n : n + 2, n : n + 2] += line * h / 6 * np.array([[2, 1], [1, 2]])
        m[n + 1, n + 1] += mass
    return k[1:, 1:], m[1:, 1:]


def test_hanging_chain():
    """J0(2 omega sqrt(l / g)) = 0; the error of linear elements goes with the square of h."""
    line = 7900.0 * math.pi * 1e-6
    design = scenes.design_of(heavy_chain(1))
    assert expand(design).wires.mass[0] == pytest.approx(
        np.array([1 / 3, 1 / 6, 1 / 3]) * line, rel=0.02
    )
    line = float(expand(design).wires.mass[0] @ [1, 2, 1])
    coarse, k, m = swings(8)
    expected = linear_elements(8, 1e-6, line)
    assert np.abs(k - expected[0]).max() < 1e-9 * np.abs(k).max()
    assert np.abs(m - expected[1]).max() < 1e-12 * np.abs(m).max()
    fine = swings(16)[0]
    bessel = jn_zeros(0, 2) / 2 * math.sqrt(G)
    better = fine[:2] + (fine[:2] - coarse[:2]) / 3
    assert fine[:2] == pytest.approx(bessel, rel=0.03)
    assert better == pytest.approx(bessel, rel=2e-3)


def hanging_wire(steps, mass=1e-6):
    raw = heavy_chain(1, mass)
    raw["materials"] = {"thread": {"youngs_modulus": 1.0, "density": 7900.0}}
    wires = raw["stage"][0]["wires"]
    del wires["radius"]
    wires |= {"material": "thread", "sections": [{"radius": [1e-3, 1e-3], "steps": steps}]}
    return raw


def test_hanging_wire_in_sections():
    """The violin model of one wire that carries next to nothing."""
    bessel = jn_zeros(0, 3) / 2 * math.sqrt(G) / (2 * math.pi)
    found = []
    for steps in (20, 40):
        model = modes(hanging_wire(steps), "violin")
        listed = roots.mode_frequencies(model, 2 * math.pi * 3.0, 1e-3) / (2 * math.pi)
        found.append([listed[np.abs(listed - f).argmin()] for f in bessel])
    coarse, fine = np.array(found)
    assert fine == pytest.approx(bessel, rel=2e-2)
    assert (np.abs((fine + (fine - coarse) / 3) / bessel - 1) < [1e-3, 2e-3, 6e-3]).all()


def test_heavy_wire_and_bob():
    """A rigid rod m with a bob M: omega^2 = g (M + m/2) / (l (M + m/3)), in string and beam."""
    raw = heavy_chain(1, mass=0.5)
    raw["stage"][0]["body"]["inertia"] = [1e-12] * 3
    model = modes(raw)
    x = model.index("s0", "x")
    m = float(expand(scenes.design_of(raw)).wires.mass[0] @ [1, 2, 1])
    squared = model.stiffness[x, x] / model.mass[x, x]
    assert squared == pytest.approx(G * (0.5 + m / 2) / (0.5 + m / 3), rel=1e-12)
    light = modes(raw | {"constants": {"gravity": G}})
    assert light.stiffness[x, x] / light.mass[x, x] == pytest.approx(G, rel=1e-12)


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


FIELD = {"gravity": [0.3, -0.2, -9.7], "gravity_gradient": 2e-4, "wire_weight": True}
