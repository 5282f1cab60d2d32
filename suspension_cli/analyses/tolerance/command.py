"""`pendsus tolerance`: random builds within tolerances."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING

import click

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import Analysis, Document, Run, Settings
from suspension_cli.analyses.options import option

if TYPE_CHECKING:
    import h5py
    from matplotlib.figure import Figure

    from suspension_cli.analyses.record import Origin
    from suspension_cli.analyses.tolerance.estimates import Estimates
    from suspension_cli.analyses.tolerance.solve import RandomBuilds
    from suspension_cli.analyses.tolerance.summary import Spread, Tolerance
    from suspension_cli.studies.run import Columns

LOW, MEDIAN, HIGH = 1, 3, 5
"""Places of 5, 50 and 95 % among the quantiles of `summary.QUANTILES`."""
BUILDS = 10_000
"""Builds without ``--precision``."""
MOST_BUILDS = 1_000_000
"""Most builds with it."""
FIRST_ROUND = 2048
"""Builds after which their number is decided."""
NEGLIGIBLE = 1e-7
"""Standard deviation of statics (m or rad) below which they are not printed."""
LEAST_SHARE = 0.005
"""Fraction of the variance below which a tolerance is not printed."""


class ToleranceAnalysis(Analysis):
    """Compute the scatter of quantities over random builds, yields, and the causes of scatter.

    The design's [tolerance] table describes the builds. Prints quantiles of mode frequencies, of
    the static pose of every stage, of the cross-coupling and of any --result; the yield (fraction
    of builds that meet a requirement); the imperfections that matter most; and the fraction of the
    variance that each tolerance causes. Writes DIR/NAME-tolerance.h5 and .png.

    Example: pendsus tolerance configs/triple-tolerance.toml --builds 1000

    Returns
    -------
    Tolerance
        With `mean`, `spread`, `quantiles` of mode frequencies in Hz; `modes`, `coupling`, `static`,
        `others` and `required`, whose items have a `name`, `mean`, `deviation`, `quantiles`,
        `share`, ...; `yields`, `joint`.

    Raises
    ------
    InputError
        If the design has no ``[tolerance]`` table, or no quantity of a name.

    Examples
    --------
    >>> import suspension_cli as sus
    >>> found = sus.tolerance(sus.example("triple-tolerance"), builds=20, fidelity="string")
    >>> found.good
    20
    """

    name = "tolerance"
    result_type = "analyses.tolerance.summary.Tolerance"
    fills_file = True
    draws_neglected = True
    arguments = (options.DESIGN,)
    parameters = (
        option(
            "--builds",
            type=click.IntRange(1, 1_000_000_000),
            help=f"Number of random builds (default {BUILDS}); with --precision the largest one"
            f" (default {MOST_BUILDS}).",
        ),
        option(
            "--precision",
            type=click.FloatRange(0.0, 1.0, min_open=True),
            help=(
                "Add builds until standard errors are below this fraction of the spread, and those"
                " of yields below this number: of the coupling, of quantities with requirements and"
                " of each --result. For example 0.01."
            ),
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
                " 'coupling < 1e-3', 'Q of test pitch < 50'; any quantity, in its unit"
                " (repeatable)."
            ),
        ),
        option(
            "--result",
            "results",
            multiple=True,
            metavar="QUANTITY",
            help=(
                "A quantity whose statistics are computed too, such as 'thermal test.x:10'"
                " (repeatable)."
            ),
        ),
        *options.COUPLING,
        *options.SWEEP,
        options.ACCURACY,
        options.ALLOW_UNSTABLE,
        *options.WRITING,
    )

    def solve(self, run: Run) -> Tolerance:
        """Compute all builds, then their statistics."""
        from suspension_cli.analyses import sweeping
        from suspension_cli.analyses.tolerance import solve
        from suspension_cli.models import registry
        from suspension_cli.physics import model_choice

        setting = run.setting
        source = run.source
        job = _make_job(run)
        job.check()
        estimator = _Estimator(setting["limit"])
        study = sweeping.Study(
            lambda level: dataclasses.replace(job, level=level),
            (registry.STRING, registry.BEAM),
            solve.compare_models(job),
            solve.first_points(job),
            solve.extreme_points,
            partial(_write, estimator, setting["precision"] or 0.0),
            _warnings,
            partial(_more_builds, run, estimator),
        )
        choice = study.choose(source, setting)
        model_choice.stable_system(source, choice, setting["allow_unstable"], run.log, bends=True)
        run.log.detail(
            f"{len(job.factors)} numbers of the design vary between builds;"
            f" {len(job.requirements)} requirements"
        )
        return sweeping.fill(run, self, study, choice)

    def text(self, result: Tolerance) -> str:
        """Return tables of modes, statics, other quantities and yields, and their causes."""
        lines = [result.run.choice.line]
        lines.append(f"{result.good:,} of {result.builds:,} builds hang on taut wires")
        lines.append(_precision(result))
        blocks = (_modes(result), _coupling(result), _statics(result), _others(result))
        for block in (*blocks, _yields(result), _shares(result)):
            own = list(block)
            if own:
                lines += ["", *own]
        return "\n".join(lines)

    def read_result(self, file: h5py.File, run: Origin, extra: Document) -> Tolerance:
        """Read the statistics of the group `tolerance`, with the first builds."""
        from suspension_cli.analyses.tolerance import summary

        return summary.load(file["tolerance"], run)

    def figures(self, result: Tolerance, setting: Settings) -> dict[str, Figure]:
        """Draw required quantities, causes, and other quantities that vary."""
        from suspension_cli.analyses.tolerance import picture

        return {"": picture.draw(result, result.subtitle)}


@dataclasses.dataclass
class _Estimator:
    """Estimates of the last job that was finished: of its precision, then for its file."""

    limit: float
    job: RandomBuilds | None = None
    estimates: Estimates | None = None

    def of(self, columns: Columns, job: RandomBuilds) -> Estimates:
        """Estimate the statistics of a finished job."""
        from suspension_cli.analyses.tolerance.estimates import estimate

        if self.estimates is None or self.job != job:
            self.job = job
            self.estimates = estimate(columns, job, self.limit)
        return self.estimates


def _write(
    estimator: _Estimator,
    precision: float,
    group: h5py.Group,
    columns: Columns,
    job: RandomBuilds,
    origin: Origin,
) -> Tolerance:
    """Write the group of the results file."""
    from suspension_cli.analyses.tolerance import summary_file

    estimates = estimator.of(columns, job)
    return summary_file.write(
        group,
        columns,
        job,
        origin,
        limit=estimator.limit,
        precision=precision,
        estimates=estimates,
    )


def _more_builds(
    run: Run, estimator: _Estimator, job: RandomBuilds, columns: Columns
) -> RandomBuilds | None:
    """Add builds to those of a job if standard errors exceed ``--precision``."""
    from suspension_cli.analyses.tolerance.estimates import builds_needed

    precision = run.setting["precision"]
    most = run.setting["builds"] or MOST_BUILDS
    if precision is None or job.count >= most:
        return None
    largest, of_what = estimator.of(columns, job).largest_error(job)
    count = min(builds_needed(job, largest, precision), most)
    if count == job.count:
        return None
    run.log.say(
        f"{run.name}: largest standard error after {job.count:,} builds {100 * largest:.2g} %"
        f" ({of_what}); computing {count:,} builds"
    )
    return dataclasses.replace(job, count=count)


def _warnings(found: Tolerance, job: RandomBuilds) -> Iterator[str]:
    """Say how many builds failed, and why."""
    for reason, count in found.failures.items():
        yield f"{count} of {job.count} builds failed: {reason}; they meet no requirement"


def _make_job(run: Run) -> RandomBuilds:
    """Look up what is asked of the builds in the design."""
    from suspension_cli.analyses.named_quantities import names_of
    from suspension_cli.analyses.tolerance import solve
    from suspension_cli.design.derive import mirror
    from suspension_cli.errors import gather
    from suspension_cli.models import registry
    from suspension_cli.physics.couplings import parse_request
    from suspension_cli.quantities import requirements

    setting = run.setting
    design = run.design
    names = names_of(run.source, setting, run.log)
    count = setting["builds"] or (MOST_BUILDS if setting["precision"] else BUILDS)
    if setting["precision"]:
        count = min(count, FIRST_ROUND)
    limits = [
        *requirements.of_tolerance(design),
        *requirements.of_design(design),
        *gather(requirements.parse, setting["require"]),
    ]
    return solve.RandomBuilds(
        run.source.text,
        count,
        setting["seed"],
        parse_request(registry.STRING.system(design), setting, mirror(design)),
        setting["allow_unstable"],
        requirements=solve.find_requirements(limits, names, run.source.text),
        results=solve.find_quantities(setting["results"], names, run.source.text),
    )


def _precision(found: Tolerance) -> str:
    """Line on the standard errors, and on whether they are as small as was asked for."""
    import math

    text = "standard errors in brackets, in units of the last digit"
    if math.isnan(found.largest_error):
        return text
    text += f"; largest {100 * found.largest_error:.2g} % ({found.largest_error_of})"
    if not found.precision:
        return text
    text += f", asked for: {100 * found.precision:g} %"
    if found.largest_error > found.precision:
        text += "; more --builds reach it"
    return text


def _modes(found: Tolerance) -> Iterator[str]:
    rows = []
    for nominal, one in zip(found.nominal_frequency, found.modes, strict=True):
        spread = None
        if nominal:
            per = 100 / nominal
            spread = tables.with_error(per * one.deviation, per * one.deviation_error)
        low, high = (_quantile(one, place) for place in (LOW, HIGH))
        rows.append((nominal, low, high, spread, one.name, _causes(found, one, 2)))
    columns = {"nominal\nHz": "#.5g", "5 %\nHz": " ", "95 %\nHz": " ", "std\n%": " "}
    columns |= {"mode": "", "depends most on (rank correlation, change)": ""}
    yield tables.render(columns, rows)


def _quantile(one: Spread, place: int, per: float = 1.0) -> str:
    """Write a quantile with its standard error, in units of 1/per."""
    return tables.with_error(
        per * float(one.quantiles[place]), per * float(one.quantile_errors[place])
    )


def _coupling(found: Tolerance) -> Iterator[str]:
    one = found.coupling
    under = found.under
    yield (
        f"|{found.ratio}| at {found.frequency:g} Hz: mean {tables.with_error(one.mean, one.error)},"
        f" median {_quantile(one, MEDIAN)}, 95 % below {_quantile(one, HIGH)}"
    )
    low, high = under.interval
    failed = found.good < found.builds
    which = f"the {found.good:,} builds that hang" if failed else "builds"
    yield (
        f"{100 * under.fraction:.4g} % of {which} lie below {found.limit:g} (95 % confidence:"
        f" {100 * low:.3g} to {100 * high:.3g} %)"
    )
    yield f"depends most on: {_causes(found, found.signed, 5) or 'no number significantly'}"


def _statics(found: Tolerance) -> Iterator[str]:
    varying = [one for one in found.static if one.deviation > NEGLIGIBLE]
    if varying:
        yield _table_of_spreads(found, varying, "displacement from the nominal pose")


def _others(found: Tolerance) -> Iterator[str]:
    """Table of quantities that are asked for; and how many builds do not have them."""
    if found.others:
        yield _table_of_spreads(found, found.others, "quantity")
    for one in (*found.modes, *found.others):
        if one.missing:
            count = f"{one.missing:,} of {found.good:,} builds"
            yield f"  {count} have no {one.name}: each {one.reason}"
        if one.infinite:
            yield f"  in {one.infinite:,} of {found.good:,} builds {one.name} is infinite"


def _table_of_spreads(found: Tolerance, spreads: Sequence[Spread], heading: str) -> str:
    rows = []
    for one in spreads:
        unit, per = one.displayed
        mean = tables.with_error(per * one.mean, per * one.error)
        std = tables.with_error(per * one.deviation, per * one.deviation_error)
        low, high = (_quantile(one, place, per) for place in (LOW, HIGH))
        rows.append((mean, std, low, high, unit, one.name, _causes(found, one, 1)))
    columns = dict.fromkeys(("mean", "std", "5 %", "95 %"), " ")
    columns |= {"unit": "", heading: "", "depends most on": ""}
    return tables.render(columns, rows)


def _yields(found: Tolerance) -> Iterator[str]:
    if found.joint is None:
        return
    rows = []
    for one in (*found.yields, found.joint):
        low, high = one.interval
        interval = f"{100 * low:.2f} to {100 * high:.2f}"
        percent = tables.with_error(100 * one.fraction, 100 * one.error)
        rows.append((percent, interval, one.name))
    columns = {"yield\n%": " ", "95 % confidence\n%": " ", "requirement": ""}
    yield tables.render(columns, rows)
    for name, count in found.shared.items():
        yield f"  in {count:,} of {found.good:,} builds two modes share {name}"
    described = {one.name for one in (*found.modes, found.coupling)}
    for one in found.required:
        if one.name not in described:
            what = _causes(found, one, 3) or "no number significantly"
            yield f"  {one.name} depends most on: {what}"


def _causes(found: Tolerance, one: Spread, count: int) -> str:
    """List numbers with the strongest significant correlations, and the change by each."""
    from suspension_cli.analyses.tolerance.build_statistics import strongest
    from suspension_cli.studies.parameters import STEPS

    unit, per = one.displayed
    texts = []
    for n in strongest(one.rank, count, found.significant):
        own = found.factor_unit[n]
        step, name = STEPS.get(own, (1.0, own))
        if own == "1":
            step = 0.01
            name = "%"
        change = f"{per * one.slope[n] * step:+.3g} {unit}".rstrip()
        texts.append(f"{found.factor[n]} {one.rank[n]:+.2f} ({change} per {name})")
    return ", ".join(texts)


def _shares(found: Tolerance) -> Iterator[str]:
    """Table of the fractions of variance that tolerances cause."""
    import numpy as np

    from suspension_cli.analyses.tolerance.summary import LEADING

    rows = []
    unexplained: list[str] = []
    asked = {one.name: one for one in (found.signed, *found.required, *found.others)}
    asked.pop(found.coupling.name, None)
    for one in asked.values():
        if not np.isfinite(one.r_squared):
            continue
        if one.r_squared <= 0:
            unexplained.append(one.name)
            continue
        order = np.argsort(-one.share, kind="stable").tolist()
        texts = [
            f"{found.group[n]} {one.share[n]:.3f} ± {one.share_error[n]:.3f}"
            for n in order
            if one.share[n] > max(LEAST_SHARE, 2 * one.share_error[n])
        ]
        rows.append((one.r_squared, one.name, ", ".join(texts[:LEADING])))
    if rows:
        heading = "fraction of the variance that each tolerance causes ± standard error"
        yield tables.render({"linear fit\nR²": ".3f", "quantity": "", heading: ""}, rows)
    if unexplained:
        yield (
            f"a linear fit explains nothing of the spread of {', '.join(unexplained)}: so it does"
            " not improve the statistics (control variates), and no fractions of variance are known"
        )


ANALYSIS = ToleranceAnalysis()
