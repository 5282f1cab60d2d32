"""Modes are paired one to one, by the largest sum of overlaps."""

from __future__ import annotations

import numpy as np

from suspension_cli.linear.mode_pairing import body_overlap, pair_by_overlap, pair_by_shape


def test_no_column_is_taken_twice():
    assert pair_by_overlap([[0.9, 0.8], [0.7, 0.1]]).tolist() == [1, 0]
    assert pair_by_overlap(np.eye(3)[[2, 0, 1]]).tolist() == [2, 0, 1]


def test_rows_left_over():
    assert pair_by_overlap([[0.9], [0.95], [0.1]]).tolist() == [-1, 0, -1]
    assert pair_by_overlap(np.zeros((2, 0))).tolist() == [-1, -1]


def test_permuted_shapes_are_found_again():
    rng = np.random.default_rng(3)
    shapes = np.linalg.qr(rng.normal(size=(8, 8)))[0]
    order = rng.permutation(8)
    choice, overlap = pair_by_shape(shapes, -shapes[order])
    assert (order[choice] == np.arange(8)).all()
    np.testing.assert_allclose(overlap, 1.0)
    np.testing.assert_allclose(body_overlap(shapes, shapes, np.eye(8)), np.eye(8), atol=1e-14)
