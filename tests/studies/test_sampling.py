"""Points that builds are drawn from, Sobol indices, and confidence intervals."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.analyses.tolerance.summary import sobol_indices, standard_error
from suspension_cli.studies.parameters import natural_step
from suspension_cli.studies.sampling import REPLICATES, SamplePoints, largest_count, smallest_count

GROUPS = (0, 1, 1, 2)


@pytest.mark.parametrize("method", ["random", "sobol"])
@pytest.mark.parametrize("groups", [(), GROUPS])
def test_points_do_not_depend_on_what_is_drawn_with_them(method, groups):
    count = largest_count(700, method, len(set(groups)))
    points = SamplePoints(method, 2**64 - 1, count, groups)
    every = points.of(0, count, 4)
    assert every.shape == (count, 4)
    assert every.min() >= 0 and every.max() < 1
    for start, stop in [(0, 1), (1, 7), (7, 200), (200, count), (3, 3)]:
        assert np.array_equal(points.of(start, stop, 4), every[start:stop])
    if groups:
        a, b, *mixed = every.reshape(points.blocks, points.rows, 4)
        assert not np.isin(a, b).any()
        for group, block in enumerate(mixed):
            assert np.array_equal(block, np.where(np.array(groups) == group, b, a))


def test_sobol_points_are_uniform_and_better_than_random():
    """Uniform in every replicate, and the mean of a smooth function has a much smaller error."""
    errors = {}
    for method in ("random", "sobol"):
        points = SamplePoints(method, 3, 2048)
        u, replicate = points.of(0, 2048, 6), points.replicate(np.arange(2048))
        assert np.bincount(replicate).tolist() == [256] * REPLICATES
        values = (u**2).sum(1)
        errors[method] = standard_error(values, replicate)
        assert values.mean() == pytest.approx(2.0, abs=4 * errors[method])
        if method == "sobol":
            for number in range(REPLICATES):  # one point in each of 256 intervals
                cells = (256 * u[replicate == number]).astype(int)
                assert (np.sort(cells, axis=0) == np.arange(256)[:, None]).all()
    assert errors["sobol"] < errors["random"] / 10


def test_counts_that_a_method_can_use():
    assert largest_count(1000, "random") == 1000
    assert largest_count(1000, "sobol") == 8 * 64
    assert largest_count(1000, "random", 5) == 7 * 8 * 16
    for method, groups in (("sobol", 0), ("random", 17)):
        least = smallest_count(groups)
        assert largest_count(least, method, groups) == least
        assert largest_count(least - 1, method, groups) == 0


def estimated(function, groups, count, method="sobol"):
    """Indices of a function of points of the unit cube."""
    points = SamplePoints(method, 5, count, groups)
    values = function(points.of(0, count, len(groups)))
    shaped = values.reshape(points.blocks, points.rows, 1)
    return sobol_indices(shaped, points.replicate(np.arange(points.rows)))


def test_indices_of_ishigamis_function():
    """sin x + 7 sin^2 y + 0.1 z^4 sin x on (-pi, pi)^3 (Ishigami and Homma, Proc. ISUMA (1990)),
    whose variances are known."""
    a, b = 7.0, 0.1

    def ishigami(u):
        x, y, z = (2 * np.pi * u - np.pi).T
        return np.sin(x) + a * np.sin(y) ** 2 + b * z**4 * np.sin(x)

    fourth, eighth = np.pi**4, np.pi**8
    alone = np.array([(1 + b * fourth / 5) ** 2 / 2, a**2 / 8, 0.0])
    together = b**2 * eighth * (1 / 18 - 1 / 50)
    whole = alone.sum() + together
    found = estimated(ishigami, (0, 1, 2), 5 * 16384)
    first, total = alone / whole, (alone + np.array([together, 0, together])) / whole
    np.testing.assert_allclose(found.first[:, 0], first, atol=0.01)
    np.testing.assert_allclose(found.total[:, 0], total, atol=0.01)
    assert (np.abs(found.first[:, 0] - first) < 5 * found.first_error[:, 0] + 1e-12).all()
    assert (np.abs(found.total[:, 0] - total) < 5 * found.total_error[:, 0] + 1e-12).all()


def test_indices_of_what_fails_or_does_not_vary():
    rng = np.random.default_rng(1)
    values = rng.random((4, 64, 2))
    values[..., 1] = 3.0
    values[0, :8, 0] = np.nan
    found = sobol_indices(values, np.arange(64) // 8)
    assert np.isfinite(found.total[:, 0]).all()
    assert np.isnan(found.total[:, 1]).all() and np.isnan(found.first[:, 1]).all()


@pytest.mark.parametrize(
    ("path", "step"),
    [
        ("stage.test.wires.d", (1e-3, "mm")),
        ("stage.test.wires.sections.2.radius.1", (0.02, "%")),
        ("stage.wire.body.radius", (1e-3, "mm")),
        ("stage.test.blades.geometry.thickness", (0.02, "%")),
        ("perturbation.1.rotation.3", (1e-3, "mrad")),
        ("materials.steel302.loss_angle", (0.02, "%")),
        ("link.strap.strands.diameter", (0.02, "%")),
    ],
)
def test_steps_of_numbers(path, step):
    assert natural_step(path, 2.0) == step
