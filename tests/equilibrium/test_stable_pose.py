"""Which of several equilibria is found: the one on the branch that leads from the nominal pose, if
it is stable."""

from __future__ import annotations

import tomllib

import numpy as np

from suspension_cli.design.reader import read
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.definite import positive_definite
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.scene.stack import stack_scenes
from tests.support import scenes
from tests.support.energy_minimum import Energy
from tests.support.golden import ROOT

TRIPLE = ROOT / "configs" / "geo-silica-triple.toml"
TOO_LONG = [12, 14, 8, -3, 6, 6, -13, 14, -14, -8]
"""Changes of the wires' lengths, 0.1 mm, after which Newton's method from the nominal pose ends
where two modes grow."""


def scene_of_half(wires):
    """With half of these changes of length, which Newton's method solves at once."""
    half = [one | {"length_change": one["length_change"] / 2} for one in wires]
    return expand(scenes.design_of(tomllib.loads(TRIPLE.read_text()) | {"perturbation": half}))


def test_a_pose_with_two_growing_modes_is_not_taken_for_stable():
    """The triple hangs at the lowest energy, less than 0.1 rad from nominal; another stationary
    point, 0.8 rad away, has two modes that grow."""
    nominal = expand(read(TRIPLE).design)
    wires = [
        {"wire": label, "length_change": 1e-4 * change}
        for label, change in zip(nominal.wires.label, TOO_LONG, strict=True)
    ]
    scene = expand(scenes.design_of(tomllib.loads(TRIPLE.read_text()) | {"perturbation": wires}))
    found = equilibrium.solve(scene)
    assert found.converged
    batch = equilibrium.solve(stack_scenes([scene, scene_of_half(wires), scene]))
    assert batch.converged.all()
    np.testing.assert_allclose(batch.pose.turn[[0, 2]], [found.pose.turn] * 2, atol=1e-9)
    assert np.linalg.eigvalsh(found.stiffness[6:, 6:]).min() > 0
    assert np.abs(found.pose.turn).max() < 0.1
    energy = Energy(scene, nominal.blades.load[:, 2])
    place, turn, _ = energy.parts(energy.lowest())
    np.testing.assert_allclose(scene.bodies.position + found.pose.shift, place, atol=1e-8)
    np.testing.assert_allclose(found.pose.rotation, turn, atol=1e-7)


def test_two_negative_eigenvalues_are_not_positive_definite():
    stack = np.array(
        [
            np.diag(d)
            for d in (
                [1.0, 2.0, 3.0],
                [-1.0, -2.0, 3.0],
                [-1.0, 2.0, 3.0],
                [np.nan, 1.0, 1.0],
                [4.0, 5.0, 6.0],
            )
        ]
    )
    assert positive_definite(stack).tolist() == [True, False, False, False, True]
    assert positive_definite(stack.reshape(5, 1, 3, 3)).shape == (5, 1)
    assert not positive_definite(stack[1])
