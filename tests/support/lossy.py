"""Designs with losses, and the thermal noise of their motions."""

from __future__ import annotations

import copy
import json
import tomllib
from typing import Any

import numpy as np

from suspension_cli.conventions import BOLTZMANN
from suspension_cli.design.reader import template
from suspension_cli.linear import signals
from suspension_cli.linear.solver import Solver
from suspension_cli.models import registry
from suspension_cli.physics import thermal_noise
from tests.support import plants, scenes
from tests.support.paths import CONFIGS

LEVELS = ("beam", "violin")
FREQUENCY = np.geomspace(0.05, 2000.0, 200)
STEEL = {"youngs_modulus": 2e11, "poisson_ratio": 0.3, "density": 7800.0, "loss_angle": 2e-4}


def raw(kind: str) -> dict[str, Any]:
    """A design with wires of lossy materials; `five` has no symmetry, `silica` sections and gas,
    `around` dampers, a spring and a frame."""
    if kind == "silica":
        return tomllib.loads((CONFIGS / "geo-silica-triple.toml").read_text())
    if kind == "quadruple":
        return tomllib.loads((CONFIGS / "quadruple.toml").read_text())
    if kind == "five":
        result = plants.raw("five")
        result["materials"] = {"steel": STEEL}
        for wire in result["stage"][0]["wire"]:
            wire |= {"material": "steel", "radius": 1.5e-4}
        result["stage"][0]["blade"][0]["loss_angle"] = 1e-4
        return result
    result = tomllib.loads(template("double" if kind == "around" else kind, kind))
    result["materials"] = {"steel302": {"loss_angle": 2e-4}}
    if kind == "around":
        first, last = result["stage"]
        first["damping"] = {"x": 3.0, "y": 2.0, "z": 4.0, "roll": 0.05, "pitch": 0.03, "yaw": 0.04}
        last["spring"] = [
            {
                "stiffness": [30.0, 20.0, 10.0, 0.1, 0.2, 0.3],
                "loss_angle": 1e-3,
                "at": [0.0, 0.0, 0.02],
            }
        ]
        result["support"] = {"stiffness": {"x": 1e6, "z": 2e6}, "loss_angle": 1e-2, "mass": 50.0}
        result["gas"] = {"pressure": 1e-2, "molar_mass": 0.029}
    return result


KINDS = ("single", "double", "triple", "quadruple", "silica", "five", "around")


def lossier(given: dict[str, Any], angle: float) -> dict[str, Any]:
    """The same with one constant loss angle for everything elastic, so large that nothing
    drowns."""
    result = copy.deepcopy(given)
    used = {
        wire.get("material")
        for stage in result["stage"]
        for wire in ([stage["wires"]] if "wires" in stage else stage["wire"])
    }
    for name in used:
        table = result.setdefault("materials", {}).setdefault(name, {})
        table.pop("loss_angle", None)
        table["loss"] = {"angle": angle, "surface_depth": 0.0, "thermoelastic": False}
    for stage in result["stage"]:
        for blade in [stage["blades"]] if "blades" in stage else stage.get("blade", []):
            blade["loss_angle"] = angle
    return result


def model_of(given: dict[str, Any], level: str = "violin") -> Any:
    """The model of a design, made once."""
    requested = json.dumps([given, level])
    if requested not in _MADE:
        _MADE[requested] = registry.by_name(level).system(scenes.design_of(given))
    return _MADE[requested]


_MADE: dict[str, Any] = {}


def noise(
    model: Any,
    text: str,
    frequency: Any = FREQUENCY,
    *,
    tilt: float = 0.0,
    temperature: float = 290.0,
) -> thermal_noise.MotionNoise:
    motion = thermal_noise.parse_motion(model, text, tilt)
    return thermal_noise.solve(model, np.asarray(frequency), [motion], temperature)[0]


def form(model: Any, text: str) -> np.ndarray:
    """Linear form of a motion."""
    return signals.linear_form(thermal_noise.parse_motion(model, text), model)


def from_susceptibility(model: Any, frequency: Any, row: np.ndarray) -> np.ndarray:
    """-(4 k T / omega) Im(r . Z^-1 r) at 290 K, unit^2/Hz; it loses the digits of a high Q."""
    omega = 2 * np.pi * np.asarray(frequency)
    total, solver = np.zeros(len(omega)), Solver(model)
    there = solver.pencil.at(omega)
    for block in solver.blocks:
        force = row[block.keep]
        if force.any():
            found = block.at(there).respond(force[None], np.zeros((6, 1)), force[:, None])
            total += np.imag(found[0, 0])
    return -4 * BOLTZMANN * 290.0 / omega * total
