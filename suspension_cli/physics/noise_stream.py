"""Noise of a given spectrum, drawn block by block without end.

White noise w with the one-sided density 1 passes through a filter whose gain is the amplitude
spectral density a of the noise: over abs(k) < N / 2,

    y_n = sum of h_k w_(n - k),    h_k = cos^4(pi k / N) (1 / N) sum of a_j exp(2 pi i j k / N),

with a at the N multiples of rate / N, as a convolution by FFT (overlap-save). The window of h
averages a over 2.6 rate / N around each frequency; from a frequency that is n rate / N away it
takes a part of n^-5, so spectra may fall by ten orders of magnitude.

Low frequencies, which need a long filter, are drawn at a low rate, and interpolated: with a cos(u)
in place of a, and a sin(u) at the full rate, where u rises from 0 to pi / 2.

>>> from numpy.random import SeedSequence
>>> noise = make_stream(lambda f: 1e-9 / f, 64.0, SeedSequence(1))
>>> both = np.concatenate([noise.take(5), noise.take(10)])
>>> again = make_stream(lambda f: 1e-9 / f, 64.0, SeedSequence(1))
>>> np.array_equal(both, again.take(15))
True
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Float
    from numpy.random import SeedSequence

    Density = Callable[[Float[np.ndarray, " frequency"]], Float[np.ndarray, " frequency"]]
    """Amplitude spectral density, one-sided, at frequencies in Hz above 0."""

LOW_RATE = 64.0
"""Least rate at which low frequencies are drawn, Hz; it is at most twice that."""
CROSSING = 1 / 64, 1 / 16
"""Frequencies between which noise is drawn at both rates, over the low one."""
LOW_COUNT = 1 << 15
"""Samples of a filter at the low rate: more than 256 s, so above 0.01 Hz densities are resolved."""
HIGH_LENGTH = 16.0
"""Least length of a filter at the full rate, s, which resolves frequencies above 1 Hz."""
SUPPRESSION = 200.0
"""Suppression of images of the low frequencies by interpolation, dB."""
AT_ONCE = 4096
"""Samples that are drawn together."""
SLOW_AT_ONCE = 256
"""Samples that are interpolated together."""


def fading_window(count: int) -> Float[np.ndarray, " sample"]:
    """Window sin^4 of as many samples, 0 at the first one and 1 in the middle."""
    return np.sin(np.pi * np.arange(count) / count) ** 4


class Stream(ABC):
    """Samples without end, the same in whatever blocks they are taken."""

    def __init__(self) -> None:
        self._ready = np.zeros(0)

    def take(self, count: int) -> Float[np.ndarray, " sample"]:
        """Return the next samples."""
        while len(self._ready) < count:
            self._ready = np.concatenate([self._ready, self._draw()])
        found = self._ready[:count]
        self._ready = self._ready[count:]
        return found

    @abstractmethod
    def _draw(self) -> Float[np.ndarray, " sample"]:
        """Draw some samples."""


class WhiteNoise(Stream):
    """White noise of a one-sided density at a rate in Hz."""

    def __init__(self, density: float, rate: float, seed: SeedSequence) -> None:
        super().__init__()
        self._generator = np.random.default_rng(seed)
        self._size = density * np.sqrt(rate / 2)

    def _draw(self) -> Float[np.ndarray, " sample"]:
        return self._size * self._generator.standard_normal(AT_ONCE)


class ColouredNoise(Stream):
    """White noise behind a filter of `count` samples, whose gain is a density."""

    def __init__(self, density: Density, rate: float, count: int, seed: SeedSequence) -> None:
        super().__init__()
        amplitude = np.append(0.0, density(np.fft.rfftfreq(count, 1 / rate)[1:]))
        coefficients = np.fft.fftshift(np.fft.irfft(amplitude, count))
        self._gain = np.fft.rfft(coefficients * fading_window(count), 2 * count)
        self._count = count
        self._white = WhiteNoise(1.0, rate, seed)
        self._before = self._white.take(count)

    def _draw(self) -> Float[np.ndarray, " sample"]:
        white = self._white.take(self._count)
        both = np.concatenate([self._before, white])
        self._before = white
        return np.fft.irfft(np.fft.rfft(both) * self._gain)[self._count :]


class Interpolated(Stream):
    """A stream of low frequencies at a rate that is `factor` times higher."""

    def __init__(self, slow: Stream, factor: int) -> None:
        from scipy.signal import kaiserord
        from scipy.signal.windows import kaiser

        super().__init__()
        self._slow = slow
        self._factor = factor
        width = 2 * (1 - 2 * CROSSING[1]) / factor
        count, shape = kaiserord(SUPPRESSION, width)
        count += 1 - count % 2
        at = np.arange(count) - count // 2
        self._filter = np.sinc(at / factor) * kaiser(count, shape)
        self._rest = np.zeros(0)
        self.take(count)  # until the filter is filled

    def _draw(self) -> Float[np.ndarray, " sample"]:
        from scipy.signal import upfirdn

        whole = upfirdn(self._filter, self._slow.take(SLOW_AT_ONCE), self._factor)
        whole[: len(self._rest)] += self._rest
        found, self._rest = np.split(whole, [SLOW_AT_ONCE * self._factor])
        return found


class Sum(Stream):
    """Sum of streams."""

    def __init__(self, parts: Sequence[Stream]) -> None:
        super().__init__()
        self._parts = parts

    def _draw(self) -> Float[np.ndarray, " sample"]:
        return np.sum([part.take(AT_ONCE) for part in self._parts], axis=0)


def make_stream(density: Density, rate: float, seed: SeedSequence) -> Stream | None:
    """Make the noise of an amplitude spectral density at a rate in Hz; None if that is 0."""
    some = density(np.geomspace(1 / LOW_COUNT, 0.5, LOW_COUNT) * rate)
    if not some.any():
        return None
    if np.ptp(some) == 0:
        return WhiteNoise(some[0], rate, seed)
    factor = 1 << max(int(np.log2(rate / LOW_RATE)), 0)
    if factor == 1:
        return ColouredNoise(density, rate, LOW_COUNT, seed)
    low_rate = rate / factor
    first, last = np.multiply(CROSSING, low_rate)

    def rise(frequency: Float[np.ndarray, " frequency"]) -> Float[np.ndarray, " frequency"]:
        part = np.log(frequency / first) / np.log(last / first)
        return np.pi / 2 * np.clip(part, 0.0, 1.0)

    def low(frequency: Float[np.ndarray, " frequency"]) -> Float[np.ndarray, " frequency"]:
        return np.cos(rise(frequency)) * density(frequency) * (frequency < last)

    def high(frequency: Float[np.ndarray, " frequency"]) -> Float[np.ndarray, " frequency"]:
        return np.sin(rise(frequency)) * density(frequency)

    seeds = seed.spawn(2)
    slow = ColouredNoise(low, low_rate, LOW_COUNT, seeds[0])
    count = 1 << int(np.ceil(np.log2(HIGH_LENGTH * rate)))
    return Sum([Interpolated(slow, factor), ColouredNoise(high, rate, count, seeds[1])])
