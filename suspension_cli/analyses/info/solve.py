"""Estimates of how complete a model a design needs, and the models that `auto` takes."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses import tables
from suspension_cli.analyses.analysis import Document, Log, Report, Settings, as_number

if TYPE_CHECKING:
    from suspension_cli.design.reader import Source
    from suspension_cli.linear.eigenmodes import Modes
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.models.auto import Refinement
    from suspension_cli.models.estimates import Estimates
    from suspension_cli.models.quantity_of_interest import Transfer
    from suspension_cli.models.registry import Choice


@dataclass(frozen=True, repr=False)
class Info(Report):
    """The models that a design needs for its modes, for one response and for its thermal noise.

    Attributes
    ----------
    source : Source
        The design, its TOML text (overrides applied) and the name of its file.
    tolerance : float
        Relative error that `auto` may leave.
    estimates : Estimates
        Changes of every mode by wire bending and wire mass, per stage.
    modes : Modes
        Those of the simplest valid model.
    choices : dict
        The model of every quantity, its estimated error and why it was chosen.
    refinements : dict
        Of every quantity except thermal noise, the refinements that were considered.
    """

    source: Source
    tolerance: float
    estimates: Estimates
    modes: Modes
    choices: dict[str, Choice]
    refinements: dict[str, tuple[Refinement, ...]]

    @property
    def change(self) -> Document:
        """Largest relative change of a mode by each refinement of each stage's wires, (s,) each."""
        from suspension_cli.models.base import BENDING, MASS

        return {BENDING: self.estimates.bending.max(0), MASS: self.estimates.mass.max(0)}

    def document(self) -> Document:
        """Return the JSON document that ``pendsus info --json`` prints."""
        choices = [
            {
                "quantity": quantity,
                "fidelity": choice.level,
                "estimated_error": as_number(choice.error),
                "reason": choice.reason,
                "refinements": [
                    {
                        "name": item.name,
                        "indicator": as_number(item.indicator),
                        "stage": item.stage,
                        "change": None if item.change is None else as_number(item.change),
                        "taken": item.taken,
                    }
                    for item in self.refinements.get(quantity, ())
                ],
            }
            for quantity, choice in self.choices.items()
        ]
        indicators = [
            {"stage": stage, "refinement": name, "value": as_number(float(values[n]))}
            for n, stage in enumerate(self.estimates.stage)
            for name, values in self.change.items()
        ]
        return {
            "command": "info",
            "design": self.name,
            "tolerance": self.tolerance,
            "indicators": indicators,
            "choices": choices,
        }

    def __str__(self) -> str:
        stages, change = self.estimates.stage, self.change
        lines = [self.title, ""]
        if stages:
            rows = zip(
                stages,
                *(_named(values, "without bound") for values in change.values()),
                _named(self.estimates.violin, "none"),
                strict=True,
            )
            columns = (
                {"stage": ""} | dict.fromkeys(change, ".1e") | {"first violin mode\nHz": ".4g"}
            )
            lines += [
                "Estimated largest relative change of a mode's frequency by the bending and the"
                " mass of each stage's wires:",
                tables.render(columns, rows),
            ]
        else:
            lines.append("No stage hangs on wires.")
        if any(np.isinf(values).any() for values in change.values()):
            from suspension_cli.models import auto

            why = auto.unrestrained_mode(self.modes, unstable=False)
            why = why or "a mode lies near or above the first violin mode of these wires"
            lines.append(f"  without bound: {why}")
        lines += ["", f"Models that auto takes, for a tolerance of {self.tolerance:g}:"]
        lines += [f"  {name}\n    {choice.line}" for name, choice in self.choices.items()]
        return "\n".join(lines)


def solve(source: Source, setting: Settings, log: Log) -> Info:
    """Choose the models of a design, with the options of ``pendsus info``.

    Raises
    ------
    InputError
        If the design does not balance, or a signal does not exist.
    """
    from suspension_cli.analyses.check import warnings
    from suspension_cli.design.derive import mirror
    from suspension_cli.errors import attribute_faults_to
    from suspension_cli.grids import parse_frequencies
    from suspension_cli.linear import eigenmodes, signals
    from suspension_cli.models import auto, registry
    from suspension_cli.models.estimates import Estimates
    from suspension_cli.models.quantity_of_interest import Frequencies, Transfer
    from suspension_cli.scene.fibres import explain_unsuitable

    design, tolerance = source.design, setting["tolerance"]
    frequency = np.array(parse_frequencies(setting["frequency"]))
    output = setting["output"] or f"{mirror(design)}.x"

    def transfer(model: LinearSystem) -> Transfer:
        known = signals.bodies_with_signals(model)
        return Transfer(
            [signals.parse_input(setting["drive"], known)],
            [signals.parse_output(output, known)],
            frequency,
        )

    span = f"{frequency.min():g} to {frequency.max():g} Hz"
    with attribute_faults_to(source.file):
        decisions = {
            "frequencies of the modes": auto.decide(design, lambda _: Frequencies(), tolerance),
            f"{output} / {setting['drive']}, {span}": auto.decide(design, transfer, tolerance),
        }
        choices = {quantity: decision.choice for quantity, decision in decisions.items()}
        if not explain_unsuitable(design, massive=True):
            choices[f"thermal noise of {output}, {span}"] = auto.for_thermal_noise(
                design, "auto", float(frequency.max()), tolerance
            )
        modes = eigenmodes.solve(registry.choose(design).model.system(design))
        found = Estimates(design, modes)
    warnings.warn_implausible(design, log)
    refinements = {quantity: decision.refinements for quantity, decision in decisions.items()}
    return Info(source, tolerance, found, modes, choices, refinements)


def _named(values: Iterable[float], infinite: str) -> list[float | str]:
    """Replace numbers that are not finite by words."""
    return [
        "unknown" if math.isnan(value) else infinite if math.isinf(value) else value
        for value in map(float, values)
    ]
