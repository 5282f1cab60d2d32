"""Filters and matrices of loops for front ends, read back apart from the program."""

from __future__ import annotations

import copy
import tomllib

import numpy as np
import pytest
import tomli_w
from scipy import signal

import suspension_cli as sus
from suspension_cli.models import registry
from suspension_cli.physics.closed_loop import find_poles
from suspension_cli.physics.local_control import build_plant
from tests.analyses.damp.test_named_sensors import BLEND, ESTIMATOR, FORWARD
from tests.analyses.export.test_export_foton import coefficients
from tests.support import plants
from tests.support.commandline import assert_refused, run, strict_json, written
from tests.support.paths import CONFIGS

FEW = np.array([0.05, 0.3, 1.0, 4.0])
"""Far below the rate, where digital filters are the continuous ones to (pi f / rate)^2."""
RATE = 16384.0
OSEMS = [
    {"name": name, "stage": "upper", "at": [0.0, y, 0.0], "direction": "x"}
    for name, y in (("L", 0.1), ("R", -0.1))
]
LEAD = 'zpk([0],[40;40],20.0,"n")'
SILENT = [
    {key: value for key, value in one.items() if key != "sensor_noise"}
    for one in ESTIMATOR["sensor"]
]
COILS = {
    "osem": OSEMS,
    "sensor": SILENT,
    "loop": [
        ESTIMATOR["loop"][0],
        {"name": "yaw", "sensor": "upper.yaw", "actuator": "upper.torque_yaw", "filter": LEAD},
    ],
}
CASES = {"estimator": ESTIMATOR, "blend": BLEND, "forward": FORWARD, "coils": COILS}


def exported(folder, raw, *options):
    """Path of the design, of the filter file, and of the matrices."""
    file = written(folder, raw)
    out = folder / "out"
    result = run("export", file, "--format", "front-end", "--out", out, "--json", *options)
    assert result.exit_code == 0, result.stderr
    (filters,) = out.glob("*-front-end.txt")
    (snap,) = out.glob("*-front-end.snap")
    return file, filters, snap, strict_json(result.stdout)


def records(path):
    """Values of the channels of a record, behind its header."""
    head, _, body = path.read_text().partition("--- End BURT header\n")
    assert head.startswith("--- Start BURT header\n")
    found = {}
    for line in body.splitlines():
        name, count, value = line.split()
        assert count == "1"
        assert name not in found
        found[name] = float(value)
    return found


def matrix(values, name):
    """A matrix of the elements NAME_ROW_COLUMN of channels."""
    places = [
        tuple(map(int, channel.split("_")[-2:]))
        for channel in values
        if channel.rpartition("_")[0].rpartition("_")[0] == f"X1:SUS-{name}"
    ]
    if not places:
        return None
    result = np.full(np.max(places, axis=0), np.nan)
    for row, column in places:
        result[row - 1, column - 1] = values[f"X1:SUS-{name}_{row}_{column}"]
    return result


def forces_over_readings(filters, snap, modules, frequency):
    """Forces over the readings that come in, with the modules run as a front end does."""
    values = records(snap)
    gains = []
    for one in modules:
        assert values[f"X1:SUS-{one['module']}_GAIN"] == 1.0
        rows = coefficients(filters, one["module"])
        gains.append(signal.sosfreqz(rows, frequency, fs=RATE)[1])
    read = matrix(values, "READ")
    if (sense := matrix(values, "SENSE")) is not None:
        read = read @ sense
    between = matrix(values, "PASS")
    between = np.zeros((len(modules),) * 2) if between is None else between
    drive = matrix(values, "DRIVE")
    result = []
    for gain in np.array(gains).T:
        out = np.linalg.solve(np.eye(len(gain)) - gain[:, None] * between, gain[:, None] * read)
        result.append(drive @ out[: drive.shape[1]])
    return np.array(result)


@pytest.mark.parametrize("name", CASES)
def test_the_files_are_the_controllers_of_the_design(tmp_path, name):
    """Without the hardware: responses of sensors and delays."""
    control = copy.deepcopy(CASES[name])
    for loop in control["loop"]:
        if loop.pop("damper", None):
            loop["filter"] = LEAD
    control["loop"][0]["delay"] = 1e-3
    _, filters, snap, document = exported(tmp_path, plants.raw("triple") | {"control": control})
    for sensor in control.get("sensor", []):
        sensor.pop("response", None)
    del control["loop"][0]["delay"]
    design = sus.read(written(tmp_path, plants.raw("triple") | {"control": control})).design
    plant = build_plant(design, registry.STRING.system(design))
    found = forces_over_readings(filters, snap, document["modules"], FEW)
    controllers = plant.network.controllers(FEW)
    through = plant.reading if plant.osems else np.eye(len(plant.channels))
    pushed = plant.driving if plant.osems else np.eye(len(plant.loops))
    expected = -pushed @ controllers @ through
    size = np.abs(expected).max((0, 2))[:, None]
    assert (np.abs(found - expected) <= 1e-5 * np.abs(expected) + 1e-12 * size).all()


def test_a_design_that_takes_its_filters_from_the_file(tmp_path):
    """Read back by the program, the closed loop has the same poles."""
    raw = tomllib.loads((CONFIGS / "triple-estimator.toml").read_text())
    _, filters, _, document = exported(tmp_path, raw)
    again = copy.deepcopy(raw)
    sections = {one["module"]: list(range(1, one["sections"] + 1)) for one in document["modules"]}

    def from_file(module):
        return {"file": str(filters), "module": module, "sections": sections[module]}

    for loop in again["control"]["loop"]:
        for key in ("gain", "zeros", "poles"):
            del loop[key]
        loop["filter"] = from_file(f"LOOP_{loop['name'].upper()}")
    for sensor in again["control"]["sensor"]:
        for n, one in enumerate(sensor.get("inputs", []), 1):
            if one["filter"] != "rest":
                one["filter"] = from_file(f"SENSOR_{sensor['name'].upper()}_{n}")
    path = tmp_path / "again.toml"
    path.write_text(tomli_w.dumps(again))
    poles = []
    for file in (CONFIGS / "triple-estimator.toml", path):
        design = sus.read(file).design
        poles.append(find_poles(build_plant(design, registry.STRING.system(design))).value)
    apart = np.abs(poles[1][:, None] / poles[0] - 1)
    slow = np.abs(poles[0]) < 2 * np.pi * 30
    assert apart.min(0)[slow].max() < 2e-5


def test_a_damper_gets_the_pole_of_foton(tmp_path):
    """At rate / pi, and the sign of a damper."""
    loop = {"name": "x", "sensor": "upper.x", "actuator": "upper.force_x", "damper": 20.0}
    raw = plants.raw("triple") | {"control": {"loop": [loop]}}
    _, filters, snap, document = exported(tmp_path, raw)
    found = forces_over_readings(filters, snap, document["modules"], FEW)[:, 0, 0]
    s = 2j * np.pi * FEW
    np.testing.assert_allclose(found, -20.0 * s / (1 + s / (2 * RATE * np.tan(1.0))), rtol=1e-6)


def test_a_filter_of_more_than_twenty_poles_is_divided(tmp_path):
    """Three notches of ten poles each."""
    text = " ".join(f'ellip("BandStop",5,1,40,{f},{f + 3})' for f in (10, 20, 30))
    loop = {"name": "x", "sensor": "upper.x", "actuator": "upper.force_x", "filter": text}
    raw = plants.raw("triple") | {
        "control": {"loop": [loop | {"gain_at": {"frequency": 1.0, "magnitude": 7.0}}]}
    }
    _, filters, snap, document = exported(tmp_path, raw)
    (module,) = document["modules"]
    assert (module["sections"], module["poles"]) == (2, 30)
    found = forces_over_readings(filters, snap, document["modules"], FEW)[:, 0, 0]
    parts = [
        signal.ellip(5, 1, 40, [f, f + 3], "bandstop", analog=False, output="sos", fs=RATE)
        for f in (10, 20, 30)
    ]
    shape = np.prod([signal.sosfreqz(one, FEW, fs=RATE)[1] for one in parts], axis=0)
    at = np.prod([signal.sosfreqz(one, [1.0], fs=RATE)[1][0] for one in parts])
    np.testing.assert_allclose(found, -7.0 * shape / abs(at), rtol=1e-5)


def test_digital_filters_keep_their_coefficients(tmp_path):
    """At their rate; another is refused."""
    given = signal.butter(4, 30.0, fs=2048.0, output="sos")
    numbers = ";".join(repr(float(x)) for row in given for x in (*row[4:], *(row[1:3] / row[0])))
    text = f'sos({float(np.prod(given[:, 0]))!r},[{numbers}],"o")'
    loop = {"name": "x", "sensor": "upper.x", "actuator": "upper.force_x"}
    raw = plants.raw("triple") | {
        "control": {"loop": [loop | {"filter": {"design": text, "rate": 2048.0}}]}
    }
    file, filters, _, document = exported(tmp_path, raw, "--rate", 2048)
    rows = coefficients(filters, document["modules"][0]["module"])
    found = signal.sosfreqz(rows, FEW, fs=2048.0)[1]
    np.testing.assert_allclose(found, signal.sosfreqz(given, FEW, fs=2048.0)[1], rtol=1e-9)
    result = run("export", file, "--format", "front-end", "--out", tmp_path / "none")
    assert_refused(result, file, tmp_path / "none")
    assert "has a rate of 2048 Hz; give --rate 2048" in result.stderr


def test_a_design_without_loops(tmp_path):
    file = CONFIGS / "double.toml"
    result = run("export", file, "--format", "front-end", "--out", tmp_path)
    assert_refused(result, file, tmp_path)


def test_saved_from_python(tmp_path):
    made = sus.export(sus.example("triple-estimator"), format="front-end")
    made.save(tmp_path / "mine.txt")
    assert (tmp_path / "mine.txt").read_text().count("# MODULES ") == 9
    assert "PASS" in str(made)
