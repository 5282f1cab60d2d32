"""Warnings about implausible designs and designs near a limit."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Log
    from suspension_cli.analyses.check.limits import Limits, NearLimit
    from suspension_cli.analyses.check.lossless import Lossless
    from suspension_cli.design.schema import Design
    from suspension_cli.linear.eigenmodes import Modes
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.models.base import Model
    from suspension_cli.scene.arrays import Array

MOST_PARTS = 10
"""Most parts that a warning lists."""
SHARE = "move its ends, or give it its share of the load"
"""What to do about a wire that is about to go slack."""


def warn_implausible(design: Design, log: Log) -> None:
    """Warn of implausible numbers that make results meaningless."""
    from suspension_cli.analyses.check import plausible

    for item in plausible.find_serious(design):
        log.warn(f"{design.design.name}: {item.line}")


def warn(design: Design, model: LinearSystem, found: Modes, log: Log) -> None:
    """Warn of implausible numbers of a design and of limits that it is near."""
    from suspension_cli.analyses.check import limits

    warn_implausible(design, log)
    for line in describe_limits(limits.find_limits(design, model, found)):
        log.warn(f"{design.design.name}: {line}")


def warn_of_modes(design: Design, model: Model, found: Modes, log: Log) -> None:
    """Warn of a design near a limit, given its modes in a model."""
    from suspension_cli.models import registry

    simpler = registry.BEAM if model.has_wire_mass else model
    warn(design, simpler.system(design), found, log)


def warn_of_tables(design: Design, frequency: Array, log: Log) -> None:
    """Warn of links whose tables of stiffness do not reach frequencies (f,) in Hz."""
    for link in design.link:
        if link.table is None:
            continue
        low, high = link.table.frequency[0], link.table.frequency[-1]
        if min(frequency) < low or max(frequency) > high:
            log.warn(
                f"{design.design.name}: the table of link {link.name} covers {low:g} to {high:g}"
                " Hz; outside, its stiffness is taken as constant; extend the table if that matters"
            )


def describe_limits(near: Limits) -> list[str]:
    """Describe each limit in one line."""
    lines = []
    if near.tipping is not None:
        lines.append(
            f"{near.tipping.name} is close to unstable: attaching the wires"
            f" {1e3 * near.tipping.value:.2g} mm lower makes it unstable; raise d"
        )
    if near.slack is not None:
        lines.append(f"{describe_slack(near.slack)}; {SHARE}")
    if near.balance:
        lines.append(
            f"the equilibrium has a residual of {near.balance:.0e} of the weight, from rounding of"
            " the lengths of its stiffest wires; check their stiffness"
        )
    return lines


def describe_slack(near: NearLimit) -> str:
    """Describe a wire about to go slack."""
    return (
        f"wire {near.name} is about to go slack: it carries {100 * near.value:.2g} % of the mean"
        " tension of its stage"
    )


def describe_lossless(found: list[Lossless], level: str) -> list[str]:
    """Describe parts without loss in the model `level`, and parts with loss only in bending."""
    from suspension_cli.models import registry

    lines = []
    nothing = [one for one in found if not one.bending]
    partial = [one for one in found if one.bending]
    if nothing:
        own = (
            ""
            if registry.by_name(level).bends_wires
            else f" in the {level} model, which uses only loss angles given in the design"
        )
        lines.append(
            f"no loss{own}: {_parts(nothing)}; they add no thermal noise and do not limit Q;"
            f" {_remedy(nothing)}"
        )
    if partial:
        names = " and ".join(dict.fromkeys(name for one in partial for name in one.bending))
        lines.append(
            f"no bulk loss, only {names} loss where they bend: {_parts(partial)};"
            f" thermal noise is too low and Q too high; {_remedy(partial)}"
        )
    return lines


def _remedy(found: list[Lossless]) -> str:
    """Name the keys that give these parts a loss."""
    made = sorted({f"materials.{name}.loss_angle" for one in found for name in one.material})
    others = [one.part for one in found if not one.material]
    return "give " + " and ".join(made + ([f"loss_angle of {', '.join(others)}"] if others else []))


def _parts(found: list[Lossless]) -> str:
    """List at most `MOST_PARTS` parts with materials: ``upper.blades, test.wires (steel302)``."""
    shown = found if len(found) <= MOST_PARTS else found[: MOST_PARTS - 1]
    listed = ", ".join(
        one.part + (f" ({', '.join(one.material)})" if one.material else "") for one in shown
    )
    return listed + (f" and {len(found) - len(shown)} more" if len(shown) < len(found) else "")
