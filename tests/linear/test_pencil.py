"""Responses of hard designs against LU with pivoting in 80 bits, from the same numbers.

Errors are at most 1e-8 of each response, and of those below 1e-6 of what their body moves by (1 rad
counts as 1 m) 1e-14 of that. Rounding the model's numbers changes the smallest ones by as much.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from suspension_cli.design.reader import read
from suspension_cli.linear import response
from suspension_cli.models import registry
from tests.support import responses_80
from tests.support.golden import ROOT

REQUIRED = 1e-8
FAINT = 1e-6
FORBIDDEN = 1e-8
"""What rounding leaves, in the reference, of a response that a symmetry makes 0."""
DESIGNS = (
    "tower",
    "reaction-chain",
    "cryogenic-payload",
    "eight-stages",
    "pulled-fibres",
    "quadruple",
    "ligo-quad-2005",
    "triple-tolerance",
)
FREQUENCY = {"string": np.array([1e-3, 0.031, 0.7, 8.3, 410.0])}
FREQUENCY["beam"] = FREQUENCY["string"][::2]
pytestmark = pytest.mark.skipif(
    not responses_80.IS_WIDE, reason="numpy.longdouble is no wider than double here"
)


@cache
def system(name, level):
    return registry.by_name(level).system(read(ROOT / "configs" / f"{name}.toml").design)


def assert_promised(model, frequency, drives, *, acts):
    """All bodies' motions under drives (i, N), motions of the support or forces (`acts`)."""
    bodies, size = len(model.body), model.size
    acts = np.array([acts] * len(drives))
    omega = 2 * np.pi * np.asarray(frequency)
    rows = np.eye(size)[6 : 6 * (bodies + 1)]
    found, _ = response.transfer(model, omega, drives, acts.tolist(), rows)
    moves, forces = np.where(acts, 0.0, drives[:, :6].T), np.where(acts, drives.T, 0.0)
    for w, values in zip(omega, found, strict=True):
        exact = responses_80.solve(model, w, moves, forces)[6 : 6 * (bodies + 1)]
        error, own = np.abs(values - exact).astype(float), np.abs(exact).astype(float)
        moved = own.reshape(bodies, 6, -1).max(1)
        if not acts.all() and w < 2 * np.pi:
            rigid = np.abs(model.rigid[6 : 6 * (bodies + 1)]).reshape(bodies, 6, 6).max(1)
            moved = np.maximum(moved, rigid @ np.abs(moves))
        moved = np.repeat(moved, 6, axis=0)
        limit = np.where(values == 0, FORBIDDEN * moved, REQUIRED * np.maximum(own, FAINT * moved))
        assert (error <= limit).all(), (w / (2 * np.pi), (error / limit).max())


@pytest.mark.parametrize("level", FREQUENCY)
@pytest.mark.parametrize("name", DESIGNS)
def test_motions_of_the_support(name, level):
    model = system(name, level)
    assert_promised(model, FREQUENCY[level], np.eye(6, model.size), acts=False)


@pytest.mark.parametrize("level", FREQUENCY)
@pytest.mark.parametrize("name", ["reaction-chain", "eight-stages", "quadruple"])
def test_forces(name, level):
    """On the last body of the chain and the first, and at 0 Hz."""
    model = system(name, level)
    drives = np.eye(model.size)[
        [*range(6, 12), *range(6 * len(model.body), 6 * len(model.body) + 6)]
    ]
    assert_promised(model, [0.0, 0.01, 3.3, 100.0], drives, acts=True)


@pytest.mark.parametrize("level", FREQUENCY)
@pytest.mark.parametrize("name", ["quadruple", "eight-stages", "cryogenic-payload"])
def test_static(name, level):
    model = system(name, level)
    assert_promised(model, [0.0], np.eye(6, model.size), acts=False)


def test_nothing_lossy_is_real():
    """Without loss nothing is computed in complex numbers, so no imaginary part is left."""
    model = system("quadruple", "string").lossless
    omega = np.array([0.1, 10.0, 1000.0])
    found, _ = response.transfer(
        model, omega, np.eye(6, model.size), [False] * 6, np.eye(model.size)
    )
    assert found.any() and not np.imag(found).any()
