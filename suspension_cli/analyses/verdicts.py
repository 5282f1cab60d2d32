"""Verdicts on the `[[requirement]]` tables of a design: values, margins, table and JSON.

`check` prints them, `report` on its first page, `compare` for each of its designs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from suspension_cli.analyses import tables
from suspension_cli.analyses.named_quantities import names_of
from suspension_cli.quantities import requirements

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Document
    from suspension_cli.design.reader import Source
    from suspension_cli.physics.log import Log
    from suspension_cli.quantities.requirements import Requirement, Verdict


def find_requirements(source: Source, log: Log | None = None) -> tuple[Requirement, ...]:
    """Look up what `[[requirement]]` of a design limits; `log` is warned of an assumed ground.

    Raises `InputError` if a requirement names no quantity of the design, or can never be met.
    """
    wanted = requirements.of_design(source.design)
    if not wanted:
        return ()
    return requirements.find(wanted, names_of(source, log=log))


def judge(source: Source, level: str | None, log: Log) -> tuple[Verdict, ...]:
    """Evaluate what `[[requirement]]` of a design limits, in a model by its name.

    Nothing is known without a model. Raises `InputError` if a requirement names no quantity of the
    design.
    """
    if level is None:
        return ()
    found = find_requirements(source, log)
    return requirements.judge(found, source.design, level) if found else ()


def document(verdict: Verdict) -> Document:
    """Return a verdict as JSON."""
    limits = verdict.requirement.limits
    return {
        "quantity": verdict.requirement.quantity.text,
        "unit": verdict.requirement.quantity.unit,
        "at_least": limits.low,
        "at_most": limits.high,
        "note": limits.note,
        "value": verdict.value,
        "margin": verdict.margin,
        "met": verdict.met,
        "model": verdict.model,
    }


def tabulate(verdicts: Sequence[Verdict]) -> str:
    """Return the table of requirements, with their values and margins."""
    rows = []
    for verdict in verdicts:
        outcome = "met" if verdict.met else "NOT met"
        margin = 100 * verdict.margin
        value = _write_value(verdict)
        rows.append((outcome, value, margin, verdict.model, verdict.requirement.description))
    columns = {"": "", "value": " ", "margin\n%": "+.3g", "model": "", "requirement": ""}
    return tables.render(columns, rows)


def _write_value(verdict: Verdict) -> str:
    """Write the value with its unit, why it is 0, or why there is none."""
    quantity = verdict.requirement.quantity
    if math.isnan(verdict.value):
        return f"none: {quantity.missing}"
    if verdict.value == 0:
        return f"0 {quantity.zero}"
    unit, factor = verdict.requirement.displayed
    return f"{verdict.value * factor:.5g} {unit}".rstrip()


def summarise(verdicts: Sequence[Verdict]) -> str:
    """Say in one line how many requirements a design meets."""
    failed = [verdict for verdict in verdicts if not verdict.met]
    count = len(verdicts)
    if not failed:
        return "The requirement is met." if count == 1 else f"All {count} requirements are met."
    if count == 1:
        return "The requirement is NOT met."
    if len(failed) == count:
        return f"None of the {count} requirements is met."
    word = "is" if len(failed) == 1 else "are"
    return f"{len(failed)} of {count} requirements {word} NOT met."
