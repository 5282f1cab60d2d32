"""`--fidelity auto` means one thing in all commands, and each reports what its model neglects: in
its reason, its estimated error, and a warning from 1 %."""

from __future__ import annotations

import h5py
import pytest

from suspension_cli.studies import parameters
from tests.support.commandline import run, strict_json, written
from tests.support.paths import CONFIGS

QUADRUPLE = CONFIGS / "quadruple.toml"
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


def answer_of(*words, out):
    done = run(*words, "--json", "--out", out)
    assert done.exit_code == 0, done.stderr
    found = strict_json(done.stdout)
    return (found["designs"][0] if "designs" in found else found), done.stderr


def test_what_cannot_be_had_is_warned_of(tmp_path):
    """On strings, where bending of the wires changes a pitch mode by half of its frequency."""
    words = ("sensitivity", QUADRUPLE, "--fidelity", "string")
    answer, stderr = answer_of(*words, out=tmp_path)
    warning = "the string model neglects wire bending, which changes test pitch"
    assert f"warning: quadruple: {warning}" in stderr
    attributes = recorded(tmp_path)
    assert answer["fidelity"] == "string"
    assert 0.1 < answer["estimated_error"] == attributes["estimated_error"]
    assert "neglected: wire bending, " in attributes["fidelity_reason"]


def test_neglected_physics_is_of_the_requested_quantity(tmp_path):
    """Bending hardly changes how a mass swings, whatever it does to its pitch."""
    words = ("sensitivity", QUADRUPLE, "--result", "test transverse")
    answer, stderr = answer_of(*words, out=tmp_path)
    assert "neglects" not in stderr
    assert 0 < answer["estimated_error"] < 0.01


@pytest.mark.parametrize("words", LITTLE, ids=lambda words: words[0])
def test_what_is_small_is_recorded(words, tmp_path):
    answer, stderr = answer_of(*words, out=tmp_path)
    attributes = recorded(tmp_path)
    assert "neglects" not in stderr
    assert 0 < answer["estimated_error"] < 0.01
    assert answer["estimated_error"] == attributes["estimated_error"]
    assert "neglected: " in attributes["fidelity_reason"]


def measured(modes, number, tmp_path):
    rows = [
        {"frequency": mode["frequency_hz"], "uncertainty": 1e-3 * mode["frequency_hz"]}
        for mode in modes
    ]
    return written(tmp_path, {"mode": rows, "parameter": [{"name": number}]}, "measured.toml")


def test_commands_agree_at_the_same_point(tmp_path):
    """Commands with derivatives take the model that `modes` takes."""
    file = CONFIGS / "double.toml"
    (of_modes, _), (found, _) = (
        answer_of(name, file, out=tmp_path) for name in ("modes", "sensitivity")
    )
    modes = of_modes["modes"]
    nominal = [item["nominal"] for item in found["results"]]
    assert nominal == pytest.approx([mode["frequency_hz"] for mode in modes], rel=1e-3)
    data = measured(modes, "stage.test.wires.l", tmp_path)
    fitted, _ = answer_of("fit", file, data, out=tmp_path)
    for one in (found, fitted):
        assert one["fidelity"] == of_modes["fidelity"] and one["estimated_error"] < 1e-3
    assert fitted["chi_squared"] < len(modes)


def test_a_fit_finds_the_sign_of_d(tmp_path):
    """Thick wires hold a quadruple upright that hangs from above its centres of mass: on straight
    wires, the same modes look like those of one with the opposite sign."""
    pitch, true = "stage.upper.wires.d", -0.0008
    shifted = [word for path in parameters.twins(pitch) for word in ("--set", f"{path}={true}")]
    answer, _ = answer_of("modes", QUADRUPLE, *shifted, out=tmp_path)
    assert answer["fidelity"] == "beam"
    data = measured(answer["modes"], pitch, tmp_path)
    found, _ = answer_of("fit", QUADRUPLE, data, out=tmp_path)
    assert found["fidelity"] == "beam"
    assert found["parameters"][0]["value"] == pytest.approx(true, rel=0.01)
    words = ("fit", QUADRUPLE, data, "--fidelity", "string")
    straight, _ = answer_of(*words, out=tmp_path)
    assert straight["parameters"][0]["value"] > 0


def test_a_model_without_an_estimate_says_so_first(tmp_path):
    """Wires of given k without cross-section have unknown bending."""
    text = (CONFIGS / "husman2000" / "table1-case4.toml").read_text()
    lines = [
        "k = 13000.0" if line.startswith("radius") else line
        for line in text.splitlines()
        if not line.startswith("material =")
    ]
    plain = written(tmp_path, "\n".join(lines))
    done = run("sensitivity", plain, "--no-plot", "--out", tmp_path)
    assert done.exit_code == 0, done.stderr
    first = done.stdout.splitlines()[0]
    assert first.startswith("model: string (") and "unknown: wire bending" in first
    found, _ = answer_of("sensitivity", plain, out=tmp_path)
    assert found["estimated_error"] is None and found["error_unknown"]


TIPPING = ("--set", "stage.test.wires.s=0", "--set", "stage.test.wires.d=-0.0001")
"""Wires that end 0.1 mm below the COM: straight ones let it tip over, bent ones do not."""
TIPS = "it decides whether test pitch is stable"


def test_what_straight_wires_do_not_hold(tmp_path):
    """No number gives the effect of bending: it is said in words."""
    file = CONFIGS / "husman2000" / "figure6.toml"
    words = ("--fidelity", "string", "--no-plot", "--out", tmp_path)
    done = run("modes", file, *TIPPING, *words)
    assert done.exit_code == 0, done.stderr
    assert TIPS in done.stdout
    assert " inf" not in done.stdout and "(inf" not in done.stdout
    answer = strict_json(run("modes", file, *TIPPING, *words, "--json").stdout)
    assert answer["estimated_error"] is None and TIPS in answer["error_unknown"]
