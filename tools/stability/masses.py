"""Masses from a tonne to a milligram: where a light imperfect stage hangs below a heavy one."""

from __future__ import annotations

from typing import Any

import numpy as np

from stability import naive
from stability.references import MP, Pair, design, given_omega_squared
from stability.row import SHIPPED, Row, relative
from suspension_cli.analysis import modes
from suspension_cli.design.scene import Scene
from suspension_cli.design.schema import Design
from suspension_cli.mechanics import equilibrium
from suspension_cli.mechanics.nominal import expand
from suspension_cli.mechanics.pose import displaced, layout, nominal_pose
from suspension_cli.mechanics.tangent import tangent
from suspension_cli.models import fidelity

MASS = 10.0 ** np.arange(3, -7, -1)
HEAVY = 1000.0
"""kg"""
OFFSET = 1e-6
"""Of one lower end of the light body's wires along x, as a share of the body's size."""
ABOVE = {"l": 1.0, "s": 0.2, "t1": 0.3, "t2": 0.3, "d": 0.01, "k": 5e6}
SIGNS = [(1, 1), (1, -1), (-1, 1), (-1, -1)]


def _below(mass: float) -> dict[str, float]:
    """Wires of a body of the density of glass, as stiff as its weight asks for."""
    size = (mass / 2200.0) ** (1 / 3)
    return {"l": 0.3, "s": 0.1 * size, "t1": 0.5 * size, "t2": 0.5 * size, "d": 0.02 * size, "k": 400 * mass * 9.81 / 0.3}


def pair(mass: float, share: float = OFFSET) -> Design:
    """A body of `mass` (kg) below one of a tonne, one of its wires attached a little off."""
    size = (mass / 2200.0) ** (1 / 3)
    bodies = ({"mass": HEAVY, "inertia": [60.0] * 3}, {"mass": mass, "inertia": [0.15 * mass * size**2] * 3})
    wires = ({"count": 4, **ABOVE}, {"count": 4, **_below(mass)})
    stages = [{"name": name, "body": body, "wires": one} for name, body, one in zip(("heavy", "light"), bodies, wires, strict=True)]
    imperfect = [{"wire": "light.1", "lower_offset": [share * size, 0.0, 0.0]}] if share else []
    return design({"design": {"name": "pair"}, "stage": stages, "perturbation": imperfect})


def exact_pitch(mass: float) -> float:
    """Pitch (rad) of the light body in 60 digits."""
    below, offset = _below(mass), OFFSET * (mass / 2200.0) ** (1 / 3)
    wires, drops = [], []
    for body, shape in enumerate((ABOVE, below)):
        shape = {name: MP.mpf(value) for name, value in shape.items()}
        tension = (MP.mpf(HEAVY) + MP.mpf(mass) if body == 0 else MP.mpf(mass)) * MP.mpf(9.81) / 4
        drops.append(shape["l"] + shape["d"])
        for n, (a, b) in enumerate(SIGNS):
            upper, lower = [a * shape["s"], b * shape["t1"], MP.zero], [a * shape["s"], b * shape["t2"], shape["d"]]
            if body and n == 0:
                lower[0] += MP.mpf(offset)
            wires.append((body, upper, lower, shape["k"], tension))
    return float(Pair((HEAVY, mass), drops, wires).settled().turn[1][0, 2])


def whole_weight(scene: Scene) -> Any:
    """Newton's method that stops where no force is more than 1e-12 of the whole weight, and no torque more than that times the largest lever arm."""
    numbering, pose = layout(scene), nominal_pose(scene)
    unit = float(scene.weight) * np.where(np.arange(numbering.size - 6) % 6 < 3, 1.0, 0.3)
    for _ in range(20):
        gradient, hessian = tangent(scene, numbering, pose)
        if (np.abs(gradient[6:]) < 1e-12 * unit).all():
            break
        step = np.linalg.solve(hessian[6:, 6:], -gradient[6:])
        pose = displaced(numbering, pose, np.concatenate([np.zeros(6), step]))
    return pose


def row(mass: Any = MASS) -> Row:
    """Modes of the pair as drawn, and pitch of the light body where it is built imperfectly."""
    error: dict[str, list[float]] = {}
    for value in mass:
        drawn, scene = fidelity.linear_model(pair(float(value), 0.0), "string"), expand(pair(float(value)))
        exact, reference = exact_pitch(float(value)), given_omega_squared(drawn)
        answers = {
            f"{SHIPPED}: pitch of the light body": relative(equilibrium.solve(scene).pose.turn[2, 0, 2], exact),
            f"{SHIPPED}: ω² of all modes": relative(np.sort(modes.solve(drawn).omega_squared), reference),
            "pitch, by the whole weight": relative(whole_weight(scene).turn[2, 0, 2], exact),
            "ω², eigenvalues of M⁻¹K": relative(naive.unscaled(drawn), reference),
        }
        for name, off in answers.items():
            error.setdefault(name, []).append(float(off.max()))
    return Row(
        title="Masses from 1 t to 1 mg",
        driver="mass below one of a tonne (kg)",
        quantity="modes, and pitch by an offset of 10⁻⁶ of the size",
        value=np.asarray(mass),
        error={name: np.array(values) for name, values in error.items()},
        finding=(
            "Balanced against the weight of a tonne, whatever a milligram pulls is rounding, and a light stage stays as drawn. "
            "The program judges the forces on every body by what that body carries; eigenvalues do not mind, as each mass scales its own rows."
        ),
        limit="none found",
    )
