"""Names, orders and signs of coordinates, and constants of nature.

A body has six coordinates at its centre of mass, in this order: x (longitudinal, along the beam),
y (transverse), z (vertical, up), roll, pitch, yaw (right-handed rotations about x, y, z).
"""

from __future__ import annotations

import os

DOFS = ("x", "y", "z", "roll", "pitch", "yaw")
DOF_UNITS = ("m", "m", "m", "rad", "rad", "rad")
"""A body's coordinates, in order: three displacements in m, three rotations in rad."""

DOF_NAMES = {
    "x": "longitudinal",
    "y": "transverse",
    "z": "vertical",
    "roll": "roll",
    "pitch": "pitch",
    "yaw": "yaw",
}
"""Name of each coordinate in the field."""

DOF_BY_NAME = {name: dof for dof, name in DOF_NAMES.items()} | {dof: dof for dof in DOFS}
"""Coordinate by its name in the field, as tables print it (longitudinal), and by its own (x)."""

BUILDS_AT_ONCE = 600
"""Builds, or points of a sweep, that are computed at once: their arrays fit into a cache.

No power of 2: of an array whose rows have such a distance a cache keeps few, so that transposing it
takes six times as long.
"""

WIRE_MODE_NAMES = {
    "violin-x": "violin longitudinal",
    "violin-y": "violin transverse",
    "stretch": "wire stretching",
    "twist": "wire twisting",
    "light": "light",
}
"""Name of each kind of internal mode of a wire, and of the light of a cavity. The first of the two
principal planes of a wire is the one nearest to x."""

SUPPORT = "support"
"""The suspension point structure: its six motions are inputs."""
FRAME = "frame"
"""The support structure, if compliant: ``frame.z`` is its motion relative to the ground."""

BETWEEN = "~"
"""Separates the names of two bodies in a signal: ``test~reaction.force_x``."""
GROUND = "ground"
"""The ground beside the support, where links and dampers may end; its motions are inputs."""

PARITY_X = (-1, 1, 1, 1, -1, -1)
"""Factor of each coordinate in the mirror image x -> -x: displacements are polar vectors, rotations
axial ones."""

PARITY_Y = (1, -1, 1, -1, 1, -1)
"""Factor of each coordinate in the mirror image y -> -y."""

BOLTZMANN = 1.380649e-23
"""Boltzmann's constant in J/K (exact since 2019)."""

AVOGADRO = 6.02214076e23
"""Avogadro's constant in 1/mol (exact since 2019)."""


def _analyses() -> tuple[str, ...]:
    """List the folders of `analyses/` with a command, in the order of their presentation."""
    order = "modes response thermal compare budget sweep sensitivity fit optimise xcouple"
    known = [*order.split(), "tolerance", "tradeoff", "damp", "simulate", "export"]
    folder = os.path.join(os.path.dirname(__file__), "analyses")
    found = (
        entry.name
        for entry in os.scandir(folder)
        if os.path.isfile(os.path.join(entry.path, "command.py"))
    )
    return tuple(sorted(found, key=lambda n: (known.index(n) if n in known else len(known), n)))


ANALYSES = _analyses()
"""Names of the analyses: of their folders, commands and `[analysis]` tables."""
