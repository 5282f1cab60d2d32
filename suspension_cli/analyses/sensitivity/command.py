"""`pendsus sensitivity`: derivatives with respect to each number of a design."""

from __future__ import annotations

from typing import TYPE_CHECKING

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import Analysis, Run, Settings
from suspension_cli.analyses.options import option

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.analyses.sensitivity.solve import Sensitivity

ACROSS = 8
"""Columns of one table."""
LEAST = 0.0005
"""Change in % below which a row is left out."""


class SensitivityAnalysis(Analysis):
    """Compute the effect of the numbers of a design on its modes, or on any quantity.

    Effects are those of 1 mm for lengths, 1 mrad for angles and 1 % for all else. They are first
    derivatives that include the change of the equilibrium. The model is chosen by the error of the
    quantities. Writes DIR/NAME-sensitivity.h5 and .png.

    Example: pendsus sensitivity my.toml --result "test longitudinal"

    Returns
    -------
    Sensitivity
        With `parameter`, `result`, `derivative` and `derivative_error` (parameters, results).

    Raises
    ------
    InputError
        If a result does not exist.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.sensitivity(sus.example("double"), results=["test yaw"], fidelity="string")
    >>> found.derivative.shape[1]
    1
    """

    name = "sensitivity"
    result_type = "analyses.sensitivity.solve.Sensitivity"
    draws_neglected = True
    arguments = (options.DESIGN,)
    parameters = (
        option(
            "--result",
            "results",
            multiple=True,
            metavar="QUANTITY",
            help=(
                "A quantity: a mode by its label or number, 'Q of test pitch', 'thermal test.x:10',"
                " a response OUTPUT/INPUT:HZ, ... (repeatable)."
                "  [default: modes, which stands for every mode]"
            ),
        ),
        option(
            "--vary",
            "vary",
            multiple=True,
            metavar="PATH",
            help=(
                "A number of the design by its dotted path, or all numbers below a path:"
                " stage.test.wires.l, stage.test.wires (repeatable).  [default: every number]"
            ),
        ),
        options.ALLOW_UNSTABLE,
        options.ACCURACY,
        *options.WRITING,
    )

    def solve(self, run: Run) -> Sensitivity:
        """Differentiate every result with respect to every number."""
        from suspension_cli.analyses.named_quantities import names_of
        from suspension_cli.analyses.sensitivity import solve as sensitivity
        from suspension_cli.linear import eigenmodes
        from suspension_cli.models import registry
        from suspension_cli.models.choice import choose
        from suspension_cli.physics import model_choice
        from suspension_cli.quantities import vocabulary
        from suspension_cli.quantities.differences import compare_designs
        from suspension_cli.quantities.kinds.modes import describe_shared_motions
        from suspension_cli.quantities.nominal_results import find_results

        setting = run.setting
        source = run.source
        wanted = setting["fidelity"]
        unstable = setting["allow_unstable"]
        model_choice.demand_one_of(wanted, registry.SCENE_MODELS, "cannot compute derivatives")
        names = names_of(source, log=run.log)
        models = model_choice.with_and_without_wire_mass(source)
        asked = find_results(setting["results"], names, source.text, models[-1].name)
        for one in asked:
            vocabulary.demand_derivative(one, "--result")
        choice = choose(
            source.design,
            wanted,
            models,
            compare_designs(asked, [source.design], allow_unstable=unstable),
            setting["tolerance"],
        )
        model = model_choice.stable_system(source, choice, unstable, run.log, bends=True)
        quantities = find_results(setting["results"], names, source.text, choice.level)
        for said in describe_shared_motions(quantities, eigenmodes.solve(model.constant)):
            run.log.warn(f"{said}; the effects are those on the first of them")
        model_choice.warn_of_neglected(source, choice, run.log, registry.SCENE_MODELS)
        found = sensitivity.solve(
            source.text,
            quantities,
            choice.level,
            run=run.origin(self, choice),
            vary=setting["vary"],
            allow_unstable=unstable,
        )
        fixed = [name for name, free in zip(found.parameter, found.free, strict=True) if not free]
        if fixed:
            run.log.say(
                f"no effect is given of {', '.join(fixed)}: a change of one of these alone"
                " unbalances the suspension in its nominal pose"
            )
        return found

    def text(self, result: Sensitivity) -> str:
        """Return tables of the changes, some columns at a time."""
        import numpy as np

        from suspension_cli.design.paths import format_with_unit

        change = result.per_step
        absolute = result.nominal == 0
        shown = np.isfinite(change) & ((abs(change) >= LEAST) | (absolute & (change != 0)))
        cells = np.where(absolute, np.char.mod("%.1e", change), np.char.mod("%+.3f", change))
        cells[abs(change) < np.where(absolute, 5e-324, LEAST)] = "0"
        lines = [
            result.run.choice.line,
            "",
            "change of each result by 1 mm, 1 mrad or 1 % of each number, in % of the result (in"
            " its unit if it is 0):",
        ]
        units = ["" if unit == "1" else unit for unit in result.unit]
        taken = max(map(len, result.parameter), default=0) + 26
        across = min(max((tables.width() - taken) // 9, 1), ACROSS)
        for start in range(0, len(result.result), across):
            here = range(start, min(start + across, len(result.result)))
            columns = {"": "", "value": " ", "per": " "}
            lines.append("")
            for n in here:
                line = f"  [{n + 1}] {result.result[n]}  {result.nominal[n]:#.5g} {units[n]}"
                lines.append(line.rstrip() + _error(result.error_share[n]))
                columns[f"[{n + 1}]\n{units[n] if absolute[n] else '%'}"] = "+.3f"
            rows = [
                (name, format_with_unit(name, result.value[k]), f"1 {step}", *cells[k, here])
                for k, (name, step) in enumerate(
                    zip(result.parameter, result.step_unit, strict=True)
                )
                if shown[k, here].any()
            ]
            lines.append(tables.render(columns, rows))
        return "\n".join(lines)

    def figures(self, result: Sensitivity, setting: Settings) -> dict[str, Figure]:
        """Draw a coloured table."""
        from suspension_cli.analyses.sensitivity import picture

        perturbations = result.run.design.design.perturbation
        return {"": picture.draw(result, result.subtitle, perturbations)}


def _error(share: float) -> str:
    """Describe the error of derivatives over the largest; nothing where they are exact."""
    return "" if share != share else f"  (error {100 * share:.1g} % of the largest change)"


ANALYSIS = SensitivityAnalysis()
