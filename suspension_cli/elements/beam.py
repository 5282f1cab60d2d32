"""Exact dynamic stiffness of a beam under tension, without overflow or cancellation.

A wire of bending stiffness EI, tension T and mass per length mu vibrates at omega with

    EI w'''' - T w'' - mu omega^2 w = 0,
    w = A cosh(alpha x) + B cos(beta x) + A' sinh(alpha x) + B' sin(beta x),
    alpha^2 = (tau + sqrt(tau^2 + 4 m)) / 2,   beta^2 = m / alpha^2,
    tau = T / EI,   m = mu omega^2 / EI.

With x from the middle, the motion of the two ends splits into an even part (both ends move alike:
W_s; their slopes are opposite: T_s) and an odd part (W_a, T_a), each the mirror image of one half.
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

All are even functions of alpha and beta, so the static limit beta = 0 is no special case. Only
tanh(alpha h) appears, so nothing overflows. Below the first resonance only the two terms of N
differ in sign; in a stiff wire at low frequency they cancel to (alpha^2 + beta^2) h^3/3, so its
power series is summed there. Howson and Williams, J. Sound Vib. 26, 503 (1973), give the elements
of the whole beam with cosh and sinh of alpha L; the split into halves preserves the digits.

Beams joined end to end have as coordinates the motion of the chord, W_s and the slope
phi = W_a / h, and the slopes a and b of the ends relative to it (`chord_stiffness`). EI / h^3,
which would swamp the tension in a short beam, then does not appear. With
d = T_a - phi = (a + b) / 2 and T_s = (b - a) / 2, the elements above give for the odd part

    pp = T h + EI (alpha^2 + beta^2) (h c - s/beta) (h - t/alpha) / N
    pd = EI [alpha^2 (t/alpha) (s/beta - h c) - beta^2 (s/beta) (h - t/alpha)] / N
    dd = TT.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.elements.functions import sinc_cos, tanh

if TYPE_CHECKING:
    from jaxtyping import Bool, Inexact, Int

EPS = 2.0**-53
SERIES = 1.0
"""|alpha^2 + beta^2| h^2 below which N is a series; above, the closed form loses a digit at
most."""
TERMS = 11
"""Terms of that series; they fall faster than 1/(2k)!."""
_FACTORIAL = [math.factorial(n) for n in range(2 * TERMS)]
COEFFICIENT = [
    [
        1 / (_FACTORIAL[2 * i] * _FACTORIAL[2 * j + 1])
        - 1 / (_FACTORIAL[2 * j] * _FACTORIAL[2 * i + 1])
        for j in range(TERMS)
    ]
    for i in range(TERMS)
]
"""Coefficients of p^i n^j in that series."""

EVEN_WW, EVEN_WT, EVEN_TT, ODD_WW, ODD_WT, ODD_TT = range(6)
"""Order of the elements from `stiffness`."""

ELEMENT_PLACES = ((0, 0), (0, 1), (1, 1), (2, 2), (2, 3), (3, 3))
"""Their places in the symmetric matrix on (W_s, T_s, W_a, T_a)."""
GAP_TERMS = 10
"""Terms of the series of cosh u - sinh(u)/u, for |u| < 1."""


@dataclass(frozen=True)
class Waves:
    """Wave numbers of a wire at given frequencies, and functions of them.

    Sections of a wire may be an axis in front of the frequencies.

    Attributes
    ----------
    half : float or array
        h, m.
    alpha, beta
        Evanescent and propagating wave number, 1/m; complex with loss.
    alpha2, beta2
        Their squares.
    tanh
        tanh(alpha h) / alpha, m.
    sin
        sin(beta h) / beta, m.
    cos
        cos(beta h).
    even, odd
        D (1/m) and N (m).
    """

    half: Inexact[np.ndarray, "*#shape"] | float
    alpha: Inexact[np.ndarray, "*shape"]
    beta: Inexact[np.ndarray, "*shape"]
    alpha2: Inexact[np.ndarray, "*shape"]
    beta2: Inexact[np.ndarray, "*shape"]
    tanh: Inexact[np.ndarray, "*shape"]
    sin: Inexact[np.ndarray, "*shape"]
    cos: Inexact[np.ndarray, "*shape"]
    even: Inexact[np.ndarray, "*shape"]
    odd: Inexact[np.ndarray, "*shape"]

    @cached_property
    def sections(self) -> list[Waves]:
        """Waves of each section, the first axis of all arrays."""
        names = [field.name for field in fields(self)]
        return [Waves(*(getattr(self, name)[n] for name in names)) for n in range(len(self.sin))]

    @cached_property
    def sum2(self) -> Inexact[np.ndarray, "*shape"]:
        """alpha^2 + beta^2, 1/m^2."""
        return self.alpha2 + self.beta2

    @cached_property
    def over_even(self) -> Inexact[np.ndarray, "*shape"]:
        """1/D, m."""
        return 1 / self.even

    @cached_property
    def over_odd(self) -> Inexact[np.ndarray, "*shape"]:
        """1/N, 1/m."""
        return 1 / self.odd

    @cached_property
    def cache(self) -> dict[str, Any]:
        """Integrals over these waves, for further motions of the wire."""
        return {}

    @cached_property
    def slow(self) -> Bool[np.ndarray, "*shape"]:
        """Whether the closed form of N cancels: stiff wire, low omega."""
        return np.abs(self.sum2) * self.half**2 < SERIES


def waves(
    rigidity: Inexact[np.ndarray, "*#shape"] | complex,
    tension: Inexact[np.ndarray, "*#shape"] | float,
    mass: Inexact[np.ndarray, "*#shape"] | complex,
    half: Inexact[np.ndarray, "*#shape"] | float,
    omega: Inexact[np.ndarray, "*#shape"],
) -> Waves:
    """Compute the waves of a wire.

    Parameters
    ----------
    rigidity
        EI in N m^2, above 0; complex, EI (1 + i phi), with loss.
    tension
        N, at least 0.
    mass
        Mass per length, kg/m; complex, mu - i b / omega, with a drag b per length; 0 for a wire
        without inertia.
    half : float or array
        Half the length, m.
    omega
        rad/s; complex to differentiate by a complex step.
    """
    tau, m = tension / rigidity, mass * omega**2 / rigidity
    alpha2 = (tau + np.sqrt(tau**2 + 4 * m)) / 2
    if np.any(still := alpha2 == 0):
        # without tension and at rest alpha = 0: any tiny alpha gives the limit
        alpha2 = np.where(still, (1e-8 / half) ** 2, alpha2)
    beta2 = m / alpha2
    alpha, beta = np.sqrt(alpha2), np.sqrt(beta2)
    sinc, cos = sinc_cos(beta * half)
    lag, sin = tanh(alpha * half) / alpha, half * sinc
    behind = cos * lag
    odd = sin - behind
    slow = np.abs(alpha2 + beta2) * half**2 < SERIES
    if np.any(slow):
        p, n = alpha2 * half**2, -beta2 * half**2
        series = _series(np.where(slow, p, 0), np.where(slow, n, 0))
        cosh = np.cosh(np.where(slow, alpha * half, 0))
        odd = np.where(slow, half * (p - n) * series / cosh, odd)
    a, b = beta2 * sin, alpha2 * behind
    even, odd = _avoid_zero(a, b, a + b), _avoid_zero(sin, behind, odd)
    return Waves(half, alpha, beta, alpha2, beta2, lag, sin, cos, even, odd)


def _avoid_zero(
    a: Inexact[np.ndarray, "*shape"],
    b: Inexact[np.ndarray, "*shape"],
    total: Inexact[np.ndarray, "*shape"],
) -> Inexact[np.ndarray, "*shape"]:
    """Replace a sum a + b that is exactly 0 (clamped resonance) by a rounding error of a and b."""
    zero = total == 0
    return np.where(zero, EPS * (np.abs(a) + np.abs(b)), total) if np.any(zero) else total


def stiffness(
    rigidity: Inexact[np.ndarray, "*#shape"] | complex, wave: Waves
) -> Inexact[np.ndarray, "6 ..."]:
    """Dynamic stiffness in one plane, as the elements of q^T F q / 2 with q = (W_s, T_s, W_a, T_a).

    For displacements w and slopes w' of the upper (1) and the lower end (2),
    W_s = (w_1 + w_2) / 2, W_a = (w_2 - w_1) / 2, T_s = (w'_2 - w'_1) / 2, T_a = (w'_1 + w'_2) / 2.

    Parameters
    ----------
    rigidity
        EI as given to `waves`, N m^2.

    Returns
    -------
    (6, ...) array
        From `EVEN_WW` to `ODD_TT`: N/m (WW), N (WT), N m (TT).
    """
    over_odd = wave.over_odd
    odd = (
        wave.sum2 * wave.cos * over_odd,
        -wave.even * over_odd,
        wave.sum2 * wave.sin * wave.tanh * over_odd,
    )
    twice = 2 * rigidity
    return np.stack([twice * element for element in _even_elements(wave) + odd])


def chord_stiffness(
    rigidity: Inexact[np.ndarray, "*#shape"] | complex,
    tension: Inexact[np.ndarray, "*#shape"] | float,
    wave: Waves,
) -> Inexact[np.ndarray, "4 4 *shape"]:
    """Dynamic stiffness (4, 4, ...) in one plane on (W_s, phi, a, b), N/m, N and N m.

    On the chord and the slopes of the ends relative to it; `rigidity` and `tension` as for `waves`.
    """
    h = wave.half
    p, n = -wave.beta2 * h**2, wave.alpha2 * h**2
    # h c - s/beta and h - t/alpha
    behind = np.where(np.abs(p) < 1, h * _gap_series(p), h * wave.cos - wave.sin)
    cosh = np.cosh(np.where(np.abs(n) < 1, wave.alpha * h, 0))
    lag = np.where(np.abs(n) < 1, h * _gap_series(n) / cosh, h - wave.tanh)
    ww, wt, tt = _even_elements(wave)
    over_odd = wave.over_odd
    pp = tension / rigidity * h + wave.sum2 * behind * lag * over_odd
    pd = -(wave.alpha2 * wave.tanh * behind + wave.beta2 * wave.sin * lag) * over_odd
    dd = wave.sum2 * wave.sin * wave.tanh * over_odd
    none, same, across = np.zeros_like(tt), (dd + tt) / 4, (dd - tt) / 4
    return (
        2
        * rigidity
        * np.array(
            [
                [ww, none, -wt / 2, wt / 2],
                [none, pp, pd / 2, pd / 2],
                [-wt / 2, pd / 2, same, across],
                [wt / 2, pd / 2, across, same],
            ]
        )
    )


def _even_elements(wave: Waves) -> tuple[Inexact[np.ndarray, "*shape"], ...]:
    """WW, WT and TT of the even motion over 2 EI."""
    product, over_even = wave.alpha2 * wave.beta2, wave.over_even
    return (
        -product * wave.sum2 * wave.sin * wave.tanh * over_even,
        product * wave.odd * over_even,
        wave.sum2 * wave.cos * over_even,
    )


def _gap_series(square: Inexact[np.ndarray, "*shape"]) -> Inexact[np.ndarray, "*shape"]:
    """cosh u - sinh(u)/u of u^2, the sum of 2k u^(2k) / (2k + 1)!, for |u| < 1; 0 above."""
    square = np.where(np.abs(square) < 1, square, 0)
    total = np.zeros_like(square)
    for k in range(GAP_TERMS, 0, -1):
        total = (total + 2 * k / math.factorial(2 * k + 1)) * square
    return total


def _series(
    p: Inexact[np.ndarray, "*shape"], n: Inexact[np.ndarray, "*shape"]
) -> Inexact[np.ndarray, "*shape"]:
    """(f0(p) f1(n) - f0(n) f1(p)) / (p - n), f0(z) = cosh sqrt z, f1(z) = sinh(sqrt z) / sqrt z.

    The product of their power series is the sum over i, j of
    (1/((2i)! (2j+1)!) - 1/((2j)! (2i+1)!)) p^i n^j, which is odd under i <-> j, and
    p^i n^j - p^j n^i = (p n)^j (p - n) (p^(k-1) + p^(k-2) n + ... + n^(k-1)) with k = i - j.
    """
    complete = [np.ones_like(p)]  # h_k = p^k + p^(k-1) n + ... + n^k
    power = np.ones_like(n)
    for _ in range(TERMS):
        power = power * n
        complete.append(p * complete[-1] + power)
    product = p * n
    total = np.zeros_like(p)
    for j in reversed(range(TERMS // 2)):
        inner = sum(
            (COEFFICIENT[i][j] * complete[i - j - 1] for i in range(j + 1, TERMS)), np.zeros_like(p)
        )
        total = total * product + inner
    return total


def resonances_below(wave: Waves) -> Int[np.ndarray, "*shape"]:
    """Count the resonances of the clamped wire below each omega of its waves, without loss.

    The even ones are the zeros of D, tan(beta h) = -(alpha / beta) tanh(alpha h), one in each ((k -
    1/2) pi, k pi) of beta h; the odd ones those of N, tan(beta h) = (beta / alpha) tanh(alpha h) <
    1, one in each (k pi, (k + 1/2) pi), for k = 1, 2, ... .
    """
    quarter = np.floor(2 * (np.sqrt(wave.beta2) * wave.half / np.pi)).astype(int)
    even, odd = (quarter + 1) // 2, quarter // 2
    # in an interval that contains a resonance, the sign of D or N shows if omega is above it
    in_even, in_odd = quarter % 2 == 1, (quarter % 2 == 0) & (quarter > 0)
    even = even - (in_even & (wave.even * (-1) ** even < 0))
    odd = odd - (in_odd & (wave.odd * (-1) ** odd < 0))
    return even + odd
