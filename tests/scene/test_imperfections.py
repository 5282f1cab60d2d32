"""Every imperfection of the table acts on a scene, and its neutral value does nothing."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.design import reader
from suspension_cli.design.imperfections import IMPERFECTIONS, swept
from suspension_cli.scene.arrays import inner_axes
from suspension_cli.scene.expand import expand_as_drawn
from suspension_cli.scene.imperfections import impose
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
    assert {name: item.unit for name, (item, _) in swept().items()} == {
        **dict.fromkeys(("k", "mass", "inertia"), "1"),
        **dict.fromkeys(
            (
                "length",
                *(
                    stem + axis
                    for stem in ("offset", "lower_offset", "com")
                    for axis in ("", "_y", "_z")
                ),
            ),
            "m",
        ),
    }
