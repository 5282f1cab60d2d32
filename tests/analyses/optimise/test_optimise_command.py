"""`pendsus optimise` as a command: what it prints and writes, its exit codes, and the goals that
it refuses."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import h5py
import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses import known_analyses
from suspension_cli.design import reader
from suspension_cli.files.hdf5 import open_results
from tests.support.commandline import (
    MISSING,
    assert_refused,
    document,
    edited,
    run,
    strict_json,
    written,
)
from tests.support.faulty_designs import parse
from tests.support.golden import CONFIGS, ROOT
from tests.support.optima import EXAMPLE, PAPER, TRIPLE, VERTICAL, WIRES

ON_STRINGS = ("--fidelity", "string")


def optimise(design, raw, folder, *options):
    """A run on strings from the start of the design alone, with these goals."""
    file = written(folder, raw, "goals.toml")
    return run("optimise", design, file, "--starts", "1", "--out", folder, *ON_STRINGS, *options)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The shipped example, from its own start alone."""
    folder = tmp_path_factory.mktemp("optimised")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        result = run(*EXAMPLE, *ON_STRINGS, "--out", folder, "--json", "--plot")
    assert result.exit_code == 0, result.stderr
    return folder, strict_json(result.stdout)


def test_the_story_of_section_5a(made):
    """From vertical wires whose rotation is too fast to a triple whose modes to be damped all are
    as section 1 wants them, by `pendsus modes` alone."""
    folder, answer = made
    before, after = (
        document("modes", file, *ON_STRINGS, "--out", folder / "modes")
        for file in (TRIPLE, folder / "husman2000-triple-vertical-optimised.toml")
    )
    fast = [mode for mode in before["modes"] if mode["verdict"] != "can be damped"]
    assert sorted(mode["dof"] for mode in fast) == ["roll", "yaw", "z"]
    left = [mode for mode in after["modes"] if mode["verdict"] != "can be damped"]
    assert sorted(mode["dof"] for mode in left) == ["roll", "z"] and all(
        mode["frequency_hz"] > 20 and mode["top_mass_fraction"] < 1e-3 for mode in left
    )
    damped = [mode for mode in after["modes"] if mode not in left]
    assert len(damped) == 16 and all(
        0.5 <= mode["frequency_hz"] <= 5 and mode["top_mass_fraction"] >= 0.05 for mode in damped
    )
    assert answer["goals_met"] and all(limit["met"] for limit in answer["limits"])
    reported = sorted(mode["after_hz"] for mode in answer["modes"])
    # the latter with losses, 1/(8 Q²) away
    np.testing.assert_allclose(
        reported, [mode["frequency_hz"] for mode in after["modes"]], rtol=1e-6
    )
    wires = reader.read(folder / "husman2000-triple-vertical-optimised.toml").design.stage[1].wires
    assert wires.t1 < 0.8 * wires.t2  # the paper's remedy: they lean


def test_what_is_not_met_has_exit_code_1(tmp_path):
    raw = {
        "goal": [{"kind": "band", "modes": ["test longitudinal"], "at_least": 3.0}],
        "free": [{"name": f"{WIRES}.l", "lower": 0.1, "upper": 0.5}],
    }
    result = optimise(VERTICAL, raw, tmp_path, "--no-plot")
    assert result.exit_code == 1
    assert "NOT MET" in result.stdout and "1 limit, 1 NOT MET" in result.stdout
    assert f"what is not met is limited by the lower bound of {WIRES}.l" in result.stdout
    with open_results(tmp_path / "husman2000-table1-case1-optimise.h5") as file:
        loaded = known_analyses.loaded(file, "")
    assert f"{loaded}\n" == result.stdout and loaded.run.analysis.exit_code(loaded) == 1
    text = (tmp_path / "husman2000-table1-case1-optimised.toml").read_text()
    assert re.search(r"^# .* NOT MET +test longitudinal >= 3 Hz$", text, re.MULTILINE)


def test_room_is_printed_as_a_fraction_of_the_limit(tmp_path):
    """Half the least there may be is 50 % short, and twice the most 100 % over, which margins in
    logarithms have alike."""
    high = {"kind": "band", "modes": ["test longitudinal"]}
    low = {"kind": "band", "modes": ["test transverse"]}
    limits = [{"at_least": 2.0}, {"at_most": 0.25}, {"equals": 2.0}, {"at_most": 2.0}]
    goal = [one | limit for one, limit in zip([high, low, high, low], limits, strict=True)]
    raw = {"goal": goal, "free": [{"name": f"{WIRES}.l", "lower": 0.2, "upper": 0.5}]}
    result = optimise(VERTICAL, raw, tmp_path, "--json")
    answer = strict_json(result.stdout)
    high_value, low_value = (limit["value"] for limit in answer["limits"][:2])
    np.testing.assert_allclose(
        [limit["room"] for limit in answer["limits"]],
        [high_value / 2 - 1, 1 - low_value / 0.25, high_value / 2 - 1, 1 - low_value / 2],
        rtol=1e-12,
    )
    found = sus.load(tmp_path / "husman2000-table1-case1-optimise.h5")
    assert found.limits.room.tolist() == [limit["room"] for limit in answer["limits"]]


def test_an_optimum_on_violin_meets_its_limits_by_the_plain_commands(tmp_path):
    """Heavy wires: their mass matters at 60 Hz."""
    limits = {"at_least": 0.8, "at_most": 2e-4}
    raw = {
        "goal": [
            {"kind": "band", "modes": ["test longitudinal"], "at_least": limits["at_least"]},
            {"kind": "isolation", "response": "test.x/support.x:60", "at_most": limits["at_most"]},
        ],
        "free": [{"name": f"{WIRES}.l", "lower": 0.2, "upper": 0.8, "start": 0.6}],
    }
    common = ("--fidelity", "violin", "--json", "--out", tmp_path)
    result = run("optimise", VERTICAL, written(tmp_path, raw, "goals.toml"), "--starts", 1, *common)
    answer = strict_json(result.stdout)
    assert answer["checked_on"] == "violin" and answer["goals_met"]
    assert [one["model"] for one in answer["quantities"]] == ["violin"] * 2
    made = tmp_path / "husman2000-table1-case1-optimised.toml"
    modes = strict_json(run("modes", made, *common, "--max-frequency", "10").stdout)["modes"]
    (found,) = (mode["frequency_hz"] for mode in modes if mode["label"] == "test longitudinal")
    run(
        "response", made, *common, "--input", "support.x", "--output", "test.x", "--frequency", "60"
    )
    with h5py.File(tmp_path / "husman2000-table1-case1-response.h5") as file:
        size = abs(file["response/value"][0, 0, 0])
    assert found >= limits["at_least"] and size <= limits["at_most"]
    for limit, value in zip(answer["limits"], (found, size), strict=True):
        assert limit["value"] == pytest.approx(value, rel=1e-6)


def test_several_models_are_named_goal_by_goal(tmp_path):
    """A violin mode needs the mass of wires, the others do not: each row says its model."""
    raw = {
        "requirement": [
            {"quantity": "test violin 1", "at_least": 300.0},
            {"quantity": "lowest pitch", "at_least": 0.4},
        ],
        "free": [{"name": "stage.test.wires.radius", "lower": 6e-5, "upper": 1e-4}],
    }
    result = optimise(CONFIGS / "double.toml", raw, tmp_path, "--no-plot")
    assert re.search(r"test violin 1 >= 300 Hz +violin\n", result.stdout)
    assert re.search(r"lowest pitch >= 0.4 Hz +string\n", result.stdout)
    assert "checked with the string and violin models" in result.stdout


def test_what_is_not_known_is_not_all_met(tmp_path):
    """Of two materials one has a strength; the last line says so, as does the exit code."""
    raw = {
        "goal": [{"kind": "stress", "at_most": 0.9}],
        "free": [{"name": "stage.mirror.wires.l", "lower": 0.5, "upper": 0.9}],
    }
    unknown = [
        word
        for stage in ("mirror", "recoil-mass")
        for word in ("--set", f"stage.{stage}.wires.material=copper")
    ]
    design = CONFIGS / "payload-recoil-mass.toml"
    result = optimise(design, raw, tmp_path, *unknown, "--no-plot")
    assert result.exit_code == 1
    assert "1 limit, met, 2 NOT KNOWN, checked with the string model" in result.stdout


def test_a_limit_that_symmetry_keeps_is_reported(tmp_path):
    raw = {
        "goal": [
            {"kind": "cross-coupling", "response": "test.x/test.z/support.z:50", "at_most": 1e-3}
        ],
        "free": [{"name": f"{WIRES}.l", "lower": 0.2, "upper": 0.5}],
    }
    result = optimise(VERTICAL, raw, tmp_path, "--no-plot")
    assert result.exit_code == 0 and "is 0 by the symmetry of the design" in result.stderr


def test_a_design_that_falls_over_is_reported(tmp_path):
    """No goal is about its pitch."""
    raw = {
        "goal": [{"kind": "height", "at_most": 1.0}],
        "free": [{"name": "stage.upper.wires.d", "lower": -0.05, "upper": 0.01, "start": -0.05}],
    }
    options = ("--starts", "1", "--no-plot", "--quiet", "--out", tmp_path)
    result = run(
        "optimise", CONFIGS / "double.toml", written(tmp_path, raw, "goals.toml"), *options
    )
    assert result.exit_code == 0 and result.stderr.startswith(
        "warning: the design found is unstable: upper pitch;"
    )


def test_an_unstable_start_has_no_frequency(tmp_path):
    """The start topples (wires end below the centre of mass), and the search gets it upright."""
    raw = {
        "goal": [{"kind": "band", "modes": ["test pitch"], "at_least": 0.5}],
        "free": [{"name": f"{WIRES}.d", "lower": -0.2, "upper": 0.01, "start": -0.15}],
    }
    result = optimise(VERTICAL, raw, tmp_path, "--no-plot", "--set", f"{WIRES}.s=0.001")
    assert result.exit_code == 0, result.stderr
    (row,) = (line.split() for line in result.stdout.splitlines() if "test pitch >=" in line)
    assert row[1] == "-" and "active" in row and "nan" not in result.stdout


GOALS = {
    "goal": [{"kind": "band", "dof": ["x"], "at_least": 0.5}],
    "free": [{"name": f"{WIRES}.l", "lower": 0.1, "upper": 1.0}],
}


def test_motions_may_be_named_as_in_tables(tmp_path):
    """The same limits for "longitudinal" as for "x"."""
    texts = []
    for name in ("x", "longitudinal"):
        raw = GOALS | {"goal": [GOALS["goal"][0] | {"dof": [name]}]}
        result = optimise(VERTICAL, raw, tmp_path, "--no-plot", "--fidelity", "string", "-q")
        assert result.exit_code == 0, result.stderr
        texts.append(result.stdout)
    assert texts[0] == texts[1]
    assert "longitudinal-pitch 1 >= 0.5 Hz" in texts[0]


FAULTY = parse(Path(__file__).parent / "faulty_goals.txt", {"goals": GOALS}, "goals")["goals"]
NO_GOALS = {
    "is empty; write tables into it": {},
    "is a design (it has [[stage]]), not a file of goals": {"stage": []},
}


@pytest.mark.parametrize(
    ("raw", "says"),
    [*((edited(GOALS, c.edits), c.says) for c in FAULTY), *((r, s) for s, r in NO_GOALS.items())],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_bad_goals_are_refused(raw, says, tmp_path):
    file, out = written(tmp_path, raw, "goals.toml"), tmp_path / "out"
    result = run("optimise", VERTICAL, file, "--starts", "1", "--out", out, "--quiet")
    lines = assert_refused(result, file, out)
    named = [line.replace(f'free."{WIRES}.l".', "free.1.") for line in lines]
    assert any(line.startswith(says) for line in named), lines


def test_goals_of_unknown_quantities_alone_are_refused(tmp_path):
    """Wires given by k have no stress."""
    wires = {"radius": MISSING, "material": MISSING, "k": 4e4}
    edits = {("stage", 0, "wires", key): value for key, value in wires.items()}
    design = written(tmp_path, edited(tomllib.loads(VERTICAL.read_text()), edits))
    goals = written(tmp_path, GOALS | {"goal": [{"kind": "stress", "at_most": 0.5}]}, "goals.toml")
    [line] = assert_refused(run("optimise", design, goals, "--out", tmp_path / "out"), goals)
    assert "is known for this design; give stage.test.wires.radius" in line


def test_unknown_strength_is_refused_where_it_is_needed(tmp_path):
    raw = {
        "goal": [{"kind": "stress", "blades": ["upper"], "at_most": 0.5}],
        "free": [{"name": "stage.upper.wires.radius", "lower": 1e-4, "upper": 1e-3}],
    }
    file = written(tmp_path, raw, "goals.toml")
    (line,) = assert_refused(
        run("optimise", PAPER / "table2.toml", file, "--out", tmp_path / "out"),
        file,
        tmp_path / "out",
    )
    assert "the stress of upper blades is unknown; give stage.upper.blades.geometry" in line
