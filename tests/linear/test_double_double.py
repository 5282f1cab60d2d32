"""Products of matrices in double-double arithmetic against exact rational numbers."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from suspension_cli.linear import double_double
from suspension_cli.linear.double_double import DoubleDouble
from suspension_cli.linear.stretching import Stretching


def _exact(number: Any, place: tuple[int, int]) -> Fraction:
    return Fraction(float(number.high[place])) + Fraction(float(number.low[place]))


@pytest.mark.parametrize("decades", [0, 6, 12])
def test_sliced_product(decades: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where elements of one row differ by many orders of magnitude."""
    monkeypatch.setattr(double_double, "LARGE", 0)
    rng = np.random.default_rng(decades)

    def graded(shape: tuple[int, int]) -> DoubleDouble:
        high = rng.standard_normal(shape) * 10 ** rng.uniform(-decades, decades, shape)
        return DoubleDouble(high, 1e-17 * high * rng.standard_normal(shape))

    a, b = graded((3, 150)), graded((150, 4))
    product = a @ b
    for place in np.ndindex(3, 4):
        terms = [_exact(a, (place[0], k)) * _exact(b, (k, place[1])) for k in range(150)]
        assert abs(_exact(product, place) - sum(terms)) < 1e-31 * sum(abs(term) for term in terms)


def test_stretching_added() -> None:
    """Wires that share coordinates, and elements that a symmetry forbids."""
    rng = np.random.default_rng(3)
    form = np.where(rng.random((9, 7)) < 0.5, rng.standard_normal((9, 7)), 0.0)
    allowed = np.ones((7, 7), dtype=bool)
    allowed[2, 5] = allowed[5, 2] = False
    stiffness = 10 ** rng.uniform(3, 9, 9)
    wires = Stretching(form, 1e-17 * form, stiffness, allowed, np.zeros((7, 7)))
    start = DoubleDouble.of(np.diag(rng.random(7)))
    total = wires.added(start, stiffness)
    assert (total.high == total.high.T).all()
    for i, j in np.ndindex(7, 7):
        terms = [
            Fraction(float(k))
            * _exact(DoubleDouble(form, wires.low), (w, i))
            * _exact(DoubleDouble(form, wires.low), (w, j))
            for w, k in enumerate(stiffness)
        ]
        expected = _exact(start, (i, j)) + (sum(terms) if allowed[i, j] else 0)
        assert abs(_exact(total, (i, j)) - expected) <= 1e-30 * (1 + sum(map(abs, terms)))
