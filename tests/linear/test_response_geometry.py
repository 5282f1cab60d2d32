"""Responses against 50-digit energies of finite motions, from the geometry alone: that the model's
own roundings do no harm either."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from suspension_cli.conventions import DOFS
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import response
from tests.support import geometry_mp, plants


@cache
def suspension(kind):
    return geometry_mp.Suspension(expand(plants.design(kind))).settle()


@pytest.mark.parametrize("kind", ["quadruple", "five"])
@pytest.mark.parametrize(
    ("frequency", "limit"), [(0.01, 1e-12), (0.1, 1e-12), (3.3, 1e-11), (100.0, 1e-10)]
)
def test_motions_of_the_support(kind, frequency, limit):
    """A slow support above all: of what it does to a body's orientation, nine digits cancel at 0.01
    Hz if everything is taken as rounded.

    Between the modes and above them the elements of K count as they are rounded, and where one
    nearly cancels some digits go with it.
    """
    model = plants.model(kind)
    expected = suspension(kind).carried(frequency)
    found = response.solve(
        model, np.array([frequency]), plants.moves(model), plants.all_motions(model)
    ).value[0]
    for row, values in zip(found, expected, strict=True):
        for dof, one, other in zip(DOFS, row, values, strict=True):
            # forbidden by symmetry, which the scene's rounded numbers keep to their last digit
            if one == 0:
                assert abs(other) < 1e-14, dof
            else:
                assert abs(geometry_mp.MP.mpf(float(one.real)) - other) < limit * abs(other), dof
