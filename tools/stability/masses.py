"""Masses from a tonne to a milligram: a light imperfect stage below a heavy one."""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.energy import gradient_and_stiffness
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from suspension_cli.scene.pose import displace, layout, nominal_pose
from suspension_cli.scene.scene import Scene
from tools.stability import naive
from tools.stability.references import MP, Pair, design, given_omega_squared
from tools.stability.row import SHIPPED, Row, sample

MASS = 10.0 ** np.arange(3, -7, -1)
HEAVY = 1000.0
"""kg"""
OFFSET = 1e-6
"""Offset of one lower wire end of the light body along x, as a fraction of the body's size."""
ABOVE = {"l": 1.0, "s": 0.2, "t1": 0.3, "t2": 0.3, "d": 0.01, "k": 5e6}
SIGNS = [(1, 1), (1, -1), (-1, 1), (-1, -1)]


def _below(mass: float) -> dict[str, float]:
    """Wires of a body with the density of glass, with stiffness in proportion to its weight."""
    size = (mass / 2200.0) ** (1 / 3)
    return {
        "l": 0.3,
        "s": 0.1 * size,
        "t1": 0.5 * size,
        "t2": 0.5 * size,
        "d": 0.02 * size,
        "k": 400 * mass * 9.81 / 0.3,
    }


def pair(mass: float, fraction: float = OFFSET) -> Design:
    """Build a body of `mass` (kg) below one of a tonne, with one wire attached off its place."""
    size = (mass / 2200.0) ** (1 / 3)
    bodies = (
        {"mass": HEAVY, "inertia": [60.0] * 3},
        {"mass": mass, "inertia": [0.15 * mass * size**2] * 3},
    )
    wires = ({"count": 4, **ABOVE}, {"count": 4, **_below(mass)})
    stages = [
        {"name": name, "body": body, "wires": one}
        for name, body, one in zip(("heavy", "light"), bodies, wires, strict=True)
    ]
    imperfect = (
        [{"wire": "light.1", "lower_offset": [fraction * size, 0.0, 0.0]}] if fraction else []
    )
    return design({"design": {"name": "pair"}, "stage": stages, "perturbation": imperfect})


def exact_pitch(mass: float) -> float:
    """Compute the pitch (rad) of the light body in 60 digits."""
    below, offset = _below(mass), OFFSET * (mass / 2200.0) ** (1 / 3)
    wires, drops = [], []
    for body, shape in enumerate((ABOVE, below)):
        shape = {name: MP.mpf(value) for name, value in shape.items()}
        tension = (MP.mpf(HEAVY) + MP.mpf(mass) if body == 0 else MP.mpf(mass)) * MP.mpf(9.81) / 4
        drops.append(shape["l"] + shape["d"])
        for n, (a, b) in enumerate(SIGNS):
            upper, lower = (
                [a * shape["s"], b * shape["t1"], MP.zero],
                [a * shape["s"], b * shape["t2"], shape["d"]],
            )
            if body and n == 0:
                lower[0] += MP.mpf(offset)
            wires.append((body, upper, lower, shape["k"], tension))
    return float(Pair((HEAVY, mass), drops, wires).balanced().turn[1][0, 2])


def balance_by_total_weight(scene: Scene) -> Any:
    """Find the pose by Newton's method with a tolerance from the total weight.

    It stops where no force exceeds 1e-12 of the total weight, and no torque that times a lever arm.
    """
    numbering, pose = layout(scene), nominal_pose(scene)
    unit = float(scene.weight) * np.where(np.arange(numbering.size - 6) % 6 < 3, 1.0, 0.3)
    for _ in range(20):
        gradient, hessian = gradient_and_stiffness(scene, numbering, pose)
        if (np.abs(gradient[6:]) < 1e-12 * unit).all():
            break
        step = np.linalg.solve(hessian[6:, 6:], -gradient[6:])
        pose = displace(numbering, pose, np.concatenate([np.zeros(6), step]))
    return pose


def row(mass: Any = MASS) -> Row:
    """Compute errors of the modes of the pair as drawn, and of the imperfect light body's pitch."""

    def pitch(value: float) -> Any:
        scene = expand(pair(value))
        return exact_pitch(value), {
            f"{SHIPPED}: pitch of the light body": equilibrium.solve(scene).pose.turn[2, 0, 2],
            "pitch, by the whole weight": balance_by_total_weight(scene).turn[2, 0, 2],
        }

    def modes(value: float) -> Any:
        drawn = registry.STRING.system(pair(value, 0.0))
        return given_omega_squared(drawn), {
            f"{SHIPPED}: ω² of all modes": np.sort(eigenmodes.solve(drawn).omega_squared),
            "ω², eigenvalues of M⁻¹K": naive.unscaled(drawn),
        }

    return Row(
        title="Masses from 1 t to 1 mg",
        driver="mass below one of a tonne (kg)",
        quantity="modes, and pitch by an offset of 10⁻⁶ of the size",
        value=np.asarray(mass),
        error=sample(mass, pitch) | sample(mass, modes),
        finding=(
            "Against the weight of a tonne, whatever a milligram pulls is rounding, and a light"
            " stage stays as drawn. The program judges the forces on a body by what it carries."
        ),
        limit="none found",
    )
