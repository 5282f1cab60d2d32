"""Random builds: the numbers that are drawn, how they get into a scene, and which mode of a build
is which of the design."""

from __future__ import annotations

import dataclasses
import tomllib

import numpy as np
import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from suspension_cli.analyses.tolerance.solve import RandomBuilds
from suspension_cli.analyses.tolerance.statistics import strongest, unit_ranks
from suspension_cli.analyses.xcouple.solve import CouplingRequest
from suspension_cli.design.imperfections import named
from suspension_cli.design.schema import Distribution
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.linear import eigenmodes, response, signals
from suspension_cli.models import registry
from suspension_cli.models import string as string_model
from suspension_cli.models.surroundings import surrounded
from suspension_cli.studies import builds, sample_points, sampling
from tests.support import scenes
from tests.support.golden import CONFIGS
from tests.support.paper import table_1

TRIPLE = CONFIGS / "triple-tolerance.toml"
LENGTH = named("wire", "length_change")
SPREADS = {
    "normal": (Distribution(normal=2e-3), stats.norm(scale=2e-3)),
    "uniform": (Distribution(uniform=5e-4), stats.uniform(-5e-4, 1e-3)),
    "truncated": (Distribution(normal=2e-3, truncate=3e-3), stats.truncnorm(-1.5, 1.5, scale=2e-3)),
    "cut short": (
        Distribution(normal=2e-3, truncate=1e-4),
        stats.truncnorm(-0.05, 0.05, scale=2e-3),
    ),
    "hardly cut": (Distribution(normal=2e-3, truncate=0.1), stats.norm(scale=2e-3)),
}


def scattering(*spreads):
    """Factors with these distributions."""
    return tuple(
        sampling.ScatteredNumber(f"test.{n} length", n, LENGTH, 0, spread)
        for n, spread in enumerate(spreads)
    )


def drawn_by(chosen, seed, start, stop):
    """Deviations of random builds."""
    return sampling.deviations(chosen, sample_points.uniforms(seed, start, stop, len(chosen)))


def job_of(raw, count=100, seed=1, **more):
    """Random builds of a parsed design."""
    names = ("support", *(stage["name"] for stage in raw["stage"]))
    over, under = (signals.parse_output(f"{names[-1]}.{dof}@0,0,-0.001", names) for dof in "xz")
    return RandomBuilds(
        tomli_w.dumps(scenes.plain(raw)),
        count,
        seed,
        CouplingRequest(0, 1, "", signals.parse_input("support.z", names), over, under, (50.0,)),
        **more,
    )


@pytest.mark.parametrize("kind", SPREADS)
def test_distributions(kind):
    spread, expected = SPREADS[kind]
    count = 50_000
    drawn = drawn_by(scattering(spread, spread, spread), 3, 0, count)
    for column in drawn.T:
        # Kolmogorov and Smirnov: above this once in a hundred; the seed is fixed
        assert stats.kstest(column, expected.cdf).statistic < 1.63 / np.sqrt(count)
        assert abs(column.mean()) < 4 * expected.std() / np.sqrt(count)
        assert column.std() == pytest.approx(expected.std(), rel=0.01)
        low, high = expected.support()
        assert low - 1e-18 <= column.min() <= column.max() <= high + 1e-18
    correlation = np.corrcoef(
        np.concatenate([drawn.T, drawn.T[:, ::-1], np.roll(drawn, 1, axis=0).T])
    )
    assert np.abs(correlation - np.eye(9)).max() < 5 / np.sqrt(count)


def test_the_ends_of_the_uniform_numbers():
    """The smallest and the largest number that a generator can give: finite, within bounds, and as
    far out as each other."""
    low, high, middle = sampling.deviations(
        scattering(*(spread for spread, _ in SPREADS.values())),
        np.array([[0.0] * 5, [1 - 2.0**-53] * 5, [0.5] * 5]),
    )
    bound = np.array([2e-3 * 9, 5e-4, 3e-3, 1e-4, 2e-3 * 9])
    assert (np.abs(low) <= bound).all()
    assert (np.abs(high) <= bound).all()
    np.testing.assert_allclose(high, -low, rtol=0.02)
    assert np.abs(middle).max() < 1e-15


@settings(deadline=None, max_examples=60)
@given(
    st.integers(0, 2**64 - 1),
    st.integers(0, 10**9),
    st.integers(0, 30),
    st.integers(1, 40),
    st.integers(1, 9),
)
def test_a_build_draws_the_same_numbers_whoever_is_drawn_with_it(seed, start, ahead, count, width):
    chosen = scattering(*(spread for spread, _ in (list(SPREADS.values()) * 2)[:width]))
    several = drawn_by(chosen, seed, start, start + ahead + count)
    assert np.array_equal(
        several[ahead:], drawn_by(chosen, seed, start + ahead, start + ahead + count)
    )
    assert len(np.unique(several)) == several.size
    assert not np.isin(
        several, drawn_by(chosen, (seed + 1) % 2**64, start, start + ahead + count)
    ).any()


def everything():
    """Every key of a tolerance table, on a chain with blades."""
    rng = np.random.default_rng(41)
    raw = scenes.raw_of(
        scenes.bladed_stage(rng, "upper", 4, 2, tip_mass=True), scenes.stage(rng, "test")
    )
    wire = {
        "k": {"uniform": 0.01},
        "radius": {"normal": 0.005},
        "length": {"normal": 1e-5},
        "upper": {"normal": 1e-4, "truncate": 2e-4},
        "lower": {"uniform": 1e-4},
    }
    tables = [
        {"stage": "upper"} | wire,
        {"wire": "test.2", "k": {"normal": 0.02}, "upper": {"normal": 1e-4}},
        {"wire": "upper.3", "k": {"normal": 0.02}},
    ]
    body = [
        {
            "stage": "test",
            "mass": {"normal": 0.001},
            "inertia": {"normal": 0.01},
            "com": {"normal": 1e-4},
        }
    ]
    return raw | {
        "tolerance": {
            "wire": tables,
            "body": body,
            "blade": [{"stage": "upper", "stiffness": {"normal": 0.01}}],
        }
    }


def test_deviations_get_into_the_scene():
    job = job_of(everything())
    scene, base, drawn = (
        sampling.imperfect(job.scene, job.factors, job.deviations(0, 50)),
        job.scene,
        job.deviations(0, 50),
    )

    def sum_of(label):
        return sum(drawn[:, n] for n, factor in enumerate(job.factors) if factor.label == label)

    wires, bodies = scene.wires, scene.bodies
    for n, label in enumerate(wires.label):
        # named by two tables, deviations add up
        k = (1 + sum_of(f"{label} k")) * (1 + sum_of(f"{label} radius")) ** 2
        np.testing.assert_allclose(wires.stiffness[:, n], base.wires.stiffness[n] * k, rtol=1e-14)
        np.testing.assert_allclose(
            wires.tension[:, n],
            base.wires.tension[n] - wires.stiffness[:, n] * sum_of(f"{label} length"),
            rtol=1e-13,
        )
        for axis, name in enumerate("xyz"):
            lower = base.wires.lower_point[n, axis] + sum_of(f"{label} lower {name}")
            if label.startswith("test"):
                lower = lower - sum_of(f"test com {name}")
            np.testing.assert_allclose(wires.lower_point[:, n, axis], lower, atol=1e-16)
            np.testing.assert_allclose(
                wires.upper_point[:, n, axis],
                base.wires.upper_point[n, axis] + sum_of(f"{label} upper {name}"),
                atol=1e-16,
            )
    np.testing.assert_allclose(
        bodies.mass[:, 1], base.bodies.mass[1] * (1 + sum_of("test mass")), rtol=1e-15
    )
    for axis, name in enumerate("xyz"):
        np.testing.assert_allclose(
            bodies.inertia[:, 1, axis, axis],
            base.bodies.inertia[1, axis, axis] * (1 + sum_of(f"test inertia {name}")),
            rtol=1e-14,
        )
        np.testing.assert_allclose(
            bodies.position[:, 2, axis],
            base.bodies.position[2, axis] + sum_of(f"test com {name}"),
            atol=1e-16,
        )
    for n, label in enumerate(scene.blades.label):
        np.testing.assert_allclose(
            scene.blades.stiffness[:, n, 2],
            base.blades.stiffness[n, 2] * (1 + sum_of(f"{label} stiffness")),
            rtol=1e-14,
        )


def one_of(scene, base, number):
    """One scene of a batch."""

    def part(group, plain):
        values = {f.name: getattr(group, f.name) for f in dataclasses.fields(group)}
        return dataclasses.replace(
            group,
            **{
                k: v[number]
                for k, v in values.items()
                if isinstance(v, np.ndarray) and v.ndim > getattr(plain, k).ndim
            },
        )

    return dataclasses.replace(
        scene,
        **{name: part(getattr(scene, name), getattr(base, name)) for name in scene.parts},
    )


@pytest.mark.parametrize("kind", ["everything", "triple", "damped on a frame", "on beam"])
def test_frequencies_are_those_of_each_build_alone(kind):
    raw = tomllib.loads(TRIPLE.read_text()) if kind in ("triple", "on beam") else everything()
    if kind == "damped on a frame":
        raw = raw | {
            "support": {
                "stiffness": {"x": 2e6, "pitch": 1e5},
                "mass": 100.0,
                "inertia": [5.0, 5.0, 5.0],
            }
        }
        raw["stage"][1]["damping"] = {"x": 1.0}
    bent = kind == "on beam"
    job = (
        dataclasses.replace(job_of(raw, 16, 5), text=tomli_w.dumps(raw), level="beam")
        if bent
        else job_of(raw, 16, 5)
    )
    found, scene = (
        job.compute(0, 16),
        sampling.imperfect(job.scene, job.factors, job.deviations(0, 16)),
    )
    good = np.flatnonzero(found["status"] == builds.GOOD)
    assert len(good) > 11
    for n in good[::4] if bent else good:
        alone = one_of(scene, job.scene, n)
        plain = (
            registry.BEAM.of_scene(registry.BEAM.completed(alone, job.design), job.design)
            if bent
            else string_model.linear_model(alone)
        )
        model = surrounded(plain, job.design)
        np.testing.assert_allclose(
            np.sort(found["frequency"][n]),
            eigenmodes.solve(model).frequency,
            rtol=1e-9 if bent else 1e-10,
        )
        if bent:
            requested = job.question
            over, under = response.solve(
                model,
                np.array(requested.frequency),
                [requested.input],
                [requested.over, requested.under],
            ).value[0, :, 0]
            assert found["ratio"][n, 0] == pytest.approx(over / under, rel=1e-7)
        assert found["residual"][n] < equilibrium.CONVERGED
    assert np.isnan(found["frequency"][found["status"] != builds.GOOD]).all()


def test_labels_go_through_a_crossing():
    """Vertical wires at the height of the COM: every degree of freedom is a mode, and a rotation
    goes with I^(-1/2)."""
    raw = table_1(1) | {"tolerance": {"body": [{"stage": "test", "inertia": {"uniform": 0.9}}]}}
    job = job_of(raw, 500)
    found, deviations = job.compute(0, 500), job.deviations(0, 500)
    assert not found["status"].any()
    home = [dof for _, dof in job.nominal.home]
    assert sorted(home) == sorted(["x", "y", "z", "roll", "pitch", "yaw"])
    for n, dof in enumerate(home):
        turned = {"roll": 0, "pitch": 1, "yaw": 2}.get(dof)
        factor = 1.0 if turned is None else 1 + deviations[:, turned]
        np.testing.assert_allclose(
            found["frequency"][:, n], job.nominal.frequency[n] / np.sqrt(factor), rtol=1e-9
        )
    # they did cross
    assert (
        found["frequency"][:, home.index("pitch")] > found["frequency"][:, home.index("z")]
    ).sum() > 20
    assert (
        found["frequency"][:, home.index("pitch")] > found["frequency"][:, home.index("roll")]
    ).sum() > 5


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32), st.integers(3, 60), st.integers(1, 4), st.integers(1, 4))
def test_rank_correlation_is_spearmans(seed, count, left, right):
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(count, left)), rng.normal(size=(count, right))
    b[:, 0] += a[:, 0]
    found = unit_ranks(a).T @ unit_ranks(b)
    for (i, j), value in np.ndenumerate(found):
        expected = stats.spearmanr(a[:, i], b[:, j]).statistic
        assert value == pytest.approx(expected, abs=1e-12)


def test_rank_correlation_of_what_does_not_vary():
    a = unit_ranks(np.arange(10.0)[:, None])
    assert a.T @ unit_ranks(np.ones((10, 1))) == 0
    assert a.T @ unit_ranks(-(np.arange(10.0)[:, None] ** 3)) == pytest.approx(-1, rel=1e-15)
    assert strongest(np.array([0.1, -0.9, 0.5]), 2) == [1, 2]
