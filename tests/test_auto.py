"""`auto` takes the lowest rung that is good enough for what is asked, and says how good: against `violin` on random designs."""

from __future__ import annotations

import numpy as np
import plants
import pytest
import scenes
from scipy.optimize import linear_sum_assignment

from suspension_cli.analysis import auto, modes, response, thermal, wire_modes
from suspension_cli.models import fidelity, wire_mass

TOLERANCE = 1e-3


def random_design(seed):
    """One to four stages, symmetric or (every fourth) leaning blades, on wires from hairs to rods."""
    rng = np.random.default_rng([31, seed])
    count = 1 + seed % 4 if seed % 8 < 6 else 2
    raw = scenes.bladed_chain(rng, min(count, 2), tip_mass=False, lateral=False) if seed % 4 == 3 else scenes.chain(rng, count)
    return scenes.design_of(scenes.fibred(raw, float(10 ** rng.uniform(6.5, 9)), ribbons=bool(rng.random() < 0.2)))


def away(frequency, known):
    return frequency[(np.abs(frequency[:, None] / known[known > 0] - 1) > 2 * auto.NEAR).all(1)]


@pytest.mark.parametrize("seed", range(24))
def test_frequencies_of_modes(seed):
    """The modes of bodies on the rung taken against those with distributed wires; the estimate is not far off."""
    design = random_design(seed)
    decision = auto.decide(design, lambda _: auto.Frequencies(), TOLERANCE)
    model = fidelity.linear_model(design, "violin")
    quick = modes.solve(decision.model)
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


@pytest.mark.parametrize("seed", range(24))
def test_responses(seed):
    """From the support to the last body, away from resonances."""
    design = random_design(seed)
    base = fidelity.linear_model(design, "string")
    drive, motion = plants.drives(base, "support.x"), plants.motions(base, f"{base.body[-1]}.x")
    grid = np.geomspace(0.05, 20, 300)
    decision = auto.decide(design, lambda _: auto.Transfer(drive, motion, grid), TOLERANCE)
    truth = fidelity.linear_model(design, "violin")
    known = np.concatenate([modes.solve(model).frequency for model in (decision.model, truth)])
    frequency = away(grid, known)
    old, new = (response.solve(model, frequency, drive, motion).value[:, 0, 0] for model in (decision.model, truth))
    slope = np.abs(np.gradient(np.log(np.abs(new) + 1e-300), np.log(frequency)))
    plain = slope < 20  # not next to a zero
    assert (np.abs(old / new - 1)[plain] <= TOLERANCE).all()


@pytest.mark.parametrize("seed", range(12))
def test_thermal_noise(seed):
    design = random_design(seed)
    first, _ = wire_mass.first_violin(design)
    grid = np.geomspace(0.02 * 10 ** (seed % 3 - 1) * first / 30, 0.02 * 10 ** (seed % 3 - 1) * first, 100)
    choice = wire_mass.choose(design, "auto", float(grid[-1]), TOLERANCE)
    taken, truth = (fidelity.linear_model(design, level) for level in (choice.level, "violin"))
    known = np.concatenate([modes.solve(model).frequency for model in (taken, truth)])
    frequency = away(grid, known)
    old, new = (thermal.solve(model, frequency, *reversed(thermal.observed(model, f"{model.body[-1]}.x")), 290.0).amplitude for model in (taken, truth))
    assert old == pytest.approx(new, rel=TOLERANCE if choice.level == "beam" else 1e-12)


def test_hairs_stay_strings():
    """Wires so thin that bending and mass are under the tolerance by far are not solved as beams at all."""
    raw = scenes.fibred(scenes.chain(np.random.default_rng(3), 2), 1e9)
    raw["materials"] = {"hair": {"youngs_modulus": 1e9, "poisson_ratio": 0.3, "density": 1.0, "thermal_expansion": 0.0}}
    for stage in raw["stage"]:
        stage["wires"] |= {"material": "hair", "k": 1e4}
    decision = auto.decide(scenes.design_of(raw), lambda _: auto.Frequencies(), 0.1)
    assert decision.choice.level == "force"
    assert all(not item.taken for item in decision.refinements)


def test_a_tighter_tolerance_takes_more():
    design = random_design(4)
    levels = [auto.decide(design, lambda _: auto.Frequencies(), tolerance).choice.level for tolerance in (0.3, 1e-3, 1e-9)]
    order = [fidelity.LEVELS.index(level) for level in levels]
    assert order == sorted(order)
    assert levels[-1] == "violin"


def test_wires_of_unknown_section_are_told():
    raw = scenes.chain(np.random.default_rng(1), 1)
    decision = auto.decide(scenes.design_of(raw), lambda _: auto.Frequencies(), 1e-3)
    assert decision.choice.level == "force"
    assert np.isnan(decision.choice.error)
    assert "unknown" in decision.choice.reason
