"""What `check` prints of heavy wires and of measured profiles."""

from __future__ import annotations

import math

import pytest

import suspension_cli as sus
from suspension_cli.analyses.check import profiles
from tests.support.golden import CONFIGS

FILE = CONFIGS / "pulled-fibres.toml"


def test_weight_sag_and_profile():
    found = sus.check(sus.read(FILE))
    own, [profile] = found.weights, found.profiles
    assert own.included and 0.05 < own.total < 0.07
    load = found.statics.wires[0]
    weight = 9.81 * 7800 * math.pi * 350e-6**2 * 0.5
    assert own.ratio == pytest.approx(weight / load.tension, rel=0.05)
    assert own.sag == pytest.approx(weight * 0.04 / (8 * load.tension), rel=0.05)
    assert own.line in str(found) and profile.line in str(found)
    assert profile.stretching_change < profile.bending_change < profile.allowed == 3e-3
    document = found.document()
    assert document["wire_weight"]["total_n"] == own.total
    assert document["profiles"][0]["places"] == 281
    light = sus.check(sus.example("quadruple"))
    assert light.weights.line == "" and "wire_weight" not in light.document()


def test_heavy_wires_that_are_left_out_are_told():
    light = sus.template("single").replace({"stage.test.body.mass": 0.05})
    assert "constants.wire_weight = true includes" in str(sus.check(light))


def test_uniform_fibre_in_closed_form():
    """T u (1 - u/l)/(1 - 2u/l) and T/(l - 2u) with u = sqrt(E I / T), but for exp(-l/u)."""
    modulus, tension, d, length = 7.2e10, 100.0, 4e-4, 0.3
    k = profiles._converged([0.0, length], [d, d], modulus, tension)
    u = math.sqrt(modulus * math.pi / 64 * d**4 / tension)
    assert k[0, 0] == pytest.approx(tension * u * (1 - u / length) / (1 - 2 * u / length), rel=1e-7)
    assert k[2, 2] == pytest.approx(tension / (length - 2 * u), rel=1e-7)
