"""Light between two mirrors: closed forms of its stiffness, modes, responses and noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.constants import c, k
from scipy.spatial.transform import Rotation

import suspension_cli as sus
from suspension_cli.design import reader
from suspension_cli.drawing.geometry import sketch_at_rest
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.models import registry

MASSES, INERTIA, TORSION, PENDULUM = (40.0, 25.0), 0.75, 30.0, 3.0  # kg, kg m^2, N m/rad, rad/s
MIRROR = """
[[stage]]
name = "{name}"
hangs_from = "support"
position = [{x}, 0.0, -0.5]
body = {{ mass = {mass}, inertia = [1.0, {inertia}, {inertia}] }}
[[stage.spring]]
stiffness = [{spring}, {spring}, 3.7e4, 100.0, {torsion}, {torsion}]
preload = [0.0, 0.0, {weight}, 0.0, 0.0, 0.0]
loss_angle = {loss}
"""
CAVITY = """
[[cavity]]
name = "arm"
between = ["itm", "etm"]
length = {length}
radii = {radii}
power = {power}
"""
ARM, RADII = 3994.5, (1934.0, 2245.0)
MU = MASSES[0] * MASSES[1] / sum(MASSES)


def two_mirrors(power=1e5, radii=RADII, loss=0.0, more="", cavity=CAVITY):
    """Two mirrors on springs whose motions along the arm have the frequency `PENDULUM`."""
    text = '[design]\nname = "two"\n'
    for name, x, mass in zip(("itm", "etm"), (0.0, 1.0), MASSES, strict=True):
        own = {"inertia": INERTIA, "torsion": TORSION, "weight": 9.81 * mass, "loss": loss}
        text += MIRROR.format(name=name, x=x, mass=mass, spring=mass * PENDULUM**2, **own)
    return text + cavity.format(length=ARM, radii=list(radii), power=power) + more


def detuned(detuning, pole=42.0, power=1e5, **options):
    """With an optical spring: its stiffness at rest, pole and detuning (rad/s), and the design."""
    gamma, delta = 2 * np.pi * pole, 2 * np.pi * detuning
    spring = 8 * np.pi * power * delta / (1064e-9 * ARM * (gamma**2 + delta**2))
    more = f"pole = {pole}\ndetuning = {detuning}\n"
    return spring, gamma, delta, sus.parse(two_mirrors(power, more=more, **options))


def along(modes):
    """Number of the mode in which the arm changes its length."""
    apart = [
        abs(squared / PENDULUM**2 - 1) if home[1] == "x" else -1
        for home, squared in zip(modes.home, modes.omega_squared, strict=True)
    ]
    return int(np.argmax(apart))


@pytest.mark.parametrize("radii", [RADII, (1e4, 5e4)])
def test_stiffness_is_the_curvature_of_the_energy_of_the_pressure(radii):
    """-F l with finite motions, l the path between spheres along the line through their centres."""
    system = registry.STRING.system
    lit, dark = (system(reader.parse(two_mirrors(p, radii))).stiffness for p in (1e5, 0.0))
    steps = np.diag(np.tile([0.1] * 3 + [1e-4] * 3, 2))

    def energy(q):
        first, second = q[:6], q[6:]
        turned = [Rotation.from_rotvec(one[3:]).apply([1, 0, 0]) for one in (first, second)]
        centre = first[:3] + radii[0] * turned[0]
        other = second[:3] + np.array([ARM, 0, 0]) - radii[1] * turned[1]
        return 2e5 / c * np.linalg.norm(other - centre)

    curved = np.zeros((12, 12))
    for i, j in np.ndindex(12, 12):
        corners = ((a, b, energy(a * steps[i] + b * steps[j])) for a in (1, -1) for b in (1, -1))
        curved[i, j] = sum(a * b * value for a, b, value in corners) / 4
    own = steps @ (lit - dark)[6:, 6:] @ steps
    assert np.abs(own - curved).max() < 1e-4 * np.abs(curved).max()


def test_critical_power():
    """The soft mode of a symmetric cavity with g < 0 has the stiffness -F L / (1 + |g|)."""
    g = -0.9
    critical = TORSION * (1 - g) * c / (2 * ARM)
    radii = (ARM / (1 - g),) * 2
    for factor, stable in ((1 - 1e-5, True), (1 + 1e-5, False)):
        assert sus.modes(sus.parse(two_mirrors(factor * critical, radii))).stable == stable
    design = sus.parse(two_mirrors(0.0, radii))
    grid = critical * np.array([0.0, 0.5, 0.9, 1.1])
    swept = sus.sweep(design, vary={"cavity.arm.power": grid}, results=["itm yaw"])
    expected = np.sqrt(TORSION * (1 - grid[:3] / critical) / INERTIA) / (2 * np.pi)
    np.testing.assert_allclose(swept.value[:3, 0], expected, rtol=1e-6)
    assert np.isnan(swept.value[3, 0]) and swept.status.tolist() == [0, 0, 0, 3]
    with pytest.raises(sus.InputError, match="power: the pressure of the light makes"):
        sus.response(design.replace({"cavity.arm.power": grid[3]}), frequency=[1.0])


@pytest.mark.parametrize(
    ("detuning", "pole", "power"),
    [
        (10.0, 42.0, 1e5),  # a strong spring, beyond the pole: it grows
        (-3e-4, 42.0, 1e5),  # a weak antispring: it damps
        (0.3, 42.0, 1e3),
        (30.0, 1e-3, 20.0),  # light that is stored longer than a period has inertia
        (-30.0, 1e-3, 2.0),
    ],
)
def test_poles_with_the_delay_of_the_cavity(detuning, pole, power):
    """Roots of mu (s^2 + w^2) + K(s)."""
    spring, gamma, delta, design = detuned(detuning, pole, power)
    light = np.array([1, 2 * gamma, gamma**2 + delta**2])
    whole = MU * np.convolve([1, 0, PENDULUM**2], light)
    whole[-1] += spring * light[-1]
    roots = np.roots(whole)
    roots = roots[roots.imag > 0]
    found = sus.modes(design, fidelity="string")
    number = along(found)
    expected = roots[np.abs(np.abs(roots) - np.sqrt(found.omega_squared[number])).argmin()]
    assert found.omega_squared[number] == pytest.approx(abs(expected) ** 2, rel=1e-9)
    assert found.decay_rate[number] == pytest.approx(-expected.real, rel=1e-6)
    assert found.stable == (expected.real < 0) == (detuning < 0)


@pytest.mark.parametrize("detuning", [2.0, -2e-4])
def test_response_and_state_space(detuning):
    """Both have the stiffness K(i omega) between the mirrors, in all models and exports."""
    spring, gamma, delta, design = detuned(detuning, power=2e4)
    frequency = np.array([0.01, 0.1, 1.3, 40.0, 300.0])
    s = 2j * np.pi * frequency
    whole = spring * (gamma**2 + delta**2) / ((s + gamma) ** 2 + delta**2)
    expected = 1 / (MU * (s**2 + PENDULUM**2) + whole)
    asked = {"inputs": "etm~itm.force_x", "outputs": "etm~itm.x", "allow_unstable": True}
    for level in ("string", "violin"):
        found = sus.response(design, frequency=frequency, fidelity=level, **asked)
        np.testing.assert_allclose(found.value[:, 0, 0], expected, rtol=1e-11)
    exported = sus.export(design, **asked).system
    assert exported.state[-2:] == ("light-1.arm momentum", "light-2.arm momentum")
    np.testing.assert_allclose(exported.at(frequency)[:, 0, 0], expected, rtol=1e-9)
    lossy = sus.export(design.replace({"stage.itm.spring.1.loss_angle": 1e-4}), loss=True, **asked)
    np.testing.assert_allclose(lossy.system.at(frequency)[:, 0, 0], expected, rtol=1e-3)


def test_poles_of_a_loop_that_holds_the_arm():
    """A loop that damps the anti-damped optical spring: roots of one polynomial."""
    loop = """
[[control.loop]]
name = "arm-length"
sensor = "etm~itm.x"
actuator = "etm~itm.force_x"
damper = 3e4
"""
    spring, gamma, delta, design = detuned(2.0, power=2e4)
    light = np.array([1, 2 * gamma, gamma**2 + delta**2])
    whole = np.convolve([MU, 3e4, MU * PENDULUM**2], light)
    whole[-1] += spring * light[-1]
    held = sus.parse(design.text + loop)
    found = sus.damp(held, allow_unstable=True)
    poles = found.closed.value
    for root in np.roots(whole):
        assert np.abs(poles - (root if root.imag >= 0 else root.conj())).min() < 1e-8 * abs(root)
    assert found.closed.stable
    with pytest.raises(sus.InputError, match="detuning: an active element"):
        sus.response(held, frequency=[1.0])


def test_cavities_add_up():
    """Two of half the power are one."""
    *_, one = detuned(2.0, power=2e4)
    half = one.replace({"cavity.arm.power": 1e4}).text
    both = half + half[half.index("[[cavity]]") :].replace('"arm"', '"other"')
    asked = {"inputs": "etm.force_x", "outputs": ["itm.x"], "allow_unstable": True}
    found = [sus.response(d, frequency=[0.3, 40.0], **asked).value for d in (one, sus.parse(both))]
    np.testing.assert_allclose(*found, rtol=1e-12)
    assert len(sus.export(sus.parse(both), **asked).system.a) == 8  # each has two states


def test_light_has_no_thermal_noise():
    """S = 4 k T k'' / omega |chi|^2 of the springs alone, with the light in chi."""
    spring, gamma, delta, design = detuned(-2e-4, power=2e4, loss=1e-3)
    frequency = np.array([0.3, 1.3, 40.0])
    s = 2j * np.pi * frequency
    whole = spring * (gamma**2 + delta**2) / ((s + gamma) ** 2 + delta**2)
    elastic = MU * PENDULUM**2
    chi = 1 / (MU * s**2 + elastic * (1 + 1e-3j) + whole)
    expected = 4 * k * 290 * elastic * 1e-3 / np.abs(s) * np.abs(chi) ** 2
    found = sus.thermal(design, outputs="etm~itm.x", frequency=frequency)
    np.testing.assert_allclose(found.amplitude[:, 0] ** 2, expected, rtol=1e-9)
    assert set(found.source) == {"itm.springs", "etm.springs"}


def test_one_mirror_at_rest():
    """The other end on the support, and derivatives by sensitivity."""
    spring, *_, design = detuned(2e-4, power=2e4)
    held = design.replace({"cavity.arm.between": ["etm", "support"]})
    found = sus.modes(held, fidelity="string")
    squared = PENDULUM**2 + spring / MASSES[1]
    number = along(found)
    assert found.omega_squared[number] == pytest.approx(squared, rel=1e-4)
    response = sus.response(
        held, inputs="support.x", outputs="etm.x", frequency=[1e-9], allow_unstable=True
    )
    assert response.value[0] == pytest.approx(1.0, rel=1e-9)
    slope = sus.sensitivity(design, results=["etm yaw"], fidelity="string", allow_unstable=True)
    power = 2e4
    g, h = (1 - ARM / radius for radius in RADII)
    torque = 2 * power * ARM / (c * (1 - g * h)) * np.array([[h, -1], [-1, g]])
    hard = -np.linalg.eigvalsh(torque)[0]
    of_power = slope.derivative[slope.parameter.index("cavity.arm.power"), 0]
    frequency = np.sqrt((TORSION + hard) / INERTIA) / (2 * np.pi)
    assert of_power == pytest.approx(frequency * hard / (2 * power * (TORSION + hard)), rel=1e-4)


GOOD = two_mirrors(more="pole = 42.0\n")


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            '"itm", "etm"]',
            '"itm", "emt"]',
            '["itm", "emt"]: ends with emt, which is not a body; did you mean',
        ),
        ('"itm", "etm"]', '"itm", "ground"]', 'take a stage, or "support" for a mirror at rest'),
        ("[1934.0, 2245.0]", "[1934.0, 0.0]", "must not be zero; give 1e12 for a flat mirror"),
        ("[1934.0, 2245.0]", "[1934.0]", "cavity.arm.radii"),
        (
            "length = 3994.5",
            "length = 5000.0",
            "1.945 with length = 5000 m, so no beam is stable; choose radii",
        ),
        ("power = 100000.0", "power = -1.0", "cavity.arm.power = -1.0: must be at least 0"),
        ("power = 100000.0", "power = nan", "cavity.arm.power = nan"),
        ("power = 100000.0", "powr = 1.0", "did you mean 'power'"),
        ("pole = 42.0", "detuning = 1.0", "none of pole, finesse, transmission; give exactly one"),
        ("pole = 42.0", "pole = 42.0\nfinesse = 450.0", "pole and finesse are both given"),
        ("pole = 42.0", "pole = 42.0\ndetuning = 2e4", "is beyond half the free spectral range"),
        ('name = "arm"', 'name = "etm"', "name of another link, damper, cavity or stage"),
    ],
)
def test_faults_have_remedies(old, new, expected):
    assert old in GOOD
    with pytest.raises(sus.InputError) as raised:
        sus.parse(GOOD.replace(old, new))
    assert expected in str(raised.value)


def test_implausible_numbers():
    text = GOOD.replace("pole = 42.0", "finesse = 450.0\nwavelength = 1064.0")
    warned = sus.check(sus.parse(text.replace("100000.0", "1e9"))).document()["warnings"]
    found = {row["key"]: row["remedy"] for row in warned}
    assert found["cavity.arm.wavelength"] == "did you mean nm?"
    assert "cavity.arm.power" in found


def test_pole_finesse_and_transmission_agree():
    """c / 4LF; 42 Hz and a finesse of 450 of an arm of Advanced LIGO (Martynov et al. 2016)."""
    finesse, transmission = (
        sus.parse(GOOD.replace("pole = 42.0", given)).design.cavity[0].half_width
        for given in ("finesse = 450.0", "transmission = 0.0139")
    )
    assert finesse == pytest.approx(41.7, abs=0.05)
    assert transmission == pytest.approx(finesse, rel=0.01)
    [row] = sus.check(sus.parse(GOOD)).document()["cavities"]
    assert row["force_n"] == pytest.approx(2e5 / c, rel=1e-12) and row["pole_hz"] == 42.0


def test_the_beam_is_drawn():
    scene = expand(design := reader.parse(GOOD))
    [beam] = [one for one in sketch_at_rest(design, scene).strokes(1) if one.kind == "light"]
    np.testing.assert_array_equal(beam.points, [[0.0, 0.0, -0.5], [1.0, 0.0, -0.5]])
