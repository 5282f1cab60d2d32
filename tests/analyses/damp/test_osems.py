"""OSEMs: matrices in closed form, noise and drives of loops that share them by hand."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from scipy.integrate import quad

import suspension_cli as sus
from suspension_cli.conventions import BOLTZMANN
from suspension_cli.design.control import Osem
from suspension_cli.errors import InputError
from suspension_cli.linear import response
from suspension_cli.models import registry
from suspension_cli.physics import closed_loop, local_control
from suspension_cli.physics import noise_budget as solve
from suspension_cli.physics.ground import Spectrum
from suspension_cli.physics.local_control import compute_matrices
from suspension_cli.physics.noise_budget import Noises
from tests.analyses.damp.test_control import LEAD, loop
from tests.support import plants, scenes
from tests.support.commandline import assert_refused, run, strict_json, written

WIDE, HIGH = 0.1, 0.04
CORNERS = [(0.0, y, z) for y in (WIDE, -WIDE) for z in (HIGH, -HIGH)]
GRID = np.geomspace(0.05, 50, 60)


def osem(name, at, direction="x", stage="test", **how):
    return {"name": name, "stage": stage, "at": at, "direction": direction, **how}


def corners(stage="upper", **how):
    return [osem(f"F{n}", at, stage=stage, **how) for n, at in enumerate(CORNERS)]


def matrices(given):
    return compute_matrices([Osem(**one) for one in given])


def plant(raw, loops, given, level="string"):
    design = scenes.design_of(raw | {"control": {"loop": loops, "osem": given}})
    return local_control.build_plant(design, registry.by_name(level).system(design))


def test_six_osems_are_inverted_exactly():
    """A body that moves along or about one axis by 1 gives 1 for this coordinate, 0 for others."""
    rng = np.random.default_rng(1)
    at, along = rng.normal(size=(2, 6, 3))
    [found] = matrices(
        osem(f"o{n}", tuple(at[n].tolist()), tuple(along[n].tolist())) for n in range(6)
    )
    unit = along / np.linalg.norm(along, axis=1)[:, None]
    readings = np.array(
        [
            [d @ (move[:3] + np.cross(move[3:], p)) for move in np.eye(6)]
            for p, d in zip(at, unit, strict=True)
        ]
    )
    np.testing.assert_allclose(found.to_euler @ readings, np.eye(6), atol=1e-9)
    # the coils push along one coordinate alone: forces d, and torques p x d
    wrench = np.hstack([unit, np.cross(at, unit)]).T @ found.to_coil
    np.testing.assert_allclose(wrench, np.eye(6), atol=1e-9)
    assert found.coordinate == ("x", "y", "z", "roll", "pitch", "yaw")


def test_four_at_the_corners_resolve_three_coordinates():
    [found] = matrices(corners())
    assert (found.coordinate, found.osem) == (("x", "pitch", "yaw"), ("F0", "F1", "F2", "F3"))
    left, up = np.sign(CORNERS)[:, 1:].T
    expected = [np.full(4, 0.25), up / (4 * HIGH), -left / (4 * WIDE)]
    np.testing.assert_allclose(found.to_euler, expected, rtol=1e-12)


def test_stages_and_references_have_matrices_of_their_own():
    turned = osem("N", (0.0, 0.0, 0.0), "-y", "test", reference="inertial")
    found = matrices([*corners(), osem("T", (0.0, 0.0, 0.0), (0.0, 3.0, 4.0)), turned])
    assert [one.stage for one in found] == ["upper", "test", "test"]
    assert found[1].coordinate == ()  # y and z together
    assert found[2].coordinate == ("y",) and found[2].to_euler.tolist() == [[-1.0]]


def test_a_point_is_resolved_by_what_moves_it():
    """Two OSEMs above each other see x beside the COM at any height, but not at the COM."""
    two = [osem(f"o{n}", (0.0, 0.02, z)) for n, z in enumerate((0.05, -0.05))]
    near = loop("test.x@0,0.02,0.025", "test.torque_pitch", damper=1.0)
    found = oscillator(two, [near])
    np.testing.assert_allclose(found.driving, [[10.0], [-10.0]], rtol=1e-12)
    np.testing.assert_allclose(found.reading, [[0.75, 0.25]], rtol=1e-12)
    with pytest.raises(InputError, match="these resolve pitch"):
        oscillator(two, [loop("test.x", "test.torque_pitch", damper=1.0)])


def oscillator(given, loops, reference="inertial"):
    """A body on one wire through its COM; its x and yaw do not couple, nothing holds yaw."""
    stage = scenes.hung({"count": 1, "l": 0.7, "k": 1e5}, 3.0, 0.1, damping={"x": 0.05})
    own = [one | {"reference": reference} for one in given]
    loops = [one | {"reference": reference} for one in loops]
    return plant(scenes.raw_of(stage), loops, own)


def test_noise_of_one_osem_enters_all_loops_coherently():
    """Two OSEMs that read x and yaw move a point beside the COM, by hand."""
    one, other, beside, c, b = 2e-9, 3e-9, 0.06, 1.3, 0.4
    two = [
        osem("L", (0.0, WIDE, 0.0), sensor_noise=one, force_noise=5e-6),
        osem("R", (0.0, -WIDE, 0.0), sensor_noise=other),
    ]
    closed = oscillator(two, [loop("test.x", damper=c), loop("test.yaw", damper=b)])
    [point] = plants.motions(closed.model, f"test.x@0,{beside},0")
    found = dict(zip(*causes(closed, [point]), strict=True))
    s = 2j * np.pi * GRID
    x = 1 / (3.0 * 9.81 / 0.7 + s * (0.05 + c) + 3.0 * s**2)  # motions per force and torque
    yaw = 1 / (s * b + 0.1 * s**2)
    # L reads x - WIDE yaw, so it is 1/2 of x and -1/(2 WIDE) of yaw; the point: x - beside yaw
    left = -s * c * x / 2 - beside * s * b * yaw / (2 * WIDE)
    right = -s * c * x / 2 + beside * s * b * yaw / (2 * WIDE)
    np.testing.assert_allclose(found["sensor.L"], np.abs(left * one) ** 2, rtol=1e-8)
    np.testing.assert_allclose(found["sensor.R"], np.abs(right * other) ** 2, rtol=1e-8)
    pushed = x + beside * WIDE * yaw
    np.testing.assert_allclose(found["actuator.L"], np.abs(pushed * 5e-6) ** 2, rtol=1e-8)


def causes(closed, outputs):
    noises = Noises(closed, outputs, {}, None)
    return noises.cause, noises.density(GRID)[0]


def test_rms_of_a_drive_against_quadrature():
    """One degree of freedom: ground, sensor, coil and thermal noise, integrated independently."""
    shown, force, c, white = 2e-7, 4e-7, 1.3, 3e-7
    how = {"coil": 1.5, "transconductance": 0.02, "counts_per_volt": 3000.0, "range": 1e-3}
    only = [osem("only", (0.0, 0.0, 0.0), sensor_noise=shown, force_noise=force, **how)]
    closed = oscillator(only, [loop("test.x", damper=c)])
    [x] = plants.motions(closed.model, "test.x")
    ground = {"x": Spectrum("white", np.array([1e-6, 1e6]), np.full(2, white))}
    noises, poles = Noises(closed, [x], ground, 300.0, 4.0), np.roots([3.0, c + 0.05, 42.0])
    low, high = 0.1, 20.0
    grid = np.geomspace(low, high, 300)
    [found] = solve.solve(noises, grid, poles[:1], {}, added=True)

    def spectrum(f):
        s, spring = 2j * np.pi * f, 3.0 * 9.81 / 0.7
        h, z = s * c, spring + s * (0.05 + c) + 3.0 * s**2
        return (
            abs(h * (spring + s * 0.05) / z * white) ** 2
            + abs(h * (1 - h / z) * shown) ** 2
            + abs(h / z * force) ** 2
            + abs(h / z) ** 2 * 4 * BOLTZMANN * 300.0 * 0.05
        )

    expected = np.sqrt(quad(spectrum, low, high, points=[0.6], limit=500, epsrel=1e-8)[0])
    [drive] = found.drive
    assert drive.force == pytest.approx(expected, rel=1e-3)
    assert (drive.coil, drive.cause) == ("only", "sensor.only")
    assert drive.current == pytest.approx(expected / 1.5, rel=1e-3)
    assert drive.voltage == pytest.approx(expected / 0.03, rel=1e-3)
    assert drive.counts == pytest.approx(expected / 0.03 * 3000, rel=1e-3)
    assert drive.part == pytest.approx(expected / 0.03 / 1e-3, rel=1e-3)


def test_thermal_noise_of_drives():
    """Against the fluctuation-dissipation theorem for all sensed motions together."""
    loops = [loop("upper.x", **LEAD), loop("upper.pitch", gain=5.0, zeros=[0.0], poles=[20.0])]
    closed = plant(plants.raw("triple", loss=True, damping=True), loops, corners())
    omega = 2 * np.pi * GRID
    y, _ = response.transfer(closed.model, omega, closed.sensed, [True] * 2, closed.sensed)
    push, _ = response.transfer(closed.model, omega, closed.pushed, [True] * 2, closed.sensed)
    open_loop = -4 * BOLTZMANN * 290.0 / omega[:, None, None] * y.imag
    h = closed.network.controllers(GRID)
    up = np.sign(CORNERS)[:, 2]
    to_coil = np.stack([np.full(4, 0.25), up / (4 * HIGH)], axis=1)
    whole = to_coil @ h @ np.linalg.inv(np.eye(2) + push @ h)
    expected = np.einsum("fai,fij,faj->af", whole, open_loop, whole.conj()).real
    noises = Noises(closed, plants.motions(closed.model, "test.x"), {}, 290.0)
    found = noises.density(GRID)[:, -1]
    np.testing.assert_allclose(found[1:], expected, rtol=1e-6)


def test_noise_of_a_known_sensor():
    part = Osem(**osem("a", (0.0, 0.0, 0.0), sensor_noise="bosem"))
    found = local_control.evaluate_noise(part, np.array([1.0, np.sqrt(10.0), 10.0]))
    np.testing.assert_allclose(found, [1.5e-10, np.sqrt(9e-21), 6e-11], rtol=1e-12)
    voltage = Osem(**osem("a", (0, 0, 0), driver_noise=2e-7, coil=1.5, transconductance=0.1))
    found = local_control.evaluate_actuator_noise(voltage, np.array([1.0, 100.0]))
    assert found == pytest.approx([3e-8, 3e-8])
    through = msgspec.structs.replace(voltage, driver_response='pole(10,"n")')
    found = local_control.evaluate_actuator_noise(through, np.array([1.0, 100.0]))
    assert found == pytest.approx(3e-8 / np.sqrt(1 + np.array([0.01, 100.0])))


def test_voltage_at_a_driver_that_rolls_off():
    """A force F needs the voltage F / (coil transconductance) |1 + i f / f0|."""
    loops = [loop("upper.x", damper=20.0)]
    electronics = {"coil": 1.5, "transconductance": 0.1, "sensor_noise": "bosem"}
    drives = []
    density = frequency = np.zeros(0)
    for more in ({}, {"driver_response": 'pole(2,"n")'}):
        closed = plant(plants.raw("triple", loss=True), loops, corners(**electronics, **more))
        noises = Noises(closed, plants.motions(closed.model, "test.x"), {}, None)
        poles = closed_loop.find_poles(closed).value
        [found] = solve.solve(noises, np.geomspace(0.1, 10.0, 200), poles, {}, added=True)
        drives.append(found.drive[0])
        frequency = found.frequency
        density = noises.density(frequency)[1].sum(0)
    plain, rolled = drives
    assert rolled.force == pytest.approx(plain.force, rel=1e-9)
    expected = np.sqrt(np.trapezoid(density * (1 + (frequency / 2) ** 2), frequency)) / 0.15
    assert rolled.voltage == pytest.approx(expected, rel=2e-3)
    assert rolled.voltage > 1.2 * plain.voltage


REFUSED = {
    "not resolved": (
        [loop("upper.y", damper=1.0)],
        {},
        'control.loop.y.sensor = "upper.y": is not resolved by the OSEMs of upper; add OSEMs: these'
        " resolve x, pitch, yaw",
    ),
    "noise twice": (
        [loop("upper.x", damper=1.0, actuator_noise=1e-9)],
        {},
        "control.loop.x.actuator_noise: conflicts with the OSEMs of upper",
    ),
    "one name": ([loop("upper.x", damper=1.0, name="F0")], {}, "control.osem.F0.name"),
    "no direction": ([loop("upper.x", damper=1.0)], {"direction": (0.0, 0.0, 0.0)}, "direction"),
    "no stage": ([loop("upper.x", damper=1.0)], {"stage": "uper"}, "did you mean"),
    "range alone": ([loop("upper.x", damper=1.0)], {"range": 10.0}, "no effect without coil"),
}


@pytest.mark.parametrize("how", REFUSED)
def test_refusals(how, tmp_path):
    loops, changes, words = REFUSED[how]
    given = corners()
    given[0] |= changes
    raw = plants.raw("triple") | {"control": {"loop": loops, "osem": given}}
    file = written(tmp_path, raw, "triple.toml")
    out = tmp_path / "out"
    result = run("budget", file, "--fidelity", "string", "--frequency", "1", "--out", out)
    assert words in "".join(assert_refused(result, file, out))


def test_commands(tmp_path):
    given = corners(sensor_noise="bosem", coil=1.5, range=1e-6)
    loops = [loop("upper.x", damper=20.0), loop("upper.yaw", damper=0.5)]
    raw = plants.raw("triple", loss=True) | {"control": {"loop": loops, "osem": given}}
    file = written(tmp_path, raw, "triple.toml")
    light = ("--fidelity", "beam", "--frequency", "0.1:10:40", "--out", tmp_path)
    result = run("budget", file, *light, "--json", "--mirrors", "4")
    answer = strict_json(result.stdout)
    assert [one["coil"] for one in answer["drive_rms"]] == ["F0", "F1", "F2", "F3"]
    assert {"sensor.F0", "sensor.F3"} < {*answer["contributions"]}
    (drive, *_), [saved] = answer["drive_rms"], sus.load(tmp_path / "triple-budget.h5").motions[:1]
    assert drive["force"] == saved.drive[0].force and drive["voltage"] is None
    assert "warning: coil F0: 4 times the RMS of its drive (an assumed crest factor) is" in (
        result.stderr
    )
    assert "RMS" in run("budget", file, *light).stdout.partition("Drives of coils by the loops")[2]
    result = run("damp", file, *light, "--json", "--duration", "1")
    [found] = strict_json(result.stdout)["osems"]
    assert found["coordinate"] == ["x", "pitch", "yaw"]
    damped = sus.load(tmp_path / "triple-damp.h5")
    assert damped.osems[0].to_coil.tolist() == found["to_coil"]
    assert damped.sensor == ("x", "yaw", "F0", "F1", "F2", "F3")
    text = run("damp", file, *light, "--duration", "1").stdout
    assert "upper: coordinates (m, rad) from readings (m)" in text
