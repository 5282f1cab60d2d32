"""Body-by-body elimination against LAPACK: chains, trees and loops, real and complex, some
of whose parts are singular."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from suspension_cli import elimination

SHAPES = {
    "chain": (-1, 0, 1, 2),
    "tree": (-1, 0, 0, 1, 1),
    "two roots": (-1, -1, 0, 1),
    "two": (-1, 0),
}


def solve(matrix, rhs, pattern):
    return pattern.solve(matrix[pattern.row, pattern.column], rhs)


def systems(rng, parent, sizes, count, *, lossy):
    """Symmetric matrices (c, c, P), diagonally dominant, with their owners and couplings."""
    place = np.repeat(np.arange(len(sizes)), sizes)
    coupled = (
        (place[:, None] == place)
        | (np.array(parent)[place][:, None] == place)
        | (place[:, None] == np.array(parent)[place])
    )
    matrix = rng.normal(size=(len(place), len(place), count))
    if lossy:
        matrix = matrix + 0.1j * rng.normal(size=matrix.shape)
    matrix = (matrix + np.swapaxes(matrix, 0, 1)) * coupled[..., None]
    return (
        matrix + 10 * np.eye(len(place))[..., None] * rng.choice([-1, 1], (len(place), 1, 1)),
        place,
        coupled,
    )


def residual(matrix, x, rhs):
    """|A x - b| as a share of |A| |x| + |b|, elementwise: the backward error."""
    left = np.einsum("abp,bkp->akp", matrix, x) - rhs
    return (
        np.abs(left) / (np.einsum("abp,bkp->akp", np.abs(matrix), np.abs(x)) + np.abs(rhs) + 1e-300)
    ).max()


@pytest.mark.parametrize("lossy", [False, True])
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(
    "sizes", [(1, 1, 1, 1, 1), (2, 2, 2, 2, 2), (3, 1, 2, 6, 1), (5, 4, 6, 3, 2)]
)
def test_is_the_dense_solution(shape, sizes, lossy):
    parent = SHAPES[shape]
    rng = np.random.default_rng([1, len(parent), sum(sizes), lossy])
    matrix, owner, coupled = systems(rng, parent, sizes[: len(parent)], 50, lossy=lossy)
    pattern = elimination.by_body(owner, coupled)
    # in a chain or tree nothing fills in
    assert pattern.start[-1] == np.triu(coupled).sum()
    rhs = rng.normal(size=(len(owner), 3, 50))
    rhs[: sizes[0]] = 0.0
    # one that drives the last leaf alone
    rhs[:, 0] *= owner[:, None] == len(parent) - 1
    found = solve(matrix, rhs, pattern)
    expected = np.moveaxis(
        np.linalg.solve(np.moveaxis(matrix, -1, 0), np.moveaxis(rhs, -1, 0)), 0, -1
    )
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)
    assert residual(matrix, found, rhs) < 1e-14
    assert np.array_equal(found, solve(matrix, rhs, pattern))


@pytest.mark.parametrize("lossy", [False, True])
def test_a_loop_fills_in(lossy):
    """Four bodies in a ring: eliminating one couples its neighbours."""
    rng = np.random.default_rng(7)
    matrix, owner, coupled = systems(rng, (-1, 0, 1, 2), (2, 2, 2, 2), 20, lossy=lossy)
    matrix[:2, 6:] = rng.normal(size=(2, 2, 20))
    matrix[6:, :2] = matrix[:2, 6:].swapaxes(0, 1)
    pattern = elimination.by_body(owner, matrix.any(-1))
    assert pattern.order.tolist() == [6, 7, 4, 5, 2, 3, 0, 1]
    assert pattern.start[-1] == np.triu(coupled).sum() + 4 + 4
    rhs = rng.normal(size=(8, 2, 20))
    found = solve(matrix, rhs, pattern)
    assert residual(matrix, found, rhs) < 1e-14


@pytest.mark.parametrize("lossy", [False, True])
@pytest.mark.parametrize("offset", [0.0, 1e-15, 1e-12, 1e-8, 1e-5, 1e-3])
@pytest.mark.parametrize("size", [1, 2, 3, 5])
def test_nearly_singular_parts(size, offset, lossy):
    """A child that resonates alone, next to systems in which it does not; the whole is well
    conditioned."""
    rng = np.random.default_rng([2, size])
    matrix, owner, coupled = systems(rng, (-1, 0, 1), (size,) * 3, 40, lossy=lossy)
    leaf = slice(2 * size, 3 * size)
    for p in range(0, 40, 3):
        vector = np.zeros(size)
        vector[p % size] = 1.0
        block = matrix[leaf, leaf, p]
        block[:, p % size] = block[p % size] = 0.0
        block += offset * np.outer(vector, vector)
    rhs = rng.normal(size=(3 * size, 2, 40))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = solve(matrix, rhs, elimination.by_body(owner, coupled))
    assert np.linalg.cond(np.moveaxis(matrix, -1, 0)).max() < 1e4
    assert residual(matrix, found, rhs) < 1e-13


def test_a_part_that_takes_up_too_much_is_solved_densely(monkeypatch):
    """A pivot of 0 leaves no digits; corrections restore what one of 1e-13 costs, which leaves 3. A
    solution with pivoting is corrected once too."""
    counted = []
    original = elimination.dense
    monkeypatch.setattr(
        elimination,
        "dense",
        lambda matrix, rhs: counted.append(matrix.shape[-1]) or original(matrix, rhs),
    )
    leaf = np.array([0.0, 1e-13, 0.5, 2.0])
    matrix = np.array([[np.full(4, 1.3), np.ones(4)], [np.ones(4), leaf]])
    rhs = np.array([[np.ones(4)], [np.full(4, 0.7)]])
    pattern = elimination.by_body(np.arange(2), np.ones((2, 2), dtype=bool))
    found = solve(matrix, rhs, pattern)
    assert counted == [1, 1]
    np.testing.assert_allclose(found[0, 0], (leaf - 0.7) / (1.3 * leaf - 1), rtol=4e-15)
    units = np.array([2.0**20, 2.0**-20])  # in other units the choice is the same
    solve(matrix * units[:, None, None] * units[:, None], rhs * units[:, None, None], pattern)
    assert counted == [1, 1, 1, 1]


@pytest.mark.parametrize("size", [1, 2, 3])
@pytest.mark.parametrize("whole", [False, True])
def test_singular_to_the_last_bit_gives_no_number(size, whole):
    """Only the system at fault; no warning and no exception."""
    rng = np.random.default_rng(3)
    count = 1 if whole else 2
    matrix, owner, coupled = systems(rng, (-1, 0)[:count], (size,) * count, 5, lossy=False)
    matrix[0, :, 2] = matrix[:, 0, 2] = 0.0
    rhs = rng.normal(size=(len(owner), 2, 5))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = solve(matrix, rhs, elimination.by_body(owner, coupled))
    finite = np.isfinite(found).all((0, 1))
    assert finite.tolist() == [True, True, False, True, True]
    good = [0, 1, 3, 4]
    assert residual(matrix[..., good], found[..., good], rhs[..., good]) < 1e-14
