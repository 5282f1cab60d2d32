"""Exact dynamic stiffness of a beam under tension, without overflow or cancellation.

>>> frequency = np.array([300.0, 320.0, 330.0])  # the string alone has 316.2 Hz
>>> wave = waves(rigidity=1e-3, tension=100.0, mass=1e-3, half=0.25, omega=2 * np.pi * frequency)
>>> resonances_below(wave)
array([0, 0, 1])

A wire of bending stiffness EI, tension T and mass per length mu vibrates at omega with

    EI w'''' - T w'' - mu omega^2 w = 0,
    w = A cosh(alpha x) + B cos(beta x) + A' sinh(alpha x) + B' sin(beta x),
    alpha^2 = (tau + sqrt(tau^2 + 4 m)) / 2,   beta^2 = m / alpha^2,
    tau = T / EI,   m = mu omega^2 / EI.

With x from the middle, the motion of the two ends splits into an even part (both ends move alike:
W; their slopes are opposite: T_s) and an odd part (W_a, T_a), each the mirror image of one half.
Solving one half of length h = L/2 for A and B from W and T at x = h gives, with
t = tanh(alpha h), c = cos(beta h), s = sin(beta h),

    D = beta s + alpha c t      0 at the even resonances of the clamped wire,
    N = s/beta - c t/alpha      0 at the odd ones;

    even:  WW = -EI alpha^2 beta^2 (alpha^2 + beta^2) (s/beta) (t/alpha) / D
           WT =  EI alpha^2 beta^2 N / D
           TT =  EI (alpha^2 + beta^2) c / D
    odd:   WW =  EI (alpha^2 + beta^2) c / N
           WT = -EI D / N
           TT =  EI (alpha^2 + beta^2) (s/beta) (t/alpha) / N.

The coordinates of the odd part are the slope of the chord, phi = W_a / h, and that of the ends
relative to it, d = T_a - phi:

    pp = T h + EI (alpha^2 + beta^2) (h c - s/beta) (h - t/alpha) / N
    pd = EI [alpha^2 (t/alpha) (s/beta - h c) - beta^2 (s/beta) (h - t/alpha)] / N
    dd = TT.

So the loss of digits in a wire that turns as a whole, and EI / h^3, which would swamp the tension
in a short beam, do not appear; T h, which does not depend on frequency, is left out. All are even
functions of alpha and beta, so the static limit beta = 0 is no special case. Only tanh(alpha h)
appears, so nothing overflows. N = (s/beta - h c) + c (h - t/alpha), a sum of positive numbers below
the first resonance, each with a power series where it would cancel. Howson and Williams, J. Sound
Vib. 26, 503 (1973), give the elements of the whole beam with cosh and sinh of alpha L; the split
into halves preserves the digits.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Inexact, Int

EPS = 2.0**-53
TERMS = 9
"""Terms of a power series for |u| < 1 whose next one is below a rounding error."""
ELEMENT_PLACES = ((0, 0), (0, 1), (1, 1), (2, 2), (2, 3), (3, 3))
"""Places of the elements from `stiffness` in the symmetric matrix on (W, T_s, phi, d)."""


class Waves(NamedTuple):
    """Functions of the wave numbers of a wire; sections may be an axis before the frequencies."""

    half: Inexact[np.ndarray, "*#shape"] | float  # h, m
    alpha2: Inexact[np.ndarray, "*shape"]  # squares of the evanescent and the propagating wave
    beta2: Inexact[np.ndarray, "*shape"]  # number, 1/m^2; complex with loss
    tanh: Inexact[np.ndarray, "*shape"]  # tanh(alpha h) / alpha, m
    sin: Inexact[np.ndarray, "*shape"]  # sin(beta h) / beta, m
    cos: Inexact[np.ndarray, "*shape"]  # cos(beta h)
    lag: Inexact[np.ndarray, "*shape"]  # h - tanh(alpha h) / alpha, m
    behind: Inexact[np.ndarray, "*shape"]  # sin(beta h) / beta - h cos(beta h), m
    even: Inexact[np.ndarray, "*shape"]  # D, 1/m
    odd: Inexact[np.ndarray, "*shape"]  # N, m


def waves(
    rigidity: Inexact[np.ndarray, "*#shape"] | complex,
    tension: Inexact[np.ndarray, "*#shape"] | float,
    mass: Inexact[np.ndarray, "*#shape"] | complex,
    half: Inexact[np.ndarray, "*#shape"] | float,
    omega: Inexact[np.ndarray, "*#shape"],
) -> Waves:
    """Compute the waves of a wire.

    `rigidity` is EI in N m^2, above 0; complex, EI (1 + i phi), with loss. `mass` is that per
    length, kg/m; complex, mu - i b / omega, with a drag b per length; 0 for a wire without inertia.
    `omega` is in rad/s; complex to differentiate by a complex step.
    """
    tau = tension / rigidity
    m = mass * omega**2 / rigidity
    alpha2 = (tau + np.sqrt(tau**2 + 4 * m)) / 2
    if np.any(still := alpha2 == 0):
        # without tension and at rest alpha = 0: any tiny alpha gives the limit
        alpha2 = np.where(still, (1e-8 / half) ** 2, alpha2)
    beta2 = m / alpha2
    alpha = np.sqrt(alpha2)
    beta = np.sqrt(beta2)
    sinc, cos = sinc_cos(beta * half)
    tanh, gap = tanhc(alpha * half)
    lag = alpha2 * half**3 * gap
    tanh = half * tanh
    sin = half * sinc
    behind = half * sinc_gap(beta * half, sinc, cos)
    even = _sum_or_rounding(beta2 * sin, alpha2 * cos * tanh)
    odd = _sum_or_rounding(behind, cos * lag)
    return Waves(half, alpha2, beta2, tanh, sin, cos, lag, behind, even, odd)


def _sum_or_rounding(
    a: Inexact[np.ndarray, "*shape"], b: Inexact[np.ndarray, "*shape"]
) -> Inexact[np.ndarray, "*shape"]:
    """Add two numbers; a sum of exactly 0 (clamped resonance) becomes a rounding error of them."""
    total = a + b
    zero = total == 0
    return np.where(zero, EPS * (np.abs(a) + np.abs(b)), total) if np.any(zero) else total


def stiffness(
    rigidity: Inexact[np.ndarray, "*#shape"] | complex, wave: Waves
) -> list[Inexact[np.ndarray, "*shape"]]:
    """Dynamic stiffness in one plane, as the elements of q^T F q / 2 with q = (W, T_s, phi, d).

    For displacements w and slopes w' of the upper (1) and the lower end (2), W = (w_1 + w_2) / 2,
    T_s = (w'_2 - w'_1) / 2, phi = (w_2 - w_1) / L, d = (w'_1 + w'_2) / 2 - phi. The stiffness T L
    of the chord against turning is left out.

    `rigidity` is EI as given to `waves`. The elements are at `ELEMENT_PLACES`: N/m, N and N m for
    WW, WT and TT; N m for the odd ones.
    """
    product = wave.alpha2 * wave.beta2
    sum2 = wave.alpha2 + wave.beta2
    bent = sum2 * wave.sin * wave.tanh
    even = 2 * rigidity / wave.even
    odd = 2 * rigidity / wave.odd
    return [
        -even * product * bent,
        even * product * wave.odd,
        even * sum2 * wave.cos,
        -odd * sum2 * wave.behind * wave.lag,
        odd * (wave.alpha2 * wave.tanh * wave.behind - wave.beta2 * wave.sin * wave.lag),
        odd * bent,
    ]


def resonances_below(wave: Waves) -> Int[np.ndarray, "*shape"]:
    """Count the resonances of the clamped wire below each omega of its waves, without loss.

    The even ones are the zeros of D, tan(beta h) = -(alpha / beta) tanh(alpha h), one in each ((k -
    1/2) pi, k pi) of beta h; the odd ones those of N, tan(beta h) = (beta / alpha) tanh(alpha h) <
    1, one in each (k pi, (k + 1/2) pi), for k = 1, 2, ... .
    """
    quarter = np.floor(2 * (np.sqrt(wave.beta2) * wave.half / np.pi)).astype(int)
    even = (quarter + 1) // 2
    odd = quarter // 2
    # in an interval that contains a resonance, the sign of D or N shows if omega is above it
    in_even = quarter % 2 == 1
    in_odd = (quarter % 2 == 0) & (quarter > 0)
    even = even - (in_even & (wave.even * (-1) ** even < 0))
    odd = odd - (in_odd & (wave.odd * (-1) ** odd < 0))
    return even + odd


def sinc_cos(
    z: Inexact[np.ndarray, "*shape"],
) -> tuple[Inexact[np.ndarray, "*shape"], Inexact[np.ndarray, "*shape"]]:
    """sin(z)/z and cos(z); `numpy.sinc` takes z/pi, whose rounding counts at large z.

    Not finite far from the real axis, where a search for poles may stray and is then lost.
    """
    zero = z == 0
    with np.errstate(over="ignore", invalid="ignore"):
        return np.where(zero, 1.0, np.sin(z) / np.where(zero, 1.0, z)), np.cos(z)


def tanhc(
    u: Inexact[np.ndarray, "*shape"],
) -> tuple[Inexact[np.ndarray, "*shape"], Inexact[np.ndarray, "*shape"]]:
    """tanh(u)/u and (1 - tanh(u)/u) / u^2, without cancellation, for Re u >= 0."""
    near = np.abs(u) < 1
    far = np.where(near, 1.0, u)
    ratio = np.tanh(far) / far
    gap = (1 - ratio) / far**2
    if np.any(near):
        u = np.broadcast_to(u, ratio.shape)[near]
        gap[near] = _gap_series(u * u) / np.cosh(u)
        ratio[near] = 1 - u * u * gap[near]
    return ratio, gap


def sinc_gap(
    u: Inexact[np.ndarray, "*shape"],
    sinc: Inexact[np.ndarray, "*shape"],
    cos: Inexact[np.ndarray, "*shape"],
) -> Inexact[np.ndarray, "*shape"]:
    """sin(u)/u - cos(u), from both and, where they cancel, from u."""
    near = np.abs(u) < 1
    result = sinc - cos
    if np.any(near):
        square = u[near] ** 2
        result[near] = square * _gap_series(-square)
    return result


def _gap_series(square: Inexact[np.ndarray, "*shape"]) -> Inexact[np.ndarray, "*shape"]:
    """(cosh u - sinh(u)/u) / u^2, the sum of 2k u^(2k-2) / (2k + 1)!, for |u| < 1."""
    total = np.zeros_like(square)
    for k in range(TERMS, 0, -1):
        total = total * square + 2 * k / math.factorial(2 * k + 1)
    return total
