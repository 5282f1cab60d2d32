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
from scipy import integrate, stats

from suspension_cli.analyses.named_quantities import names_of
from suspension_cli.analyses.tolerance.build_statistics import strongest, unit_ranks
from suspension_cli.analyses.tolerance.solve import RandomBuilds, find_quantities
from suspension_cli.design import reader
from suspension_cli.design.imperfections import named
from suspension_cli.design.schema import Distribution
from suspension_cli.linear import eigenmodes, response, signals
from suspension_cli.models import registry
from suspension_cli.physics.couplings import CouplingRequest
from suspension_cli.studies import builds, sampling
from tests.support import scenes
from tests.support.exchanging import SMALL
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
    return sampling.deviations(chosen, sampling.uniforms(seed, start, stop, len(chosen)))


def job_of(raw, count=100, seed=1, results=(), **more):
    """Random builds of a parsed design."""
    text = tomli_w.dumps(scenes.plain(raw))
    if results:
        known = names_of(reader.Source(reader.parse(text), text, ""))
        more["results"] = find_quantities(results, known, text)
    names = ("support", *(stage["name"] for stage in raw["stage"]))
    over, under = (signals.parse_output(f"{names[-1]}.{dof}@0,0,-0.001", names) for dof in "xz")
    return RandomBuilds(
        text,
        count,
        seed,
        CouplingRequest(0, 1, "", signals.parse_input("support.z", names), over, under, (50.0,)),
        **more,
    )


def frequencies(job, found):
    """Frequencies of all modes, Hz, in the columns of builds."""
    return found["value"][:, : len(job.modes)]


def statics(job, found):
    """Static poses of all bodies, in the columns of builds."""
    start = len(job.modes) + 1
    return found["value"][:, start : start + len(job.statics)].reshape(len(found["value"]), -1, 6)


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
    exact = sampling.standard_deviations(scattering(spread))
    np.testing.assert_allclose(exact, expected.std(), rtol=1e-6)
    correlation = np.corrcoef(
        np.concatenate([drawn.T, drawn.T[:, ::-1], np.roll(drawn, 1, axis=0).T])
    )
    assert np.abs(correlation - np.eye(9)).max() < 5 / np.sqrt(count)


@pytest.mark.parametrize("cut", [1e-6, 0.999e-3, 1.001e-3, 0.1, 1.0, 30.0])
def test_standard_deviations_of_cut_distributions(cut):
    """From the integral of the density, without the difference of nearly equal numbers."""
    x = np.linspace(-cut, cut, 200_001)
    density = np.exp(-(x**2) / 2)
    expected = 2e-3 * np.sqrt(integrate.simpson(x**2 * density, x) / integrate.simpson(density, x))
    chosen = scattering(Distribution(normal=2e-3, truncate=2e-3 * cut))
    assert sampling.standard_deviations(chosen)[0] == pytest.approx(expected, rel=1e-7)


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


WIRE = {
    "k": {"uniform": 0.01},
    "radius": {"normal": 0.005},
    "length": {"normal": 1e-5},
    "upper": {"normal": 1e-4, "truncate": 2e-4},
    "lower": {"uniform": 1e-4},
}
COM = [{"stage": "test", "com": {"normal": 1e-4}}]


def bladed():
    """Tolerances of every part, on a chain with blades, dampers and a frame."""
    rng = np.random.default_rng(41)
    upper = scenes.bladed_stage(rng, "upper", 4, 2, tip_mass=True)
    test = scenes.stage(rng, "test") | {"damping": {"x": 1.0}}
    frame = {"stiffness": {"x": 2e6, "pitch": 1e5}, "mass": 100.0, "inertia": [5.0, 5.0, 5.0]}
    tables = [
        {"stage": "upper"} | WIRE,
        {"wire": "test.2", "k": {"normal": 0.02}, "upper": {"normal": 1e-4}},
        {"wire": "upper.3", "k": {"normal": 0.02}},
    ]
    blade = [{"stage": "upper", "stiffness": {"normal": 0.01}}]
    table = {"wire": tables, "body": COM, "blade": blade}
    return scenes.raw_of(upper, test) | {"support": frame, "tolerance": table}


def bent():
    """Tolerances of a triple on wires that bend."""
    raw = tomllib.loads(TRIPLE.read_text())
    wire = {key: WIRE[key] for key in ("length", "upper", "lower")}
    return raw | {"tolerance": {"wire": [{"stage": "test"} | wire], "body": COM}}


def perturbations(job, drawn):
    """The deviations of one build as entries of its design; those of two tables add up."""
    found: dict[str, dict[str, object]] = {}
    for factor, deviation in zip(job.factors, drawn.tolist(), strict=True):
        label, what, *axis = factor.label.split()
        kind = "blade" if "blade" in label else "wire" if "." in label else "body"
        item = found.setdefault(label, {kind: label})
        if axis:
            vector = item.setdefault(f"{what}_offset", [0.0, 0.0, 0.0])
            vector["xyz".index(axis[0])] += deviation
        elif what == "length":
            item["length_change"] = deviation
        else:
            key = {"k": "k_factor"}.get(what, f"{what}_factor")
            item[key] = item.get(key, 1.0) + deviation
    for item in found.values():
        if "radius_factor" in item:
            item["k_factor"] *= item.pop("radius_factor") ** 2
    return [*found.values()]


@pytest.mark.parametrize(("kind", "level"), [(bladed, "string"), (bent, "beam")])
def test_builds_are_designs_with_these_perturbations(kind, level):
    """Frequencies and the ratio of each build, and of a design with its deviations, alone."""
    raw = kind()
    job = dataclasses.replace(job_of(raw, 8, 5), level=level)
    drawn, found = job.deviations(0, 8), job.compute(0, 8)
    good = np.flatnonzero(found["status"] == builds.GOOD)
    assert len(good) > 5
    for n in good[::2]:
        design = scenes.design_of(
            {key: value for key, value in raw.items() if key != "tolerance"}
            | {"perturbation": perturbations(job, drawn[n])}
        )
        model = registry.by_name(level).system(design)
        np.testing.assert_allclose(
            np.sort(frequencies(job, found)[n]), eigenmodes.solve(model).frequency, rtol=1e-8
        )
        ends = [job.question.input], [job.question.over, job.question.under]
        over, under = response.solve(model, np.array(job.question.frequency), *ends).value[0, :, 0]
        assert found["ratio"][n, 0] == pytest.approx(over / under, rel=1e-6)
    assert np.isnan(found["value"][found["status"] != builds.GOOD]).all()


def test_labels_go_through_a_crossing():
    """Vertical wires at the height of the COM: every degree of freedom is a mode, and a rotation
    goes with I^(-1/2)."""
    raw = table_1(1) | {"tolerance": {"body": [{"stage": "test", "inertia": {"uniform": 0.9}}]}}
    job = job_of(raw, 500)
    found, deviations = job.compute(0, 500), job.deviations(0, 500)
    value = frequencies(job, found)
    assert not found["status"].any()
    home = [dof for _, dof in job.nominal.home]
    assert sorted(home) == sorted(["x", "y", "z", "roll", "pitch", "yaw"])
    for n, dof in enumerate(home):
        turned = {"roll": 0, "pitch": 1, "yaw": 2}.get(dof)
        factor = 1.0 if turned is None else 1 + deviations[:, turned]
        np.testing.assert_allclose(
            value[:, n], job.nominal.frequency[n] / np.sqrt(factor), rtol=1e-9
        )
    # they did cross
    assert (value[:, home.index("pitch")] > value[:, home.index("z")]).sum() > 20
    assert (value[:, home.index("pitch")] > value[:, home.index("roll")]).sum() > 5


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


def test_a_required_mode_is_in_each_build_the_one_with_its_label():
    """Builds of a mirror whose pitch and pendulum modes exchange their character when the height of
    its wires varies, against the table of modes of each build alone."""
    raw = tomllib.loads(SMALL)
    raw["stage"][0]["wires"]["d"] = 9e-4
    raw["tolerance"] = {"wire": [{"stage": "test", "lower": {"normal": 2e-4}}]}
    job = job_of(raw, 60, results=["test pitch"])
    found, drawn = job.compute(0, 60), job.deviations(0, 60)
    pitch = job.nominal.label.index("test pitch")
    exchanged = 0
    for n in range(60):
        design = scenes.design_of(
            {key: value for key, value in raw.items() if key != "tolerance"}
            | {"perturbation": perturbations(job, drawn[n])}
        )
        alone = eigenmodes.solve(registry.STRING.system(design))
        exchanged += pitch != alone.label.index("test pitch")
        own = alone.frequency[alone.label.index("test pitch")]
        assert frequencies(job, found)[n, pitch] == pytest.approx(own, rel=1e-8)
        fractions = np.sort(alone.fractions[:, alone.coordinate.index("test.pitch")])
        assert found["shared"][n, 0] == (fractions[-2] >= 0.8 * fractions[-1])
    assert 5 < exchanged < 55
    assert 0 < found["shared"].sum() < 60
