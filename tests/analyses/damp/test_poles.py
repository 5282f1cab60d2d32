"""Poles of closed loops that hardly decay, with losses at their own frequency, delays and digital
filters: by hand, from responses, by Lambert's W, characteristic equations and sampled systems."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
import tomli_w
from scipy import signal
from scipy.special import lambertw

import suspension_cli as sus
from suspension_cli.analyses.damp import solve as damp
from suspension_cli.design import foton
from suspension_cli.design.noise_spectra import NoiseSpectrum
from suspension_cli.design.reader import read
from suspension_cli.linear import response, statespace
from suspension_cli.models import registry
from suspension_cli.physics import closed_loop, local_control, loop_network, margins
from tests.analyses.damp.test_control import LEAD, loop, plant, simple
from tests.support import plants, scenes, terms
from tests.support.foton import sections
from tests.support.paths import CONFIGS


@pytest.mark.parametrize("c", [40.0, 5.0, 0.4, 1e-3, 1e-8, 1e-12, 1e-20])
def test_a_pendulum_by_hand(c):
    """m x'' + c x' + m g x / l = 0 decays with c / 2m, whatever its rounding."""
    mass, length = 3.0, 0.7
    found = closed_loop.find_poles(simple(c, mass=mass, length=length))
    own = np.array([state.startswith("test.x") for state in found.state])
    others = ~np.array([state.startswith(("test.x", "test.pitch")) for state in found.state])
    root = np.emath.sqrt((c / (2 * mass)) ** 2 - 9.81 / length)
    expected = -c / (2 * mass) + (np.array([-root, root]) if c > 20 else np.array([root]))
    np.testing.assert_allclose(np.sort(found.value[own].real), expected.real, rtol=1e-9)
    np.testing.assert_allclose(np.sort(found.value[own].imag), expected.imag, rtol=1e-9)
    np.testing.assert_allclose(found.q[own], abs(expected) / (-2 * expected.real), rtol=1e-9)
    assert np.isinf(found.q[others]).all()


GRID = np.array([0.3, 0.6, 1.37, 3.3, 10.0, 36.174, 51.816])


@cache
def silica():
    """Fused silica with a filter and a damper, and its model with bending wires."""
    raw = plants.tomllib.loads((CONFIGS / "geo-silica-triple.toml").read_text())
    first = raw["stage"][0]["name"]
    raw["control"] = {
        "loop": [
            loop(
                f"{first}.x", gain=1e6, zeros=[0.0], poles=[20.0, [10.0, 17.0]], sensor_noise=1e-10
            )
        ]
    }
    raw["control"]["loop"].append(loop(f"{first}.pitch", damper=0.03, sensor_noise=1e-9))
    design = scenes.design_of(raw)
    return design, registry.BEAM.system(design)


@cache
def steel():
    design = read(CONFIGS / "triple-damped.toml").design
    return design, registry.BEAM.system(design)


@cache
def answered(made):
    """What `damp` gives of the last body, moved along x."""
    design, model = made()
    last = model.body[-1]
    return damp.solve(design, model, f"{last}.x", f"{last}.force_x", GRID, 1.0, samples=3)


@pytest.mark.parametrize("made", [steel, silica])
def test_gains_and_noise_are_those_of_responses(made):
    """From what `response` gives for each actuator: 1 + L_k = det(1 + H G) / det(the same without
    k), noise -G_o (1 + H G)^-1 H n."""
    design, model = made()
    loops = design.control.loop
    count, last = len(loops), model.body[-1]
    answer = answered(made)
    drives = plants.drives(model, *(one.actuator for one in loops))
    watched = plants.motions(model, *(one.sensor for one in loops), f"{last}.x")
    found = response.solve(model, GRID, drives, watched).value
    for n, frequency in enumerate(GRID):
        g, out = found[n, :count], found[n, count]
        h = np.diag([loop_network.make_node(one).at(frequency) for one in loops])
        whole = np.eye(count) + h @ g
        for k in range(count):
            rest = np.delete(np.delete(whole, k, 0), k, 1)
            assert answer.gain[n, k] == pytest.approx(
                np.linalg.det(whole) / np.linalg.det(rest) - 1, rel=1e-9, abs=1e-12
            )
        expected = np.abs(out @ np.linalg.solve(whole, h)) * [one.sensor_noise for one in loops]
        np.testing.assert_allclose(
            answer.noise[n], expected, rtol=1e-9, atol=1e-12 * expected.max()
        )


@pytest.mark.parametrize("made", [steel, silica])
def test_poles_are_roots_with_losses_at_their_own_frequency(made):
    """The smallest singular value of Z(s) + sum of H p s^T, in units of each coordinate, is all but
    0 there and not beside it."""
    design, model = made()
    found = answered(made).closed
    closed = local_control.build_plant(design, model)
    some = [n for n in range(len(found.value)) if found.value[n].imag > 0][::5]
    assert len(some) >= 3
    for n in some:
        s = found.value[n]
        assert smallest(closed, s) < 1e-6 * max(
            smallest(closed, s * (1 + 1e-4)), smallest(closed, s * (1 + 1e-4j))
        )


def smallest(closed, s):
    """The least determinant of a block of the closed loop, over its size with coordinates scaled to
    1."""
    model, free = closed.model, slice(6, None)
    dynamic = (model.stiffness + s * model.damping + s**2 * model.mass).astype(complex)
    for term in model.terms:
        at = np.ix_(term.columns, term.columns)
        dynamic[at] += terms.stiffness(term, s.imag)
    for one, pushed, sensed in zip(closed.loops, closed.pushed, closed.sensed, strict=True):
        h = loop_network.make_node(one).at(s / (2j * np.pi))
        dynamic = dynamic + h * np.outer(pushed, sensed)
    dynamic = dynamic[free, free]
    scale = np.sqrt(
        np.abs(model.stiffness.diagonal()[free]) + abs(s) ** 2 * model.mass.diagonal()[free]
    )
    return np.linalg.svd(dynamic / np.outer(scale, scale), compute_uv=False)[-1]


@pytest.mark.parametrize("angle", [0.1, 1e-3, 1e-9])
@pytest.mark.parametrize("c", [0.0, 0.7, 40.0])
def test_one_lossy_oscillator_by_hand(angle, c):
    """m s^2 + c s + k (1 + i phi) = 0; at phi = 0.1 alone its Q is 10.04, or Im s / (-2 Re s) =
    10.025, not the 10 of first order."""
    mass, k = 3.0, 2e4
    stage = scenes.hung({"count": 1, "l": 0.7, "k": k, "material": "lossy"}, mass, 0.1)
    raw = scenes.raw_of(stage) | {
        "materials": {"lossy": {"youngs_modulus": 1e11, "loss_angle": angle}}
    }
    closed = plant(raw, [loop("test.z", damper=c)], "string")
    found = closed_loop.find_poles(closed)
    [z] = [
        value for value, state in zip(found.value, found.state, strict=True) if state == "test.z"
    ]
    root = -c / 2 / mass + 1j * np.sqrt(complex(k * (1 + 1j * angle) / mass - (c / 2 / mass) ** 2))
    assert z.imag == pytest.approx(root.imag, rel=1e-9)
    exact = root.real if c or angle > 1e-6 else -angle / 2 * np.sqrt(k / mass)
    assert z.real == pytest.approx(exact, rel=1e-7)
    if angle == 0.1 and c == 0.0:
        assert z.imag / (-2 * z.real) == pytest.approx(10.025, abs=1e-3)


STAGE = scenes.hung({"count": 1, "l": 0.5, "k": 1e4, "d": 0.0}, 3.0, 0.1)


@pytest.mark.parametrize("delay", [0.01, 0.3])
def test_a_delayed_damper_of_a_free_body(delay):
    """J s^2 + c s exp(-s T) = 0 has s T = W(-c T / J) (Corless et al., Adv. Comput. Math. 5, 329
    (1996))."""
    c, inertia = 0.2, 0.1
    closed = plant(scenes.raw_of(STAGE), [loop("test.yaw", damper=c, delay=delay)], "string")
    found = closed_loop.find_poles(closed)
    values = found.value[[state == "test.yaw" for state in found.state]]
    expected = lambertw(-c * delay / inertia, 0) / delay
    assert np.abs(values / (expected.real + 1j * abs(expected.imag)) - 1).min() < 1e-12


@pytest.mark.parametrize("how", [LEAD, LEAD | {"sensor_response": 'pole2(3,0.7,"n")'}])
@pytest.mark.parametrize("delay", [1e-3, 0.03])
def test_roots_of_the_characteristic_equation(how, delay):
    """m s^2 + m g / l + H(s) exp(-s T), with the products of the filter written out."""
    closed = plant(scenes.raw_of(STAGE), [loop("test.x", delay=delay, **how)], "string")
    found = closed_loop.find_poles(closed).value

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
        lambda f: local_control.compute_loop_gains(nominal, f), corners, faint=1e-6
    )[0]
    assert found.gain_up < 1e3
    assert found.delay < 1.0
    gain = {"gain_at": {"frequency": 1.0, "magnitude": 60.0 * found.gain_up}}
    for frequency, edge in (
        (found.gain_up_frequency, changed(**gain)),
        (found.delay_frequency, changed(delay=delay + found.delay)),
    ):
        values = closed_loop.find_poles(edge).value
        near = values[np.abs(values - 2j * np.pi * frequency).argmin()]
        assert near == pytest.approx(2j * np.pi * frequency, rel=1e-8)


def test_sensitivity_peak_of_two_coupled_loops():
    """The largest singular value, scaled as best can be, on a dense grid around the peak; and its
    independence of the units of the actuators."""
    raw = plants.raw("triple", loss=True)
    loops = [loop("upper.x", **LEAD), loop("upper.pitch", gain=5.0, zeros=[0.0], poles=[20.0])]
    closed = plant(raw, loops, "string")
    peak = margins.find_peak(
        partial(local_control.compute_sensitivity, closed), np.geomspace(0.05, 500, 100)
    )

    def largest(frequency):
        s = local_control.compute_sensitivity(closed, frequency)
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
            assert closed_loop.find_poles(plant(raw, tables, "string")).stable


def test_noise_of_sensors():
    one = plant(
        scenes.raw_of(STAGE), [loop("test.x", damper=1.0, sensor_noise=2e-9)], "string"
    ).channels[0]
    f = np.array([0.01, 1.0, 100.0])
    cornered = replace(one, sensor_noise=NoiseSpectrum(asd=2e-9, corner=3.0))
    listed = replace(one, sensor_noise=NoiseSpectrum(frequency=[0.1, 10.0], asd=[1e-8, 1e-10]))
    np.testing.assert_array_equal(local_control.evaluate_noise(one, f), [2e-9] * 3)
    np.testing.assert_allclose(local_control.evaluate_noise(cornered, f), 2e-9 * np.sqrt(1 + 3 / f))
    np.testing.assert_allclose(local_control.evaluate_noise(listed, f), [1e-8, 1e-9, 1e-10])


DESIGN = 'zpk([0],[12;8+i*9;8-i*9],0.6,"n")'


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
    found = closed_loop.find_poles(closed)
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
    without = closed_loop.find_poles(late)
    assert max(np.abs(without.value / one - 1).min() for one in exact) > 5 * max(off)


@pytest.mark.parametrize("delay", [0.0, 4e-3])
def test_digital_roots_of_the_characteristic_equation(delay):
    """m s^2 + m g / l + H(exp(s T)) exp(-s T'), with H from its coefficients in z."""
    rate, rows = 100.0, signal.butter(3, 6.0, fs=100.0, output="sos")
    numbers = [row[k] for row in rows for k in (4, 5)]
    gain = rows[0, 0] * 900.0
    text = f'sos({gain},[{numbers[0]};{numbers[1]};2;1;{numbers[2]};{numbers[3]};2;1],"o")'
    text = text.replace(f"{numbers[0]};0.0;2;1", f"{numbers[0]};0.0;1;0")
    how = {"filter": {"design": text, "rate": rate}, "sensor_response": 'pole(9,"n") zero(2,"n")'}
    closed = plant(scenes.raw_of(STAGE), [loop("test.x", delay=delay, **how)], "string")
    found = closed_loop.find_poles(closed).value

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
