"""Statistics and spectra of signals that come block by block.

>>> found = Statistics(np.array([1.0]))
>>> found.add(np.array([[0.3], [-0.4]]))
>>> found.add(np.array([[1.2]]))
>>> found.rms, found.largest, found.first_beyond
(array([0.75055535]), array([1.2]), array([2]))
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.physics.noise_stream import fading_window

if TYPE_CHECKING:
    from jaxtyping import Float, Int


class Statistics:
    """Mean squares and largest magnitudes of signals, and when they first exceed bounds."""

    def __init__(self, bounds: Float[np.ndarray, " signal"]) -> None:
        self.bounds = bounds
        self.count = 0
        self.squares = np.zeros(len(bounds))
        self.largest = np.zeros(len(bounds))
        self.first_beyond: Int[np.ndarray, " signal"] = np.full(len(bounds), -1)
        """Number of the first sample beyond the bound of each signal, or -1."""

    def add(self, block: Float[np.ndarray, "sample signal"]) -> None:
        """Take the next samples."""
        size = np.abs(block)
        beyond = size > self.bounds
        new = beyond.any(0) & (self.first_beyond < 0)
        self.first_beyond[new] = self.count + beyond[:, new].argmax(0)
        self.count += len(block)
        self.squares += (block**2).sum(0)
        self.largest = np.maximum(self.largest, size.max(0))

    @property
    def rms(self) -> Float[np.ndarray, " signal"]:
        """Root of the mean square of each signal."""
        return np.sqrt(self.squares / max(self.count, 1))


class WelchAverage:
    """Spectra of signals by the method of Welch: average over pieces that overlap by half.

    P. Welch, IEEE Trans. Audio Electroacoust. 15, 70 (1967), with the window sin^4. `piece` is an
    even number of samples, `rate` in Hz.
    """

    def __init__(self, piece: int, rate: float, signals: int) -> None:
        self.rate = rate
        self.window = fading_window(piece)
        self.waiting = np.empty((piece, signals))
        self.filled = 0
        self.sum = np.zeros((piece // 2 - 1, signals))
        self.averages = 0

    def add(self, block: Float[np.ndarray, "sample signal"]) -> None:
        """Take the next samples."""
        while len(block):
            some = block[: len(self.waiting) - self.filled]
            block = block[len(some) :]
            self.waiting[self.filled : self.filled + len(some)] = some
            self.filled += len(some)
            if self.filled == len(self.waiting):
                self._add_piece()

    def _add_piece(self) -> None:
        for total, signal in zip(self.sum.T, self.waiting.T, strict=True):
            total += np.abs(np.fft.rfft(self.window * signal)[1:-1]) ** 2
        self.averages += 1
        self.filled //= 2
        self.waiting[: self.filled] = self.waiting[-self.filled :]

    @property
    def frequency(self) -> Float[np.ndarray, " frequency"]:
        """Frequencies above 0 and below half the rate, Hz."""
        return np.fft.rfftfreq(len(self.waiting), 1 / self.rate)[1:-1]

    @property
    def density(self) -> Float[np.ndarray, "frequency signal"]:
        """One-sided amplitude spectral densities, in the unit of each signal over sqrt(Hz)."""
        return np.sqrt(2 * self.sum / (self.averages * self.rate * (self.window**2).sum()))
