"""Noise of closed loops: one oscillator by hand, and chains through cross-spectra."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from suspension_cli.conventions import BOLTZMANN
from suspension_cli.linear import response, signals
from suspension_cli.models import registry
from suspension_cli.physics import local_control, thermal_noise
from suspension_cli.physics import noise_budget as solve
from suspension_cli.physics.ground import Spectrum
from suspension_cli.physics.noise_budget import Noises
from tests.analyses.damp.test_control import LEAD, loop, plant
from tests.support import plants, scenes

MASS, LENGTH, OWN, LOOP = 3.0, 0.7, 0.05, 1.3
SPRING = MASS * 9.81 / LENGTH
GRID = np.geomspace(0.05, 50, 60)
OMEGA = 2 * np.pi * GRID
WHITE = Spectrum("white", np.array([1e-6, 1e6]), np.ones(2))


def pendulum(reference="inertial", **how):
    """A mass on one wire with a damper of its own (OWN) and one loop, along x."""
    stage = scenes.hung({"count": 1, "l": LENGTH, "k": 1e5}, MASS, 0.1, damping={"x": OWN})
    return plant(scenes.raw_of(stage), [loop("test.x", reference=reference, **how)])


def densities(closed, motion, temperature=300.0):
    [x] = plants.motions(closed.model, "test.x")
    noises = Noises(closed, [x], motion, temperature)
    return dict(zip(noises.cause, noises.density(GRID)[0], strict=True))


def test_one_oscillator_by_hand():
    """A cold damper: all move through 1 / (K - m w^2 + i w (c + b)), the thermal force is c's."""
    closed = pendulum(damper=LOOP, sensor_noise=2.0, actuator_noise=5.0)
    found = densities(closed, {"x": WHITE, "z": WHITE})
    z = SPRING - MASS * OMEGA**2 + 1j * OMEGA * (OWN + LOOP)
    expected = {
        # the body's own damper acts against the support
        "ground.x": np.abs((SPRING + 1j * OMEGA * OWN) / z) ** 2,
        "ground.z": 0 * GRID,
        "sensor.x": np.abs(2.0 * OMEGA * LOOP / z) ** 2,
        "actuator.x": np.abs(5.0 / z) ** 2,
        "thermal": 4 * BOLTZMANN * 300.0 * OWN / np.abs(z) ** 2,
    }
    assert [*found] == [*expected]
    for cause, density in found.items():
        np.testing.assert_allclose(density, expected[cause], rtol=1e-10, err_msg=cause)


def cross_spectra(closed, rows, temperature):
    """x_cl = x_ol - G_xu (1 + H G_yu)^-1 H y_ol with S_xy = -(4 k T / w) Im G_xy."""
    both = np.concatenate([rows, closed.sensed])
    g, _ = response.transfer(closed.model, OMEGA, both, [True] * len(both), both)
    open_loop = -4 * BOLTZMANN * temperature / OMEGA[:, None, None] * g.imag
    count, loops = len(rows), len(closed.loops)
    push, _ = response.transfer(closed.model, OMEGA, closed.pushed, [True] * loops, both)
    h = closed.network.controllers(GRID)
    back = push[:, :count] @ np.linalg.solve(np.eye(loops) + h @ push[:, count:], h)
    whole = np.concatenate([np.broadcast_to(np.eye(count), (len(GRID), count, count)), -back], 2)
    return np.einsum("fai,fij,faj->af", whole, open_loop, whole.conj()).real


CHAINS = {
    "damper": [loop("upper.x", damper=25.0)],
    "filters": [loop("upper.x", **LEAD), loop("upper.pitch", gain=5.0, zeros=[0.0], poles=[20.0])],
    "not collocated": [
        loop("test.x", "upper.force_x", damper=3.0),
        loop("upper.pitch", "test.torque_pitch", **LEAD | {"gain": 3.0}),
    ],
    "across blocks": [loop("upper.x", "upper.force_y", **LEAD), loop("upper.y", damper=9.0)],
    "none": [],
}


@pytest.mark.parametrize("how", CHAINS)
@pytest.mark.parametrize("reference", ["support", "inertial"])
def test_thermal_noise_of_chains(how, reference):
    """Against the fluctuation-dissipation theorem for sensed and observed motions together."""
    raw = plants.raw("triple", loss=True, damping=True)
    loops = [one | {"reference": reference} for one in CHAINS[how]]
    if loops:
        closed = plant(raw, loops, "string")
    else:
        design = scenes.design_of(raw)
        closed = local_control.build_plant(design, registry.STRING.system(design))
    motions = plants.motions(closed.model, "test.x", "test.pitch", "test.z")
    rows = np.array([signals.linear_form(motion, closed.model) for motion in motions])
    found = Noises(closed, motions, {}, 290.0).density(GRID)[:, -1]
    np.testing.assert_allclose(found, cross_spectra(closed, rows, 290.0), rtol=1e-6)
    if how == "none":
        for part, bare in zip(
            found, thermal_noise.solve(closed.model, GRID, motions, 290.0), strict=True
        ):
            np.testing.assert_allclose(part, bare.density.sum(0), rtol=1e-12)


@pytest.mark.parametrize("damper", [3.0, 1e-2, 1e-6])
def test_rms_under_a_white_force(damper):
    """S / (4 k c) and, of the velocity, S / (4 m c): Q from 4 to 2e7, over six decades."""
    closed = pendulum(damper=damper, actuator_noise=1e-6)
    closed = closed.with_model(replace(closed.model, damping=0 * closed.model.damping))
    [x] = plants.motions(closed.model, "test.x")
    poles = np.roots([MASS, damper, SPRING])
    [found] = solve.solve(
        Noises(closed, [x], {}, None),
        np.geomspace(1e-3, 1e3, 500),
        poles[poles.imag > 0],
        {},
        added=True,
    )
    c = damper
    assert found.rms[0] ** 2 == pytest.approx(1e-12 / (4 * SPRING * c), rel=2e-3)
    assert found.rms_velocity[0] ** 2 == pytest.approx(1e-12 / (4 * MASS * c), rel=2e-3)
    assert (np.diff(found.rms) <= 0).all() and found.rms[-1] == 0


def test_a_resonance_without_loss_has_no_rms():
    closed = pendulum(damper=0.0).without_loops()
    closed = closed.with_model(replace(closed.model, damping=0 * closed.model.damping))
    outputs = plants.motions(closed.model, "test.x", "test.y")
    found = solve.solve(
        Noises(closed, outputs, {"x": WHITE}, None),
        np.geomspace(0.01, 10, 100),
        np.array([1j * np.sqrt(SPRING / MASS)]),
        {},
        added=True,
    )
    at = np.sqrt(SPRING / MASS) / (2 * np.pi)
    assert np.isinf(found[0].rms[found[0].frequency < at * 0.999]).all()
    assert np.isfinite(found[0].rms[found[0].frequency > at * 1.001]).all()
    assert not found[1].rms.any()


def test_many_white_spectra_integrate_exactly():
    """Power laws are integrated without error."""
    at = np.geomspace(0.1, 10, 5)
    found = solve.integrate_down(at, np.array([at**-1.0, at**-8.0, 0 * at]))
    np.testing.assert_allclose(found[:, 0], [np.log(100), (0.1**-7 - 10.0**-7) / 7, 0], rtol=1e-12)
