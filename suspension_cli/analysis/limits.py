"""How close a design is to where its answers end: digits lost, bodies about to tip over, wires about to go slack.

`results/stability.md` shows where each of these bites.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from suspension_cli.analysis import graded, statics
from suspension_cli.analysis.modes import Modes
from suspension_cli.design.scene import Array
from suspension_cli.design.schema import Design
from suspension_cli.errors import InputError
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.mechanics.nominal import expand
from suspension_cli.mechanics.shares import loads

DIGITS = 1e-4
"""Relative error of a frequency that is worth a warning."""
TIPPING = 1e-4
"""m; how little wires may be lowered before a body tips over, below which nobody builds."""
SLACK = 0.01
"""Tension of a wire as a share of the mean of its stage, below which it is about to go slack."""
BALANCE = 1e-6
"""Residual of an equilibrium, of the weight, that is worth a warning."""


@dataclass(frozen=True)
class Near:
    """What is near a limit: its name and a number."""

    name: str
    value: float


@dataclass(frozen=True)
class Limits:
    """Everything about a design that is near a limit; None where nothing is.

    Attributes
    ----------
    digits : Near or None
        The mode that rounding in the stiffness matrix has hit most, and its relative error of frequency.
    tipping : Near or None
        The mode that is next to turn unstable, and by how much (m) lowering the lower ends of all wires on their bodies does it.
    slack : Near or None
        The wire with the smallest share of the mean tension of its stage.
    balance : float
        Residual of the equilibrium, of the weight, if it is above `BALANCE`, else 0.
    """

    digits: Near | None
    tipping: Near | None
    slack: Near | None
    balance: float


def of(design: Design, model: LinearModel, found: Modes) -> Limits:
    """The limits that a design is near.

    Parameters
    ----------
    design : Design
    model : LinearModel
        On the rung of the modes (at rest: for `violin`, that of `beam`).
    found : Modes
    """
    still = (found.order == 0) & (found.omega_squared != 0)
    digits = np.where(still, _lost(model, found), 0.0)
    height = np.where(still & (found.omega_squared > 0), tipping_height(design, found), np.inf)
    return Limits(
        digits=_near(found.label, digits, int(digits.argmax()), worth=bool((digits > DIGITS).any())),
        tipping=_near(found.label, height, int(height.argmin()), worth=bool((height < TIPPING).any())),
        slack=_slackest(design) if _may_differ(design) else None,
        balance=model.residual if model.residual > BALANCE else 0.0,
    )


def _lost(model: LinearModel, found: Modes) -> Array:
    with np.errstate(divide="ignore"):
        return graded.lost(model, found.omega_squared, found.shape)


def tipping_height(design: Design, found: Modes) -> Array:
    """By how much (m) the wires' lower ends may come down on all bodies before each mode (m,) grows; infinite where that takes nothing from it.

    Lowering the ends by h takes W h from the stiffness of each body against roll and pitch, W the weight that it carries: gravity's share of
    equations 10 to 14 of Husman et al. (2000).  A mode of unit modal mass has omega^2 = h sum of W (roll^2 + pitch^2) to lose.
    """
    load = loads(expand(design))
    turns = found.shape[:, : 6 * len(found.body)].reshape(len(found.shape), -1, 6)[:, :, 3:5]
    per_metre = ((turns**2).sum(-1) * load).sum(-1)
    return np.where(per_metre > 0, found.omega_squared / np.where(per_metre > 0, per_metre, 1.0), np.inf)


def slackest(design: Design, carried: statics.Carried) -> Near | None:
    """The wire that carries the smallest share of the mean tension of its stage, if that is below `SLACK`."""
    worst = Near("", np.inf)
    for stage in design.stage:
        own = [wire for wire in carried.wires if wire.label.rsplit(".", 1)[0] == stage.name]
        mean = sum(wire.tension for wire in own) / max(len(own), 1)
        for wire in own:
            if wire.tension < worst.value * mean:
                worst = Near(wire.label, wire.tension / mean)
    return worst if worst.value < SLACK else None


def _slackest(design: Design) -> Near | None:
    """The same from the design; None too where it balances only on wires that bend."""
    try:
        return slackest(design, statics.solve(design))
    except InputError:
        return None


def _may_differ(design: Design) -> bool:
    """Whether wires of one stage may carry different tensions."""
    return bool(design.perturbation) or any(stage.wire for stage in design.stage)


def _near(names: list[str], values: Array, which: int, *, worth: bool) -> Near | None:
    return Near(names[which], float(values[which])) if worth else None
