"""Cross-coupling as a command: JSON, failures, faults; and the error of each model against whole
sweeps in the most complete one."""

from __future__ import annotations

import json
import pickle
import tomllib

import h5py
import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.errors import Fault, InputError
from suspension_cli.models import registry
from suspension_cli.models.choice import ONE_MODEL_ONLY
from tests.support.commandline import (
    MISSING,
    assert_refused,
    document,
    edited,
    run,
    strict_json,
    written,
)
from tests.support.couplings import FILE
from tests.support.paths import CONFIGS

RAW = tomllib.loads(FILE.read_text())
TABLE = ("analysis", "xcouple")
NAME = "husman2000-figure6-xcouple"


def xcouple(file, out, *options):
    """The JSON document of a run that must succeed; options as one types them, or in words."""
    options = options[0].split() if len(options) == 1 else options
    return document("xcouple", file, "--workers", "1", "--out", out, *options)


def test_defaults_without_a_table(tmp_path):
    """The first wire of the last stage, 1 mm below its COM, at 50 Hz."""
    file = written(tmp_path, edited(RAW, {TABLE: MISSING}))
    given = xcouple(
        FILE,
        tmp_path,
        "--sweep k=0.6:1.4:41,offset=-2e-3:2e-3:5 --wire test.1 --frequency 50 --observe"
        " test@0,0,-0.001 --fidelity auto",
    )
    assert xcouple(file, tmp_path) == given


@pytest.fixture
def impatient(monkeypatch):
    """What hangs nowhere is given up early."""
    monkeypatch.setattr(equilibrium, "STEPS", equilibrium.STEPS[:1])


def test_failed_builds_are_reported_and_the_rest_goes_on(tmp_path, impatient):
    result = run(
        "xcouple",
        FILE,
        "--json",
        "--out",
        tmp_path,
        "--sweep",
        "length=0,5e-3,mass=1,1e4,com_z=0,0.05",
    )
    assert result.exit_code == 0
    answer = strict_json(result.stdout)
    real, imag = (np.array(answer[f"ratio_{part}"], dtype=object) for part in ("real", "imag"))
    assert real.shape == (2, 2, 2)
    assert np.array_equal(np.equal(real, None), np.equal(imag, None))
    assert real[0, 0, 0] == 0.0
    assert sum(answer["failures"].values()) == np.equal(real, None).sum() == 7
    assert set(answer["failures"]) == {
        "a wire is slack",
        "no equilibrium near the nominal pose",
        "the equilibrium is unstable",
    }
    [warning] = [line for line in result.stderr.splitlines() if "builds failed" in line]
    assert warning.startswith("warning: ")
    for reason, count in answer["failures"].items():
        assert f"{count} of 8 builds failed: {reason}" in warning
    with h5py.File(tmp_path / f"{NAME}.h5") as stored:
        status, wire, ratio = (
            stored[f"xcouple/{name}"][:] for name in ("status", "slack_wire", "ratio")
        )
        meaning = list(stored["xcouple"].attrs["status_meaning"])
    assert (np.isnan(ratio[..., 0]) == (status != 0)).all()
    assert ((wire >= 0) == (status == meaning.index("a wire is slack"))).all()
    assert wire[1, 0, 0] == 0


def test_all_builds_failed(tmp_path, impatient):
    result = run("xcouple", FILE, "--out", tmp_path, "--sweep", "mass=1e4,1e5")
    assert result.exit_code == 0
    assert result.stdout.splitlines()[1:] == ["no build has an equilibrium on taut wires"]
    assert (tmp_path / f"{NAME}.png").exists()


ON_SPRINGS = """
design = { name = "springs" }

[[stage]]
name = "test"
position = [0.0, 0.0, -0.3]
body = { mass = 5.0, inertia = [0.02, 0.02, 0.03] }

[[stage.spring]]
stiffness = [100.0, 100.0, 1e4, 10.0, 10.0, 10.0]
preload = [0.0, 0.0, 49.05, 0.0, 0.0, 0.0]

[[tolerance.body]]
stage = "test"
com = { normal = 1e-3 }
"""


def test_a_stage_without_wires(tmp_path):
    file = written(tmp_path, ON_SPRINGS)
    answer = xcouple(file, tmp_path, "--sweep com=0,1e-4,2e-4")
    assert answer["ratio_real"][0] == 0.0
    assert answer["ratio_real"][2] == pytest.approx(2 * answer["ratio_real"][1], rel=1e-3)
    result = run("xcouple", file, "--out", tmp_path / "out")
    [line] = assert_refused(result, file, tmp_path / "out")
    assert (
        line
        == "--wire: k changes a wire, but the mirror hangs on none; name a wire, or sweep mass,"
        " com or a path"
    )
    assert (
        run(
            "tolerance", file, "--builds", "10", "--workers", "1", "--no-plot", "--out", tmp_path
        ).exit_code
        == 0
    )


def test_faults_cross_from_worker_processes():
    fault = InputError([Fault("key", "problem", "remedy", "value")], "file")
    again = pickle.loads(pickle.dumps(fault))
    assert (str(again), again.faults, again.file) == (str(fault), fault.faults, fault.file)


def test_a_frequency_at_which_waves_die_out_along_wires():
    """At 1 GHz losses damp a wave of stretching before it reaches the other end of a wire."""
    found = sus.xcouple(sus.template("single"), frequency=[1e9])
    assert np.isfinite(found.ratio).all()


GRID = "k=0.9,1.1,1,offset=-1e-3,1e-3,0"
"""The last build is perfect and couples nothing."""


def test_the_default_is_what_the_couplings_need(tmp_path):
    """To the tolerance: relative to the largest coupling."""
    design = CONFIGS / "geo-silica-triple.toml"
    found = {
        words: json.loads(
            run("xcouple", design, "--sweep", GRID, "--json", "--out", tmp_path, *words).stdout
        )
        for words in (
            (),
            ("--tolerance", "1"),
            ("--tolerance", "0.05"),
            ("--fidelity", "string"),
            ("--fidelity", "violin"),
        )
    }
    default, loose, medium, strings, exact = found.values()
    levels = [one["fidelity"] for one in (default, loose, medium)]
    assert levels == ["violin", "string", "beam"]
    assert default["estimated_error"] == 0.0 < medium["estimated_error"] < 0.05
    assert 0.05 < loose["estimated_error"] == strings["estimated_error"] < 1.0
    assert default["ratio_real"] == exact["ratio_real"]
    assert loose["ratio_real"] == strings["ratio_real"]
    old, new = (
        np.array(one["ratio_real"]) + 1j * np.array(one["ratio_imag"]) for one in (loose, exact)
    )
    assert np.abs(old - new).max() / np.abs(new).max() == pytest.approx(
        loose["estimated_error"], rel=0.3
    )


ROD = """
[design]
name = "rod"
[[stage]]
name = "test"
body = { mass = 2.0, inertia = [0.0147, 0.0117, 0.011] }
[stage.wires]
count = 4
l = 0.4
s = 0.02
t1 = 0.1
t2 = 0.1
d = 0.001
material = "c70steel"
radius = 8e-3
"""
"""Rods of 8 mm: bending lifts the weight off some of them in every build whose ends are 1 mm
off."""


def test_builds_that_hang_on_strings_alone(tmp_path):
    """No finite error of strings: `auto` takes what shows that they do not hang."""
    design = tmp_path / "rod.toml"
    design.write_text(ROD)
    words = ("xcouple", design, "--sweep", GRID, "--json", "--out", tmp_path)
    done = run(*words, "--fidelity", "string")
    found = json.loads(done.stdout)
    assert found["estimated_error"] is None
    assert ONE_MODEL_ONLY in found["error_unknown"]
    with h5py.File(tmp_path / "rod-xcouple.h5") as results:
        assert ONE_MODEL_ONLY in results.attrs["fidelity_reason"]
    assert registry.by_name(json.loads(run(*words).stdout)["fidelity"]).bends_wires


def test_the_tolerance_that_no_model_meets(tmp_path):
    """Without a density there is no wire mass; the reason says that its effect is unknown."""
    text = (
        ROD.replace("8e-3", "3e-3").replace('"c70steel"', '"mine"')
        + "[materials.mine]\nyoungs_modulus = 2e11\npoisson_ratio = 0.3\n"
    )
    found = xcouple(written(tmp_path, text), tmp_path, "--sweep", GRID)
    assert found["fidelity"] == "beam" and found["estimated_error"] is None
    assert "wire mass, as wire test.1 is of mine, which has no density" in found["error_unknown"]
