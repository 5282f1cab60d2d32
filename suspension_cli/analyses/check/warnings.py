"""Warnings of analyses about implausible designs and designs near a limit."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Log
    from suspension_cli.design.schema import Design
    from suspension_cli.linear.eigenmodes import Modes
    from suspension_cli.scene.arrays import Array


def warn_implausible(design: Design, log: Log) -> None:
    """Warn of implausible numbers that make results meaningless."""
    from suspension_cli.analyses.check import findings

    for item in findings.find_serious(design):
        log.warn(f"{design.design.name}: {item.line}")


def warn(design: Design, modes: Modes, log: Log) -> None:
    """Warn of implausible numbers of a design, of a mode about to tip over and of slack wires."""
    import contextlib

    from suspension_cli.analyses.check import findings, statics
    from suspension_cli.errors import InputError

    warn_implausible(design, log)
    if tipping := findings.describe_tipping(design, modes):
        log.warn(f"{design.design.name}: {tipping}")
    # tensions differ in a stage; bending alone may balance the wires
    if design.perturbation or any(stage.wire for stage in design.stage):
        with contextlib.suppress(InputError):
            for item in findings.find_slackest(statics.solve(design)):
                log.warn(f"{design.design.name}: {item.line}")


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
