"""Points of a finished study at which models are compared."""

from __future__ import annotations

import numpy as np

from suspension_cli.studies.extremes import MOST, find_extremes, find_largest


def test_both_sides_of_a_narrow_resonance():
    at = np.linspace(0.9, 1.2, 301)
    value = 1 / (at - 1.0505 + 1e-5j)
    chosen = find_extremes(value[:, None])
    assert {150, 151} <= set(chosen.tolist())
    assert len(chosen) <= MOST


def test_a_resonance_along_any_axis():
    x, y = np.meshgrid(np.linspace(-1, 1, 21), np.linspace(-1, 1, 31), indexing="ij")
    value = 1 / (x + 0.5 * y - 0.23)
    chosen = find_extremes(value[..., None])
    assert int(np.abs(value).argmax()) in chosen
    size = np.abs(value.ravel()[chosen])
    assert np.median(size) > 10 * np.median(np.abs(value))


def test_smallest_results_count_too():
    """A frequency that goes to 0 has the largest relative error."""
    value = np.stack([np.linspace(1e-3, 1, 50), np.full(50, 7.0)], axis=1)
    assert 0 in find_extremes(value)


def test_neighbours_of_which_one_failed():
    value = np.ones((40, 1))
    value[17:] = np.nan
    assert {16, 17} <= set(find_extremes(value).tolist())


def test_nothing_is_known():
    assert not len(find_extremes(np.full((4, 5, 2), np.nan)))
    assert not len(find_largest(np.full((2, 4), np.nan)))


def test_many_results_share_the_points():
    """Those that vary most come first."""
    rng = np.random.default_rng(1)
    value = 1 + 0.01 * rng.random((500, 24))
    value[123, 20] = 50.0
    chosen = find_extremes(value)
    assert 123 in chosen and len(chosen) <= MOST


def test_largest_and_smallest_of_random_builds():
    value = np.random.default_rng(2).normal(size=(300, 2))
    chosen = set(find_largest(value.T).tolist())
    for column in np.abs(value).T:
        assert {int(column.argmax()), int(column.argmin())} <= chosen
