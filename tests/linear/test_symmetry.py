"""What symmetry forbids is exactly 0, and what it allows is found: blocks, labels, rigid and
unstable modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from suspension_cli.conventions import DOFS
from suspension_cli.design.reader import read
from suspension_cli.elements.known_elements import elements_of
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.energy import gradient_and_stiffness, sum_forms
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.structure import Structure
from suspension_cli.linear.symmetry import is_mirror_symmetric
from suspension_cli.models import closed_form
from suspension_cli.models import string as string_model
from suspension_cli.scene.arrays import inner_axes
from suspension_cli.scene.pose import layout
from tests.support import paper, scenes
from tests.support.paths import CONFIGS

FAMILIES = [("x", "pitch"), ("y", "roll"), ("z",), ("yaw",)]


def model_of(raw):
    return string_model.linear_model(scenes.scene_of(raw))


def dofs_of(model, block):
    """Degrees of freedom of the bodies in a block; tips left out."""
    bodies = 6 * (len(model.body) + 1)
    return {DOFS[i % 6] for i in block if i < bodies}


def between_families(matrix):
    """Elements between coordinates of bodies of different families."""
    family = np.array([next(n for n, dofs in enumerate(FAMILIES) if dof in dofs) for dof in DOFS])
    family = np.tile(family, len(matrix) // 6)
    return matrix[family[:, None] != family[None, :]]


@pytest.mark.parametrize(("wires", "blades"), scenes.BLADE_COUNTS)
@pytest.mark.parametrize(
    "options",
    [{}, {"tip_mass": True}, {"lateral": True}, {"tip_mass": True, "lateral": True}],
    ids=["plain", "tips", "lateral", "both"],
)
@pytest.mark.parametrize("angled", [False, True], ids=["vertical", "angled"])
def test_symmetric_chains_fall_into_four_blocks(wires, blades, options, angled):
    rng = np.random.default_rng([21, wires, blades])
    stages = [
        scenes.stage(rng, "top"),
        scenes.bladed_stage(rng, "middle", wires, blades, angled=angled, **options),
        scenes.bladed_stage(rng, "low", 4, 2, **options),
    ]
    model = model_of(scenes.raw_of(*stages))
    assert model.size == 6 * 4 + (blades + 2) * (3 if "lateral" in options else 1)
    families = [dofs_of(model, block) for block in Structure(model).blocks]
    # one wire does not hand yaw on; tips may move against each other without moving a body
    bodied = [found for found in families if found]
    assert sorted(map(sorted, bodied)) == sorted(
        [*map(sorted, FAMILIES), *([["yaw"]] if wires == 1 else [])]
    )
    for matrix in (model.mass, model.stiffness):
        assert np.array_equal(matrix, matrix.T)
        n = 6 * 4
        assert not between_families(matrix[:n, :n]).any()
    light, own = model.massless[6:], model.stiffness[6:, 6:]
    follow = np.linalg.solve(own[np.ix_(light, light)], own[np.ix_(light, ~light)])
    reduced = own[np.ix_(~light, ~light)] - own[np.ix_(~light, light)] @ follow
    assert not between_families(np.pad(reduced[:18, :18], ((6, 0), (6, 0)))).any()


def on_springs(rng):
    """Off the axis, with nothing but symmetric springs: not symmetric about the support."""
    spring = {"stiffness": rng.uniform(100, 200, 6), "preload": [0, 0, 5.0 * 9.81, 0, 0, 0]}
    body = {"mass": 5.0, "inertia": [0.02, 0.02, 0.03]}
    stage = {"name": "test", "body": body, "position": [0.1, 0, -0.4], "spring": [spring]}
    return scenes.raw_of(stage)


def ring_on_blades(rng):
    """Five wires on the tips of five blades, above a pair."""
    top = scenes.stage(rng, "top", 4)
    top["wires"] = {"count": 5, "ring": 0.05, "phase": 0.0, "l": 0.4, "k": 4e4}
    return scenes.raw_of(
        top | {"blades": {"count": 5, "stiffness": 2e3}}, scenes.stage(rng, "x", 2)
    )


def chains_side_by_side(rng):
    """Three wires on three blades beside the axis, and a chain of fours on it."""
    wires, blades = [], []
    for n, angle in enumerate((0, 2 * np.pi / 3, -2 * np.pi / 3)):
        x, y = 0.05 * np.cos(angle), 0.05 * np.sin(angle)
        upper = [0.3 + x, y, 0.0]
        wires.append({"upper": upper, "lower": [x, y, 0.0], "k": 4e4, "blade": f"b{n}"})
        blades.append({"name": f"b{n}", "at": upper, "stiffness": 2e3})
    aside = scenes.hung({}, 5.0, 0.02, hangs_from="support", position=[0.3, 0.0, -0.4])
    del aside["wires"]
    aside |= {"name": "aside", "wire": wires, "blade": blades}
    return scenes.raw_of(scenes.stage(rng, "main", 4), aside)


def shipped(name):
    return lambda _: expand(read(CONFIGS / f"{name}.toml").design)


SCENES = {
    "blades": (
        lambda rng: scenes.scene_of(scenes.bladed_chain(rng, 2, tip_mass=True, lateral=True)),
        (),
    ),
    "crooked": (lambda rng: scenes.scene_of(scenes.crooked(rng)), ()),
    "springs": (lambda rng: scenes.scene_of(on_springs(rng)), ()),
    "ring": (lambda rng: scenes.scene_of(ring_on_blades(rng)), ("top", "x")),
    "aside": (lambda rng: scenes.scene_of(chains_side_by_side(rng)), ("main", "aside")),
    "tower": (shipped("tower"), ("platform", "filter", "mirror")),
    "pulled-fibres": (shipped("pulled-fibres"), ("upper", "mirror")),
    "reaction-chain": (shipped("reaction-chain"), ("top", "mirror")),
}
"""Scenes, and bodies in them whose families stay apart: of rings, and of chains side by side."""


@pytest.mark.parametrize("kind", SCENES)
def test_no_stiffness_is_lost_with_the_zeros(kind):
    """The zeros are put in where the plain sum over elements has nothing but rounding errors."""
    make, bodies = SCENES[kind]
    for seed in range(2):
        scene = make(np.random.default_rng([23, seed]))
        model, found = string_model.linear_model(scene), equilibrium.solve(scene)
        whole = model.basis @ model.stiffness @ model.basis.T
        _, plain = gradient_and_stiffness(scene, layout(scene), found.pose)
        assert np.abs(whole - plain).max() < 1e-14 * np.abs(whole).max()
        parts = [item.add_mass for item in elements_of(scene)]
        mass = sum_forms(scene, layout(scene), found.pose, parts)
        assert np.abs(model.basis @ model.mass @ model.basis.T - mass).max() < 1e-14 * mass.max()
        np.testing.assert_allclose(model.basis.T @ model.basis, np.eye(model.size), atol=1e-15)
        for block in Structure(model).blocks:
            moving = [i for i in block if i < 6 * (len(model.body) + 1)]
            dofs = {DOFS[i % 6] for i in moving if model.coordinate[i].split(".")[0] in bodies}
            assert any(dofs <= set(family) for family in FAMILIES)


SPOILERS = {
    "com forward": ({"body": "test", "com_offset": [1e-3, 0, 0]}, {"x", "z", "pitch"}),
    "com to the side": ({"body": "test", "com_offset": [0, 1e-3, 0]}, {"y", "z", "roll"}),
    "pitched mass": ({"body": "test", "rotation": [0, 0.01, 0]}, {"x", "z", "pitch"}),
    "stiffer wire": ({"wire": "test.1", "k_factor": 1.001}, set(DOFS)),
}
"""Imperfections, and what moves in the plane of the mirror that is left."""


@pytest.mark.parametrize("spoiler", SPOILERS)
def test_one_mirror_keeps_two_classes(spoiler):
    """Without x to -x, what moves in the plane of x and z stays apart from what moves out of it;
    likewise for y. A wire at a corner leaves no mirror."""
    item, plane = SPOILERS[spoiler]
    model = model_of(paper.table_1(4) | {"perturbation": [item]})
    found = [dofs_of(model, block) for block in Structure(model).blocks]
    assert all(group <= plane or group <= set(DOFS) - plane for group in found)
    # turning the mass about its COM does not couple z: what rounding leaves there may be exactly 0
    if "rotation" not in item:
        assert len(found) == (1 if len(plane) == 6 else 2)


def test_ring_with_one_stiffer_wire_couples():
    """The rotation is lost, and with it the zeros that one mirror does not explain."""
    scene = expand(read(CONFIGS / "pulled-fibres.toml").design)
    stiffness = scene.wires.stiffness.copy()
    stiffness[0] *= 1.001  # the wire in the plane of x and z
    other = replace(scene, wires=replace(scene.wires, stiffness=stiffness))
    assert is_mirror_symmetric(other).tolist() == [False, True]
    model = string_model.linear_model(other)
    assert any({"x", "z"} <= dofs_of(model, block) for block in Structure(model).blocks)


def three_wires(rng):
    """Three wires at 120 degrees but for rounding, turned so that no mirror is left: longitudinal
    and transverse are degenerate."""
    wires = []
    for angle in 0.2 + 2 * np.pi * np.arange(3) / 3:
        x, y, z = [0.1 * np.cos(angle), 0.1 * np.sin(angle), 0.0] + 1e-15 * rng.uniform(-1, 1, 3)
        wire = {"upper": [0.7 * x, 0.7 * y, z], "lower": [x, y, z + 0.01]}
        wires.append(wire | {"k": 2e4, "natural_length": 0.4})
    body = {"mass": 5.0, "inertia": [0.02, 0.02, 0.03]}
    return scenes.raw_of({"name": "test", "body": body, "position": [0, 0, -0.41], "wire": wires})


def test_degenerate_modes_keep_their_labels():
    names = set()
    for seed in range(6):
        model = model_of(three_wires(np.random.default_rng(seed)))
        found = eigenmodes.solve(model)
        assert len(Structure(model).blocks) < 4
        for one, other in (("x", "y"), ("pitch", "roll")):
            assert found.of(one) == pytest.approx(found.of(other), rel=1e-10)
        names.add(tuple(found.home))
        for n, (_, dof) in enumerate(found.home):
            assert dof not in ("x", "y") or found.energy[n, 0, DOFS.index(dof)] > 0.99
    assert len(names) == 1
    assert {dof for _, dof in names.pop()} == set(DOFS)


def test_two_equal_masses_keep_their_labels():
    """Beside each other on one upper mass they share every mode alike, so that rounding would
    decide its label."""
    rng = np.random.default_rng(24)
    top, one = scenes.stage(rng, "top"), scenes.stage(rng, "one")
    raw = scenes.raw_of(top, one, one | {"name": "two", "hangs_from": "top"})
    found = eigenmodes.solve(model_of(raw))
    raw["stage"][2]["body"] = raw["stage"][2]["body"] | {
        "mass": raw["stage"][2]["body"]["mass"] * (1 + 1e-15)
    }
    again = eigenmodes.solve(model_of(raw))
    assert np.abs(found.energy[:, 1] - found.energy[:, 2]).max() < 1e-6
    assert found.label == again.label
    assert not any(label.startswith("two") for label in found.label)
    np.testing.assert_allclose(found.frequency, again.frequency, rtol=1e-9)


@pytest.mark.parametrize("kind", ["crooked", "chain", "blades", "heavy tips"])
def test_shares_of_the_kinetic_energy(kind):
    """They add up to 1; shapes have unit modal mass, and the stiffness omega^2."""
    rng, heavy = np.random.default_rng(25), kind == "heavy tips"
    makers = {"crooked": scenes.crooked, "chain": lambda rng: scenes.chain(rng, 3)}
    blades = lambda rng: scenes.bladed_chain(rng, 3, tip_mass=heavy, lateral=heavy)  # noqa: E731
    model = model_of(makers.get(kind, blades)(rng))
    found = eigenmodes.solve(model)
    assert found.fractions.min() >= 0
    np.testing.assert_allclose(found.fractions.sum(1), 1.0, rtol=1e-12)
    assert found.tip_energy.shape[1] == model.size - 6 * (len(model.body) + 1)
    assert found.tip_energy.any() == heavy or kind == "crooked"
    mass, stiffness = (
        found.shape @ (model.basis @ matrix @ model.basis.T)[6:, 6:] @ found.shape.T
        for matrix in (model.mass, model.stiffness)
    )
    np.testing.assert_allclose(mass, np.eye(len(mass)), atol=1e-7)  # degenerate ones included
    scale = np.abs(found.omega_squared).max()
    np.testing.assert_allclose(stiffness, np.diag(found.omega_squared), atol=1e-10 * scale)


def test_growth_rate_of_a_top_heavy_mass():
    """Below d = 0 the tension pushes the mass over, once the wires are close enough together."""
    raw = paper.table_1(1)
    for d, s in ((-0.01, 1e-4), (-0.02, 1e-3), (-0.003, 0.0), (-0.01, 0.04)):
        raw["stage"][0]["wires"] = raw["stage"][0]["wires"] | {"d": d, "s": s}
        design = scenes.design_of(raw)
        found = eigenmodes.solve(string_model.linear_model(expand(design)))
        expected = -np.linalg.eigvals(closed_form.longitudinal_tilt(closed_form.four_wires(design)))
        assert found.stable == (s == 0.04) == bool((expected > 0).all())
        if found.stable:
            assert not found.growth_rate.any()
            continue
        assert (found.omega_squared < 0).sum() == 1 and np.isnan(found.frequency[0])
        np.testing.assert_allclose(found.growth_rate[0], np.sqrt(-expected.min()), rtol=1e-10)
        assert found.home[0] == ("test", "pitch")


def test_one_wire_lets_a_body_spin_for_nothing():
    rng = np.random.default_rng(26)
    below = [scenes.stage(rng, "mirror", 1), scenes.stage(rng, "weight", 4)]
    chain = [scenes.stage(rng, "top", 4), *below]
    for stages in (chain, [scenes.stage(rng, "test", 1)]):
        found = eigenmodes.solve(model_of(scenes.raw_of(*stages)))
        assert np.flatnonzero(found.omega_squared == 0).tolist() == [0]
        assert found.stable and found.home[0][1] == "yaw"
        bodies = found.energy[0].sum(-1)  # only what hangs from the one wire spins
        assert bodies[1:].sum() == pytest.approx(1.0) if stages is chain else bodies[0] == 1.0


REDUNDANT = {"bodies.mass", "wires.span", "springs.upper_point"} | {
    f"struts.{name}" for name in ("span", "length", "torsion", "mass")
}
"""Numbers of a scene that cannot break a mirror alone: they follow from others, are 0, or belong to
a body on the plane."""


def test_every_number_of_a_scene_can_break_a_mirror():
    """A kind of element that the search for symmetry ignored would lose couplings in silence."""
    seen = set()
    for name in ("tower", "reaction-chain", "pulled-fibres"):
        scene = expand(read(CONFIGS / f"{name}.toml").design)
        # legs and wires at 120 degrees from each other make x a mirror of all matrices, too
        assert is_mirror_symmetric(scene).tolist() == [name != "reaction-chain", True]
        for kind, part in scene.parts.items():
            for field in inner_axes(type(part)):
                value = getattr(part, field)
                if f"{kind}.{field}" in REDUNDANT | seen or not value.size:
                    continue
                for place in np.ndindex(value.shape):
                    changed = value.copy()
                    changed[place] += 0.01 * (np.abs(value).max() + 1)
                    other = replace(scene, **{kind: replace(part, **{field: changed})})
                    if not is_mirror_symmetric(other)[1]:
                        assert not is_mirror_symmetric(other)[0]
                        seen.add(f"{kind}.{field}")
                        break
                else:
                    pytest.fail(f"{kind}.{field} of {name} breaks no mirror")
    fields = {
        f"{kind}.{field}" for kind, part in scene.parts.items() for field in inner_axes(type(part))
    }
    assert seen == fields - REDUNDANT
