"""Viscous damping by eddy currents, from the geometry of magnet and conductor.

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

if TYPE_CHECKING:
    from jaxtyping import Inexact

MU_0 = 4e-7 * np.pi
"""Magnetic constant, H/m."""


def axial_damping(
    shape: str, moment: float, conductivity: float, thickness: float, gap: float
) -> float:
    """Damping (N s/m) of motion along the dipole's axis.

    Parameters
    ----------
    shape : {"plate", "tube"}
    moment
        A m^2.
    conductivity
        S/m.
    thickness, gap
        Thickness of the plate or the tube's wall; distance to the plate, or inner radius, m.

    Examples
    --------
    >>> round(axial_damping("plate", 1.0, 5.8e7, 5e-3, 10e-3), 3)
    0.321
    """
    depth = 1 / gap**3 - 1 / (gap + thickness) ** 3
    strength = MU_0**2 * moment**2 * conductivity * depth
    return strength / (64 * np.pi) if shape == "plate" else 15 * strength / 1024


def damping_matrix(
    shape: str, axis: int, moment: float, conductivity: float, thickness: float, gap: float
) -> Inexact[np.ndarray, "6 6"]:
    """Damping (6, 6) at the magnet along the dipole's axis and, by a plate, across it, N s/m."""
    along = axial_damping(shape, moment, conductivity, thickness, gap)
    across = along / 2 if shape == "plate" else 0.0 * along
    return np.diag([along if n == axis else across for n in range(3)] + [0.0 * along] * 3)
