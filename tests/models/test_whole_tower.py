"""Legs, filter, link, damper, heavy wires and a tilted field with a gradient, all in one design.

Stiffness, mass and damping are compared with second derivatives of energies written down here.
"""

from __future__ import annotations

import tomllib
from functools import cache

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.design import reader
from suspension_cli.design.paths import value_at
from suspension_cli.elements.known_elements import elements_of
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.energy import gradient_and_stiffness, sum_forms
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.errors import InputError
from suspension_cli.scene.pose import layout, nominal_pose
from suspension_cli.studies import sampling
from tests.support import jets

GRAVITY, SLOPE = np.array([0.02, -0.03, -9.8]), 1e-4
GRADIENT = np.diag([-SLOPE / 2, -SLOPE / 2, SLOPE])
NAMES = ("support", "ip", "ip-keystone", "f", "m")
MASS = {"ip": 310.0, "ip-keystone": 2.4, "f": 20.0, "m": 12.0}
INERTIA = {"ip": (30.0, 28.0, 55.0), "ip-keystone": (4e-3, 5e-3, 6e-3)}
INERTIA |= {"f": (0.4, 0.5, 0.6), "m": (0.1, 0.12, 0.13)}
LEG = {"length": 0.45, "radius": 0.55, "flexure": 700.0, "axial": 3e7, "yaw": 55.0}
LEG |= {"top": 0.06, "joint": 21.0, "phase": 0.4}
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
top = {LEG["top"]}
phase = {LEG["phase"]}
stiffness = {LEG["flexure"]}
top_stiffness = {LEG["joint"]}
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


class Motion:
    """Bodies in any pose as jets, and the mass matrix of what was added to them."""

    def __init__(self):
        q = jets.coordinates(6 * len(NAMES))
        drop = np.array([0.0, 0.0, WIRE["l"] + WIRE["d"]])
        start = {"support": np.zeros(3), "ip": np.array([0.0, 0.0, LEG["length"] - LEG["top"]])}
        start["ip-keystone"] = start["ip"] - [0.0, 0.0, BLADES["depth"]]
        start["f"] = start["ip-keystone"] - drop
        start["m"] = start["f"] - drop
        self.start, self.zero = start, 0.0 * q[0]
        self.at = {n: start[n] + np.array(q[6 * i : 6 * i + 3]) for i, n in enumerate(NAMES)}
        self.angle = {n: np.array(q[6 * i + 3 : 6 * i + 6]) for i, n in enumerate(NAMES)}
        self.turn = {n: jets.rotation(self.angle[n]) for n in NAMES}
        self.mass = np.zeros((len(q), len(q)))

    def place(self, body, point):
        return self.at[body] + self.turn[body] @ np.array(point)

    def add(self, kilograms, point):
        """Energy of a point mass, whose inertia is added to the mass matrix."""
        motion = np.array([axis.gradient for axis in point])
        self.mass += kilograms * motion.T @ motion
        return -kilograms * (GRAVITY @ point + point @ (GRADIENT @ point) * 0.5)

    def strain(self, one, other, point):
        """Displacement and rotation of one body against another at a point of space."""
        apart = self.place(one, point - self.start[one])
        apart = apart - self.place(other, point - self.start[other])
        return [*apart, *(self.angle[one] - self.angle[other])]


STRENGTH = np.linalg.norm(GRAVITY)
WIRE_MASS = DENSITY * np.pi * WIRE["radius"] ** 2 * WIRE["l"]
HUNG = MASS["f"] + MASS["m"] + 8 * WIRE_MASS


def bodies(now):
    """Six points each with the body's mass and moments of inertia."""
    total = now.zero
    for name, kilograms in MASS.items():
        moments = np.array(INERTIA[name])
        for axis, second in enumerate(moments.sum() / 2 - moments):
            for sign in (1, -1):
                arm = sign * np.sqrt(3 * second / kilograms) * np.eye(3)[axis]
                total = total + now.add(kilograms / 6, now.place(name, arm))
    return total


def wires(now):
    total = now.zero
    for upper, lower, load in (("ip-keystone", "f", HUNG - 4 * WIRE_MASS), ("f", "m", MASS["m"])):
        pull = STRENGTH * (load / 4 + WIRE_MASS / 2)
        for n in range(4):
            x, y = (1 - 2 * (n // 2)) * WIRE["s"], (1 - 2 * (n % 2)) * WIRE["t"]
            top, bottom = now.place(upper, (x, y, 0.0)), now.place(lower, (x, y, WIRE["d"]))
            stretch = jets.length(top - bottom) - WIRE["l"] + pull / WIRE["k"]
            total = total + 0.5 * WIRE["k"] * stretch * stretch
            for s in (0.5 - 12**-0.5, 0.5 + 12**-0.5):  # Gauss points
                total = total + now.add(WIRE_MASS / 2, (1 - s) * top + s * bottom)
    return total


def blades(now):
    """Springs of the filter; mass coupling m_c v_1 . v_2 in place of a part of both masses."""
    below = np.array([0.0, 0.0, -BLADES["depth"]])
    apart = now.at["ip-keystone"] - now.place("ip", below)
    strain = now.turn["ip"].T @ apart
    total = -STRENGTH * (MASS["ip-keystone"] + HUNG) * strain[2]
    for k, s in zip((BLADES["lateral"], BLADES["lateral"], BLADES["k"]), strain, strict=True):
        total = total + 0.5 * k * s * s
    for t in now.angle["ip-keystone"] - now.angle["ip"]:
        total = total + 0.5 * BLADES["tilt"] * t * t
    motion = np.array([axis.gradient for axis in apart])
    now.mass -= BLADES["coupling"] * motion.T @ motion
    return total + 0.5 * BLADES["coupling"] * (apart @ (GRADIENT @ apart))


def legs(now):
    """A rod as two points, a counterweight below the foot, flexures at foot and top."""
    total, share = now.zero, LEG["com"] / LEG["length"]
    half = np.sqrt(LEG["inertia"] / LEG["mass"]) / LEG["length"]
    below = LEG["below"] / LEG["length"]
    on_top = share * LEG["mass"] - below * LEG["weight"]
    thrust = STRENGTH * ((MASS["ip"] + MASS["ip-keystone"] + HUNG) / 3 + on_top)
    for n in range(3):
        x, y = (LEG["radius"] * f(LEG["phase"] + 2 * np.pi * n / 3) for f in (np.cos, np.sin))
        foot, top = now.place("support", (x, y, 0.0)), now.place("ip", (x, y, LEG["top"]))
        leg = top - foot
        size = jets.length(leg)
        short = size - LEG["length"] - thrust / LEG["axial"]
        total = total + 0.5 * LEG["axial"] * short * short
        for body, joint in (("support", LEG["flexure"]), ("ip", LEG["joint"])):
            lean = now.turn[body].T @ (leg / size)
            total = total + 0.5 * joint * (lean[0] * lean[0] + lean[1] * lean[1])
        yaw = now.angle["ip"][2] - now.angle["support"][2]
        total = total + 0.5 * LEG["yaw"] * yaw * yaw
        for sign in (1, -1):
            total = total + now.add(LEG["mass"] / 2, foot + (share + sign * half) * leg)
        total = total + now.add(LEG["weight"], foot - below * leg)
    return total


@cache
def assembly():
    """Potential energy as a jet, mass matrix and damping matrix, from the geometry alone."""
    now = Motion()
    potential = bodies(now) + wires(now) + blades(now) + legs(now)
    # the ground moves with the support here
    for k, s in zip(LINK, now.strain("m", "support", now.start["m"] + LINK_AT), strict=True):
        potential = potential + 0.5 * k * s * s
    strain = now.strain("f", "ip", now.start["f"] + DAMPER_AT)
    damping = sum(c * np.outer(s.gradient, s.gradient) for c, s in zip(DAMPER, strain, strict=True))
    return potential, now.mass, damping


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
    for name, expected in (("add_mass", mass), ("add_damping", damping)):
        parts = [getattr(item, name) for item in elements_of(scene)]
        assert_close(sum_forms(scene, numbering, pose, parts), expected)
    # the field acts: sideways on everything, and a gradient on stiffness
    assert abs(gradient[6] + GRAVITY[0] * mass[6, 6]) < 0.05 * abs(gradient[6])


# ---------------------------------------------------------------- imperfections

CHANGES = {
    "leg": (
        [f"stage.ip.inverted_pendulum.{part}stiffness" for part in ("", "top_", "yaw_")],
        ("ip.leg1", "ip.leg2", "ip.leg3"),
    ),
    "blade": ([f"stage.ip.filter.{part}stiffness" for part in ("", "lateral_", "tilt_")], ("ip",)),
    "link": ([f"link.heat.stiffness.{n}" for n in range(1, 7)], ("heat",)),
}


@pytest.mark.parametrize("part", CHANGES)
def test_stiffness_factor_is_that_of_the_design(part):
    keys, names = CHANGES[part]
    lines = [f'[[perturbation]]\n{part} = "{name}"\nstiffness_factor = 1.03\n' for name in names]
    perturbed = expand(reader.parse(DESIGN + "".join(lines)))
    raw = tomllib.loads(DESIGN)
    changes = [f"{key}={1.03 * value_at(raw, key)!r}" for key in keys]
    changed = expand(reader.parse_with_overrides(DESIGN, changes))
    pose = nominal_pose(perturbed)
    found, expected = (
        gradient_and_stiffness(scene, layout(scene), pose)[1] for scene in (perturbed, changed)
    )
    plain = gradient_and_stiffness(expand(reader.parse(DESIGN)), layout(perturbed), pose)[1]
    assert np.abs(found - expected).max() < 1e-9 * np.abs(found - plain).max()


def test_longer_legs_lift_the_platform():
    level = DESIGN.replace(f"gravity = {GRAVITY.tolist()}", "gravity = 9.8")
    lines = [f'[[perturbation]]\nleg = "ip.leg{n}"\nlength_change = 1e-4\n' for n in (1, 2, 3)]
    before, after = (
        equilibrium.solve(expand(reader.parse(text))) for text in (level, level + "".join(lines))
    )
    lifted = after.pose.shift[1, 2] - before.pose.shift[1, 2]
    np.testing.assert_allclose(lifted, 1e-4, rtol=1e-6)


def test_random_builds_scatter_them():
    text = """
[[tolerance.leg]]
stage = "ip"
stiffness = { normal = 0.001 }
length = { normal = 1e-5 }
[[tolerance.blade]]
stage = "ip"
stiffness = { normal = 0.02 }
[[tolerance.link]]
link = "heat"
stiffness = { uniform = 0.5 }
"""
    design = reader.parse(DESIGN + text)
    scene = expand(design)
    chosen = sampling.factors(design, scene)
    assert [one.label for one in chosen] == [
        "ip blades stiffness",
        *(f"ip.leg{n} {key}" for n in (1, 2, 3) for key in ("stiffness", "length")),
        "heat stiffness",
    ]
    built = sampling.imperfect(scene, chosen, np.array([[0.1, 0, 0, 0, 0, 0, 0, 1.0]] * 2))
    ratio = built.springs.stiffness[:, :, 0, 0] / scene.springs.stiffness[:, 0, 0]
    np.testing.assert_allclose(ratio[0][np.isfinite(ratio[0])], [1.0, 1.0, 1.0, 1.1, 2.0])


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ('perturbation]]\nleg = "ip.leg4"\nstiffness_factor = 2.0', "names no leg"),
        ('perturbation]]\nlink = "heat"\nlength_change = 2.0', "is not for a link"),
        (
            'perturbation]]\nlink = "heat"\nleg = "ip.leg1"',
            "leg and link are both given; give exactly one: wire or body",
        ),
        ('tolerance.leg]]\nstage = "f"\nlength = { normal = 1e-5 }', "names no stage with legs"),
        ('tolerance.blade]]\nstage = "f"\nstiffness = { normal = 1e-5 }', "stage with blades"),
        ('tolerance.link]]\nlink = "het"\nstiffness = { normal = 1e-5 }', "did you mean 'heat'"),
    ],
)
def test_wrong_names_are_reported(table, message):
    with pytest.raises(InputError, match=message):
        reader.parse(f"{DESIGN}[[{table}\n")


def test_motion_of_the_ground_moves_the_payload_through_the_link():
    """Below all modes; also beside a given model, whose error is then estimated."""
    text = DESIGN.replace(str(GRAVITY.tolist()), "9.8").replace(f"{SLOPE}", "0.0", 1)
    design = sus.parse(text)
    signals = {"outputs": ["m.x"], "frequency": [1e-5]}
    ground = sus.response(design, inputs=["ground.x"], fidelity="string", **signals).value
    support = sus.response(design, inputs=["support.x"], fidelity="string", **signals).value
    np.testing.assert_allclose(ground + support, 1.0, rtol=1e-6)
    assert 1e-4 < abs(ground.item()) < 0.1


# ---------------------------------------------------------------- losses of links


STRANDS = """[link.strands]
to = [0.3, 0.1, -1.9]
material = "cold"
diameter = 1e-3
shape = "u"
length = 1.5
[materials.cold]
youngs_modulus = 7e10
density = 2700.0
thermal_expansion = 2e-5
specific_heat = 900.0
thermal_conductivity = 100.0
[materials.cold.loss]
table = { frequency = [0.1, 10.0], angle = [1e-3, 1e-2] }
surface_depth = 1e-4
"""


def test_links_of_wires_have_the_losses_of_their_material():
    text = DESIGN.replace(f"stiffness = {list(LINK)}", STRANDS).replace('"ground"', '"support"')
    design = sus.parse(text.replace(str(GRAVITY.tolist()), "9.8"))
    omega, diameter = 2 * np.pi * 1.0, 1e-3
    bulk = float(np.sqrt(1e-3 * 1e-2) * (1 + 1e-4 * 4 / (diameter / 2)))
    capacity = 2700.0 * 900.0
    tau = capacity * diameter**2 / (13.57 * 100.0)  # Zener's, of a round wire
    heat = 7e10 * (2e-5) ** 2 * 290.0 / capacity * omega * tau / (1 + (omega * tau) ** 2)

    def noise(changes):
        way = {"outputs": ["m.x"], "frequency": [1.0], "fidelity": "beam"}
        found = sus.thermal(design.replace(changes), **way).motions[0]
        return found.density.sum(0)[0]

    constant = noise({"link.heat.loss_angle": bulk})
    plain = noise({"materials.cold.loss.thermoelastic": False})
    # other parts dissipate in both
    other = noise({"link.heat.loss_angle": 0.0})
    np.testing.assert_allclose(plain, constant, rtol=1e-9)
    np.testing.assert_allclose((noise({}) - plain) / (plain - other), heat / bulk, rtol=0.03)
