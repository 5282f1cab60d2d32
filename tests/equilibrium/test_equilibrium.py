"""Where imperfect suspensions hang: residuals, uniqueness, statics by hand, faults that are
named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from suspension_cli.design import reader
from suspension_cli.equilibrium import clamps, nominal
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.errors import InputError
from suspension_cli.models import registry
from suspension_cli.models import string as string_model
from suspension_cli.scene.applied_imperfections import impose
from suspension_cli.scene.pose import displace, layout, nominal_pose
from tests.support import scenes
from tests.support.golden import CONFIGS

BODY = {"mass": 5.6, "inertia": [0.02, 0.018, 0.017]}


def perturbed(kind, rng):
    """A scene out of balance in its nominal pose."""
    if kind == "crooked":
        return scenes.scene_of(scenes.crooked(rng))
    if kind == "one stage":
        raw = scenes.single(rng)
    elif kind in ("chain", "single wires"):
        counts = (1, 4, 1) if kind == "single wires" else rng.choice([2, 4], 4).tolist()
        raw = scenes.raw_of(*(scenes.stage(rng, f"m{n}", count) for n, count in enumerate(counts)))
    else:
        pairs = [scenes.BLADE_COUNTS[n] for n in rng.integers(1, 5, 2)]
        stages = [
            scenes.bladed_stage(rng, f"m{n}", *pair, tip_mass=True, lateral=True)
            for n, pair in enumerate(pairs)
        ]
        raw = scenes.raw_of(*stages)
    return scenes.scene_of(scenes.perturbations(rng, raw))


def points(scene, pose):
    """Everything that has a place, m: centres of mass and wire ends."""
    w = scene.wires
    lower = scene.bodies.position[w.lower] + pose.shift[w.lower] + pose.arms(w.lower, w.lower_point)
    upper = scene.bodies.position[w.upper] + pose.shift[w.upper] + pose.arms(w.upper, w.upper_point)
    return np.concatenate([pose.shift, lower, upper])


def twist(pose):
    """The part of each body's rotation that is about the vertical, rad."""
    r = pose.rotation
    return np.arctan2(r[..., 1, 0] - r[..., 0, 1], r[..., 0, 0] + r[..., 1, 1])


@pytest.mark.parametrize("kind", ["crooked", "one stage", "chain", "blades", "single wires"])
def test_imperfect_designs_balance(kind):
    for seed in range(6):
        scene = perturbed(kind, np.random.default_rng([10, seed]))
        found = equilibrium.solve(scene)
        assert found.iterations > 0
        assert found.residual < 1e-10, seed
        # wires close together are soft, but nothing spins without a cause
        spun = 0.1 if kind == "single wires" else 0.6
        assert np.abs(twist(found.pose)).max() < spun, seed
        assert not found.pose.shift[0].any()


@pytest.mark.parametrize("kind", ["crooked", "blades"])
def test_the_pose_does_not_depend_on_the_start(kind):
    for seed in range(3):
        rng = np.random.default_rng([11, seed])
        scene = perturbed(kind, rng)
        numbering, found = layout(scene), equilibrium.solve(scene)
        wrong = displace(
            numbering,
            nominal_pose(scene),
            scenes.step_of(rng, numbering.name, 5e-3, 5e-3, support=False),
        )
        assert np.abs(points(scene, wrong) - points(scene, found.pose)).max() > 1e-4
        again = equilibrium.solve(scene, start=wrong)
        assert again.residual < 1e-10
        assert np.abs(points(scene, again.pose) - points(scene, found.pose)).max() < 1e-12, seed
        assert np.abs(again.pose.deflection - found.pose.deflection).max(initial=0.0) < 1e-12, seed


def test_symmetric_designs_hang_as_drawn():
    for seed in range(12):
        rng = np.random.default_rng([12, seed])
        raw = (
            scenes.chain(rng, 1 + seed % 5)
            if seed % 2
            else scenes.bladed_chain(rng, 1 + seed % 5, tip_mass=True, lateral=True)
        )
        found = equilibrium.solve(scenes.scene_of(raw))
        assert found.iterations == 0, seed
        assert found.residual < 1e-14


def two_vertical_wires(**wires):
    return scenes.raw_of(
        {
            "name": "test",
            "body": BODY,
            "wires": {"count": 2, "l": 0.4, "t1": 0.1, "t2": 0.1, "d": 0.005, "k": 2e4, **wires},
        }
    )


def with_wire(raw, **what):
    return scenes.scene_of(raw | {"perturbation": [{"wire": "test.1", **what}]})


@pytest.mark.parametrize("hold", ["loaded-length", "natural-length"])
def test_what_is_held_when_k_changes(hold):
    """Trimmed: nothing moves. Natural length kept: a softer wire is longer by T/k' - T/k."""
    scene = with_wire(two_vertical_wires(), k_factor=0.5, hold=hold)
    tension = 5.6 * 9.81 / 2
    found = equilibrium.solve(scene)
    if hold == "loaded-length":
        assert found.iterations == 0
        np.testing.assert_allclose(found.tension, tension, rtol=1e-14)
    else:
        np.testing.assert_allclose(scene.wires.tension, [tension / 2, tension], rtol=1e-14)
        longer = tension / 1e4 - tension / 2e4
        np.testing.assert_allclose(found.pose.shift[1, 2], -longer / 2, rtol=0.02)
        roll = np.arcsin(-found.pose.rotation[1, 1, 2])
        np.testing.assert_allclose(roll, -longer / 0.2, rtol=0.02)


@pytest.mark.parametrize("hold", ["loaded-length", "natural-length"])
def test_what_is_held_when_an_end_moves(hold):
    """Tension in the nominal pose: T if trimmed, else what the old unstretched length gives at the
    new span."""
    offset, k, tension = np.array([2e-3, 1e-3, 5e-4]), 1.3 * 2e4, 5.6 * 9.81 / 2
    scene = with_wire(
        two_vertical_wires(),
        k_factor=1.3,
        upper_offset=(-offset).tolist(),
        length_change=1e-5,
        hold=hold,
    )
    span = np.linalg.norm(np.array([0.0, 0.0, -0.4]) + offset)
    natural = 0.4 - tension / 2e4 if hold == "natural-length" else span - tension / k
    expected = k * (span - (natural + 1e-5))
    assert scene.wires.length[0] == pytest.approx(span, rel=1e-15)
    assert scene.wires.tension[0] == pytest.approx(expected, rel=1e-12)
    assert scene.wires.tension[1] == pytest.approx(tension, rel=1e-15)
    assert not equilibrium.solve(scene).pose.shift[0].any()


@pytest.mark.parametrize("count", [1, 2])
def test_com_hangs_under_the_wires(count):
    """Moved by (a, b) along x and z, with wires d above it, the COM pitches by atan(a / (d -
    b))."""
    raw = two_vertical_wires()
    if count == 1:
        raw["stage"][0]["wires"] = {"count": 1, "l": 0.4, "d": 0.005, "k": 2e4}
    for a, b in [(1e-3, 0.0), (-5e-4, 1e-3), (4e-3, -2e-3)]:
        scene = scenes.scene_of(
            raw | {"perturbation": [{"body": "test", "com_offset": [a, 0.0, b]}]}
        )
        found = equilibrium.solve(scene)
        assert found.residual < 1e-10
        pitch = np.arctan2(a, 0.005 - b)
        np.testing.assert_allclose(
            found.pose.rotation[1],
            [[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]],
            atol=1e-10,
        )
        where = scene.bodies.position[1] + found.pose.shift[1]
        np.testing.assert_allclose(where, [0, 0, -0.4 - np.hypot(a, 0.005 - b)], atol=1e-12)


def held(*wires, **more):
    """A body on vertical wires at (x, y)."""
    rows = [{"upper": [x, y, 0.0], "lower": [x, y, 0.005], "k": 2e4} for x, y in wires]
    stage = {"name": "test", "body": BODY, "position": [0, 0, -0.4], "wire": rows}
    return scenes.raw_of(stage | more)


FOUR = {"count": 4, "l": 0.4, "s": 0.03, "t1": 0.1, "t2": 0.1, "d": 0.005, "k": 2e4}
SPRING = {"stiffness": [1.0] * 6, "preload": [0, 0, 5.6 * 9.81, 0, 0, 0]}
TOO_LONG = {"wire": "test.1", "length_change": 5e-3}
FAULTY = {
    "slack as it hangs": (
        scenes.raw_of({"name": "test", "body": BODY, "wires": FOUR}, perturbation=[TOO_LONG]),
        r"wire test\.1 is slack",
    ),
    "slack as drawn": (held((0.0, 0.05), (0.0, 0.1)), r"wire test\.2 would be slack.*tension -"),
    "off its centre": (
        held((0.01, 0.05), (0.01, -0.05)),
        r"stage\.test: cannot balance in the nominal pose: .*N m of pitch torque",
    ),
}


@pytest.mark.parametrize("kind", FAULTY)
def test_what_cannot_hang_is_named(kind):
    raw, message = FAULTY[kind]
    with pytest.raises(InputError, match=message) as caught:
        registry.STRING.system(scenes.design_of(raw))
    assert caught.value.exit_code == 2
    if kind == "off its centre":
        torque = float(str(caught.value).split(" N m of pitch")[0].rpartition(" ")[2])
        assert abs(torque) == pytest.approx(5.6 * 9.81 * 0.01, rel=0.05)


def test_what_does_not_balance_is_refused():
    found = equilibrium.solve(scene := perturbed("one stage", np.random.default_rng(15)))
    found.demand(scene)
    with pytest.raises(InputError, match="no equilibrium found"):
        replace(found, residual=1e-10).demand(scene)
    sagging = scenes.scene_of(held(wire=[], spring=[SPRING]))
    preload = 0 * sagging.springs.preload  # rests 55 m further down
    sagging = replace(sagging, springs=replace(sagging.springs, preload=preload))
    with pytest.raises(InputError, match="no equilibrium found near the nominal pose"):
        string_model.linear_model(sagging)


def test_stiff_wires_balance_as_well_as_rounding_lets_them():
    """A displacement of 0.1 mm is known to 1e-20 m, which a wire of 1e12 N/m turns into 1e-8 N: no
    reason to refuse the design, below a soft imperfect stage; 1e17 N/m are one."""
    errors = [
        {"wire": "upper.1", "lower_offset": [1e-3, 5e-4, 0.0], "length_change": 1e-4},
        {"body": "test", "com_offset": [1e-4, 2e-4, 0.0]},
    ]

    def pair(k):
        stages = [
            {"name": name, "body": BODY, "wires": FOUR | {"d": 0.001, "s": 0.005, "k": own}}
            for name, own in (("upper", 1.2e4), ("test", k))
        ]
        return scenes.scene_of(scenes.raw_of(*stages, perturbation=errors))

    soft, *stiff = (equilibrium.solve(pair(k)) for k in (1e11, 1e12, 1e13, 1e14))
    for found in stiff:
        assert found.converged
        assert found.residual < found.rounding
        assert np.abs(points(pair(1e12), found.pose) - points(pair(1e12), soft.pose)).max() < 1e-8
    with pytest.raises(InputError, match=r"1.0e\+17 N/m are too stiff to be balanced"):
        equilibrium.solve(pair(1e17)).demand(pair(1e17))


@pytest.mark.parametrize("mass", [1.0, 1e-6])
def test_a_light_stage_below_a_heavy_one_is_not_taken_for_rounding(mass):
    """A milligram below a tonne tilts by what it does below the support: the tonne does not
    move."""
    size = (mass / 2200) ** (1 / 3)
    shape = {"s": 0.1 * size, "t1": 0.5 * size, "t2": 0.5 * size, "d": 0.02 * size}
    wires = FOUR | shape | {"l": 0.3, "k": 400 * mass * 9.81 / 0.3}
    body = {"mass": mass, "inertia": [0.15 * mass * size**2] * 3}
    light = {"name": "light", "body": body, "wires": wires}
    heavy = {"name": "heavy", "body": {"mass": 1e3, "inertia": [60.0] * 3}}
    heavy["wires"] = FOUR | {"d": 0.001, "s": 0.2, "k": 5e6}
    error = {"wire": "light.1", "lower_offset": [1e-6 * size, 0.0, 0.0]}
    tilt = []
    for stages in ([light], [heavy, light]):
        scene = scenes.scene_of(scenes.raw_of(*stages, perturbation=[error]))
        tilt.append(equilibrium.solve(scene).pose.turn[-1, 0, 2])
    assert tilt[0] != 0
    assert tilt[1] == pytest.approx(tilt[0], rel=2 * mass / 1e3 + 1e-9)


def test_builds_whose_wires_bend_converge():
    """To 1e-12 rad: the resistance to bending at the tension of each build is found with its pose.

    A further search from the poses that were found converges to rounding.
    """
    design = reader.read(CONFIGS / "husman2000" / "table2.toml").design
    factor = np.repeat(np.linspace(0.6, 1.4, 9), 9)
    offset = np.zeros((81, 3))
    offset[:, 0] = np.tile(np.linspace(-2e-3, 2e-3, 9), 9)
    error = {"k_factor": factor, "upper_offset": offset}
    scene = impose(nominal.expand(design), "wire", 6, error)
    scene = registry.BEAM.completed(scene, design)
    scene, found = clamps.solve_bending(scene, layout(scene))
    again = equilibrium.solve(scene, layout(scene), start=found.pose)
    assert np.abs(found.pose.turn).max() > 1e-4
    np.testing.assert_allclose(found.pose.turn, again.pose.turn, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found.pose.shift, again.pose.shift, rtol=0.0, atol=1e-13)
