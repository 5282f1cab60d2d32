"""What `check` prints of heavy wires and of measured profiles."""

from __future__ import annotations

import math

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.check import profiles
from suspension_cli.design.profiles import reduced
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


def test_reduced_profile_has_the_compliances_of_the_measured_one():
    """Against quadrature of 1/d^2 and 1/d^4 along the measured diameters."""
    [wires] = (stage.wires for stage in sus.read(FILE).design.stage if stage.wires.profile)
    own = wires.profile
    z = np.linspace(own.position[0], own.position[-1], 400_001)
    d = np.interp(z, own.position, own.diameter)
    [profile] = profiles.solve(sus.read(FILE).design)
    sections = reduced(own)
    for power, change in ((2, profile.stretching_change), (4, profile.bending_change)):
        exact = np.trapezoid(d**-power, z)
        coarse = sum(piece.length / (2 * piece.radius) ** power for piece in sections)
        assert change == pytest.approx(abs(exact / coarse - 1), rel=1e-3, abs=1e-9)
