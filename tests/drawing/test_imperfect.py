"""Drawings of designs with imperfections."""

from __future__ import annotations

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.drawing import draw, geometry, imperfect
from suspension_cli.drawing.bodies import outlines
from suspension_cli.drawing.parts import Sketch
from suspension_cli.equilibrium.nominal import expand_nominal
from suspension_cli.scene.pose import nominal_pose
from tests.support.pictures import SINGLE


def flawed(*items):
    design = sus.parse(SINGLE + "".join(f"\n[[perturbation]]\n{item}\n" for item in items)).design
    scene = expand_nominal(design)
    bare = Sketch(design, scene, outlines(design, scene), nominal_pose(scene), 0.0)
    return bare, imperfect.exaggerate(bare)


def test_displacements_are_exaggerated_by_one_factor():
    """An upper end that is off by 0.1 mm moves the body, and all is drawn as many times larger."""
    bare, found = flawed('wire = "test.1"\nupper_offset = [1e-4, 0.0, 0.0]')
    before = geometry.wire_ends(bare.scene, bare.pose)
    after = geometry.wire_ends(found.sketch.scene, found.sketch.pose)
    assert found.factor in imperfect.FACTORS
    assert after[0, 0] - before[0, 0] == pytest.approx([1e-4 * found.factor, 0, 0], abs=1e-12)
    assert np.abs(after[1, 0] - before[1, 0]).max() < 1e-15
    largest = np.abs(after - before).max() / 0.4
    assert 0.02 < largest <= imperfect.LARGEST_SHIFT * 1.1


def test_pose_is_that_of_the_equilibrium():
    """Wires cut 1 mm too long lower the body by 1 mm, to first order."""
    items = [f'wire = "test.{n}"\nlength_change = 1e-3' for n in range(1, 5)]
    _, found = flawed(*items)
    drop = found.sketch.pose.shift[1] / found.factor
    assert drop == pytest.approx([0, 0, -1e-3 / np.cos(np.arctan(0.133 / 0.377))], rel=0.2)


def test_mass_is_turned_and_shifted_against_its_wires():
    bare, found = flawed('body = "test"\nrotation = [0.0, 0.001, 0.0]\ncom_offset = [1e-4, 0, 0]')
    body = found.sketch.outlines[0]
    assert body.turn is not None
    angle = np.arctan2(body.turn[0, 2], body.turn[0, 0])
    assert angle == pytest.approx(0.001 * found.factor, rel=1e-9)
    corner = body.section(1)[0]
    assert np.linalg.norm(corner) == pytest.approx(np.linalg.norm(bare.outlines[0].section(1)[0]))
    assert body.nearest(corner) == pytest.approx(corner)


def test_nothing_to_displace():
    bare, found = flawed()
    assert found is None
    assert imperfect.describe(bare.design) == []
    assert flawed('wire = "test.1"\nk_factor = 1.1')[1] is None  # trimmed to its tension


def test_drawing_says_its_factor_and_lists_the_imperfections():
    design = sus.example("imperfect").design
    figure = draw.draw(design, expand_nominal(design))
    said = [text.get_text() for text in figure.texts]
    said += [text.get_text() for axes in figure.axes for text in axes.texts]
    assert "Dimensions, to scale; imperfections 50 times larger (grey: without)" in said
    assert {"offset of the wire's upper end", "(0.3, 0, 0) mm", "(2, 0, 5) mrad"} <= set(said)
    assert said.count("1") >= 2 <= said.count("4")  # numbers of the wires, in both views
