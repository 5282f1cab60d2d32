"""`auto` takes the cheapest model within the tolerance of the requested result; errors are those
against `violin`, on random designs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from suspension_cli.design.reader import Source
from suspension_cli.errors import InputError
from suspension_cli.linear import eigenmodes
from suspension_cli.models import choice, registry, spectrum_error
from suspension_cli.models.choice import Systems, Transfer
from suspension_cli.physics import model_choice, thermal_noise, wire_modes
from tests.support import plants, scenes
from tests.support.pendulums import Pendulum

TOLERANCE = 1e-3


def random_design(seed):
    """One to four stages, symmetric or (every fourth) leaning blades, on wires from hairs to
    rods."""
    rng = np.random.default_rng([31, seed])
    count = 1 + seed % 4 if seed % 8 < 6 else 2
    raw = (
        scenes.bladed_chain(rng, min(count, 2), tip_mass=False, lateral=False)
        if seed % 4 == 3
        else scenes.chain(rng, count)
    )
    return scenes.design_of(
        scenes.fibred(raw, float(10 ** rng.uniform(6.5, 9)), ribbons=bool(rng.random() < 0.2))
    )


def source_of(design):
    return Source(design, "", "design.toml")


def for_modes(design, tolerance=TOLERANCE, wanted="auto"):
    return model_choice.for_modes(source_of(design), wanted, tolerance)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("wanted", ["auto", "string", "beam"])
def test_frequencies_of_modes(seed, wanted):
    """The error that is stated is that against wires with distributed mass, solved apart."""
    design = random_design(seed)
    chosen, model = for_modes(design, wanted=wanted)
    if chosen.model.has_wire_mass or not math.isfinite(chosen.error):
        return
    quick = eigenmodes.solve(model)
    violin = registry.VIOLIN.system(design)
    slow = wire_modes.solve(violin, 1.2 * float(quick.frequency[-1]))
    count = 6 * len(model.body)
    mass = violin.mass[6 : 6 + count, 6 : 6 + count]
    overlap = np.abs(slow.shape[:, :count] @ mass @ quick.shape[:, :count].T)
    rows, columns = linear_sum_assignment(-overlap)
    paired = overlap[rows, columns] > 0.7  # modes that mix with a violin mode have no partner
    paired &= quick.frequency[columns] > 0
    error = np.abs(quick.frequency[columns] / slow.frequency[rows] - 1)[paired].max()
    assert error <= 1.05 * chosen.error + 1e-7
    if wanted == "auto":
        assert error <= TOLERANCE


@pytest.mark.parametrize("seed", range(3))
def test_responses_neglect_nothing(seed):
    """Simpler models lack the loss of wires that bend, and so the heights of peaks."""
    design = random_design(seed)
    drive = plants.drives(registry.STRING.system(design), "support.x")
    motion = plants.motions(registry.STRING.system(design), f"{design.stage[-1].name}.x")
    wanted = Transfer(drive, motion, np.geomspace(0.05, 20, 300))
    chosen, model = model_choice.choose(source_of(design), "auto", lambda _: wanted)
    assert (chosen.level, chosen.error) == ("violin", 0.0)
    assert "neglected" not in chosen.reason
    explicit, simple = model_choice.choose(source_of(design), "string", lambda _: wanted)
    some = spectrum_error.away_from_modes(wanted.frequency, simple, model)
    old, new = (wanted.values(one, some)[:, 0, 0] for one in (simple, model))
    change = np.abs(old / new - 1)
    assert explicit.error >= 0.9 * change[change < 0.1].max()


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("output", ["x", "pitch"])
def test_the_error_at_a_few_frequencies_is_that_at_all(seed, output, monkeypatch):
    """Also where the more complete model has a narrow zero, or modes of wires."""
    design = random_design(seed)
    models = registry.STRING.system(design), registry.VIOLIN.system(design)
    drive = plants.drives(models[0], "support.x")
    motion = plants.motions(models[0], f"{design.stage[-1].name}.{output}")
    wanted = Transfer(drive, motion, np.geomspace(0.05, 50, 2000))
    solved = []

    def values(solver, frequency):
        solved.append((solver.system is models[1]) * len(frequency))
        return wanted.values(solver, frequency)

    few = spectrum_error.largest_error(wanted.frequency, *models, values)
    assert sum(solved) < 600 or spectrum_error.first_violin(models[1]) < 50
    monkeypatch.setattr(spectrum_error, "EVENLY", len(wanted.frequency))
    every = spectrum_error.largest_error(wanted.frequency, *models, values)
    assert 0.8 * every.value <= few.value <= every.value * (1 + 1e-9)


def test_a_response_is_not_zero_because_it_is_in_a_simpler_model():
    """Wires that end at effective bending points in the COM leave pitch alone on strings; torsion
    and bending of real wires do not."""
    wires = {"count": 4, "l": 0.4, "s": 0.02, "t1": 0.05, "t2": 0.05, "d": 0.0}
    wires |= {"material": "c70steel", "radius": 2e-4, "clamp": "bending-point"}
    stage = {"name": "b1", "body": {"mass": 5.0, "inertia": [0.02] * 3}, "wires": wires}
    design = scenes.design_of({"design": {"name": "one"}, "stage": [stage]})
    drive = plants.drives(registry.STRING.system(design), "support.pitch")
    motion = plants.motions(registry.STRING.system(design), "b1.pitch")
    wanted = Transfer(drive, motion, np.array([0.1, 3.0]))
    chosen, model = model_choice.choose(source_of(design), "auto", lambda _: wanted, tolerance=0.1)
    truth = wanted.values(registry.VIOLIN.system(design), wanted.frequency)
    assert (wanted.values(model, wanted.frequency) == truth).all()
    assert (truth != 0).all() and chosen.error == 0.0


@pytest.mark.parametrize("level", ["beam", "violin"])
def test_thermal_noise(level):
    """Neglecting mass changes the noise by 0.82 (f/f1)^2 for a mass that keeps its wire's end
    upright, as the slope of the wire at its ends changes (a string with mass)."""
    one = Pendulum(inertia=1e6, radius=2e-5)
    design = scenes.design_of(one.raw())
    area = math.pi * one.radius**2
    first = math.sqrt(one.tension / (one.density * area)) / (2 * one.length)
    assert spectrum_error.first_violin(registry.BEAM.system(design)) == pytest.approx(
        first, rel=1e-12
    )
    grid = np.array([0.03 * first])
    chosen, _ = thermal_noise.choose(source_of(design), level, grid, ["test.x"])
    assert chosen.level == level
    expected = math.pi**2 / 12 * 0.03**2 if level == "beam" else 0.0
    assert chosen.error == pytest.approx(expected, rel=0.05)
    assert thermal_noise.choose(source_of(design), "auto", grid, ["test.x"])[0].level == "violin"


@pytest.mark.parametrize("wanted", ["closed-form", "force", "string"])
def test_models_without_thermal_noise_are_refused(wanted):
    design = scenes.design_of(Pendulum().raw())
    with pytest.raises(InputError, match="take auto, beam or violin"):
        thermal_noise.choose(source_of(design), wanted, np.ones(1), ["test.x"])


def test_mass_of_swinging_wires_is_a_third():
    """Straight wires have a third of the kinetic energy that they would have at their lower end."""
    wires = {"count": 4, "l": 0.5, "s": 0.1, "t1": 0.1, "t2": 0.1, "d": 0.0}
    wires |= {"material": "plain", "radius": 1e-4, "k": 1e6}
    steel = {"youngs_modulus": 2e11, "poisson_ratio": 0.3, "density": 7800.0}
    stage = {"name": "test", "body": {"mass": 4.0, "inertia": [0.02] * 3}, "wires": wires}
    raw = {"design": {"name": "one"}, "materials": {"plain": steel}, "stage": [stage]}
    design = scenes.design_of(raw)
    systems = Systems(design)
    modes, changes = choice.shifts(systems(registry.BEAM), systems(registry.VIOLIN))
    swing = next(n for n, home in enumerate(modes.home) if home[1] == "y")
    weight = 4 * 7800 * math.pi * 1e-8 * 0.5
    assert changes[swing] == pytest.approx(weight / 3 / 4.0 / 2, rel=0.05)


def test_a_body_free_to_spin_needs_the_torsion_of_its_wire():
    """A string lets it spin; that mode is a torsion pendulum, however thin the wire."""
    stage = scenes.hung(
        {"count": 1, "l": 0.4, "d": 0.01, "material": "c70steel", "radius": 1e-4}, 5.0, 0.02
    )
    chosen, model = for_modes(scenes.design_of({"design": {"name": "one"}, "stage": [stage]}), 0.1)
    assert chosen.level == "beam"
    assert (eigenmodes.solve(model).frequency > 0).all()


def test_a_tighter_tolerance_takes_more():
    """Of all models, with the error of each computed."""
    design = random_design(4)
    levels = []
    for tolerance in (0.9, 1e-3, 1e-9):
        compare = Systems(design).compare(lambda _: choice.Frequencies())
        found = choice.choose(design, "auto", registry.MODELS, compare, tolerance)
        assert found.error <= tolerance
        levels.append(registry.LEVELS.index(found.level))
    assert levels == sorted(levels)
    assert registry.LEVELS[levels[-1]] == "violin"


@pytest.mark.parametrize(("tolerance", "missed"), [(1e-9, True), (1.0, False)])
def test_a_tolerance_that_the_models_allowed_cannot_keep_is_reported(tolerance, missed):
    chosen, _ = model_choice.for_modes(
        source_of(random_design(4)), "auto", tolerance, massless=True
    )
    assert chosen.level == "beam"
    assert ("not met by any model" in chosen.reason) == missed
