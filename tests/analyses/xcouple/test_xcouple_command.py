"""What `pendsus xcouple` promises: JSON, defaults from the design, the file, failures that are
reported, faults that stop it."""

from __future__ import annotations

import pickle
import tomllib

import h5py
import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.errors import Fault, InputError
from tests.support.commandline import MISSING, assert_refused, edited, run, strict_json, written
from tests.support.couplings import FIGURE_6, FILE, answers, question

RAW = tomllib.loads(FILE.read_text())
TABLE = ("analysis", "xcouple")
NAME = "husman2000-figure6-xcouple"


def xcouple(file, out, *options):
    """The JSON document of a run that must succeed; options as one types them, or in words."""
    options = options[0].split() if len(options) == 1 else options
    result = run("xcouple", file, "--json", "--workers", "1", "--out", out, *options)
    assert result.exit_code == 0, result.stderr
    return strict_json(result.stdout)


def test_json_first_axis_first(tmp_path):
    answer = xcouple(FILE, tmp_path, "--sweep offset=-1e-3:1e-3:3,k=0.9:1.2:4,length=0,1e-5")
    assert answer["command"] == "xcouple"
    assert answer["design"] == "husman2000-figure6"
    assert [axis["name"] for axis in answer["axes"]] == ["offset", "k", "length"]
    offset, k, length = (np.array(axis["values"]) for axis in answer["axes"])
    np.testing.assert_allclose(offset, [-1e-3, 0.0, 1e-3], atol=1e-18)
    assert length.tolist() == [0.0, 1e-5]
    real, imag = np.array(answer["ratio_real"]), np.array(answer["ratio_imag"])
    assert real.shape == imag.shape == (3, 4, 2)
    assert answer["frequency_hz"] == 50.0
    assert (answer["input"], answer["over"], answer["under"]) == (
        "support.z",
        "test.x@0,0,-0.001",
        "test.z@0,0,-0.001",
    )
    assert answer["hold"] == "loaded-length"
    assert answer["failures"] == {}
    grid = np.meshgrid(offset, k, length, indexing="ij")
    found = answers(
        dict(zip(("offset", "k", "length"), (values.ravel() for values in grid), strict=True))
    )["ratio"][:, 0]
    assert np.array_equal(real.ravel(), found.real)
    assert not imag.any()


def test_several_frequencies_come_last(tmp_path):
    answer = xcouple(FILE, tmp_path, "--sweep k=1.1,1.2 --frequency 10:100:3")
    np.testing.assert_allclose(answer["frequency_hz"], [10.0, 1000**0.5, 100.0])
    assert np.array(answer["ratio_real"]).shape == (2, 3)
    for n, frequency in enumerate(answer["frequency_hz"]):
        one = xcouple(FILE, tmp_path, "--sweep", "k=1.1,1.2", "--frequency", repr(frequency))
        assert one["ratio_real"] == [row[n] for row in answer["ratio_real"]]


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


def test_the_answer_is_that_of_the_design_with_overrides(tmp_path):
    answer = xcouple(FILE, tmp_path, "--sweep k=1.1 --set stage.test.wires.s=0.006")
    swept = xcouple(FILE, tmp_path, "--sweep stage.test.wires.s=0.006,k=1.1")
    assert answer["ratio_real"] == swept["ratio_real"][0]
    assert answer["ratio_real"] != xcouple(FILE, tmp_path, "--sweep k=1.1")["ratio_real"]
    assert question(FIGURE_6).wire == 0


def test_a_frequency_at_which_waves_die_out_along_wires():
    """At 1 GHz losses damp a wave of stretching before it reaches the other end of a wire."""
    found = sus.xcouple(sus.template("single"), frequency=[1e9])
    assert np.isfinite(found.ratio).all()
