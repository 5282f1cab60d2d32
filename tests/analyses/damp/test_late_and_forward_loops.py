"""Poles of a digital filter behind a delay, and of a path from the ground that is in no loop.

A mass m with omega = sqrt(g/l) and the force H(w) exp(-s T) x of a digital velocity filter has

    s^2 + omega^2 + H(w) exp(-s T)/m = 0,    w = 2 rate tanh(s/(2 rate)).
"""

from __future__ import annotations

import cmath
import math

import numpy as np

import suspension_cli as sus
from suspension_cli.physics import closed_loop, local_control
from suspension_cli.physics.model_choice import for_modes

MASS = 2.0
LENGTH = 0.5
DELAY = 1e-3
RATE = 2048.0
DESIGN = f"""
[design]
name = "one"

[[stage]]
name = "test"
body = {{ mass = {MASS}, inertia = [0.01, 0.01, 0.01] }}
wires = {{ count = 4, l = {LENGTH}, s = 0.03, t1 = 0.1, t2 = 0.1, d = 0.0, k = 1e6 }}

[[control.loop]]
name = "x"
sensor = "test.x"
actuator = "test.force_x"
"""
LATE = f"""
delay = {DELAY}
filter = {{ design = "zpk([0],[-20],1,\\"f\\")", rate = {RATE} }}
gain_at = {{ frequency = 0.7, magnitude = 8.0 }}
"""
FORWARD = """
damper = 1.0

[[control.sensor]]
name = "ground"
motion = "support.x"

[[control.loop]]
name = "forward"
sensor = "ground"
actuator = "test.force_x"
gain = 10.0
poles = [1.0, 1.0, 1.0, 1.0, 1.0, [0.5, 2.0]]
"""


def find(text: str):
    source = sus.parse(text)
    plant = local_control.build_plant(source.design, for_modes(source, "string", 1e-3)[1])
    return source.design.control.loop[0], closed_loop.find_poles(plant)


def test_a_millisecond_before_a_filter_of_2048_hz():
    loop, found = find(DESIGN + LATE)
    of_filter = [one.startswith("loop x") for one in found.state]
    moving = found.motion[:, 6] != 0
    own = found.value[moving | np.array(of_filter)]
    assert len(own) == 2 and found.stable
    size = abs(loop.controller.gain)
    pole = RATE / math.pi * math.tan(math.pi * 20.0 / RATE)  # so that the filter turns at 20 Hz
    for s in own:
        w = 2 * RATE * cmath.tanh(s / (2 * RATE))
        force = size * (w / (2 * np.pi)) / (w / (2 * np.pi) + pole) * cmath.exp(-s * DELAY)
        left = s**2 + 9.81 / LENGTH + force / MASS
        assert abs(left) < 1e-6 * abs(s**2)


def test_a_path_from_the_ground_keeps_five_equal_poles_and_moves_none():
    _, found = find(DESIGN + FORWARD)
    _, alone = find(DESIGN + "damper = 1.0\n")
    forward = np.array([one.startswith("loop forward") for one in found.state])
    own = np.sort_complex(found.value[forward]) / (2 * np.pi)
    np.testing.assert_allclose(own, [-1.0] * 5 + [-0.5 + 2.0j], rtol=1e-15)
    np.testing.assert_allclose(found.value[~forward], alone.value, rtol=1e-12)


def test_both_are_damped_by_the_command():
    for text in (LATE, FORWARD):
        damped = sus.damp(
            sus.parse(DESIGN + text), fidelity="string", frequency=[1.0], duration=1.0
        )
        assert damped.stable
