"""Limits of validity: bodies close to tipping over, nearly slack wires.

`results/stability.md` shows where each matters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from suspension_cli.analyses.check import statics
from suspension_cli.design.schema import Design
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.equilibrium.residual_scale import carried_weights
from suspension_cli.errors import InputError
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.arrays import Array

TIPPING = 1e-4
"""Lowering of the wires that makes a body unstable, m, below which there is a warning."""
SLACK = 0.01
"""Fraction of the mean tension of its stage below which a wire is about to go slack."""
BALANCE = 1e-6
"""Residual of an equilibrium over the weight above which there is a warning."""


@dataclass(frozen=True)
class NearLimit:
    """A mode or wire near a limit, with its height (m) or fraction; see `Limits`."""

    name: str
    value: float


@dataclass(frozen=True)
class Limits:
    """Limits that a design is near; None where it is not.

    Attributes
    ----------
    tipping : NearLimit or None
        The mode closest to instability, and the `compute_tipping_height` of it.
    slack : NearLimit or None
        The wire with the smallest tension over the mean of its stage.
    balance : float
        Residual of the equilibrium over the weight if above `BALANCE`, else 0.
    """

    tipping: NearLimit | None
    slack: NearLimit | None
    balance: float


def find_limits(design: Design, model: LinearSystem, found: Modes) -> Limits:
    """Find the limits that a design is near; `model` is the beam model for violin modes."""
    bodily = (found.order == 0) & (found.omega_squared != 0)
    height = np.where(
        bodily & (found.omega_squared > 0), compute_tipping_height(design, found), np.inf
    )
    n = int(height.argmin())
    lowest = NearLimit(found.label[n], float(height[n]))
    return Limits(
        tipping=lowest if lowest.value < TIPPING else None,
        slack=_slackest_of(design),
        balance=model.residual if model.residual > BALANCE else 0.0,
    )


def compute_tipping_height(design: Design, found: Modes) -> Array:
    """Lowering (m,) of the wires' lower ends on all bodies that makes each mode unstable, m.

    Infinite for modes that do not depend on it. Lowering by h reduces the stiffness of each body
    against roll and pitch by W h, with the weight W that it carries (gravity terms of equations 10
    to 14 of Husman et al. (2000)). A mode of unit modal mass is unstable at
    h sum of W (roll^2 + pitch^2) = omega^2.
    """
    load = carried_weights(expand(design))
    turns = found.shape[:, : 6 * len(found.body)].reshape(len(found.shape), -1, 6)[:, :, 3:5]
    per_metre = ((turns**2).sum(-1) * load).sum(-1)
    return np.where(
        per_metre > 0, found.omega_squared / np.where(per_metre > 0, per_metre, 1.0), np.inf
    )


def find_slackest(design: Design, carried: statics.Statics) -> NearLimit | None:
    """Find the wire with the smallest fraction of its stage's mean tension, if below `SLACK`."""
    worst = NearLimit("", np.inf)
    for stage in design.stage:
        own = [wire for wire in carried.wires if wire.label.rsplit(".", 1)[0] == stage.name]
        mean = sum(wire.tension for wire in own) / max(len(own), 1)
        for wire in own:
            if wire.tension < worst.value * mean:
                worst = NearLimit(wire.label, wire.tension / mean)
    return worst if worst.value < SLACK else None


def _slackest_of(design: Design) -> NearLimit | None:
    """Find the slackest wire, if tensions of a stage may differ."""
    if not design.perturbation and not any(stage.wire for stage in design.stage):
        return None
    try:
        return find_slackest(design, statics.solve(design))
    except InputError:  # only wires that bend balance it
        return None
