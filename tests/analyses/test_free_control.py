"""Numbers of `[control]` vary as those of the suspension do, in every analysis that varies numbers.

A mass m on soft wires, at omega = sqrt(g/l), with a damper c in its loop: decay rate c/(2 m),
quality factor m omega/c. White noise of force F and of the sensor's motion n move it by

    x_rms^2 = F^2/(4 c m omega^2) + c n^2/(4 m),

which is least at c = F/(n omega).
"""

from __future__ import annotations

import math

import pytest

import suspension_cli as sus
from tests.support.commandline import written

MASS = 2.0
LENGTH = 0.5
FORCE = 1.4e-8
MOTION = 1e-9
DESIGN = sus.parse(f"""
[design]
name = "one"

[analysis.budget]
ground = ["none"]

[materials.soft]
youngs_modulus = 2e11
density = 7800.0

[[stage]]
name = "test"
body = {{ mass = {MASS}, inertia = [0.01, 0.01, 0.01] }}
wires = {{ count = 4, l = {LENGTH}, s = 0.03, t1 = 0.1, t2 = 0.1, d = 0.0, k = 1e6 }}

[[control.loop]]
name = "x"
sensor = "test.x"
actuator = "test.force_x"
damper = 1.0
sensor_noise = {MOTION}
actuator_noise = {FORCE}

[[control.loop]]
name = "yaw"
sensor = "test.yaw"
actuator = "test.torque_yaw"
gain = 10.0
zeros = [0.0]
poles = [[10.0, 17.3], [11.0, 5.0], [15.0, 12.0]]
""")
OMEGA = math.sqrt(9.81 / LENGTH)
FREE = """
[[free]]
name = "control.loop.x.damper"
lower = 0.5
upper = 60.0
scale = "log"
"""


def optimum(goals: str, folder) -> float:
    found = sus.optimise(DESIGN, written(folder, goals + FREE, "goals.toml"), starts=1)
    assert found.met
    return float(found.numbers.after[0])


def test_optimum_between_noise_of_force_and_of_sensor(tmp_path):
    found = optimum('objective = [{ minimise = "rms test.x:0.01:50" }]', tmp_path)
    assert found == pytest.approx(FORCE / (MOTION * OMEGA), rel=1e-2)  # the band ends at 50 Hz


def test_gain_that_just_meets_a_quality_factor(tmp_path):
    goals = """
    requirement = [{ quantity = "Q of test x", at_most = 3.0 }]
    objective = [{ minimise = "noise test.x:10" }]
    """
    assert optimum(goals, tmp_path) == pytest.approx(MASS * OMEGA / 3.0, rel=1e-4)


def test_derivatives_are_those_of_differences():
    result = "decay of test longitudinal"
    found = sus.sensitivity(DESIGN, vary=["control"], results=[result], fidelity="string")
    rates = dict(zip(found.parameter, found.derivative[:, 0], strict=True))
    assert rates == {"control.loop.x.damper": pytest.approx(1 / (2 * MASS), rel=1e-8)}

    turned = "decay of test yaw"
    found = sus.sensitivity(DESIGN, vary=["control"], results=[turned], fidelity="string")
    rates = dict(zip(found.parameter, found.derivative[:, 0], strict=True))
    for name in ("gain", "poles.1.2", "poles.2.1", "poles.3.2"):
        path = f"control.loop.yaw.{name}"
        value = found.value[found.parameter.index(path)]
        ends = [value * 0.999, value * 1.001]
        low, high = sus.sweep(DESIGN, vary={path: ends}, results=[turned], fidelity="string").value
        difference = (high - low) / (ends[1] - ends[0])
        assert rates[path] == pytest.approx(float(difference[0]), rel=1e-4), name


def test_fit_finds_a_gain(tmp_path):
    measured = """
    quantity = [{ name = "Q of test x", value = 4.0, uncertainty = 0.01 }]
    parameter = [{ name = "control.loop.x.damper" }]
    """
    file = written(tmp_path, measured, "measured.toml")
    found = sus.fit(file, DESIGN, fidelity="string")
    assert found.value[0] == pytest.approx(MASS * OMEGA / 4.0, rel=1e-4)


def test_switches_and_tables_of_noise_do_not_vary():
    from suspension_cli.studies import parameters

    noisy = DESIGN.replace({"control.loop.x.sensor_noise": [[0.1, 1e-9], [10.0, 1e-10]]})
    names = [one.name for one in parameters.every(noisy.text)]
    assert "control.loop.x.actuator_noise" in names
    assert not any("sensor_noise" in name for name in names if ".x." in name)
