"""Modes, drawing and check of designs with many bodies."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg

import suspension_cli as sus
from suspension_cli.design.reader import parse
from suspension_cli.drawing import draw
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import damped, eigenmodes
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from tests.support import terms
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


def test_poles_are_roots_of_the_matrices() -> None:
    """Singular values of Z(s), with coordinates scaled to 1, at poles of bending wires."""
    model = registry.BEAM.system(parse(large_tower(3, 1, 4, symmetric=False)))
    found = damped.solve(model)
    omega = np.sqrt(found.omega_squared - found.decay_rate**2)
    assert len(omega) == model.size - 6
    for s in (-found.decay_rate + 1j * omega)[::5]:
        here, beside = (_least_singular_value(model, s * factor) for factor in (1, 1 + 1e-4))
        assert here < 1e-6 * beside


def _least_singular_value(model: LinearSystem, s: complex) -> float:
    dynamic = model.stiffness + s * model.damping + s**2 * model.mass
    for term in model.terms:
        at = np.ix_(term.columns, term.columns)
        dynamic[at] += terms.stiffness(term, s.imag)
    scale = np.sqrt(np.abs(s**2 * model.mass.diagonal()) + model.stiffness.diagonal())[6:]
    return float(np.linalg.svd(dynamic[6:, 6:] / np.outer(scale, scale), compute_uv=False)[-1])


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
