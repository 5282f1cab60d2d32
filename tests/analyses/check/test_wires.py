"""What `check` prints of heavy wires and of measured profiles."""

from __future__ import annotations

import math

import pytest

import suspension_cli as sus
from tests.support.golden import CONFIGS

FILE = CONFIGS / "pulled-fibres.toml"


def test_weight_sag_and_profile():
    found = sus.check(sus.read(FILE))
    own, [profile] = found.weights, found.statics.profiles
    assert own.included and 0.05 < own.total < 0.07
    load = found.statics.wires[0]
    weight = 9.81 * 7800 * math.pi * 350e-6**2 * 0.5
    assert own.ratio == pytest.approx(weight / load.tension, rel=0.05)
    assert own.sag == pytest.approx(weight * 0.04 / (8 * load.tension), rel=0.05)
    assert own.line in str(found)
    assert f"281 places in {profile.sections} uniform sections" in str(found)
    document = found.document()
    assert document["wire_weight"]["total_n"] == own.total
    assert document["profiles"][0]["places"] == 281
    light = sus.check(sus.example("quadruple"))
    assert light.weights.line == "" and "wire_weight" not in light.document()


def test_heavy_wires_that_are_left_out_are_told():
    light = sus.template("single").replace({"stage.test.body.mass": 0.05})
    assert "constants.wire_weight = true includes" in str(sus.check(light))
