"""Delays and sensors in loops: poles against Lambert's W, and against characteristic equations."""

from __future__ import annotations

from functools import partial

import msgspec
import numpy as np
import pytest
from scipy.special import lambertw

from suspension_cli.analyses.damp import (
    closed_loop_poles,
    control,
    margins,
)
from suspension_cli.design.schema import NoiseSpectrum
from tests.analyses.damp.test_control import LEAD, loop, plant
from tests.support import plants, scenes

STAGE = scenes.hung({"count": 1, "l": 0.5, "k": 1e4, "d": 0.0}, 3.0, 0.1)


def pole_values(closed):
    """Closed-loop poles of a plant, one of each conjugate pair."""
    return closed_loop_poles.find(closed)


@pytest.mark.parametrize("delay", [0.01, 0.3])
def test_a_delayed_damper_of_a_free_body(delay):
    """J s^2 + c s exp(-s T) = 0 has s T = W(-c T / J) (Corless et al., Adv. Comput. Math. 5, 329
    (1996))."""
    c, inertia = 0.2, 0.1
    closed = plant(scenes.raw_of(STAGE), [loop("test.yaw", damper=c, delay=delay)], "string")
    found = pole_values(closed)
    values = found.value[[state == "test.yaw" for state in found.state]]
    expected = lambertw(-c * delay / inertia, 0) / delay
    assert np.abs(values / (expected.real + 1j * abs(expected.imag)) - 1).min() < 1e-12


@pytest.mark.parametrize("how", [LEAD, LEAD | {"sensor_response": 'pole2(3,0.7,"n")'}])
@pytest.mark.parametrize("delay", [1e-3, 0.03])
def test_roots_of_the_characteristic_equation(how, delay):
    """m s^2 + m g / l + H(s) exp(-s T), with the products of the filter written out."""
    closed = plant(scenes.raw_of(STAGE), [loop("test.x", delay=delay, **how)], "string")
    found = pole_values(closed).value

    def evaluate(s):
        f = s / (2 * np.pi)
        h = 3e4 * f * (f + 0.8) / ((f + 30) * ((f + 12) ** 2 + 81)) * np.exp(-s * delay)
        if "sensor_response" in how:
            h = h / (1 + f / (3 * 0.7) + (f / 3) ** 2)
        return h + 3.0 * s**2 + 3.0 * 9.81 / 0.5

    of_x = found[np.abs(evaluate(found)) < 1e-9 * np.abs(3.0 * found**2)]
    assert len(of_x) >= 3  # the pendulum, and those of the filter
    # every root with a modulus below 100 rad/s, by the argument principle
    turn = 100.0 * np.exp(1j * np.linspace(0, 2 * np.pi, 20001))
    winding = np.unwrap(np.angle(evaluate(turn)))
    inner = of_x[np.abs(of_x) < 100]
    filter_poles = 2 * ("sensor_response" in how) + 2  # within: 12 +- 9 i Hz is 94 rad/s
    count = np.sum(np.where(np.abs(inner.imag) > 1e-9 * np.abs(inner), 2, 1))
    assert count - filter_poles == round((winding[-1] - winding[0]) / (2 * np.pi))


@pytest.mark.parametrize("delay", [0.0, 2e-3])
def test_margins_lie_on_the_axis(delay):
    """At the gain margin a pole is on the imaginary axis, at the delay margin too."""
    filter_ = 'zpk([0;0.8],[30;12+i*9;12-i*9],3e4,"n")'
    how = {"gain_at": {"frequency": 1.0, "magnitude": 60.0}, "filter": filter_, "delay": delay}
    raw = plants.raw("triple", loss=True)

    def changed(**changes):
        loops = [loop("upper.x", **how | changes), loop("upper.pitch", damper=0.2, delay=delay)]
        return plant(raw, loops, "string")

    nominal = changed()
    corners = np.geomspace(0.05, 500, 300)
    found = margins.compute_margins(
        lambda f: control.compute_loop_gains(nominal, f), corners, faint=1e-6
    )[0]
    assert found.gain_up < 1e3
    assert found.delay < 1.0
    gain = {"gain_at": {"frequency": 1.0, "magnitude": 60.0 * found.gain_up}}
    for frequency, edge in (
        (found.gain_up_frequency, changed(**gain)),
        (found.delay_frequency, changed(delay=delay + found.delay)),
    ):
        values = pole_values(edge).value
        near = values[np.abs(values - 2j * np.pi * frequency).argmin()]
        assert near == pytest.approx(2j * np.pi * frequency, rel=1e-8)


def test_sensitivity_peak_of_two_coupled_loops():
    """The largest singular value, scaled as best can be, on a dense grid around the peak; and its
    independence of the units of the actuators."""
    raw = plants.raw("triple", loss=True)
    loops = [loop("upper.x", **LEAD), loop("upper.pitch", gain=5.0, zeros=[0.0], poles=[20.0])]
    closed = plant(raw, loops, "string")
    peak = margins.find_peak(
        partial(control.compute_sensitivity, closed), np.geomspace(0.05, 500, 100)
    )

    def largest(frequency):
        s = control.compute_sensitivity(closed, frequency)
        # singular values of a 2 x 2 matrix of given determinant: least at equal off-diagonals
        squares = (
            np.abs(s[:, 0, 0]) ** 2 + np.abs(s[:, 1, 1]) ** 2 + 2 * np.abs(s[:, 0, 1] * s[:, 1, 0])
        )
        return np.sqrt((squares + np.sqrt(squares**2 - 4 * np.abs(np.linalg.det(s)) ** 2)) / 2)

    near = largest(peak.frequency * (1 + np.linspace(-1e-4, 1e-4, 2001)))
    assert peak.size == pytest.approx(near.max(), rel=1e-9)
    assert peak.size >= largest(np.geomspace(0.05, 500, 20001)).max() * (1 - 1e-9)
    # the gains of both loops may change at once within the bounds
    for first in (peak.gain_down, peak.gain_up):
        for second in (peak.gain_down, peak.gain_up):
            tables = [loops[0] | {"gain": 3e4 * first}, loops[1] | {"gain": 5.0 * second}]
            assert pole_values(plant(raw, tables, "string")).stable


def test_noise_of_sensors():
    one = plant(
        scenes.raw_of(STAGE), [loop("test.x", damper=1.0, sensor_noise=2e-9)], "string"
    ).loops[0]
    f = np.array([0.01, 1.0, 100.0])
    cornered = msgspec.structs.replace(one, sensor_noise=NoiseSpectrum(asd=2e-9, corner=3.0))
    listed = msgspec.structs.replace(
        one, sensor_noise=NoiseSpectrum(frequency=[0.1, 10.0], asd=[1e-8, 1e-10])
    )
    np.testing.assert_array_equal(control.evaluate_noise(one, f), [2e-9] * 3)
    np.testing.assert_allclose(control.evaluate_noise(cornered, f), 2e-9 * np.sqrt(1 + 3 / f))
    np.testing.assert_allclose(control.evaluate_noise(listed, f), [1e-8, 1e-9, 1e-10])
