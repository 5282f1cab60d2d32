"""Thermoelastic relaxation of bending, of round and of flat cross-sections.

Stretched material cools and compressed material warms; in a bent wire, heat flows from the
compressed to the stretched side and back (Zener, Phys. Rev. 53, 90 (1938)). With theta the change
of temperature across a wire that bends in y (scaled to be y where no heat flows), its surface
insulated, and the diffusivity D = conductivity/(rho C),

    i w theta = D (theta_xx + theta_yy) + i w y,
    E (1 + Delta g),   g = (integral of y theta)/(integral of y^2),

so the loss angle is Delta Im g (`losses.thermoelastic` has Delta). With h half the depth in y (the
radius, or half the thickness) and x = h sqrt(i w/D) the solution is, for both shapes,

    g = v/(v + 2 (n + 1)),   v = x^2 + x I_(n+2)(x)/I_(n+1)(x),
    n = 1 (round), n = 1/2 (ribbon or blade),

that is 1 - 4 J2(z)/(z^2 J1'(z)) with z = i x for a round wire, and 1 + (12/z^2)(1 - (2/z) tan(z/2))
with z = 2 i x for a ribbon (Lifshitz and Roukes, Phys. Rev. B 61, 5600 (2000)). Zener's single
relaxation Delta w tau/(1 + w^2 tau^2), with tau = R^2/(1.8412^2 D) or t^2/(pi^2 D), is 1 % more at
low frequencies; far above its peak Im g exceeds it by 18 or 22 %.
"""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact

FAST = 1e4
"""|x^2| beyond which the asymptotic series has all digits, and is quicker."""
TERMS = 9
"""Terms of that series: the next is below 1e-16."""
LARGE = 10_000
"""Number of phases beyond which the result is not kept."""
MIDDLE = 2.0
"""|x| below which g, and above which g - 1, is free of cancellation."""


def relaxation(
    phase: Inexact[np.ndarray, "*frequency"] | complex, order: float
) -> Inexact[np.ndarray, "*frequency"]:
    """Im g: thermoelastic loss angle over its strength Delta.

    Parameters
    ----------
    phase
        w h^2/D, with h half the depth of the section and D its diffusivity; complex for the
        analytic continuation.
    order
        n: 1 of a round wire, 0.5 of a ribbon or blade.
    """
    if np.iscomplexobj(phase):  # Im g = (g(i p) - g(-i p))/2i for real p, and so for all
        return (_moment(1j * phase, order) - _moment(-1j * phase, order)) / 2j
    phase = np.asarray(phase, dtype=float)
    if phase.size > LARGE:
        return np.imag(_moment(1j * phase, order))
    return _known_relaxation(phase.tobytes(), phase.shape, order).copy()


@functools.lru_cache(maxsize=64)
def _known_relaxation(
    phase: bytes, shape: tuple[int, ...], order: float
) -> Float[np.ndarray, "*frequency"]:
    """Im g at phases given by their bytes, cached for equal sections and both ends of wires."""
    return np.imag(_moment(1j * np.frombuffer(phase).reshape(shape), order))


def _moment(
    x2: Inexact[np.ndarray, "*frequency"] | complex, order: float
) -> Complex[np.ndarray, "*frequency"]:
    """g = v/(v + c) up to |x| = `MIDDLE`, g - 1 = -c/(v + c) beyond, with c = 2 (n + 1).

    v = x^2 (1 + q_(n+1)), by the continued fraction of the Bessel functions,
    q_m = I_(m+1)(x)/(x I_m(x)) = 1/(2 (m + 1) + x^2 q_(m+1)).
    """
    x2 = np.asarray(x2)
    fast = np.abs(x2) > FAST
    slow, q = np.where(fast, 0.0, x2), 0.0
    steps = 14 + int(1.5 * math.sqrt(np.abs(slow).max(initial=0.0)))  # for all digits
    for n in range(steps, 0, -1):
        q = 1 / (2 * (order + 1 + n) + slow * q)
    v = np.asarray(x2 * (1 + q))
    if fast.any():
        v[fast] = x2[fast] + _large_ratio(np.sqrt(x2[fast]), order)
    c = 2 * (order + 1)
    return np.where(np.abs(x2) < MIDDLE**2, v, -c) / (v + c)


def _large_ratio(
    x: Inexact[np.ndarray, "*frequency"], order: float
) -> Inexact[np.ndarray, "*frequency"]:
    """x r = x I_(n+2)(x)/I_(n+1)(x) for large x.

    The coefficients of r = sum a_k/x^k follow from r' = 1 - r^2 - (2 n + 3) r/x.
    """
    a = [1.0]
    for k in range(1, TERMS):
        mixed = sum(a[i] * a[k - i] for i in range(1, k))
        a.append(-(mixed + (2 * order + 4 - k) * a[-1]) / 2)
    return x * np.polynomial.polynomial.polyval(1 / x, a)
