"""`pendsus tolerance`: random builds within tolerances."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import options
from suspension_cli.analyses.analysis import Analysis, Document, Log, Result, Run, Settings
from suspension_cli.analyses.options import option
from suspension_cli.errors import InputError

if TYPE_CHECKING:
    import h5py
    from matplotlib.figure import Figure

    from suspension_cli.analyses.tolerance.solve import RandomBuilds
    from suspension_cli.analyses.tolerance.summary import Summary
    from suspension_cli.design.schema import Design
    from suspension_cli.linear.eigenmodes import Modes


class ToleranceAnalysis(Analysis):
    """Compute the scatter of modes and cross-coupling over random builds, and its causes.

    The design's [tolerance] table describes the builds. Prints quantiles of mode frequencies, of
    the static pose of every stage and of the cross-coupling; the yield (fraction of builds that
    meet a requirement); and the imperfections that matter most. Writes DIR/NAME-tolerance.h5 and
    .png.

    Example: pendsus tolerance configs/triple-tolerance.toml --builds 1000

    Returns
    -------
    Result
        With the attributes of `analyses.tolerance.summary.Summary`: `mean`, `spread`,
        `quantiles` of mode frequencies in Hz; `modes`, `coupling`, `static` and `required`, whose
        items have a `name`, `mean`, `deviation`, `quantiles`, ...; `yields`, `joint`, `indices`.

    Raises
    ------
    InputError
        If the design has no ``[tolerance]`` table.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.tolerance(sus.example("triple-tolerance"), builds=20, fidelity="string")
    >>> found.good
    20
    """

    name = "tolerance"
    fills_file = True
    draws_neglected = True
    arguments = (options.DESIGN,)
    parameters = (
        option(
            "--builds",
            type=click.IntRange(1, 1_000_000_000),
            default=10_000,
            help="Number of random builds.",
        ),
        option(
            "--seed",
            type=click.IntRange(0, 2**64 - 1),
            default=1,
            help="Seed of the random numbers; the same seed gives the same builds.",
        ),
        option(
            "--limit",
            type=click.FloatRange(0.0, min_open=True),
            default=1e-3,
            help="Limit on the cross-coupling, whose yield is printed.",
        ),
        option(
            "--require",
            multiple=True,
            metavar="TEXT",
            help=(
                "A requirement beside those of the design: 'test pitch in 0.5:0.7',"
                " 'coupling < 1e-3', 'test static pitch < 2e-3'; Hz, m, rad (repeatable)."
            ),
        ),
        option(
            "--sampling",
            type=click.Choice(("random", "sobol")),
            default="random",
            help=(
                "Independent builds, or 8 scrambled Sobol sequences, whose statistical errors are"
                " smaller."
            ),
        ),
        option(
            "--sobol-indices",
            is_flag=True,
            help=(
                "Print Sobol indices: the fraction of the variance of every result that each of"
                " the k tolerances causes. Uses (k + 2) N of the --builds, with N a power of two."
            ),
        ),
        *options.COUPLING,
        *options.SWEEP,
        options.ACCURACY,
        options.ALLOW_UNSTABLE,
        *options.WRITING,
    )

    def solve(self, run: Run) -> Result:
        """Compute all builds, then their statistics."""
        from suspension_cli.analyses import model_choice, sweeping
        from suspension_cli.analyses.tolerance import quantities, summary
        from suspension_cli.analyses.tolerance.solve import RandomBuilds, build_change
        from suspension_cli.analyses.xcouple.solve import parse_request
        from suspension_cli.design.derive import mirror
        from suspension_cli.models import registry

        setting, source = run.setting, run.source
        job = RandomBuilds(
            source.text,
            setting["builds"],
            setting["seed"],
            parse_request(registry.STRING.system(run.design), setting, mirror(run.design)),
            setting["allow_unstable"],
            requirements=quantities.requirements(run.design, setting["require"]),
            method=setting["sampling"],
            with_indices=setting["sobol_indices"],
        )
        job = _of_possible_count(job, run.log)
        job.check()
        choice = model_choice.for_builds(
            source,
            setting["fidelity"],
            (registry.STRING, registry.BEAM),
            build_change(job),
            setting["tolerance"],
        )
        model_choice.stable_system(source, choice, setting["allow_unstable"], run.log, bends=True)
        job, limit = dataclasses.replace(job, level=choice.level), setting["limit"]
        run.log.detail(
            f"{len(job.factors)} numbers of the design vary between builds; {len(job.required)}"
            " requirements"
        )
        result = sweeping.fill(
            run,
            self,
            job,
            choice,
            summary.describe(job, limit),
            lambda part: summary.complete(part, job, limit),
        )
        found: Summary = result.data
        for reason, count in found.failures.items():
            run.log.warn(
                f"{count} of {job.count} builds failed: {reason}; they meet no requirement"
            )
        return result

    def parse_results(
        self, design: Design, modes: Modes, stages: tuple[str, ...], known: tuple[str, ...]
    ) -> Iterator[Callable[[], object]]:
        """Parse the quantities of requirements."""
        from suspension_cli.analyses.tolerance import quantities

        for one in quantities.requirements(design, ()):
            yield partial(quantities.find, one.quantity, one.key, modes, stages, known)

    def document(self, result: Result) -> Document:
        """Return statistics of modes, coupling and statics, and yields."""
        from suspension_cli.analyses.tolerance import report

        return report.document(result.data)

    def text(self, result: Result) -> str:
        """Return tables of modes, statics and yields, and their causes."""
        from suspension_cli.analyses.tolerance import report

        return f"{result.choice.line}\n{report.text(result.data)}"

    def load(self, file: h5py.File) -> Summary:
        """Read the statistics of the group `tolerance`."""
        from suspension_cli.analyses.tolerance import summary

        text, level = str(file.attrs["design"]), str(file.attrs["fidelity"])
        return summary.load(file["tolerance"], text, level)

    def figures(self, result: Result, setting: Settings) -> dict[str, Figure]:
        """Draw required quantities, causes, and other quantities that vary."""
        from suspension_cli.analyses.tolerance import picture

        return {"": picture.draw(result.data, result.subtitle)}


def _of_possible_count(job: RandomBuilds, log: Log) -> RandomBuilds:
    """Limit a job to the builds that its sampling can use, and report their number."""
    from suspension_cli.studies import sample_points
    from suspension_cli.studies.sample_points import RANDOM, REPLICATES

    groups = len(job.groups) if job.with_indices else 0
    if job.method == RANDOM and not groups:
        return job
    count = sample_points.largest_count(job.count, job.method, groups)
    if not count:
        what = f"--sobol-indices of {groups} tolerances ({groups} + 2 sets of builds)"
        problem = f"is too few for {what if groups else '--sampling sobol'}"
        remedy = f"give at least {sample_points.smallest_count(groups)}"
        raise InputError.of("--builds", problem, remedy, str(job.count))
    job = dataclasses.replace(job, count=count)
    sets = f"Sobol sampling: {REPLICATES} x {job.points.rows // REPLICATES:,}"
    if groups:
        sets = f"Sobol indices of {groups} tolerances: ({groups} + 2) x {job.points.rows:,}"
    log.say(f"{sets} = {count:,} builds, as the size of each set is a power of two")
    return job


ANALYSIS = ToleranceAnalysis()
