"""Noise of sensors, actuators and drivers, in each form that a design gives it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.io import savemat

import suspension_cli as sus
from suspension_cli.design import noise_spectra
from tests.support.commandline import run

AT = np.array([0.1, 1.0, 10.0])
ASD = np.array([1e-8, 2e-10, 5e-11])
KEYS = {
    "control.loop.x.sensor_noise": "sensor.x",
    "control.loop.x.actuator_noise": "actuator.x",
    "control.osem.F1.sensor_noise": "sensor.F1",
    "control.osem.F1.force_noise": "actuator.F1",
    "control.osem.F1.driver_noise": "actuator.F1",
}
PENDULUM = sus.template("single").text
LOOP = """
[[control.loop]]
name = "x"
sensor = "test.x"
actuator = "test.force_x"
damper = 1.0
"""
OSEM = """
[[control.osem]]
name = "F1"
stage = "test"
at = [0.05, 0.0, 0.0]
direction = "x"
coil = 1.0
transconductance = 0.1
"""


def files(folder, unit: str = "nm") -> dict[str, str]:
    """The points in each form of a design, as TOML; files are written into a folder."""
    header = f"frequency (mHz), noise ({unit}/sqrt(Hz))"
    table = np.array([1e3 * AT, 1e9 * ASD]).T
    np.savetxt(folder / "noise.csv", table, header=header, delimiter=",")
    savemat(folder / "noise.mat", {"f": AT, "spectra": {"one": ASD, "two": 2 * ASD}})
    points = [[float(f), float(asd)] for f, asd in zip(AT, ASD, strict=True)]
    return {
        "points": f"{points}",
        "table": f"{{ frequency = {AT.tolist()}, asd = {ASD.tolist()} }}",
        "csv": '"noise.csv"',
        "matlab": '{ file = "noise.mat", column = "spectra.one" }',
    }


@pytest.mark.parametrize("form", ["points", "table", "csv", "matlab"])
@pytest.mark.parametrize("key", KEYS)
def test_each_key_takes_each_form(key, form, tmp_path):
    """The budget at the points is proportional to the numbers that were given there."""
    text = PENDULUM + LOOP + (OSEM if "osem" in key else "")
    unit = {"sensor_noise": "nm", "driver_noise": "nV"}.get(key.rpartition(".")[2], "nN")
    given = files(tmp_path, unit)[form]
    file = tmp_path / "mine.toml"
    file.write_text(text)
    design = sus.read(file, f"{key}={given}")
    flat = sus.read(file, f"{key}=1.0")
    how = {"frequency": AT, "outputs": ["test.x"], "ground": ["none"], "fidelity": "string"}

    def part(one: sus.Design) -> np.ndarray:
        return sus.budget(one, **how).first.parts[KEYS[key]]

    assert part(design) == pytest.approx(part(flat) * ASD, rel=1e-9)


def test_between_points_and_outside():
    """Power laws between, the value of the end outside; rising below a corner as 1/f in power."""
    points = [[1.0, 1e-9], [100.0, 1e-11]]
    found = noise_spectra.density(points, [0.01, 10.0, 1e4])
    assert found == pytest.approx([1e-9, 1e-10, 1e-11], rel=1e-12)
    cornered = noise_spectra.NoiseSpectrum(asd=2.0, corner=3.0)
    assert noise_spectra.density(cornered, [1.0]) == pytest.approx([2.0 * math.sqrt(4.0)])


def test_known_sensors_and_drivers():
    """The numbers of their sources."""
    assert noise_spectra.density("bosem", 1.0) == pytest.approx(1.5e-10)
    assert noise_spectra.density("gs13", 10.71) == pytest.approx(3.28e-13)
    assert noise_spectra.density("dac-18bit", [0.1, 100.0]) == pytest.approx([1.5e-7, 1.5e-7])
    whole = PENDULUM + LOOP + 'sensor_noise = "l4c"\n'
    [loop] = sus.parse(whole).design.control.loop
    assert loop.sensor_noise == "l4c"


def test_a_file_in_another_unit_is_refused(tmp_path):
    """Metres are no forces."""
    files(tmp_path, "nm")
    file = tmp_path / "mine.toml"
    file.write_text(PENDULUM + LOOP)
    result = run("check", file, "--set", 'control.loop.x.actuator_noise="noise.csv"')
    assert result.exit_code == 2
    assert "whose unit is not known; give it in N, " in result.stderr


@pytest.mark.parametrize("given", ["0.1", "{ asd = 0.1 }", "{ frequency = [1, 2], asd = [1, 1] }"])
def test_implausible_noise_of_a_sensor_is_warned_of(given, tmp_path):
    """Nanometres given as metres, in numbers and tables."""
    file = tmp_path / "mine.toml"
    file.write_text(PENDULUM + LOOP)
    result = run("check", file, "--set", f"control.loop.x.sensor_noise={given}")
    assert result.exit_code == 0
    assert "did you mean nm/sqrt(Hz)?" in result.stderr


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ('"bosen"', "is neither a known sensor or driver nor a file"),
        ('"bosen"', "did you mean 'bosem'?"),
        ('"noise.mat"', "has the spectra spectra.one, spectra.two"),
        ('{ file = "noise.mat", column = "three" }', "has no such column"),
        ('{ file = "other.csv" }', "cannot be read"),
        ('{ column = "three", asd = 1.0 }', 'column = "three": has no effect without file'),
        ("[[1.0, 1e-9], [0.5, 1e-9]]", "has points that do not ascend"),
        ("[[1.0, -1e-9], [2.5, 1e-9]]", "sensor_noise.1.2 = -1e-09: must be greater than 0"),
        ("{ asd = [1e-9, 1e-9] }", "lists of one length"),
    ],
)
def test_faults_are_one_clear_line(given, message, tmp_path):
    """Exit code 2, file, key and remedy."""
    files(tmp_path)
    file = tmp_path / "mine.toml"
    file.write_text(PENDULUM + LOOP)
    result = run("check", file, "--set", f"control.loop.x.sensor_noise={given}")
    assert result.exit_code == 2
    assert message in result.stderr
    assert result.stderr.count("\n") == 1
