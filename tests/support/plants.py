"""Designs and signals for the tests of responses, state space and control."""

from __future__ import annotations

import copy
import tomllib
from functools import cache
from typing import Any

from suspension_cli.conventions import DOFS
from suspension_cli.design.reader import template
from suspension_cli.linear import signals
from suspension_cli.models import registry
from tests.support import scenes
from tests.support.paths import CONFIGS

FIVE = """\
[design]
name = "five-wires"

[[stage]]
name = "test"
position = [0.001, -0.002, -0.4]
body = { mass = 9.0, inertia = [[0.06, 0.004, -0.002], [0.004, 0.05, 0.003], [-0.002, 0.003, 0.07]] }
wire = [
    { upper = [0.03, 0.07, 0.0], lower = [0.028, 0.09, 0.011], k = 2.1e4, natural_length = 0.3886 },
    { upper = [0.025, -0.06, 0.0], lower = [0.031, -0.085, 0.013], k = 1.7e4, natural_length = 0.3870 },
    { upper = [-0.033, 0.065, 0.001], lower = [-0.03, 0.08, 0.009], k = 2.6e4, natural_length = 0.3912, blade = "soft" },
    { upper = [-0.03, -0.07, 0.0], lower = [-0.034, -0.09, 0.012], k = 1.9e4, natural_length = 0.3877 },
    { upper = [0.004, 0.02, -0.002], lower = [0.002, 0.03, 0.04], k = 0.8e4, natural_length = 0.3570 },
]
blade = [{ name = "soft", stiffness = 4.0e4 }]
"""

LOSS = {"wire": 2e-4, "blade": 1e-3}
"""Loss angles of a lossy design."""


@cache
def _parsed(kind: str) -> dict[str, Any]:
    if kind == "quadruple":
        return tomllib.loads((CONFIGS / "quadruple.toml").read_text())
    if kind == "five":
        return tomllib.loads(FIVE)
    result = tomllib.loads(template(kind, kind))
    del result["materials"]  # all that makes a template lossy in models of strings
    return result


def raw(
    kind: str, *, loss: bool = False, damping: bool = False, tips: bool = False
) -> dict[str, Any]:
    """A design as parsed TOML, by choice with loss angles, dampers on its first body, tip masses on
    its first blades."""
    result = copy.deepcopy(_parsed(kind))
    first = result["stage"][0]
    if damping:
        first["damping"] = {"x": 3.0, "y": 2.0, "z": 40.0, "roll": 0.05, "pitch": 0.03, "yaw": 0.04}
    if tips:
        for blade in [first["blades"]] if "blades" in first else first["blade"]:
            blade["tip_mass"] = 0.1
    return _with_loss(result) if loss else result


def _with_loss(result: dict[str, Any]) -> dict[str, Any]:
    """Wires and blades of lossy materials; a wire given by its k gets a material for its loss angle
    alone."""
    table = result.setdefault("materials", {})
    table["lossy"] = {"youngs_modulus": 1e11, "loss_angle": LOSS["wire"]}
    for stage in result["stage"]:
        for wire in [stage["wires"]] if "wires" in stage else stage["wire"]:
            if "material" in wire:
                table.setdefault(wire["material"], {})["loss_angle"] = LOSS["wire"]
            else:
                wire["material"] = "lossy"
        for blade in [stage["blades"]] if "blades" in stage else stage.get("blade", []):
            blade["loss_angle"] = LOSS["blade"]
    return result


def design(kind: str, **options: bool) -> Any:
    """A checked design."""
    return scenes.design_of(raw(kind, **options))


@cache
def model(kind: str, level: str = "string", **options: bool) -> Any:
    """The linear model of a design."""
    return registry.by_name(level).system(design(kind, **options))


def drives(model: Any, *texts: str) -> list[signals.Signal]:
    """Inputs by name."""
    return [signals.parse_input(text, signals.bodies_with_signals(model)) for text in texts]


def motions(model: Any, *texts: str) -> list[signals.Signal]:
    """Outputs by name."""
    return [signals.parse_output(text, signals.bodies_with_signals(model)) for text in texts]


def moves(model: Any) -> list[signals.Signal]:
    """The six motions of the support."""
    return drives(model, *(f"support.{dof}" for dof in DOFS))


def forces(model: Any, body: str) -> list[signals.Signal]:
    """The six forces and torques on a body."""
    return drives(model, *(f"{body}.{force}" for force in signals.FORCES))


def all_motions(model: Any, *bodies: str) -> list[signals.Signal]:
    """Every motion of some bodies (of all of them)."""
    return motions(model, *(f"{body}.{dof}" for body in bodies or model.body for dof in DOFS))
