"""`pendsus tolerance`: random builds within tolerances."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import (
    Analysis,
    Document,
    Log,
    Result,
    Run,
    Settings,
    table,
)
from suspension_cli.analyses.options import option
from suspension_cli.errors import InputError

if TYPE_CHECKING:
    import h5py
    from matplotlib.figure import Figure

    from suspension_cli.analyses.tolerance.solve import RandomBuilds
    from suspension_cli.analyses.tolerance.summary import Spread, Summary
    from suspension_cli.design.schema import Design
    from suspension_cli.linear.eigenmodes import Modes

LOW, MEDIAN, HIGH = 1, 3, 5
"""Places of 5, 50 and 95 % among the quantiles of `summary.QUANTILES`."""
NEGLIGIBLE = 1e-7
"""Standard deviation of statics (m or rad) below which they are not printed."""
LEADING = 5
"""Number of causes in the JSON document."""


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
            default=options.COUPLING_LIMIT,
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
        from suspension_cli.analyses import sweeping
        from suspension_cli.analyses.tolerance import solve, summary
        from suspension_cli.analyses.tolerance.solve import RandomBuilds, requirements
        from suspension_cli.design.derive import mirror
        from suspension_cli.models import registry
        from suspension_cli.physics import model_choice
        from suspension_cli.physics.couplings import parse_request

        setting, source = run.setting, run.source
        job = RandomBuilds(
            source.text,
            setting["builds"],
            setting["seed"],
            parse_request(registry.STRING.system(run.design), setting, mirror(run.design)),
            setting["allow_unstable"],
            requirements=requirements(run.design, setting["require"]),
            method=setting["sampling"],
            with_indices=setting["sobol_indices"],
        )
        job = _of_possible_count(job, run.log)
        job.check()
        study = sweeping.Study(
            lambda level: dataclasses.replace(job, level=level),
            (registry.STRING, registry.BEAM),
            solve.build_change(job),
            solve.first_points(job),
            solve.extreme_points,
            partial(summary.write, limit=setting["limit"]),
        )
        choice = study.choose(source, setting)
        model_choice.stable_system(source, choice, setting["allow_unstable"], run.log, bends=True)
        final = study.at(choice.level)
        run.log.detail(
            f"{len(final.factors)} numbers of the design vary between builds; {len(final.required)}"
            " requirements"
        )
        result = sweeping.fill(run, self, study, choice)
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
        from suspension_cli.analyses.tolerance.solve import find, requirements

        for one in requirements(design, ()):
            yield partial(find, one.quantity, one.key, modes, stages, known)

    def document(self, result: Result) -> Document:
        """Return statistics of modes, coupling and statics, and yields."""
        from suspension_cli.analyses.tolerance.summary import QUANTILES, strongest

        found: Summary = result.data

        def leading(one: Spread) -> list[tuple[str, float]]:
            factors = found.job.factors
            return [(factors[n].label, float(one.rank[n])) for n in strongest(one.rank, LEADING)]

        spread = "mean_hz=mean mean_error_hz=error std_hz=deviation quantiles_hz=quantiles"
        frequency, rows = found.job.nominal.frequency, table(found.modes, spread)
        modes = zip(frequency, rows, found.modes, strict=True)
        spread = "quantity=name unit mean mean_error=error std=deviation quantiles"
        statics = zip(table(found.static, spread), found.static, strict=True)
        together, required = None, list[Document]()
        if found.joint is not None:
            every = (*found.yields, found.joint)
            *required, together = table(every, "requirement=name yield=fraction interval")
        answer: Document = {
            "builds": found.job.count,
            "good": found.good,
            "failures": found.failures,
            "seed": found.job.seed,
            "sampling": found.job.method,
            "independent": found.independent,
            "levels": list(QUANTILES),
            "significant_correlation": found.significant,
            "modes": [
                {"label": one.name, "nominal_hz": frequency, **row, "leading": leading(one)}
                for frequency, row, one in modes
            ],
            "coupling": {
                "ratio": found.ratio,
                "frequency_hz": found.frequency,
                "limit": found.limit,
                "fraction_under_limit": found.under.fraction,
                "fraction_under_limit_interval": found.under.interval,
                "quantiles": found.coupling.quantiles,
                "leading": leading(found.coupling),
                "leading_signed": leading(found.signed),
            },
            "statics": [row | {"leading": leading(one)} for row, one in statics],
            "requirements": required,
            "all_requirements": together,
        }
        if found.indices:
            answer["sobol_indices"] = {
                "tolerances": list(found.job.groups),
                "results": [one.name for one in found.job.quantities],
                **found.indices,
            }
        return answer

    def text(self, result: Result) -> str:
        """Return tables of modes, statics and yields, and their causes."""
        found: Summary = result.data
        lines = [result.choice.line]
        lines.append(f"{found.good:,} of {found.job.count:,} builds hang on taut wires")
        if found.independent < found.job.count:
            lines.append(
                f"statistics are those of {found.independent:,} independent builds; the others are"
                " for the Sobol indices"
            )
        lines += ["", _modes(found), "", *_coupling(found), "", *_statics(found)]
        if found.joint is not None:
            lines += ["", *_yields(found)]
        if found.indices:
            lines += ["", *_indices(found)]
        return "\n".join(lines)

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
    from suspension_cli.studies import sampling
    from suspension_cli.studies.sampling import RANDOM, REPLICATES

    groups = len(job.groups) if job.with_indices else 0
    if job.method == RANDOM and not groups:
        return job
    count = sampling.largest_count(job.count, job.method, groups)
    if not count:
        what = f"--sobol-indices of {groups} tolerances ({groups} + 2 sets of builds)"
        problem = f"is too few for {what if groups else '--sampling sobol'}"
        remedy = f"give at least {sampling.smallest_count(groups)}"
        raise InputError.of("--builds", problem, remedy, str(job.count))
    job = dataclasses.replace(job, count=count)
    sets = f"Sobol sampling: {REPLICATES} x {job.points.rows // REPLICATES:,}"
    if groups:
        sets = f"Sobol indices of {groups} tolerances: ({groups} + 2) x {job.points.rows:,}"
    log.say(f"{sets} = {count:,} builds, as the size of each set is a power of two")
    return job


def _modes(found: Summary) -> str:
    rows = []
    for nominal, one in zip(found.job.nominal.frequency, found.modes, strict=True):
        spread = 100 * one.deviation / nominal if nominal else None
        low, high = one.quantiles[[LOW, HIGH]]
        rows.append((nominal, low, high, spread, one.name, _causes(found, one, 2)))
    columns = dict.fromkeys(("nominal\nHz", "5 %\nHz", "95 %\nHz"), "#.5g")
    columns |= {"std\n%": ".2f", "mode": "", "depends most on (rank correlation, change)": ""}
    return tables.render(columns, rows)


def _coupling(found: Summary) -> Iterator[str]:
    quantiles, under = found.coupling.quantiles, found.under
    yield (
        f"|{found.ratio}| at {found.frequency:g} Hz: median {quantiles[MEDIAN]:.3g}, 95 % below"
        f" {quantiles[HIGH]:.3g}"
    )
    low, high = under.interval
    failed = found.hanging < found.independent
    which = f"the {found.hanging:,} builds that hang" if failed else "builds"
    yield (
        f"{100 * under.fraction:.4g} % of {which} lie below {found.limit:g} (95 % confidence:"
        f" {100 * low:.3g} to {100 * high:.3g} %)"
    )
    yield f"depends most on: {_causes(found, found.signed, 5) or 'no number significantly'}"


def _statics(found: Summary) -> Iterator[str]:
    rows = []
    for one in found.static:
        if one.deviation > NEGLIGIBLE:
            unit, per = one.quantity.displayed
            values = (one.mean, one.error, one.deviation, *one.quantiles[[LOW, HIGH]])
            shown = [per * value for value in values]
            rows.append((*shown, unit, one.name, _causes(found, one, 1)))
    if rows:
        columns = dict.fromkeys(("mean", "error\nof mean", "std", "5 %", "95 %"), "#.3g")
        columns |= {"unit": "", "displacement from the nominal pose": "", "depends most on": ""}
        yield tables.render(columns, rows)


def _yields(found: Summary) -> Iterator[str]:
    assert found.joint is not None
    rows = []
    for one in (*found.yields, found.joint):
        low, high = one.interval
        interval = f"{100 * low:.2f} to {100 * high:.2f}"
        rows.append((100 * one.fraction, interval, one.name))
    columns = {"yield\n%": ".2f", "95 % confidence\n%": " ", "requirement": ""}
    yield tables.render(columns, rows)
    for name, count in found.shared.items():
        yield f"  in {count:,} of {found.good:,} builds two modes share {name}"
    for one in found.required:
        if one.quantity.column in ("static", "response"):
            what = _causes(found, one, 3) or "no number significantly"
            yield f"  {one.name} depends most on: {what}"


def _causes(found: Summary, one: Spread, count: int) -> str:
    """List numbers with the strongest significant correlations, and the change by each."""
    from suspension_cli.analyses.tolerance.summary import strongest
    from suspension_cli.studies.parameters import STEPS

    unit, per = one.quantity.displayed
    texts = []
    for n in strongest(one.rank, count, found.significant):
        factor = found.job.factors[n]
        step, name = STEPS.get(factor.unit, (1.0, factor.unit))
        if factor.unit == "1":
            step, name = 0.01, "%"
        change = f"{per * one.slope[n] * step:+.3g} {unit}".rstrip()
        texts.append(f"{factor.label} {one.rank[n]:+.2f} ({change} per {name})")
    return ", ".join(texts)


def _indices(found: Summary) -> Iterator[str]:
    yield (
        "Sobol indices: fraction of the variance that a tolerance causes alone (first), or alone"
        " and together with others (total)"
    )
    if failed := found.job.count - found.good:
        failures = f"{failed:,} of {found.job.count:,} builds failed"
        yield f"{failures}; the indices leave out the samples with one of them, and are biased"
    columns = dict.fromkeys(("total", "std error", "first", "std error "), ".3f")
    columns |= {"tolerance": ""}
    for one in dict.fromkeys((found.coupling, *found.required)):
        own = found.indices_of(one)
        if own is None:
            yield f"  {one.name}: not known, as too few builds hang"
            continue
        names = "total", "total_error", "first", "first_error"
        rows = zip(*(own[name].tolist() for name in names), found.job.groups, strict=True)
        shown = [row for row in rows if row[0] > max(0.005, 2 * row[1])]
        shown.sort(key=lambda row: -row[0])
        listed = "\n" + tables.render(columns, shown) if shown else ": does not vary"
        yield f"  {one.name}{listed}"


ANALYSIS = ToleranceAnalysis()
