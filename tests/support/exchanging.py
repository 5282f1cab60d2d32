"""A small mirror whose pitch and pendulum modes exchange their character, in closed form.

On two wires of length l, with their lower ends at the height d over the centre of mass (string
model), the energies of the displacement x of this and the pitch theta are

    m g (x + d theta)^2 / 2 l + m g d theta^2 / 2    and    m v^2 / 2 + I w^2 / 2.
"""

from __future__ import annotations

import numpy as np

MASS, RADIUS, LENGTH, WIRE, G = 0.05, 0.0254, 0.0112, 0.2, 9.81
D = "stage.test.wires.d"
SMALL = f"""
[design]
name = "small"

[[stage]]
name = "test"
body = {{ shape = "cylinder", axis = "x", radius = {RADIUS}, length = {LENGTH}, mass = {MASS} }}

[stage.wires]
count = 2
l = {WIRE}
s = 0.0
t1 = {RADIUS}
t2 = {RADIUS}
d = 2e-3
material = "tungsten"
radius = 25e-6
"""


def pendulum_and_pitch(d):
    """omega^2 (2,) ascending, (rad/s)^2, and the fractions (2,) of kinetic energy in pitch."""
    inertia = MASS * (RADIUS**2 / 4 + LENGTH**2 / 12)
    stiffness = MASS * G * np.array([[1, d], [d, d * d + d * WIRE]]) / WIRE
    root = 1 / np.sqrt([MASS, inertia])
    squared, vectors = np.linalg.eigh(root[:, None] * stiffness * root)
    return squared, vectors[1] ** 2


def pitch(d):
    """Frequency of the mode that is mostly pitch, Hz; NaN where it grows."""
    squared, part = pendulum_and_pitch(d)
    own = squared[part.argmax()]
    return np.sqrt(own) / (2 * np.pi) if own >= 0 else np.nan
