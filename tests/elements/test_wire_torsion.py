"""Torsion of wires under tension: GJ + T I_p/A, of which the tension's part has no loss."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from suspension_cli.design.cross_sections import circle
from suspension_cli.design.losses import Bulk
from suspension_cli.elements.dynamic_wire import Fibre, TautWire
from suspension_cli.scene.composition import Section
from tests.support.commandline import modes_json, written

STUFF = (Bulk(1e-4),)
ROUND = {"radius": 2e-4}
RIBBON = {"section": {"width": 1.2e-3, "thickness": 1e-4}}
LENGTH, MASS, YAW = 0.6, 9.0, 0.05
"""A stiff body on one wire: m, kg, kg m^2."""
WEIGHT = MASS * 9.81


def hung(shape: dict[str, Any]) -> dict[str, Any]:
    """A body that clamps its only wire at its centre of mass; the material's loss angle is 1e-4,
    its shear modulus 28 GPa."""
    material = {
        "youngs_modulus": 7e10,
        "poisson_ratio": 0.25,
        "density": 2200.0,
        "loss": {"angle": 1e-4},
    }
    body = {"mass": MASS, "inertia": [0.04, 0.03, YAW]}
    wires = {"count": 1, "l": LENGTH, "d": 0.001, "material": "glass", **shape}
    return {
        "design": {"name": "hung"},
        "materials": {"glass": material},
        "stage": [{"name": "test", "body": body, "wires": wires}],
    }


def area(shape: dict[str, Any]) -> float:
    if "radius" in shape:
        return math.pi * shape["radius"] ** 2
    return shape["section"]["width"] * shape["section"]["thickness"]


def shear(shape: dict[str, Any]) -> float:
    """GJ, N m^2: of a round wire G pi r^4/2, of a ribbon G w t^3 (1/3 - 0.21 (t/w) (1 -
    (t/w)^4/12)) (Roark, good to 0.5 %)."""
    if "radius" in shape:
        return 2.8e10 * math.pi * shape["radius"] ** 4 / 2
    w, t = shape["section"]["width"], shape["section"]["thickness"]
    return 2.8e10 * w * t**3 * (1 / 3 - 0.21 * t / w * (1 - (t / w) ** 4 / 12))


def filaments(shape: dict[str, Any], count: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """Places (n, 2) across a cross-section and the share of its area that each stands for, by
    Gauss-Legendre quadrature."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    if "radius" in shape:
        r = shape["radius"] * (nodes + 1) / 2
        azimuth = 2 * np.pi * (np.arange(count) + 0.5) / count
        places = np.stack([np.outer(r, np.cos(azimuth)), np.outer(r, np.sin(azimuth))], axis=-1)
        return places.reshape(-1, 2), np.repeat(weights * (nodes + 1) / 2 / count, count)
    w, t = shape["section"]["width"], shape["section"]["thickness"]
    places = np.stack(np.meshgrid(nodes * w / 2, nodes * t / 2, indexing="ij"), axis=-1)
    return places.reshape(-1, 2), np.outer(weights, weights).ravel() / 4


def bundle(shape: dict[str, Any], load: float) -> float:
    """Torsional stiffness (N m/rad) of filaments that do not touch between two plates, under a
    load: none of them resists shear.

    The energy of straight elastic filaments and of the load that sinks and rises, at its least over
    the height of the lower plate, against the angle of that plate.
    """
    places, share = filaments(shape)
    stiffness = 7e10 * area(shape) / LENGTH
    natural = LENGTH - load / stiffness
    squares = (places**2).sum(1)

    def least_energy(angle: float) -> float:
        across, height = 4 * squares * math.sin(angle / 2) ** 2, LENGTH
        for _ in range(20):  # Newton
            length = np.sqrt(height**2 + across)
            pull = stiffness * (length - natural)
            force, slope = (
                share @ (pull * height / length) - load,
                share @ (stiffness * height**2 / length**2 + pull * across / length**3),
            )
            height -= force / slope
        length = np.sqrt(height**2 + across)
        # less the energy at the angle 0, without cancellation
        gain = across / (length + height) + height - LENGTH
        return float(share @ (gain * (load + stiffness * gain / 2)) - load * (height - LENGTH))

    angle = 0.3  # the energy is quadratic in the sine of half of it, but for (r/l)^2
    return least_energy(angle) / (2 * math.sin(angle / 2) ** 2)


@pytest.mark.parametrize("shape", [ROUND, RIBBON], ids=["round", "ribbon"])
def test_what_tension_adds_is_the_energy_of_a_bundle_of_filaments(
    tmp_path: Path, shape: dict[str, Any]
):
    """Yaw of a body on one wire, on beam: the shear of the section and the tension of its
    filaments."""
    expected = math.sqrt((shear(shape) / LENGTH + bundle(shape, WEIGHT)) / YAW) / (2 * math.pi)
    found = modes_json(
        written(tmp_path, hung(shape)), "--fidelity", "beam", "--no-plot", "--out", tmp_path
    )
    (yaw,) = [mode for mode in found["modes"] if mode["dof"] == "yaw"]
    assert yaw["frequency_hz"] == pytest.approx(expected, rel=2e-5 if shape is ROUND else 2e-3)


@pytest.mark.parametrize("shape", [ROUND, RIBBON], ids=["round", "ribbon"])
def test_tension_has_no_loss(tmp_path: Path, shape: dict[str, Any]):
    """Q is 1/phi times the share of the stiffness that is not shear: the dilution of torsion."""
    found = modes_json(
        written(tmp_path, hung(shape)), "--fidelity", "beam", "--no-plot", "--out", tmp_path
    )
    (yaw,) = [mode for mode in found["modes"] if mode["dof"] == "yaw"]
    dilution = 1 + bundle(shape, WEIGHT) * LENGTH / shear(shape)
    assert dilution > (1.02 if shape is ROUND else 2)
    assert yaw["q"] == pytest.approx(1e4 * dilution, rel=2e-5 if shape is ROUND else 5e-3)


def strand(sections: tuple[Section, ...], tension: Any, **kind: bool) -> TautWire:
    zero = np.zeros(3)
    return TautWire(
        Fibre("test.1", sections, zero, (zero, zero), (290.0, 290.0)),
        tension,
        **{"massive": False, "lossy": False, **kind},
    )


def round_section(radius: float, length: float) -> Section:
    size, inertia = math.pi * radius**2, math.pi * radius**4 / 4
    gj = 2.8e10 * 2 * inertia
    return Section(
        length,
        (7e10 * inertia,) * 2,
        7e10 * size,
        gj,
        2200 * size,
        4400 * inertia,
        circle(radius, radius),
        STUFF,
    )


def test_sections_twist_in_series():
    """Thick ends and a thin middle under the same tension, whose share in each goes with its own
    I_p/A = r^2/2."""
    radii, lengths, tension = (4e-4, 2e-4, 3e-4), (0.02, 0.5, 0.05), 80.0
    whole = strand(tuple(map(round_section, radii, lengths)), tension)
    compliance = sum(
        length / (2.8e10 * math.pi * r**4 / 2 + tension * r**2 / 2)
        for r, length in zip(radii, lengths, strict=True)
    )
    assert whole.static["twist"][1, 1] / 4 == pytest.approx(1 / compliance, rel=1e-12)


def test_many_tensions_at_once():
    tensions = np.array([0.0, 10.0, 200.0])
    sections = (round_section(2e-4, 0.3),)
    together = strand(sections, tensions).resting("twist")
    for n, tension in enumerate(tensions):
        assert together[..., n] == pytest.approx(
            strand(sections, tension).resting("twist")[..., 0], rel=1e-14
        )


def test_torsional_waves_run_faster_under_tension():
    """c^2 = (GJ + T I_p/A)/(rho I_p) = G/rho + sigma/rho; between held ends the resonances lie at n
    c/2L."""
    tension, section = 90.0, round_section(2e-4, LENGTH)
    speed = math.sqrt((2.8e10 + tension / section.shape.area) / 2200)
    found = strand((section,), tension, massive=True).held_resonances(
        "twist", 3 * math.pi * speed / LENGTH
    )
    assert found[:3] == pytest.approx(np.arange(1, 4) * math.pi * speed / LENGTH, rel=1e-9)
