"""Loss angles against quadrature, the heat equation, limits and published numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate

from suspension_cli.design.cross_sections import CrossSection, circle, rectangle, rectangle_torsion
from suspension_cli.design.losses import Bulk, Mechanism, Thermoelastic
from suspension_cli.elements import loss
from suspension_cli.scene.composition import BladeLoss, Section

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


def wire(diameter: float = 4e-4, losses: tuple[Mechanism, ...] = SILICA) -> Section:
    return section(circle(diameter / 2, diameter / 2), losses)


def ribbon(thickness: float, width: float, losses: tuple[Mechanism, ...] = SILICA) -> Section:
    return section(rectangle(thickness=thickness, width=width), losses)


def section(shape: CrossSection, losses: tuple[Mechanism, ...]) -> Section:
    return Section(1.0, (1.0, 1.0), 1.0, 1.0, 1.0, 1.0, shape, losses)


def test_surface_of_a_round_wire():
    """Energy at the rim over energy inside, by quadrature."""
    r, n = 2e-4, 2000
    azimuth = (np.arange(n) + 0.5) * 2 * np.pi / n
    for strain, found in (
        (lambda x, y: x, wire(2 * r).shape.bending_ratio(0)),
        (lambda x, y: x, wire(2 * r).shape.bending_ratio(1)),
        (lambda x, y: np.ones_like(x), wire(2 * r).shape.stretching_ratio),
        (lambda x, y: np.hypot(x, y), wire(2 * r).shape.twisting_ratio),
    ):
        surface = (strain(r * np.cos(azimuth), r * np.sin(azimuth)) ** 2).sum() * r * 2 * np.pi / n
        inside, _ = integrate.quad(
            lambda a, s=strain: (
                (s(a * np.cos(azimuth), a * np.sin(azimuth)) ** 2).sum() * a * 2 * np.pi / n
            ),
            0,
            r,
        )
        assert found == pytest.approx(surface / inside, rel=1e-9)


@pytest.mark.parametrize(("t", "w"), [(1e-4, 1e-3), (1e-3, 1e-3), (1e-3, 2e-4)])
def test_surface_of_a_ribbon(t, w):
    for plane, strain in (
        (0, lambda x, y: x),
        (1, lambda x, y: y),
        (2, lambda x, y: np.ones_like(x + y)),
    ):
        nodes, weights = np.polynomial.legendre.leggauss(8)
        x, y = nodes * t / 2, nodes * w / 2
        inside = (
            (
                strain(x[:, None], y[None, :] + 0 * x[:, None]) ** 2 * np.outer(weights, weights)
            ).sum()
            * t
            * w
            / 4
        )
        edges = sum(
            (strain(np.full(8, side * t / 2), y) ** 2 * weights).sum() * w / 2 for side in (-1, 1)
        )
        edges += sum(
            (strain(x, np.full(8, side * w / 2)) ** 2 * weights).sum() * t / 2 for side in (-1, 1)
        )
        found = (
            ribbon(t, w).shape.stretching_ratio
            if plane == 2
            else ribbon(t, w).shape.bending_ratio(plane)
        )
        assert found == pytest.approx(edges / inside, rel=1e-12)


def shear_along_edge(side: float, across: float, place: np.ndarray) -> np.ndarray:
    """Shear at points of an edge of length `side`, the other one being `across`: St Venant's series
    along the edge, term by term."""
    n = np.arange(2000)[:, None]
    m = 2 * n + 1
    return (
        8
        * side
        / np.pi**2
        * (
            (-1.0) ** n
            / m**2
            * np.tanh(m * np.pi * across / (2 * side))
            * np.cos(m * np.pi * place / side)
        ).sum(0)
    )


@pytest.mark.parametrize(("t", "w"), [(1.0, 1.0), (1.0, 1.7), (1.0, 5.0)])
def test_surface_of_a_twisted_rectangle(t, w):
    """The shear along all four edges integrated place by place; none of the identities that the
    formula uses."""
    nodes, weights = np.polynomial.legendre.leggauss(200)

    def edge(side, across):
        return (weights * shear_along_edge(side, across, nodes * side / 2) ** 2).sum() * side / 2

    expected = 2 * (edge(t, w) + edge(w, t)) / rectangle_torsion(w, t)
    assert ribbon(t, w).shape.twisting_ratio == pytest.approx(expected, rel=1e-7)
    assert ribbon(w, t).shape.twisting_ratio == ribbon(t, w).shape.twisting_ratio


def test_surface_of_a_twisted_thin_ribbon():
    """Shear ~ distance from the middle plane: 6/t, less what the ends lack."""
    assert ribbon(1e-7, 1e-3).shape.twisting_ratio * 1e-7 == pytest.approx(6, rel=1e-3)
    assert np.isfinite(ribbon(1e-9, 1e3).shape.twisting_ratio)


def peak(losses: Thermoelastic, diameter: float) -> float:
    """The angular frequency at which the slowest relaxation is at its peak: tau = 0.0737 rho C
    d^2/kappa (Cagnoli and Willems)."""
    return losses.conductivity / (0.0737 * losses.density * losses.heat_capacity * diameter**2)


def test_published_peak():
    """Cagnoli and Willems' strain without loss, alpha/beta = 0.26 %, and the peak of an unloaded
    fibre of fused silica, which is 1 % lower than Delta/2."""
    fibre, free = wire(), 290.0
    delta = 7.2e10 * free * 3.9e-7**2 / (2200 * 772)
    omega = peak(HEAT, 4e-4) * np.linspace(0.9, 1.1, 401)
    extra = loss.bending_angle(fibre, 0, omega, 0.0, free) - loss.bending_angle(
        wire(losses=COLD), 0, omega, 0.0, free
    )
    assert extra.max() == pytest.approx(delta / 2, rel=0.011)
    assert omega[extra.argmax()] == pytest.approx(peak(HEAT, 4e-4), rel=5e-3)
    nulling = fibre.shape.area * 7.2e10 * 3.9e-7 / 1.52e-4
    assert loss.bending_angle(fibre, 0, OMEGA, nulling, free) == pytest.approx(
        loss.bending_angle(wire(losses=COLD), 0, OMEGA, 0.0, free), rel=1e-12
    )
    assert (
        loss.bending_angle(fibre, 0, OMEGA[1:], 2.5 * nulling, free)
        > loss.bending_angle(fibre, 0, OMEGA[1:], 0.0, free)
    ).all()


def test_strain_against_temperature():
    """alpha - u beta is how the strain at constant stress changes with temperature."""
    stress, step, omega = 8e8, 1e-3, peak(HEAT, 4e-4)

    def strain(temperature):
        return stress / (7.2e10 * (1 + 1.52e-4 * temperature)) + 3.9e-7 * temperature

    coefficient = (strain(step) - strain(-step)) / (2 * step)
    cold = loss.bending_angle(wire(losses=COLD), 1, omega, 0.0, 300.0)
    loaded, free = (
        loss.bending_angle(wire(), 1, omega, load * wire().shape.area, 300.0) - cold
        for load in (stress, 0.0)
    )
    assert loaded / free == pytest.approx((coefficient / 3.9e-7) ** 2, rel=1e-6)


def test_silica_fibre_in_numbers():
    """0.4 mm fibre: bulk times 1 + 0.015 m x 4/r = 301."""
    assert loss.bending_angle(wire(losses=COLD), 0, 10.0, 50.0, 290.0) == pytest.approx(
        4.1e-10 * 301, rel=1e-12
    )
    assert loss.stretching_angle(wire(), 10.0) == pytest.approx(4.1e-10 * 151, rel=1e-12)
    assert loss.twisting_angle(wire(), 10.0) == pytest.approx(4.1e-10 * 301, rel=1e-12)


def test_a_table_of_angles():
    tabled = wire(losses=(Bulk(0.0, table=((1.0, 100.0), (1e-6, 1e-4))),))
    found = loss.stretching_angle(tabled, 2 * np.pi * np.array([0.0, 0.5, 1.0, 10.0, 100.0, 1e4]))
    np.testing.assert_allclose(found, [1e-6, 1e-6, 1e-6, 1e-5, 1e-4, 1e-4], rtol=1e-12)


@pytest.mark.parametrize("losses", [SILICA, COLD, (replace(GLASS, table=((10.0,), (1e-7,))), HEAT)])
def test_finite_and_of_the_requested_shape(losses):
    tension = np.array([[0.0], [50.0]])
    for one in (wire(losses=losses), ribbon(1e-4, 1e-3, losses)):
        for found, shape in (
            (loss.bending_angle(one, 1, OMEGA, tension, 290.0), (2, OMEGA.size)),
            (loss.stretching_angle(one, OMEGA), OMEGA.shape),
            (loss.twisting_angle(one, OMEGA), OMEGA.shape),
        ):
            assert found.shape == shape
            assert (found > 0).all() and np.isfinite(found).all()
    blade = BladeLoss("upper.blade1", 1e-4, losses, 2e-3, 290.0)
    assert np.isfinite(loss.blade_angle(blade, OMEGA)).all()


def test_blades():
    """A thick ribbon, but for the edges; no material: the constant; no thickness: the bulk."""
    blade = BladeLoss("b", 1e-4, SILICA, 2e-3, 290.0)
    wide = ribbon(2e-3, 1e6)
    np.testing.assert_allclose(
        loss.blade_angle(blade, OMEGA), loss.bending_angle(wide, 0, OMEGA, 0.0, 290.0), rtol=1e-8
    )
    np.testing.assert_array_equal(loss.blade_angle(replace(blade, losses=None), OMEGA), 1e-4)
    np.testing.assert_array_equal(loss.blade_angle(replace(blade, thickness=0.0), OMEGA), 4.1e-10)
