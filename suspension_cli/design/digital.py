"""Filters of control loops: products of continuous and of sampled factors.

A continuous root r has the factor i f + r. A root z0 of a digital filter with the sampling period T
has 1 - z0/z, z = exp(2 pi i f T), which cancels nearly all its digits where f T is small. With the
backward difference m = (1 - 1/z) / (2 pi T) per 2 pi, near i f, and the root

    r = (1 - z0) / (2 pi T),    (1 - z0/z) / (2 pi T) = r + (1 - 2 pi r T) m,

which is the factor of a continuous root where T = 0. So both kinds are roots in Hz, with a period.

The state space of a closed loop needs rational functions of frequency. There z is replaced by
(1 + w T / 2) / (1 - w T / 2), exact but for the scale of frequencies: w = 2 i tan(pi f T) / T, so a
feature at f appears at f (1 + (pi f T)^2 / 3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Any

NYQUIST = 1e-9
"""Distance of a root from z = -1 within which it is there."""
OUTSIDE = 1e-12
"""Distance beyond the unit circle that may be a rounding error of a coefficient."""


@dataclass(frozen=True)
class Sampled:
    """Roots r of a digital filter, Hz, as many zeros as poles, at a sample rate in Hz."""

    rate: float
    zeros: tuple[complex, ...]
    poles: tuple[complex, ...]

    @staticmethod
    def of(rate: float, zeros: list[complex], poles: list[complex]) -> Sampled:
        """Make it of the numbers 1 - z0, without the delays z0 = 0 that cancel."""
        delays = min(zeros.count(1.0), poles.count(1.0))
        for roots in (zeros, poles):
            for _ in range(delays):
                roots.remove(1.0)
        scale = rate / (2 * math.pi)
        kept = (tuple(complex(root) * scale for root in roots) for roots in (zeros, poles))
        return Sampled(rate, *kept)


@dataclass(frozen=True)
class Filter:
    """Filter H(f): gain times the product of (i f + z), divided by that of (i f + p), f in Hz.

    Attributes
    ----------
    zeros, poles
        Hz, positive in the left half plane; complex ones with their conjugates.
    sampled
        Digital filters in series.
    """

    gain: float
    zeros: tuple[complex, ...] = ()
    poles: tuple[complex, ...] = ()
    sampled: tuple[Sampled, ...] = ()

    def __mul__(self, other: Filter) -> Filter:
        return Filter(
            self.gain * other.gain,
            self.zeros + other.zeros,
            self.poles + other.poles,
            self.sampled + other.sampled,
        )

    @property
    def period(self) -> float:
        """Longest sampling period, s; 0 of a continuous filter."""
        return max((1 / one.rate for one in self.sampled), default=0.0)

    @property
    def factors(self) -> tuple[list[tuple[complex, float]], list[tuple[complex, float]]]:
        """Zeros and poles in Hz, each with its sampling period in s."""
        zeros, poles = ([(root, 0.0) for root in some] for some in (self.zeros, self.poles))
        for one in self.sampled:
            zeros += [(root, 1 / one.rate) for root in one.zeros]
            poles += [(root, 1 / one.rate) for root in one.poles]
        return zeros, poles

    @property
    def continuous(self) -> Filter:
        """Approximation without sampled factors, see the module."""
        result = replace(self, sampled=())
        for one in self.sampled:
            gain, kept = 1.0 + 0j, []
            for sign, roots in ((1, one.zeros), (-1, one.poles)):
                shrunk = [(root, 1 - math.pi * root / one.rate) for root in roots]
                inside = [(root, size) for root, size in shrunk if abs(size) > NYQUIST]
                gain *= math.prod(size for _, size in inside) ** sign
                gain *= math.prod(root for root, size in shrunk if abs(size) <= NYQUIST)
                kept.append(tuple(root / size for root, size in inside))
            result *= Filter(gain.real, *kept)
        return result

    def at(self, frequency: Any) -> Any:
        """Evaluate the filter at a frequency, or an array of frequencies, in Hz.

        A digital filter passes nothing above half its sample rate.
        """
        import numpy as np

        periods = {0.0, *(1 / one.rate for one in self.sampled)}
        steps = {t: difference(2j * math.pi * frequency, t) / (2 * math.pi) for t in periods}
        result = complex(self.gain)
        for zero, pole in zip_longest(*self.factors):  # in turn, so that nothing overflows
            for place, sign in ((zero, 1), (pole, -1)):
                if place is not None:
                    root, period = place
                    value = root + (1 - 2 * math.pi * root * period) * steps[period]
                    result = result * value if sign > 0 else result / value
        limit = 0.5 / self.period if self.sampled else math.inf
        return np.where(np.abs(frequency) <= limit, result, 0.0) if self.sampled else result


def difference(s: Any, period: Any) -> Any:
    """Backward difference (1 - exp(-s T)) / T that samples have instead of s, or s where T is 0.

    Examples
    --------
    >>> round(difference(1.0, 1e-3), 6)
    0.9995
    """
    import numpy as np

    if np.ndim(period) == 0:
        return -np.expm1(-s * period) / period if period else s
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        return np.where(period > 0, -np.expm1(-s * period) / period, s)
