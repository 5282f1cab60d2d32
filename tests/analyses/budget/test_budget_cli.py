"""`pendsus budget`: the JSON that scripts rely on, requirements, files, pictures and refusals."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.physics.thermal_noise import compute_arm_tilt
from tests.analyses.damp.test_control import loop
from tests.support import plants
from tests.support.commandline import assert_refused, document, run, strict_json, written

RAW = plants.raw("triple") | {"materials": {"steel302": {"loss_angle": 2e-4}}}
LOOPS = [
    loop("upper.x", damper=20.0, sensor_noise=1e-10, actuator_noise=1e-8),
    loop("upper.yaw", damper=0.5, sensor_noise=1e-9),
]
DAMPED = RAW | {"control": {"loop": LOOPS}}
LIGHT = ("--fidelity", "beam", "--frequency", "0.1:10:40")


@pytest.fixture
def file(tmp_path):
    return written(tmp_path, DAMPED, "triple.toml")


def csv(folder, text, name="goal.csv"):
    path = folder / name
    path.write_text(text)
    return path


def json_of(file, tmp_path, *options):
    return document("budget", file, "--out", tmp_path / "out", *LIGHT, *options)


def test_the_document(file, tmp_path):
    answer = json_of(file, tmp_path, "--ground", "nlnm")
    keys = (
        "command design fidelity frequency_hz output unit displacement_asd "
        "contributions rms rms_velocity rms_by_cause rms_velocity_by_cause "
        "cumulative_rms cumulative_rms_velocity other_outputs ground mirrors estimated_error"
    )
    assert list(answer) == keys.split()
    assert (answer["command"], answer["output"], answer["unit"]) == (
        "budget",
        "test.x",
        "m/sqrt(Hz)",
    )
    assert [one["output"] for one in answer["other_outputs"]] == ["test.pitch", "test.yaw"]
    assert answer["ground"] == dict.fromkeys("xyz", "nlnm")
    causes = ["ground.x", "ground.y", "ground.z", "sensor.x", "sensor.yaw", "actuator.x", "thermal"]
    assert [*answer["contributions"]] == causes
    frequency = np.array(answer["frequency_hz"])
    assert set(np.geomspace(0.1, 10, 40).round(12)) <= set(frequency.round(12))
    assert len(frequency) > 40 and (np.diff(frequency) > 0).all()
    parts = np.array([*answer["contributions"].values()])
    np.testing.assert_allclose(np.sqrt((parts**2).sum(0)), answer["displacement_asd"], rtol=1e-12)
    squares = np.array([*answer["rms_by_cause"].values()]) ** 2
    assert np.sqrt(squares.sum()) == pytest.approx(answer["rms"], rel=1e-12)
    assert answer["cumulative_rms"][0] == answer["rms"]
    # a symmetric design: y, z and yaw do not reach x
    for cause in ("ground.y", "ground.z", "sensor.yaw"):
        assert answer["rms_by_cause"][cause] == 0.0
    power = np.square(answer["displacement_asd"])
    assert np.sqrt(np.trapezoid(power, frequency)) == pytest.approx(answer["rms"], rel=3e-3)


def test_numbers_are_taken_as_they_are(file, tmp_path):
    grid = json_of(file, tmp_path)
    answer = json_of(file, tmp_path, "--frequency", "10,0.1,1")
    assert answer["frequency_hz"] == [0.1, 1.0, 10.0]
    assert answer["rms"] == pytest.approx(grid["rms"], rel=2e-3)
    assert answer["displacement_asd"][0] == pytest.approx(grid["displacement_asd"][0], rel=1e-12)
    assert json_of(file, tmp_path, "--frequency", "1")["rms"] is None


def test_requirements(file, tmp_path):
    goal = csv(tmp_path, "# goal\n0.5 1e-3\n5 1e-3\n")
    yaw = csv(tmp_path, "f,asd (nrad/sqrt(Hz))\n2,1e-3\n3,1e-3\n50,1e-21\n", "yaw.csv")
    words = ("--ground", "nlnm", "--requirement", goal, "--requirement", f"test.yaw={yaw}")
    answer = json_of(file, tmp_path, *words)
    met, not_met = answer["requirement"], answer["other_outputs"][1]["requirement"]
    assert met["met"] and met["margin"] > 1 and met["exceeded_hz"] == []
    frequency, total = np.array(answer["frequency_hz"]), np.array(answer["displacement_asd"])
    inside = (frequency >= 0.5) & (frequency <= 5)
    assert met["margin"] == pytest.approx(1e-3 / total[inside].max(), rel=1e-9)
    assert met["at_hz"] == frequency[inside][total[inside].argmax()]
    assert not not_met["met"] and not_met["margin"] < 1
    assert not_met["exceeded_hz"] == [[2.0, 10.0]]
    text = run("budget", file, *LIGHT, *words, "--no-plot", "--out", tmp_path / "out").stdout
    assert "requirement goal.csv: met, smallest margin" in text
    assert "requirement yaw.csv: NOT met, exceeded by a factor of" in text


def test_several_mirrors_along_the_beam_of_an_arm(file, tmp_path):
    """The noise of one mirror along the beam, in power times the number; z couples into x."""
    words = ("--output", "test.x", "--frequency", "1,5,20")
    one, tilted = json_of(file, tmp_path, *words), json_of(file, tmp_path, *words, "--arm", "4000")
    up = json_of(file, tmp_path, "--output", "test.z", *words[2:])
    four = json_of(file, tmp_path, *words, "--arm", "4000", "--mirrors", "4")
    assert (four["mirrors"], four["tilt_rad"]) == (4.0, compute_arm_tilt(4000.0))
    assert tilted["mirrors"] == 1.0 and "tilt_rad" not in one
    for cause, part in four["contributions"].items():
        np.testing.assert_allclose(part, 2 * np.array(tilted["contributions"][cause]), rtol=1e-12)
    assert four["rms"] == pytest.approx(2 * tilted["rms"], rel=1e-12)
    slope = np.sin(four["tilt_rad"]) * np.array(up["contributions"]["ground.z"])
    np.testing.assert_allclose(tilted["contributions"]["ground.z"], slope, rtol=1e-9)
    thermal = run("thermal", file, "--json", "--out", tmp_path, *LIGHT[:2], *words, "--arm", "4000")
    # loops move the mirror less at their resonances alone
    assert four["contributions"]["thermal"][2] == pytest.approx(
        2 * strict_json(thermal.stdout)["displacement_asd"][2], rel=0.02
    )
    several = run("budget", file, *LIGHT, "--arm", "4000", "--mirrors", "4", "--out", tmp_path)
    assert "test.x along a beam that rises by 314 urad, 4 mirrors, 0.1 to" in several.stdout
    assert "\ntest.pitch, 4 mirrors, 0.1 to" in several.stdout
    assert run("plot", tmp_path / "triple-budget.h5").exit_code == 0


def test_a_requirement_in_strain(file, tmp_path):
    strain = csv(tmp_path, "f,h (strain/sqrt(Hz))\n1,1e-15\n5,1e-16\n")
    length = csv(tmp_path, "f,x (m/sqrt(Hz))\n1,4e-12\n5,4e-13\n", "length.csv")
    words = ("--output", "test.x", "--arm", "4000", "--requirement")
    first, second = (json_of(file, tmp_path, *words, goal) for goal in (strain, length))
    margins = [one["requirement"]["margin"] for one in (first, second)]
    assert margins[0] == pytest.approx(margins[1], rel=1e-12)
    without = run("budget", file, *LIGHT, "--requirement", strain, "--out", tmp_path / "no")
    (line,) = assert_refused(without, strain, tmp_path / "no")
    assert "whose unit is not known" in line


def test_files_and_pictures(file, tmp_path):
    goal = csv(tmp_path, "1 1e-9\n2 1e-9\n")
    out = tmp_path / "out"
    words = (file, *LIGHT, "--output", "test.x", "--requirement", goal, "--out", out)
    assert run("budget", *words).exit_code == 0
    with h5py.File(out / "triple-budget.h5") as results:
        assert results["budget/contribution"].dims[2].label == "cause"
    again = sus.load(out / "triple-budget.h5")
    assert "requirement goal.csv: NOT met" in str(again)
    goal.write_text("1 0\n2 0\n")
    text = run("budget", *words, "--no-plot").stdout
    assert "NOT met, exceeded by a factor of inf at 1 Hz" in text
    goal.write_text("1 1\n2 1\n")
    run("budget", *words, "--no-plot")
    assert sus.load(out / "triple-budget.h5").motions[0].requirement.exceeded == ()


def test_the_grid_is_cut_to_the_table(file, tmp_path):
    site = csv(tmp_path, "0.2,1e-6\n5,1e-9\n", "site.csv")
    words = ("--out", tmp_path / "out", *LIGHT, "--no-plot", "--ground", site)
    result = run("budget", file, *words)
    assert f"frequencies are cut to 0.2 to 5 Hz, the range of {site}" in result.stderr
    assert "test.x, 0.2 to 5 Hz" in result.stdout


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ("--ground SITE --frequency 20:30:5", "--frequency = "),
        ("--ground none --fidelity string --set control.loop.x.sensor_noise=0", "--ground: "),
        ("--requirement GOAL --frequency 1:10:5", "is from 50 to 60 Hz, outside 1 to 10 Hz of"),
    ],
)
def test_refusals(options, says, tmp_path):
    """Out of the range of a table; no cause at all; others are in `tests/cli/refusals.txt`."""
    raw = RAW | {"control": {"loop": [loop("upper.x", damper=20.0)]}}
    file, site = written(tmp_path, raw, "triple.toml"), csv(tmp_path, "0.2,1e-6\n5,1e-9\n")
    goal, out = csv(tmp_path, "50 1e-9\n60 1e-9\n", "far.csv"), tmp_path / "out"
    words = options.replace("SITE", str(site)).replace("GOAL", str(goal)).split()
    result = run("budget", file, *LIGHT[:2], *words, "--out", out)
    (line,) = assert_refused(result, goal if "GOAL" in options else file, out)
    assert line.startswith(says)


def test_an_unstable_loop(tmp_path):
    raw = RAW | {"control": {"loop": [loop("upper.x", damper=-20.0)]}}
    file, out = written(tmp_path, raw, "triple.toml"), tmp_path / "out"
    (line,) = assert_refused(run("budget", file, *LIGHT, "--out", out), file, out)
    assert line.startswith("control: the closed loop is unstable, so it has no steady motion: a")
