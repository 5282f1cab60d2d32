"""Poles that hardly decay: the first digit of a Q of 1e13 and the last, by hand, from losses and in
50 digits."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from suspension_cli.analyses.damp import closed_loop_poles, control
from suspension_cli.linear import eigenmodes
from tests.analyses.damp.test_control import loop, plant, simple
from tests.support import plants

MP = mpmath.mp.clone()
MP.dps = 50


def found_of(closed):
    return closed_loop_poles.find(closed)


@pytest.mark.parametrize("c", [40.0, 5.0, 0.4, 1e-3, 1e-8, 1e-12, 1e-20])
def test_a_pendulum_by_hand(c):
    """m x'' + c x' + m g x / l = 0 decays with c / 2m, whatever its rounding."""
    mass, length = 3.0, 0.7
    found = found_of(simple(c, mass=mass, length=length))
    own = np.array([state.startswith("test.x") for state in found.state])
    others = ~np.array([state.startswith(("test.x", "test.pitch")) for state in found.state])
    root = np.emath.sqrt((c / (2 * mass)) ** 2 - 9.81 / length)
    expected = -c / (2 * mass) + (np.array([-root, root]) if c > 20 else np.array([root]))
    np.testing.assert_allclose(np.sort(found.value[own].real), expected.real, rtol=1e-9)
    np.testing.assert_allclose(np.sort(found.value[own].imag), expected.imag, rtol=1e-9)
    np.testing.assert_allclose(found.q[own], abs(expected) / (-2 * expected.real), rtol=1e-9)
    assert np.isinf(found.q[others]).all()


def test_without_loops_it_is_the_q_of_modes():
    """A spring of a tiny loss angle: to first order in the losses, which makes such a Q exact."""
    raw = plants.raw("quadruple")
    raw["stage"][0]["spring"] = [{"stiffness": [1.0, 2.0, 3.0, 0.1, 0.2, 0.3], "loss_angle": 1e-9}]
    closed = plant(raw, [loop(f"{raw['stage'][0]['name']}.x", damper=1e-9)], "string")
    bare = control.Plant(
        closed.model, (), [], [], np.zeros((0, closed.model.size)), np.zeros((0, closed.model.size))
    )
    found = found_of(bare)
    expected = eigenmodes.solve(closed.model)
    order = np.argsort(found.frequency)
    np.testing.assert_allclose(found.frequency[order], expected.frequency, rtol=1e-9)
    np.testing.assert_allclose(found.q[order], expected.q, rtol=1e-6)
