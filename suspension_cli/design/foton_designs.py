"""Zeros and poles of the designs that Foton strings name.

Arguments are those of `FilterDesign` in LIGO's Global Diagnostics System. A notch of the depth d
has the poles of s^2 + 2 w s / Q + w^2, and zeros damped d times less or, without depth, not at all
(definition of Foton's notch in the package kontrol, `kontrol.transfer_function.Notch`). A `resgain`
is taken as a notch of the inverse depth, and a `comb` as a series of either.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from typing import Any

Roots = list[complex]
Reals = Sequence[float]
TYPES = ("LowPass", "HighPass", "BandPass", "BandStop")
RIPPLES = {"butter": 0, "cheby1": 1, "cheby2": 1, "ellip": 2}
"""Designs of these types, with their number of ripples and attenuations, dB."""
MOST = 100
"""Highest order of a design, and most harmonics of a comb."""
OUTSIDE = 1e-12
"""Distance beyond the unit circle that may be a rounding error of a coefficient."""


class FotonError(ValueError):
    """Error in a Foton string: what is wrong, with its column, and what to do."""

    def __init__(self, problem: str, remedy: str) -> None:
        super().__init__(f"{problem}; {remedy}")
        self.problem, self.remedy = problem, remedy


def pair(f0: float, q: float) -> Roots:
    """Roots r of f0^2 - f^2 + i f f0 / Q = (i f + r1) (i f + r2)."""
    if not (f0 > 0 and q > 0):
        raise FotonError("takes a positive frequency and Q", "correct them")
    half, root = f0 / (2 * q), f0 * cmath.sqrt(1 / (4 * q * q) - 1)
    return [half + root, half - root]


def prototype(name: str, kind: str, numbers: Reals) -> tuple[Roots, Roots, float]:
    """Zeros, poles (rad/s, negative in the left half plane) and gain of `butter`, ..., `ellip`."""
    import numpy as np
    from scipy import signal

    order, count = int(numbers[0]) if numbers else 0, 1 + RIPPLES[name]
    band = [2 * math.pi * edge for edge in numbers[count:]]
    if kind not in TYPES or not 1 <= order <= MOST or len(band) != 1 + kind.startswith("Band"):
        problem = f"takes a type, an order up to {MOST}, {count - 1} ripples (dB), band edges (Hz)"
        remedy = f'write {", ".join(TYPES)} as in ellip("BandPass",4,1,40,10,20)'
        raise FotonError(problem, remedy)
    edges, shape = (band if len(band) > 1 else band[0]), kind.lower()
    try:
        with np.errstate(all="ignore"):
            made = getattr(signal, name)(order, *numbers[1:count], edges, shape, True, "zpk")
    except ValueError as error:
        raise FotonError(f"cannot be designed: {error}", "correct it") from None
    return list(made[0]), list(made[1]), float(made[2])


def rpoly(above: Reals, below: Reals, gain: Reals) -> tuple[Roots, Roots, float]:
    """Zeros, poles (rad/s) and gain of a ratio of polynomials in s, highest power first."""
    from scipy.signal import tf2zpk

    if not any(above) or not any(below):
        raise FotonError("has a polynomial that is 0", "correct it")
    zeros, poles, leading = tf2zpk(above, below)
    return zeros.tolist(), poles.tolist(), float(leading) * gain[0]


def peaks(name: str, f0: float, q: float, size: float = 0.0, count: float = 1) -> list[Roots]:
    """Zeros and poles (Hz) of a notch, a resonant gain, or a comb; `size` in dB.

    A comb has peaks where `size` is positive and notches where it is negative.
    """
    if (name != "notch" and not size) or not 1 <= count <= MOST:
        remedy = f"give frequency (Hz), Q, height (dB) and, for a comb, 1 to {MOST} harmonics"
        raise FotonError("has no height, or no number of harmonics", remedy)
    places = [n * f0 for n in range(1, int(count) + 1)]
    sharp = q / 2 * 10 ** ((size if name == "notch" else -size) / 20)
    poles = [root for f in places for root in pair(f, q / 2)]
    zeros = [root for f in places for root in (pair(f, sharp) if size else (1j * f, -1j * f))]
    return [zeros, poles]


def zroots(zeros: Roots, poles: Roots, gain: Reals = (1.0,)) -> tuple[float, Roots, Roots]:
    """Gain, and numbers 1 - z0 of zeros and poles z0."""
    if len(zeros) != len(poles):
        problem = f"has {len(zeros)} zeros and {len(poles)} poles"
        raise FotonError(problem, "give as many of each, with roots 0 for delays")
    return complex(gain[0]).real, [1 - zero for zero in zeros], [1 - pole for pole in poles]


def direct(above: Reals, below: Reals) -> tuple[float, Roots, Roots]:
    """Likewise of the sum of b_k/z^k, over 1 less that of a_k/z^k from k = 1."""
    import numpy as np

    size = max(len(above), len(below) + 1)
    rows = ([*row, *[0.0] * (size - len(row))] for row in (above, [1.0, *(-a for a in below)]))
    zeros, poles = (np.roots(row).tolist() for row in rows)
    return zroots(zeros, poles, above[:1])


def biquad(b0: Reals, b1: Reals, b2: Reals, a1: Reals, a2: Reals) -> tuple[float, Roots, Roots]:
    """Likewise of a second-order section."""
    return sos([b0[0]], [b1[0] / b0[0], b2[0] / b0[0], a1[0], a2[0]])


def sos(first: Reals, others: Reals = (), order: str = "s") -> tuple[float, Roots, Roots]:
    """Likewise of second-order sections: a gain, then b1, b2, a1, a2; or a1, a2, b1, b2 ("o")."""
    gain, *numbers = *first, *others
    if len(numbers) % 4:
        problem = f"has {len(numbers)} numbers beside the gain, instead of 4 for each section"
        raise FotonError(problem, 'write sos(gain,[a1;a2;b1;b2;...],"o")')
    found: list[Roots] = [[], []]
    for n in range(0, len(numbers), 2):
        found[(n // 2 + (order == "o")) % 2] += quadratic(*numbers[n : n + 2])
    return gain, found[0], found[1]


def quadratic(first: float, second: float) -> Roots:
    """Numbers 1 - z0 of the roots z0 of 1 + first/z + second/z^2, which keep their digits."""
    if second == 0:
        return [1 + first, 1.0]
    half, product = (2 + first) / 2, math.fsum((1.0, first, second))
    root = cmath.sqrt(half * half - product)
    large = half + (root if root.imag or half >= 0 else -root)
    return [large, large.conjugate() if root.imag else product / large if large else 0.0]


def from_z(form: tuple[float, Roots, Roots], rate: float) -> tuple[float, Any, Any]:
    """Gain, zeros and poles (Hz, in w, see `design.foton`) of gain prod(1 - z0/z) / prod(1 - p/z).

    `form` has numbers 1 - z0, as many of zeros as of poles; `rate` is in Hz. As z is
    (1 + w / 2 rate) / (1 - w / 2 rate), 1 - z0/z is

        (1 + z0) / (2 rate) (w + 2 rate (1 - z0) / (1 + z0)) / (1 + w / 2 rate).
    """
    gain, zeros, poles = form
    delays = min(zeros.count(1.0), poles.count(1.0))  # z0 = 0, which cancel
    found: list[tuple[complex, ...]] = []
    for sign, roots in ((1, zeros), (-1, poles)):
        kept = sorted(roots, key=lambda root: root != 1.0)[delays:]
        inside = [root for root in kept if root != 2]  # the others are at half the rate
        if sign < 0 and (len(inside) < len(kept) or any(abs(1 - p) > 1 + OUTSIDE for p in kept)):
            problem = "has a pole outside the unit circle, which grows, or at half the sample rate"
            raise FotonError(problem, "check the signs and the order of the coefficients")
        size = math.prod((2 - root) * math.pi / rate for root in inside)
        gain *= (complex(size).real * 2.0 ** (len(kept) - len(inside))) ** sign
        found.append(tuple(rate / math.pi * root / (2 - root) for root in inside))
    return gain, found[0], found[1]
