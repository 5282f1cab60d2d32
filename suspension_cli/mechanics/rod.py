"""The exact dynamic stiffness of a rod that is stretched or twisted, and of a string without bending stiffness.

    S u'' + mu omega^2 u = 0:    S = EA for stretching (u in m), GJ + T I_p/A for twisting (rad), T for a string pulled across (m),

with the even motion of the ends U_s = (u_1 + u_2)/2 and the odd one U_a = (u_2 - u_1)/2, kappa^2 = mu omega^2 / S and h = L/2:

    even: -2 S kappa tan(kappa h),    odd: 2 S kappa / tan(kappa h)      (any text on vibrations).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.mechanics import curvature

DEEP = 300.0
"""Im(kappa h) above which a motion of one end does not reach the other, to rounding."""


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


def squared(rigidity: Any, mass: Any, half: float, omega: Any, ends: Any) -> tuple[Any, Any]:
    """Integrals (r, f) of |u'|^2 and of |u|^2 along the rod, for U_s and U_a (2, r, f) of r motions.

    u = U_s cos(kappa x)/cos(kappa h) + U_a sin(kappa x)/sin(kappa h), with x from the middle; the products of even and odd parts integrate to 0.
    """
    square = mass * omega**2 / rigidity + 0 * omega
    whole: Any = np.sqrt(square + 0j) * half
    size2, deep = np.abs(whole) ** 2, np.abs(whole.imag) > DEEP
    angle: Any = np.where(deep, 1.0, whole)
    still = size2 == 0
    # 1/h times the integrals of |cos(kappa x)|^2 and |sin(kappa x)|^2, and of the latter over |kappa h|^2
    cosine = curvature.sinhc(2 * angle.imag) + np.sinc(2 * angle.real / np.pi)
    sine = curvature.gap(2 * angle.real, 2 * angle.imag)
    slow_sine = np.where(still, 2 / 3, sine / np.where(still, 1.0, size2))
    even, odd = np.abs(ends[0]) ** 2, np.abs(ends[1]) ** 2
    over_cos, over_sin = 1 / np.abs(np.cos(angle)) ** 2, 1 / np.abs(_sinc(angle)) ** 2
    # what dies away along the rod: both kinds of integrals over |cos|^2 and |sin|^2 are 1 / Im(kappa h)
    gone = 1 / np.where(deep, np.abs(whole.imag), 1.0)
    strained = even * np.where(deep, size2 * gone, size2 * sine * over_cos) + odd * np.where(deep, size2 * gone, cosine * over_sin)
    moved = even * np.where(deep, gone, cosine * over_cos) + odd * np.where(deep, gone, slow_sine * over_sin)
    return strained / half, moved * half


def resonances_below(rigidity: float, mass: float, half: float, omega: Any) -> Any:
    """How many resonances (f,) of the rod with both ends held lie below each omega: kappa L = pi, 2 pi, ..."""
    return np.ceil(np.sqrt(mass / rigidity) * np.asarray(omega) * 2 * half / np.pi - 1).clip(0).astype(int)


def _sinc(z: Any) -> Any:
    safe = np.where(z == 0, 1.0, z)
    return np.where(z == 0, 1.0, np.sin(safe) / safe)
