"""Interpolated maps of cross-couplings, against full solutions."""

from __future__ import annotations

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses import registry, settings
from suspension_cli.analyses.xcouple.solve import Sweep
from suspension_cli.design.derive import mirror
from suspension_cli.models import registry as models
from suspension_cli.physics.couplings import parse_request
from suspension_cli.studies.interpolated import determinants, interpolated
from suspension_cli.studies.job import Axis

K = Axis("k", tuple(np.linspace(0.6, 1.4, 40)))
OFFSET = Axis("offset", tuple(np.linspace(-2e-3, 2e-3, 50)))


def job_of(name: str, *axes: Axis, frequency: str = "50", level: str = "string") -> Sweep:
    design = sus.example(name)
    setting = settings.merge(registry.get("xcouple"), design, {"frequency": frequency})
    system = models.by_name(level).system(design.design)
    asked = parse_request(system, setting, mirror(design.design))
    return Sweep(design.text, axes, asked, level=level)


@pytest.mark.parametrize(
    ("name", "frequency", "level"),
    [
        ("husman2000/figure6", "50", "string"),
        ("husman2000/table2", "50", "string"),  # the roll mode crosses the map
        ("husman2000/table2", "3.3,50", "beam"),
    ],
)
def test_a_map_of_few_points_is_that_of_all(name, frequency, level):
    job = job_of(name, K, OFFSET, frequency=frequency, level=level)
    found = interpolated(job)
    assert found is not None
    assert found.surface.points < job.count / 4
    assert found.error < 1e-7
    some = np.random.default_rng(7).integers(job.count, size=8)
    largest = 0.0
    for point in some.tolist():
        exact = job.compute(point, point + 1)
        mine = found.compute(point, point + 1)
        assert mine["status"] == exact["status"]
        for column in ("ratio", "over", "under"):
            scale = np.abs(exact[column]) + 1e-6 * np.abs(exact["under"])
            largest = max(largest, float((np.abs(mine[column] - exact[column]) / scale).max()))
    assert largest < 1e-7


def test_parts_of_a_map_are_those_of_the_whole():
    found = interpolated(job_of("husman2000/figure6", K, OFFSET))
    assert found is not None
    whole = found.compute(0, found.count)["ratio"]
    parts = [found.compute(start, min(start + 333, found.count)) for start in range(0, 2000, 333)]
    np.testing.assert_array_equal(np.concatenate([one["ratio"] for one in parts]), whole)


def test_maps_with_failures_and_small_ones_are_solved_point_by_point():
    far = Axis("offset", tuple(np.linspace(-0.5, 0.5, 50)))
    assert interpolated(job_of("husman2000/figure6", K, far)) is None
    few = Axis("k", (0.9, 1.0, 1.1))
    assert interpolated(job_of("husman2000/figure6", few, OFFSET)) is None


def test_the_determinant_is_the_product_over_modes():
    design = sus.example("husman2000/figure6")
    system = models.by_name("string").system(design.design)
    job = job_of("husman2000/figure6", Axis("k", (1.0, 1.1)))
    [(found, _)] = job._balanced({"k": np.array([1.0])})
    omega = 2 * np.pi * 3.0
    from suspension_cli.linear import eigenmodes

    squared = eigenmodes.solve(system.constant).omega_squared
    expected = np.prod((squared - omega**2) / (squared + omega**2))
    np.testing.assert_allclose(determinants(found.model, omega), [expected], rtol=1e-6)
