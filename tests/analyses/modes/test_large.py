"""Modes, drawing and check of designs with many bodies."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy.linalg

from suspension_cli.analyses.check.solve import solve as check
from suspension_cli.design.reader import Source, parse
from suspension_cli.drawing import draw
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import damped, eigenmodes, elastic_losses
from suspension_cli.models import registry
from tests.support.large_tower import large_tower


@pytest.mark.parametrize("symmetric", [True, False])
def test_frequencies_are_those_of_the_matrices(symmetric: bool) -> None:
    model = registry.STRING.system(parse(large_tower(5, 3, 12, symmetric=symmetric)))
    assert model.size == 6 + 6 * 17
    found = eigenmodes.solve(model)
    square = scipy.linalg.eigh(model.stiffness[6:, 6:], model.mass[6:, 6:], eigvals_only=True)
    assert found.omega_squared == pytest.approx(square, rel=1e-7)


def test_modes_of_a_system_are_solved_once() -> None:
    model = registry.STRING.system(parse(large_tower(2, 1, 4, symmetric=True)))
    assert eigenmodes.solve(model) is eigenmodes.solve(model.constant)


@pytest.fixture
def every_function(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Evaluate losses from the functions of all wires."""
    return lambda: monkeypatch.setattr(elastic_losses, "MANY", 10**6)


def test_combined_losses_leave_poles_unchanged(every_function: Callable[[], None]) -> None:
    model = registry.BEAM.system(parse(large_tower(2, 1, 4, symmetric=False)))
    still = eigenmodes.solve(model.constant)
    combined = damped.solve(model, still)
    every_function()
    whole = damped.solve(model, still)
    assert combined.omega_squared == pytest.approx(whole.omega_squared, rel=1e-13)
    assert combined.q == pytest.approx(whole.q, rel=1e-11)


def test_losses_outside_combined_functions_are_exact(
    every_function: Callable[[], None],
) -> None:
    model = registry.BEAM.system(parse(large_tower(3, 1, 0, symmetric=True)))
    size, group = model.size - 6, np.arange(6, model.size)
    parts = [
        (term, elastic_losses.transform(term.all_matrices, np.eye(size), group))
        for term in model.terms
    ]
    few = elastic_losses.ElasticLosses(np.zeros((size, size), complex), np.array([6.0]), parts)
    place, omega = np.arange(size), np.array([0.1, 6.0, 3e3])
    found = few.at(omega, place)
    every_function()
    whole = few.at(omega, place)
    assert np.abs(found - whole).max() < 1e-12 * np.abs(whole).max()
    for n, one in enumerate(few.rows(omega, place, np.array([0, 5, 9]))):
        assert one == pytest.approx(whole[n, [0, 5, 9][n]], rel=1e-12)
    assert few.diagonal(omega, place)[2] == pytest.approx(whole[2].diagonal(), rel=1e-12)


def test_drawing_and_check_of_many_bodies_stay_short() -> None:
    text = large_tower(5, 3, 12, symmetric=False)
    design = parse(text)
    figure = draw.draw(design, expand(design), tabulate=False)
    words = [text.get_text() for text in figure.findobj() if hasattr(text, "get_text")]
    assert words.count("left3b") == 1
    assert not any(word.endswith("kg") for word in words)
    lines = str(check(Source(design, text, ""))).splitlines()
    assert sum("left3b.1 to 4" in line for line in lines) == 1
    assert max(len(line) for line in lines) < 120
