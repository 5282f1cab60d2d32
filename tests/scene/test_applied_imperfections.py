"""Every imperfection of the table acts on a scene, and its neutral value does nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from suspension_cli.design import reader
from suspension_cli.design.imperfections import IMPERFECTIONS, swept
from suspension_cli.scene.applied_imperfections import impose
from suspension_cli.scene.arrays import inner_axes
from suspension_cli.scene.expand import expand_as_drawn
from tests.support.paths import CONFIGS

SCENES = {
    part: expand_as_drawn(reader.read(CONFIGS / f"{name}.toml").design)
    for part, name in (
        ("wire", "quadruple"),
        ("body", "quadruple"),
        ("blade", "quadruple"),
        ("leg", "tower"),
        ("link", "cryogenic-payload"),
    )
}


def numbers(scene):
    """All numbers that may carry batch axes."""
    return {
        (key, name): getattr(part, name)
        for key, part in scene.parts.items()
        for name in inner_axes(type(part))
    }


@pytest.mark.parametrize("item", IMPERFECTIONS, ids=lambda item: item.name)
def test_acts_unless_neutral(item):
    shape, number = ((3,) if item.vector else ()), (1 if item.part == "body" else 0)
    scene = SCENES[item.part]
    expected = numbers(scene)
    for amount, same in ((item.neutral, True), (item.neutral + 1e-3, False)):
        found = numbers(impose(scene, item.part, number, {item.name: np.full(shape, amount)}))
        assert same == all(
            np.allclose(found[key], expected[key], rtol=1e-14, atol=0) for key in expected
        )


def test_short_names():
    units = {name: item.unit for name, (item, _) in swept().items()}
    places = [
        f"{what}{axis}" for what in ("offset", "lower_offset", "com") for axis in ("", "_y", "_z")
    ]
    factors = dict.fromkeys(("k", "mass", "inertia"), "1")
    assert units == factors | dict.fromkeys(("length", *places), "m")


def test_a_turned_mass_has_a_turned_inertia():
    """R I R^T, with products of inertia that tell the sense of the rotation."""
    turn, inertia = [0.1, -0.2, 0.3], np.diag([0.01, 0.02, 0.03]) + 0.002
    bodies = SCENES["body"].bodies
    bodies = replace(bodies, inertia=np.array([inertia] * len(bodies.name)))
    scene = replace(SCENES["body"], bodies=bodies)
    found = impose(scene, "body", 1, {"rotation": np.array(turn)})
    r = Rotation.from_rotvec(turn).as_matrix()
    np.testing.assert_allclose(found.bodies.inertia[0], r @ inertia @ r.T, rtol=1e-12)
