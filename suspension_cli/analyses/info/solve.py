"""Errors of the models of a design, and the models that `auto` takes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses import tables
from suspension_cli.analyses.analysis import Document, Log, Report, Settings, as_number

if TYPE_CHECKING:
    from suspension_cli.design.reader import Source
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.models.choice import Transfer
    from suspension_cli.models.registry import Choice


@dataclass(frozen=True, repr=False)
class Info(Report):
    """The models that a design needs for its modes, for one response and for its thermal noise.

    Attributes
    ----------
    source : Source
        The design, its TOML text (overrides applied) and the name of its file.
    tolerance : float
        Relative error that `auto` may leave in frequencies of modes.
    errors : dict
        Of every model that is valid and every quantity, the model with its error.
    choices : dict
        The model that `auto` takes for every quantity.
    first_violin : float
        Lowest first violin mode, Hz; infinite if the design does not tell the mass of wires.
    """

    source: Source
    tolerance: float
    errors: dict[str, dict[str, Choice]]
    choices: dict[str, Choice]
    first_violin: float

    def document(self) -> Document:
        """Return the JSON document that ``pendsus info --json`` prints."""
        return {
            "command": "info",
            "design": self.name,
            "tolerance": self.tolerance,
            "first_violin_hz": as_number(self.first_violin),
            "errors": [
                {"fidelity": level, "quantity": quantity} | _document(choice)
                for level, row in self.errors.items()
                for quantity, choice in row.items()
            ],
            "choices": [
                {"quantity": quantity, "fidelity": choice.level, "reason": choice.reason}
                | _document(choice)
                for quantity, choice in self.choices.items()
            ],
        }

    def __str__(self) -> str:
        quantities = list(next(iter(self.errors.values())))
        columns = {"model": ""} | {f"error of\n{name}\n%": ".2g" for name in quantities}
        rows = [
            (level, *(_percent(choice.error) for choice in row.values()))
            for level, row in self.errors.items()
        ]
        lines = [
            self.title,
            "",
            "Errors of the models against the most complete one that is valid:",
            tables.render(columns, rows),
        ]
        if math.isfinite(self.first_violin):
            lines.append(f"lowest first violin mode: {self.first_violin:.4g} Hz")
        lines += ["", f"Models that auto takes, for a tolerance of {self.tolerance:g}:"]
        lines += [f"  {name}\n    {choice.line}" for name, choice in self.choices.items()]
        return "\n".join(lines)


def solve(source: Source, setting: Settings, log: Log) -> Info:
    """Compute the errors of the models of a design, with the options of ``pendsus info``.

    Raises
    ------
    InputError
        If the design does not balance, or a signal does not exist.
    """
    from suspension_cli.analyses import model_choice
    from suspension_cli.analyses.check import warnings
    from suspension_cli.analyses.thermal import solve as thermal
    from suspension_cli.design.derive import mirror
    from suspension_cli.errors import attribute_faults_to
    from suspension_cli.grids import parse_frequencies
    from suspension_cli.linear import signals
    from suspension_cli.models import registry
    from suspension_cli.models.choice import Frequencies, Systems, Transfer, choose, first_violin

    design, tolerance = source.design, setting["tolerance"]
    frequency = np.array(parse_frequencies(setting["frequency"]))
    output = setting["output"] or f"{mirror(design)}.x"

    def transfer(model: LinearSystem) -> Transfer:
        known = signals.bodies_with_signals(model)
        return Transfer(
            [signals.parse_input(setting["input"], known)],
            [signals.parse_output(output, known)],
            frequency,
        )

    span = f"{frequency.min():g} to {frequency.max():g} Hz"
    modes, response = "frequencies of the modes", f"{output} / {setting['input']}, {span}"
    systems = Systems(design)
    comparisons = {
        modes: systems.compare(lambda _: Frequencies()),
        response: systems.compare(transfer),
    }
    with attribute_faults_to(source.file):
        complete = systems(registry.most_complete(design))
        transfer(complete)  # raises if a signal does not exist
        errors = {
            model.name: {
                name: choose(design, model.name, (), compare)
                for name, compare in comparisons.items()
            }
            for model in registry.MODELS
            if not model.unsuitable(design)
        }
        choices = {
            modes: model_choice.for_modes(source, registry.AUTO, tolerance)[0],
            response: model_choice.choose(source, registry.AUTO, transfer)[0],
        }
        if registry.most_complete(design).bends_wires:
            noise = f"thermal noise of {output}, {span}"
            choices[noise] = thermal.choose(source, registry.AUTO, frequency, [output])[0]
    warnings.warn_implausible(design, log)
    return Info(source, tolerance, errors, choices, first_violin(complete))


def _document(choice: Choice) -> Document:
    return {"estimated_error": as_number(choice.error)}


def _percent(error: float) -> float | str:
    """Return an error in per cent, or words where it is not finite."""
    if math.isnan(error):
        return "unknown"
    return 100 * error if math.isfinite(error) else "without bound"
