"""Soft modes next to stiff ones: all digits that the matrices hold, and an honest estimate of those
that they do not."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from suspension_cli.analyses.tolerance.solve import RandomBuilds
from suspension_cli.analyses.xcouple.solve import CouplingRequest
from suspension_cli.design import reader
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import batch_modes, eigenmodes, graded_eigenvalues, signals
from suspension_cli.models import registry
from suspension_cli.studies import builds, sampling, variants
from tests.support import plants, scenes

WIRES = {"count": 4, "l": 0.4, "s": 0.02, "t1": 0.1, "t2": 0.1, "d": 0.004, "k": 1e15}

MP = mpmath.mp.clone()
MP.dps = 60


def exact(mass, stiffness):
    inverse = MP.inverse(MP.cholesky(MP.matrix(mass.tolist())))
    return np.array(
        [
            float(v)
            for v in MP.eigsy(
                inverse * MP.matrix(stiffness.tolist()) * inverse.T, eigvals_only=True
            )
        ]
    )


def graded_matrix(rng, size, spread):
    """A stiffness whose rows are scaled over `spread` powers of ten and that is well conditioned
    but for that, some modes unstable."""
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
        values, shapes = graded_eigenvalues.solve(mass, stiffness)
        assert (np.diff(values) >= 0).all()
        wanted = exact(mass, stiffness)
        assert (
            np.abs(values - wanted)
            <= 4 * graded_eigenvalues.EPS / graded_eigenvalues.APART * np.abs(wanted)
        ).all()
        assert np.abs(shapes.T @ mass @ shapes - np.eye(8)).max() < 1e-12


def test_shapes_belong_to_their_eigenvalues():
    stiffness, mass = graded_matrix(np.random.default_rng(1), 6, 12), np.eye(6)
    values, shapes = graded_eigenvalues.solve(mass, stiffness)
    assert np.einsum("im,ij,jm->m", shapes, stiffness, shapes) == pytest.approx(values, rel=1e-12)


@pytest.mark.parametrize("kind", ["single", "triple", "quadruple", "five"])
def test_ordinary_designs_lose_nothing(kind):
    model = plants.model(kind)
    found = eigenmodes.solve(model)
    assert (
        graded_eigenvalues.relative_error_bound(model, found.omega_squared, found.shape).max()
        < 1e-11
    )


def test_a_rigid_mode_has_no_digits():
    body = {"mass": 5.6, "inertia": [0.02, 0.018, 0.017]}
    model = registry.STRING.system(
        scenes.design_of(
            scenes.raw_of(
                {"name": "test", "body": body, "wires": {"count": 1, "l": 0.4, "d": 0.01, "k": 2e4}}
            )
        )
    )
    found = eigenmodes.solve(model)
    assert found.omega_squared[0] == 0
    assert (
        graded_eigenvalues.relative_error_bound(model, found.omega_squared, found.shape)[0]
        == np.inf
    )


STIFF = {
    "design": {"name": "stiff"},
    "stage": [
        {
            "name": "upper",
            "body": {"mass": 6.0, "inertia": [0.02, 0.018, 0.017]},
            "wires": WIRES | {"d_upper": 0.0},
        },
        {
            "name": "test",
            "body": {"mass": 5.6, "inertia": [0.02, 0.018, 0.017]},
            "wires": WIRES | {"d_upper": 0.004},
        },
    ],
    "tolerance": {
        "wire": [{"stage": "test", "k": {"normal": 0.1}}],
        "body": [{"stage": "test", "inertia": {"normal": 0.05}}],
    },
}
"""Wires 1e13 times stiffer along than across; what scatters leaves all in place."""


def test_random_builds_of_nearly_rigid_wires():
    """Frequencies of the batch against eigenvalues in 60 digits of the same matrices: those of
    pendulums are 1e-13 of the largest."""
    design = scenes.design_of(STIFF)
    known = ("support", "upper", "test")
    requested = CouplingRequest(
        0,
        2,
        "loaded-length",
        signals.parse_input("support.z", known),
        signals.parse_output("test.x", known),
        signals.parse_output("test.z", known),
        frequency=(50.0,),
    )
    job = RandomBuilds(reader.write_toml(scenes.plain(STIFF)), 40, 3, requested)
    found = job.compute(0, 40)
    assert not found["status"].any()
    model = builds.balance(
        sampling.imperfect(expand(design), job.factors, job.deviations(0, 40)), design
    ).model
    for n in range(0, 40, 8):
        squares = exact(model.mass[n, 6:, 6:], model.stiffness[n, 6:, 6:])
        assert squares[0] / squares[-1] < 1e-13
        assert np.sort(found["frequency"][n]) == pytest.approx(
            np.sqrt(squares) / (2 * np.pi), rel=1e-9
        )
    plain = np.array(
        [
            np.linalg.eigvalsh(np.linalg.solve(m, k))
            for m, k in zip(model.mass[:, 6:, 6:], model.stiffness[:, 6:, 6:], strict=True)
        ]
    )
    # what one solver alone makes of them
    assert (
        np.abs(np.sqrt(np.abs(plain[:, 0])) / (2 * np.pi) / found["frequency"].min(1) - 1).max()
        > 1e-3
    )


def test_a_sweep_to_nearly_rigid_wires():
    """Each point by the batched solver as the single one has it, from ordinary wires on."""
    values = np.geomspace(1e4, 1e15, 12)
    text = reader.write_toml(
        scenes.plain({key: value for key, value in STIFF.items() if key != "tolerance"})
    )
    [(found, here)] = variants.balanced(text, {"stage.test.wires.k": values}, "string")
    batch = batch_modes.solve(found.model).omega_squared
    for n, place in enumerate(here):
        design = variants.overridden(text, {"stage.test.wires.k": values[place]})
        assert batch[n] == pytest.approx(
            eigenmodes.solve(registry.STRING.system(design)).omega_squared, rel=2e-9
        )
