"""`pendsus sweep`: modes, responses and couplings over any parameters of a design."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import Analysis, Document, Result, Run, Settings, table
from suspension_cli.analyses.options import option
from suspension_cli.errors import InputError, format_value

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from suspension_cli.analyses.sweep.solve import SweepResult
    from suspension_cli.studies.job import Axis

ALIKE = 0.4
"""Overlap below which a mode may have become any other; two that mix half and half have 0.5."""


class SweepAnalysis(Analysis):
    """Compute modes, responses and couplings over a grid of a design's parameters.

    One parameter gives lines, two give maps. Modes are followed through crossings by their shapes.
    Writes DIR/NAME-sweep.h5 and .png.

    Example: pendsus sweep my.toml --vary stage.test.wires.d=1e-3:5e-3:41

    Returns
    -------
    Result
        With the attributes of `analyses.sweep.solve.SweepResult`: `axes`, `result`, `value`
        (axis 1, axis 2, ..., results).

    Raises
    ------
    InputError
        If a path leads nowhere or a result does not exist.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> design = sus.example("husman2000/table1-case3")
    >>> lengths = {"stage.test.wires.l": [0.4, 0.5]}
    >>> found = sus.sweep(design, vary=lengths, results=["test yaw"], fidelity="string")
    >>> found.value.shape
    (2, 1)
    """

    name = "sweep"
    result_type = "analyses.sweep.solve.SweepResult"
    fills_file = True
    draws_neglected = True
    arguments = (options.DESIGN,)
    parameters = (
        option(
            "--vary",
            multiple=True,
            metavar="PATH=GRID",
            help=(
                "A parameter and its values: stage.test.wires.s=1e-3:0.05:50:log (repeatable)."
                "  [required]"
            ),
        ),
        options.RESULTS,
        *options.SWEEP,
        options.ACCURACY,
        options.ALLOW_UNSTABLE,
        *options.WRITING,
    )

    def solve(self, run: Run) -> Result:
        """Compute all points of the grid, then follow the modes."""
        from suspension_cli.analyses import sweeping
        from suspension_cli.analyses.sweep import solve as sweep
        from suspension_cli.analyses.sweep.solve import ParameterSweep
        from suspension_cli.linear import named_results
        from suspension_cli.models import registry
        from suspension_cli.physics import near_limits
        from suspension_cli.studies import builds

        setting, source = run.setting, run.source
        over = axes(list(setting["vary"]))
        unstable = setting["allow_unstable"]
        simplest = registry.choose(source.design, setting["fidelity"])

        def on(level: str, names: Sequence[str] = setting["results"]) -> ParameterSweep:
            system = registry.by_name(level).system(source.design)
            results = named_results.of_system(names, system)
            return ParameterSweep(source.text, over, level, results, unstable)

        try:
            first = on(simplest.level)
        except InputError:  # another model may have a mode of this label
            if setting["fidelity"] != registry.AUTO:
                raise
            first = on(simplest.level, [])
        follows = len(first.ratios) < len(first.results)
        if follows and simplest.model.has_wire_mass:
            remedy = "take beam, or ask for responses alone"
            problem = "has no modes that could be followed"
            raise InputError.of("--fidelity", problem, remedy, format_value(simplest.level))
        first.check()
        study = sweeping.Study(
            on,
            [model for model in registry.MODELS if not (follows and model.has_wire_mass)],
            sweep.result_change(first),
            sweep.first_points(first),
            sweep.extreme_points,
            sweep.write,
        )
        choice = study.choose(source, setting)
        run.log.detail(f"{run.name}: {choice.line}")
        near_limits.warn_implausible(run.design, run.log)
        result = sweeping.fill(run, self, study, choice)
        found: SweepResult = result.data
        for reason, count in found.failures.items():
            impossible = reason == builds.STATUS[builds.IMPOSSIBLE]
            fault = on(result.choice.level).first_fault(found.status) if impossible else ""
            why = f"{reason} ({fault})" if fault else reason
            run.log.warn(
                f"{count} of {found.status.size} points have no result: {why}; narrow the range"
                " of --vary"
            )
        if found.overlap < ALIKE:
            run.log.warn(
                "the shapes of a mode at two neighbouring points have an overlap of only"
                f" {found.overlap:.2f} (1: equal), so modes may be mixed up there; take a finer"
                " grid"
            )
        return result

    def document(self, result: Result) -> Document:
        """Return axes and results, first axis first; null for an unstable mode or failed point."""
        from suspension_cli.analyses.sweep import sharing

        answer: SweepResult = result.data
        results = table(answer, "name=result unit nominal")
        labelled = sharing.labelled(answer)
        for n, row in enumerate(results):
            row["values"] = answer.value[..., n]
            if n in labelled:
                one = labelled[n]
                row["fraction"] = one.content.fraction
                row["other_values"], row["other_fraction"] = one.other, one.content.other_fraction
        swept = table(answer.axes, "name values")
        said = [*sharing.remarks(answer)]
        return {"axes": swept, "results": results, "failures": answer.failures, "remarks": said}

    def text(self, result: Result) -> str:
        """Return smallest and largest value of every result, and where modes share a motion."""
        import numpy as np

        from suspension_cli.analyses.sweep import sharing

        answer: SweepResult = result.data
        rows = []
        for n, name in enumerate(answer.result):
            value, where, ends = answer.value[..., n], "nowhere on the grid", (None, None)
            if np.isfinite(value).any():
                top = np.unravel_index(int(np.nanargmax(value)), value.shape)
                at = zip(answer.axes, top, strict=True)
                where = ", ".join(f"{axis.name} = {axis.values[k]:.4g}" for axis, k in at)
                ends = np.nanmin(value), np.nanmax(value)
            rows.append((answer.nominal[n], *ends, answer.unit[n], name, where))
        columns = dict.fromkeys(("as drawn", "smallest", "largest"), "#.5g")
        columns |= {"unit": "", "result": "", "where it is largest": ""}
        found = sharing.remarks(answer)
        said = ["", *found] if answer.labelled else []
        return "\n".join([result.choice.line, "", tables.render(columns, rows), *said]).rstrip()

    def figures(self, result: Result, setting: Settings) -> dict[str, Figure]:
        """Draw lines over one parameter, maps over two."""
        from suspension_cli.analyses.sweep import picture

        stages = [stage.name for stage in result.given.design.stage]
        return {"": picture.draw(result.data, result.subtitle, stages)}


def axes(vary: list[str]) -> tuple[Axis, ...]:
    """Parse the axes of `--vary`."""
    from suspension_cli.grids import parse_grid
    from suspension_cli.studies.job import Axis, distinct

    example = "write for example --vary stage.test.wires.s=1e-3:0.05:50:log"
    if not vary:
        raise InputError.of("--vary", "is missing", example)
    result = []
    for text in vary:
        path, equals, values = (part.strip() for part in text.partition("="))
        if not equals or not all(part.strip() for part in path.split(".")) or "." not in path:
            problem = "is not of the form PATH=GRID"
            raise InputError.of("--vary", problem, example, format_value(text))
        result.append(Axis(path, tuple(parse_grid(values, f"--vary {path}"))))
    return distinct(result, "--vary", " ".join(vary))


ANALYSIS = SweepAnalysis()
