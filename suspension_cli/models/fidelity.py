"""Which rung of the ladder of models a design needs, and the linear model on that rung."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from suspension_cli.design import fibres
from suspension_cli.design.scene import Scene
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, shown
from suspension_cli.mechanics import assemble, distributed
from suspension_cli.mechanics.gas import body_damping
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.mechanics.nominal import expand
from suspension_cli.models import closed_form, force
from suspension_cli.models.surroundings import surrounded

LEVELS = ("auto", "closed-form", "force", "string", "beam", "violin")
"""What `--fidelity` takes, from the quickest rung to the most general one."""


@dataclass(frozen=True)
class Choice:
    """A rung and why it was taken, in one line for the user; the estimated relative error of what is asked for, NaN where none was estimated."""

    level: str
    reason: str
    error: float = math.nan


def choose(design: Design, wanted: str = "auto") -> Choice:
    """The rung for a design.

    Parameters
    ----------
    design : Design
    wanted : str
        One of `LEVELS`; ``auto`` looks at the structure of the design only (`analysis.auto` weighs what is asked for too).

    Raises
    ------
    InputError
        If the rung asked for does not hold for the design.
    """
    if wanted == "auto":
        why = force.unsuited(design)
        if why:
            return Choice("string", f"general string model, as {why}")
        return Choice("force", "force model of a symmetric chain" + _approximation(design))
    why = unsuited(design, wanted)
    if why:
        raise InputError([Fault("--fidelity", f"does not hold for {design.design.name}: {why}", "take auto or string", shown(wanted))])
    return Choice(wanted, "as asked" + (_approximation(design) if wanted == "force" else ""))


def approximate(design: Design) -> bool:
    """Whether the force model only approximates a design that it holds for."""
    return bool(force.series_is_approximate(design))


def unsuited(design: Design, level: str) -> str:
    """Why a rung does not hold for a design; "" if it does."""
    if level in ("beam", "violin"):
        return fibres.unsuited(design, massive=level == "violin")
    return {"closed-form": closed_form.unsuited, "force": force.unsuited, "string": lambda _: ""}[level](design)


def _approximation(design: Design) -> str:
    stages = force.series_is_approximate(design)
    if not stages:
        return ""
    return f"; blades under angled wires ({', '.join(stages)}) are taken in series with them, --fidelity string does without that"


def linear_model(design: Design, level: str) -> LinearModel:
    """The linear model of a design on one rung (not ``auto``), with its dampers and its support structure."""
    if level == "closed-form":
        model = closed_form.linear_model(design)
    elif level == "force":
        model = force.linear_model(design)
    elif level == "string":
        model = assemble.linear_model(expand(design))
    else:
        scene, drag = bending(expand(design), design)
        model = distributed.linear_model(scene, drag, massive=level == "violin")
    return surrounded(model, design)


def bending(scene: Scene, design: Design) -> tuple[Scene, distributed.Drag]:
    """A scene (any batch of builds) of a design with what its wires are made of, and the damping of its bodies by the gas around them."""
    wires = fibres.fibres(design)
    drag = tuple(body_damping(stage.body, wires.gas) for stage in design.stage) if wires.gas is not None else ()
    return replace(scene, fibres=wires), drag
