"""The nominal pose of any design without natural lengths is an equilibrium: loads find their way up
every tree."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.equilibrium import solve as equilibrium
from tests.support import scenes


def lopsided_tree(rng, *, blades=True, springs=True):
    """Two bodies hang off the centre of an upper one, on vertical wires each with its own k; blades
    carry tip masses."""
    stages = []
    for name, where, parent in (
        ("upper", (0.0, 0.0, -0.5), None),
        ("left", (0.03, 0.04, -0.4), "upper"),
        ("right", (-0.02, -0.05, -0.3), "upper"),
    ):
        points = [[*(0.12 * np.array([np.cos(a), np.sin(a)])), 0.01] for a in (0.3, 1.9, 3.6, 5.0)]
        wires = [
            {"upper": [*(np.array(p[:2]) + where[:2]), -0.02], "lower": p, "k": k}
            for p, k in zip(points, rng.uniform(1e4, 4e4, 4), strict=True)
        ]
        body = {"mass": scenes.uniform(rng, 4, 8), "inertia": [0.05, 0.05, 0.05]}
        one = {"name": name, "body": body, "position": where, "wire": wires}
        if parent:
            one["hangs_from"] = parent
        if blades:
            one["blade"] = [
                {"name": "soft", "stiffness": 5e3, "tip_mass": 0.2},
                {"name": "stiff", "stiffness": 9e3, "tip_mass": 0.1, "at": [0.1, 0.05, 0.0]},
            ]
            for number, wire in enumerate(wires):
                wire["blade"] = ("soft", "stiff")[number % 2]
        if springs:
            preload = [0.0, 0.0, 3.0, 0.2, -0.1, 0.0]
            spring = {"stiffness": [20.0] * 6, "at": [0.05, 0.02, 0.01], "preload": preload}
            one["spring"] = [spring]
        stages.append(one)
    return scenes.raw_of(*stages)


@pytest.mark.parametrize("blades", [False, True])
@pytest.mark.parametrize("springs", [False, True])
def test_lopsided_trees_balance_as_drawn(blades, springs):
    for seed in range(5):
        scene = scenes.scene_of(
            lopsided_tree(np.random.default_rng([30, seed]), blades=blades, springs=springs)
        )
        found = equilibrium.solve(scene)
        assert found.residual < 1e-13
        assert np.abs(found.pose.shift).max() < 1e-13
        carried = scene.wires.tension[:4].sum() + (3.0 if springs else 0.0)
        # those of the upper stage hang on the support
        tips = scene.blades.tip_mass[2:].sum() if blades else 0.0
        assert carried == pytest.approx(9.81 * (scene.bodies.mass.sum() + tips), rel=1e-12)
