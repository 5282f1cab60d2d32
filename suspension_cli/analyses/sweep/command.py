"""`pendsus sweep`: any quantities over any parameters of a design."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import Analysis, Document, Run, Settings
from suspension_cli.analyses.options import option
from suspension_cli.errors import InputError, format_value

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Bool
    from matplotlib.figure import Figure

    from suspension_cli.analyses.sweep.parameter_sweep import ParameterSweep
    from suspension_cli.analyses.sweep.solve import Sweep
    from suspension_cli.studies.job import Axis

ALIKE = 0.4
"""Overlap below which a mode may have become any other; two that mix half and half have 0.5."""
TOGETHER = 16
"""Points computed at once, if a quantity is computed design by design: progress is seen then."""


class SweepAnalysis(Analysis):
    """Compute modes, or any quantities, over a grid of a design's parameters.

    One parameter gives lines, two give maps. Modes are followed through crossings by their shapes.
    Limits of requirements are drawn, and what share of the grid meets them is printed. Writes
    DIR/NAME-sweep.h5 and .png.

    Example: pendsus sweep my.toml --vary stage.test.wires.d=1e-3:5e-3:41

    Returns
    -------
    Sweep
        With `axes`, `result`, `value` (axis 1, axis 2, ..., results); `met`, whether each point
        meets each requirement.

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
    result_type = "analyses.sweep.solve.Sweep"
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
        options.QUANTITIES,
        option(
            "--require",
            multiple=True,
            metavar="TEXT",
            help=(
                "A requirement beside those of the design: 'test pitch in 0.5:0.7',"
                " 'thermal test.x:10 < 1e-19', SI units and Hz, margins in dB and degrees"
                " (repeatable)."
            ),
        ),
        options.EVERY_POINT,
        *options.SWEEP,
        options.ACCURACY,
        options.ALLOW_UNSTABLE,
        *options.WRITING,
    )

    def solve(self, run: Run) -> Sweep:
        """Compute all points of the grid, then follow the modes."""
        from suspension_cli.analyses import sweeping
        from suspension_cli.analyses.sweep import point_errors, sweep_models
        from suspension_cli.analyses.sweep.followed_modes import Follower
        from suspension_cli.analyses.sweep.solve import write
        from suspension_cli.physics import near_limits

        asked = sweep_models.Asked.of(run, axes(list(run.setting["vary"])))
        wanted = asked.settle_model(run.setting["fidelity"], run.log.say)
        first = asked.job(asked.simplest(wanted))
        first.check()
        follow = Follower()
        study = sweeping.Study(
            asked.job,
            asked.usable(wanted),
            point_errors.PointErrors(first),
            point_errors.first_points(first),
            partial(point_errors.extreme_points, follow),
            partial(write, follow),
            _warnings,
        )
        chunk = run.setting["chunk"]
        if first.is_slow:
            chunk = min(chunk, TOGETHER)
        run = replace(run, setting=run.setting | {"fidelity": wanted, "chunk": chunk})
        choice = study.choose(run.source, run.setting)
        run.log.detail(f"{run.name}: {choice.line}")
        near_limits.warn_implausible(run.design, run.log)
        return sweeping.fill(run, self, study, choice)

    def document(self, result: Sweep) -> Document:
        """Add modes that share a motion, remarks, and the share of points that meet limits."""
        from suspension_cli.analyses.sweep import sharing

        document = super().document(result)
        for n, one in sharing.labelled(result).items():
            row = document["results"][n]
            row["fraction"] = one.content.fraction
            row["other_values"] = one.other
            row["other_fraction"] = one.content.other_fraction
        document["remarks"] = [*sharing.remarks(result)]
        if result.met is not None and result.all_met is not None:
            for n, row in enumerate(document["requirements"]):
                row["share"] = result.met[..., n].mean()
            document["all_requirements"] = {"share": result.all_met.mean(), "met": result.all_met}
        return document

    def text(self, result: Sweep) -> str:
        """Return smallest and largest value of every result, requirements, and remarks."""
        from suspension_cli.analyses.sweep import sharing

        lines = (result.run.choice.line, result.interpolation)
        head = "\n".join(line for line in lines if line)
        parts = [head, _tabulate(result), _describe_requirements(result)]
        parts.append("\n".join(sharing.remarks(result)))
        return "\n\n".join(part for part in parts if part)

    def figures(self, result: Sweep, setting: Settings) -> dict[str, Figure]:
        """Draw lines over one parameter, maps over two."""
        from suspension_cli.analyses.sweep import picture

        stages = [stage.name for stage in result.run.design.design.stage]
        return {"": picture.draw(result, result.subtitle, stages)}


def _warnings(found: Sweep, job: ParameterSweep) -> Iterator[str]:
    """Warn of points without results, and of a grid that is too coarse to follow modes."""
    from suspension_cli.studies import builds

    for reason, count in found.failures.items():
        impossible = reason == builds.STATUS[builds.IMPOSSIBLE]
        fault = job.first_fault(found.status) if impossible else ""
        why = f"{reason} ({fault})" if fault else reason
        yield (
            f"{count} of {found.status.size} points have no result: {why}; narrow the range of"
            " --vary"
        )
    if found.overlap < ALIKE:
        yield (
            "the shapes of a mode at two neighbouring points have an overlap of only"
            f" {found.overlap:.2f} (1: equal), so modes may be mixed up there; take a finer grid"
        )


def _tabulate(result: Sweep) -> str:
    """Return tables of smallest and largest values: of all points, and where limits are met."""
    import numpy as np

    everywhere = np.ones(result.status.shape, dtype=bool)
    names = ", ".join(axis.name for axis in result.axes)
    parts = [f"values, and where they are smallest and largest ({names}):"]
    parts.append(_ends(result, everywhere))
    good = result.all_met
    if good is not None and good.any() and not good.all():
        parts += ["", "among the points that meet all requirements:", _ends(result, good)]
    return "\n".join(parts)


def _ends(result: Sweep, points: Bool[np.ndarray, "*axes"]) -> str:
    """Return a table of the smallest and largest value of every result among some points."""
    import numpy as np

    rows = []
    for n, name in enumerate(result.result):
        value = result.value[..., n]
        known = np.where(np.isfinite(value) & points, value, np.nan)
        row: list[float | str | None] = [result.nominal[n]]
        for find in (np.nanargmin, np.nanargmax):
            if np.isnan(known).all():
                row += [None, "nowhere"]
                continue
            place = np.unravel_index(int(find(known)), value.shape)
            at = zip(result.axes, place, strict=True)
            row += [known[place], ", ".join(f"{axis.values[k]:.4g}" for axis, k in at)]
        rows.append([*row, result.unit[n], name])
    number = "#.5g"
    columns = {"nominal": number, "smallest": number, "at": "", "largest": number, "at ": ""}
    return tables.render(columns | {"unit": "", "result": ""}, rows)


def _describe_requirements(result: Sweep) -> str:
    """Say at how many points of the grid each requirement is met, and all; "" without any."""
    if result.required is None or result.met is None or result.all_met is None:
        return ""
    shares = [(name, result.met[..., n]) for n, name in enumerate(result.required)]
    if len(shares) > 1:
        shares.append(("all of these", result.all_met))
    count = result.status.size
    lines = [
        f"  {name}: met at {met.sum()} of {count} points ({100 * met.mean():.3g} %)"
        for name, met in shares
    ]
    return "\n".join(["requirements", *lines])


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
