"""`pendsus info`: errors of the models of a design, and the models that `auto` takes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import Analysis, Document, Result, Run

if TYPE_CHECKING:
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.models.choice import Transfer
    from suspension_cli.models.registry import Choice


@dataclass(frozen=True)
class Info:
    """The models that a design needs for its modes, for one response and for its thermal noise.

    Attributes
    ----------
    tolerance : float
        Relative error that `auto` may leave in frequencies of modes.
    errors : dict
        Of every model that is valid and every quantity, the model with its error.
    choices : dict
        The model that `auto` takes for every quantity.
    first_violin : float
        Lowest first violin mode, Hz; infinite if the design does not tell the mass of wires.
    """

    tolerance: float
    errors: dict[str, dict[str, Choice]]
    choices: dict[str, Choice]
    first_violin: float


class InfoAnalysis(Analysis):
    """Compute the errors of the models of a design, and name the model that `auto` takes.

    Prints both for the modes, one response and its thermal noise. Writes no file.

    Example: pendsus info my.toml --output test.pitch

    Returns
    -------
    Result
        With the attributes of `analyses.info.command.Info`: `errors`, `choices`, `first_violin`.

    Raises
    ------
    InputError
        If the design does not balance, or a signal does not exist.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.info(sus.example("geo-silica-triple"), tolerance=0.01)
    >>> [choice.level for choice in found.choices.values()]
    ['beam', 'violin', 'violin']
    """

    name = "info"
    has_model = False
    has_file = False
    arguments = (options.DESIGN,)
    parameters = (
        options.option(
            "--input",
            default="support.x",
            metavar="SIGNAL",
            help="Input of the response.",
        ),
        options.option(
            "--output",
            metavar="SIGNAL",
            help="Output of the response and of the thermal noise.  [default: x of the mirror]",
        ),
        options.frequencies("0.1:100:2000", "Frequencies of the response and the noise, Hz."),
        options.ACCURACY,
        options.OVERRIDES,
        options.AS_JSON_ONLY,
    )

    def solve(self, run: Run) -> Result:
        """Compute the error of every model, and choose one, for every quantity."""
        import numpy as np

        from suspension_cli.design.derive import mirror
        from suspension_cli.grids import parse_frequencies
        from suspension_cli.linear import signals
        from suspension_cli.models import registry
        from suspension_cli.models.choice import (
            Frequencies,
            Systems,
            Transfer,
            choose,
        )
        from suspension_cli.models.spectrum_error import first_violin
        from suspension_cli.physics import model_choice, near_limits, thermal_noise

        source, design, setting = run.source, run.design, run.setting
        frequency = np.array(parse_frequencies(setting["frequency"]))
        into, output = setting["input"], setting["output"] or f"{mirror(design)}.x"

        def transfer(model: LinearSystem) -> Transfer:
            known = signals.bodies_with_signals(model)
            inputs, outputs = signals.parse_input(into, known), signals.parse_output(output, known)
            return Transfer([inputs], [outputs], frequency)

        span = f"{frequency.min():g} to {frequency.max():g} Hz"
        modes, response = "frequencies of the modes", f"{output} / {into}, {span}"
        systems = Systems(design)
        complete = systems(registry.most_complete(design))
        transfer(complete)  # raises if a signal does not exist
        compare = {
            modes: systems.compare(lambda _: Frequencies()),
            response: systems.compare(transfer),
        }
        errors = {
            model.name: {name: choose(design, model.name, (), one) for name, one in compare.items()}
            for model in registry.MODELS
            if not model.unsuitable(design)
        }
        choices = {
            modes: model_choice.for_modes(source, registry.AUTO, setting["tolerance"])[0],
            response: model_choice.choose(source, registry.AUTO, transfer)[0],
        }
        if registry.most_complete(design).bends_wires:
            noise = f"thermal noise of {output}, {span}"
            choices[noise] = thermal_noise.choose(source, registry.AUTO, frequency, [output])[0]
        near_limits.warn_implausible(design, run.log)
        found = Info(setting["tolerance"], errors, choices, first_violin(complete))
        return Result(self, source, registry.Choice("all", ""), found, command=run.command)

    def document(self, result: Result) -> Document:
        """Return the errors and the choices, one by one."""
        found: Info = result.data
        return {
            "tolerance": found.tolerance,
            "first_violin_hz": found.first_violin,
            "errors": [
                {"fidelity": level, "quantity": quantity, "estimated_error": one.error}
                for level, row in found.errors.items()
                for quantity, one in row.items()
            ],
            "choices": [
                {
                    "quantity": quantity,
                    "fidelity": one.level,
                    "reason": one.reason,
                    "estimated_error": one.error,
                }
                for quantity, one in found.choices.items()
            ],
        }

    def text(self, result: Result) -> str:
        """Return a table of the errors, and the choices."""
        found: Info = result.data
        quantities = next(iter(found.errors.values()))
        columns = {"model": ""} | {f"error of\n{name}\n%": ".2g" for name in quantities}
        rows = [
            (level, *(_percent(choice.error) for choice in row.values()))
            for level, row in found.errors.items()
        ]
        head = "Errors of the models against the most complete one that is valid:"
        lines = [result.given.title, "", head, tables.render(columns, rows)]
        if math.isfinite(found.first_violin):
            lines.append(f"lowest first violin mode: {found.first_violin:.4g} Hz")
        lines += ["", f"Models that auto takes, for a tolerance of {found.tolerance:g}:"]
        lines += [f"  {name}\n    {choice.line}" for name, choice in found.choices.items()]
        return "\n".join(lines)


def _percent(error: float) -> float | str:
    """Return an error in per cent, or words where it is not finite."""
    if math.isnan(error):
        return "unknown"
    return 100 * error if math.isfinite(error) else "without bound"


ANALYSIS = InfoAnalysis()
