"""Warnings of designs near a limit, each with its number."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from suspension_cli.analysis.limits import Limits, Near
    from suspension_cli.analysis.modes import Modes
    from suspension_cli.cli.options import Voice
    from suspension_cli.design.lossless import Lossless
    from suspension_cli.design.schema import Design
    from suspension_cli.mechanics.model import LinearModel


def implausible(design: Design, voice: Voice) -> None:
    """Warn of numbers with which answers mean nothing; `pendsus check` lists the others too."""
    from suspension_cli.analysis import plausible

    for doubt in plausible.serious(design):
        voice.warn(f"{design.design.name}: {doubt.line}")


def warn(design: Design, model: LinearModel, found: Modes, voice: Voice) -> None:
    """Say what about a design is hard to believe or near a limit."""
    from suspension_cli.analysis import limits

    implausible(design, voice)
    for line in told(limits.of(design, model, found)):
        voice.warn(f"{design.design.name}: {line}")


def warn_on(design: Design, level: str, found: Modes, voice: Voice) -> None:
    """The same for modes found on a rung."""
    from suspension_cli.models import fidelity as ladder

    warn(design, ladder.linear_model(design, "beam" if level == "violin" else level), found, voice)


def told(near: Limits) -> list[str]:
    """A line for each limit."""
    lines = []
    if near.digits is not None:
        lines.append(f"wires so stiff leave soft modes few digits: {near.digits.name} is known to {near.digits.value:.1e} of its frequency")
    if near.tipping is not None:
        lines.append(f"{near.tipping.name} is close to unstable: wires attached {1e3 * near.tipping.value:.2g} mm lower would tip it over")
    if near.slack is not None:
        lines.append(slack(near.slack))
    if near.balance:
        lines.append(f"balanced to {near.balance:.0e} of the weight only, as rounding of the lengths of its stiffest wires allows")
    return lines


def slack(near: Near) -> str:
    """The line about a wire."""
    return f"wire {near.name} is about to go slack: it carries {100 * near.value:.2g} % of the mean tension of its stage"


def lossless(found: list[Lossless], level: str) -> list[str]:
    """The lines about what has no loss in a model: one for what dissipates nothing, one for what lacks the loss of the bulk alone."""
    from suspension_cli.design.lossless import BENDING

    lines = []
    nothing, warm = [one for one in found if not one.thermoelastic], [one for one in found if one.thermoelastic]
    if nothing:
        own = "" if level in BENDING else f" in the {level} model, which knows only loss angles that the design itself gives"
        lines.append(f"no loss{own}: {_parts(nothing)}; they add no thermal noise and do not limit Q; {_remedy(nothing)}")
    if warm:
        lines.append(f"no loss of the bulk, only thermoelastic loss where they bend: {_parts(warm)}; thermal noise is too low and Q too high; {_remedy(warm)}")
    return lines


def _remedy(found: list[Lossless]) -> str:
    """Where to give the loss of parts that have none."""
    made = sorted({f"materials.{name}.loss_angle" for one in found for name in one.material})
    others = [one.part for one in found if not one.material]
    return "give " + " and ".join(made + ([f"loss_angle of {', '.join(others)}"] if others else []))


def _parts(found: list[Lossless]) -> str:
    """Parts with their materials: ``upper.blades, test.wires (steel302)``."""
    return ", ".join(one.part + (f" ({', '.join(one.material)})" if one.material else "") for one in found)
