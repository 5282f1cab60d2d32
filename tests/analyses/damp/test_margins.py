"""Margins of local control at resonances as narrow as losses make them: closed forms, and the gain
at which a pole of the closed loop starts to grow."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import msgspec
import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.damp import closed_loop_poles, control, margins
from suspension_cli.analyses.damp import solve as damp
from suspension_cli.design.reader import read
from suspension_cli.linear.statespace import with_constant_loss
from suspension_cli.models import registry
from tests.support import plants, scenes
from tests.support.paths import CONFIGS

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


@pytest.mark.parametrize("loss", [1e-3, 1e-7, 1e-10])
def test_a_lagging_spring_on_one_oscillator(loss):
    """k (1 + i phi) - m w^2 + kappa g / (1 + i w tau) = 0: with c = kappa g / (1 + w^2 tau^2), k
    phi = c w tau and m w^2 = k + c."""
    m, k, g, tau = 3.0, 2e4, 5.0, 0.02

    def gain(frequency):
        w = 2 * np.pi * frequency
        return (g / (1 + 1j * w * tau) / (k * (1 + 1j * loss) - m * w**2))[:, None]

    omega = np.sqrt(k / m)
    for _ in range(50):
        omega = np.sqrt((k + k * loss / (omega * tau)) / m)
    kappa = k * loss / (omega * tau) * (1 + (omega * tau) ** 2) / g
    found = margins.compute_margins(gain, np.array([np.sqrt(k / m), 1 / tau]) / (2 * np.pi))[0]
    assert (found.gain_up if kappa > 1 else found.gain_down) == pytest.approx(kappa, rel=1e-9)


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
    return all_margins(control.build_plant(design, model))


def all_margins(plant):
    constant = replace(plant, model=with_constant_loss(plant.model))
    closed = closed_loop_poles.find(plant)
    corners = damp.find_corner_frequencies(constant, closed)
    return margins.compute_margins(
        partial(control.compute_loop_gains, plant), corners, damp._static_gains(plant, corners[0])
    )


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
    plant = control.build_plant(design, model)
    return plant, all_margins(plant)


def scaled(plant, n, factor):
    """The plant with the gain of one loop multiplied."""
    key = "gain" if plant.loops[n].damper is None else "damper"
    loops = list(plant.loops)
    loops[n] = msgspec.structs.replace(loops[n], **{key: getattr(loops[n], key) * factor})
    return replace(plant, loops=tuple(loops))


def growing(plant, n=0, factor=1.0):
    """How many poles grow with the gain of one loop multiplied."""
    return int((closed_loop_poles.find(scaled(plant, n, factor)).growth_rate > 0).sum())


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


def test_phase_margin_is_that_of_a_delay():
    """L exp(-i phase) goes through -1, so the loop with that lag put into it has a pole on the axis
    at the frequency given."""
    plant, margins_of = both("beam", ())
    for n, found in enumerate(margins_of):
        gain = control.compute_loop_gains(plant, np.array([found.phase_frequency]))[0, n]
        assert abs(gain) == pytest.approx(1.0, rel=1e-6)
        assert abs(np.degrees(np.angle(-gain))) == pytest.approx(found.phase, rel=1e-6)


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
