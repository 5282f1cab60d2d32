"""Clamps of wires of which the design gives the effective bending points."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from tests.support.scenes import design_of

MASS, GRAVITY, MODULUS, RADIUS = 4.0, 9.81, 2.1e11, 2e-4
TENSION = MASS * GRAVITY / 4
REACH = np.sqrt(MODULUS * np.pi * RADIUS**4 / 4 / TENSION)
"""Distance from a clamp to the effective bending point, sqrt(E I / T), m."""
STIFFNESS = 1e5


def frequencies(level, clamp, *perturbation):
    """Modes of a body on four vertical wires, whose ends are the bending points or the clamps."""
    beyond = 0.0 if clamp == "bending-point" else REACH
    wires = [
        {
            "upper": [x, y, beyond],
            "lower": [x, y, 5e-3 - beyond],
            "material": "hard",
            "radius": RADIUS,
            "k": STIFFNESS,
            "clamp": clamp,
        }
        for x in (-0.02, 0.02)
        for y in (-0.05, 0.05)
    ]
    raw = {
        "design": {"name": "clamps"},
        "materials": {"hard": {"youngs_modulus": MODULUS, "poisson_ratio": 0.3, "density": 7800.0}},
        "constants": {"gravity": GRAVITY},
        "stage": [
            {
                "name": "test",
                "body": {"mass": MASS, "inertia": [0.01, 0.012, 0.014]},
                "position": [0.0, 0.0, -0.305],
                "wire": wires,
            }
        ],
        "perturbation": list(perturbation),
    }
    return eigenmodes.solve(registry.by_name(level).system(design_of(raw))).frequency


@pytest.mark.parametrize("level", ["beam", "violin"])
@pytest.mark.parametrize(
    "error",
    [
        {"length_change": 2e-5},
        {"length_change": -4e-5},
        {"k_factor": 1.1},
        {"upper_offset": [0.0, 0.0, 2e-5], "hold": "natural-length"},
    ],
    ids=["longer", "shorter", "stiffer", "raised"],
)
def test_imperfections_do_not_move_clamps(level, error):
    """A wire too long pulls less: its bending point moves, its clamps stay where they are.

    So builds of a design that gives the bending points are those of one that gives the clamps.
    """
    error = {"wire": "test.1", **error}
    known = frequencies(level, "wire", error)
    np.testing.assert_allclose(frequencies(level, "bending-point", error), known, rtol=2e-7)
    assert np.abs(known / frequencies(level, "wire") - 1).max() > 1e-6
