"""Drawings of designs with imperfections."""

from __future__ import annotations

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.drawing import draw, geometry
from suspension_cli.equilibrium.nominal import expand_nominal
from tests.support.pictures import SINGLE


def lines(strokes, kind):
    return np.array([one.points for one in strokes if one.kind == kind])


def displaced(*items):
    """Lines at rest and as drawn in side view, and the factor of exaggeration."""
    design = sus.parse(SINGLE + "".join(f"\n[[perturbation]]\n{item}\n" for item in items)).design
    sketch = geometry.sketch_at_rest(design, expand_nominal(design))
    shown, factor = draw.exaggerate(sketch)
    return sketch.strokes(1), shown[1], factor


def test_displacements_are_exaggerated_by_one_factor():
    """An upper end that is off by 0.1 mm moves the body, and all is drawn as many times larger."""
    still, shown, factor = displaced('wire = "test.1"\nupper_offset = [1e-4, 0.0, 0.0]')
    moved = lines(shown, "wire") - lines(still, "wire")
    assert factor in draw.FACTORS
    assert moved[0, 0] == pytest.approx([1e-4 * factor, 0, 0], abs=1e-12)
    assert np.abs(moved[1, 0]).max() < 1e-15
    assert 0.02 < np.abs(moved).max() / 0.4 <= draw.LARGEST_SHIFT * 2


def test_pose_is_that_of_the_equilibrium():
    """Wires cut 1 mm too long lower the body by 1 mm, to first order."""
    items = [f'wire = "test.{n}"\nlength_change = 1e-3' for n in range(1, 5)]
    still, shown, factor = displaced(*items)
    drop = (lines(shown, "body") - lines(still, "body"))[0, 0] / factor
    assert drop == pytest.approx([0, 0, -1e-3 / np.cos(np.arctan(0.133 / 0.377))], rel=0.2)


def test_nothing_to_displace():
    assert displaced()[2] is None
    assert displaced('wire = "test.1"\nk_factor = 1.1')[2] is None  # trimmed to its tension


def test_drawing_says_its_factor_and_lists_the_imperfections():
    design = sus.example("imperfect").design
    figure = draw.draw(design, expand_nominal(design))
    said = [text.get_text() for text in figure.texts]
    said += [text.get_text() for axes in figure.axes for text in axes.texts]
    assert "Dimensions, to scale; imperfections 50 times larger (grey: without)" in said
    assert {"offset of the wire's upper end", "(0.3, 0, 0) mm", "(2, 0, 5) mrad"} <= set(said)
    assert said.count("1") >= 2 <= said.count("4")  # numbers of the wires, in both views
