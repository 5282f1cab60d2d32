"""Designs that Foton strings name: Butterworth, Chebyshev, elliptic, notches, coefficients in z.

All are filters in s, designed by scipy.signal, but those given by coefficients or roots in z
(`sos`, `biquad`, `zroots`, `direct`), which need a sample rate. Arguments are those of
`FilterDesign` in LIGO's Global Diagnostics System.

A notch of the depth d has the poles of s^2 + 2 w s / Q + w^2 and zeros damped d times less (as
measured on Foton by the authors of the package kontrol, `kontrol.transfer_function.Notch`); without
depth they are not damped. `resgain` and `comb` are taken as its inverse and its series.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from suspension_cli.design.digital import NYQUIST, OUTSIDE, Filter, Sampled

TYPES = {"LowPass": 1, "HighPass": 1, "BandPass": 2, "BandStop": 2}
"""Types of `butter`, ..., with their number of band edges."""
RIPPLES = {"butter": 0, "cheby1": 1, "cheby2": 1, "ellip": 2}
"""Designs with a type, with their number of ripples and attenuations, dB."""
IN_Z = ("sos", "biquad", "zroots", "direct")
HIGHEST = 20
"""Highest order of a design, that of ten second-order sections."""
MOST = 100
"""Most harmonics of a comb."""


class FotonError(ValueError):
    """Error in a Foton string: what is wrong, with its column, and what to do."""

    def __init__(self, problem: str, remedy: str) -> None:
        super().__init__(f"{problem}; {remedy}")
        self.problem, self.remedy = problem, remedy


def pair(frequency: float, q: float) -> tuple[complex, complex]:
    """Roots r of f0^2 - f^2 + i f f0 / Q = (i f + r1) (i f + r2), Hz."""
    half, root = frequency / (2 * q), frequency * cmath.sqrt(1 / (4 * q * q) - 1)
    return half + root, half - root


def design(name: str, kind: str, numbers: Sequence[float]) -> Filter:
    """Design a filter of a type: order, ripples, band edges in Hz."""
    from scipy import signal

    if kind not in TYPES:
        raise FotonError(f'has no type "{kind}"', f"write {' or '.join(TYPES)}")
    ripples, edges = RIPPLES[name], numbers[1 + RIPPLES[name] :]
    if len(edges) != TYPES[kind]:
        raise FotonError(
            f"takes order, {ripples} ripples (dB) and {TYPES[kind]} band edges (Hz) for {kind},"
            f" found {len(numbers)} numbers",
            'write for example butter("LowPass",4,100) or ellip("BandPass",4,1,40,10,20)',
        )
    order = numbers[0]
    if order != int(order) or not 1 <= order <= HIGHEST:
        raise FotonError(f"has the order {order:g}", f"give a whole number from 1 to {HIGHEST}")
    if min(numbers) <= 0 or (len(edges) == 2 and edges[0] >= edges[1]):
        raise FotonError("takes positive ripples and ascending band edges", "correct them")
    if name == "ellip" and numbers[1] >= numbers[2]:
        raise FotonError("has more ripple than attenuation", "give ripple, then attenuation, dB")
    band = [2 * math.pi * edge for edge in edges]
    zeros, poles, gain = getattr(signal, name)(
        int(order),
        *numbers[1 : 1 + ripples],
        band if len(band) == 2 else band[0],
        kind.lower(),
        analog=True,
        output="zpk",
    )
    return of_zpk(zeros.tolist(), poles.tolist(), float(gain))


def of_zpk(zeros: Sequence[complex], poles: Sequence[complex], gain: float) -> Filter:
    """Filter gain times the product of (s - zeros) over that of (s - poles), rad/s."""
    scaled = (tuple(-root / (2 * math.pi) for root in roots) for roots in (zeros, poles))
    return Filter(gain * (2 * math.pi) ** (len(zeros) - len(poles)), *scaled)


def polynomials(numerator: list[float], denominator: list[float], gain: float) -> Filter:
    """Ratio of polynomials in s, rad/s, coefficients in descending order."""
    from scipy.signal import tf2zpk

    if not any(numerator) or not denominator or not denominator[0]:
        raise FotonError("takes polynomials that are not 0", "give the highest power first")
    zeros, poles, leading = tf2zpk(numerator, denominator)
    return of_zpk(zeros.tolist(), poles.tolist(), gain * float(leading))


def peak(frequency: float, q: float, height: float) -> Filter:
    """Resonant gain of a height in dB, or a notch of -height."""
    if frequency <= 0 or q <= 0:
        raise FotonError("takes a positive frequency and Q", "correct them")
    zeros = pair(frequency, q / 2 * 10 ** (-height / 20))
    return Filter(1.0, zeros, pair(frequency, q / 2))


def notch(frequency: float, q: float, depth: float = 0.0) -> Filter:
    """Notch of a depth in dB; complete for a depth of 0."""
    made = peak(frequency, q, -depth)
    return made if depth else replace(made, zeros=(1j * frequency, -1j * frequency))


def resgain(frequency: float, q: float, height: float = 0.0) -> Filter:
    """Resonant gain of a height in dB."""
    if not height:
        raise FotonError("has no height", "give frequency (Hz), Q and height (dB)")
    return peak(frequency, q, height)


def comb(frequency: float, q: float, height: float = 0.0, count: float = 0.0) -> Filter:
    """Resonant gains (or, of negative height, notches) at the first harmonics of a frequency."""
    if not height or count != int(count) or not 1 <= count <= MOST:
        remedy = f"give frequency (Hz), Q, height (dB) and 1 to {MOST} harmonics"
        raise FotonError("has no height or no number of harmonics", remedy)
    result = Filter(1.0)
    for n in range(1, int(count) + 1):
        result *= peak(n * frequency, q, height)
    return result


def set_gain(made: Filter, frequency: float, gain: float) -> Filter:
    """Scale a filter to a magnitude at a frequency in Hz."""
    import numpy as np

    with np.errstate(all="ignore"):
        try:
            size = abs(made.at(frequency))
        except ZeroDivisionError:
            size = math.inf
    if not 0 < size < math.inf:
        problem = f"sets the gain at {frequency:g} Hz, where it is 0 or infinite"
        raise FotonError(problem, "name another frequency")
    return replace(made, gain=made.gain * gain / float(size))


def close_loop(made: Filter, gain: float = 1.0) -> Filter:
    """Close a loop around a filter G: 1 / (1 + gain G)."""
    import numpy as np

    if made.sampled:
        raise FotonError("closes loops of filters in s alone", "write the closed loop in z")
    poles, zeros = (np.real(np.poly(-np.array(roots))) for roots in (made.poles, made.zeros))
    whole = np.trim_zeros(np.polyadd(poles, gain * made.gain * zeros), "f")
    if not len(whole):
        raise FotonError("divides by 0: the loop gain is -1", "give another gain")
    closed = tuple(complex(-root) for root in np.roots(whole))
    return Filter(float(1 / whole[0]), made.poles, closed)


def _quadratic(first: float, second: float) -> list[complex]:
    """Numbers 1 - z0 of the roots z0 of 1 + first/z + second/z^2."""
    if second == 0:
        return [1 + first, 1.0]
    half, product = (2 + first) / 2, math.fsum((1.0, first, second))
    inside = half * half - product
    if inside < 0:
        return [complex(half, math.sqrt(-inside)), complex(half, -math.sqrt(-inside))]
    large = half + math.copysign(math.sqrt(inside), half)
    return [large, product / large if large else 0.0]


def sections(numbers: Sequence[float], order: str, rate: float) -> Filter:
    """Second-order sections in z: a gain, then four coefficients each.

    Parameters
    ----------
    order
        ``"o"``: a1, a2, b1, b2, as in filter files; ``"s"``: b1, b2, a1, a2.
    rate
        Hz.
    """
    if len(numbers) % 4 != 1:
        problem = f"has {len(numbers)} numbers instead of a gain and 4 for each section"
        raise FotonError(problem, 'write sos(gain,[a1;a2;b1;b2;...],"o")')
    zeros: list[complex] = []
    poles: list[complex] = []
    for n in range(1, len(numbers), 4):
        first, second = numbers[n : n + 2], numbers[n + 2 : n + 4]
        below, above = (first, second) if order == "o" else (second, first)
        poles += _quadratic(*below)
        zeros += _quadratic(*above)
    return _checked(numbers[0], zeros, poles, rate)


def of_roots(zeros: Sequence[complex], poles: Sequence[complex], gain: float, rate: float) -> Filter:
    """Roots in z, as many zeros as poles: gain times the product of (z - zeros)/(z - poles)."""
    if len(zeros) != len(poles):
        problem = f"has {len(zeros)} zeros and {len(poles)} poles"
        raise FotonError(problem, "give as many zeros as poles, with roots 0 for delays")
    return _checked(gain, [1 - root for root in zeros], [1 - root for root in poles], rate)


def direct(above: list[float], below: list[float], rate: float) -> Filter:
    """Direct form: the sum of b_k / z^k, over 1 less that of a_k / z^k from k = 1."""
    import numpy as np

    if not above or not above[0]:
        raise FotonError("has no b0", "give a coefficient that is not 0; delays are in delay")
    size = max(len(above), len(below) + 1)
    tops = [*above, *[0.0] * (size - len(above))]
    bottoms = [1.0, *(-a for a in below), *[0.0] * (size - len(below) - 1)]
    roots = ([complex(root) for root in np.roots(some)] for some in (tops, bottoms))
    missing = ([*some, *[0j] * (size - 1 - len(some))] for some in roots)
    return of_roots(*missing, above[0], rate)


def _checked(gain: float, zeros: list[complex], poles: list[complex], rate: float) -> Filter:
    """Check the poles of a sampled filter, given as 1 - z0."""
    for pole in poles:
        if abs(1 - pole) > 1 + OUTSIDE:
            problem = f"has a pole outside the unit circle, at |z| = {abs(1 - pole):.9g}, which grows"
            raise FotonError(problem, "check the signs and the order of the coefficients")
        if abs(2 - pole) <= NYQUIST:
            raise FotonError("has a pole at half the sample rate", "check the coefficients")
    return Filter(gain, sampled=(Sampled.of(rate, zeros, poles),))


SIMPLE: dict[str, Callable[..., Filter]] = {"notch": notch, "resgain": resgain, "comb": comb}
"""Designs of numbers alone."""
