"""Legs, filter, link, damper, heavy wires and a tilted field with a gradient, all in one design.

Stiffness, mass and damping are compared with second derivatives of energies written down here.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from suspension_cli.design import reader
from suspension_cli.elements import weight
from suspension_cli.equilibrium import compiled
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.energy import energy, gradient_and_stiffness
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.models import string
from suspension_cli.scene import imperfections, stack
from suspension_cli.scene.pose import Pose, displace, layout, nominal_pose
from tests.support import jets
from tests.support.derivatives import complex_gradient

GRAVITY, SLOPE = np.array([0.02, -0.03, -9.8]), 1e-4
GRADIENT = np.diag([-SLOPE / 2, -SLOPE / 2, SLOPE])
NAMES = ("support", "ip", "ip-keystone", "f", "m")
MASS = {"ip": 310.0, "ip-keystone": 2.4, "f": 20.0, "m": 12.0}
INERTIA = {"ip": (30.0, 28.0, 55.0), "ip-keystone": (4e-3, 5e-3, 6e-3)}
INERTIA |= {"f": (0.4, 0.5, 0.6), "m": (0.1, 0.12, 0.13)}
LEG = {"length": 0.45, "radius": 0.55, "flexure": 240.0, "axial": 3e7, "yaw": 55.0}
LEG |= {"mass": 2.2, "com": 0.25, "inertia": 0.05, "weight": 1.3, "below": 0.15}
BLADES = {"k": 110.0, "lateral": 2e5, "tilt": 4e3, "coupling": 0.35, "depth": 0.08}
WIRE = {"l": 1.1, "s": 0.03, "t": 0.04, "d": 0.02, "k": 4e4, "radius": 1e-3}
LINK_AT, LINK = (0.1, -0.2, 0.05), (5.0, 3.0, 2.0, 0.3, 0.2, 0.1)
DAMPER_AT, DAMPER = (-0.1, 0.05, 0.2), (7.0, 8.0, 9.0, 0.4, 0.5, 0.6)
DENSITY = 7900.0

WIRES = f"""wires = {{ count = 4, l = {WIRE["l"]}, s = {WIRE["s"]}, t1 = {WIRE["t"]}, \
t2 = {WIRE["t"]}, d = {WIRE["d"]}, k = {WIRE["k"]}, material = "steel302", \
radius = {WIRE["radius"]} }}"""
DESIGN = f"""
[design]
name = "whole-tower"
[constants]
gravity = {GRAVITY.tolist()}
gravity_gradient = {SLOPE}
wire_weight = true
[materials.steel302]
density = {DENSITY}
[[stage]]
name = "ip"
body = {{ mass = {MASS["ip"]}, inertia = {list(INERTIA["ip"])} }}
[stage.inverted_pendulum]
length = {LEG["length"]}
count = 3
radius = {LEG["radius"]}
stiffness = {LEG["flexure"]}
yaw_stiffness = {LEG["yaw"]}
axial_stiffness = {LEG["axial"]}
leg_mass = {LEG["mass"]}
leg_com = {LEG["com"]}
leg_inertia = {LEG["inertia"]}
counterweight = {{ mass = {LEG["weight"]}, below = {LEG["below"]} }}
[stage.filter]
at = [0.0, 0.0, {-BLADES["depth"]}]
stiffness = {BLADES["k"]}
lateral_stiffness = {BLADES["lateral"]}
tilt_stiffness = {BLADES["tilt"]}
mass_coupling = {BLADES["coupling"]}
keystone = {{ mass = {MASS["ip-keystone"]}, inertia = {list(INERTIA["ip-keystone"])} }}
[[stage]]
name = "f"
body = {{ mass = {MASS["f"]}, inertia = {list(INERTIA["f"])} }}
{WIRES}
[[stage]]
name = "m"
body = {{ mass = {MASS["m"]}, inertia = {list(INERTIA["m"])} }}
{WIRES}
[[link]]
name = "heat"
between = ["m", "ground"]
at = {list(LINK_AT)}
stiffness = {list(LINK)}
[[damper]]
name = "brake"
between = ["f", "ip"]
at = {list(DAMPER_AT)}
damping = {list(DAMPER)}
"""


@cache
def assembly():
    """Potential energy as a jet, mass matrix and damping matrix, from the geometry alone."""
    q = jets.coordinates(6 * len(NAMES))
    drop = np.array([0.0, 0.0, WIRE["l"] + WIRE["d"]])
    start = {"support": np.zeros(3), "ip": np.array([0.0, 0.0, LEG["length"]])}
    start["ip-keystone"] = start["ip"] - [0.0, 0.0, BLADES["depth"]]
    start["f"] = start["ip-keystone"] - drop
    start["m"] = start["f"] - drop
    at = {n: start[n] + np.array(q[6 * i : 6 * i + 3]) for i, n in enumerate(NAMES)}
    angle = {n: np.array(q[6 * i + 3 : 6 * i + 6]) for i, n in enumerate(NAMES)}
    turn = {n: jets.rotation(angle[n]) for n in NAMES}
    mass, damping = np.zeros((len(q), len(q))), np.zeros((len(q), len(q)))

    def place(body, point):
        return at[body] + turn[body] @ np.array(point)

    def motions(point):
        return np.array([axis.gradient for axis in point])

    def add(kilograms, point):
        """Energy of a point mass, whose inertia is added to the mass matrix."""
        mass[:] += kilograms * motions(point).T @ motions(point)
        return -kilograms * (GRAVITY @ point + point @ (GRADIENT @ point) * 0.5)

    potential = 0.0 * q[0]
    for name, kilograms in MASS.items():
        # six points with the body's mass and moments of inertia
        moments = np.array(INERTIA[name])
        for axis, second in enumerate(moments.sum() / 2 - moments):
            for sign in (1, -1):
                arm = sign * np.sqrt(3 * second / kilograms) * np.eye(3)[axis]
                potential = potential + add(kilograms / 6, place(name, arm))
    strength = np.linalg.norm(GRAVITY)
    wire = DENSITY * np.pi * WIRE["radius"] ** 2 * WIRE["l"]
    load = {"m": MASS["m"], "f": MASS["f"] + MASS["m"] + 4 * wire}
    hung = load["f"] + 4 * wire
    for upper, lower, depth in (("ip-keystone", "f", 0.0), ("f", "m", 0.0)):
        pull = strength * (load[lower] / 4 + wire / 2)
        for i in (1, -1):
            for j in (1, -1):
                x, y = i * WIRE["s"], j * WIRE["t"]
                top, bottom = place(upper, (x, y, depth)), place(lower, (x, y, WIRE["d"]))
                stretch = jets.length(top - bottom) - WIRE["l"] + pull / WIRE["k"]
                potential = potential + 0.5 * WIRE["k"] * stretch * stretch
                for s in (0.5 - 12**-0.5, 0.5 + 12**-0.5):  # Gauss points
                    potential = potential + add(wire / 2, (1 - s) * top + s * bottom)
    # blades: mass coupling m_c v_1 . v_2 in place of a part of both masses
    carried = strength * (MASS["ip-keystone"] + hung)
    ends = place("ip", (0.0, 0.0, -BLADES["depth"])), at["ip-keystone"]
    strain = turn["ip"].T @ (ends[1] - ends[0])
    potential = potential - carried * strain[2]
    for k, s in zip((BLADES["lateral"], BLADES["lateral"], BLADES["k"]), strain, strict=True):
        potential = potential + 0.5 * k * s * s
    for t in angle["ip-keystone"] - angle["ip"]:
        potential = potential + 0.5 * BLADES["tilt"] * t * t
    apart = motions(ends[1] - ends[0])
    mass -= BLADES["coupling"] * apart.T @ apart
    tide = (ends[1] - ends[0]) @ (GRADIENT @ (ends[1] - ends[0]))
    potential = potential + 0.5 * BLADES["coupling"] * tide
    # legs: a rod as two points, a counterweight below the foot
    share = LEG["com"] / LEG["length"]
    half = np.sqrt(LEG["inertia"] / LEG["mass"]) / LEG["length"]
    below = LEG["below"] / LEG["length"]
    on_top = share * LEG["mass"] - below * LEG["weight"]
    thrust = strength * ((MASS["ip"] + MASS["ip-keystone"] + hung) / 3 + on_top)
    for n in range(3):
        x, y = (LEG["radius"] * f(2 * np.pi * n / 3) for f in (np.cos, np.sin))
        foot, top = place("support", (x, y, 0.0)), place("ip", (x, y, 0.0))
        leg = top - foot
        size = jets.length(leg)
        short = size - LEG["length"] - thrust / LEG["axial"]
        potential = potential + 0.5 * LEG["axial"] * short * short
        lean = turn["support"].T @ (leg / size)
        potential = potential + 0.5 * LEG["flexure"] * (lean[0] * lean[0] + lean[1] * lean[1])
        yaw = angle["ip"][2] - angle["support"][2]
        potential = potential + 0.5 * LEG["yaw"] * yaw * yaw
        for sign in (1, -1):
            potential = potential + add(LEG["mass"] / 2, foot + (share + sign * half) * leg)
        potential = potential + add(LEG["weight"], foot - below * leg)
    # link to the ground (here moving with the support); damper between filter and platform
    point = start["m"] + LINK_AT
    strain = [*(place("m", LINK_AT) - place("support", point))]
    for k, s in zip(LINK, [*strain, *(angle["m"] - angle["support"])], strict=True):
        potential = potential + 0.5 * k * s * s
    point = start["f"] + DAMPER_AT
    strain = [*(place("f", DAMPER_AT) - place("ip", point - start["ip"]))]
    for c, s in zip(DAMPER, [*strain, *(angle["f"] - angle["ip"])], strict=True):
        damping += c * np.outer(s.gradient, s.gradient)
    return potential, mass, damping


def assert_close(found, expected, tolerance=1e-11):
    size = np.sqrt(np.abs(np.diag(expected))) + 1e-3
    assert np.abs((found - expected) / np.outer(size, size)).max() < tolerance


def test_matrices_are_the_second_derivatives_of_the_energies():
    potential, mass, damping = assembly()
    scene = expand(reader.parse(DESIGN))
    numbering, pose = layout(scene), nominal_pose(scene)
    gradient, stiffness = gradient_and_stiffness(scene, numbering, pose)
    np.testing.assert_allclose(gradient, potential.gradient, atol=1e-8)
    assert_close(stiffness, potential.hessian)
    assert_close(string.mass_matrix(scene, numbering, pose), mass)
    # the field acts: sideways on everything, and a gradient on stiffness
    assert abs(gradient[6] + GRAVITY[0] * mass[6, 6]) < 0.05 * abs(gradient[6])


@pytest.mark.parametrize("coupling", [0.35, 0.0])
def test_weight_of_legs_and_blades_follows_from_the_energy_in_any_pose(coupling):
    text = DESIGN.replace(f"mass_coupling = {BLADES['coupling']}", f"mass_coupling = {coupling}")
    scene, rng = expand(reader.parse(text)), np.random.default_rng(2)
    numbering = layout(scene)
    pose = displace(numbering, nominal_pose(scene), 1e-2 * rng.normal(size=numbering.size))
    gradient, stiffness = gradient_and_stiffness(scene, numbering, pose)
    derived = complex_gradient(energy, scene, numbering, pose, np.zeros(numbering.size))
    np.testing.assert_allclose(gradient, derived, rtol=1e-9, atol=1e-9 * np.abs(derived).max())
    pair = stack.stack_scenes([scene, scene])
    poses = Pose(*(np.stack([part] * 2) for part in (pose.shift, pose.turn, pose.deflection)))
    soft, form = compiled.tangent(pair, numbering, poses)[:2]
    whole = soft[0] + np.einsum("w,wi,wj->ij", scene.wires.stiffness, form[0], form[0])
    assert_close(whole, stiffness, 1e-12)


def test_imperfect_builds_in_a_batch_are_those_solved_alone():
    scene = expand(reader.parse(DESIGN))
    numbering = layout(scene)
    assert weight.acts(scene)
    built = [
        imperfections.impose(scene, "body", 4, {"com_offset": np.array([x, 2e-4, 0.0])})
        for x in (0.0, 1e-3)
    ]
    batch = equilibrium.solve(stack.stack_scenes(built), numbering)
    assert batch.converged.all()
    for n, one in enumerate(built):
        alone = equilibrium.solve(one, numbering)
        np.testing.assert_allclose(batch.pose.shift[n], alone.pose.shift, atol=1e-11)
