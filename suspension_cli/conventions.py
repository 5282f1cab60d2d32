"""Names and orders that every part agrees on.

A body has six coordinates at its centre of mass, in this order: x (longitudinal, along the beam),
y (transverse), z (vertical, up), roll, pitch, yaw (right-handed rotations about x, y, z).
"""

from __future__ import annotations

DOFS = ("x", "y", "z", "roll", "pitch", "yaw")
"""A body's coordinates, in order: three displacements in m, three rotations in rad."""

WORDS = {
    "x": "longitudinal",
    "y": "transverse",
    "z": "vertical",
    "roll": "roll",
    "pitch": "pitch",
    "yaw": "yaw",
}
"""The field's word for each coordinate (Husman et al. call them longitudinal, sideways, vertical, roll, tilt, rotation)."""

WIRE_WORDS = {"violin-x": "violin longitudinal", "violin-y": "violin transverse", "stretch": "wire stretching", "twist": "wire twisting"}
"""What a wire with mass can do by itself: vibrate in its two principal planes (the first is the one nearest to x), stretch, twist."""

PAPER_WORDS = {"x": "longitudinal", "y": "sideways", "z": "vertical", "roll": "roll", "pitch": "tilt", "yaw": "rotation"}
"""The paper's word for each coordinate."""

SUPPORT = "support"
"""The suspension point structure: its six motions are inputs."""

PARITY_X = (-1, 1, 1, 1, -1, -1)
"""Sign that each coordinate takes when the scene is mirrored in x (x to -x): displacements are
polar vectors, rotations axial ones."""

PARITY_Y = (1, -1, 1, -1, 1, -1)
"""Sign that each coordinate takes when the scene is mirrored in y (y to -y)."""

BOLTZMANN = 1.380649e-23
"""Boltzmann's constant in J/K (exact since 2019)."""

AVOGADRO = 6.02214076e23
"""Avogadro's constant in 1/mol (exact since 2019)."""
