"""Interpolated maps, against full solutions."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses import known_analyses, settings
from suspension_cli.analyses.xcouple.imperfect_builds import ImperfectBuilds
from suspension_cli.design.derive import mirror
from suspension_cli.models import registry as models
from suspension_cli.physics.couplings import parse_request
from suspension_cli.studies.interpolated import determinants, interpolated
from suspension_cli.studies.job import Axis
from tools import map_trials
from tools.stability import map_errors

K = Axis("k", tuple(np.linspace(0.6, 1.4, 40)))
OFFSET = Axis("offset", tuple(np.linspace(-2e-3, 2e-3, 50)))


def job_of(name: str, *axes: Axis, frequency: str = "50", level: str = "string") -> ImperfectBuilds:
    design = sus.example(name)
    setting = settings.merge(known_analyses.get("xcouple"), design, {"frequency": frequency})
    system = models.by_name(level).system(design.design)
    asked = parse_request(system, setting, mirror(design.design))
    return ImperfectBuilds(design.text, axes, asked, level=level)


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
    mine = np.concatenate([one["ratio"] for one in parts])
    # a product of few rows may be summed in another order
    np.testing.assert_allclose(mine, whole, rtol=1e-14, atol=0)


def test_maps_with_failures_and_small_ones_are_solved_point_by_point():
    far = Axis("offset", tuple(np.linspace(-0.5, 0.5, 50)))
    assert interpolated(job_of("husman2000/figure6", K, far)) is None
    few = Axis("k", (0.9, 1.0, 1.1))
    assert interpolated(job_of("husman2000/figure6", few, OFFSET)) is None


def test_builds_whose_wires_push_give_no_numerical_warning():
    """A large offset leaves wires without tension, so nothing is interpolated."""
    offset = Axis("offset", tuple(np.linspace(-0.02, 0.02, 9)))
    job = job_of(
        "geo-silica-triple", offset, Axis("k", tuple(np.linspace(0.5, 2, 12))), level="beam"
    )
    with warnings.catch_warnings(action="error", category=RuntimeWarning):
        assert interpolated(job) is None


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


def test_commands_say_how_a_map_was_computed(tmp_path):
    design = sus.example("husman2000/figure6")
    asked = {"sweep": {"k": list(K.values), "offset": list(OFFSET.values)}, "fidelity": "string"}
    mapped = sus.xcouple(design, **asked)
    assert "points, interpolated at 2,000; largest difference at " in str(mapped)
    assert mapped.document()["interpolation"] == mapped.interpolation
    mapped.save(tmp_path / "map.h5")
    assert sus.load(tmp_path / "map.h5").interpolation == mapped.interpolation
    whole = sus.xcouple(design, **asked, every_point=True)
    assert whole.interpolation is None
    np.testing.assert_allclose(mapped.ratio, whole.ratio, rtol=1e-8, atol=1e-12)


def test_a_sweep_of_responses_is_a_map_too():
    design = sus.example("husman2000/table1-case3")
    asked = {
        "vary": {
            "stage.test.wires.l": np.linspace(0.4, 0.5, 40).tolist(),
            "stage.test.wires.s": np.linspace(0.02, 0.03, 30).tolist(),
        },
        "results": ["test.x/support.x:0.8", "test.pitch/test.x/support.x:3"],
        "fidelity": "string",
    }
    mapped = sus.sweep(design, **asked)
    assert "interpolated at 1,200" in mapped.interpolation
    whole = sus.sweep(design, **asked, every_point=True)
    np.testing.assert_allclose(mapped.value, whole.value, rtol=1e-7)
    np.testing.assert_allclose(mapped.response, whole.response, rtol=1e-7)


@pytest.mark.parametrize("level", ["string", "beam", "force"])
def test_maps_of_poses_loads_and_modes_are_those_of_all_points(level):
    design = sus.example("husman2000/table1-case3")
    asked = {
        "vary": {
            "stage.test.wires.l": np.geomspace(0.4, 0.5, 20).tolist(),
            "stage.test.wires.s": np.linspace(0.02, 0.03, 24).tolist(),
        },
        "results": [
            *("test height", "test static x", "tension test wires"),
            *("test pitch", "lowest yaw", "2"),
        ],
        "fidelity": level,
    }
    mapped = sus.sweep(design, **asked)
    assert "interpolated at 480" in mapped.interpolation
    whole = sus.sweep(design, **asked, every_point=True)
    np.testing.assert_allclose(mapped.value, whole.value, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(mapped.omega_squared, whole.omega_squared, rtol=1e-8)
    np.testing.assert_array_equal(mapped.label_mode, whole.label_mode)
    np.testing.assert_array_equal(mapped.rank, whole.rank)


def test_a_result_that_is_not_analytic_has_every_point_solved():
    design = sus.example("husman2000/table1-case3")
    numbers = np.linspace(0.4, 0.5, 40).tolist()
    asked = {"vary": {"stage.test.wires.l": numbers}, "fidelity": "string"}
    assert sus.sweep(design, results=["test height"], **asked).interpolation
    noisy = ["test height", "thermal test.x:10"]
    assert sus.sweep(design, results=noisy, **asked).interpolation is None


@pytest.mark.parametrize("seed", [3, 101, 104])
def test_stated_errors_are_honest(seed):
    found = map_trials.run(seed)
    assert found.stated is not None, found.text
    assert found.ratio < map_trials.HONEST, found


@pytest.mark.parametrize("trouble", map_errors.TROUBLES)
def test_stated_errors_are_honest_where_maps_are_hard(trouble):
    found = map_errors.compare(map_errors.TROUBLES[trouble]())
    has_failures = "slack" in trouble or "tips" in trouble
    assert (found.stated is None) == has_failures
    assert found.ratio < map_trials.HONEST
