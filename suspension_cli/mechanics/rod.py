"""The exact dynamic stiffness of a rod that is stretched or twisted, and of a string without bending stiffness.

    S u'' + mu omega^2 u = 0:    S = EA for stretching (u in m), GJ for twisting (rad), T for a string pulled across (m),

with the even motion of the ends U_s = (u_1 + u_2)/2 and the odd one U_a = (u_2 - u_1)/2, kappa^2 = mu omega^2 / S and h = L/2:

    even: -2 S kappa tan(kappa h),    odd: 2 S kappa / tan(kappa h)      (any text on vibrations).
"""

from __future__ import annotations

from typing import Any

import numpy as np


def stiffness(rigidity: Any, mass: Any, half: float, omega: Any) -> Any:
    """Dynamic stiffness (2, f), the elements of F_s U_s^2 / 2 + F_a U_a^2 / 2.

    Parameters
    ----------
    rigidity : (f,) array or float
        S in N (stretching, string) or N m^2 (twisting); complex with loss.
    mass : (f,) array or float
        A length: kg/m, or kg m for twisting; 0 without inertia.
    half : float
        m.
    omega : (f,) array
        rad/s.
    """
    square = mass * omega**2 / rigidity + 0 * omega
    angle = np.sqrt(square) * half
    through = np.tan(angle) / np.where(angle == 0, 1.0, angle)
    through = np.where(angle == 0, 1.0, through)  # tan(kappa h) / (kappa h)
    return np.stack([-2 * rigidity * square * half * through, 2 * rigidity / half / through])


def strained(rigidity: Any, mass: Any, half: float, omega: Any, ends: Any) -> Any:
    """Integral (r, f) of |u'|^2 along the rod, for U_s and U_a (2, r, f) of r motions."""
    square = mass * omega**2 / rigidity + 0 * omega
    kappa = np.sqrt(square + 0j)
    re, im = kappa.real * half, kappa.imag * half
    swell, wave = np.where(im == 0, 1.0, np.sinh(2 * im) / np.where(im == 0, 1.0, 2 * im)), np.sinc(2 * re / np.pi)
    cos2, sinc2 = np.abs(np.cos(kappa * half)) ** 2, np.abs(_sinc(kappa * half)) ** 2
    even = np.abs(kappa) ** 2 * half * (swell - wave) / cos2
    odd = (swell + wave) / (half * sinc2)
    return np.abs(ends[0]) ** 2 * even + np.abs(ends[1]) ** 2 * odd


def resonances_below(rigidity: float, mass: float, half: float, omega: Any) -> Any:
    """How many resonances (f,) of the rod with both ends held lie below each omega: kappa L = pi, 2 pi, ..."""
    return np.ceil(np.sqrt(mass / rigidity) * np.asarray(omega) * 2 * half / np.pi - 1).clip(0).astype(int)


def _sinc(z: Any) -> Any:
    safe = np.where(z == 0, 1.0, z)
    return np.where(z == 0, 1.0, np.sin(safe) / safe)
