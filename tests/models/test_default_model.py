"""One meaning of `--fidelity auto`: commands with derivatives take the model that `modes` takes."""

from __future__ import annotations

import pytest

from suspension_cli.studies import parameters
from tests.support.commandline import run, strict_json, written
from tests.support.golden import CONFIGS

CHAINS = ("double",)
NUMBER = "stage.test.wires.l"
PITCH = "stage.upper.wires.d"


def answer(*words, out):
    done = run(*words, "--json", "--out", out)
    assert done.exit_code == 0, done.stderr
    return strict_json(done.stdout)


def modes_of(file, *words, out):
    """Fidelity, and frequencies by label, of `pendsus modes`."""
    (found,) = (answer("modes", file, *words, out=out),)
    found = found["designs"][0] if "designs" in found else found
    return found["fidelity"], found["modes"]


def measured(modes, number, tmp_path):
    rows = [
        {"frequency": mode["frequency_hz"], "uncertainty": 1e-3 * mode["frequency_hz"]}
        for mode in modes
    ]
    return written(tmp_path, {"mode": rows, "parameter": [{"name": number}]}, "measured.toml")


@pytest.mark.parametrize("name", CHAINS)
def test_commands_agree_at_the_same_point(name, tmp_path):
    file = CONFIGS / f"{name}.toml"
    fidelity, modes = modes_of(file, out=tmp_path)
    found = answer("sensitivity", file, out=tmp_path)
    assert found["fidelity"] == fidelity and found["estimated_error"] < 1e-3
    nominal = [item["nominal"] for item in found["results"]]
    assert nominal == pytest.approx([mode["frequency_hz"] for mode in modes], rel=1e-3)
    fitted = answer("fit", file, measured(modes, NUMBER, tmp_path), out=tmp_path)
    assert fitted["fidelity"] == fidelity and fitted["estimated_error"] < 1e-3
    assert fitted["chi_squared"] < len(modes)


def test_a_fit_finds_the_sign_of_d(tmp_path):
    """Thick wires hold a quadruple upright that hangs from above its centres of mass: on straight
    wires, the same modes look like those of one with the opposite sign."""
    file, true = CONFIGS / "quadruple.toml", -0.0008
    shifted = [word for path in parameters.twins(PITCH) for word in ("--set", f"{path}={true}")]
    fidelity, modes = modes_of(file, *shifted, out=tmp_path)
    assert fidelity == "beam"
    data = measured(modes, PITCH, tmp_path)
    found = answer("fit", file, data, out=tmp_path)
    assert found["fidelity"] == "beam"
    assert found["parameters"][0]["value"] == pytest.approx(true, rel=0.01)
    straight = answer("fit", file, data, "--fidelity", "string", out=tmp_path)
    assert straight["parameters"][0]["value"] > 0


def test_a_model_without_an_estimate_says_so_first(tmp_path):
    """Wires of given k without cross-section have unknown bending."""
    file = CONFIGS / "husman2000" / "table1-case4.toml"
    text = file.read_text()
    lines = [
        "k = 13000.0" if line.startswith("radius") else line
        for line in text.splitlines()
        if not line.startswith("material =")
    ]
    plain = tmp_path / "plain.toml"
    plain.write_text("\n".join(lines))
    done = run("sensitivity", plain, "--no-plot", "--out", tmp_path)
    assert done.exit_code == 0, done.stderr
    first = done.stdout.splitlines()[0]
    assert first.startswith("model: string (") and "unknown: wire bending" in first
    found = answer("sensitivity", plain, out=tmp_path)
    assert found["estimated_error"] is None and found["error_unknown"]
