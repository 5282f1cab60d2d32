"""Filters of control loops and stability margins: textbook loops, closed forms, resonances as
narrow as losses make them, and the gain at which a pole of the closed loop starts to grow."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import msgspec
import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.design.control import Control
from suspension_cli.design.reader import read
from suspension_cli.models import registry
from suspension_cli.physics import (
    closed_loop,
    closed_loop_margins,
    local_control,
    loop_network,
    loop_realisation,
    margins,
)
from tests.support import plants, scenes
from tests.support.paths import CONFIGS

GRID = np.geomspace(0.05, 50, 41)


def margins_of(numerator, denominator):
    def gain(frequency):
        s = 2j * np.pi * frequency
        return (np.polyval(numerator, s) / np.polyval(denominator, s))[:, None]

    roots = np.abs(np.concatenate([np.roots(numerator), np.roots(denominator)])) / (2 * np.pi)
    return margins.compute_margins(gain, np.append(roots, 1.0))[0]


def test_margins_of_a_textbook_loop():
    """k / (s (s + 1) (s + 2)) at k = 1: gain margin 6 at sqrt 2 rad/s, phase margin 53.4 degrees at
    0.446 rad/s."""
    found = margins_of([1.0], [1, 3, 2, 0])
    (crossing,) = (np.sqrt(root.real) for root in np.roots([1, 5, 4, -1]) if root.real > 0)
    assert found.gain_up == pytest.approx(6.0, rel=1e-12)
    assert found.gain_down == 0.0
    assert found.phase == pytest.approx(
        90 - np.degrees(np.arctan(crossing) + np.arctan(crossing / 2)), rel=1e-12
    )
    assert found.phase == pytest.approx(53.4, abs=0.05)
    assert found.phase_frequency == pytest.approx(crossing / (2 * np.pi), rel=1e-12)


def test_margins_of_a_conditionally_stable_loop():
    """2 (s + 1)^2 / s^3 crosses -180 degrees at 1 rad/s with a gain of 4: it may fall fourfold, and
    grow without limit."""
    found = margins_of([2, 4, 2], [1, 0, 0, 0])
    assert found.gain_up == np.inf
    assert found.gain_down == pytest.approx(0.25, rel=1e-12)


def test_margins_without_crossings():
    found = margins_of([0.3], [1, 1])
    assert (found.phase, found.gain_up, found.gain_down) == (np.inf, np.inf, 0.0)
    assert np.isnan(found.phase_frequency)
    assert found.distance == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize(
    "how",
    [
        {"gain": 5.0},
        {"gain": -2.0, "poles": [3.0]},
        {"gain": 3e4, "zeros": [0.0, 0.8], "poles": [30.0, [12.0, 9.0]]},
        {"gain": 1e3, "zeros": [[0.3, 4.0]], "poles": [[0.1, 7.0], 0.0]},
        {
            "gain": 1e3,
            "zeros": [0.01, [0.1, 3.0], [0.2, 7.0]],
            "poles": [0.001, [1.0, 2.0], [10.0, 30.0], 100.0],
        },
    ],
)
def test_filters(how):
    """H(f) = gain times the product of (i f + z) over that of (i f + p), a pair standing for both
    conjugates; and its state space."""
    table = {"name": "a", "sensor": "upper.x", "actuator": "upper.force_x", **how}
    one = scenes.design_of(plants.raw("triple") | {"control": {"loop": [table]}}).control.loop[0]
    expected = np.full(GRID.shape, how["gain"], dtype=complex)
    for key, power in (("zeros", 1), ("poles", -1)):
        for root in how.get(key, []):
            for value in (
                [complex(*root), complex(*root).conjugate()] if isinstance(root, list) else [root]
            ):
                expected *= (1j * GRID + value) ** power
    np.testing.assert_allclose(loop_network.make_node(one).at(GRID), expected, rtol=1e-14)
    made = loop_realisation.realise(loop_network.make_node(one))
    a, b, c, d = made.A, made.B, made.C, made.D
    assert all(np.isrealobj(matrix) for matrix in (a, b, c, d))
    s = 2j * np.pi * GRID
    found = [(c @ np.linalg.solve(x * np.eye(len(a)) - a, b) + d)[0, 0] for x in s]
    np.testing.assert_allclose(found, expected, rtol=1e-10)


DAMPED = CONFIGS / "triple-damped.toml"
STEEL = "materials.steel302.loss_angle"


@pytest.mark.parametrize("q", [1e3, 1e7, 1e9, 1e11])
@pytest.mark.parametrize("angle", [0.3, 2.0, 2.9, -2.5])
def test_one_resonance_is_a_circle(q, angle):
    """L = R / (i delta + gamma) is a circle through 0 whose diameter R / gamma points along R."""
    centre, diameter = 36.0, 3.0
    gamma = centre / (2 * q)
    residue = diameter * gamma * np.exp(1j * angle)

    def gain(frequency):
        return (residue / (1j * (frequency - centre) + gamma))[:, None]

    found = margins.compute_margins(gain, np.array([centre - gamma, centre, centre + gamma]))[0]
    middle = diameter / 2 * np.exp(1j * angle)
    tolerance = 1e-9 + (1e-15 * q) ** 2
    assert found.distance == pytest.approx(
        abs(abs(1 + middle) - diameter / 2), rel=1e-9, abs=tolerance
    )
    turned = np.arccos(1 / diameter)  # where |L| = 1, the angle from R
    phases = [abs(np.degrees(np.angle(-np.exp(1j * (angle + side * turned))))) for side in (-1, 1)]
    assert found.phase == pytest.approx(min(phases), rel=1e-9 + 1e-15 * q)
    crossing = -diameter * np.cos(angle)  # of the real axis
    gains = (
        (np.inf, 1 / crossing)
        if crossing > 1
        else (1 / crossing, 0.0)
        if crossing > 0
        else (np.inf, 0.0)
    )
    assert (found.gain_up, found.gain_down) == pytest.approx(gains, rel=tolerance)


def test_what_drifts_off_without_oscillating():
    """A negative spring of half the restoring one: twice its gain, and the body falls over."""
    stage = scenes.hung({"count": 1, "l": 0.7, "k": 1e5}, 3.0, 0.1)
    spring = 3.0 * 9.81 / 0.7
    loop = {
        "name": "a",
        "sensor": "test.x",
        "actuator": "test.force_x",
        "gain": -spring / 2 * 10.0,
        "poles": [10.0],
    }
    damper = {"name": "b", "sensor": "test.x", "actuator": "test.force_x", "damper": 20.0}
    made = of(
        plants.scenes.design_of(
            {"design": {"name": "one"}, "stage": [stage], "control": {"loop": [loop, damper]}}
        ),
        "force",
    )
    assert made[0].gain_up == pytest.approx(2.0, rel=1e-9)


@pytest.mark.parametrize("c", [1e-6, 0.2, 1e3])
def test_a_body_that_nothing_holds(c):
    """c / (J s) is 1 at c / J, 90 degrees from -1, and never comes nearer to that than far
    above."""
    stage = scenes.hung({"count": 1, "l": 0.5, "k": 1e4, "d": 0.01}, 3.0, 0.1)
    loop = {"name": "yaw", "sensor": "test.yaw", "actuator": "test.torque_yaw", "damper": c}
    [found] = of(
        plants.scenes.design_of(
            {"design": {"name": "one"}, "stage": [stage], "control": {"loop": [loop]}}
        ),
        "string",
    )
    assert found.phase == pytest.approx(90.0, rel=1e-9)
    assert found.phase_frequency == pytest.approx(c / 0.1 / (2 * np.pi), rel=1e-9)
    assert (found.gain_up, found.gain_down) == (np.inf, 0.0)
    assert found.distance == pytest.approx(1.0, abs=1e-5)


def of(design, level):
    """Margins of a design's loops on a model."""
    model = registry.by_name(level).system(design)
    return all_margins(local_control.build_plant(design, model))


def all_margins(plant):
    return closed_loop_margins.find_margins(plant, closed_loop.find_poles(plant))[0]


@cache
def both(level, overrides, loops=range(6)):
    """The plant of the damped design with some of its loops, and the margins."""
    design = read(DAMPED, overrides).design
    design = msgspec.structs.replace(
        design,
        control=msgspec.structs.replace(
            design.control, loop=[design.control.loop[n] for n in loops]
        ),
    )
    model = registry.by_name(level).system(design)
    plant = local_control.build_plant(design, model)
    return plant, all_margins(plant)


def scaled(plant, n, factor):
    """The plant with the gain of one loop multiplied."""
    key = "gain" if plant.loops[n].damper is None else "damper"
    loops = list(plant.loops)
    loops[n] = msgspec.structs.replace(loops[n], **{key: getattr(loops[n], key) * factor})
    network, _ = loop_network.build(Control(loop=loops), 9.81)
    return replace(plant, loops=tuple(loops), network=network)


def growing(plant, n=0, factor=1.0):
    """How many poles grow with the gain of one loop multiplied."""
    return int((closed_loop.find_poles(scaled(plant, n, factor)).growth_rate > 0).sum())


def loops_with_limits(plant, found, loops, near):
    """Just inside each gain margin as many poles grow as now, just beyond it others; returns the
    loops that have a gain margin."""
    now = growing(plant)
    checked = set()
    for n in loops:
        for limit, inward in ((found[n].gain_up, -1), (found[n].gain_down, 1)):
            if np.isfinite(limit) and limit > 0:
                assert growing(plant, n, limit * (1 + inward * near)) == now
                assert growing(plant, n, limit * (1 - inward * near)) != now
                checked.add(n)
    return checked


def test_every_loop_of_the_damped_design():
    assert loops_with_limits(*both("beam", ()), range(6), 1e-8) == set(range(6))


def test_an_unstable_loop_is_reported_first(tmp_path):
    """No margins, no Q of what grows; the pole, where it lives and its growth rate in the first
    line."""
    with pytest.warns(sus.PendsusWarning, match="closed loop is unstable"):
        found = sus.damp(sus.read(DAMPED, f"{STEEL}=1e-8"), frequency=[1.0, 2.0], fidelity="string")
    printed, answer = str(found), found.document()
    first = printed.splitlines()[0]
    assert (
        first.startswith("UNSTABLE") and "36.17" in first and "middle.z" in first and "1/s" in first
    )
    assert "phase margin" not in printed and "degrees" not in printed
    assert answer["stable"] is False and answer["margins"] is None
    [pole] = [pole for pole in answer["poles"] if "growth_rate_per_s" in pole]
    assert pole["q"] is None and pole["growth_rate_per_s"] == pole["real_per_s"] > 0
    assert pole["state"] == "middle.z"
    assert f"{pole['growth_rate_per_s']:.4g}" in first
    found.save(tmp_path / "damp.h5")
    assert sus.load(tmp_path / "damp.h5").figures()
