"""Drag of a gas along a wire that is stretched: response and thermal noise of a mass that bounces
on one wire, against the rod's equation."""

from __future__ import annotations

import copy
import math
from pathlib import Path
from typing import Any

import mpmath
import pytest

from suspension_cli.conventions import AVOGADRO, BOLTZMANN
from tests.support.commandline import run, strict_json, written

PRESSURE, MOLAR, WARMTH = 20.0, 0.028, 300.0
LENGTH, RADIUS, MASS = 0.8, 5e-5, 0.3
YOUNG, DENSITY = 7e10, 2200.0
BELOW, ABOVE = 40.0, 3562.0
"""Hz: near the bounce, and near the second stretching mode of the wire with the mass all but at
rest."""
DESIGN: dict[str, Any] = {
    "design": {"name": "bounce"},
    "constants": {"temperature": WARMTH},
    "gas": {"pressure": PRESSURE, "molar_mass": MOLAR},
    "materials": {"glass": {"youngs_modulus": YOUNG, "density": DENSITY}},
    "stage": [
        {
            "name": "test",
            "body": {"mass": MASS, "inertia": [1e-3, 1e-3, 1e-3]},
            "wires": {"count": 1, "l": LENGTH, "d": 0.01, "material": "glass", "radius": RADIUS},
        }
    ],
}


def dragged(frequency: float) -> tuple[complex, complex]:
    """z of the mass for a unit motion of the support and for a unit force on it: EA u'' + (mu w^2 -
    i w c) u = 0, c = 2 pi r p sqrt(m/(2 pi k T))."""
    with mpmath.workdps(40):
        w = 2 * mpmath.pi * frequency
        drag = (
            2
            * mpmath.pi
            * RADIUS
            * PRESSURE
            * mpmath.sqrt(MOLAR / AVOGADRO / (2 * mpmath.pi * BOLTZMANN * WARMTH))
        )
        stiff = YOUNG * mpmath.pi * mpmath.mpf(RADIUS) ** 2
        kappa = mpmath.sqrt(
            (DENSITY * mpmath.pi * mpmath.mpf(RADIUS) ** 2 * w**2 - 1j * w * drag) / stiff
        )
        far, cos = mpmath.sin(kappa * LENGTH) / kappa, mpmath.cos(kappa * LENGTH)
        dynamic = stiff * cos / far - MASS * w**2
        return complex(stiff / far / dynamic), complex(1 / dynamic)


@pytest.mark.parametrize("frequency", [BELOW, ABOVE])
def test_response(tmp_path: Path, frequency: float):
    way = (
        *["--input", "support.z", "--output", "test.z", "--frequency"],
        frequency,
        *["--fidelity", "violin", "--json", "--no-plot", "--out"],
        tmp_path,
    )
    found = strict_json(run("response", written(tmp_path, DESIGN), *way).stdout)
    expected, _ = dragged(frequency)
    assert abs(complex(found["real"][0], found["imag"][0]) / expected - 1) < 1e-11
    without = copy.deepcopy(DESIGN)
    del without["gas"]
    plain = strict_json(run("response", written(tmp_path, without), *way).stdout)
    # the drag can be seen at all
    assert abs(complex(plain["real"][0], plain["imag"][0]) / expected - 1) > 1e-7


@pytest.mark.parametrize("frequency", [BELOW, ABOVE])
def test_thermal_noise(tmp_path: Path, frequency: float):
    """All of it from the gas: S = -(4 k T/w) Im of the susceptibility."""
    way = (
        "--output",
        "test.z",
        "--frequency",
        frequency,
        *["--fidelity", "violin", "--json", "--no-plot", "--out"],
        tmp_path,
    )
    found = strict_json(run("thermal", written(tmp_path, DESIGN), *way).stdout)
    _, susceptibility = dragged(frequency)
    expected = math.sqrt(-4 * BOLTZMANN * WARMTH / (2 * math.pi * frequency) * susceptibility.imag)
    assert found["contributions"]["test.gas"][0] == pytest.approx(expected, rel=1e-10)
    assert found["displacement_asd"][0] == pytest.approx(expected, rel=1e-10)
