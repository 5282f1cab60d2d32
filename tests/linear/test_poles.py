"""Poles with light, dampers, losses and tables: none is lost, and no start value is listed."""

from __future__ import annotations

import json

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.errors import InputError
from suspension_cli.linear import damped, roots
from suspension_cli.linear.oscillations import find_oscillations
from suspension_cli.models import registry
from tests.support.commandline import run, written
from tests.support.paths import CONFIGS
from tools import cavity_survey

ARM = CONFIGS / "arm-cavity.toml"
DAMPER = '\n[[damper]]\nname = "d"\nbetween = ["etm", "itm"]\ndamping = [1e4, 0, 0, 0, 0, 0]\n'
YAW = """
[design]
name = "yaw"
[[stage]]
name = "test"
body = { mass = 5.0, inertia = [0.03, 0.03, 0.03] }
[stage.wires]
count = 4
l = 0.5
s = 0.05
t1 = 0.05
t2 = 0.05
k = 1e5
[[link]]
name = "cable"
between = ["test", "support"]
[link.table]
axis = "yaw"
frequency = [0.1, 1.0, 10.0]
real = [[0.01, 0.72, 1.2]]
imaginary = [[0.001, 0.036, 0.06]]
"""
LOOP = """
[[control.loop]]
name = "length"
sensor = "test.x"
actuator = "test.force_x"
damper = 1.0
"""


@pytest.mark.parametrize("seed", [*range(19), 29])
def test_random_cavities_have_the_eigenvalues_of_their_matrices(seed):
    """Power, detuning, curvatures, masses, dampers, losses and tables at random, on matrices that
    share nothing with the program (`tools/cavity_survey.py` has 500)."""
    assert cavity_survey.compare(cavity_survey.draw(seed)) == ""


def growing(design):
    """Growth rate and frequency (Hz) of the fastest mode."""
    modes = sus.modes(design)
    n = int(modes.growth_rate.argmax())
    rate = modes.growth_rate[n]
    omega = np.sqrt(max(modes.omega_squared[n] - rate**2, 0.0))
    return rate, omega / (2 * np.pi)


def exported_growth(design):
    """Growth rate and frequency of the fastest pole of the exported state space."""
    asked = {"inputs": "etm~itm.force_x", "outputs": "etm~itm.x", "allow_unstable": True}
    poles = np.linalg.eigvals(sus.export(design, **asked).system.a)
    worst = poles[poles.real.argmax()]
    return worst.real, abs(worst.imag) / (2 * np.pi)


@pytest.mark.parametrize(
    ("power", "detuning", "damper", "rate", "frequency"),
    [
        (400e3, 25.0, DAMPER, 15.96, 37.26),  # was called stable, of Q 1.24 at 70.87 Hz
        (200e3, 25.0, "", 97.95, 32.14),  # was 277 1/s at 50.1 Hz
    ],
)
def test_strong_optical_springs(power, detuning, damper, rate, frequency):
    """Growth and frequency are those of the exported matrix, with the states of the light."""
    changed = {"cavity.arm.detuning": detuning, "cavity.arm.power": power}
    design = sus.parse(ARM.read_text() + damper).replace(changed)
    assert growing(design) == pytest.approx((rate, frequency), rel=1e-3)
    assert growing(design) == pytest.approx(exported_growth(design), rel=1e-5)
    for analysis in (sus.response, sus.thermal):
        with pytest.raises(sus.InputError, match="no steady state"):
            analysis(design)
    warned = sus.check(design).document()["warnings"]
    assert any(f"grows at {rate:.4g} 1/s" in row["problem"] for row in warned)


@pytest.mark.parametrize("detuning", [-0.3, -3.0])
def test_growth_in_messages_is_that_of_the_poles(detuning):
    """An antispring: dampers and the delay of the light slow the growth of the static stiffness."""
    design = sus.read(ARM).replace({"cavity.arm.detuning": detuning})
    rate, _ = exported_growth(design)
    still = damped.eigenmodes.solve(registry.BEAM.system(design.design).constant)
    assert rate < 0.9 * still.growth_rate.max()
    with pytest.raises(sus.InputError, match=f"grows at {rate:.4g} 1/s"):
        sus.export(design)
    with pytest.warns(UserWarning, match=f"grows at {rate:.4g} 1/s"):
        sus.export(design, allow_unstable=True)


@pytest.mark.parametrize(("power", "detuning"), [(20e3, 0.5), (200e3, 100.0), (700e3, 8.0)])
def test_power_and_detuning_of_the_arm(power, detuning):
    """The growth is that of the exported matrix."""
    changed = {"cavity.arm.power": power, "cavity.arm.detuning": detuning}
    design = sus.read(ARM).replace(changed)
    assert growing(design) == pytest.approx(exported_growth(design), rel=1e-5)


def test_the_light_has_modes_of_its_own():
    """Of a weak spring: the poles -gamma +- i Delta of the light alone, beside those of bodies."""
    design = sus.read(ARM)
    weak = {"cavity.arm.power": 1e-6, "cavity.arm.detuning": 10.0}
    dark, lit = sus.modes(design), sus.modes(design.replace(weak))
    assert len(lit.frequency) == len(dark.frequency) + 1
    n = lit.label.index("arm light")
    cavity = design.design.cavity[0]
    pole = 2 * np.pi * (-cavity.half_width + 10.0j)
    assert lit.decay_rate[n] == pytest.approx(-pole.real, rel=1e-6)
    assert lit.omega_squared[n] == pytest.approx(abs(pole) ** 2, rel=1e-6)
    assert lit.fractions[n].max() == pytest.approx(1.0, abs=1e-6)
    others = np.delete(lit.omega_squared, n)
    dark = sus.modes(design.replace({"cavity.arm.power": 1e-6}))
    np.testing.assert_allclose(others, dark.omega_squared, rtol=1e-6)
    np.testing.assert_allclose(lit.fractions.sum(1), 1.0, rtol=1e-9)


def test_modes_of_wires_and_light(tmp_path):
    """The list with modes of wires has the growing mode, and the mode of the light, of bodies."""
    options = ("--set", "cavity.arm.detuning=25", "--json", "--no-plot", "--out", tmp_path)
    short, every = (
        json.loads(run("modes", ARM, *more, *options).stdout)["modes"]
        for more in ((), ("--max-frequency", "100"))
    )
    for key, told in (
        ("growth_rate_per_s", lambda row: row["frequency_hz"] is None),
        ("frequency_hz", lambda row: row["dof"] == "light"),
    ):
        one, other = (next(row[key] for row in rows if told(row)) for rows in (short, every))
        assert other == pytest.approx(one, rel=1e-4)


def test_sweeps_count_designs_that_grow_because_of_light():
    """Points of a sweep have no result where a mode of the design grows."""
    design = sus.parse(ARM.read_text() + DAMPER).replace({"cavity.arm.detuning": 25.0})
    power = np.array([5e4, 2e5, 5e5])
    swept = sus.sweep(design, vary={"cavity.arm.power": power}, results=["itm yaw"])
    stable = [sus.modes(design.replace({"cavity.arm.power": p})).stable for p in power.tolist()]
    assert stable == [True, True, False]
    assert (swept.status == 0).tolist() == stable


def test_a_table_that_rises_with_frequency():
    """Of a cable in yaw that is 100 times stiffer at 10 Hz: I s^2 + k_wires + k(Im s) = 0."""
    modes = sus.modes(sus.parse(YAW))
    n = modes.label.index("test yaw")
    wires = 4 * 5.0 * 9.81 / 4 * 0.05 * 2 * 0.05 / 0.5
    s = 1j
    for _ in range(400):
        place = np.log(s.imag / (2 * np.pi))
        known = np.log([0.1, 1.0, 10.0])
        k = np.interp(place, known, [0.01, 0.72, 1.2])
        k = k + 1j * np.interp(place, known, [0.001, 0.036, 0.06])
        s = 0.5 * s + 0.5j * np.sqrt((wires + k) / 0.03)
    assert modes.frequency[n] == pytest.approx(abs(s) / (2 * np.pi), rel=1e-9)
    assert modes.frequency[n] == pytest.approx(1.012, abs=5e-4)
    assert modes.q[n] == pytest.approx(s.imag / (-2 * s.real), rel=1e-9)
    found = sus.damp(sus.parse(YAW + LOOP))
    assert np.abs(found.closed.value - s).min() < 1e-8 * abs(s)
    assert np.abs(found.closed.frequency - 0.6506).min() > 0.01


@pytest.mark.parametrize("name", ["triple-damped", "cryogenic-payload", "built/ligo-quad"])
def test_counting_finds_the_poles_of_newtons_method(name, monkeypatch):
    """Eigenvalues with the stiffness at their own frequency, counted, are the roots of the
    pencil."""
    design = sus.read(CONFIGS / f"{name}.toml").design
    model = registry.most_complete(design, massless=True)
    found = damped.solve(model.system(design))
    monkeypatch.setattr(damped, "has_steep_tables", lambda *_: True)
    counted = damped.solve(model.system(design))
    np.testing.assert_allclose(counted.omega_squared, found.omega_squared, rtol=1e-9)
    np.testing.assert_allclose(counted.decay_rate, found.decay_rate, rtol=1e-8)


def test_lost_poles_are_counted(monkeypatch):
    """Where Newton's method loses all poles, they are found all the same."""
    design = sus.read(CONFIGS / "triple-damped.toml").design
    expected = damped.solve(registry.BEAM.system(design))

    def lose(pencil, blocks, start, noise=0.0):
        return roots.Roots(start.value, start.block, start.motion, np.ones(len(start.value), bool))

    monkeypatch.setattr(damped, "find_all", lose)
    found = damped.solve(registry.BEAM.system(design))
    np.testing.assert_allclose(found.omega_squared, expected.omega_squared, rtol=1e-8)
    np.testing.assert_allclose(found.decay_rate, expected.decay_rate, rtol=1e-6)
    heavy = registry.VIOLIN.system(design)
    with pytest.raises(InputError, match="was not found"):
        damped.solve(heavy)


def test_a_lost_closed_loop_pole_is_refused(tmp_path, monkeypatch):
    """One line, in place of a start value."""
    found = roots.find_roots

    def lose(*args, **options):
        result = found(*args, **options)
        return roots.Roots(
            result.value, result.block, result.motion, np.ones(len(result.value), bool)
        )

    monkeypatch.setattr(roots, "find_roots", lose)
    refused = run("damp", written(tmp_path, YAW + LOOP), "--out", tmp_path)
    assert refused.exit_code == 2
    assert "test.yaw was not found with all losses and delays" in refused.stderr


def test_a_stiffness_that_jumps_gives_three_frequencies():
    """omega_0 (1, 2 or between) of a stiffness that rises from 1 to 4 near omega = 1.5."""

    def poles_at(omega, share):
        k = 1.0 + 3.0 / (1.0 + (1.5 / omega) ** 40) + 1e-3j * share
        return np.array([1j * np.sqrt(k)]), np.ones((1, 1), dtype=complex)

    found, _ = find_oscillations(poles_at)
    assert len(found) == 3
    for s in found:
        assert abs(poles_at(s.imag, 1.0)[0][0] - s) < 1e-9
