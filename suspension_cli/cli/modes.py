"""`pendsus modes`: frequencies and shapes of the normal modes."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import analyses, limits, options, rung

if TYPE_CHECKING:
    from suspension_cli.analysis.modes import Modes
    from suspension_cli.design.reader import Source
    from suspension_cli.models.fidelity import Choice

HIGHEST = 1000.0
"""Hz; up to where modes are listed on the violin rung."""


@click.command("modes")
@options.designs
@click.option(
    "--max-frequency", type=options.Finite(1e-6, 1e6), metavar="HZ", help="List all modes up to here; with auto and violin those of the wires' own mass too."
)
@options.tolerance
@options.analysis
@click.pass_context
def command(ctx: click.Context, designs: tuple[str, ...], overrides: tuple[str, ...], out: str, as_json: bool, quiet: bool, verbose: bool, **_: Any) -> None:
    """Frequencies and shapes of the normal modes.

    Prints a table (or JSON), writes DIR/NAME-modes.h5 and .png for each DESIGN.  An unstable equilibrium is told with
    its growth rates; a rigid mode (a body free to spin on one wire) has frequency 0.

    With --max-frequency (or --fidelity violin, then up to 1 kHz) the wires have mass: violin modes are listed with the others, none missed.
    On beam and violin every mode has its Q and its dilution factor.
    """
    voice = options.Voice(quiet, verbose)
    sources = _read_all(designs, overrides)
    settings = [options.with_analysis_table(ctx, source.design.analysis.get("modes", {}), source.file) for source in sources]
    solved = [_solve(source, setting) for source, setting in zip(sources, settings, strict=True)]
    folder = options.folder(out)
    documents = []
    for number, (source, setting, (choice, modes)) in enumerate(zip(sources, settings, solved, strict=True)):
        _write(source, choice, modes, folder, not as_json if setting["plot"] is None else setting["plot"], voice)
        if as_json:
            documents.append(document(source.design.design.name, choice, modes))
            voice.say(f"{source.design.design.name}: {choice.level}: {choice.reason}")
        else:
            options.put(("\n" if number else "") + table(source, choice, modes))
        _warn_of_series(source, choice, modes, voice)
        limits.warn_on(source.design, choice.level, modes, voice)
        for label, rate in zip(modes.label, modes.growth_rate, strict=True):
            if rate > 0:
                voice.warn(f"{source.design.design.name} is unstable: {label} grows at {rate:.4g} 1/s")
    if as_json:
        import json

        click.echo(json.dumps(documents[0] if len(documents) == 1 else documents))


def _warn_of_series(source: Source, choice: Choice, modes: Modes, voice: options.Voice) -> None:
    """Say with a number what blades in series with angled wires cost, where that is more than the tolerance."""
    from suspension_cli.analysis import rungs

    apart = rungs.series_error(source.design, modes) if choice.level == "force" else None
    if apart is not None and abs(apart.share) > options.TOLERANCE:
        voice.warn(
            f"{source.design.design.name}: blades under angled wires are taken in series with them: "
            f"{apart.label} {apart.quick:.4g} Hz is {apart.general:.4g} Hz with --fidelity string ({100 * apart.share:+.2g} %)"
        )


def _read_all(files: tuple[str, ...], overrides: tuple[str, ...]) -> list[Source]:
    from suspension_cli.design.reader import read
    from suspension_cli.errors import Fault, InputError, joined, shown

    sources, bad = [], []
    for file in files:
        try:
            sources.append(read(file, overrides))
            options.check_tables(sources[-1].design.analysis, file)
        except InputError as error:
            bad.append(error)
    if bad:
        raise joined(bad)
    names = [source.design.design.name for source in sources]
    for n, name in enumerate(names):
        if name in names[:n]:
            raise InputError([Fault("design.name", "is the name of another design of this run", "give each a name of its own", shown(name))], sources[n].file)
    return sources


def _solve(source: Source, setting: dict[str, Any]) -> tuple[Choice, Modes]:
    import numpy as np

    from suspension_cli.analysis import auto, modes, wire_modes
    from suspension_cli.analysis.asked import Frequencies
    from suspension_cli.errors import faults_of
    from suspension_cli.models import fidelity as ladder

    highest, level = setting["max_frequency"], setting["fidelity"]
    with faults_of(source.file):
        if highest is None and level == "auto":
            decision = auto.decide(source.design, lambda _: Frequencies(), setting["tolerance"])
            found = modes.solve(decision.model)
            if decision.choice.level != "violin":
                return decision.choice, found
            # the mass of wires lowers all frequencies: those of the bodies lie below the highest one without it
            return decision.choice, wire_modes.solve(decision.model, float(np.nanmax(found.frequency)))
        decision = auto.left_out(source.design, ladder.choose(source.design, "violin" if level == "auto" else level), lambda _: Frequencies())
        if decision.choice.level != "violin":
            found = modes.solve(decision.model)
            return decision.choice, found if highest is None else found.up_to(highest)
        highest = HIGHEST if highest is None else highest
        return ladder.Choice("violin", f"wires with their mass, all modes up to {highest:g} Hz", 0.0), wire_modes.solve(decision.model, highest)


def _write(source: Source, choice: Choice, modes: Modes, folder: Any, plot: bool, voice: options.Voice) -> None:
    from suspension_cli.results import Provenance
    from suspension_cli.results import modes as files

    path = folder / f"{source.design.design.name}-modes.h5"
    with analyses.written(path, source, voice):
        files.save(path, modes, Provenance(source.text, options.command_line(sys.argv), choice.level, choice.reason, error=choice.error))
    if plot:
        from suspension_cli.design.expand import expand
        from suspension_cli.plots import modes as picture
        from suspension_cli.plots import wires

        figures = {path.with_suffix(".png"): picture.draw(modes, source.design, expand(source.design))}
        if modes.wire:
            figures[path.with_name(f"{path.stem}-wires.png")] = wires.draw(modes, source.design)
        for name, figure in figures.items():
            analyses.draw(figure, name, voice)


def document(name: str, choice: Choice, modes: Modes) -> dict[str, Any]:
    """The JSON document of one design."""
    import numpy as np

    rows, labels, verdicts = [], modes.label, modes.verdict
    for n, (body, dof) in enumerate(modes.home):
        unstable = modes.growth_rate[n] > 0
        row: dict[str, Any] = {
            "frequency_hz": None if unstable else float(modes.frequency[n]),
            "dof": dof,
            "stage": body,
            "q": float(modes.q[n]) if np.isfinite(modes.q[n]) else None,
        }
        if np.isfinite(modes.dilution[n]):
            row["dilution"] = float(modes.dilution[n])
        if unstable:
            row["growth_rate_per_s"] = float(modes.growth_rate[n])
        share = {"label": labels[n], "share": float(modes.shares[n].max()), "top_mass_share": float(modes.top_share[n]), "verdict": verdicts[n]}
        rows.append(row | share)
    return {"command": "modes", "design": name, "fidelity": choice.level, "stable": modes.stable, "modes": rows} | {"estimated_error": rung.estimate(choice)}


def table(source: Source, choice: Choice, modes: Modes) -> str:
    """The modes of one design as a table for people."""
    import numpy as np

    from suspension_cli.analysis.modes import described

    head = source.design.design
    lines = [f"{head.title or head.name}" + (f"  [{head.name}]" if head.title else ""), f"{choice.level}: {choice.reason}", ""]
    lossy = bool(np.isfinite(modes.q).any())
    diluted = bool(np.isfinite(modes.dilution).any())
    columns = ("        Q  " if lossy else "") + ("dilution  " if diluted else "")
    lines.append(f"  #    frequency  {columns}{'from the top mass':24}  mode, by share of kinetic energy")
    verdict = modes.verdict
    for group in modes.groups:
        n, shares = group[0], modes.shares[group[0]]
        leading = [i for i in np.argsort(-shares.round(9), kind="stable")[:3] if shares[i] > 0.02]
        where = ", ".join(f"{described(modes.place[i])} {100 * shares[i]:.0f} %" for i in leading)
        quality = _number(modes.q[n], 9) if lossy else ""
        quality += _number(modes.dilution[n], 8) if diluted else ""
        if modes.order[n]:
            last = group[-1]
            spread = "" if len(group) == 1 else f", {len(group)} modes to {modes.frequency[last]:#.6g} Hz"
            lines.append(f"{n + 1:3d}  {_frequency(modes, n):>11}  {quality}{'':24}  {_family(modes, group)}{spread}")
            continue
        top = f"{100 * modes.top_share[n]:.1f} %, {verdict[n]}"
        lines.append(f"{n + 1:3d}  {_frequency(modes, n):>11}  {quality}{top:24}  {where}")
    return "\n".join(lines)


def _family(modes: Modes, group: list[int]) -> str:
    """What modes of wires that lie together have in common."""
    labels = [modes.label[n] for n in group]
    if len(set(labels)) == 1:
        return labels[0]
    body, dof = modes.home[group[0]]
    return f"{body} {'violin' if dof.startswith('violin') else dof} {modes.order[group[0]]}"


def _number(value: float, width: int) -> str:
    return f"{value:{width}.4g}  " if value < float("inf") else f"{'-':>{width}}  "


def _frequency(modes: Modes, n: int) -> str:
    if modes.growth_rate[n] > 0:
        return "unstable"
    if modes.omega_squared[n] == 0:
        return "rigid"
    return f"{modes.frequency[n]:#.5g} Hz"
