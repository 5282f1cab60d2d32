"""Closed loops: against hand formulas, and state space against direct solutions of the same
matrices."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.conventions import DOFS
from suspension_cli.design.derive import com_positions
from suspension_cli.design.loop_filters import expand_roots
from suspension_cli.errors import InputError
from suspension_cli.linear import statespace
from suspension_cli.models import registry
from suspension_cli.physics import closed_loop, local_control
from suspension_cli.physics.closed_loop import build_closed_loop
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
    return local_control.build_plant(design, registry.by_name(level).system(design))


def six_dampers():
    return [
        loop(f"upper.{dof}", damper=value, sensor_noise=1e-10) for dof, value in DAMPERS.items()
    ]


def simple(c, reference="support", mass=3.0, length=0.7):
    """A mass on one wire through its COM, with a damper along x."""
    stage = scenes.hung({"count": 1, "l": length, "k": 1e5}, mass, 0.1)
    return plant(scenes.raw_of(stage), [loop("test.x", damper=c, reference=reference)])


LOOPS = {
    "dampers": (plants.raw("triple"), "force", six_dampers()),
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


@pytest.mark.parametrize("name", LOOPS)
def test_state_space_is_the_direct_solution(name):
    closed = built(name)
    inputs, outputs = ends(closed.model)
    direct, system = (
        local_control.solve_responses(closed, GRID, inputs, outputs),
        build_closed_loop(closed, inputs, outputs).at(GRID),
    )
    size = np.abs(direct)
    assert (np.abs(system - direct) <= 1e-9 * size + 1e-15 * size.max((0, 1))).all()
    assert size[:, 0, 0].all()


@pytest.mark.parametrize(
    "name", [name for name in LOOPS if name not in ("massless frame", "damped frame")]
)
def test_poles_are_eigenvalues_of_the_state_space(name):
    closed = built(name)
    system = build_closed_loop(closed, [], plants.all_motions(closed.model))
    found = closed_loop.find_poles(closed)
    assert found.stable or name != "across blocks"  # no growth by rounding
    order = sum(len(expand_roots(one.poles)) for one in closed.loops)
    assert len(system.a) == 2 * (closed.model.size - 6 - closed.model.massless.sum()) + order
    eigenvalues = np.linalg.eigvals(system.a)
    for pole in found.value:
        assert np.abs(eigenvalues - pole).min() < 1e-7 * abs(pole)


def test_impulse_response_is_the_inverse_transform():
    closed = plant(plants.raw("triple"), six_dampers())
    inputs, outputs = (
        plants.drives(closed.model, "upper.force_x"),
        plants.motions(closed.model, "test.x", "test.pitch"),
    )
    duration, highest = 400.0, 25.0
    count = int(2 * duration * highest)
    frequency = np.arange(count // 2 + 1) / duration
    value = local_control.solve_responses(closed, frequency, inputs, outputs)[:, :, 0]
    expected = np.fft.irfft(value, axis=0) * count / duration
    found = statespace.impulse(
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
