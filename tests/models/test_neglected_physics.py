"""Every command that takes a model reports what it neglects: in its reason, its estimated error,
and a warning from 1 %."""

from __future__ import annotations

import h5py
import pytest

from tests.support.commandline import run, strict_json, written
from tests.support.paths import CONFIGS

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
        "warning: quadruple: the string model neglects wire bending, which changes test pitch"
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
