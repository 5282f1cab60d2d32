"""Every command that takes a model reports what it neglects: in its reason, its estimated error,
and a warning from 1 %."""

from __future__ import annotations

from functools import cache

import h5py
import numpy as np
import pytest

from suspension_cli.analyses.modes import wire_modes
from suspension_cli.design.reader import read
from suspension_cli.linear import eigenmodes
from suspension_cli.models import auto, registry
from suspension_cli.models.quantity_of_interest import Frequencies
from suspension_cli.models.registry import Choice
from tests.models.test_auto import CONFIGS, TOLERANCE
from tests.support import scenes
from tests.support.commandline import run, strict_json, written

QUADRUPLE = CONFIGS / "quadruple.toml"
BENDS = (("sensitivity", QUADRUPLE, "--fidelity", "string"),)
"""On strings, where bending of the wires changes a pitch mode by half of its frequency."""
LITTLE = (
    ("modes", QUADRUPLE),
    (
        "damp",
        CONFIGS / "triple-damped.toml",
        "--set",
        "control.loop=[{name='x', sensor='upper.x', actuator='upper.force_x', damper=20.0}]",
    ),
    ("export", QUADRUPLE, "--format", "hdf5"),
    ("xcouple", CONFIGS / "five-wires.toml", "--sweep", "k=0.9:1.1:3"),
    ("sweep", QUADRUPLE, "--vary", "stage.test.wires.l=0.55:0.6:2"),
)


def recorded(folder):
    (path,) = folder.glob("*.h5")
    with h5py.File(path) as file:
        return dict(file.attrs)


def of_one(answer):
    return answer["designs"][0] if "designs" in answer else answer


@pytest.mark.parametrize("words", BENDS, ids=lambda words: words[0])
def test_what_cannot_be_had_is_warned_of(words, tmp_path):
    done = run(*words, "--json", "--out", tmp_path)
    assert done.exit_code == 0, done.stderr
    answer, attributes = strict_json(done.stdout), recorded(tmp_path)
    assert (
        "warning: quadruple: the string model neglects wire bending, which changes the derivatives of"
        in done.stderr
    )
    assert answer["fidelity"] == "string"
    assert 0.1 < answer["estimated_error"] == attributes["estimated_error"]
    assert "neglected: wire bending, " in attributes["fidelity_reason"]


def test_neglected_physics_is_of_the_requested_quantity(tmp_path):
    """Bending hardly changes how a mass swings, whatever it does to its pitch."""
    done = run("sensitivity", QUADRUPLE, "--result", "test transverse", "--json", "--out", tmp_path)
    assert "neglects" not in done.stderr
    assert 0 < strict_json(done.stdout)["estimated_error"] < 0.01


@pytest.mark.parametrize("words", LITTLE, ids=lambda words: words[0])
def test_what_is_small_is_recorded(words, tmp_path):
    done = run(*words, "--json", "--out", tmp_path)
    assert done.exit_code == 0, done.stderr
    answer, attributes = of_one(strict_json(done.stdout)), recorded(tmp_path)
    assert "neglects" not in done.stderr
    assert 0 < answer["estimated_error"] < 0.01
    assert answer["estimated_error"] == attributes["estimated_error"]
    assert "neglected: " in attributes["fidelity_reason"]


def test_a_fit_reports_neglected_physics(tmp_path):
    """Of several designs, the worst counts."""
    single = CONFIGS / "husman2000" / "table1-case3.toml"
    experiments = [
        {
            "design": str(CONFIGS / "double.toml"),
            "mode": [{"frequency": 0.75, "uncertainty": 0.01, "label": "test pitch"}],
        },
        {
            "design": str(single),
            "mode": [{"frequency": 11.3, "uncertainty": 0.1, "label": "test vertical"}],
        },
    ]
    measured = written(
        tmp_path,
        {
            "experiment": experiments,
            "parameter": [{"name": "stage.test.wires.l", "experiments": ["double"]}],
        },
        "measured.toml",
    )
    done = run("fit", measured, "--fidelity", "string", "--json", "--out", tmp_path / "out")
    assert done.exit_code == 0, done.stderr
    assert [line for line in done.stderr.splitlines() if "neglects" in line] == [
        "warning: double: the string model neglects wire bending, which changes test pitch by 25 %;"
        " rerun with --fidelity beam"
    ]
    answer = strict_json(done.stdout)
    assert 0.1 < answer["estimated_error"] == recorded(tmp_path / "out")["estimated_error"]


@cache
def most_complete(seed):
    """A random chain, its violin model, and the modes of that."""
    design = scenes.design_of(
        scenes.fibred(
            scenes.chain(np.random.default_rng([32, seed]), 1 + seed % 3),
            float(10 ** (7.5 + seed % 4 / 3)),
        )
    )
    high = registry.VIOLIN.system(design)
    highest = 1.2 * float(eigenmodes.solve(registry.BEAM.system(design)).frequency[-1])
    return design, high, wire_modes.solve(high, highest)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("level", ["string", "beam"])
def test_estimate_is_the_change_by_the_most_complete_model(seed, level):
    """Within the factor that estimates are good for."""
    design, high, new = most_complete(seed)
    choice = auto.estimate_error(design, Choice(level, "given"), lambda _: Frequencies()).choice
    old = eigenmodes.solve(registry.by_name(level).system(design))
    count = 6 * len(high.body)
    overlap = np.abs(
        new.shape[:, :count] @ high.mass[6 : 6 + count, 6 : 6 + count] @ old.shape[:, :count].T
    )
    pair = overlap.argmax(0)
    good = (overlap.max(0) > 0.9) & (old.frequency > 0)
    assert good.sum() >= count / 2
    found = np.abs(old.frequency / new.frequency[pair] - 1)[good].max()
    assert found <= 4 * choice.error
    if good.all() and choice.error < 0.1:
        assert choice.error <= 4 * found


def test_the_most_complete_model_neglects_nothing():
    design = read(QUADRUPLE).design
    assert auto.estimate_error(
        design, Choice("violin", "given"), lambda _: Frequencies()
    ).choice == Choice("violin", "given", 0.0)


def test_auto_stops_at_the_top_there_is():
    """The mass of wires counts for these hairs under light bodies; without it `beam` is the best,
    and the result says so."""
    raw = scenes.fibred(scenes.chain(np.random.default_rng(5), 2), 10**7.0)
    design = scenes.design_of(raw)
    whole = auto.decide(design, lambda _: Frequencies(), TOLERANCE)
    assert whole.choice.level == "violin"
    capped = auto.decide(design, lambda _: Frequencies(), TOLERANCE, "beam")
    assert capped.choice.level == "beam"
    assert capped.choice.error == capped.refinements[-1].change > TOLERANCE
    assert capped.model.terms and not capped.refinements[-1].taken
