"""`pendsus fit`: numbers of designs learned from measured modes."""

from __future__ import annotations

import dataclasses
import math
import sys
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import limits, options

if TYPE_CHECKING:
    from suspension_cli.analysis.fit import Fit
    from suspension_cli.cli.analyses import Read
    from suspension_cli.design.measured import Measured
    from suspension_cli.models.fidelity import Choice

SAME = 1e-3
"""Relative difference of chi^2 below which two searches ended at the same place."""

LARGEST = 6
"""Numbers told of a combination."""


@click.command("fit")
@click.argument("files", nargs=-1, required=True, metavar="[DESIGN] MEASURED")
@click.option(
    "--starts", type=click.IntRange(1, 100_000), default=1, show_default=True, help="Searches, all but the first from random numbers; the best counts."
)
@click.option("--seed", type=click.IntRange(0, 2**64 - 1), default=1, show_default=True, help="Of the random numbers.")
@options.analysis
@click.pass_context
def command(ctx: click.Context, files: tuple[str, ...], overrides: tuple[str, ...], out: str, as_json: bool, quiet: bool, verbose: bool, **_: Any) -> None:
    """Learn numbers of designs from measured modes.

    MEASURED is a TOML file of frequencies with uncertainties and of the numbers that are free: of DESIGN, or of several designs that it names itself,
    which may share numbers.  Writes DIR/NAME-fit.h5 and .png, and each fitted design as DIR/NAME-fitted.toml; NAME is the design's, or the stem of
    MEASURED and the experiment's.
    """
    from pathlib import Path

    from suspension_cli.analysis import fit, modes
    from suspension_cli.cli import analyses
    from suspension_cli.cli.progress import Bar
    from suspension_cli.design import measured as measurements
    from suspension_cli.design import reader
    from suspension_cli.errors import faults_of
    from suspension_cli.models import fidelity
    from suspension_cli.results import fit as results

    voice = options.Voice(quiet, verbose)
    text = reader.text_of(files[-1])
    given = measurements.read(files[-1], text)
    sources, setting, choice = _designs(ctx, files, given, overrides, voice)
    with faults_of(files[-1]), Bar(enabled=not quiet) as bar:
        how: dict[str, Any] = {"level": choice.level, "starts": setting["starts"], "seed": setting["seed"], "tell": bar}
        found = fit.solve([source.text for source in sources], given, [source.file for source in sources], **how)
    joint = given.experiment is not None
    name, folder = Path(files[-1]).stem if joint else found.experiment[0], options.folder(out)
    path = folder / f"{name}-fit.h5"
    title = (given.title if joint else sources[0].design.design.title) or name
    with analyses.written(path, sources[0], voice):
        results.save(path, found, analyses.provenance(sources[0], choice, sys.argv), [source.text for source in sources], text, title)
    for n, source in enumerate(sources):
        fitted = folder / f"{name}-{found.experiment[n]}-fitted.toml" if joint else folder / f"{name}-fitted.toml"
        results.save_design(fitted, found, n, Path(source.file).name, Path(files[-1]).name, options.command_line(sys.argv))
        voice.say(f"wrote {fitted}")
    for label, bound in zip(found.parameters, found.at_bound, strict=True):
        if bound:
            voice.warn(f"{label} ends at its bound")
    for name, fitted in zip(found.experiment, found.design, strict=True):
        design = reader.parse(fitted)
        limits.implausible(design, voice)
        states = modes.solve(fidelity.linear_model(design, choice.level))
        if not states.stable:
            voice.warn(f"{name} as fitted is unstable on {choice.level}: {states.label[0]} grows at {states.growth_rate[0]:.4g} 1/s")
    if setting["plot"] or (setting["plot"] is None and not as_json):
        from suspension_cli.plots import fit as picture

        analyses.draw(picture.draw(found, title), path.with_suffix(".png"), voice)
    if as_json:
        import json

        for line in misfit(found):
            voice.warn(line)
        click.echo(json.dumps(document(name, [source.file for source in sources], choice, found)))
    else:
        options.put("\n".join(table(found)))


def _designs(
    ctx: click.Context, files: tuple[str, ...], given: Measured, overrides: tuple[str, ...], voice: options.Voice
) -> tuple[list[Read], dict[str, Any], Choice]:
    """The designs that were measured, the options (of the first, where defaults stand in the designs), and the rung with its largest error."""
    from pathlib import Path

    from suspension_cli.cli import analyses, rung
    from suspension_cli.errors import Fault, InputError, joined, shown

    if given.experiment is None:
        if len(files) != 2:
            raise InputError(
                [Fault("mode", f"of one design, but {len(files) - 1} are given", "write pendsus fit DESIGN MEASURED, or name designs in [[experiment]]")],
                files[-1],
            )
        asked = [(files[0], ())]
    else:
        if len(files) != 1:
            raise InputError([Fault("experiment", "names its designs itself", "write pendsus fit MEASURED", shown(files[0]))], files[-1])
        asked = [(str(Path(files[-1]).parent / item.design), tuple(item.set)) for item in given.experiment]
    read, bad = [], {}
    for n, (file, own) in enumerate(asked, 1):
        try:
            read.append(analyses.prepared(ctx, file, (*own, *overrides)))
        except InputError as error:
            theirs = {shown(text) for text in own} - {shown(text) for text in overrides}
            moved = [Fault(f"experiment.{n}.set", fault.problem, fault.remedy, fault.value) for fault in error.faults if fault.value in theirs]
            told = InputError(moved, files[-1]) if moved else error  # what stands in MEASURED, not on the command line
            bad[str(told)] = told
    if bad:
        raise joined(list(bad.values()))
    sources = [source for source, _ in read]
    seen = [given.mode] if given.experiment is None else [item.mode for item in given.experiment]
    choices = []
    setting = read[0][1]
    for source, measured in zip(sources, seen, strict=True):
        with source.faults():
            decision = rung.differentiable(setting["fidelity"], source, _asker({mode.label for mode in measured or ()}))
        choices.append(decision.choice)
        rung.tell(source, decision, voice, tuple(rung.DIFFERENTIABLE))
    return sources, setting, max(choices, key=lambda choice: -1.0 if math.isnan(choice.error) else choice.error)


def _asker(labels: set[str | None]) -> Any:
    """The modes of these labels; all if some have none."""
    from suspension_cli.analysis import modes, scalars
    from suspension_cli.analysis.asked import Several

    def asked(model: Any) -> Several:
        found = modes.solve(dataclasses.replace(model, terms=()))
        every = tuple(scalars.Mode(name, n) for n, name in enumerate(scalars.labels(found)))
        return Several(every if None in labels else tuple(mode for mode in every if mode.text in labels) or every, found)

    return asked


def document(name: str, files: list[str], choice: Choice, found: Fit) -> dict[str, Any]:
    """The JSON document; null for an uncertainty that is infinite or that of a number at its bound."""
    from suspension_cli.cli import rung
    from suspension_cli.cli.analyses import plain

    who = found.experiment
    learned = [
        {
            "name": label,
            "start": plain(found.start[n]),
            "value": plain(found.value[n]),
            "sigma": plain(found.scale * found.sigma[n]),
            "at_bound": bool(found.at_bound[n]),
        }
        | {"experiments": [name for name, here in zip(who, found.shared[n], strict=True) if here]}
        for n, label in enumerate(found.name)
    ]
    columns = {
        "measured_hz": found.measured,
        "uncertainty_hz": found.uncertainty,
        "before_hz": found.before,
        "after_hz": found.after,
        "residual": found.residual,
    }
    modes = [
        {"experiment": who[found.of[n]], "label": label} | {key: plain(values[n]) for key, values in columns.items()} for n, label in enumerate(found.label)
    ]
    exchanged = None
    if found.exchange is not None:
        exchanged = {"experiment": who[found.exchange.experiment], "labels": list(found.exchange.labels), "chi_squared": found.exchange.chi_squared}
    return {
        "command": "fit",
        "design": name,
        "fidelity": choice.level,
        "experiments": [{"name": experiment, "design": file} for experiment, file in zip(who, files, strict=True)],
        "parameters": learned,
        "covariance": plain(found.scale**2 * found.covariance),
        "modes": modes,
        "chi_squared": found.chi_squared,
        "chi_squared_of_starts": found.ends.tolist(),
        "degrees_of_freedom": found.freedom,
        "misfit": found.misfit,
        "sigma_scale": found.scale,
        "exchange": exchanged,
        "singular_values": found.singular.tolist(),
        "directions": found.direction.tolist(),
        "estimated_error": rung.estimate(choice),
    }


def misfit(found: Fit) -> list[str]:
    """Lines that say how far model and measurements disagree, and what would mend it; none if they agree."""
    if not found.misfit:
        return []
    lines = [
        f"MISFIT: chi^2 is {found.chi_squared:.4g} for {found.freedom} degrees of freedom, so these numbers do not explain the measurements; "
        f"uncertainties are given {found.scale:.3g} times as large"
    ]
    if found.exchange is None:
        lines.append("no exchange of two labels mends it: free more numbers, or check designs, labels and uncertainties")
    else:
        first, second = found.exchange.labels
        where = f" in {found.experiment[found.exchange.experiment]}" if len(found.experiment) > 1 else ""
        lines.append(f'are two labels exchanged? with "{first}" and "{second}" the other way round{where} chi^2 is {found.exchange.chi_squared:.4g}')
    return lines


def table(found: Fit) -> list[str]:
    """What was learned, how modes lie, and what the data cannot tell apart."""
    from suspension_cli.results.fit import spread

    wide = max(len(name) for name in found.parameters)
    lines = [*misfit(found), ""] if found.misfit else []
    for n, name in enumerate(found.parameters):
        lines.append(f"{name:{wide}}  {found.start[n]:#.6g} -> {found.value[n]:#.6g}{spread(found, n)}")
    lines += ["", "   measured        before    after Hz  residual  mode"]
    for n, label in enumerate(found.modes):
        known = f"{found.measured[n]:#9.5g} +- {found.uncertainty[n]:.2g}"
        before, after = (f"{value:#9.5g}" if math.isfinite(value) else " unstable" for value in (found.before[n], found.after[n]))
        residual = f"{found.residual[n]:+8.2f}" if math.isfinite(found.residual[n]) else f"{'-':>8}"
        lines.append(f"{known:18} {before} {after}  {residual}  {label}")
    lines += ["", f"chi^2 {found.chi_squared:.4g} for {found.freedom} degrees of freedom"]
    if len(found.ends) > 1:
        same = int((found.ends <= (1 + SAME) * found.ends[0]).sum())
        rest = f", the next best at {found.ends[same]:.4g}" if same < len(found.ends) else ""
        lines.append(f"{same} of {len(found.ends)} searches ended there{rest}")
    lines += ["", "what the modes by themselves say, from best to worst known combination of relative changes:"]
    for value, row in zip(found.singular, found.direction, strict=True):
        largest = sorted(zip(row, found.parameters, strict=True), key=lambda item: -abs(item[0]))[:LARGEST]
        parts = " ".join(f"{share:+.2f} {name}" for share, name in largest if abs(share) >= 0.05)
        lines.append(f"  {f'to {100 / value:.2g} %' if value > 1e-9 * found.singular[0] else 'not at all'}: {parts}")
    if len(found.singular) < len(found.name):
        lines.append(f"  and {len(found.name) - len(found.singular)} not at all: there are more numbers than modes")
    return lines
