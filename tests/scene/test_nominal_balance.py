"""The nominal pose of any design without natural lengths is an equilibrium: loads find their way up
every tree."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.energy import gradient_and_stiffness
from suspension_cli.scene import imperfections
from suspension_cli.scene.pose import layout, nominal_pose
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
        offset = np.array(where)
        wires = [
            {
                "upper": [p[0] + offset[0], p[1] + offset[1], -0.02],
                "lower": p,
                "k": scenes.log_uniform(rng, 1e4, 4e4),
            }
            for p in points
        ]
        one = {
            "name": name,
            "body": {"mass": scenes.uniform(rng, 4, 8), "inertia": [0.05, 0.05, 0.05]},
            "position": offset,
            "wire": wires,
        }
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
            one["spring"] = [
                {
                    "stiffness": [20.0] * 6,
                    "at": [0.05, 0.02, 0.01],
                    "preload": [0.0, 0.0, 3.0, 0.2, -0.1, 0.0],
                }
            ]
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


def attachments(scene):
    """Every attachment in the nominal pose, in global axes."""
    at, w, b, s = scene.bodies.position, scene.wires, scene.blades, scene.springs
    ends = (
        (w.upper, w.upper_point),
        (w.lower, w.lower_point),
        (b.body, b.tip),
        (s.upper, s.upper_point),
        (s.lower, s.lower_point),
    )
    return np.concatenate([at[body] + point for body, point in ends])


@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_com_moves_alone(number):
    """Attachments, wires and their tensions stay where they are; only the weight pulls
    elsewhere."""
    scene = scenes.scene_of(lopsided_tree(np.random.default_rng(31)))
    offset = np.array([2e-3, -1e-3, 3e-3])
    moved = imperfections.move_com(scene, number, offset)
    np.testing.assert_allclose(attachments(moved), attachments(scene), rtol=0, atol=1e-15)
    step = np.zeros((4, 3))
    step[number] = offset
    np.testing.assert_allclose(
        moved.bodies.position - scene.bodies.position, step, rtol=0, atol=1e-15
    )
    numbering = layout(scene)
    before, _ = gradient_and_stiffness(scene, numbering, nominal_pose(scene))
    after, _ = gradient_and_stiffness(moved, numbering, nominal_pose(moved))
    # the gradient about the COM: what balanced there now has the weight's torque about the old one
    expected = np.zeros_like(before)
    weight = np.array([0.0, 0.0, -9.81 * scene.bodies.mass[number - 1]])
    expected[6 * number + 3 : 6 * number + 6] = -np.cross(offset, weight)
    np.testing.assert_allclose((after - before)[6:], expected[6:], rtol=0, atol=1e-11)
