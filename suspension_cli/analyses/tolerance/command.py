"""`pendsus tolerance`: random builds within tolerances."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.analyses import options, tables
from suspension_cli.analyses.analysis import Analysis, Result, Run, as_number
from suspension_cli.analyses.options import option

if TYPE_CHECKING:
    import h5py
    from matplotlib.figure import Figure

    from suspension_cli.analyses.tolerance.statistics import Summary


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
        options.ACCURACY,
        options.ALLOW_UNSTABLE,
        *options.WRITING,
    )

    def solve(self, run: Run) -> Result:
        """Compute all builds, then their statistics."""
        from suspension_cli.analyses import model_choice, sweeping
        from suspension_cli.analyses.tolerance import file as stored
        from suspension_cli.analyses.tolerance import model_error
        from suspension_cli.analyses.tolerance.solve import RandomBuilds
        from suspension_cli.analyses.xcouple.request import parse_request
        from suspension_cli.models import registry

        setting, source = run.setting, run.source
        job = RandomBuilds(
            source.text,
            setting["builds"],
            setting["seed"],
            parse_request(registry.STRING.system(run.design), setting),
            setting["allow_unstable"],
        )
        job.check()
        run.log.detail(f"{len(job.factors)} numbers scatter")
        choice = model_choice.for_builds(
            source,
            setting["fidelity"],
            (registry.STRING, registry.BEAM),
            model_error.build_change(job),
            setting["tolerance"],
        )
        model_choice.stable_system(source, choice, setting["allow_unstable"], run.log, bends=True)
        job = dataclasses.replace(job, level=choice.level)
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
        job = stored.reconstruct_job(group, str(file.attrs["design"]), str(file.attrs["fidelity"]))
        return stored.summarise_group(group, job, float(group.attrs["limit"]))

    def figures(self, result: Result, setting: dict[str, Any]) -> dict[str, Figure]:
        """Draw distributions and correlations."""
        from suspension_cli.analyses.tolerance import picture
        from suspension_cli.drawing.style import name_model

        figure = picture.draw(result.data, result.title, result.data.ratio)
        return {"": name_model(figure, result.choice)}


ANALYSIS = ToleranceAnalysis()
