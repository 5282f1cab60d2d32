"""Inverted pendulums and filters against closed forms, and legs that lean against energies."""

from __future__ import annotations

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.conventions import DOFS
from suspension_cli.design import reader
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear.signals import FORCES
from suspension_cli.linear.symmetry import find_symmetry
from suspension_cli.models import registry
from suspension_cli.rotations import rotation_matrix
from suspension_cli.scene.pose import layout
from tests.support import jets

G = 9.81

ALONE = """
[design]
name = "legs"
[[stage]]
name = "ip"
body = {{ mass = 300.0, inertia = [20.0, 20.0, 40.0] }}
[stage.inverted_pendulum]
length = 0.5
count = 3
radius = 0.6
{more}
"""
TOWER = ALONE.format(
    more="""stiffness = 700.0
top_stiffness = 21.0
phase = 0.4
leg_mass = 2.2
[stage.filter]
stiffness = 310.0
lateral_stiffness = 2e6
keystone = { mass = 2.4, inertia = [0.004, 0.005, 0.006] }
[[stage]]
name = "f"
body = { mass = 120.0, inertia = [4.0, 5.0, 6.0] }
wires = { count = 4, l = 1.1, s = 0.03, t1 = 0.04, t2 = 0.04, d = 0.02, k = 4e5 }
"""
)


def alone(**keys):
    lines = "\n".join(f"{key} = {value}" for key, value in keys.items())
    return sus.parse(ALONE.format(more=lines))


def transfer(design, source, target, frequency):
    way = {"inputs": [source], "outputs": [target], "fidelity": "string"}
    return sus.response(design, frequency=np.atleast_1d(frequency), **way).value[:, 0, 0]


PRELOADS = {
    "link": """[[link]]
name = "push"
between = ["{body}", "ground"]
stiffness = [0, 0, 0, 0, 0, 0]
preload = [0.0, 0.0, {force}, 0.0, 0.0, 0.0]
""",
    "spring": """[[stage.spring]]
stiffness = [0, 0, 0, 0, 0, 0]
preload = [0.0, 0.0, {force}, 0.0, 0.0, 0.0]
""",
}


@pytest.mark.parametrize("force", [-981.0, 490.5])
@pytest.mark.parametrize("kind", PRELOADS)
def test_preload_on_legs_is_no_mass(kind, force):
    more = "frequency = 0.1\nleg_mass = 3.0\n" + PRELOADS[kind].format(body="ip", force=force)
    design = sus.parse(ALONE.format(more=more))
    found = sus.modes(design, fidelity="string")
    np.testing.assert_allclose(found.frequency[:2], 0.1, rtol=1e-9)
    (legs,) = sus.check(design).document()["inverted_pendulums"]
    assert legs["frequency_hz"] == pytest.approx(0.1, rel=1e-9)
    assert legs["load_n"] == pytest.approx(300 * G - force, rel=1e-9)
    # ground motion passes by the inertia of the legs, thin rods
    assert legs["saturation"] == pytest.approx(-3 * (3.0 / 6) / (300 + 3 * 3.0 / 3), rel=1e-9)


def test_ground_tilt_moves_the_stage_by_g_over_omega_squared():
    frequency = np.sqrt(G / 69.5) / (2 * np.pi)  # of KAGRA's signal recycling mirror
    design = alone(frequency=frequency)
    # the stage moves rigidly with the ground by its height of 0.5 m besides
    found = transfer(design, "support.pitch", "ip.x", 1e-9)
    np.testing.assert_allclose(found, 69.5 + 0.5, rtol=1e-8)
    np.testing.assert_allclose(transfer(design, "support.roll", "ip.y", 1e-9), -70.0, rtol=1e-8)


def test_thermal_noise_is_that_of_an_oscillator_with_diluted_loss():
    design = alone(frequency=0.06, loss_angle=1e-3)
    frequency = np.array([0.01, 0.06, 0.3, 2.0])
    w, mass = 2 * np.pi * frequency, 300.0
    k = (2 * np.pi * 0.06) ** 2 * mass
    elastic = k + mass * G / 0.5  # the load takes away stiffness without loss
    admittance = 1 / (k + 1j * 1e-3 * elastic - mass * w**2)
    expected = np.sqrt(4 * 1.380649e-23 * 290.0 / w * np.abs(admittance.imag))
    found = sus.thermal(design, outputs=["ip.x"], frequency=frequency, fidelity="beam")
    np.testing.assert_allclose(np.sqrt(found.motions[0].density.sum(0)), expected, rtol=1e-8)


def test_quality_factor_is_that_of_the_loaded_mode():
    found = sus.modes(alone(frequency=0.06, q=20.0), fidelity="string")
    np.testing.assert_allclose(found.q[:2], 20.0, rtol=1e-3)


def solve_tilted(gravity, flexure, top_joint):
    """Shift, compliance and frequencies of legs under tilted gravity, from the energies of angles.

    The angle a of a leg to an axis is that of the cosine c: a^2 = 2 y + y^2 / 3 + ..., y = 1 - c.
    """

    def angle_squared(cosine):
        y = 1 - cosine
        return y * (2 + y * (1 / 3 + y * (4 / 45 + y * (1 / 35 + y * 16 / 1575))))

    inertia, thrust = np.diag([20.0, 20.0, 40.0]), 100 * G
    shift, turned = np.zeros(3), np.eye(3)
    for _ in range(30):
        q = jets.coordinates(6)
        turn = jets.rotation(np.array(q[3:])) @ turned
        move = shift + np.array(q[:3])
        potential = -300 * (np.array(gravity) @ move)
        for n in range(3):
            foot = 0.6 * np.array([np.cos(2 * np.pi * n / 3), np.sin(2 * np.pi * n / 3), 0])
            leg = move + turn @ foot - foot + [0, 0, 0.5]
            size = jets.length(leg)
            stretch, yaw = size - 0.5 - thrust / 1e8, (turn[1, 0] - turn[0, 1]) / 2
            potential = potential + 0.5e8 * (stretch * stretch) + 20.0 * (yaw * yaw)
            potential = potential + flexure / 2 * angle_squared(leg[2] / size)
            potential = potential + top_joint / 2 * angle_squared(turn[:, 2] @ leg / size)
        step = -np.linalg.solve(potential.hessian, potential.gradient)
        shift, turned = shift + step[:3], rotation_matrix(step[3:]) @ turned
    mass = np.zeros((6, 6))
    mass[:3, :3], mass[3:, 3:] = 300 * np.eye(3), turned @ inertia @ turned.T
    compliance = np.linalg.inv(potential.hessian)
    root = np.linalg.cholesky(mass)
    square = 1 / np.linalg.eigvalsh(root.T @ compliance @ root)[::-1]
    return shift, compliance, np.sqrt(square) / (2 * np.pi)


@pytest.mark.parametrize(
    ("flexure", "top_joint", "tilt", "tolerance"),
    [(600.0, 0.0, 2.3e-3, 1e-9), (900.0, 70.0, 2.3e-3, 1e-9), (900.0, 70.0, 0.02, 1e-8)],
)
def test_leaning_legs_are_those_of_energies_of_finite_angles(flexure, top_joint, tilt, tolerance):
    gravity = [0.8 * G * np.sin(tilt), 0.6 * G * np.sin(tilt), -G * np.cos(tilt)]
    keys = {"stiffness": flexure, "top_stiffness": top_joint, "yaw_stiffness": 40.0}
    text = ALONE.format(more="".join(f"{key} = {value}\n" for key, value in keys.items()))
    design = sus.parse(text + f"[constants]\ngravity = {[float(x) for x in gravity]}\n")
    shift, compliance, frequency = solve_tilted(gravity, flexure, top_joint)
    assert np.linalg.norm(shift) > 1e-3
    (body,) = sus.check(design).document()["bodies"]
    np.testing.assert_allclose(body["shift_m"], shift, rtol=tolerance)
    found = sus.modes(design, fidelity="string").frequency
    np.testing.assert_allclose(found, frequency, rtol=tolerance)
    way = {"inputs": [f"ip.{force}" for force in FORCES], "outputs": [f"ip.{dof}" for dof in DOFS]}
    static = sus.response(design, frequency=[1e-9], fidelity="string", **way).value[0]
    size = np.sqrt(np.diag(compliance))
    error = (static.real - compliance) / np.outer(size, size)
    assert np.abs(error).max() < tolerance


def test_legs_stand_on_an_earlier_body_too():
    base = """
[[stage]]
name = "base"
body = { mass = 900.0, inertia = [90.0, 90.0, 90.0] }
position = [0.0, 0.0, 0.2]
[[stage.spring]]
stiffness = [1e9, 1e9, 1e9, 1e9, 1e9, 1e9]
preload = [0.0, 0.0, 11860.29, 0.0, 0.0, 0.0]
[[stage]]"""
    text = ALONE.format(more="stiffness = 600.0\nleg_mass = 3.0").replace("\n[[stage]]", base, 1)
    found = sus.modes(sus.parse(text), fidelity="string")
    alone_ = sus.modes(alone(stiffness=600.0, leg_mass=3.0), fidelity="string")
    np.testing.assert_allclose(found.frequency[:2], alone_.frequency[:2], rtol=1e-5)


# ---------------------------------------------------------------- a filter

FILTER = """
[design]
name = "gas"
[[stage]]
name = "f"
body = {{ mass = 100.0, inertia = [4.0, 4.0, 6.0] }}
wires = {{ count = 4, l = 0.5, s = 0.1, t1 = 0.1, t2 = 0.1, d = 0.1, k = 1e12 }}
[stage.filter]
frequency = 0.3
keystone = {{ mass = 40.0, inertia = [0.5, 0.5, 0.5] }}
{more}
"""


@pytest.mark.parametrize("saturation", [1e-3, -2e-3])
def test_isolation_of_a_filter_saturates(saturation):
    design = sus.parse(FILTER.format(more=f"saturation = {saturation}"))
    f = np.array([0.01, 1.0, 30.0])
    found = transfer(design, "support.z", "f-keystone.z", f)
    expected = (0.3**2 + saturation * f**2) / (0.3**2 - f**2)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_a_filter_away_from_its_load_sags():
    design = sus.parse(FILTER.format(more="load = 400.0"))
    k = (2 * np.pi * 0.3) ** 2 * 400.0 / G
    scene = expand(design.design)
    found = equilibrium.solve(scene, layout(scene))
    np.testing.assert_allclose(found.pose.shift[2, 2], (400.0 - 40.0 * G) / k, rtol=1e-9)


@pytest.mark.parametrize("load", [None, 160.0])
def test_preload_below_a_filter_is_no_mass(load):
    more = "" if load is None else f"load = {load}\n"
    more += f"""[[stage]]
name = "m"
body = {{ mass = 9.0, inertia = [1.0, 1.0, 1.0] }}
wires = {{ count = 4, l = 0.5, s = 0.1, t1 = 0.1, t2 = 0.1, d = 0.1, k = 1e12 }}
{PRELOADS["link"].format(body="m", force=-49.05)}"""
    text = FILTER.format(more=more).replace("mass = 40.0", "mass = 1.0")
    hung, at_load = 10.0, 10.0 if load is None else (load - 49.05) / G
    k = (2 * np.pi * 0.3) ** 2 * at_load
    design = sus.parse(text)
    found = sus.modes(design, fidelity="string").frequency
    expected = np.sqrt(k / hung) / (2 * np.pi)
    assert np.abs(found / expected - 1).min() < 1e-8
    (blades,) = sus.check(design).document()["filters"]
    sag = (hung - at_load) * G / k
    numbers = {"stiffness_n_per_m": k, "carried_n": hung * G + 49.05, "sag_m": sag}
    assert {key: blades[key] for key in numbers} == pytest.approx(numbers, rel=1e-8, abs=1e-12)


# ---------------------------------------------------------------- symmetry, models


def test_symmetry_of_legs_and_filters_is_exact():
    """Three legs with a mirror couple no more directions than four."""
    cases = ((3, 0.0, "xy"), (3, np.pi / 2, "xy"), (3, 0.1, ""), (4, 0.0, "xy"))
    for count, phase, mirrors in cases:
        text = TOWER.replace("count = 3", f"count = {count}")
        scene = expand(reader.parse(text.replace("phase = 0.4", f"phase = {phase}")))
        assert find_symmetry(scene, layout(scene)).mirrors == tuple(mirrors)


def test_chain_models_say_why_they_do_not_fit():
    tower, legs = reader.parse(TOWER), alone(frequency=0.1).design
    assert registry.by_name("force").unsuitable(tower) == "stage ip stands on legs"
    assert registry.by_name("closed-form").unsuitable(legs) == "stage ip stands on legs"
    gas = reader.parse(FILTER.format(more=""))
    assert registry.by_name("force").unsuitable(gas) == "stage f has a filter"


def test_springs_below_legs_have_the_losses_of_their_material():
    """The flexures of legs are springs of the scene, too, before them. Only a loss that depends on
    frequency is looked up by the place among them."""
    wire = 'material = "steel302", radius = 4e-4'
    spring = '[[stage.spring]]\nstiffness = [50.0, 50.0, 0.0, 0.0, 0.0, 0.0]\nmaterial = "lossy"\n'
    table = "table = { frequency = [0.1, 0.5, 5.0], angle = [0.001, 0.01, 0.1] }\n"
    lossy = "[materials.lossy]\nyoungs_modulus = 2e11\ndensity = 7800.0\n[materials.lossy.loss]\n"
    own = TOWER.replace("k = 4e5", wire) + spring

    def noise(text):
        found = sus.thermal(sus.parse(text), outputs=["f.x"], frequency=[0.5], fidelity="beam")
        return found.motions[0].density.sum(0)[0]

    given = own.replace('material = "lossy"', "loss_angle = 0.01")
    assert noise(own + lossy + table) == pytest.approx(noise(given), rel=1e-9)
    assert noise(given) > 1.1 * noise(given.replace("loss_angle = 0.01\n", ""))
