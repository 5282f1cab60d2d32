"""Exact dynamic stiffness of a rod that is stretched or twisted, or of a string without bending.

    S u'' + mu omega^2 u = 0:   S = EA for stretching (u in m), GJ + T I_p/A for twisting (u in
                                rad), T for a string displaced across itself (u in m).

With the even motion of the ends U_s = (u_1 + u_2)/2, the odd one U_a = (u_2 - u_1)/2,
kappa^2 = mu omega^2 / S and h = L/2, the stiffness is diagonal (any text on vibrations):

    even: -2 S kappa tan(kappa h),    odd: 2 S kappa / tan(kappa h).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.functions import tan

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact, Int


def stiffness(
    rigidity: Inexact[np.ndarray, "*#shape"] | complex,
    mass: Inexact[np.ndarray, "*#shape"] | complex,
    half: Inexact[np.ndarray, "*#shape"] | float,
    omega: Inexact[np.ndarray, "*#shape"],
) -> Inexact[np.ndarray, "2 ..."]:
    """Dynamic stiffness, the elements F_s and F_a of (F_s U_s^2 + F_a U_a^2) / 2.

    Parameters
    ----------
    rigidity
        S, N (stretching, string) or N m^2 (twisting); complex with loss.
    mass
        Inertia per length: kg/m, or kg m for twisting; 0 without inertia.
    half
        Half the length, m.
    omega
        rad/s. Sections of a rod may be an axis in front of the frequencies.

    Returns
    -------
    (2, ...) array
        N/m or N m/rad.
    """
    kappa2 = mass * omega**2 / rigidity + 0 * omega
    angle = np.sqrt(kappa2) * half
    zero = angle == 0
    tanc = tan(angle) / np.where(zero, 1.0, angle)
    tanc = np.where(zero, 1.0, tanc)  # tan(kappa h) / (kappa h)
    return np.stack([-2 * rigidity * kappa2 * half * tanc, 2 * rigidity / half / tanc])


def resonances_below(
    rigidity: Float[np.ndarray, "*#shape"] | float,
    mass: Float[np.ndarray, "*#shape"] | float,
    half: Float[np.ndarray, "*#shape"] | float,
    omega: Float[np.ndarray, "*#shape"] | float,
) -> Int[np.ndarray, "*shape"]:
    """Count the resonances of the clamped rod below each omega (rad/s), at kappa L = pi, 2 pi, ...
    .

    Arguments as for `stiffness`, without loss.
    """
    turns = np.sqrt(mass / rigidity) * np.asarray(omega) * 2 * half / np.pi
    return np.ceil(turns - 1).clip(0).astype(int)
