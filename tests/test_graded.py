"""Soft modes next to stiff ones: all digits that the matrices hold, and an honest estimate of those that they do not."""

from __future__ import annotations

import mpmath
import numpy as np
import plants
import pytest

from suspension_cli.analysis import graded, modes

MP = mpmath.mp.clone()
MP.dps = 60


def exact(mass, stiffness):
    inverse = MP.inverse(MP.cholesky(MP.matrix(mass.tolist())))
    return np.array([float(v) for v in MP.eigsy(inverse * MP.matrix(stiffness.tolist()) * inverse.T, eigvals_only=True)])


def graded_matrix(rng, size, spread):
    """A stiffness whose rows are scaled over `spread` powers of ten and that is well conditioned but for that, some modes unstable."""
    core = rng.normal(size=(size, size))
    core = core @ core.T / size + np.eye(size)
    core[0] *= -1
    core = (core + core.T) / 2
    scale = 10.0 ** np.linspace(0, spread / 2, size)
    return core * scale[:, None] * scale


@pytest.mark.parametrize("spread", [2, 8, 14, 20])
def test_every_eigenvalue_keeps_its_digits(spread):
    rng = np.random.default_rng(spread)
    for _ in range(5):
        stiffness = graded_matrix(rng, 8, spread)
        mass = np.diag(rng.uniform(0.5, 2.0, 8))
        values, shapes = graded.solve(mass, stiffness)
        assert (np.diff(values) >= 0).all()
        wanted = exact(mass, stiffness)
        assert (np.abs(values - wanted) <= 4 * graded.EPS / graded.APART * np.abs(wanted)).all()
        assert np.abs(shapes.T @ mass @ shapes - np.eye(8)).max() < 1e-12


def test_shapes_belong_to_their_eigenvalues():
    stiffness, mass = graded_matrix(np.random.default_rng(1), 6, 12), np.eye(6)
    values, shapes = graded.solve(mass, stiffness)
    assert np.einsum("im,ij,jm->m", shapes, stiffness, shapes) == pytest.approx(values, rel=1e-12)


@pytest.mark.parametrize("kind", ["single", "triple", "quadruple", "five"])
def test_ordinary_designs_lose_nothing(kind):
    model = plants.model(kind)
    found = modes.solve(model)
    assert graded.lost(model, found.omega_squared, found.shape).max() < 1e-11


def test_a_rigid_mode_has_no_digits():
    from scenes import design_of, raw_of

    from suspension_cli.models import fidelity

    body = {"mass": 5.6, "inertia": [0.02, 0.018, 0.017]}
    model = fidelity.linear_model(design_of(raw_of({"name": "test", "body": body, "wires": {"count": 1, "l": 0.4, "d": 0.01, "k": 2e4}})), "string")
    found = modes.solve(model)
    assert found.omega_squared[0] == 0
    assert graded.lost(model, found.omega_squared, found.shape)[0] == np.inf
