"""Which of several equilibria is found: the one on the branch that leads from the nominal pose, if
it is stable."""

from __future__ import annotations

import tomllib

import numpy as np
from scipy.optimize import minimize, root

from suspension_cli.design.reader import read
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.energy import gradient_and_stiffness
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.scene.pose import displace, layout, nominal_pose
from suspension_cli.scene.scene import stack_scenes
from tests.support import scenes
from tests.support.derivatives import complex_gradient, hessian
from tests.support.energies import energy
from tests.support.golden import ROOT

TRIPLE = ROOT / "configs" / "geo-silica-triple.toml"
TOO_LONG = [12, 14, 8, -3, 6, 6, -13, 14, -14, -8]
"""Changes of the wires' lengths, 0.1 mm, after which Newton's method from the nominal pose ends
where two modes grow."""


def scene_of_half(wires):
    """With half of these changes of length, which Newton's method solves at once."""
    half = [one | {"length_change": one["length_change"] / 2} for one in wires]
    return expand(scenes.design_of(tomllib.loads(TRIPLE.read_text()) | {"perturbation": half}))


def pose_of_least_energy(scene):
    """By scipy, from energies alone, whose gradient is 0 there: a complex step."""
    numbering, start = layout(scene), nominal_pose(scene)
    free = np.flatnonzero(np.arange(numbering.size) >= 6)
    scale = 1 / np.sqrt(np.abs(np.diag(hessian(energy, scene, numbering, start))[free]) + 1)

    def displaced(y):
        step = np.zeros(numbering.size)
        step[free] = scale * y
        return step

    def slope(y):
        found = complex_gradient(energy, scene, numbering, start, displaced(y))
        return scale * found[free]

    best = minimize(
        lambda y: float(energy(scene, displace(numbering, start, displaced(y)))),
        np.zeros(len(free)),
        jac=slope,
        method="BFGS",
        options={"gtol": 1e-9, "maxiter": 3000},
    )
    return displace(numbering, start, displaced(root(slope, best.x).x))


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
    stiffness = gradient_and_stiffness(scene, layout(scene), found.pose)[1]
    assert np.linalg.eigvalsh(stiffness[6:, 6:]).min() > 0
    assert np.abs(found.pose.turn).max() < 0.1
    lowest = pose_of_least_energy(scene)
    np.testing.assert_allclose(found.pose.shift, lowest.shift, atol=1e-8)
    np.testing.assert_allclose(found.pose.rotation, lowest.rotation, atol=1e-7)
