"""Closed loops: against hand formulas, and state space against direct solutions of the same
matrices."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.analyses.damp import closed_loop_poles, control
from suspension_cli.analyses.damp.closed_loop_poles import build_closed_loop
from suspension_cli.conventions import DOFS
from suspension_cli.design.derive import com_positions
from suspension_cli.design.schema import expand_roots
from suspension_cli.errors import InputError
from suspension_cli.linear import eigenmodes, poles
from suspension_cli.models import registry
from suspension_cli.rotations import cross_matrix
from tests.support import plants, scenes

GRID = np.geomspace(0.05, 50, 41)
LEAD = {"gain": 3e4, "zeros": [0.0, 0.8], "poles": [30.0, [12.0, 9.0]]}
"""A filter as a damping loop has: a zero at 0, some lead, three poles above."""
DAMPERS = {"x": 25.0, "y": 20.0, "z": 60.0, "roll": 0.3, "pitch": 0.2, "yaw": 0.25}
FRAME = {"stiffness": {"x": 2e5, "y": 3e5, "pitch": 1e5}, "mass": 60.0, "inertia": [2.0, 2.0, 2.0]}


def force_of(dof):
    return f"{'force' if dof in 'xyz' else 'torque'}_{dof}"


def loop(sensor, actuator=None, *, name=None, **how):
    """A loop table; the actuator is the force along the sensor by default."""
    body, _, dof = sensor.partition("@")[0].rpartition(".")
    return {
        "name": name or dof,
        "sensor": sensor,
        "actuator": actuator or f"{body}.{force_of(dof)}",
        **how,
    }


def plant(raw, loops, level="force"):
    design = scenes.design_of(raw | {"control": {"loop": loops}})
    return control.build_plant(design, registry.by_name(level).system(design))


def six_dampers():
    return [
        loop(f"upper.{dof}", damper=value, sensor_noise=1e-10) for dof, value in DAMPERS.items()
    ]


def simple(c, reference="support", mass=3.0, length=0.7):
    """A mass on one wire through its COM, with a damper along x."""
    stage = scenes.hung({"count": 1, "l": length, "k": 1e5}, mass, 0.1)
    return plant(scenes.raw_of(stage), [loop("test.x", damper=c, reference=reference)])


@pytest.mark.parametrize("reference", ["support", "inertial"])
def test_what_the_sensor_refers_to(reference):
    """Against the support the damper drags the body along with it; against the stars it does
    not."""
    mass, length, c = 3.0, 0.7, 2.0
    closed = simple(c, reference)
    s = 2j * np.pi * GRID
    inputs, outputs = (
        plants.drives(closed.model, "support.x"),
        plants.motions(closed.model, "test.x"),
    )
    expected = (9.81 / length + (s * c / mass if reference == "support" else 0)) / (
        9.81 / length + s**2 + s * c / mass
    )
    np.testing.assert_allclose(
        control.solve_responses(closed, GRID, inputs, outputs).value[:, 0, 0], expected, rtol=1e-11
    )
    np.testing.assert_allclose(
        build_closed_loop(closed, inputs, outputs).at(GRID)[:, 0, 0],
        expected,
        rtol=1e-9,
    )


LOOPS = {
    "dampers": (plants.raw("triple"), "force", six_dampers()),
    "strings": (plants.raw("triple", tips=True), "string", six_dampers()),
    "losses": (plants.raw("triple", loss=True), "force", six_dampers()),
    "filters": (
        plants.raw("triple"),
        "force",
        [
            loop("upper.x", **LEAD),
            loop("upper.y", **LEAD),
            loop("upper.pitch", gain=5.0, zeros=[0.0], poles=[20.0]),
        ],
    ),
    "inertial": (
        plants.raw("quadruple"),
        "force",
        [
            loop("top.x", **LEAD, reference="inertial"),
            loop("top.z", damper=100.0, reference="inertial"),
        ],
    ),
    "not collocated": (
        plants.raw("triple"),
        "force",
        [
            loop("test.x", "upper.force_x", damper=3.0),
            loop("upper.pitch", "test.torque_pitch", **LEAD | {"gain": 3.0}),
        ],
    ),
    "across blocks": (
        plants.raw("triple"),
        "force",
        [loop("upper.x", "upper.force_y", **LEAD), loop("upper.y", damper=9.0)],
    ),
    "points": (
        plants.raw("five"),
        "string",
        [loop("test.x@0,0.1,0.02", "test.force_x@0,-0.1,0", damper=4.0), loop("test.z", **LEAD)],
    ),
    "frame": (
        plants.raw("triple") | {"support": FRAME},
        "force",
        [*six_dampers(), loop("upper.x", name="more", **LEAD)],
    ),
    "massless frame": (
        plants.raw("triple") | {"support": {"stiffness": FRAME["stiffness"]}},
        "force",
        [*six_dampers(), loop("upper.x", name="more", **LEAD)],
    ),
    "damped frame": (
        plants.raw("triple") | {"support": {"stiffness": {"x": 1e5}, "damping": {"x": 3e3}}},
        "string",
        [loop("upper.x", **LEAD)],
    ),
}


def built(name):
    raw, level, loops = LOOPS[name]
    return plant(raw, loops, level)


def ends(model):
    first, last = model.body[0], model.body[-1]
    inputs = plants.drives(model, "support.x", "support.y", "support.pitch", f"{first}.force_x")
    return inputs, plants.motions(model, f"{last}.x", f"{last}.y", f"{first}.pitch")


@pytest.mark.parametrize("name", [name for name in LOOPS if name != "losses"])
def test_state_space_is_the_direct_solution(name):
    closed = built(name)
    inputs, outputs = ends(closed.model)
    direct, system = (
        control.solve_responses(closed, GRID, inputs, outputs).value,
        build_closed_loop(closed, inputs, outputs).at(GRID),
    )
    size = np.abs(direct)
    assert (np.abs(system - direct) <= 1e-9 * size + 1e-15 * size.max((0, 1))).all()
    assert size[:, 0, 0].all()


def characteristic(closed, s):
    """d/ds log det(K + s C + s^2 M + sum of H p s^T) times the denominators of H: its reciprocal is
    a Newton step towards a pole."""
    model, free = closed.model, slice(6, None)
    dynamic, slope = (
        model.stiffness + s * model.damping + s**2 * model.mass,
        model.damping + 2 * s * model.mass,
    )
    sharpness = 0.0
    for one, pushed, sensed in zip(closed.loops, closed.pushed, closed.sensed, strict=True):
        if one.damper is not None:
            h, change = one.damper * s, one.damper
        else:
            f = s / (2j * np.pi)
            h = control.evaluate_filter(one, f)
            zeros, poles = (np.array(expand_roots(given)) for given in (one.zeros, one.poles))
            relative = (1 / (s / (2 * np.pi) + zeros)).sum() - (1 / (s / (2 * np.pi) + poles)).sum()
            change = h * relative / (2 * np.pi)
            sharpness += (1 / (s + 2 * np.pi * poles)).sum()
        dynamic = dynamic + h * np.outer(pushed, sensed)
        slope = slope + change * np.outer(pushed, sensed)
    return sharpness + np.trace(np.linalg.solve(dynamic[free, free], slope[free, free]))


@pytest.mark.parametrize(
    "name", [name for name in LOOPS if name not in ("losses", "massless frame", "damped frame")]
)
def test_poles_are_zeros_of_the_determinant(name):
    closed = built(name)
    system = build_closed_loop(closed, [], plants.all_motions(closed.model))
    found = closed_loop_poles.find(closed)
    assert found.stable or name != "across blocks"  # no growth by rounding
    order = sum(len(expand_roots(one.poles)) for one in closed.loops)
    assert len(system.a) == 2 * (closed.model.size - 6 - closed.model.massless.sum()) + order
    for pole in found.value:
        beside = pole * (1 + 1e-10)  # at the pole itself it may be infinite
        assert abs(1 / characteristic(closed, beside)) < 1e-8 * abs(pole)


def gains_at(closed, s):
    """H and G (actuators to sensors) at one complex frequency, from the matrices."""
    model, free = closed.model, slice(6, None)
    dynamic = model.stiffness + s * model.damping + s**2 * model.mass
    g = closed.sensed[:, free] @ np.linalg.solve(dynamic[free, free], closed.pushed[:, free].T)
    return np.diag([control.evaluate_filter(one, s / (2j * np.pi)) for one in closed.loops]), g


@pytest.mark.parametrize("name", LOOPS)
def test_loop_gain_with_the_others_closed(name):
    """1 + L_k = det(1 + H G) / det(the same without loop k)."""
    closed = built(name)
    gains = control.compute_loop_gains(closed, GRID)
    count = len(closed.loops)
    for n, frequency in enumerate(GRID):
        if closed.model.is_lossy:
            break
        h, g = gains_at(closed, 2j * np.pi * frequency)
        whole = np.linalg.det(np.eye(count) + h @ g)
        for k in range(count):
            others = [m for m in range(count) if m != k]
            rest = (
                np.linalg.det(np.eye(count - 1) + (h @ g)[np.ix_(others, others)])
                if others
                else 1.0
            )
            assert 1 + gains[n, k] == pytest.approx(whole / rest, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("name", ["dampers", "filters", "frame"])
def test_sensor_noise(name):
    """Noise n of one sensor moves the mirror by -G_ou (1 + H G)^-1 H n."""
    raw, level, loops = LOOPS[name]
    loops = [one | {"sensor_noise": 1e-10 * (n + 1)} for n, one in enumerate(loops)]
    closed = plant(raw, loops, level)
    outputs = plants.motions(closed.model, "test.x", "test.y")
    answer = control.solve_responses(
        closed, GRID[::8], plants.drives(closed.model, "support.x"), outputs
    )
    model, free = closed.model, slice(6, None)
    for n, frequency in enumerate(GRID[::8]):
        s = 2j * np.pi * frequency
        h, g = gains_at(closed, s)
        dynamic = (model.stiffness + s * model.damping + s**2 * model.mass)[free, free]
        watched = np.linalg.solve(dynamic, closed.pushed[:, free].T)[
            [model.index("test", dof) - 6 for dof in "xy"]
        ]
        expected = np.abs(watched @ np.linalg.solve(np.eye(len(h)) + h @ g, h)) * [
            one["sensor_noise"] for one in loops
        ]
        np.testing.assert_allclose(answer.noise[n], expected, rtol=1e-9, atol=1e-30)


@pytest.mark.parametrize("support", [None, FRAME])
def test_what_moves_as_one_is_not_sensed(support):
    """The structure reaches to the sensor as one rigid thing, and what moves it is the ground and
    its own deflection."""
    raw = plants.raw("triple") | ({"support": support} if support else {})
    sensors = [f"middle.{dof}" for dof in DOFS] + ["test.x@0.1,0.2,-0.3", "upper.z@0.05,0.1,0"]
    closed = plant(
        raw, [loop(sensor, name=f"a{n}", damper=1.0) for n, sensor in enumerate(sensors)]
    )
    design = scenes.design_of(raw)
    positions = com_positions(design)
    rigid = np.zeros((closed.model.size, 6))
    for n, body in enumerate(("support", *closed.model.body)):
        rigid[6 * n : 6 * n + 6] = np.eye(6)
        rigid[6 * n : 6 * n + 3, 3:] = -cross_matrix(np.array(positions[body]))
    assert np.abs(closed.sensed @ rigid).max() < 1e-15
    assert np.array_equal(closed.sensed[:6], closed.pushed[:6])
    if support:
        deflected = rigid.copy()  # the ground at rest, the structure moves by its deflection
        deflected[:6] = 0.0
        for n, dof in enumerate(DOFS):
            if f"frame.{dof}" in closed.model.coordinate:
                deflected[closed.model.coordinate.index(f"frame.{dof}"), n] = 1.0
                assert np.abs(closed.sensed @ deflected[:, n]).max() < 1e-15


def test_impulse_response_is_the_inverse_transform():
    closed = plant(plants.raw("triple"), six_dampers())
    inputs, outputs = (
        plants.drives(closed.model, "upper.force_x"),
        plants.motions(closed.model, "test.x", "test.pitch"),
    )
    duration, highest = 400.0, 25.0
    count = int(2 * duration * highest)
    frequency = np.arange(count // 2 + 1) / duration
    value = control.solve_responses(closed, frequency, inputs, outputs).value[:, :, 0]
    expected = np.fft.irfft(value, axis=0) * count / duration
    found = poles.impulse(
        build_closed_loop(closed, inputs, outputs),
        np.arange(1500) / (2 * highest),
    )[:, :, 0]
    assert (np.abs(found - expected[:1500]).max(0) < 1e-4 * np.abs(found).max(0)).all()
    assert np.abs(expected[-10:]).max() < 1e-4 * np.abs(found).max()  # it has died away


def test_a_damper_that_senses_no_massless_structure_that_it_pushes():
    raw = plants.raw("triple") | {"support": {"stiffness": {"y": 1e5}}}
    closed = plant(raw, [loop("upper.x", "upper.force_y", damper=20.0)])
    with pytest.raises(InputError, match="give \\[support\\] a mass"):
        build_closed_loop(
            closed,
            plants.drives(closed.model, "support.x"),
            plants.motions(closed.model, "test.x", "test.y"),
        )


def test_responses_at_a_resonance_of_the_plant_without_loss():
    """The plant has no finite response there; the closed loop has that of the points around it."""
    closed = built("filters")
    resonance = eigenmodes.solve(closed.model).frequency
    at = (resonance[:, None] * (1 + np.array([-1e-6, -1e-14, 0.0, 1e-14, 1e-6]))).ravel()
    value = control.solve_responses(closed, at, *ends(closed.model)).value
    value = value.reshape(-1, 5, *value.shape[1:])
    below, above, between = value[:, :1], value[:, -1:], value[:, 1:-1]
    smooth = np.abs(above - below) < 1e-4 * np.abs(above)  # not of modes that no loop damps
    assert smooth.any((1, 2, 3)).sum() > 6
    error = np.abs(between - (below + above) / 2)
    where = np.broadcast_to(smooth, error.shape)
    assert (error <= 1e-7 * np.abs(above))[where].all()
