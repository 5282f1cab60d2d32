"""`pendsus tolerance`: random builds within tolerances."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import Analysis, Result, Run, as_number
from suspension_cli.analyses.options import option

if TYPE_CHECKING:
    import h5py
    from matplotlib.figure import Figure

    from suspension_cli.analyses.tolerance.solve import RandomBuilds
    from suspension_cli.analyses.tolerance.statistics import Summary
    from suspension_cli.models.registry import Choice


class ToleranceAnalysis(Analysis):
    """Compute random builds within the design's [tolerance] table.

    Prints quantiles of mode frequencies and of the cross-coupling, the fraction of builds under a
    limit, and which imperfections matter most. Writes DIR/NAME-tolerance.h5 and .png.

    Example: pendsus tolerance configs/triple-tolerance.toml --builds 1000
    """

    name = "tolerance"
    arguments = (options.DESIGN,)
    parameters = (
        option(
            "--builds",
            type=click.IntRange(1, 1_000_000_000),
            default=10_000,
            show_default=True,
            help="Number of random builds.",
        ),
        option(
            "--seed",
            type=click.IntRange(0, 2**64 - 1),
            default=1,
            show_default=True,
            help="Seed of the random numbers; the same seed gives the same builds.",
        ),
        option(
            "--limit",
            type=click.FloatRange(0.0, min_open=True),
            default=1e-3,
            show_default=True,
            help="Limit on the cross-coupling (the paper's 0.1 %).",
        ),
        *options.COUPLING,
        *options.SWEEP,
        options.ALLOW_UNSTABLE,
        *options.WRITING,
    )

    def solve(self, run: Run) -> Result:
        """Compute all builds, then their statistics."""
        from suspension_cli.analyses import model_choice, sweeping
        from suspension_cli.analyses.tolerance import file as stored
        from suspension_cli.analyses.tolerance.solve import RandomBuilds
        from suspension_cli.analyses.xcouple.request import parse_request
        from suspension_cli.models import auto, registry
        from suspension_cli.models.quantity_of_interest import Frequencies

        setting, source = run.setting, run.source
        models = (registry.STRING, registry.BEAM)
        decision = auto.estimate_error(
            run.design,
            model_choice.for_builds(source, setting["fidelity"], models),
            lambda _: Frequencies(),
        )
        choice = decision.choice
        model = model_choice.stable_system(
            source, choice, setting["allow_unstable"], run.log, decision.model
        )
        job = RandomBuilds(
            source.text,
            setting["builds"],
            setting["seed"],
            parse_request(model, setting),
            setting["allow_unstable"],
            choice.level,
        )
        job.check()
        run.log.detail(f"{len(job.factors)} numbers scatter")
        if not choice.model.bends_wires:
            choice = _coupled(job, choice)
        if setting["fidelity"] == "auto":
            model_choice.warn_of_neglected(source, decision, run.log, models)
            _warn_of_coupling(run, choice, decision.choice)
        path = sweeping.fill(
            run, self, job, choice, lambda group: stored.fill(group, job, setting["limit"])
        )
        summary = stored.summarise(path, job, setting["limit"])
        for reason, count in summary.failures.items():
            run.log.warn(f"{count} of {summary.builds} builds failed: {reason}")
        return Result(self, source, choice, summary, file=path, command=run.command)

    def document(self, result: Result) -> dict[str, Any]:
        """Return statistics of every mode and of the coupling."""
        from suspension_cli.analyses.tolerance.statistics import QUANTILES, leading

        summary: Summary = result.data
        modes = [
            {
                "label": label,
                "nominal_hz": as_number(summary.nominal[n]),
                "mean_hz": as_number(summary.mean[n]),
                "std_hz": as_number(summary.spread[n]),
                "quantiles_hz": [as_number(value) for value in summary.quantiles[n]],
                "leading": leading(summary.mode_rank[n], summary.factor),
            }
            for n, label in enumerate(summary.label)
        ]
        coupling = {
            "ratio": summary.ratio,
            "frequency_hz": summary.frequency,
            "limit": summary.limit,
            "share_under_limit": as_number(summary.under),
            "quantiles": [as_number(value) for value in summary.ratio_quantiles],
            "leading": leading(summary.ratio_rank, summary.factor),
        }
        return {
            "builds": summary.builds,
            "good": summary.good,
            "failures": summary.failures,
            "seed": summary.seed,
            "levels": list(QUANTILES),
            "modes": modes,
            "coupling": coupling,
        }

    def text(self, result: Result) -> str:
        """Return tables of modes and coupling."""
        from suspension_cli.analyses.tolerance.statistics import QUANTILES, leading

        summary: Summary = result.data
        lines = [
            result.choice.line,
            f"{summary.good:,} of {summary.builds:,} builds hang on taut wires",
            "",
        ]
        low, high = QUANTILES.index(0.05), QUANTILES.index(0.95)
        rows = []
        for n, label in enumerate(summary.label):
            what = ", ".join(
                f"{name} {value:+.2f}"
                for name, value in leading(summary.mode_rank[n], summary.factor, 2)
            )
            nominal, quantiles = summary.nominal[n], summary.quantiles[n]
            spread = 100 * summary.spread[n] / nominal if nominal else None
            rows.append((nominal, quantiles[low], quantiles[high], spread, label, what))
        columns = dict.fromkeys(("nominal\nHz", "5 %\nHz", "95 %\nHz"), "#.5g")
        columns |= {"std\n%": ".2f", "mode": "", "what moves it most (rank correlation)": ""}
        lines.append(tables.render(columns, rows))
        lines += [
            "",
            (
                f"|{summary.ratio}| at {summary.frequency:g} Hz: median"
                f" {summary.ratio_quantiles[QUANTILES.index(0.5)]:.3g}, 95 % below"
                f" {summary.ratio_quantiles[high]:.3g}"
            ),
        ]
        lines.append(f"{100 * summary.under:.4g} % of builds lie below {summary.limit:g}")
        lines.append(
            "matters most: "
            + ", ".join(
                f"{name} {value:+.2f}"
                for name, value in leading(summary.ratio_rank, summary.factor)
            )
        )
        return "\n".join(lines)

    def load(self, file: h5py.File) -> Summary:
        """Sum up the group `tolerance`."""
        from suspension_cli.analyses.tolerance import file as stored

        group: Any = file["tolerance"]
        job = stored.reconstruct_job(group, str(file.attrs["design"]))
        return stored.summarise_group(group, job, float(group.attrs["limit"]))

    def figures(self, result: Result, setting: dict[str, Any]) -> dict[str, Figure]:
        """Draw distributions and correlations."""
        from suspension_cli.analyses.tolerance import picture

        return {"": picture.draw(result.data, result.title, result.data.ratio)}


def _coupled(job: RandomBuilds, choice: Choice) -> Choice:
    """Add the error of the cross-coupling by neglected wire bending to a choice."""
    from suspension_cli.analyses.tolerance import model_error

    error = model_error.estimate_scatter_error(job)
    if math.isnan(error):
        return choice
    reason = (
        f"{choice.reason}; of the cross-coupling: bending of wires ({error:.1g} of the largest of"
        " the first builds)"
    )
    return dataclasses.replace(choice, reason=reason, error=max(choice.error, error))


def _warn_of_coupling(run: Run, choice: Choice, of_modes: Choice) -> None:
    """Warn of what strings neglect in the cross-coupling, if that is more than in the modes."""
    from suspension_cli.analyses import model_choice

    if choice.error > max(model_choice.WARNED_ERROR, of_modes.error):
        run.log.warn(
            f"{run.name}: bending of wires changes the cross-coupling of builds by up to"
            f" {float(f'{100 * choice.error:.2g}'):g} % of the largest: --fidelity beam has it"
        )


ANALYSIS = ToleranceAnalysis()
