"""Modes, drawing and check of designs with many bodies."""

from __future__ import annotations

import pytest
import scipy.linalg

import suspension_cli as sus
from suspension_cli.design.reader import parse
from suspension_cli.drawing import draw
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from tests.support.large_tower import large_tower


@pytest.mark.parametrize("symmetric", [True, False])
def test_frequencies_are_those_of_the_matrices(symmetric: bool) -> None:
    model = registry.STRING.system(parse(large_tower(5, 3, 12, symmetric=symmetric)))
    assert model.size == 6 + 6 * 17
    found = eigenmodes.solve(model)
    square = scipy.linalg.eigh(model.stiffness[6:, 6:], model.mass[6:, 6:], eigvals_only=True)
    assert found.omega_squared == pytest.approx(square, rel=1e-7)


def test_drawing_and_check_of_many_bodies_stay_short() -> None:
    text = large_tower(5, 3, 12, symmetric=False)
    design = parse(text)
    figure = draw.draw(design, expand(design), tabulate=False)
    words = [text.get_text() for text in figure.findobj() if hasattr(text, "get_text")]
    assert words.count("left3b") == 1
    assert not any(word.endswith("kg") for word in words)
    lines = str(sus.check(sus.parse(text))).splitlines()
    assert sum("left3b.1 to 4" in line for line in lines) == 1
    assert max(len(line) for line in lines) < 120
