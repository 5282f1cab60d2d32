"""`pendsus response --measured`: measured over modelled transfer functions."""

from __future__ import annotations

import json
import re
from pathlib import Path

import h5py
import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.measurements.resonances import find_peaks
from suspension_cli.measurements.transfer_function import MeasuredResponse
from tests.support.commandline import document, run, strict_json
from tests.support.paths import ROOT

FOLDER = ROOT / "measured" / "triple"
DESIGN = FOLDER / "triple.toml"
TABLES = """
transfer_function = [{ file = "a.csv", input = "coil", output = "osem", uncertainty = 0.01 }]
[[sensor]]
name = "osem"
signal = "upper.x@0,0,0.01"
gain = -2.0
delay = 3e-3
mix = { "upper.yaw" = 0.05 }
[[actuator]]
name = "coil"
signal = "upper.force_x"
gain = 1e-3
mix = { "upper.torque_yaw" = 0.02 }
"""
ONE = TABLES.splitlines()[1].removeprefix("transfer_function = [").removesuffix("]")
TWICE = TABLES.replace(ONE, f"{ONE}, {ONE}")


@pytest.fixture(scope="module")
def design():
    return sus.read(DESIGN)


def file_of(folder: Path, frequency, value, name: str = "a.csv") -> Path:
    rows = zip(frequency, value, strict=True)
    lines = [f"{f:.17g}, {h.real:.17g}, {h.imag:.17g}\n" for f, h in rows]
    (folder / name).write_text("f, re, im\n" + "".join(lines))
    return folder / name


def test_model_agrees_with_itself(design, tmp_path):
    """Data made from single responses by the formula of gains, signs, delays and mixes: ratio 1,
    chi^2 0, resonances at the poles."""
    at = np.geomspace(0.3, 5.0, 400)
    given = sus.response(
        design,
        inputs=["upper.force_x", "upper.torque_yaw"],
        outputs=["upper.x@0,0,0.01", "upper.yaw"],
        frequency=at,
        fidelity="string",
    )
    h = given.value
    total = h[:, 0, 0] + 0.02 * h[:, 0, 1] + 0.05 * (h[:, 1, 0] + 0.02 * h[:, 1, 1])
    file_of(tmp_path, at, -2e-3 * np.exp(-2j * np.pi * at * 3e-3) * total)
    (tmp_path / "m.toml").write_text(TABLES)
    [one] = sus.response(design, measured=[tmp_path / "m.toml"], fidelity="string").measured
    assert np.allclose(one.ratio, 1, rtol=1e-9) and one.chi_squared < 1e-10
    assert one.extreme[0] == pytest.approx(1)
    along = np.array([name.endswith("longitudinal") for name in one.mode])
    assert along.sum() == 3 and np.allclose(np.array(one.shift)[along], 0, atol=2e-3)


def test_resonance_is_found_between_points():
    """A pole of Q 30 on a grid coarser than its width, with 0.1 % noise."""
    f = np.geomspace(0.5, 2.0, 60)
    random = np.random.default_rng(2)
    value = 1 / (1.0137**2 - f**2 + 1j * f * 1.0137 / 30)
    value *= 1 + 1e-3 * (random.normal(size=60) + 1j * random.normal(size=60))
    unknown = np.full(60, np.nan)
    data = MeasuredResponse("a", "", "", f, value, unknown, unknown)
    [peak] = find_peaks(data)
    assert np.isclose(peak.frequency, 1.0137, rtol=2e-4)
    assert np.isclose(peak.damping, 1 / 30, rtol=0.02)


def test_peaks_are_paired_with_modes_one_to_one(design, tmp_path):
    """One peak 8 % below a mode, two at another, and those of another structure above all modes."""
    known = sus.modes(design, fidelity="string")
    modes = [f for f, name in zip(known.frequency, known.label, strict=True) if "vert" in name]
    peaks = [0.92 * modes[0], 0.99 * modes[1], 1.05 * modes[1], 0.5 * modes[2], 3.2 * modes[2]]
    pairs = [modes[0], modes[1], None, None, None]
    f = np.geomspace(0.3, 200.0, 4000)
    value = sum(1 / (at**2 - f**2 + 0.02j * f * at) for at in peaks)
    file = file_of(tmp_path, f, value)
    options = ("--input", "upper.force_z", "--output", "upper.z", "--fidelity", "string")
    done = run("response", DESIGN, "--measured", file, *options, "--json", "--out", tmp_path)
    found = strict_json(done.stdout)["measured"][0]["resonances"]
    assert [one["measured_hz"] for one in found] == pytest.approx(peaks, rel=2e-3)
    assert [one["model_hz"] for one in found] == [f and pytest.approx(f, rel=1e-3) for f in pairs]
    assert [one["shift"] for one in found][2:] == [None] * 3
    text = run("response", DESIGN, "--measured", file, *options, "--out", tmp_path).stdout
    [line] = re.findall("measured resonances of no mode: (.*) Hz", text)
    assert np.allclose([float(word) for word in line.split(",")], peaks[2:], rtol=2e-3)
    again = sus.load(tmp_path / "triple-response.h5").document()["measured"][0]["resonances"]
    assert again == found


def test_command(tmp_path):
    """The example: table, JSON, HDF5, and the picture redrawn from the file alone."""
    words = ("response", DESIGN, "--measured", FOLDER / "measured.toml", "--fidelity", "beam")
    done = run(*words, "--out", tmp_path, "--frequency", "0.3:6:200")
    assert done.exit_code == 0
    assert "+1.00  test pitch#1         pitch\n" in done.stdout
    assert "osem-x / coil-x (m/V)" in done.stdout
    answer = document(*words, "--out", tmp_path)
    first = answer["measured"][0]
    assert first["points"] == 240 and first["unit"] == "m/V" and first["name"] == "x"
    assert first["median_ratio"] == pytest.approx(1.0, abs=0.02)
    assert first["resonances"][1]["shift"] == pytest.approx(-0.0067, abs=2e-4)
    with h5py.File(tmp_path / "triple-response.h5") as file:
        group = file["response/measured/2"]
        assert group.attrs["name"] == "pitch" and group["value"].shape == (160,)
        assert group["predicted"].dims[0].label == "frequency"
    again = sus.load(tmp_path / "triple-response.h5")
    assert json.dumps(again.document()["measured"]) == json.dumps(answer["measured"])
    assert len(again.plot(scale="absolute").axes) == 4


@pytest.mark.parametrize(
    ("tables", "words", "says"),
    [
        (None, (), 'does not say what was driven and observed'),
        (DESIGN.read_text(), (), "is a design (it has [[stage]]), not a file of measurements"),
        (None, ("--input", "support.x", "--output", "uper.x"), 'did you mean \'upper\'?'),
        (TABLES.replace("upper.yaw", "uper.yaw"), (), "{file}: sensor.osem = "),
        (TABLES.replace('"osem"', '"ossem"', 1), (), "as upper.x; did you mean 'osem'?"),
        ('mode = [{ frequency = 1, uncertainty = 1 }]', (), "has no [[transfer_function]]"),
        (TABLES.replace("a.csv", "b.csv"), (), "b.csv: cannot be read"),
        (TWICE.replace("a.csv", "b.csv"), (), "b.csv: cannot be read"),
        (TABLES.replace('input = "coil"', 'input = "upper.x"'), (), "is an output; give"),
    ],
)  # fmt: skip
def test_faulty_measurements(tables, words, says, tmp_path):
    file = file_of(tmp_path, [1.0, 2.0], [1 + 1j, 2 + 1j])
    if tables is not None:
        file = tmp_path / "m.toml"
        file.write_text(tables)
    out = tmp_path / "out"
    done = run("response", DESIGN, "--measured", file, *words, "--out", out)
    assert done.exit_code == 2 and not out.exists() and done.stdout == ""
    assert says.format(file=file) in done.stderr and done.stderr.count("\n") == 1


def test_results_and_folders_are_no_measurements(design, tmp_path):
    """Each is named for what it is, in one line."""
    stored = tmp_path / "triple-response.h5"
    sus.response(design, frequency=[1.0, 2.0], fidelity="string").save(stored)
    words = ("--input", "support.x", "--output", "test.x", "--out", tmp_path / "out")
    for given, says in (
        (stored, "is a results file of pendsus, not a measurement"),
        (tmp_path, "is a directory"),
        (tmp_path / "none.csv", "is missing"),
    ):
        done = run("response", DESIGN, "--measured", given, *words)
        assert done.exit_code == 2 and f"{given}: {says}" in done.stderr
    done = run("response", FOLDER / "measured.toml", "--out", tmp_path / "out")
    assert done.exit_code == 2 and done.stderr.count("\n") == 1
    assert "is a file of measurements (it has [[transfer_function]]), not a design" in done.stderr
    assert not (tmp_path / "out").exists()


def test_loops_closed(tmp_path):
    """Data measured with the loops closed are compared with closed-loop responses."""
    damped = sus.example("triple-damped")
    at = np.geomspace(0.3, 6.0, 60)
    signals = {"inputs": ["support.x"], "outputs": ["test.x"]}
    given = sus.response(damped, **signals, frequency=at, closed_loop=True, fidelity="string")
    rows = zip(at.tolist(), given.value[:, 0, 0].tolist(), strict=True)
    text = "".join(f"{f!r},{value.real!r},{value.imag!r}\n" for f, value in rows)
    (tmp_path / "x.csv").write_text("f,re,im\n" + text)
    found = sus.response(
        damped, **signals, measured=[tmp_path / "x.csv"], closed_loop=True, fidelity="string"
    )
    assert np.allclose(found.measured[0].ratio, 1, rtol=1e-9)
    (tmp_path / "out").mkdir()
    found.save(tmp_path / "out" / "r.h5")
    assert np.allclose(sus.load(tmp_path / "out" / "r.h5").measured[0].ratio, 1, rtol=1e-9)
