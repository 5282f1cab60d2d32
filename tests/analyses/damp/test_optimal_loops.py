"""Filters that are found: judged by the full model, and against a published requirement."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.design.foton import format_filter
from suspension_cli.errors import InputError
from suspension_cli.physics import (
    closed_loop,
    closed_loop_margins,
    local_control,
    optimal_loops,
    riccati_equations,
)
from suspension_cli.physics.optimal_loops import Wanted
from suspension_cli.physics.riccati_equations import CLOSER
from tests.analyses.damp.test_published_loops import NOISE, damped_quadruple
from tests.support import plants, scenes

SECTIONS = 10
"""Second-order sections that a filter of a front end has at most."""


def length_loop(**how):
    loop = {"name": "length", "sensor": "shadow", "actuator": "top.force_x"} | how
    loop["reference"] = "inertial"
    sensor = {"name": "shadow", "motion": "top.x", "sensor_noise": NOISE}
    return scenes.design_of(
        plants.raw("triple") | {"control": {"sensor": [sensor], "loop": [loop]}}
    )


def test_a_quieter_loop_than_the_published_requirement():
    """The published loop makes 8.3e-18 m/sqrt(Hz) at 10 Hz; 1e-19 is required, with all modes
    settled within 15 s and a sensitivity below 1.5."""
    system = damped_quadruple().model
    wanted = Wanted(15.0, 1.5, "tst.x", quiet_at=10.0, highest=10.0)
    found = optimal_loops.solve(length_loop(damper=1.0), system, 0, wanted)
    assert len(found.filter.poles) <= 2 * SECTIONS
    assert found.left_out == ()
    design = length_loop(filter=format_filter(found.filter))
    closed = local_control.build_plant(design, system)
    poles = closed_loop.find_poles(closed)
    own = np.array([".x" in name or name.startswith("loop") for name in poles.state])
    settling = -1 / np.real(poles.value[own]).max()
    assert settling == pytest.approx(found.settling, rel=1e-6)
    assert settling < 15
    _, peak = closed_loop_margins.find_margins(closed, poles)
    assert peak.size == pytest.approx(found.sensitivity, rel=1e-3)
    assert peak.size < 1.5
    [output] = plants.motions(system, "tst.x")
    noise = local_control.solve_sensor_noise(closed, np.array([10.0]), output)[0, 0]
    assert noise == pytest.approx(found.noise * NOISE, rel=1e-6)
    assert noise < 1e-19


def test_what_no_filter_does_is_refused():
    system = damped_quadruple().model
    wanted = Wanted(0.05, 1.01, "tst.x", quiet_at=10.0, highest=10.0)
    with pytest.raises(InputError, match=r"no filter was found that settles within 0.05 s"):
        optimal_loops.solve(length_loop(damper=1.0), system, 0, wanted)


def test_a_loop_that_reaches_no_mode_is_refused():
    system = damped_quadruple().model
    wanted = Wanted(15.0, 1.5, "tst.x", quiet_at=10.0, highest=0.1)
    with pytest.raises(InputError, match=r"reaches no mode below 0.1 Hz"):
        optimal_loops.solve(length_loop(damper=1.0), system, 0, wanted)


def test_the_smallest_bound_is_that_of_another_solver(monkeypatch):
    """gamma of `control.hinfsyn` with the same forces, noise and weights, on scaled equations."""
    control = pytest.importorskip("control")
    pytest.importorskip("slycot")
    asked = []
    own = riccati_equations.find_smallest_bound

    def record(plant, x, y, weights):
        asked.append((plant, weights, own(plant, x, y, weights)))
        return asked[-1][-1]

    monkeypatch.setattr(riccati_equations, "find_smallest_bound", record)
    monkeypatch.setattr(optimal_loops, "ROLL_OFFS", [0.5])
    system = damped_quadruple().model
    wanted = Wanted(15.0, 1.5, "tst.x", quiet_at=10.0, highest=10.0)
    optimal_loops.solve(length_loop(damper=1.0), system, 0, wanted, "hinf")
    for plant, weights, bound in (asked[0], asked[-1]):
        count = len(plant.a)
        drive = np.hstack([np.eye(count), np.zeros((count, 1)), plant.b[:, None]])
        sense = np.vstack([np.eye(count), np.zeros((1, count)), plant.c[None]])
        through = np.zeros((count + 2, count + 2))
        through[count, count + 1], through[count + 1, count] = np.sqrt(weights)
        smallest = control.hinfsyn(control.ss(plant.a, drive, sense, through), 1, 1)[2]
        assert 0.99 * smallest < bound < 1.01 * CLOSER * smallest
