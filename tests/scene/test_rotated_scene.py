"""Physics does not know x from y: a scene built turned about z has turned matrices, poses and the
same modes."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.energy import gradient_and_stiffness
from suspension_cli.models import string as string_model
from suspension_cli.scene.pose import layout
from tests.support import scenes


def turn_of(scene, turn):
    """The change of coordinates (N, N): every vector turns, deflections along z stay."""
    numbering = layout(scene)
    result = np.zeros((numbering.size, numbering.size))
    vectors = 2 * (len(scene.bodies.name) + 1)
    result[: 3 * vectors, : 3 * vectors] = np.kron(np.eye(vectors), turn)
    for axes, columns in zip(scene.blades.axes, numbering.blade, strict=True):
        result[np.ix_(columns[axes], columns[axes])] = turn[np.ix_(axes, axes)]
    return result


@pytest.mark.parametrize(("cos", "sin"), [(-0.6, 0.8), (0.0, 1.0)], ids=["turned", "quarter"])
def test_matrices_turn_with_the_scene(cos, sin):
    raw = scenes.crooked(np.random.default_rng(8), lateral=sin == 1.0)
    three = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    one, other = scenes.scene_of(raw), scenes.scene_of(scenes.turned(raw, three))
    turn = turn_of(one, three)
    first, second = equilibrium.solve(one), equilibrium.solve(other)
    for found in (first, second):
        assert found.iterations > 0
        assert found.converged
    assert np.abs(first.pose.shift @ three.T - second.pose.shift).max() < 1e-12
    assert np.abs(three @ first.pose.rotation @ three.T - second.pose.rotation).max() < 1e-11
    assert np.abs(first.tension - second.tension).max() < 1e-9 * one.weight
    own, turned = (
        gradient_and_stiffness(scene, layout(scene), found.pose)[1]
        for scene, found in ((one, first), (other, second))
    )
    stiffness = turn @ own @ turn.T
    # it does turn
    assert np.abs(stiffness - own).max() > 1e-3 * np.abs(stiffness).max()
    assert np.abs(stiffness - turned).max() < 1e-11 * np.abs(stiffness).max()
    masses = [
        string_model.mass_matrix(scene, layout(scene), found.pose)
        for scene, found in ((one, first), (other, second))
    ]
    assert np.abs(turn @ masses[0] @ turn.T - masses[1]).max() < 1e-12 * np.abs(masses[1]).max()
