"""Loops with public numbers, on plants that are given as matrices."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from suspension_cli.conventions import DOF_UNITS, DOFS
from suspension_cli.linear.coordinates import momentum_units
from suspension_cli.linear.system import LinearSystem
from suspension_cli.physics import closed_loop, closed_loop_margins, local_control
from tests.support import plants, scenes
from tests.support.paths import DATA

BODIES = ("top", "uim", "pum", "tst")
MASSES = (22.0, 22.0, 39.676, 39.641)
NOISE = 7.071067811865475e-11
"""Noise of the sensor of the problem at 10 Hz, m/sqrt(Hz)."""
CORNER = 20.0


@cache
def damped_quadruple():
    """Longitudinal damping of a quadruple pendulum: 1e6 s / (s + 40 pi)^2 from and to the top mass
    (QuadSUSdamping of rxa254/LIGO-Controls-Problems at 96cd119). Other motions are uncoupled."""
    a, b = (
        np.loadtxt(DATA / "control" / f"quadruple-along-x-{name}.csv", delimiter=",")
        for name in "ab"
    )
    bodies = ("support", *BODIES)
    size = 6 * len(bodies)
    along = 6 * np.arange(1, 5)
    mass = np.eye(size)
    mass[:6] = 0.0
    mass[along, along] = MASSES
    stiffness = np.diag(np.where(np.arange(size) < 6, 0.0, 1e3))
    stiffness[np.ix_(along, along)] = -np.array(MASSES)[:, None] * a[4:, :4]
    of_ground = MASSES[0] * b[4, 0]
    stiffness[0, 6] = stiffness[6, 0] = -of_ground
    stiffness[0, 0] = of_ground
    damping = np.zeros((size, size))
    damping[np.ix_(along, along)] = -np.array(MASSES)[:, None] * a[4:, 4:]
    symmetric = (stiffness + stiffness.T) / 2
    np.testing.assert_allclose(stiffness, symmetric, rtol=1e-9)
    system = LinearSystem(
        body=BODIES,
        coordinate=tuple(f"{body}.{dof}" for body in bodies for dof in DOFS),
        unit=len(bodies) * DOF_UNITS,
        momentum_unit=len(bodies) * momentum_units(DOF_UNITS),
        basis=np.eye(size),
        massless=np.zeros(size, dtype=bool),
        mass=mass,
        damping=(damping + damping.T) / 2,
        soft=symmetric,
        elongation=np.zeros((0, size)),
        k=np.zeros(0),
        allowed=np.ones((size, size), dtype=bool),
    )
    control = {
        "sensor": [{"name": "shadow", "motion": "top.x", "sensor_noise": NOISE}],
        "loop": [
            {
                "name": "length",
                "sensor": "shadow",
                "actuator": "top.force_x",
                "reference": "inertial",
                "gain": 1e6 / (2 * np.pi),
                "zeros": [0.0],
                "poles": [CORNER, CORNER],
            }
        ],
    }
    design = scenes.design_of(plants.raw("triple") | {"control": control})
    return local_control.build_plant(design, system)


def test_modes_of_the_published_quadruple():
    opened = closed_loop.find_poles(damped_quadruple().without_loops())
    own = np.array([".x" in name for name in opened.state])
    np.testing.assert_allclose(
        opened.frequency[own][:4], [0.4404, 0.9911, 1.9799, 3.3956], rtol=1e-4
    )


def test_poles_of_the_published_loop():
    found = closed_loop.find_poles(damped_quadruple())
    own = np.array([".x" in name for name in found.state])
    frequency = found.frequency[own]
    expected = [0.4407, 0.9941, 2.0016, 3.4251]
    np.testing.assert_allclose(frequency, expected, atol=6e-5)
    np.testing.assert_allclose(found.q[own], [51.5, 27.9, 10.9, 14.9], atol=0.06)
    slowest = -1 / np.real(found.value[own]).max()
    assert slowest == pytest.approx(37.2, abs=0.05)


def test_sensitivity_of_the_published_loop():
    plant = damped_quadruple()
    _, peak = closed_loop_margins.find_margins(plant, closed_loop.find_poles(plant))
    assert peak.size == pytest.approx(1.076, abs=6e-4)


def test_sensor_noise_of_the_published_loop():
    """The problem prints 8.33e-18 m/sqrt(Hz) at the frequency of its grid beside 10 Hz."""
    plant = damped_quadruple()
    [output] = plants.motions(plant.model, "tst.x")
    found = local_control.solve_sensor_noise(plant, np.array([10.0]), output)[0, 0]
    assert found == pytest.approx(8.33e-18, rel=2e-3)
