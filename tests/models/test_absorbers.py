"""Absorbers, stages on springs: Den Hartog's closed forms, and the bounce mode of a pendulum."""

from __future__ import annotations

import numpy as np
import pytest

import suspension_cli as sus

RATIO = 0.05
MASS = 10.0
F0 = 3.0
STIFF = (2 * np.pi * F0) ** 2 * MASS


def absorber(damping: float, loss_angle: float = 0.0) -> sus.Design:
    """A mass on a spring along z, with an absorber of the optimum frequency."""
    soft = (2 * np.pi * F0 / (1 + RATIO)) ** 2 * RATIO * MASS
    return sus.parse(f"""
[design]
name = "absorber"
[[stage]]
name = "primary"
mirror = true
position = [0.0, 0.0, -0.1]
body = {{ mass = {MASS}, inertia = [0.1, 0.1, 0.1] }}
spring = [{{ stiffness = [1e5, 1e5, {STIFF!r}, 1e4, 1e4, 1e4] }}]
[[stage]]
name = "absorber"
position = [0.0, 0.0, -0.1]
body = {{ mass = {RATIO * MASS}, inertia = [1e-3, 1e-3, 1e-3] }}
[[stage.spring]]
stiffness = [1e5, 1e5, {soft!r}, 1e4, 1e4, 1e4]
damping = [0.0, 0.0, {float(damping)!r}, 0.0, 0.0, 0.0]
loss_angle = {loss_angle!r}
""")


def amplification(design: sus.Design, frequency: np.ndarray) -> np.ndarray:
    """Response of the primary to a force on it, over its static one without an absorber."""
    found = sus.response(
        design, inputs="primary.force_z", outputs="primary.z", frequency=frequency.tolist()
    )
    return STIFF * np.abs(np.squeeze(found.value))


@pytest.mark.parametrize("share", [0.3, 1.0, 2.0])
def test_fixed_points_do_not_depend_on_the_damping(share):
    """g^2 = (1 -+ sqrt(mu / (2 + mu))) / (1 + mu), where the response is sqrt(1 + 2 / mu)."""
    optimum = np.sqrt(3 * RATIO / (8 * (1 + RATIO) ** 3))
    damping = share * optimum * 2 * RATIO * MASS * 2 * np.pi * F0
    root = np.sqrt(RATIO / (2 + RATIO))
    fixed = F0 * np.sqrt(np.array([1 - root, 1 + root]) / (1 + RATIO))
    peaks = amplification(absorber(damping), fixed)
    np.testing.assert_allclose(peaks, np.sqrt(1 + 2 / RATIO), rtol=1e-9)


def test_peak_of_the_optimum():
    """With the optimum damping no response is more than 1 % above that of the fixed points."""
    damping = np.sqrt(3 * RATIO / (8 * (1 + RATIO) ** 3)) * 2 * RATIO * MASS * 2 * np.pi * F0
    found = amplification(absorber(damping), np.linspace(2.0, 4.0, 400))
    assert 1.0 <= found.max() / np.sqrt(1 + 2 / RATIO) < 1.01


def test_lossy_spring_is_that_of_two_coupled_oscillators():
    frequency = np.linspace(2.0, 4.0, 21)
    angle = 0.2
    square = (2 * np.pi * frequency) ** 2
    mass = RATIO * MASS
    k = (2 * np.pi * F0 / (1 + RATIO)) ** 2 * mass * (1 + 1j * angle)
    dynamic = STIFF - MASS * square - mass * square * k / (k - mass * square)
    found = amplification(absorber(0.0, angle), frequency)
    np.testing.assert_allclose(found, np.abs(STIFF / dynamic), rtol=1e-9)


def test_bounce_mode_of_the_example():
    """A mode of Q 5000 becomes two of about 50, as the closed form of the optimum says."""
    without = sus.modes(sus.example("double"))
    damped = sus.modes(sus.example("bounce-absorber"))
    [bounce] = [
        q for q, name in zip(without.q, without.label, strict=True) if name == "test vertical"
    ]
    split = [
        q
        for q, name in zip(damped.q, damped.label, strict=True)
        if name.startswith("absorber vert")
    ]
    assert len(split) == 2 and max(split) < 60 < 1000 < bounce
