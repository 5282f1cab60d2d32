"""Modes of many builds on nearly rigid wires, against eigenvalues in 60 digits."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from suspension_cli.analyses.tolerance.solve import RandomBuilds
from suspension_cli.analyses.xcouple.solve import CouplingRequest
from suspension_cli.design import reader
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import signals
from suspension_cli.studies import builds, sampling
from tests.support import scenes

WIRES = {"count": 4, "l": 0.4, "s": 0.02, "t1": 0.1, "t2": 0.1, "d": 0.004, "k": 1e15}

MP = mpmath.mp.clone()
MP.dps = 60


def exact(mass, stiffness):
    inverse = MP.inverse(MP.cholesky(MP.matrix(mass.tolist())))
    dynamic = inverse * MP.matrix(stiffness.tolist()) * inverse.T
    return np.array([float(v) for v in MP.eigsy(dynamic, eigvals_only=True)])


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
    """Frequencies of pendulums against eigenvalues in 60 digits of the same matrices, in which they
    are 1e-13 of the largest."""
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
        soft = squares < 1e-6 * squares[-1]
        assert soft.sum() >= 4
        assert np.sort(found["frequency"][n])[: soft.sum()] == pytest.approx(
            np.sqrt(squares[soft]) / (2 * np.pi), rel=1e-9
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
