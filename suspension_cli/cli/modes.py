"""`pendsus modes`: frequencies and shapes of the normal modes."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import analyses, limits, options, progress, rung

if TYPE_CHECKING:
    from suspension_cli.analysis.modes import Modes
    from suspension_cli.design.lossless import Lossless
    from suspension_cli.design.reader import Source
    from suspension_cli.models.fidelity import Choice

HIGHEST = 1000.0
"""Hz; up to where modes are listed on the violin rung."""
MOST = 1000
"""Modes of wires with mass above which a run is refused unless it is asked for with --all."""
MANY = 100
"""Modes whose number is printed before they are looked for."""


@click.command("modes")
@options.designs
@click.option(
    "--max-frequency", type=options.Finite(1e-6, 1e6), metavar="HZ", help="List all modes up to here; with auto and violin those of the wires' own mass too."
)
@click.option("--all", "every", is_flag=True, help=f"Solve for all modes of wires with mass, be they more than {MOST}.")
@options.tolerance
@options.analysis
@click.pass_context
def command(ctx: click.Context, designs: tuple[str, ...], overrides: tuple[str, ...], out: str, as_json: bool, quiet: bool, verbose: bool, **_: Any) -> None:
    """Frequencies and shapes of the normal modes.

    Prints a table (or JSON), writes DIR/NAME-modes.h5 and .png for each DESIGN.  An unstable equilibrium is told with
    its growth rates; a rigid mode (a body free to spin on one wire) has frequency 0; an overdamped mode has a decay rate and no frequency.

    With --max-frequency (or --fidelity violin, then up to 1 kHz) the wires have mass: violin modes are listed with the others, none missed.
    On beam and violin every mode has its Q and its dilution factor.
    """
    import numpy as np

    voice = options.Voice(quiet, verbose)
    sources = _read_all(designs, overrides)
    settings = [options.with_analysis_table(ctx, source.design.analysis.get("modes", {}), source.file) for source in sources]
    solved = [_solve(source, setting, voice) for source, setting in zip(sources, settings, strict=True)]
    folder = options.folder(out)
    documents = []
    for number, (source, setting, (choice, undamped, modes)) in enumerate(zip(sources, settings, solved, strict=True)):
        _write(source, choice, modes, folder, not as_json if setting["plot"] is None else setting["plot"], voice)
        if as_json:
            documents.append(document(source.design.design.name, choice, modes, _lossless(source, choice)))
            voice.say(f"{source.design.design.name}: {choice.level}: {choice.reason}")
        else:
            options.put(("\n" if number else "") + table(source, choice, modes))
        _warn_of_series(source, choice, undamped, voice)
        limits.warn_on(source.design, choice.level, undamped, voice)
        if np.isfinite(modes.q).any():
            for line in limits.lossless(_lossless(source, choice), choice.level):
                voice.warn(f"{source.design.design.name}: {line}")
        for label, rate in zip(modes.label, modes.growth_rate, strict=True):
            if rate > 0:
                voice.warn(f"{source.design.design.name} is unstable: {label} grows at {rate:.4g} 1/s")
    if as_json:
        import json

        click.echo(json.dumps(documents[0] if len(documents) == 1 else documents))


def _lossless(source: Source, choice: Choice) -> list[Lossless]:
    from suspension_cli.design.lossless import without_loss

    return without_loss(source.design, choice.level)


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


def _solve(source: Source, setting: dict[str, Any], voice: options.Voice) -> tuple[Choice, Modes, Modes]:
    """What was chosen, the modes without damping (with the mass of wires: those with it), and the modes with all losses."""
    import numpy as np

    from suspension_cli.analysis import auto, damped, modes, wire_modes
    from suspension_cli.analysis.asked import Frequencies
    from suspension_cli.errors import faults_of
    from suspension_cli.models import fidelity as ladder

    highest, level = setting["max_frequency"], setting["fidelity"]
    with faults_of(source.file):
        if highest is None and level == "auto":
            decision = auto.decide(source.design, lambda _: Frequencies(), setting["tolerance"])
        else:
            decision = auto.left_out(source.design, ladder.choose(source.design, "violin" if level == "auto" else level), lambda _: Frequencies())
        model, choice = decision.model, decision.choice
        if choice.level != "violin":
            found = modes.solve(model)
            listed = damped.solve(model, found)
            if highest is None:
                return choice, found, listed
            listed = listed.up_to(highest)
            if not len(listed.q):
                raise wire_modes.none_below(highest)
            return choice, found, listed
        if level == "auto" and highest is None:
            # the mass of wires lowers all frequencies: those of the bodies lie below the highest one without it
            still = modes.solve(model)
            top = float(np.nanmax(still.frequency))
            cause = f"the highest mode of the bodies without them ({still.label[int(np.nanargmax(still.frequency))]})"
        else:
            top, cause = HIGHEST if highest is None else highest, "--max-frequency" if highest is not None else "where none is given"
            choice = ladder.Choice("violin", f"wires with their mass, all modes up to {top:g} Hz", 0.0)
        _admit(source, wire_modes.number(model, top), top, cause, setting["every"], voice)
        with progress.Bar(enabled=not voice.quiet) as bar:
            found = wire_modes.solve(model, top, damping=True, progress=bar)
        return choice, found, found


def _admit(source: Source, number: int, top: float, cause: str, every: bool, voice: options.Voice) -> None:
    """Say how many modes there are, where they are many, and refuse more than `MOST` that nobody asked for."""
    from suspension_cli.errors import Fault, InputError

    if number > MOST and not every:
        problem = f"wires with mass have {number:,} modes up to {top:.4g} Hz ({cause}), and more than {MOST:,} take long"
        raise InputError([Fault("", problem, "check the design's numbers, give a lower --max-frequency, or --all to have them all")])
    if number > MANY:
        voice.say(f"{source.design.design.name}: {number:,} modes up to {top:.4g} Hz")


def _write(source: Source, choice: Choice, modes: Modes, folder: Any, plot: bool, voice: options.Voice) -> None:
    from suspension_cli.results import Provenance
    from suspension_cli.results import modes as files

    path = folder / f"{source.design.design.name}-modes.h5"
    with analyses.written(path, source, voice):
        files.save(path, modes, Provenance(source.text, options.command_line(sys.argv), choice.level, choice.reason, error=choice.error))
    if plot:
        from suspension_cli.mechanics.nominal import expand
        from suspension_cli.plots import modes as picture
        from suspension_cli.plots import wires

        figures = {path.with_suffix(".png"): picture.draw(modes, source.design, expand(source.design))}
        if modes.wire:
            figures[path.with_name(f"{path.stem}-wires.png")] = wires.draw(modes, source.design)
        for name, figure in figures.items():
            analyses.draw(figure, name, voice)


def document(name: str, choice: Choice, modes: Modes, lossless: list[Lossless]) -> dict[str, Any]:
    """The JSON document of one design."""
    import numpy as np

    rows, labels, verdicts = [], modes.label, modes.verdict
    frequency, growth, top, shares = modes.frequency, modes.growth_rate, modes.top_share, modes.shares
    for n, (body, dof) in enumerate(modes.home):
        row: dict[str, Any] = {
            "frequency_hz": float(frequency[n]) if np.isfinite(frequency[n]) else None,
            "dof": dof,
            "stage": body,
            "q": float(modes.q[n]) if np.isfinite(modes.q[n]) else None,
        }
        if np.isfinite(modes.dilution[n]):
            row["dilution"] = float(modes.dilution[n])
        if growth[n] > 0:
            row["growth_rate_per_s"] = float(growth[n])
        if modes.overdamped[n]:
            row["decay_rate_per_s"] = float(modes.decay_rate[n])
        share = {"label": labels[n], "share": float(shares[n].max()), "top_mass_share": float(top[n]), "verdict": verdicts[n]}
        rows.append(row | share)
    head = {"command": "modes", "design": name, "fidelity": choice.level, "stable": modes.stable, "modes": rows}
    return head | {"estimated_error": rung.estimate(choice), "without_loss": [part.part for part in lossless]}


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
    verdict, labels, home, every, top_share, frequency = modes.verdict, modes.label, modes.home, modes.shares, modes.top_share, modes.frequency
    for group in modes.groups:
        n, shares = group[0], every[group[0]]
        leading = [i for i in np.argsort(-shares.round(9), kind="stable")[:3] if shares[i] > 0.02]
        where = ", ".join(f"{described(modes.place[i])} {100 * shares[i]:.0f} %" for i in leading)
        quality = _number(modes.q[n] if modes.q[n] > 0 else np.inf, 9) if lossy else ""
        quality += _number(modes.dilution[n], 8) if diluted else ""
        if modes.order[n]:
            last = group[-1]
            spread = "" if len(group) == 1 else f", {len(group)} modes to {frequency[last]:#.6g} Hz"
            lines.append(f"{n + 1:3d}  {_frequency(modes, n):>11}  {quality}{'':24}  {_family([labels[k] for k in group], *home[n], modes.order[n])}{spread}")
            continue
        top = f"{100 * top_share[n]:.1f} %, {verdict[n]}"
        decays = f", decays at {modes.decay_rate[n]:#.4g} 1/s" if modes.overdamped[n] else ""
        lines.append(f"{n + 1:3d}  {_frequency(modes, n):>11}  {quality}{top:24}  {where}{decays}")
    return "\n".join(lines)


def _family(labels: list[str], body: str, dof: str, order: int) -> str:
    """What modes of wires that lie together have in common: all of one label, or those of a body of one order."""
    return labels[0] if len(set(labels)) == 1 else f"{body} {'violin' if dof.startswith('violin') else dof} {order}"


def _number(value: float, width: int) -> str:
    return f"{value:{width}.4g}  " if value < float("inf") else f"{'-':>{width}}  "


def _frequency(modes: Modes, n: int) -> str:
    if modes.growth_rate[n] > 0:
        return "unstable"
    if modes.omega_squared[n] == 0:
        return "overdamped" if modes.overdamped[n] else "rigid"
    return f"{modes.frequency[n]:#.5g} Hz"
