"""`auto` takes the cheapest model within the tolerance of the requested result, and estimates its
error: compared with `violin` on random designs."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

import suspension_cli as sus
from suspension_cli.analyses.modes import wire_modes
from suspension_cli.analyses.thermal import solve as thermal
from suspension_cli.design.reader import read
from suspension_cli.linear import eigenmodes, response
from suspension_cli.models import auto, registry, wire_mass
from suspension_cli.models.quantity_of_interest import NEAR, Frequencies, Transfer
from tests.support import plants, scenes
from tests.support.paths import CONFIGS

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


def away(frequency, known):
    return frequency[(np.abs(frequency[:, None] / known[known > 0] - 1) > 2 * NEAR).all(1)]


@pytest.mark.parametrize("seed", range(4))
def test_frequencies_of_modes(seed):
    """The modes of bodies on the model taken against those with distributed wires; the estimate is
    not far off."""
    design = random_design(seed)
    decision = auto.decide(design, lambda _: Frequencies(), TOLERANCE)
    model = registry.VIOLIN.system(design)
    quick = eigenmodes.solve(decision.model)
    slow = wire_modes.solve(model, 1.2 * float(quick.frequency[-1]))
    if decision.choice.level == "violin":
        return
    count = 6 * len(model.body)
    mass = model.mass[6 : 6 + count, 6 : 6 + count]
    overlap = np.abs(slow.shape[:, :count] @ mass @ quick.shape[:, :count].T)
    rows, columns = linear_sum_assignment(-overlap)
    paired = overlap[rows, columns] > 0.7  # modes that mix with a violin mode have no partner
    assert paired.sum() >= count - 2
    error = np.abs(quick.frequency[columns] / slow.frequency[rows] - 1)[paired].max()
    assert error <= TOLERANCE
    assert error <= 3 * decision.choice.error + 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_responses(seed):
    """From the support to the last body, away from resonances; of some, above most modes."""
    design = random_design(seed)
    base = registry.STRING.system(design)
    drive, motion = plants.drives(base, "support.x"), plants.motions(base, f"{base.body[-1]}.x")
    grid = np.geomspace(5 if seed % 3 == 2 else 0.05, 20, 300)
    decision = auto.decide(design, lambda _: Transfer(drive, motion, grid), TOLERANCE)
    truth = registry.VIOLIN.system(design)
    known = np.concatenate([eigenmodes.solve(model).frequency for model in (decision.model, truth)])
    frequency = away(grid, known)
    old, new = (
        response.solve(model, frequency, drive, motion).value[:, 0, 0]
        for model in (decision.model, truth)
    )
    slope = np.abs(np.gradient(np.log(np.abs(new) + 1e-300), np.log(frequency)))
    plain = slope < 20  # not next to a zero
    assert (np.abs(old / new - 1)[plain] <= TOLERANCE).all()


@pytest.mark.parametrize("seed", range(4))
def test_thermal_noise(seed):
    design = random_design(seed)
    first = wire_mass.effect_on_noise(design, 1.0).lowest
    grid = np.geomspace(
        0.02 * 10 ** (seed % 3 - 1) * first / 30, 0.02 * 10 ** (seed % 3 - 1) * first, 100
    )
    choice = auto.for_thermal_noise(design, "auto", float(grid[-1]), TOLERANCE)
    taken, truth = (registry.by_name(level).system(design) for level in (choice.level, "violin"))
    known = np.concatenate([eigenmodes.solve(model).frequency for model in (taken, truth)])
    frequency = away(grid, known)
    old, new = (
        thermal.solve(
            model, frequency, *reversed(thermal.parse_motion(model, f"{model.body[-1]}.x")), 290.0
        ).amplitude
        for model in (taken, truth)
    )
    assert old == pytest.approx(new, rel=TOLERANCE if choice.level == "beam" else 1e-12)


def test_hairs_stay_strings():
    """Wires so thin that bending and mass are under the tolerance by far are not solved as beams at
    all."""
    wires = {
        "count": 4,
        "l": 0.4,
        "s": 0.02,
        "t1": 0.05,
        "t2": 0.06,
        "d": 0.005,
        "material": "hair",
        "radius": 2e-4,
        "k": 1e4,
    }
    stage = {"name": "test", "body": {"mass": 5.0, "inertia": [0.02, 0.02, 0.02]}, "wires": wires}
    hair = {"youngs_modulus": 1e7, "poisson_ratio": 0.3, "density": 1.0}
    raw = {"design": {"name": "hairs"}, "materials": {"hair": hair}, "stage": [stage]}
    decision = auto.decide(scenes.design_of(raw), lambda _: Frequencies(), 1e-2)
    assert decision.choice.level == "force"
    assert all(not item.taken for item in decision.refinements)


def test_a_body_free_to_spin_needs_the_torsion_of_its_wire():
    """A string lets it spin; that mode is a torsion pendulum, however thin the wire."""
    stage = {
        "name": "test",
        "body": {"mass": 5.0, "inertia": [0.02] * 3},
        "wires": {"count": 1, "l": 0.4, "d": 0.01, "material": "c70steel", "radius": 1e-4},
    }
    decision = auto.decide(
        scenes.design_of({"design": {"name": "one"}, "stage": [stage]}),
        lambda _: Frequencies(),
        0.1,
    )
    assert decision.choice.level == "beam"
    assert (eigenmodes.solve(decision.model).frequency > 0).all()


@pytest.mark.parametrize("name", ["husman2000/table2", "triple-damped"])
def test_bending_points_are_those_of_strings(name):
    """Where a design gives the points at which its wires seem to bend, beams clamped beyond them
    move as strings do, but for torsion and (u/l)^2."""
    design = read(CONFIGS / f"{name}.toml").design
    thin, thick = (
        eigenmodes.solve(registry.by_name(level).system(design)) for level in ("string", "beam")
    )
    error = np.abs(thick.frequency / thin.frequency - 1)
    yaw = np.array([home[1] == "yaw" for home in thin.home])
    assert error[~yaw].max() < 2e-4
    assert error[yaw].max() < 2e-3
    clamped = msgspec.structs.replace(design, stage=[_clamped(stage) for stage in design.stage])
    assert (
        np.abs(eigenmodes.solve(registry.BEAM.system(clamped)).frequency / thin.frequency - 1).max()
        > 0.05
    )


def test_bending_points_of_thick_ends():
    """A fibre with ends ten times as thick, shorter than their own bending length: the bending
    points are still those that the design gives."""
    wires = {
        "count": 4,
        "l": 0.4,
        "s": 0.02,
        "t1": 0.08,
        "t2": 0.08,
        "d": 0.002,
        "material": "fused-silica",
        "clamp": "bending-point",
    }
    wires["sections"] = [
        {"length": 0.02, "radius": 1.5e-3},
        {"radius": 1.5e-4},
        {"length": 0.02, "radius": 1.5e-3},
    ]
    stage = {"name": "test", "body": {"mass": 10.0, "inertia": [0.05, 0.04, 0.04]}, "wires": wires}
    design = scenes.design_of({"design": {"name": "thick"}, "stage": [stage]})
    thin, thick = (
        eigenmodes.solve(registry.by_name(level).system(design)) for level in ("string", "beam")
    )
    assert thick.of("x") == pytest.approx(thin.of("x"), rel=1e-2)
    assert thick.of("y") == pytest.approx(thin.of("y"), rel=1e-2)


def _clamped(stage):
    return msgspec.structs.replace(stage, wires=msgspec.structs.replace(stage.wires, clamp="wire"))


def test_a_tighter_tolerance_takes_more():
    design = random_design(4)
    levels = [
        auto.decide(design, lambda _: Frequencies(), tolerance).choice.level
        for tolerance in (0.3, 1e-3, 1e-9)
    ]
    order = [registry.LEVELS.index(level) for level in levels]
    assert order == sorted(order)
    assert levels[-1] == "violin"


def test_a_response_that_symmetry_forbids_has_no_error():
    """From vertical to longitudinal in a symmetric chain, with wires whose mass would change any
    other response: the bound for all responses is no reason then."""
    design = random_design(0)
    base = registry.STRING.system(design)
    drive, frequency = plants.drives(base, "support.z"), np.geomspace(0.1, 100, 50)
    for output, reason in (("x", "exactly 0"), ("z", "wire")):
        motion = plants.motions(base, f"{design.stage[-1].name}.{output}")
        for highest in (None, 100.0):
            wanted = Transfer(drive, motion, frequency)
            decision = auto.decide(design, lambda _, own=wanted: own, 1e-6, highest=highest)
            assert decision.choice.level == "violin"
            assert decision.choice.error == 0.0
            assert reason in decision.choice.reason


def test_a_tolerance_that_the_models_allowed_cannot_keep_is_reported():
    design = random_design(4)
    for tolerance, says in ((1e-9, True), (1.0, False)):
        reason = auto.decide(design, lambda _: Frequencies(), tolerance, "beam").choice.reason
        assert ("not met by any model" in reason) == says


def test_wires_of_unknown_section_are_reported():
    raw = scenes.chain(np.random.default_rng(1), 1)
    decision = auto.decide(scenes.design_of(raw), lambda _: Frequencies(), 1e-3)
    assert decision.choice.level == "force"
    assert np.isnan(decision.choice.error)
    assert "unknown" in decision.choice.reason


def test_physics_in_the_model_is_not_listed_as_neglected():
    """Wires that bend are on a model that has blades as coordinates, whether these
    are the reason for this model or not."""
    design = read(CONFIGS / "quadruple.toml").design
    base = registry.STRING.system(design)
    drive, motion = plants.drives(base, "support.x"), plants.motions(base, "test.x")
    decision = auto.decide(
        design, lambda _: Transfer(drive, motion, np.geomspace(0.1, 100, 50)), TOLERANCE
    )
    series = decision.refinements[0]
    assert (series.name, series.taken, decision.choice.level) == (
        "blade tip motion",
        False,
        "violin",
    )
    assert "neglected" not in decision.choice.reason
    assert decision.choice.error == 0.0


SINGLE = """
[design]
name = "single"
[[stage]]
name = "b1"
body = { shape = "cylinder", axis = "x", radius = 0.09, length = 0.10, mass = 5.6 }
"""
TWO_WIRES = """
[stage.wires]
count = 2
l = 0.5
t1 = 0.08
t2 = 0.08
d = 0.1
material = "c70steel"
radius = 1e-4
"""
BENDING_POINTS = """
position = [0.0, 0.0, -0.5]
[[stage.wire]]
upper = [0.0, 0.08, 0.0]
lower = [0.0, 0.08, 0.05]
material = "c70steel"
radius = 3e-4
clamp = "bending-point"
[[stage.wire]]
upper = [0.0, -0.08, 0.0]
lower = [0.0, -0.08, 0.05]
material = "c70steel"
radius = 3e-4
clamp = "bending-point"
"""


@pytest.mark.parametrize(
    ("wires", "tolerance", "simplest"),
    [
        pytest.param(TWO_WIRES, 0.1, "force", id="force"),
        pytest.param(BENDING_POINTS, 1e-2, "string", id="string"),
    ],
)
def test_a_zero_of_a_simpler_model_alone_is_no_answer(wires, tolerance, simplest):
    """The support tilts about the line through both upper ends. Strings do not move then; wires
    clamped in the support bend, and tilt the body."""
    design = sus.parse(SINGLE + wires)
    asked = {"outputs": ["b1.pitch"], "frequency": [0.1, 1.0, 3.0], "tolerance": tolerance}
    taken, exact, simple = (
        sus.response(design, inputs=["support.pitch"], model=model, **asked)
        for model in ("auto", "violin", simplest)
    )
    assert (simple.value == 0).all()
    assert not simple.estimated_error <= tolerance
    assert (exact.value != 0).all()
    assert taken.value == pytest.approx(exact.value, rel=tolerance)
    # other results on the same wires need no more than before
    longitudinal = sus.response(design, inputs=["support.x"], **asked | {"outputs": ["b1.x"]})
    assert longitudinal.model == simplest
    # one answer that is not 0 does not hide another one that is
    both = sus.response(design, inputs=["support.x", "support.pitch"], **asked)
    assert both.model == taken.model
