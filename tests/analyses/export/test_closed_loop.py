"""Closed loops as one state space: pendulums by hand, `response --closed-loop`, python-control."""

from __future__ import annotations

import json
from functools import cache

import control
import h5py
import numpy as np
import pytest
from scipy.io import loadmat

import suspension_cli as sus
from suspension_cli.models import registry
from suspension_cli.physics.closed_loop import find_poles
from suspension_cli.physics.local_control import build_plant
from suspension_cli.physics.loop_signals import list_names
from tests.analyses.damp.test_damp_cli import damped
from tests.analyses.damp.test_named_sensors import CASES
from tests.support import plants, scenes
from tests.support.commandline import assert_refused, run, strict_json, written
from tests.support.paths import CONFIGS

MASS, LENGTH, DRAG = 3.0, 0.7, 0.05
STIFFNESS = MASS * 9.81 / LENGTH
POLES = [6.0, [3.0, 4.0]]
"""Of the filter, Hz; it has a zero at 0."""
GAIN = 3e3
FILTER = {"gain": GAIN, "zeros": [0.0], "poles": POLES}
FEW = np.array([0.3, 0.55, 0.9, 2.0, 7.0, 15.0, 31.0])


def of_raw(raw, folder):
    return sus.read(written(folder, raw))


def pendulum_path(folder, **loop):
    """A mass on one wire with a loop along x; nothing else moves it."""
    wires = {"count": 1, "l": LENGTH, "k": 1e5}
    stage = scenes.hung(wires, MASS, 0.1, damping={"x": DRAG})
    own = {"name": "x", "sensor": "test.x", "actuator": "test.force_x", "reference": "inertial"}
    return written(folder, scenes.raw_of(stage) | {"control": {"loop": [own | loop]}})


def pendulum(folder, **loop):
    return sus.read(pendulum_path(folder, **loop))


def polynomials():
    """Numerator and denominator of the filter in s, rad/s, highest power first."""
    roots = -2 * np.pi * np.array([6.0, 3.0 + 4.0j, 3.0 - 4.0j])
    return GAIN * (2 * np.pi) ** 2 * np.array([1.0, 0.0]), np.real(np.poly(roots))


def test_poles_of_a_pendulum_by_hand(tmp_path):
    made = sus.export(
        pendulum(tmp_path, **FILTER),
        closed_loop=True,
        inputs="support.x",
        outputs="test.x",
        fidelity="string",
    )
    above, below = polynomials()
    whole = np.polyadd(np.polymul([MASS, DRAG, STIFFNESS], below), above)
    expected = np.sort_complex(np.roots(whole))
    found = np.sort_complex(np.linalg.eigvals(made.system.a))
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    assert made.poles.largest(1e9)[0] < 1e-9


def test_all_signals_of_a_pendulum_by_hand(tmp_path):
    made = sus.export(pendulum(tmp_path, **FILTER), closed_loop=True, fidelity="string")
    s = 2j * np.pi * FEW
    above, below = polynomials()
    h = np.polyval(above, s) / np.polyval(below, s)
    p = 1 / (MASS * s**2 + DRAG * s + STIFFNESS)
    closed = 1 / (1 + p * h)
    expected = {
        ("test.x", "actuator.x"): p * closed,
        ("test.x", "test.force_x"): p * closed,
        ("test.x", "sensor.x"): -p * h * closed,
        ("sensor.x", "sensor.x"): closed,
        ("sensor.x", "actuator.x"): p * closed,
        ("drive.x", "sensor.x"): -h * closed,
        ("drive.x", "actuator.x"): -p * h * closed,
        ("test.x", "support.x"): p * (STIFFNESS + DRAG * s) * closed,
    }
    value = made.system.at(FEW)
    for (out, into), exact in expected.items():
        o = made.system.output.index(out)
        i = made.system.input.index(into)
        np.testing.assert_allclose(value[:, o, i], exact, rtol=1e-9, err_msg=f"{out} {into}")
    assert made.system.input_unit[made.system.input.index("actuator.x")] == "N"
    assert made.system.output_unit[made.system.output.index("sensor.x")] == "m"


def opened_at(made, loop):
    """Gain of a loop by python-control, from the closed system: L = -T / (1 + T)."""
    plant = sus.python_control(made)
    from_actuator = plant[f"drive_{loop}", f"actuator_{loop}"]
    return -control.feedback(control.ss(from_actuator), 1)


def test_margins_of_python_control_are_those_of_damp(tmp_path):
    design = pendulum(tmp_path, **FILTER)
    made = sus.export(design, closed_loop=True, fidelity="string")
    gain, phase, distance, _, at_phase, _ = control.stability_margins(opened_at(made, "x"))
    (own,) = sus.damp(design, fidelity="string", frequency=[1.0, 2.0], duration=1.0).margin
    assert gain == pytest.approx(own.gains[0], rel=1e-6)
    assert phase == pytest.approx(own.phase, rel=1e-6)
    assert at_phase / (2 * np.pi) == pytest.approx(own.phase_frequency, rel=1e-6)
    assert distance == pytest.approx(own.distance, rel=1e-6)


def test_margins_of_one_of_six_loops_of_a_triple(tmp_path):
    """The other loops stay closed; they are velocity dampers."""
    raw = damped(damper=None, filter='zpk([0],[20;20],120.0,"n")')
    del raw["control"]["loop"][0]["damper"]
    design = of_raw(raw, tmp_path)
    own = design.design
    inputs, outputs = list_names(own, registry.STRING.system(own))
    assert set(outputs) >= {"drive.loop-x", "sensor.loop-yaw"}
    assert "drive.loop-y" not in outputs
    assert "sensor.loop-y" not in inputs
    ends = {"inputs": "actuator.loop-x", "outputs": "drive.loop-x"}
    made = sus.export(design, closed_loop=True, fidelity="string", **ends).system.balanced()
    loop = -control.feedback(control.ss(made.a, made.b, made.c, made.d))
    own = sus.damp(design, fidelity="string", frequency=[1.0, 2.0], duration=1.0).margin[0]
    gain, phase, distance, *_ = control.stability_margins(loop)
    assert phase == pytest.approx(own.phase, rel=1e-6)
    assert distance == pytest.approx(own.distance, rel=1e-6)
    assert (gain == np.inf and not own.gains) or gain == pytest.approx(max(own.gains), rel=1e-6)


@pytest.mark.parametrize("name", CASES)
def test_lossless_systems_are_the_closed_loop_response(tmp_path, name):
    """To rounding, with states of what the signals need alone."""
    raw = plants.raw("triple", damping=True) | {"control": CASES[name]}
    design = of_raw(raw, tmp_path)
    ends = {"inputs": ["support.x", "upper.force_x"], "outputs": ["test.x", "upper.pitch"]}
    made = sus.export(design, closed_loop=True, fidelity="string", **ends)
    direct = sus.response(design, closed_loop=True, fidelity="string", frequency=FEW, **ends)
    np.testing.assert_allclose(made.system.at(FEW), direct.value, rtol=1e-8)
    assert not any("yaw" in state for state in made.system.state)
    assert made.poles.largest(1e9)[0] < 1e-6


@cache
def poles_of_beams(name):
    """Closed-loop poles that `damp` lists."""
    design = sus.read(CONFIGS / f"{name}.toml").design
    return find_poles(build_plant(design, registry.BEAM.system(design)))


@pytest.mark.parametrize(
    ("name", "into", "out"),
    [
        ("triple-damped", "support.x", "test.x"),
        ("triple-damped", "sensor.pitch", "test.pitch"),
        ("triple-damped", "upper.force_z", "test.z"),
        ("triple-estimator", "support.yaw", "test.yaw"),
        ("triple-estimator", "sensor.shadow", "drive.yaw"),
    ],
)
def test_with_losses_isolation_and_poles_are_right(name, into, out):
    """Off resonance 1 % of the direct solution with all losses; poles and Q are those of damp."""
    design = sus.read(CONFIGS / f"{name}.toml")
    made = sus.export(design, closed_loop=True, loss=True, inputs=into, outputs=out)
    assert made.worst < 0.01
    assert made.q_error < 0.02
    assert len(made.system.state) < 60
    if not (into + out).startswith(("sensor", "drive")) and "drive" not in out:
        direct = sus.response(
            design, closed_loop=True, inputs=into, outputs=out, frequency=FEW
        ).value
        np.testing.assert_allclose(made.system.at(FEW), direct, rtol=0.01)
    closed = poles_of_beams(name)
    poles = np.linalg.eigvals(made.system.a)
    assert (poles.real < 1e-10 * np.abs(poles)).all()
    for pole, state in zip(made.poles.frequency, made.poles.state, strict=True):
        assert np.abs(closed.frequency / pole - 1).min() < 1e-3, state
    slow = made.poles.frequency < 40.0
    np.testing.assert_allclose(made.poles.exported_q[slow], made.poles.q[slow], rtol=0.02)


def test_undamped_modes_that_would_grow_are_refused(tmp_path):
    """Without losses the loops feed the mode at 36 Hz; with them it decays."""
    file = CONFIGS / "triple-damped.toml"
    result = run("export", file, "--closed-loop", "--out", tmp_path)
    assert_refused(result, file, tmp_path)
    assert "a pole at 36.174 Hz in middle.z grows" in result.stderr
    assert "give --loss" in result.stderr
    ends = ("--input", "support.z", "--output", "test.z")
    result = run("export", file, "--closed-loop", "--loss", "--json", "--out", tmp_path, *ends)
    assert result.exit_code == 0, result.stderr
    document = strict_json(result.stdout)
    assert document["closed_loop"] is True
    (mode,) = [one for one in document["poles"] if 36 < one["frequency_hz"] < 37]
    assert mode["exported_q"] == pytest.approx(mode["q"], rel=0.02)


def test_a_loop_that_is_unstable_is_refused(tmp_path):
    file = CONFIGS / "triple-damped.toml"
    turned = ("--set", "control.loop.x.gain=-1e6")
    result = run("export", file, "--closed-loop", "--loss", "--out", tmp_path, *turned)
    assert_refused(result, file, tmp_path)
    assert "the closed loop is unstable, so it has no steady response" in result.stderr


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--input", "sensor.yw"), "did you mean 'sensor.yaw'?"),
        (("--output", "drive.nothing"), "is no signal of the loops"),
        (("--input", "drive.yaw"), "names no body"),
        (("--format", "gwinc"), "gwinc has no loops of suspensions"),
    ],
)
def test_refusals(tmp_path, options, message):
    file = CONFIGS / "triple-damped.toml"
    result = run("export", file, "--closed-loop", "--loss", "--out", tmp_path, *options)
    assert_refused(result, file, tmp_path)
    assert message in result.stderr


def test_a_design_without_loops(tmp_path):
    file = CONFIGS / "double.toml"
    result = run("export", file, "--closed-loop", "--out", tmp_path)
    assert_refused(result, file, tmp_path)
    assert "control: missing" in result.stderr


def test_delays_and_rates_are_described(tmp_path):
    """Pade's approximation of a delay is right in the band; the text says up to where."""
    loop = {"filter": {"design": 'zpk([0],[20;20],20,"n")', "rate": 2048.0}, "delay": 1e-4}
    file = pendulum_path(tmp_path, **loop)
    ends = ("--input", "support.x", "--output", "test.x", "--fidelity", "string")
    result = run("export", file, "--closed-loop", "--out", tmp_path, *ends)
    assert result.exit_code == 0, result.stderr
    assert "delays up to 0.0001 s" in result.stdout
    assert "up to 1.273e+04 Hz" in result.stdout  # 8 / (2 pi T)
    assert "digital filters at 2048 Hz" in result.stdout


def test_files_have_the_closed_loop_under_its_names(tmp_path):
    """Read by numpy, scipy, h5py, json and python-control, all are one system."""
    file = pendulum_path(tmp_path, **FILTER)
    made = sus.export(sus.read(file), closed_loop=True, fidelity="string").system
    for form in ("npz", "mat", "hdf5", "control"):
        result = run(
            "export", file, "--closed-loop", "--fidelity", "string", "--format", form,
            "--out", tmp_path / "out",
        )  # fmt: skip
        assert result.exit_code == 0, result.stderr
    out = tmp_path / "out"
    (npz,) = out.glob("*.npz")
    (mat,) = out.glob("*.mat")
    (hdf5,) = out.glob("*.h5")
    (text,) = out.glob("*.json")
    arrays = np.load(npz)
    struct = loadmat(mat, simplify_cells=True)["pendsus"]
    document = json.loads(text.read_text())
    with h5py.File(hdf5) as opened:
        group = opened["statespace"]
        stored = {name: group[name][()] for name in "ABCD"}
        names = [name.decode() for name in group["output"][()]]
        assert group.attrs["pole_difference"] < 1e-9
    for name in "ABCD":
        exact = getattr(made, name.lower())
        for other in (arrays, struct, document, stored):
            np.testing.assert_array_equal(np.asarray(other[name]), exact)
    assert names == list(struct["output"]) == document["output"] == arrays["output"].tolist()
    assert "drive.x" in names
    named = {
        key: [one.replace(".", "_") for one in document[key]]
        for key in ("state", "input", "output")
    }
    plant = control.ss(
        *(document[name] for name in "ABCD"),
        states=named["state"], inputs=named["input"], outputs=named["output"],
    )  # fmt: skip
    np.testing.assert_allclose(plant(2j * np.pi * FEW[2]), made.at(FEW[2:3])[0], rtol=1e-9)


def test_osems_have_noise_and_coils_of_their_own(tmp_path):
    """Two OSEMs along x: each reading enters by half, and each coil pushes by half of the force."""
    osems = [
        {"name": name, "stage": "test", "at": [0.0, y, 0.0], "direction": "x"}
        | {"reference": "inertial"}
        for name, y in (("L", 0.1), ("R", -0.1))
    ]
    wires = {"count": 1, "l": LENGTH, "k": 1e5}
    stage = scenes.hung(wires, MASS, 0.1, damping={"x": DRAG, "yaw": 0.1})
    loop = {"name": "x", "sensor": "test.x", "actuator": "test.force_x", "reference": "inertial"}
    raw = scenes.raw_of(stage) | {"control": {"loop": [loop | FILTER], "osem": osems}}
    made = sus.export(of_raw(raw, tmp_path), closed_loop=True, fidelity="string").system
    value = made.at(FEW)

    def found(out, into):
        return value[:, made.output.index(out), made.input.index(into)]

    for osem in "LR":
        np.testing.assert_allclose(
            found("test.x", f"sensor.{osem}"), found("test.x", "sensor.x") / 2
        )
        np.testing.assert_allclose(
            found("test.x", f"actuator.{osem}"), found("test.x", "actuator.x")
        )
        np.testing.assert_allclose(
            found(f"drive.{osem}", "sensor.x"), found("drive.x", "sensor.x") / 2
        )
