"""`pendsus tolerance`: builds with everything a little wrong."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import options

if TYPE_CHECKING:
    from suspension_cli.analysis.scatter import Summary
    from suspension_cli.analysis.tolerance import Tolerances
    from suspension_cli.cli.analyses import Read
    from suspension_cli.models.fidelity import Choice


LEVELS = ("string", "beam")
"""Rungs that random builds have; the first unless another is asked for."""


@click.command("tolerance")
@options.design
@click.option("--builds", type=click.IntRange(1, 1_000_000_000), default=10_000, show_default=True, help="How many.")
@click.option("--seed", type=click.IntRange(0, 2**64 - 1), default=1, show_default=True, help="Of the random numbers; the same seed gives the same builds.")
@click.option("--limit", type=click.FloatRange(0.0, min_open=True), default=1e-3, show_default=True, help="On the cross-coupling (the paper's 0.1 %).")
@options.question
@options.batch
@options.allow_unstable
@options.analysis
@click.pass_context
def command(ctx: click.Context, design: str, overrides: tuple[str, ...], out: str, as_json: bool, quiet: bool, verbose: bool, **_: Any) -> None:
    """Random builds of the design's [tolerance] table: mode frequencies and cross-coupling.

    Tells quantiles, the share of builds under a limit and which imperfections matter most.  Writes DIR/NAME-tolerance.h5 and .png.
    """
    from suspension_cli.analysis import auto
    from suspension_cli.analysis.asked import Frequencies
    from suspension_cli.analysis.tolerance import Tolerances
    from suspension_cli.cli import analyses, rung
    from suspension_cli.results import tolerance as files

    voice = options.Voice(quiet, verbose)
    source, setting = analyses.prepared(ctx, design, overrides)
    with source.faults():
        decision = auto.left_out(source.design, rung.imperfect(source, setting["fidelity"], LEVELS), lambda _: Frequencies())
        choice = decision.choice
        model = rung.stood(source, choice, setting["allow_unstable"], voice, decision.model)
        job = Tolerances(source.text, setting["builds"], setting["seed"], analyses.question(model, setting), setting["allow_unstable"], choice.level)
        job.check()
        voice.detail(f"{len(job.factors)} numbers scatter")
        if choice.level == "string":
            choice = _coupled(job, choice)
    if setting["fidelity"] == "auto":
        rung.tell(source, decision, voice, LEVELS)
        _tell(source, choice, decision.choice, voice)
    path = options.folder(out) / f"{source.design.design.name}-tolerance.h5"
    analyses.swept(job, path, "tolerance", source, choice, setting, voice, lambda group: files.fill(group, job, setting["limit"]))
    summary = files.summarise(path, job, setting["limit"])
    for reason, count in summary.failures.items():
        voice.warn(f"{count} of {summary.builds} builds failed: {reason}")
    ratio = f"{job.question.over.text} / {job.question.under.text}"
    if setting["plot"] or (setting["plot"] is None and not as_json):
        from suspension_cli.plots import tolerance as picture

        analyses.draw(picture.draw(summary, source.design.design.title or source.design.design.name, ratio), path.with_suffix(".png"), voice)
    if as_json:
        import json

        click.echo(json.dumps(document(source.design.design.name, choice, job.seed, ratio, summary)))
    else:
        options.put(table(choice, ratio, summary))


def _coupled(job: Tolerances, choice: Choice) -> Choice:
    """What strings leave out of the cross-coupling too, in the choice."""
    from suspension_cli.analysis import rungs

    error = rungs.scatter_error(job)
    if math.isnan(error):
        return choice
    reason = f"{choice.reason}; of the cross-coupling: bending of wires ({error:.1g} of the largest of the first builds)"
    return dataclasses.replace(choice, reason=reason, error=max(choice.error, error))


def _tell(source: Read, choice: Choice, of_modes: Choice, voice: options.Voice) -> None:
    """Warn of what strings leave out of the cross-coupling, if that is more than of the modes."""
    from suspension_cli.cli import rung

    if choice.error > max(rung.TOLD, of_modes.error):
        what = "bending of wires changes the cross-coupling of builds by up to"
        voice.warn(f"{source.design.design.name}: {what} {float(f'{100 * choice.error:.2g}'):g} % of the largest: --fidelity beam has it")


def document(name: str, choice: Choice, seed: int, ratio: str, summary: Summary) -> dict[str, Any]:
    """The JSON document."""
    from suspension_cli.analysis.scatter import LEVELS, leading
    from suspension_cli.cli import rung

    def plain(value: float) -> float | None:
        return float(value) if math.isfinite(value) else None

    modes = [
        {
            "label": label,
            "nominal_hz": plain(summary.nominal[n]),
            "mean_hz": plain(summary.mean[n]),
            "std_hz": plain(summary.spread[n]),
            "quantiles_hz": [plain(value) for value in summary.quantiles[n]],
            "leading": leading(summary.mode_rank[n], summary.factor),
        }
        for n, label in enumerate(summary.label)
    ]
    coupling = {
        "ratio": ratio,
        "frequency_hz": summary.frequency,
        "limit": summary.limit,
        "share_under_limit": plain(summary.under),
        "quantiles": [plain(value) for value in summary.ratio_quantiles],
        "leading": leading(summary.ratio_rank, summary.factor),
    }
    head = {
        "command": "tolerance",
        "design": name,
        "fidelity": choice.level,
        "builds": summary.builds,
        "good": summary.good,
        "failures": summary.failures,
        "seed": seed,
    }
    return head | {"levels": list(LEVELS), "modes": modes, "coupling": coupling, "estimated_error": rung.estimate(choice)}


def table(choice: Choice, ratio: str, summary: Summary) -> str:
    """Modes and coupling for people."""
    from suspension_cli.analysis.scatter import LEVELS, leading

    lines = [f"{choice.level}: {choice.reason}", f"{summary.good:,} of {summary.builds:,} builds hang on taut wires", ""]
    lines.append("   nominal       5 %       95 %   std      mode, and what moves it most (rank correlation)")
    low, high = LEVELS.index(0.05), LEVELS.index(0.95)
    for n, label in enumerate(summary.label):
        what = ", ".join(f"{name} {value:+.2f}" for name, value in leading(summary.mode_rank[n], summary.factor, 2))
        spread = 100 * summary.spread[n] / summary.nominal[n] if summary.nominal[n] else math.nan
        lines.append(f"{summary.nominal[n]:#9.5g} {summary.quantiles[n, low]:#9.5g} {summary.quantiles[n, high]:#9.5g} Hz {spread:5.2f} %  {label}: {what}")
    lines += [
        "",
        f"|{ratio}| at {summary.frequency:g} Hz: median {summary.ratio_quantiles[LEVELS.index(0.5)]:.3g}, 95 % below {summary.ratio_quantiles[high]:.3g}",
    ]
    lines.append(f"{100 * summary.under:.4g} % of builds lie below {summary.limit:g}")
    lines.append("matters most: " + ", ".join(f"{name} {value:+.2f}" for name, value in leading(summary.ratio_rank, summary.factor)))
    return "\n".join(lines)
