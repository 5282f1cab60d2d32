"""Thermoelastic loss against the heat equation, solved in many digits across the section of a bent
wire, ribbon or blade."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest

from suspension_cli.design.cross_sections import circle, rectangle
from suspension_cli.design.losses import Thermoelastic
from suspension_cli.design.relaxation import relaxation
from suspension_cli.elements import loss
from suspension_cli.scene.composition import BladeLoss, Section
from tests.support.commandline import run, strict_json, written

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


def section(depth: float, *, is_round: bool) -> Section:
    shape = (
        circle(depth / 2, depth / 2) if is_round else rectangle(thickness=depth, width=3 * depth)
    )
    return Section(1.0, (1.0, 1.0), 1.0, 1.0, 1.0, 1.0, shape, (STEEL,))


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("is_round", [True, False], ids=["round", "ribbon"])
def test_wires_against_the_heat_equation(phase: float, is_round: bool):
    h = 2e-4
    omega = phase * DIFFUSIVITY / h**2
    found = loss.bending_angle(
        section(2 * h, is_round=is_round), 0, np.array([omega]), 0.0, WARMTH
    )[0]
    assert found == pytest.approx(DELTA * of_heat(phase, is_round=is_round), rel=1e-12)


def test_a_ribbon_in_its_stiff_plane_and_a_blade():
    """Heat flows across the width of the one and across the thickness of the other."""
    omega = np.array([0.3, 30.0]) * DIFFUSIVITY / 3e-4**2
    expected = [DELTA * of_heat(phase, is_round=False) for phase in (0.3, 30.0)]
    assert loss.bending_angle(
        section(2e-4, is_round=False), 1, omega, 0.0, WARMTH
    ) == pytest.approx(expected, rel=1e-12)
    assert loss.blade_angle(
        BladeLoss("upper.blade1", 0.0, (STEEL,), 6e-4, WARMTH), omega
    ) == pytest.approx(expected, rel=1e-12)


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
    circle = centre + radius * np.exp(2j * np.pi * (np.arange(24) + 0.5) / 24)
    found = relaxation(circle, order)
    assert found.mean() == pytest.approx(relaxation(np.array([centre]), order)[0], rel=1e-11)
    np.testing.assert_allclose(found, found[::-1].conj(), rtol=1e-12)


def test_of_a_pendulum(tmp_path: Path):
    """The noise of a heavy mass far above its pendulum mode goes with the square root of the loss
    angle: by the command, in steel."""
    wires: dict[str, Any] = {"count": 1, "l": 0.5, "d": 0.0, "material": "warm", "radius": 1e-3}
    material = {
        "youngs_modulus": 2.1e11,
        "density": 7800.0,
        "thermal_expansion": 1.2e-5,
        "specific_heat": 486.0,
        "thermal_conductivity": 49.0,
    }
    raw = {
        "design": {"name": "warm"},
        "materials": {
            "warm": material,
            "plain": {"youngs_modulus": 2.1e11, "density": 7800.0, "loss": {"angle": 1e-3}},
        },
        "stage": [
            {"name": "test", "body": {"mass": 100.0, "inertia": [1e9, 1e9, 1e9]}, "wires": wires}
        ],
    }
    frequency = 80.0
    densities = []
    for name in ("warm", "plain"):
        wires["material"] = name
        path = written(tmp_path, raw)
        done = run(
            "thermal",
            path,
            "--output",
            "test.x",
            "--frequency",
            frequency,
            *["--fidelity", "beam", "--json", "--no-plot", "--out"],
            tmp_path,
        )
        parts = strict_json(done.stdout)["contributions"]
        densities.append(sum(parts[f"test.bending-{end}"][0] ** 2 for end in ("upper", "lower")))
    u = 981.0 / (2.1e11 * np.pi * 1e-6)
    assert u < 2e-3
    phase = 2 * np.pi * frequency * 1e-3**2 / DIFFUSIVITY
    assert phase > 30
    assert densities[0] / densities[1] == pytest.approx(
        DELTA * of_heat(phase, is_round=True) / 1e-3, rel=1e-6
    )
