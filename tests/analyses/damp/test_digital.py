"""Digital filters in loops: poles of the sampled system, and of the characteristic equation."""

from __future__ import annotations

import numpy as np
import pytest
import tomli_w
from scipy import signal

import suspension_cli as sus
from suspension_cli.analyses.damp import solve as damp
from suspension_cli.design import foton
from suspension_cli.linear import statespace
from tests.analyses.damp.test_control import loop, plant
from tests.support import plants, scenes
from tests.support.foton import sections

DESIGN = 'zpk([0],[12;8+i*9;8-i*9],0.6,"n")'
STAGE = scenes.hung({"count": 1, "l": 0.5, "k": 1e4, "d": 0.0}, 3.0, 0.1)


def sampled_poles(system, rows, rate):
    """Poles rate ln(z) of a plant behind a zero-order hold with u = -H y, H of sections."""
    plant_ = signal.cont2discrete((system.a, system.b, system.c, system.d), 1 / rate)
    a, b, c = plant_[:3]
    for row in rows:
        own = signal.tf2ss(row[:3], row[3:])
        # in series: y of this section drives the next
        a, b, c = _append(a, b, c, *own)
    return np.log(np.linalg.eigvals(a - b @ c)) * rate


def _append(a, b, c, fa, fb, fc, fd):
    """Series of (a, b, c) and a filter at its output."""
    whole = np.block([[a, np.zeros((len(a), len(fa)))], [fb @ c, fa]])
    return whole, np.vstack([b, np.zeros((len(fa), b.shape[1]))]), np.hstack([fd @ c, fc])


@pytest.mark.parametrize(("rate", "error"), [(256.0, 4e-5), (64.0, 6e-4)])
def test_poles_are_those_of_the_sampled_system(rate, error):
    """The zero-order hold is half a sample of delay; its sinc and images are errors of second order
    in f / rate. Without that delay they are of first order."""
    raw = plants.raw("triple")
    how = {"filter": {"design": DESIGN, "rate": rate}}
    closed = plant(raw, [loop("upper.yaw", delay=0.5 / rate, **how)], "string")
    found = damp.find_poles(closed)
    system = statespace.build(
        closed.model,
        plants.drives(closed.model, "upper.torque_yaw"),
        plants.motions(closed.model, "upper.yaw"),
    )
    exact = sampled_poles(system, sections(foton.parse(DESIGN, rate)), rate)
    exact = exact[(exact.imag > 0) & (np.abs(exact) < 2 * np.pi * 6)]
    assert len(exact) == 3  # the modes in yaw
    off = [np.abs(found.value / one - 1).min() for one in exact]
    assert max(off) < error
    late = plant(raw, [loop("upper.yaw", **how)], "string")
    without = damp.find_poles(late)
    assert max(np.abs(without.value / one - 1).min() for one in exact) > 5 * max(off)


@pytest.mark.parametrize("delay", [0.0, 4e-3])
def test_roots_of_the_characteristic_equation(delay):
    """m s^2 + m g / l + H(exp(s T)) exp(-s T'), with H from its coefficients in z."""
    rate, rows = 100.0, signal.butter(3, 6.0, fs=100.0, output="sos")
    numbers = [row[k] for row in rows for k in (4, 5)]
    gain = rows[0, 0] * 900.0
    text = f'sos({gain},[{numbers[0]};{numbers[1]};2;1;{numbers[2]};{numbers[3]};2;1],"o")'
    text = text.replace(f"{numbers[0]};0.0;2;1", f"{numbers[0]};0.0;1;0")
    how = {"filter": {"design": text, "rate": rate}, "sensor_response": 'pole(9,"n") zero(2,"n")'}
    closed = plant(scenes.raw_of(STAGE), [loop("test.x", delay=delay, **how)], "string")
    found = damp.find_poles(closed).value

    def evaluate(s):
        z, f = np.exp(s / rate), s / (2 * np.pi)
        h = 900 * np.prod([np.polyval(row[:3], z) / np.polyval(row[3:], z) for row in rows], axis=0)
        return h * np.exp(-s * delay) * (1 + f / 2) / (1 + f / 9) + 3 * s**2 + 3 * 9.81 / 0.5

    good = found[np.abs(evaluate(found)) < 1e-9 * np.abs(3 * found**2)]
    assert (np.abs(good) < 2 * np.pi * 20).sum() >= 3


def test_a_response_with_the_loop_closed():
    """x = G / (1 + H G) f with the response G of the open loop, at any frequency below rate / 2."""
    raw = plants.raw("triple")
    how = {"filter": {"design": DESIGN, "rate": 64.0}, "sensor": "upper.yaw"}
    text = raw | {"control": {"loop": [{"name": "yaw", "actuator": "upper.torque_yaw"} | how]}}
    design = sus.parse(tomli_w.dumps(text))
    f = np.array([0.3, 2.0, 17.0, 31.0, 40.0])
    ends = {"inputs": ["upper.torque_yaw"], "outputs": ["upper.yaw"], "frequency": f}
    opened = sus.response(design, **ends).value.ravel()
    closed = sus.response(design, closed_loop=True, **ends).value.ravel()
    h = foton.parse(DESIGN, 64.0).at(f)
    assert h[-1] == 0
    np.testing.assert_allclose(closed, opened / (1 + h * opened), rtol=1e-9)
