"""Damping of a magnet by the eddy currents that it induces in a conductor.

The magnet is a dipole m along an axis. The field of the currents is small beside its own: the
velocity is far below 2 / (mu_0 sigma t), and the conductor thinner than its skin depth. A velocity
v along the axis induces in the conductor, at the distance rho from the axis and z along it, the
electric field

    E_phi = v dA_phi/dz = -(3 mu_0 m / 4 pi) v rho z / (rho^2 + z^2)^(5/2),

whose currents dissipate the power c v^2, the integral of sigma E^2:

    plate from z = g to g + t:       c = mu_0^2 m^2 sigma / (64 pi) (1/g^3 - 1/(g + t)^3)
    tube from radius a to a + t:     c = 15 mu_0^2 m^2 sigma / 1024 (1/a^3 - 1/(a + t)^3)

For t << a the second is 45 mu_0^2 m^2 sigma t / (1024 a^4), known from a magnet that falls through
a pipe (wall thickness: Donoso, Ladera and Martin, Eur. J. Phys. 30, 855 (2009)). For motion across
the axis, along the plate, c is half as large: the drag on a dipole over a thin sheet from Maxwell's
receding images at low velocity (Saslow, Am. J. Phys. 60, 693 (1992)); the sheets of a thick plate
add up, as their currents are parallel to it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.links import EddyCurrent

if TYPE_CHECKING:
    from jaxtyping import Inexact

MU_0 = 4e-7 * np.pi
"""Magnetic constant, H/m."""


def eddy_damping(magnet: EddyCurrent) -> Inexact[np.ndarray, "6 6"]:
    """Damping (6, 6) at a magnet along the dipole's axis and, by a plate, across it, N s/m."""
    moment = magnet.moment
    if moment is None:
        assert magnet.remanence is not None and magnet.volume is not None
        moment = magnet.remanence * magnet.volume / MU_0
    depth = 1 / magnet.gap**3 - 1 / (magnet.gap + magnet.thickness) ** 3
    strength = magnet.count * MU_0**2 * moment**2 * magnet.conductivity * depth
    if magnet.shape == "plate":
        along = strength / (64 * np.pi)
        across = along / 2
    else:
        along = 15 * strength / 1024
        across = 0.0
    forces = [along if axis == magnet.axis else across for axis in "xyz"]
    torques = [0.0] * 3
    return np.diag(forces + torques)
