"""Problems of control with public numbers: six loops of a quadruple, a triple along x."""

from __future__ import annotations

import tomllib
from functools import cache

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.conventions import DOF_UNITS, DOFS
from suspension_cli.design.foton import format_filter
from suspension_cli.linear import response, signals
from suspension_cli.linear.coordinates import momentum_units
from suspension_cli.linear.system import LinearSystem
from suspension_cli.physics import closed_loop, closed_loop_margins, local_control, optimal_loops
from suspension_cli.physics.optimal_loops import Wanted
from tests.support import plants, scenes
from tests.support.paths import CONFIGS, DATA

LIMITS = {"x": 1e-19, "y": 1e-16, "z": 1e-16, "pitch": 1e-17, "yaw": 1e-17}
"""Noise that the sensors may make at 10 Hz, m/sqrt(Hz) and rad/sqrt(Hz): the y and z of
rxa254/LIGO-Controls-Problems at 96cd119 are a thousandth of the motion."""
FALLING = {"x": 4, "y": 4, "z": 4, "pitch": 2, "yaw": 2}
"""Powers of the frequency with which it has to fall at least."""
SECTIONS = 10
"""Second-order sections that a filter of a front end has at most."""


@pytest.fixture(scope="module")
def quadruple():
    """Filters that the command finds for a quadruple pendulum, in the design."""
    loops = tomllib.loads((DATA / "control" / "quadruple-six-loops.toml").read_text())["control"]
    losses = {"materials.wire.loss_angle": 2e-4, "materials.silica.loss_angle": 1e-6}
    plain = sus.read(CONFIGS / "ligo-quad-2005.toml").replace(losses)
    return plain.replace({"control.loop": loops["loop"]})


@pytest.mark.parametrize("motion", LIMITS)
def test_sensor_noise_of_six_loops(quadruple, motion):
    """At 10 Hz, and its slope from 20 to 40 Hz, above the bounce mode."""
    how = {"output": f"test.{motion}", "duration": 1.0, "frequency": [10.0, 20.0, 40.0]}
    found = sus.damp(quadruple, fidelity="string", **how)
    noise = np.sqrt((found.noise**2).sum(1))
    assert noise[0] < LIMITS[motion]
    assert noise[2] / noise[1] < 0.5 ** FALLING[motion]


def test_modes_and_sensitivity_of_six_loops(quadruple):
    """All modes below 6 Hz settle within 12 s; no filter needs more sections than there are."""
    found = sus.damp(quadruple, duration=1.0, frequency=[10.0])
    low = found.closed.frequency < 6
    assert found.stable
    assert (-1 / np.real(found.closed.value[low])).max() < 12
    assert found.sensitivity.size < 2.1
    control = quadruple.design.control
    assert max(len(loop.controller.poles) for loop in control.loop) <= 2 * SECTIONS


BODIES = ("upper", "middle", "test")
DENOMINATOR = (1.0, 1.72000482, 424.075005, 360.124667, 36021.0749, 9377.65390, 513934.032)
"""Of the response from the suspension point to the mirror of an HSTS along x (hsts.txt of
terrencetec/seibot at its newest commit, MIT); the numerator is 513934.032."""


@cache
def triple_along_x():
    """A chain of unit masses, springs and inertial dampers with that response.

    Its numerator is the product of the stiffnesses, so that the denominator alone decides.
    """
    from scipy.optimize import fsolve

    def parts(numbers):
        k = np.exp(numbers[:3])
        stiffness = np.diag([k[0] + k[1], k[1] + k[2], k[2]])
        stiffness -= np.diag(k[1:], 1) + np.diag(k[1:], -1)
        return k, stiffness, np.diag(numbers[3:])

    def difference(numbers):
        _, stiffness, damping = parts(numbers)
        state = np.block([[np.zeros((3, 3)), np.eye(3)], [-stiffness, -damping]])
        return (np.poly(state) / DENOMINATOR - 1)[1:]

    start = [*np.log([99.1, 118.2, 43.9]), 0.57, 0.57, 0.57]
    k, stiffness, damping = parts(fsolve(difference, start, xtol=1e-13))
    bodies = ("support", *BODIES)
    size = 6 * len(bodies)
    along = 6 * np.arange(1, 4)
    mass = np.diag(np.where(np.isin(np.arange(size), along), 1.0, 0.0))
    other = np.arange(size) % 6 > 0
    mass[6:, 6:] += np.diag(other[6:].astype(float))
    soft = np.diag(np.where(other & (np.arange(size) >= 6), 1e3, 0.0))
    soft[np.ix_(along, along)] = stiffness
    soft[0, 6] = soft[6, 0] = -k[0]
    soft[0, 0] = k[0]
    viscous = np.zeros((size, size))
    viscous[np.ix_(along, along)] = damping
    return LinearSystem(
        body=BODIES,
        coordinate=tuple(f"{body}.{dof}" for body in bodies for dof in DOFS),
        unit=len(bodies) * DOF_UNITS,
        momentum_unit=len(bodies) * momentum_units(DOF_UNITS),
        basis=np.eye(size),
        massless=np.zeros(size, dtype=bool),
        mass=mass,
        damping=viscous,
        soft=soft,
        elongation=np.zeros((0, size)),
        k=np.zeros(0),
        allowed=np.ones((size, size), dtype=bool),
    )


def length_loop(**how):
    """A loop on the upper mass along x."""
    loop = {"name": "length", "sensor": "upper.x", "actuator": "upper.force_x"} | how
    loop["reference"] = "inertial"
    return scenes.design_of(plants.raw("triple") | {"control": {"loop": [loop]}})


def test_modes_and_isolation_of_the_published_triple():
    """0.6733 Hz (Q 26.4), 1.5222 (17.1), 2.8198 (17.7); 9.33e-6 at 10 Hz."""
    system = triple_along_x()
    opened = local_control.build_plant(length_loop(damper=1.0), system).without_loops()
    found = closed_loop.find_poles(opened)
    own = np.array([".x" in name for name in found.state])
    np.testing.assert_allclose(found.frequency[own], [0.6733, 1.5222, 2.8198], atol=6e-5)
    np.testing.assert_allclose(found.q[own], [26.4, 17.1, 17.7], atol=0.06)
    rows = [signals.linear_form(one, system) for one in plants.motions(system, "support.x")]
    [output] = plants.motions(system, "test.x")
    form = signals.linear_form(output, system)
    value, _ = response.transfer(
        system, 2 * np.pi * np.array([10.0]), np.array(rows), [False], form[None]
    )
    assert abs(value[0, 0, 0]) == pytest.approx(9.33e-6, rel=1e-3)


@pytest.mark.parametrize("method", ["lqg", "h2", "hinf"])
def test_loops_for_the_published_triple(method):
    """The modes of the published triple ring for 6 s; all methods damp them within 3 s."""
    system = triple_along_x()
    wanted = Wanted(3.0, 1.6, "test.x", quiet_at=10.0, highest=10.0)
    found = optimal_loops.solve(length_loop(damper=1.0), system, 0, wanted, method)
    closed = local_control.build_plant(length_loop(filter=format_filter(found.filter)), system)
    poles = closed_loop.find_poles(closed)
    own = np.array([".x" in name or name.startswith("loop") for name in poles.state])
    assert -1 / np.real(poles.value[own]).max() == pytest.approx(found.settling, rel=1e-6)
    assert found.settling < 3
    _, peak = closed_loop_margins.find_margins(closed, poles)
    assert peak.size < 1.6
    assert len(found.filter.poles) <= 2 * SECTIONS
    # filters near the smallest gamma have poles without bound, which no front end runs
    assert max(map(abs, found.filter.poles)) < 1e3
