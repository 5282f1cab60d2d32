"""Which rung thermal noise needs, and what leaving the mass of wires out costs."""

from __future__ import annotations

import math
import tomllib

import numpy as np
import pytest

from suspension_cli.errors import InputError
from suspension_cli.models import auto, wire_mass
from tests.support import scenes
from tests.support.lossy import CONFIGS, LEVELS, model_of, noise, raw
from tests.support.pendulums import Pendulum


@pytest.mark.parametrize("name", ["husman2000/figure6", "quadruple", "geo-silica-triple"])
def test_where_the_mass_of_wires_counts(name):
    """Up to the limit it changes the sum by less than 1e-3, but on the flanks of resonances, which
    it moves."""
    given = tomllib.loads((CONFIGS / f"{name}.toml").read_text())
    design = scenes.design_of(given)
    first, _ = wire_mass.first_violin(design)
    frequency = np.geomspace(0.05, wire_mass.BELOW * first, 400)
    beam, violin = (
        noise(model_of(given, level), "test.x", frequency).amplitude for level in LEVELS
    )
    apart = np.abs(beam / violin - 1)
    assert apart[-1] < 1e-3
    assert np.quantile(apart, 0.9) < 1e-3
    assert auto.for_thermal_noise(design, "auto", float(frequency[-1])).level == "beam"
    assert auto.for_thermal_noise(design, "auto", float(frequency[-1]) * 1.001).level == "violin"


def test_what_leaving_mass_out_costs():
    """0.82 (f/f1)^2 of the sum, for a mass that keeps its wire's end upright."""
    one = Pendulum(inertia=1e6, radius=2e-5)
    first, wire = wire_mass.first_violin(scenes.design_of(one.raw()))
    assert wire == "test.1"
    area = math.pi * one.radius**2
    assert first == pytest.approx(
        math.sqrt(one.tension / (one.density * area)) / (2 * one.length), rel=1e-12
    )
    at = [wire_mass.BELOW * first]
    beam, violin = (
        noise(model_of(one.raw(), level), "test.x", at).amplitude[0] for level in LEVELS
    )
    assert beam / violin - 1 == pytest.approx(wire_mass.ERROR * wire_mass.BELOW**2, rel=0.05)


@pytest.mark.parametrize(("wanted", "level"), [("beam", "beam"), ("violin", "violin")])
def test_a_rung_can_be_asked_for(wanted, level):
    assert auto.for_thermal_noise(scenes.design_of(raw("single")), wanted, 1e4).level == level


@pytest.mark.parametrize("wanted", ["closed-form", "force", "string"])
def test_rungs_that_do_not_know(wanted):
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
