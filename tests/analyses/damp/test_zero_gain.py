"""A loop of gain 0 is no loop: the others have the poles and margins that they have without it."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.design import reader
from suspension_cli.physics import closed_loop, closed_loop_margins, local_control
from suspension_cli.physics.model_choice import for_modes


def solve(design):
    plant = local_control.build_plant(design.design, for_modes(design, "string", 1e-3)[1])
    poles = closed_loop.find_poles(plant)
    return np.sort_complex(poles.value), closed_loop_margins.find_margins_of_loops(plant, poles)


def test_a_loop_of_gain_0_beside_others_of_the_same_poles():
    whole = sus.example("triple-damped")
    raw = tomllib.loads(whole.text)
    raw["control"]["loop"] = [one for one in raw["control"]["loop"] if one["name"] != "x"]
    poles, margins = solve(reader.replaced(whole, {"control.loop": raw["control"]["loop"]}))
    own_poles, own_margins = solve(whole.replace({"control.loop.x.gain": 0.0}))
    np.testing.assert_allclose(own_poles, poles, rtol=1e-9)
    assert own_margins[0].gain_up == np.inf and own_margins[0].distance == 1.0
    for one, other in zip(own_margins[1:], margins, strict=True):
        assert one.phase == pytest.approx(other.phase, rel=1e-6)
