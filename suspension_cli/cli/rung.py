"""The rung of the ladder of models that a command takes, what that leaves out, and its model."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from suspension_cli.cli import limits, options

if TYPE_CHECKING:
    from suspension_cli.analysis.asked import Asked
    from suspension_cli.analysis.auto import Decision
    from suspension_cli.cli.analyses import Read
    from suspension_cli.mechanics.model import LinearModel
    from suspension_cli.models.fidelity import Choice

    Asker = Callable[[LinearModel], Asked]

TOLD = 0.01
"""Relative error from which it is a warning what a rung leaves out that was not asked for."""
DIFFERENTIABLE = {"string": "general string model, whose derivatives are exact", "beam": "beam model, derivatives by differences"}
"""Rungs that have derivatives; the first unless another is asked for."""


def weighed(source: Read, wanted: str, asker: Asker | None = None, tolerance: float = options.TOLERANCE, top: str = "violin") -> Decision:
    """The rung up to `top` that what is asked for needs (without `asker`, the frequencies of modes), or the one that is `wanted`.

    Raises
    ------
    InputError
        If a rung is wanted that does not hold.
    """
    from suspension_cli.analysis import auto
    from suspension_cli.analysis.asked import Frequencies
    from suspension_cli.models import fidelity as ladder

    asker = asker or (lambda _: Frequencies())
    if wanted == "auto":
        return auto.decide(source.design, asker, tolerance, top)
    return auto.left_out(source.design, ladder.choose(source.design, wanted), asker)


def constant(source: Read, wanted: str, tolerance: float) -> Decision:
    """The same where matrices must not depend on frequency.

    Raises
    ------
    InputError
        If wires with mass are asked for.
    """
    from suspension_cli.errors import Fault, InputError, shown

    if wanted == "violin":
        problem = "does not hold here: wires with mass have no state space of finite order"
        raise InputError([Fault("--fidelity", problem, "take beam, which holds below the first violin mode", shown(wanted))])
    return weighed(source, wanted, tolerance=tolerance, top="beam")


def imperfect(source: Read, wanted: str, levels: tuple[str, ...]) -> Choice:
    """The rung for imperfect builds, of those that have them: the first unless another is asked for.

    Raises
    ------
    InputError
        If one is asked for that has none.
    """
    from suspension_cli.errors import Fault, InputError, shown
    from suspension_cli.models import fidelity as ladder

    if wanted not in ("auto", *levels):
        others = ", ".join(("auto", *levels[:-1]))
        raise InputError([Fault("--fidelity", "does not hold for imperfect builds", f"take {others} or {levels[-1]}", shown(wanted))])
    if wanted in levels[1:]:
        return ladder.choose(source.design, wanted)
    return ladder.Choice(levels[0], f"general {levels[0]} model, as imperfect builds need it")


def several(texts: list[str] | tuple[str, ...]) -> Asker:
    """What is asked for by names of numbers; all modes if there are none."""
    from suspension_cli.analysis import modes, scalars, signals
    from suspension_cli.analysis.asked import Several

    def asked(model: LinearModel) -> Several:
        found = modes.solve(dataclasses.replace(model, terms=()))
        return Several(scalars.parse(list(texts) or [scalars.ALL], found, signals.bodies(model)), found)

    return asked


def differentiable(wanted: str, source: Read, asker: Asker) -> Decision:
    """The rung that has exact derivatives, or `beam` if that is asked for.

    Raises
    ------
    InputError
        If another is asked for, or the design says too little for `beam`.
    """
    from suspension_cli.analysis import auto
    from suspension_cli.errors import Fault, InputError, shown
    from suspension_cli.models import fidelity as ladder

    if wanted not in ("auto", *DIFFERENTIABLE):
        raise InputError([Fault("--fidelity", "has no derivatives", "take auto, string or beam", shown(wanted))], source.file)
    level = "string" if wanted == "auto" else ladder.choose(source.design, wanted).level
    return auto.left_out(source.design, ladder.Choice(level, DIFFERENTIABLE[level]), asker)


def stood(source: Read, choice: Choice, allow_unstable: bool, voice: options.Voice, model: LinearModel | None = None, *, bends: bool = False) -> LinearModel:
    """The linear model on a rung, if its equilibrium is stable or may be unstable.

    `bends` says that ``beam`` may be asked for, which is told of where only strings fall over.

    Raises
    ------
    InputError
        If it is unstable and that is not allowed.
    """
    from suspension_cli.analysis import modes
    from suspension_cli.errors import Fault, InputError
    from suspension_cli.models import fidelity as ladder

    model = ladder.linear_model(source.design, choice.level) if model is None else model
    voice.detail(f"{source.design.design.name}: {choice.level}: {choice.reason}; balanced to {model.residual:.0e} of the weight")
    found = modes.solve(dataclasses.replace(model, terms=()))
    if not found.stable:
        worst = f"{found.label[0]} grows at {found.growth_rate[0]:.4g} 1/s"
        if not allow_unstable:
            way = "take --fidelity beam, whose wires hold it by bending," if bends and _held(source, choice) else "make it stable (raise d, say),"
            raise InputError([Fault("stage", f"the equilibrium is unstable: {worst}", f"{way} or give --allow-unstable")])
        voice.warn(f"{source.design.design.name} is unstable: {worst}")
    limits.warn(source.design, model, found, voice)
    return model


def _held(source: Read, choice: Choice) -> bool:
    """Whether wires that bend make a design stable that is not on strings."""
    from suspension_cli.analysis import modes
    from suspension_cli.errors import InputError
    from suspension_cli.models import fidelity as ladder

    if choice.level in ("beam", "violin") or ladder.unsuited(source.design, "beam"):
        return False
    try:
        return modes.solve(ladder.linear_model(source.design, "beam")).stable
    except InputError:  # it does not balance there
        return False


def estimate(choice: Choice) -> float | None:
    """The estimated relative error of a rung, for JSON."""
    return choice.error if math.isfinite(choice.error) else None


def tell(source: Read, decision: Decision, voice: options.Voice, levels: tuple[str, ...] = ()) -> None:
    """Warn of what a rung leaves out that nobody chose; `levels` are what the command takes instead."""
    choice = decision.choice
    if choice.error > TOLD:
        better = next((f"--fidelity {level} has it" for level in levels if level == decision.needed), "modes, response and thermal have it")
        size = f"{100 * choice.error:.2g} %" if choice.error < 1 else "100 % or more"
        voice.warn(f"{source.design.design.name}: what {choice.level} leaves out changes {decision.missed} by {size}; {better}")
