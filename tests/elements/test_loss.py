"""Loss angles against quadrature, the heat equation, limits and published numbers."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import mpmath
import numpy as np
import pytest
from scipy import integrate

from suspension_cli.design.cross_sections import (
    CrossSection,
    circle,
    rectangle,
    rectangle_torsion,
    relaxation,
)
from suspension_cli.design.materials import Bulk, Mechanism, Thermoelastic
from suspension_cli.elements import loss
from suspension_cli.scene.scene import BladeLoss, Section

GLASS = Bulk(4.1e-10, surface_depth=1.5e-2)
HEAT = Thermoelastic(
    youngs_modulus=7.2e10,
    density=2200.0,
    expansion=3.9e-7,
    modulus_slope=1.52e-4,
    heat_capacity=772.0,
    conductivity=1.38,
)
SILICA, COLD = (GLASS, HEAT), (GLASS,)
"""Fused silica, as pygwinc has it; and without thermoelastic loss."""
OMEGA = np.concatenate([[0.0], 2 * np.pi * np.logspace(-3, 5, 33)])


def section(shape: CrossSection, losses: tuple[Mechanism, ...]) -> Section:
    return Section(1.0, (1.0, 1.0), 1.0, 1.0, 1.0, 1.0, shape, losses, 290.0)


def wire(losses: tuple[Mechanism, ...] = SILICA) -> Section:
    return section(circle(2e-4, 2e-4), losses)


# ---------------------------------------------------------------- surfaces


def test_surface_of_a_round_wire():
    """Energy at the rim over energy inside, by quadrature."""
    r, n, shape = 2e-4, 2000, wire().shape
    azimuth = (np.arange(n) + 0.5) * 2 * np.pi / n
    for strain, found in (
        (lambda x, y: x, shape.bending_ratio(0)),
        (lambda x, y: x, shape.bending_ratio(1)),
        (lambda x, y: np.ones_like(x), shape.stretching_ratio),
        (lambda x, y: np.hypot(x, y), shape.twisting_ratio),
    ):

        def around(a, s=strain):
            square = s(a * np.cos(azimuth), a * np.sin(azimuth)) ** 2
            return square.sum() * a * 2 * np.pi / n

        assert found == pytest.approx(around(r) / integrate.quad(around, 0, r)[0], rel=1e-9)


@pytest.mark.parametrize(("t", "w"), [(1e-4, 1e-3), (1e-3, 1e-3), (1e-3, 2e-4)])
def test_surface_of_a_ribbon(t, w):
    shape, (nodes, weights) = (rectangle(thickness=t, width=w), np.polynomial.legendre.leggauss(8))
    x, y = nodes * t / 2, nodes * w / 2
    for strain, found in (
        (lambda x, y: x + 0 * y, shape.bending_ratio(0)),
        (lambda x, y: y + 0 * x, shape.bending_ratio(1)),
        (lambda x, y: 1 + 0 * x * y, shape.stretching_ratio),
    ):
        inside = weights @ strain(x[:, None], y) ** 2 @ weights * t * w / 4
        edges = weights @ (strain(t / 2, y) ** 2 + strain(-t / 2, y) ** 2) * w / 2
        edges += weights @ (strain(x, w / 2) ** 2 + strain(x, -w / 2) ** 2) * t / 2
        assert found == pytest.approx(edges / inside, rel=1e-12)


@pytest.mark.parametrize(("t", "w"), [(1.0, 1.0), (1.0, 1.7), (1.0, 5.0)])
def test_surface_of_a_twisted_rectangle(t, w):
    """The shear along all four edges integrated place by place: St Venant's series, term by term;
    none of the identities that the formula uses."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    n = np.arange(2000)[:, None]
    m = 2 * n + 1

    def edge(side, across):
        place = nodes * side / 2
        terms = (-1.0) ** n / m**2 * np.tanh(m * np.pi * across / (2 * side))
        shear = 8 * side / np.pi**2 * (terms * np.cos(m * np.pi * place / side)).sum(0)
        return (weights * shear**2).sum() * side / 2

    expected = 2 * (edge(t, w) + edge(w, t)) / rectangle_torsion(w, t)
    found = rectangle(thickness=t, width=w).twisting_ratio
    assert found == pytest.approx(expected, rel=1e-7)
    assert rectangle(thickness=w, width=t).twisting_ratio == found


def test_surface_of_a_twisted_thin_ribbon():
    """Shear ~ distance from the middle plane: 6/t, less what the ends lack."""
    found = rectangle(thickness=1e-7, width=1e-3).twisting_ratio
    assert found * 1e-7 == pytest.approx(6, rel=1e-3)
    assert np.isfinite(rectangle(thickness=1e-9, width=1e3).twisting_ratio)


# ---------------------------------------------------------------- angles


def test_strain_against_temperature():
    """alpha - u beta is how the strain at constant stress changes with temperature."""
    stress, step, omega = 8e8, 1e-3, 7e3

    def strain(temperature):
        return stress / (7.2e10 * (1 + 1.52e-4 * temperature)) + 3.9e-7 * temperature

    coefficient = (strain(step) - strain(-step)) / (2 * step)
    cold = loss.bending_angle(wire(COLD), 1, omega, 0.0, 300.0)
    loaded, free = (
        loss.bending_angle(wire(), 1, omega, load * wire().shape.area, 300.0) - cold
        for load in (stress, 0.0)
    )
    assert loaded / free == pytest.approx((coefficient / 3.9e-7) ** 2, rel=1e-6)


def test_silica_fibre_in_numbers():
    """0.4 mm fibre: bulk times 1 + 0.015 m x 4/r = 301."""
    assert loss.bending_angle(wire(COLD), 0, 10.0, 50.0, 290.0) == pytest.approx(
        4.1e-10 * 301, rel=1e-12
    )
    assert loss.stretching_angle(wire(), 10.0) == pytest.approx(4.1e-10 * 151, rel=1e-12)
    assert loss.twisting_angle(wire(), 10.0) == pytest.approx(4.1e-10 * 301, rel=1e-12)


def test_a_table_of_angles():
    tabled = wire((Bulk(0.0, table=((1.0, 100.0), (1e-6, 1e-4))),))
    found = loss.stretching_angle(tabled, 2 * np.pi * np.array([0.0, 0.5, 1.0, 10.0, 100.0, 1e4]))
    np.testing.assert_allclose(found, [1e-6, 1e-6, 1e-6, 1e-5, 1e-4, 1e-4], rtol=1e-12)


def test_blades():
    """A thick ribbon, but for the edges; no material: the constant; no thickness: the bulk."""
    blade = BladeLoss("b", 1e-4, SILICA, 2e-3, 290.0)
    wide = section(rectangle(thickness=2e-3, width=1e6), SILICA)
    np.testing.assert_allclose(
        loss.blade_angle(blade, OMEGA), loss.bending_angle(wide, 0, OMEGA, 0.0, 290.0), rtol=1e-8
    )
    np.testing.assert_array_equal(loss.blade_angle(replace(blade, losses=None), OMEGA), 1e-4)
    np.testing.assert_array_equal(loss.blade_angle(replace(blade, thickness=0.0), OMEGA), 4.1e-10)


# ---------------------------------------------------------------- thermoelastic loss

STEEL = Thermoelastic(
    youngs_modulus=2.1e11,
    density=7800.0,
    expansion=1.2e-5,
    modulus_slope=-2.5e-4,
    heat_capacity=486.0,
    conductivity=49.0,
)
CAPACITY = STEEL.density * STEEL.heat_capacity
DIFFUSIVITY = STEEL.conductivity / CAPACITY
WARMTH = 290.0
DELTA = STEEL.youngs_modulus * WARMTH * STEEL.expansion**2 / CAPACITY
PHASES = (1e-9, 1e-3, 0.3, 3.39, 3.9, 4.1, 30.0, 1e3, 1e5)
"""Of w h^2/D; the slowest relaxation of a round wire peaks at 1.8412^2, of a ribbon at (pi/2)^2,
and there is a seam at 4."""


@cache
def of_heat(phase: float, *, is_round: bool) -> float:
    """Im of the moment of the temperature over that of y^2, with h = 1: theta = y + A f(y) solves i
    p theta = div grad theta + i p y.

    f is J1(k r) sin(azimuth) or sin(k y) with k^2 = -i p, and A lets no heat through the surface;
    the integral by quadrature.
    """
    with mpmath.workdps(40):
        k = mpmath.sqrt(mpmath.mpc(0, -phase))
        if is_round:
            slope = k * mpmath.besselj(1, k, derivative=1)
            theta = lambda r: (r - mpmath.besselj(1, k * r) / slope) * 4 * r**2  # noqa: E731
        else:
            theta = lambda y: (y - mpmath.sin(k * y) / (k * mpmath.cos(k))) * 3 * y  # noqa: E731
        layer = min(1.0, 30 / phase**0.5)  # at the surface, beyond which nothing flows
        places = [0, 1 - layer, 1 - layer / 2, 1 - layer / 8, 1] if layer < 1 else [0, 0.5, 1]
        return float(mpmath.im(mpmath.quad(theta, places)))


@pytest.mark.parametrize("phase", PHASES)
def test_against_the_heat_equation(phase: float):
    """A round wire, both planes of a ribbon (heat flows across its thickness or its width), and a
    blade."""
    h, ribbon = 2e-4, section(rectangle(thickness=4e-4, width=1.2e-3), (STEEL,))
    omega = np.array([phase * DIFFUSIVITY / h**2])
    blade = BladeLoss("upper.blade1", 0.0, (STEEL,), 2 * h, WARMTH)
    flat = DELTA * of_heat(phase, is_round=False)
    for found, expected in (
        (
            loss.bending_angle(section(circle(h, h), (STEEL,)), 0, omega, 0.0, WARMTH),
            DELTA * of_heat(phase, is_round=True),
        ),
        (loss.bending_angle(ribbon, 0, omega, 0.0, WARMTH), flat),
        (loss.bending_angle(ribbon, 1, omega / 9, 0.0, WARMTH), flat),
        (loss.blade_angle(blade, omega), flat),
    ):
        assert found[0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("order", "least", "most"), [(1.0, 7 / 24, 4.0), (0.5, 0.4, 3.0)], ids=["round", "ribbon"]
)
def test_far_from_the_peak(order: float, least: float, most: float):
    """It rises with w and falls with 1/w, at any frequency that can be written; the next term far
    above is lower by sqrt(2/p) or so."""
    low = np.array([1e-300, 1e-30, 1e-12])
    assert relaxation(low, order) == pytest.approx(least * low, rel=1e-9)
    high = np.array([1e11, 0.99e12, 1.01e12, 1e20, 1e100])
    assert relaxation(high, order) * high / most == pytest.approx(
        1 - np.sqrt(0.5 / high), rel=1e-10
    )
    assert relaxation(np.zeros(2), order).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("order", [1.0, 0.5])
@pytest.mark.parametrize("centre", [1e-3, 1.0, 4.0, 50.0, 1e4])
def test_analytic_in_the_frequency(order: float, centre: float):
    """The mean over a circle is the value at its centre (Cauchy), and values below the axis are
    conjugates of those above."""
    radius = 0.2 * centre if centre != 4.0 else 1e-3
    around = centre + radius * np.exp(2j * np.pi * (np.arange(24) + 0.5) / 24)
    found = relaxation(around, order)
    assert found.mean() == pytest.approx(relaxation(np.array([centre]), order)[0], rel=1e-11)
    np.testing.assert_allclose(found, found[::-1].conj(), rtol=1e-12)
