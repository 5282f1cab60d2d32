"""Bodies on springs alone: the springs share the load as if the body had sunk on them.

A body that sinks by a small rigid motion u on springs without strain feels -K_i u_i of each, with
u_i the motion at its point. Those are the forces of least elastic energy that carry the load
(Castigliano); the sum is solved for here by an own linear system.
"""

from __future__ import annotations

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.design import reader
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.structure import Structure
from suspension_cli.models import registry
from suspension_cli.scene import applied_imperfections
from suspension_cli.studies import variants
from tests.support import scenes

GRAVITY = 9.81
ISOLATOR = """
[design]
name = "isolator"

[[stage]]
name = "plate"
position = [0.0, 0.0, -0.1]
body = { mass = 14.2, inertia = [0.2, 0.25, 0.3] }

[[stage.spring]]
stiffness = [900.0, 1100.0, 5000.0, 3.0, 4.0, 5.0]
at = [0.0, 0.0, 0.02]
"""
"""Nothing in it says what the body weighs but its mass."""


def random_springs(rng, count, given=0):
    """Springs off the centre with full stiffness matrices, the first of them with a preload."""
    made = []
    for number in range(count):
        root = rng.normal(size=(6, 6)) * [30, 30, 60, 2, 2, 2]
        stiffness = (root.T @ root + np.diag([500.0, 500.0, 900.0, 2.0, 2.0, 2.0])).tolist()
        stiffness = np.tril(stiffness) + np.tril(stiffness, -1).T
        spring = {"stiffness": stiffness.tolist(), "at": rng.uniform(-0.2, 0.2, 3).tolist()}
        if number < given:
            spring["preload"] = rng.normal(size=6).tolist()
        made.append(spring)
    return made


def tower(seed, given=0):
    """A frame on four springs, a plate on three below it, and a weight on two wires."""
    rng = np.random.default_rng([45, seed])
    body = {"mass": 6.0, "inertia": [0.2, 0.25, 0.3]}
    wires = [
        {"upper": [0.05, 0.02 + y, 0.0], "lower": [0.0, y, 0.0], "k": 1e4} for y in (0.1, -0.1)
    ]
    return scenes.raw_of(
        {
            "name": "frame",
            "position": [0.01, 0.02, 0.3],
            "body": body,
            "spring": random_springs(rng, 4, given),
        },
        {
            "name": "plate",
            "position": [0.03, -0.01, -0.4],
            "body": body,
            "spring": random_springs(rng, 3, given),
        },
        {"name": "weight", "position": [0.05, 0.02, -0.5], "body": body, "wire": wires},
    )


@pytest.mark.parametrize("given", [0, 1])
@pytest.mark.parametrize("seed", range(4))
def test_springs_without_preload_balance_as_drawn(seed, given):
    scene = scenes.scene_of(tower(seed, given))
    found = equilibrium.solve(scene)
    assert found.residual < 1e-12
    assert np.abs(found.pose.shift).max() < 1e-12


@pytest.mark.parametrize("given", [0, 1])
def test_shares_of_least_energy(given):
    """Springs of the plate carry its weight and that of the weight on its wires; each takes what a
    rigid sinking of the body would put on it, beside the preloads that are given."""
    scene = scenes.scene_of(tower(0, given))
    springs = scene.springs
    own = np.flatnonzero(springs.lower == 2)
    load = np.array([0.0, 0.0, -2 * 6.0 * GRAVITY, 0.0, 0.0, 0.0])
    load[3:] = np.cross([0.05, 0.02, 0.0], [0.0, 0.0, -6.0 * GRAVITY])
    arms = []  # wrench about the COM from that at the point
    for point in springs.lower_point[own]:
        arm = np.eye(6)
        for axis in range(3):
            arm[3:, axis] = np.cross(point, np.eye(3)[axis])
        arms.append(arm)
    for arm, preload in zip(arms[:given], springs.preload[own][:given], strict=True):
        load = load + arm @ preload
    free = list(zip(arms, springs.stiffness[own], springs.preload[own], strict=True))[given:]
    whole = sum(arm @ stiffness @ arm.T for arm, stiffness, _ in free)
    sunk = np.linalg.solve(whole, -load)
    for arm, stiffness, preload in free:
        np.testing.assert_allclose(preload, stiffness @ arm.T @ sunk, rtol=1e-9, atol=1e-9)


def closed_form(mass, gravity=GRAVITY):
    """Frequencies, Hz, of the isolator: each axis alone but x with pitch, y with roll.

    A spring of (k, kappa) at the height h over the COM that carries m g, in (x, theta):
    K = [[k, k h], [k h, k h^2 + kappa + m g h]] with x the COM's (and -h with roll).
    """
    height = 0.02
    squares = [5000.0 / mass, 5.0 / 0.3]
    for lateral, turn, inertia in ((900.0, 4.0, 0.25), (1100.0, 3.0, 0.2)):
        stiffness = np.array(
            [
                [lateral, lateral * height],
                [lateral * height, lateral * height**2 + turn + mass * gravity * height],
            ]
        )
        squares += np.linalg.eigvals(np.diag([1 / mass, 1 / inertia]) @ stiffness).tolist()
    return np.sort(np.sqrt(squares)) / (2 * np.pi)


def test_modes_of_one_spring():
    found = sus.modes(sus.parse(ISOLATOR), fidelity="string")
    np.testing.assert_allclose(found.frequency, closed_form(14.2), rtol=1e-9)
    given = f"{ISOLATOR}preload = [0.0, 0.0, {14.2 * GRAVITY!r}, 0.0, 0.0, 0.0]\n"
    same = sus.modes(sus.parse(given), fidelity="string")
    np.testing.assert_allclose(found.frequency, same.frequency, rtol=1e-12)


@pytest.mark.parametrize(
    ("path", "values"),
    [("stage.plate.body.mass", [10.0, 14.2, 20.0]), ("constants.gravity", [1.62, 9.81, 20.0])],
)
def test_sweeps(path, values):
    found = sus.sweep(sus.parse(ISOLATOR), vary={path: values}, fidelity="string")
    for value, row in zip(values, found.value, strict=True):
        is_mass = path.endswith("mass")
        expected = closed_form(value) if is_mass else closed_form(14.2, gravity=value)
        np.testing.assert_allclose(np.sort(row), expected, rtol=1e-9)


def test_a_sweep_says_what_a_given_preload_leaves_over():
    """The force that a preload does not carry, and the remedy, of the first point."""
    given = f"{ISOLATOR}preload = [0.0, 0.0, 139.302, 0.0, 0.0, 0.0]\n"
    vary = {"stage.plate.body.mass": [10.0, 14.2]}
    with pytest.warns(sus.PendsusWarning, match="not possible") as caught:
        sus.sweep(sus.parse(given), vary=vary, results=["1"], fidelity="string")
    [said] = [str(one.message) for one in caught if "not possible" in str(one.message)]
    assert "at stage.plate.body.mass = 10: " in said
    assert "41.2 N of force along z left over; leave out preload" in said


def test_designs_in_one_batch_are_those_alone():
    masses = np.array([5.0, 6.0, 8.0])
    text = sus.parse(ISOLATOR).replace({"stage.plate.spring.1.at": [0.01, -0.02, 0.05]}).text
    designs = list(variants.designs_at(text, {"stage.plate.body.mass": masses}))
    [(_, scene, _)] = variants.alike(designs, "string")
    for n, design in enumerate(designs):
        alone = registry.by_name("string").system(design)
        np.testing.assert_allclose(scene.springs.preload[n, 0, 2], masses[n] * GRAVITY, rtol=1e-12)
        found = eigenmodes.solve(alone)
        assert found.frequency[0] > 0


def test_sensitivity_to_mass_and_gravity():
    found = sus.sensitivity(sus.parse(ISOLATOR), fidelity="string")
    assert found.free.all()
    step = 1e-4
    slope = (closed_form(14.2 + step) - closed_form(14.2 - step)) / (2 * step)
    own = found.derivative[found.parameter.index("stage.plate.body.mass")]
    np.testing.assert_allclose(own[np.argsort(found.nominal)], slope, rtol=1e-5, atol=1e-9)


def test_imperfect_builds_sink_and_tilt():
    """Springs keep their preloads: a body heavier by 1 % sinks by m g / 100 k; one whose COM is
    moved by e tilts by m g e / (kappa + m g h), to first order."""
    design, weight = reader.parse(ISOLATOR), 14.2 * GRAVITY
    heavier = applied_imperfections.impose(expand(design), "body", 1, {"mass_factor": 1.01})
    found = equilibrium.solve(heavier)
    assert found.converged
    assert found.pose.shift[1, 2] == pytest.approx(-0.01 * weight / 5000.0, rel=1e-9)
    moved = '\n[[perturbation]]\nbody = "plate"\ncom_offset = [1e-5, 0.0, 0.0]\n'
    found = equilibrium.solve(expand(reader.parse(ISOLATOR + moved)))
    tilt = np.arcsin(found.pose.rotation[1, 0, 2])
    assert abs(tilt) == pytest.approx(1e-5 * weight / (4.0 + 0.02 * weight), rel=1e-3)


CORNERS = """
[design]
name = "table"

[[stage]]
name = "plate"
position = [0.0, 0.0, 0.3]
body = { mass = 7.3, inertia = [0.2, 0.25, 0.3] }
"""


def test_symmetric_springs_keep_the_symmetry():
    """Shares of mirror images differ by rounding at most, and yaw stays apart from all else."""
    stiffness = "stiffness = [91.3, 73.1, 617.0, 0.7, 0.3, 0.2]"
    springs = [
        f"\n[[stage.spring]]\n{stiffness}\nat = [{x}, {y}, -0.07]"
        for x in (0.123, -0.123)
        for y in (0.217, -0.217)
    ]
    system = registry.STRING.system(reader.parse(CORNERS + "\n".join(springs)))
    coupled = {frozenset(block.tolist()) for block in Structure(system).blocks}
    assert coupled == {frozenset({6, 10}), frozenset({7, 9}), frozenset({8}), frozenset({11})}


@pytest.mark.parametrize(
    ("keys", "left_over", "remedy"),
    [
        ("preload = [0.0, 0.0, 139.0, 0.0, 0.0, 0.0]", "-0.302 N of force along z", "leave out"),
        ("at = [0.1, 0.0, 0.0]", "13.9 N m of pitch torque", "no stiffness"),
    ],
)
def test_what_cannot_be_carried(keys, left_over, remedy):
    text = ISOLATOR.replace("at = [0.0, 0.0, 0.02]", keys)
    text = text.replace("5000.0, 3.0, 4.0, 5.0", "5000.0, 0.0, 0.0, 0.0")
    with pytest.raises(sus.InputError, match="cannot balance") as caught:
        sus.modes(sus.parse(text))
    assert left_over in str(caught.value)
    assert remedy in str(caught.value)
