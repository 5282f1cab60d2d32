"""The exact dynamic stiffness of a beam under tension: nothing is discretised, nothing overflows, nothing cancels.

A wire of bending stiffness EI, tension T and mass mu a length moves across itself as

    EI w'''' - T w'' - mu omega^2 w = 0,      w = A cosh(alpha x) + B cos(beta x) + A' sinh(alpha x) + B' sin(beta x),
    alpha^2 = (tau + sqrt(tau^2 + 4 m)) / 2,  beta^2 = m / alpha^2,  tau = T / EI,  m = mu omega^2 / EI.

With x from the middle, the motion of the two ends splits into an even part (both ends move alike: W_s, their slopes are
opposite: T_s) and an odd one (W_a, T_a), in which the two halves mirror each other.  One half of length h = L/2, solved for
A and B from W and T at x = h, gives with C = cosh(alpha h), t = tanh(alpha h), c = cos(beta h), s = sin(beta h)

    D   = beta s + alpha c t                              (0 where the clamped wire resonates evenly)
    N   = s / beta - c t / alpha                          (0 where it resonates oddly)
    even: WW = -EI alpha^2 beta^2 (alpha^2 + beta^2) (s/beta)(t/alpha) / D,  WT = EI alpha^2 beta^2 N / D,  TT = EI (alpha^2 + beta^2) c / D
    odd:  WW =  EI (alpha^2 + beta^2) c / N,   WT = -EI D / N,   TT = EI (alpha^2 + beta^2) (s/beta)(t/alpha) / N.

All are even functions of alpha and beta, so the static limit beta = 0 is no special case; all terms but those of N have one sign
as long as the wire does not vibrate.  N cancels to (alpha^2 + beta^2) h^3/3 in a wire that is stiff and slow, where its power series is
summed.  Only tanh of alpha h appears: nothing overflows.  (Howson and Williams, J. Sound Vib. 26, 503 (1973), give the same elements for the
whole beam with cosh and sinh of alpha L; the split into halves is what keeps their digits.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

EPS = 2.0**-53
SERIES = 1.0
"""Below this |alpha^2 + beta^2| h^2 the series of N is summed; above, the closed form loses no more than a digit."""
TERMS = 11
"""Of the series, whose terms fall faster than 1/(2k)!."""
FACTORIAL = [math.factorial(n) for n in range(2 * TERMS)]
COEFFICIENT = [[1 / (FACTORIAL[2 * i] * FACTORIAL[2 * j + 1]) - 1 / (FACTORIAL[2 * j] * FACTORIAL[2 * i + 1]) for j in range(TERMS)] for i in range(TERMS)]
"""Of p^i n^j in the series."""

EVEN_WW, EVEN_WT, EVEN_TT, ODD_WW, ODD_WT, ODD_TT = range(6)
"""Order of the elements that `stiffness` gives."""

PLACE = ((0, 0), (0, 1), (1, 1), (2, 2), (2, 3), (3, 3))
"""Their places in the symmetric matrix on (W_s, T_s, W_a, T_a)."""


@dataclass(frozen=True)
class Waves:
    """The four waves of a wire at given frequencies, and the functions of them that everything is made of.

    Attributes
    ----------
    half : float
        h, m.
    alpha2, beta2 : (f,) arrays
        Squares of the decaying and of the running wave number, 1/m^2; complex if lossy.
    tanh : (f,) array
        tanh(alpha h) / alpha, m.
    sin : (f,) array
        sin(beta h) / beta, m.
    cos : (f,) array
        cos(beta h).
    even, odd : (f,) arrays
        D (1/m) and N (m).
    """

    half: float
    alpha2: Any
    beta2: Any
    tanh: Any
    sin: Any
    cos: Any
    even: Any
    odd: Any

    @cached_property
    def both(self) -> Any:
        """alpha^2 + beta^2."""
        return self.alpha2 + self.beta2

    @cached_property
    def alpha(self) -> Any:
        """Its square root, 1/m."""
        return np.sqrt(self.alpha2)

    @cached_property
    def beta(self) -> Any:
        """Its square root, 1/m."""
        return np.sqrt(self.beta2)

    @cached_property
    def memo(self) -> dict[str, Any]:
        """What is worked out from these waves once, and kept for other motions of the same wire."""
        return {}

    @cached_property
    def slow(self) -> Any:
        """Where (f,) the wire is so stiff and slow that its waves cancel."""
        return np.abs(self.both) * self.half**2 < SERIES


def waves(rigidity: Any, tension: float, mass: Any, half: float, omega: Any) -> Waves:
    """The waves of a wire.

    Parameters
    ----------
    rigidity : (f,) array or float
        EI in N m^2, above 0; complex, EI (1 + i phi), with loss.
    tension : float
        N, at least 0.
    mass : (f,) array or float
        A length, kg/m; complex, mu - i b / omega, with a drag b; 0 for a wire without inertia.
    half : float
        Half the length, m.
    omega : (f,) array
        rad/s; complex to differentiate by a complex step.
    """
    tau, m = tension / rigidity, mass * omega**2 / rigidity
    alpha2 = (tau + np.sqrt(tau**2 + 4 * m)) / 2
    # a wire without tension at rest has no waves at all: any tiny alpha gives its limit
    alpha2 = np.where(alpha2 == 0, (1e-8 / half) ** 2, alpha2)
    beta2 = m / alpha2
    alpha, beta = np.sqrt(alpha2), np.sqrt(beta2)
    tanh, sin, cos = np.tanh(alpha * half) / alpha, half * _sinc(beta * half), np.cos(beta * half)
    odd = sin - cos * tanh
    slow = np.abs(alpha2 + beta2) * half**2 < SERIES
    if np.any(slow):
        p, n = alpha2 * half**2, -beta2 * half**2
        odd = np.where(slow, half * (p - n) * _series(np.where(slow, p, 0), np.where(slow, n, 0)) / np.cosh(np.where(slow, alpha * half, 0)), odd)
    even = _off_zero(beta2 * sin, alpha2 * cos * tanh, beta2 * sin + alpha2 * cos * tanh)
    return Waves(half, alpha2, beta2, tanh, sin, cos, even, _off_zero(sin, cos * tanh, odd))


def _off_zero(a: Any, b: Any, value: Any) -> Any:
    """A sum of a and b; where it vanishes to the last bit, half a rounding of them: a resonance of the held wire, just passed or just ahead."""
    return np.where(value == 0, EPS * (np.abs(a) + np.abs(b)), value)


def stiffness(rigidity: Any, found: Waves) -> Any:
    """Dynamic stiffness (6, f) in one plane, as the elements of q^T F q / 2 with q = (W_s, T_s, W_a, T_a).

    W_s = (w_1 + w_2) / 2, W_a = (w_2 - w_1) / 2, T_s = (w'_2 - w'_1) / 2, T_a = (w'_1 + w'_2) / 2 for the displacements w and slopes w' of
    the upper (1) and the lower end (2).

    Parameters
    ----------
    rigidity : (f,) array or float
        The same as that of the waves.
    found : Waves
    """
    through = found.sin * found.tanh
    running = found.alpha2 * found.beta2
    elements = (
        -running * found.both * through / found.even,
        running * found.odd / found.even,
        found.both * found.cos / found.even,
        found.both * found.cos / found.odd,
        -found.even / found.odd,
        found.both * through / found.odd,
    )
    return np.stack([2 * rigidity * element + 0 * found.both for element in elements])


def _sinc(z: Any) -> Any:
    """sin(z) / z."""
    safe = np.where(z == 0, 1.0, z)
    return np.where(z == 0, 1.0, np.sin(safe) / safe)


def _series(p: Any, n: Any) -> Any:
    """(f0(p) f1(n) - f0(n) f1(p)) / (p - n) with f0(z) = cosh sqrt z, f1(z) = sinh(sqrt z) / sqrt z, by its power series.

    The product of the series is sum over i, j of (1/((2i)! (2j+1)!) - 1/((2j)! (2i+1)!)) p^i n^j, odd under i <-> j, and
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
        inner = sum((COEFFICIENT[i][j] * complete[i - j - 1] for i in range(j + 1, TERMS)), np.zeros_like(p))
        total = total * product + inner
    return total


def resonances_below(rigidity: float, tension: float, mass: float, half: float, omega: Any) -> Any:
    """How many resonances (f,) of the wire with both ends clamped lie below each omega (rad/s).

    The even ones are the zeros of D: tan(beta h) = -(alpha / beta) tanh(alpha h), one in each ((k - 1/2) pi, k pi); the odd ones those of N:
    tan(beta h) = (beta / alpha) tanh(alpha h) < 1, one in each (k pi, (k + 1/2) pi), for k = 1, 2, ... .
    """
    if mass == 0:
        return np.zeros(np.shape(omega), dtype=int)
    found = waves(rigidity, tension, mass, half, np.asarray(omega, dtype=float))
    turns = np.sqrt(found.beta2) * half / np.pi
    quarter = np.floor(2 * turns).astype(int)  # whole quarters of a wave
    even, odd = (quarter + 1) // 2, quarter // 2
    # in the open interval that holds a resonance: has it been passed?  D and N change sign there.
    in_even, in_odd = quarter % 2 == 1, (quarter % 2 == 0) & (quarter > 0)
    even = even - (in_even & (found.even * _parity(even) < 0))
    odd = odd - (in_odd & (found.odd * _parity(odd) < 0))
    return even + odd


def _parity(k: Any) -> Any:
    return 1 - 2 * (k % 2)
