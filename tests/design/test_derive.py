"""Inertia of shapes, stiffness of blades and wires: formulas against the integrals that they stand
for."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from suspension_cli.design import bodies, derive
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import eigenmodes
from suspension_cli.models import string as string_model
from tests.support import paper, scenes

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(24)


def between(low, high):
    """Gauss-Legendre nodes and weights on an interval."""
    return (high + low) / 2 + (high - low) / 2 * POINTS, (high - low) / 2 * WEIGHTS


def tensor(points, weights, density):
    """Mass and inertia of a cloud of weighted points."""
    square = (points**2).sum(-1)
    matrix = np.einsum("n,n,ij->ij", weights, square, np.eye(3)) - np.einsum(
        "n,ni,nj->ij", weights, points, points
    )
    return density * weights.sum(), density * matrix


def box_cloud(size):
    axes = [between(-side / 2, side / 2) for side in size]
    points = np.array(list(itertools.product(*(nodes for nodes, _ in axes))))
    weights = np.array([np.prod(w) for w in itertools.product(*(w for _, w in axes))])
    return points, weights


def cylinder_cloud(radius, inner, length, axis):
    radii, rw = between(inner, radius)
    angles, aw = between(0, 2 * np.pi)
    heights, hw = between(-length / 2, length / 2)
    r, a, h = (grid.ravel() for grid in np.meshgrid(radii, angles, heights, indexing="ij"))
    weights = np.einsum("i,j,k->ijk", rw * radii, aw, hw).ravel()
    points = np.stack([h, r * np.cos(a), r * np.sin(a)], -1)  # axis along x
    return np.roll(points, "xyz".index(axis), axis=1), weights


def body_of(**keys):
    return (
        scenes.design_of(
            scenes.raw_of({"name": "test", "body": keys, "wires": {"count": 1, "l": 0.3, "k": 1e4}})
        )
        .stage[0]
        .body
    )


@pytest.mark.parametrize("size", [(0.1, 0.2, 0.3), (0.5, 0.02, 0.11)])
def test_box(size):
    mass, inertia = tensor(*box_cloud(size), 2700.0)
    body = body_of(shape="box", size=size, density=2700.0)
    assert bodies.body_mass(body) == pytest.approx(mass, rel=1e-13)
    np.testing.assert_allclose(
        bodies.body_inertia(body), inertia, rtol=1e-12, atol=1e-12 * inertia.max()
    )
    heavier = body_of(shape="box", size=size, mass=2 * mass)
    np.testing.assert_allclose(
        bodies.body_inertia(heavier), 2 * inertia, rtol=1e-12, atol=1e-12 * inertia.max()
    )


@pytest.mark.parametrize("axis", ["x", "y", "z"])
@pytest.mark.parametrize("inner", [0.0, 0.06])
def test_cylinder(axis, inner):
    mass, inertia = tensor(*cylinder_cloud(0.09, inner, 0.10, axis), 2200.0)
    keys = {"shape": "cylinder", "axis": axis, "radius": 0.09, "length": 0.10, "density": 2200.0}
    body = body_of(**keys, **({"inner_radius": inner} if inner else {}))
    assert bodies.body_mass(body) == pytest.approx(mass, rel=1e-12)
    np.testing.assert_allclose(
        bodies.body_inertia(body), inertia, rtol=1e-11, atol=1e-11 * inertia.max()
    )


BLADE = {"length": 0.25, "base_width": 0.06, "thickness": 2e-3}


@pytest.mark.parametrize(
    ("shape_factor", "width"),
    [(1.0, lambda x: 1.0 + 0 * x), (1.5, lambda x: x)],
    ids=["rectangular", "triangular"],
)
def test_cantilever(shape_factor, width):
    """Tip deflection per force: the integral of x^2 / (E I(x)) from the tip to the clamp (Euler and
    Bernoulli)."""
    modulus = 1.87e11
    x, w = between(0.0, BLADE["length"])
    second_moment = BLADE["base_width"] * width(x / BLADE["length"]) * BLADE["thickness"] ** 3 / 12
    compliance = (w * x**2 / (modulus * second_moment)).sum()
    blade = derive.BladeGeometry(shape_factor=shape_factor, material="maraging", **BLADE)
    assert derive.cantilever_stiffness(blade, modulus) == pytest.approx(1 / compliance, rel=1e-12)


def bladed(**blades):
    wires = {"count": 4, "l": 0.3, "s": 0.03, "t1": 0.1, "t2": 0.1, "d": 0.002, "k": 1e12}
    return scenes.design_of(
        scenes.raw_of({"name": "test", "body": paper.BODY, "wires": wires, "blades": blades})
    )


@pytest.mark.parametrize("count", [2, 4])
def test_uncoupled_frequency(count):
    """On stiff wires, the stage's mass bounces on its blades at just that frequency."""
    design = bladed(count=count, uncoupled_frequency=2.5)
    found = eigenmodes.solve(string_model.linear_model(expand(design)))
    assert found.of("z") == pytest.approx([2.5], rel=1e-6)
    assert expand(design).blades.stiffness[:, 2] == pytest.approx(
        (2 * np.pi * 2.5) ** 2 * 20.0 / count, rel=1e-14
    )


def test_wire_from_its_section():
    """k = E A / l of the loaded length, for a round wire and for a ribbon; k overrides it."""
    base = {"count": 4, "l": 0.5, "s": 0.02, "t1": 0.1, "t2": 0.1, "material": "steel302"}
    sections = {
        "round": ({"radius": 150e-6}, np.pi * 150e-6**2),
        "ribbon": ({"section": {"width": 1e-3, "thickness": 1e-4}}, 1e-7),
    }
    for given, area in sections.values():
        design = scenes.design_of(
            scenes.raw_of({"name": "test", "body": paper.BODY, "wires": base | given})
        )
        assert expand(design).wires.stiffness == pytest.approx(1.7e11 * area / 0.5, rel=1e-14)
    design = scenes.design_of(
        scenes.raw_of(
            {"name": "test", "body": paper.BODY, "wires": base | {"radius": 1e-4, "k": 123.0}}
        )
    )
    assert expand(design).wires.stiffness == pytest.approx(123.0)
