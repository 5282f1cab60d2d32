"""What `check` prints of heavy wires and of measured profiles."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import solve_banded

import suspension_cli as sus
from suspension_cli.analyses.check import profiles
from suspension_cli.design import materials
from tests.support.golden import CONFIGS

FILE = CONFIGS / "pulled-fibres.toml"


def test_weight_sag_and_profile():
    found = sus.check(sus.read(FILE))
    own, [profile] = found.weights, found.profiles
    assert own.included and 0.05 < own.total < 0.07
    load = found.statics.wires[0]
    weight = 9.81 * 7800 * math.pi * 350e-6**2 * 0.5
    assert own.ratio == pytest.approx(weight / load.tension, rel=0.05)
    assert own.sag == pytest.approx(weight * 0.04 / (8 * load.tension), rel=0.05)
    assert own.line in str(found) and profile.line in str(found)
    assert profile.stretching_change < profile.bending_change < profile.allowed == 3e-3
    document = found.document()
    assert document["wire_weight"]["total_n"] == own.total
    assert document["profiles"][0]["places"] == 281
    light = sus.check(sus.example("quadruple"))
    assert light.weights.line == "" and "wire_weight" not in light.document()


def test_heavy_wires_that_are_left_out_are_told():
    light = sus.template("single").replace({"stage.test.body.mass": 0.05})
    assert "constants.wire_weight = true includes" in str(sus.check(light))


def test_reduced_profile_against_finite_elements():
    """Static stiffness of the measured fibre with linear elements of the slope f = w'.

    (E I f')' - T f = const, with the mean of f given by the shift of one end, extrapolated from two
    meshes (Richardson).
    """
    design = sus.read(FILE).design
    [stage] = [stage for stage in design.stage if stage.wires.profile]
    own, found = stage.wires.profile, sus.check(sus.read(FILE))
    number = [w.label for w in found.statics.wires].index(f"{stage.name}.1")
    tension, length = found.statics.wires[number].tension, found.statics.wires[number].length
    modulus = materials.resolve(design, stage.wires.material).youngs_modulus
    z = np.array(own.position) - own.position[0]
    coarse, fine = (
        slope_elements(z * length / z[-1], own.diameter, modulus, tension, n) for n in (6000, 12000)
    )
    exact = fine + (fine - coarse) / 3
    reduced, _ = profiles._stiffness(design, number, tension)
    scale = np.sqrt(np.diag(exact))
    change = (abs(reduced[np.ix_([1, 3, 2], [1, 3, 2])] - exact) / np.outer(scale, scale)).max()
    assert found.profiles[0].bending_change == pytest.approx(change, rel=0.15)


def slope_elements(z, d, modulus, tension, count):
    """Stiffness (3, 3) against the slopes of the ends and the shift of one."""
    x = np.linspace(z[0], z[-1], count + 1)
    h = x[1] - x[0]
    rigid = modulus * np.pi / 64 * np.interp((x[1:] + x[:-1]) / 2, z, d) ** 4
    diagonal, beside = np.zeros(count + 1), -rigid / h + tension * h / 6
    diagonal[1:] += rigid / h + tension * h / 3
    diagonal[:-1] += rigid / h + tension * h / 3
    band = np.zeros((3, count - 1))
    band[0, 1:], band[1], band[2, :-1] = beside[1:-1], diagonal[1:-1], beside[1:-1]
    weight = np.full(count + 1, h)
    weight[[0, -1]] = h / 2
    right = np.zeros((count - 1, 3))
    right[0, 0], right[-1, 1], right[:, 2] = beside[0], beside[-1], weight[1:-1]
    inner = solve_banded((1, 1), band, right)
    moved = weight[[0, -1]] - right[:, :2].T @ inner[:, 2]
    give = weight[1:-1] @ inner[:, 2]
    k = np.zeros((3, 3))
    k[:2, :2] = np.diag(diagonal[[0, -1]]) - right[:, :2].T @ inner[:, :2]
    k[:2, :2] += np.outer(moved, moved) / give
    k[:2, 2] = k[2, :2] = -moved / give
    k[2, 2] = 1 / give
    return k
