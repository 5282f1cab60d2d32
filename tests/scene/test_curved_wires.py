"""Curved wires and eddy currents against frames of straight beams and numerical integration."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from suspension_cli.design.links import EddyCurrent
from suspension_cli.rotations import cross_matrix
from suspension_cli.scene import curved_wires
from suspension_cli.scene.eddy_currents import eddy_damping

WIRE = curved_wires.RoundWire.of(1.2e-3, 7e10, 0.33, 2.6e4)
END = np.array([0.08, 0.03, 0.05])


def _frame(points: Any) -> Any:
    """Compliance of a chain of straight beams from textbook elements, at the first point."""
    total = np.zeros((6, 6))
    for one, other in itertools.pairwise(points):
        span = other - one
        length = np.linalg.norm(span)
        t = span / length
        # cantilever clamped at `other`, loaded at `one`: PL^3/3EI, PL^2/2EI, L/EI
        along, across, turn = np.outer(t, t), np.eye(3) - np.outer(t, t), cross_matrix(t)
        b = WIRE.bending
        local = np.zeros((6, 6))
        local[:3, :3] = along * length / WIRE.stretching + across * length**3 / (3 * b)
        local[3:, 3:] = along * length / WIRE.twisting + across * length / b
        local[:3, 3:] = turn * length**2 / (2 * b)
        local[3:, :3] = local[:3, 3:].T
        arm = points[0] - one
        move = np.eye(6)
        move[3:, :3] = cross_matrix(arm)
        total += move.T @ local @ move
    return total


def _points(curve: curved_wires.Curve) -> Any:
    return np.vstack([np.zeros(3), curve.point, curve.end])


def _dense(kind: str, length: float, count: int) -> Any:
    """Points along the curve, from formulas of its own."""
    width = np.hypot(*END[:2])
    if kind == "u":
        radius = width / 2
        first = (length - np.pi * radius - END[2]) / 2
        a = np.linspace(0, np.pi, count)
        flat = np.column_stack([radius * (1 - np.cos(a)), -first - radius * np.sin(a)])
        flat = np.vstack([[0, 0], flat, [width, END[2]]])
    else:
        target = np.sqrt(length**2 - END[2] ** 2)
        a = brentq(lambda a: 2 * a * np.sinh(width / (2 * a)) - target, 1e-3, 10, xtol=1e-15)
        height = lambda x, b: a * (np.cosh((x - b) / a) - np.cosh(b / a))  # noqa: E731
        b = brentq(lambda b: height(width, b) - END[2], -1, 1, xtol=1e-15)
        x = np.linspace(0, width, count)
        flat = np.column_stack([x, height(x, b)])
    return np.column_stack([flat[:, :1] * END[:2] / width, flat[:, 1]])


@pytest.mark.parametrize("kind", ["u", "catenary"])
def test_stiffness_of_curves_against_frames_of_beams(kind: str) -> None:
    length = 0.4
    curve = curved_wires.u_shape(END, length) if kind == "u" else curved_wires.catenary(END, length)
    assert curve.length == pytest.approx(length, rel=1e-12)
    found = curved_wires.curve_compliance(curve, WIRE)
    coarse, fine = (_frame(_dense(kind, length, n)) for n in (1001, 2001))
    expected = fine + (fine - coarse) / 3  # Richardson
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.abs((found - expected) / scale).max() < 1e-7


def test_straight_wire_is_a_beam_and_a_polyline_a_frame() -> None:
    length = 0.3
    k = curved_wires.curve_stiffness(
        curved_wires.polyline(np.array([[0, 0, 0], [length, 0, 0]])), WIRE
    )
    across, turning = 12 * WIRE.bending / length**3, 4 * WIRE.bending / length
    along, twisting = WIRE.stretching / length, WIRE.twisting / length
    expected = [along, across, across, twisting, turning, turning]
    assert np.diag(k) == pytest.approx(expected, rel=1e-12)
    points = np.array([[0, 0, 0], [0.1, 0.02, -0.2], [0.2, 0.1, -0.1], [0.3, 0.0, 0.1]])
    found = curved_wires.curve_compliance(curved_wires.polyline(points), WIRE)
    np.testing.assert_allclose(found, _frame(points), rtol=1e-11, atol=1e-12)


def test_sag_of_a_straight_wire() -> None:
    """A horizontal beam clamped at both ends descends by w L^4 / 384 EI in its middle."""
    length = 0.2
    curve = curved_wires.polyline(np.array([[0, 0, 0], [length, 0, 0]]))
    descent, reaction = curved_wires.sag(curve, WIRE)
    assert descent == pytest.approx(WIRE.weight * length**4 / (384 * WIRE.bending), rel=5e-3)
    assert reaction[2] == pytest.approx(-WIRE.weight * length / 2, rel=1e-9)
    assert reaction[4] == pytest.approx(WIRE.weight * length**2 / 12, rel=5e-3)


def test_eddy_currents_dissipate_the_power_of_the_damper() -> None:
    m, sigma, t, g = 0.8, 5.8e7, 4e-3, 7e-3
    mu = 4e-7 * np.pi

    def field(rho: float, z: float) -> float:
        return 3 * mu * m / (4 * np.pi) * rho * z / (rho**2 + z**2) ** 2.5

    def plate(z: float) -> float:
        value, _ = quad(lambda rho: sigma * field(rho, z) ** 2 * 2 * np.pi * rho, 0, np.inf)
        return value

    def tube(rho: float) -> float:
        value, _ = quad(lambda z: sigma * field(rho, z) ** 2, -0.3, 0.3, points=[0], limit=200)
        return value * 2 * np.pi * rho

    def damping(shape: Any, thickness: float) -> Any:
        magnet = EddyCurrent(
            shape=shape, axis="z", conductivity=sigma, thickness=thickness, gap=g, moment=m
        )
        return np.diag(eddy_damping(magnet))

    for shape, power in (("plate", plate), ("tube", tube)):
        expected, _ = quad(power, g, g + t)
        assert damping(shape, t)[2] == pytest.approx(expected, rel=1e-6)
    assert damping("tube", 1e-7)[2] == pytest.approx(
        45 * mu**2 * m**2 * sigma * 1e-7 / (1024 * g**4), rel=1e-4
    )
    # across the axis over a sheet: E = v x B less a potential that keeps the currents in the sheet;
    # Saslow (1992): at low velocity 3 mu_0 m^2 / (32 pi h^4) v mu_0 sigma t / 4
    saslow = 3 * mu * m**2 / (32 * np.pi * g**4) * mu * sigma * 1e-7 / 4
    assert damping("plate", 1e-7)[:2] == pytest.approx(saslow, rel=1e-4)
