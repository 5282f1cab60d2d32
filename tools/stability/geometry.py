"""Extreme geometries: pitch about to tip over, wires about to go slack."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear import eigenmodes
from suspension_cli.models import registry
from suspension_cli.physics import statics
from tools.stability.energy import Stage
from tools.stability.references import (
    INERTIA,
    MASS,
    MP,
    SHAPE,
    design,
    document,
    stage,
)
from tools.stability.row import SHIPPED, Row, sample

DISTANCE = 10.0 ** np.arange(1, -15, -1)
LEFT = 10.0 ** np.arange(0, -14.1, -1)
CLOSE = 5e-4
"""Half the distance of the wires in x for soft pitch, m."""


def tipping_height(s: float = CLOSE) -> Any:
    """Height d (m) below which a mass on four vertical wires tips over in pitch, in 60 digits.

    By equations 10 to 14 of Husman et al. (2000) a pitch p with x free to follow costs (K_pp -
    K_xp^2 / K_xx) p^2 / 2 with K_xx = m g / l, K_xp = m g d / l and K_pp = 4 k s^2 + m g d + m g
    d^2 / l. That is 4 k s^2 + m g d, which vanishes at d = -4 k s^2 / (m g).
    """
    return -4 * MP.mpf(SHAPE["k"]) * MP.mpf(s) ** 2 / (MP.mpf(MASS) * MP.mpf(9.81))


def lowest(d: float, s: float = CLOSE) -> Any:
    """Smaller omega^2 of longitudinal and pitch from these equations, in 60 digits."""
    weight, length, height, half = (
        MP.mpf(MASS) * MP.mpf(9.81),
        MP.mpf(SHAPE["l"]),
        MP.mpf(d),
        MP.mpf(s),
    )
    x = weight / length / MP.mpf(MASS)
    pitch = (
        4 * MP.mpf(SHAPE["k"]) * half**2 + weight * height + weight * height**2 / length
    ) / MP.mpf(INERTIA[1])
    across = (weight * height / length) ** 2 / (MP.mpf(MASS) * MP.mpf(INERTIA[1]))
    return (x + pitch - MP.sqrt((x - pitch) ** 2 + 4 * across)) / 2


def soft_pitch(distance: Any = DISTANCE) -> Row:
    """Compute errors of the lowest omega^2 of x and pitch, on both sides of tipping over."""
    critical = tipping_height()
    error: dict[str, Any] = {}
    for side, sign in (("still stable", -1), ("tipped over", 1)):

        def compute(value: float, side: str = side, sign: int = sign) -> Any:
            d = float(critical * (1 + sign * MP.mpf(value)))
            one = design(document(s=CLOSE, d=d))
            model = registry.STRING.system(one)
            found = eigenmodes.solve(model)
            mine = found.omega_squared[(found.energy[:, 0, 0] + found.energy[:, 0, 4]) > 0.5].min()
            answers = {f"{SHIPPED}: {side}": mine}
            if sign < 0:
                answers["difference quotients of energy"] = _softest(one)
                answers["eigenvalues of M⁻¹K"] = np.linalg.eigvals(
                    model.stiffness[6:, 6:] / np.diag(model.mass)[6:, None]
                ).real.min()
            return float(lowest(d)), answers

        error |= sample(distance, compute)
    return Row(
        title="Pitch: soft, then unstable",
        driver="height of the wires above tipping, |d / d_c − 1|",
        quantity="lowest ω² of longitudinal and pitch",
        value=np.asarray(distance),
        error=error,
        finding=(
            f"At d = −4 k s² / (m g) (here −{-1e3 * float(critical):.4f} mm)"
            " stretch and gravity cancel; difference quotients have no digits left from 10⁻⁵ on."
            " Closed forms distinguish stable from unstable down to 10⁻¹¹ of that height."
        ),
        limit=(
            "ε / distance, from 10⁻¹² on reported as rigid; `modes` warns within 0.1 mm of tipping"
        ),
    )


def _softest(one: Design) -> float:
    """Lowest omega^2 of longitudinal and pitch by difference quotients of the energy."""
    block = np.array([0, 4])
    quotients = Stage.nominal(expand(one)).quotients()[np.ix_(block, block)]
    return float(np.linalg.eigvals(quotients / np.array([MASS, INERTIA[1]])[:, None]).real.min())


def nearly_slack(left: Any = LEFT) -> Row:
    """Compute errors of the smallest tension of four wires of which one is too long."""
    critical = slack_length()
    nominal = MP.mpf(MASS) * MP.mpf(9.81) / 4
    slope = (_tension(critical * MP.mpf("1e-6")) - nominal) / (critical * MP.mpf("1e-6"))

    def compute(value: float) -> Any:
        change = float(critical * (1 - MP.mpf(value)))
        one = design(document() | {"perturbation": [{"wire": "test.1", "length_change": change}]})
        settled = Stage.nominal(expand(one)).balanced()
        return float(_tension(change)), {
            SHIPPED: min(wire.tension for wire in statics.solve(one).wires),
            "lengths from coordinates": settled.wires[3].min(),
            "in proportion to the length": float(nominal + slope * MP.mpf(change)),
        }

    return Row(
        title="Wires about to go slack",
        driver="tension left, fraction of the nominal one",
        quantity="the smallest tension",
        value=np.asarray(left),
        error=sample(left, compute),
        finding=(
            f"A wire that is {1e3 * float(critical):.3f} mm"
            " too long carries nothing; close to that its tension is a small difference of"
            " lengths. With elongations counted from the nominal pose, it ends in rounding alone."
        ),
        limit=(
            "ε / tension left; a warning below 1 % of the stage's mean, and a slack wire is refused"
        ),
    )


def _tension(change: Any) -> Any:
    """Smallest tension (60 digits) with wire 1 longer than drawn by `change` (m)."""
    one = stage(length=change).settle()
    result = []
    for wire in one.wires:
        span = one.centre + one.turn * wire.lower - wire.upper
        result.append(wire.k * (MP.sqrt(sum(x * x for x in span)) - wire.natural))
    return min(result)


@cache
def slack_length() -> Any:
    """Change of length (m) at which the first wire goes slack, by secants in 60 digits."""
    a, b = MP.mpf("1e-3"), MP.mpf("2e-3")
    at, bt = _tension(a), _tension(b)
    for _ in range(20):
        a, at, b = b, bt, b - bt * (b - a) / (bt - at)
        bt = _tension(b)
        if abs(b - a) < MP.mpf(10) ** -35:
            break
    return b
