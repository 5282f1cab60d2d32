"""The general string model against a Lagrangian written down from nothing but energies.

One mass hangs on four linear springs from a support that can move. Both are turned by finite
rotations; the potential energy is m g z plus k (L - L0)^2 / 2 for every wire, the kinetic energy
that of a rigid body. SymPy differentiates; no formula of the package is used.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import sympy as sp

from suspension_cli.equilibrium.nominal import expand
from suspension_cli.models import string
from tests.support import scenes

GRAVITY = 9.81
MASS, K, INERTIA = 7.5, 2.6e4, (0.061, 0.048, 0.055)

GEOMETRIES = {
    "vertical": {
        "l": 0.27,
        "s_upper": 0.04,
        "s_lower": 0.04,
        "t1": 0.133,
        "t2": 0.133,
        "d": 0.0,
        "d_upper": 0.0,
    },
    "angled in y": {
        "l": 0.26,
        "s_upper": 0.025,
        "s_lower": 0.025,
        "t1": 0.047,
        "t2": 0.133,
        "d": 0.0,
        "d_upper": 0.0,
    },
    "angled in y, raised": {
        "l": 0.36,
        "s_upper": 0.025,
        "s_lower": 0.025,
        "t1": 0.0,
        "t2": 0.133,
        "d": 0.032,
        "d_upper": 0.0,
    },
    "angled in x": {
        "l": 0.31,
        "s_upper": 0.06,
        "s_lower": 0.015,
        "t1": 0.08,
        "t2": 0.08,
        "d": 0.004,
        "d_upper": 0.007,
    },
    "angled in both": {
        "l": 0.42,
        "s_upper": 0.011,
        "s_lower": 0.052,
        "t1": 0.15,
        "t2": 0.07,
        "d": -0.003,
        "d_upper": 0.012,
    },
    "crossed in y": {
        "l": 0.55,
        "s_upper": 0.03,
        "s_lower": 0.08,
        "t1": 0.02,
        "t2": 0.12,
        "d": 0.021,
        "d_upper": -0.004,
    },
}

Q = sp.symbols("X Y Z A B C x y z a b c")
"""Displacement and rotation of the support, then of the mass."""


def turned(a, b, c):
    """A finite rotation: about x, then y, then z."""
    return sp.rot_ccw_axis3(c) * sp.rot_ccw_axis2(b) * sp.rot_ccw_axis1(a)


@cache
def wire():
    """S = L^2 of one wire with its first and second derivatives at rest, as functions of its
    ends."""
    p, r, drop = sp.symbols("p0:3"), sp.symbols("r0:3"), sp.Symbol("drop")
    rest = dict.fromkeys(Q, sp.Integer(0))

    def square(*alive):
        """S with all but some coordinates at rest."""
        q = [one if one in alive else sp.Integer(0) for one in Q]
        upper = sp.Matrix(q[:3]) + turned(*q[3:6]) * sp.Matrix(p)
        lower = sp.Matrix([0, 0, -drop]) + sp.Matrix(q[6:9]) + turned(*q[9:]) * sp.Matrix(r)
        span = lower - upper
        return span.dot(span)

    first = [sp.diff(square(q), q).xreplace(rest) for q in Q]
    second = [
        [
            sp.diff(square(q, other), q, other).xreplace(rest) if i <= j else 0
            for j, other in enumerate(Q)
        ]
        for i, q in enumerate(Q)
    ]
    return sp.lambdify([p, r, drop], (square(), first, second), "numpy")


@cache
def spring():
    """Derivatives of k (sqrt(S) - L0)^2 / 2 in S."""
    square, k, natural = sp.symbols("S k L0", positive=True)
    energy = k * (sp.sqrt(square) - natural) ** 2 / 2
    return sp.lambdify(
        [square, k, natural], (sp.diff(energy, square), sp.diff(energy, square, 2)), "numpy"
    )


def wire_energy(upper, lower, drop, natural):
    """Gradient and Hessian of one wire's energy E(S): E' dS and E'' dS dS + E' d2S."""
    square, first, second = (np.array(part, dtype=float) for part in wire()(upper, lower, drop))
    one, two = spring()(square, K, natural)
    second = second + np.triu(second, 1).T
    return one * first, two * np.outer(first, first) + one * second


def derived_stiffness(g):
    height = np.sqrt(g["l"] ** 2 - (g["t2"] - g["t1"]) ** 2 - (g["s_lower"] - g["s_upper"]) ** 2)
    natural = g["l"] - MASS * GRAVITY * g["l"] / (4 * height) / K
    gradient, hessian = np.zeros(12), np.zeros((12, 12))
    gradient[8] = MASS * GRAVITY  # of m g z
    for i in (1, -1):
        for j in (1, -1):
            upper = (i * g["s_upper"], j * g["t1"], -g["d_upper"])
            lower = (i * g["s_lower"], j * g["t2"], g["d"])
            one, two = wire_energy(upper, lower, g["d_upper"] + height + g["d"], natural)
            gradient += one
            hessian += two
    return gradient, hessian


@cache
def derived_mass():
    """Hessian of the kinetic energy in the rates of the body's six coordinates, at rest."""
    rates, angles = sp.symbols("vx vy vz va vb vc"), Q[9:]
    turn = turned(*angles)
    rate = sum(
        (sp.diff(turn, angle) * v for angle, v in zip(angles, rates[3:], strict=True)),
        sp.zeros(3, 3),
    )
    spin = rate * turn.T
    omega = turn.T * sp.Matrix([spin[2, 1], spin[0, 2], spin[1, 0]])  # in the body's frame
    kinetic = sp.Rational(1, 2) * (
        MASS * sum(v**2 for v in rates[:3])
        + sum(i * w**2 for i, w in zip(INERTIA, omega, strict=True))
    )
    return np.array(sp.hessian(kinetic.subs(dict.fromkeys(angles, 0)), rates), dtype=float)


def model_of(geometry):
    stage = {
        "name": "test",
        "body": {"mass": MASS, "inertia": list(INERTIA)},
        "wires": {"count": 4, "k": K, **geometry},
    }
    return string.linear_model(
        expand(scenes.design_of(scenes.raw_of(stage, constants={"gravity": GRAVITY})))
    )


@pytest.mark.parametrize("name", GEOMETRIES)
def test_nominal_pose_balances(name):
    gradient, _ = derived_stiffness(GEOMETRIES[name])
    assert np.abs(gradient[6:]).max() < 1e-11 * MASS * GRAVITY


@pytest.mark.parametrize("name", GEOMETRIES)
def test_stiffness_from_the_lagrangian(name):
    """All of it but the support's own block: coupling to the support, too."""
    _, derived = derived_stiffness(GEOMETRIES[name])
    found = model_of(GEOMETRIES[name]).stiffness
    root = np.sqrt(np.diag(derived))[6:]
    natural_scale = np.tile(np.outer(root, root), (2, 2))
    assert natural_scale.min() > 0
    difference = np.abs(found - derived) / natural_scale
    assert difference[6:].max() < 1e-10
    # at rest the support is held by forces alone, so its translations are independent of the choice
    # of angles as well
    assert difference[:3, :3].max() < 1e-10


@pytest.mark.parametrize("name", GEOMETRIES)
def test_mass_from_the_lagrangian(name):
    found, derived = model_of(GEOMETRIES[name]).mass, derived_mass()
    root = np.sqrt(np.diag(derived))
    assert np.abs((found[6:, 6:] - derived) / np.outer(root, root)).max() < 1e-10
    assert not found[:6].any()


def test_the_geometries_differ():
    """Otherwise the tests above would be one test: every term of the stiffness is alive in one of
    them."""
    found = [derived_stiffness(g)[1][6:, 6:] for g in GEOMETRIES.values()]
    pairs = [(0, 4), (1, 3)]
    for i, j in pairs:
        couplings = [abs(k[i, j]) for k in found]
        assert min(couplings) < 1e-9 < 1.0 < max(couplings)
