"""Noise drawn block by block against its density, and running statistics against those of numpy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.random import SeedSequence
from scipy import signal

from suspension_cli.physics import ground, noise_stream
from suspension_cli.physics.running_statistics import Statistics, WelchAverage


def measured(density, rate, count, piece, seed=5):
    """Frequencies, density measured by scipy over that given, and number of pieces."""
    noise = noise_stream.make_stream(density, rate, SeedSequence(seed)).take(count)
    window = signal.get_window("hann", piece) ** 2
    frequency, power = signal.welch(noise, rate, window, piece, detrend=False)
    return frequency[8:-8], np.sqrt(power[8:-8]) / density(frequency[8:-8])


@pytest.mark.parametrize("rate", [16.0, 300.0, 2048.0])
@pytest.mark.parametrize("name", ["nlnm", "aligo-isi", "vc-d"])
def test_noise_has_its_density(name, rate):
    """Also where that drawn at the low rate passes into that at the full rate, 1 to 4 Hz. Averages
    of some hundred values scatter by 5 %; a table's corners are rounded."""
    density = ground.parse([name], (), Path())["x"].at
    count = 1 << 20
    frequency, ratio = measured(density, rate, count, 1 << 14 if rate > 100 else 1 << 12)
    some = frequency > 0.3
    for part in np.array_split(ratio[some], 20):
        assert np.sqrt((part**2).mean()) == pytest.approx(1.0, abs=0.06)


def test_density_that_falls_by_ten_orders_of_magnitude():
    """f^-5 from 0.1 to 10 Hz: what leaks from the largest density is below the smallest."""
    slope = lambda f: 1e-6 * np.minimum((0.1 / f) ** 5, 1.0)  # noqa: E731
    frequency, ratio = measured(slope, 512.0, 1 << 20, 1 << 14)
    high = (frequency > 3.0) & (frequency < 10.0)
    assert np.sqrt((ratio[high] ** 2).mean()) == pytest.approx(1.0, abs=0.05)


def test_blocks_do_not_matter_nor_do_other_sources():
    density = ground.parse(["nlnm"], (), Path())["x"].at
    whole = noise_stream.make_stream(density, 512.0, SeedSequence(3)).take(30_000)
    stream = noise_stream.make_stream(density, 512.0, SeedSequence(3))
    parts = np.concatenate([stream.take(n) for n in (1, 4095, 7, 12_000, 13_897)])
    np.testing.assert_array_equal(whole, parts)


def test_flat_noise_is_white_and_none_is_none():
    flat = noise_stream.make_stream(lambda f: np.full(f.shape, 3e-10), 64.0, SeedSequence(1))
    assert flat.take(100_000).std() == pytest.approx(3e-10 * np.sqrt(32), rel=0.01)
    assert noise_stream.make_stream(np.zeros_like, 64.0, SeedSequence(1)) is None


def test_running_statistics_are_those_of_the_whole():
    rows = np.random.default_rng(2).standard_normal((5000, 2)) * [1.0, 3.0]
    statistics = Statistics(np.array([2.5, 100.0]))
    spectra = WelchAverage(512, 100.0, 2)
    for part in np.split(rows, [3, 511, 512, 513, 1700, 4999]):
        statistics.add(part)
        spectra.add(part)
    np.testing.assert_allclose(statistics.rms, np.sqrt((rows**2).mean(0)), rtol=1e-12)
    np.testing.assert_array_equal(statistics.largest, np.abs(rows).max(0))
    assert statistics.first_beyond.tolist() == [np.flatnonzero(np.abs(rows[:, 0]) > 2.5)[0], -1]
    window = signal.get_window(("general_cosine", [3 / 8, 1 / 2, 1 / 8]), 512)
    frequency, power = signal.welch(rows.T, 100.0, window, 512, detrend=False)
    np.testing.assert_array_equal(spectra.frequency, frequency[1:-1])
    np.testing.assert_allclose(spectra.density.T, np.sqrt(power[:, 1:-1]), rtol=1e-10)
    assert spectra.averages == 18
