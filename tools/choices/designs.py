"""Random suspensions: one to four stages on wires from thin to thick, with and without blades."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator

from suspension_cli.design import reader
from suspension_cli.design.schema import Design
from suspension_cli.equilibrium.nominal import expand

STRESS = (1e7, 3e9)
"""Stress in the wires, Pa, which sets their thickness: steel is used at 0.3 to 1 GPa; at 10 MPa it
is a rod, at 3 GPa about to break."""
MODULUS = 2e11
"""Typical Young's modulus, Pa: the strain of a wire is its stress over this."""
BLADES = ((1, 1), (2, 1), (2, 2), (4, 2), (4, 4))
"""Numbers of wires in a set and of blades that can carry them."""


def random_design(seed: int) -> Design:
    """Generate a design that all models can solve."""
    return reader.convert(random_raw(seed))


def random_raw(seed: int) -> dict[str, Any]:
    """Generate a design as a parsed TOML file."""
    rng = np.random.default_rng([77, seed])
    has_blades, stress = rng.random() < 0.3, float(np.exp(rng.uniform(*np.log(STRESS))))
    stages = [
        _stage(rng, f"mass{n}", has_blades=bool(has_blades and (n == 1 or rng.random() < 0.6)))
        for n in range(1, 2 + seed % 4)
    ]
    _add_sections(rng, stages, stress)
    raw: dict[str, Any] = {"design": {"name": f"scene-{seed}"}, "stage": stages}
    if rng.random() < 0.25:
        raw["perturbation"] = [
            item for stage in stages for item in _imperfections(rng, stage, stress / MODULUS)
        ]
    return raw


def smallest_elongation(design: Design) -> float:
    """Smallest elongation of any wire under its load, m."""
    wires = expand(design).wires
    return float((wires.tension / wires.stiffness).min())


def _between(rng: Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _stage(rng: Generator, name: str, *, has_blades: bool) -> dict[str, Any]:
    """Generate a solid block on a symmetric set of wires, vertical under blades."""
    mass, density = _between(rng, 1.0, 40.0), _between(rng, 2200.0, 8000.0)
    sides = rng.uniform(0.6, 1.6, 3)
    squares = (sides * (mass / density / sides.prod()) ** (1 / 3)) ** 2
    body = {
        "mass": mass,
        "inertia": [float(mass * (squares.sum() - square) / 12) for square in squares],
    }
    count, blades = (
        BLADES[rng.integers(len(BLADES))] if has_blades else (int(rng.choice([1, 2, 4, 4])), 0)
    )
    half = 0.5 * (mass / 4000.0) ** (1 / 3)
    wires: dict[str, Any] = {
        "count": count,
        "l": _between(rng, 0.15, 1.0),
        "d": float(rng.uniform(0.001, 0.03)),
        "d_upper": float(rng.uniform(0.0, 0.02)),
    }
    if count > 1:
        wires["t2"] = float(rng.uniform(0.5, 1.2)) * half
        wires["t1"] = (
            wires["t2"]
            if has_blades
            else abs(wires["t2"] + float(rng.uniform(-0.3, 0.3)) * wires["l"])
        )
    if count == 4:
        wires["s"] = _between(rng, 0.1, 1.0) * half
    stage = {"name": name, "body": body, "wires": wires}
    return stage | (
        {"blades": {"count": blades, "stiffness": _between(rng, 1e3, 1e4)}} if has_blades else {}
    )


def _add_sections(rng: Generator, stages: list[dict[str, Any]], stress: float) -> None:
    """Add material and cross-section to all wires; half of the designs give bending points."""
    material = str(rng.choice(["steel302", "c70steel", "fused-silica"]))
    ribbons, effective, load = rng.random() < 0.2, rng.random() < 0.5, 0.0
    for stage in reversed(stages):
        load += 9.81 * stage["body"]["mass"]
        wires = stage["wires"]
        area = load / wires["count"] / stress
        shape = (
            {"section": {"width": (4 * area) ** 0.5, "thickness": (area / 4) ** 0.5}}
            if ribbons
            else {"radius": (area / np.pi) ** 0.5}
        )
        wires |= {"material": material} | shape | ({"clamp": "bending-point"} if effective else {})


def _imperfections(rng: Generator, stage: dict[str, Any], strain: float) -> list[dict[str, Any]]:
    """Generate one imperfect wire and a mass offset, too small to make a wire slack."""
    wires = stage["wires"]
    most = 0.1 * strain * wires["l"]
    wire = f"{stage['name']}.{rng.integers(1, wires['count'] + 1)}"
    offset = (rng.uniform(-1, 1, 3) * min(1e-3, most)).tolist()
    com = (rng.uniform(-1, 1, 3) * min(5e-4, most)).tolist()
    return [
        {
            "wire": wire,
            "k_factor": float(rng.uniform(0.9, 1.1)),
            "upper_offset": offset,
            "hold": "natural-length",
        },
        {"body": stage["name"], "com_offset": com},
    ]
