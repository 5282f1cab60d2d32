"""Exact dynamic stiffness of a rod that is stretched or twisted, or of a string without bending.

    S u'' + mu omega^2 u = 0:   S = EA for stretching (u in m), GJ + T I_p/A for twisting (u in
                                rad), T for a string displaced across itself (u in m).

With the even motion of the ends U_s = (u_1 + u_2)/2, the odd one U_a = (u_2 - u_1)/2,
kappa^2 = mu omega^2 / S and h = L/2, the stiffness is diagonal (any text on vibrations):

    even: -2 S kappa tan(kappa h),    odd: 2 S kappa / tan(kappa h).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.elements.functions import sin_cos, sinc, sinhc, sinhc_minus_sinc, tan

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact, Int

DEEP = 300.0
"""Im(kappa h) above which the motion of one end vanishes, within rounding, at the other."""


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


def square_integrals(
    rigidity: Inexact[np.ndarray, "*#shape"] | complex,
    mass: Inexact[np.ndarray, "*#shape"] | complex,
    half: float,
    omega: Float[np.ndarray, "*#shape"],
) -> tuple[
    tuple[Float[np.ndarray, "*shape"], Float[np.ndarray, "*shape"]],
    tuple[Float[np.ndarray, "*shape"], Float[np.ndarray, "*shape"]],
]:
    """Integrals of |u'|^2 and of |u|^2 along the rod for U_s = 1 and for U_a = 1: (2, f) each.

    u = U_s cos(kappa x)/cos(kappa h) + U_a sin(kappa x)/sin(kappa h), with x from the middle;
    products of even and odd parts integrate to 0. Arguments as for `stiffness`.
    """
    kappa2 = mass * omega**2 / rigidity + 0 * omega
    kappa_h: Any = np.sqrt(kappa2 + 0j) * half
    size2, deep = kappa_h.real**2 + kappa_h.imag**2, np.abs(kappa_h.imag) > DEEP
    some_deep, static = np.any(deep), size2 == 0
    a, b = kappa_h.real, kappa_h.imag
    if some_deep:
        a, b = np.where(deep, 1.0, a), np.where(deep, 0.0, b)
    (sin, cos), sinh = sin_cos(a), np.sinh(b)
    # |cos(kappa h)|^2 and |sin(kappa h)|^2
    outer_cos2, outer_sin2 = cos**2 + sinh**2, sin**2 + sinh**2
    # 1/h times the integrals of |cos(kappa x)|^2 and of |sin(kappa x)|^2
    cos2, sin2 = sinhc(2 * b) + sinc(2 * a), sinhc_minus_sinc(2 * a, 2 * b)
    even_strain = size2 * sin2 / outer_cos2
    if np.any(static):  # sin2 / outer_sin2 tends to 2/3, size2 / outer_sin2 to 1
        sin2, size2 = np.where(static, 2 / 3, sin2), np.where(static, 1.0, size2)
        outer_sin2 = np.where(static, 1.0, outer_sin2)
    found = (even_strain, cos2 * size2 / outer_sin2, cos2 / outer_cos2, sin2 / outer_sin2)
    if some_deep:  # of a motion that decays along the rod every such ratio is 1 / Im(kappa h)
        decay = 1 / np.where(deep, np.abs(kappa_h.imag), 1.0)
        limit = (size2 * decay, size2 * decay, decay, decay)
        found = [np.where(deep, deeply, own) for deeply, own in zip(limit, found, strict=True)]
    even_strain, odd_strain, even, odd = found
    return (even_strain / half, odd_strain / half), (even * half, odd * half)


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
