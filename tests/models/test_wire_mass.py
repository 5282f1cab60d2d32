"""The model that thermal noise needs, and the error of neglecting the mass of wires."""

from __future__ import annotations

import math
import tomllib

import numpy as np
import pytest

from suspension_cli.analyses.modes import wire_modes
from suspension_cli.errors import InputError
from suspension_cli.models import auto, registry, wire_mass
from suspension_cli.models.quantity_of_interest import Frequencies
from tests.support import scenes
from tests.support.lossy import CONFIGS, LEVELS, model_of, noise, raw
from tests.support.pendulums import Pendulum


@pytest.mark.parametrize("name", ["husman2000/figure6", "quadruple", "geo-silica-triple"])
def test_where_the_mass_of_wires_counts(name):
    """Below the estimate, but on the flanks of resonances, which it moves; `auto` decides by it."""
    given = tomllib.loads((CONFIGS / f"{name}.toml").read_text())
    design = scenes.design_of(given)
    first = wire_mass.effect_on_noise(design, 1.0).lowest
    frequency = np.geomspace(0.05, 0.03 * first, 400)
    beam, violin = (
        noise(model_of(given, level), "test.x", frequency).amplitude for level in LEVELS
    )
    apart = np.abs(beam / violin - 1)
    estimated = wire_mass.effect_on_noise(design, float(frequency[-1])).error
    assert apart[-1] < 1e-3
    assert np.quantile(apart, 0.9) < 1e-3
    assert apart[-1] < estimated
    for tolerance, level in ((1.001 * estimated, "beam"), (0.999 * estimated, "violin")):
        choice = auto.for_thermal_noise(design, "auto", float(frequency[-1]), tolerance)
        assert choice.level == level


def test_neglecting_mass_changes_noise_at_each_end():
    """0.82 (f/f1)^2 of the sum, for a mass that keeps its wire's end upright; at most 3.3."""
    one = Pendulum(inertia=1e6, radius=2e-5)
    effect = wire_mass.effect_on_noise(scenes.design_of(one.raw()), 1.0)
    first = effect.lowest
    assert effect.wire == "test.1"
    area = math.pi * one.radius**2
    assert first == pytest.approx(
        math.sqrt(one.tension / (one.density * area)) / (2 * one.length), rel=1e-12
    )
    beam, violin = (
        noise(model_of(one.raw(), level), "test.x", [0.03 * first]).amplitude[0] for level in LEVELS
    )
    assert beam / violin - 1 == pytest.approx(wire_mass.NOISE / 4 * 0.03**2, rel=0.05)


def light_body(fraction):
    """A body of 0.12 kg on four wires that weigh this fraction of it together."""
    density, length = 7800.0, 0.5
    radius = math.sqrt(fraction * 0.12 / (4 * math.pi * density * length))
    body = {"mass": 0.12, "shape": "box", "size": [0.03, 0.03, 0.03]}
    wires = {"count": 4, "l": length, "s": 0.01, "t1": 0.012, "t2": 0.012, "d": 0.002}
    wires |= {"material": "c70steel", "radius": radius}
    stage = {"name": "test", "body": body, "wires": wires}
    return {"design": {"name": "light"}, "stage": [stage]}


@pytest.mark.parametrize("fraction", [1e-4, 1e-2, 0.3])
def test_light_bodies_on_heavy_wires(fraction):
    """Their noise is on `violin` where a mode that wires load moves by more than the tolerance;
    frequencies move by less than the estimate."""
    design = scenes.design_of(light_body(fraction))
    effect = wire_mass.effect_on_noise(design, 0.5)
    beam = registry.BEAM.system(design)
    shifts = Frequencies().change(beam, registry.VIOLIN.system(design))[0]
    assert shifts <= 1.2 * effect.inertia / 2 or shifts < 1e-6
    assert effect.inertia >= fraction / 3
    for tolerance in (1e-4, 1e-2, 0.2):
        choice = auto.for_thermal_noise(design, "auto", 0.5, tolerance)
        assert (choice.level == "violin") == (effect.error > tolerance)
        assert choice.error <= tolerance


def test_noise_beside_a_mode_that_wires_load():
    """At a resonance of the complete model the beam model is off by far, whatever the first violin
    mode; `auto` takes `violin`."""
    given = light_body(0.3)
    system = registry.VIOLIN.system(scenes.design_of(given))
    mode = wire_modes.solve(system, 2 * math.pi * 30.0).frequency[:6]
    for frequency in mode[mode > 0][:3]:
        beam, violin = (
            noise(model_of(given, level), "test.x", [frequency]).amplitude[0] for level in LEVELS
        )
        if abs(beam / violin - 1) > 0.1:
            break
    else:
        pytest.fail("no mode matters")
    choice = auto.for_thermal_noise(scenes.design_of(given), "auto", float(frequency))
    assert choice.level == "violin"


@pytest.mark.parametrize(("wanted", "level"), [("beam", "beam"), ("violin", "violin")])
def test_a_model_can_be_requested(wanted, level):
    assert auto.for_thermal_noise(scenes.design_of(raw("single")), wanted, 1e4).level == level


@pytest.mark.parametrize("wanted", ["closed-form", "force", "string"])
def test_models_without_thermal_noise_are_refused(wanted):
    with pytest.raises(InputError, match="take auto, beam or violin"):
        auto.for_thermal_noise(scenes.design_of(raw("single")), wanted, 1.0)


def test_a_design_hung_on_springs_has_no_violin_modes():
    stage = {
        "name": "test",
        "body": {"mass": 1.0, "inertia": [0.01] * 3},
        "position": [0.0, 0.0, -0.1],
    }
    stage["spring"] = [
        {
            "stiffness": [100.0, 100.0, 100.0, 1.0, 1.0, 1.0],
            "loss_angle": 1e-3,
            "preload": [0.0, 0.0, 9.81, 0.0, 0.0, 0.0],
        }
    ]
    given = {"design": {"name": "sprung"}, "stage": [stage]}
    assert auto.for_thermal_noise(scenes.design_of(given), "auto", 1e3).level == "beam"
