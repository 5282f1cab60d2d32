"""`pendsus tradeoff`: what every rung and method costs for a design, and what it gets wrong."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import options

if TYPE_CHECKING:
    from suspension_cli.analysis.tradeoff.result import Entry, Panel, Tradeoff

NAMES = ("modes", "modes-digits", "response", "response-digits", "thermal", "coupling", "equilibrium")
"""As `analysis.tradeoff.registry.QUANTITIES`, which is not imported just to print help."""
REPEAT = 7


@click.command("tradeoff")
@options.design
@click.option("--quantity", "quantities", multiple=True, type=click.Choice(NAMES), help="Compare this alone (repeatable).  [default: all]")
@click.option("--repeat", type=click.IntRange(2, 1000), default=REPEAT, show_default=True, metavar="N", help="Samples of every time.")
@options.overrides
@options.out
@options.as_json
@options.plot
@options.quiet
@options.verbose
@click.pass_context
def command(ctx: click.Context, design: str, overrides: tuple[str, ...], out: str, as_json: bool, quiet: bool, verbose: bool, **_: Any) -> None:
    """Speed against accuracy of every rung and every method, for one design.

    Times are the processor's, taken in turns; errors are against the top rung that holds, or 50-digit arithmetic.  Writes DIR/NAME-tradeoff.h5 and
    .png.
    """
    from suspension_cli.analysis.tradeoff import run
    from suspension_cli.cli import analyses
    from suspension_cli.models.fidelity import Choice
    from suspension_cli.results import tradeoff as files

    voice = options.Voice(quiet, verbose)
    source, setting = analyses.prepared(ctx, design, overrides)
    name = source.design.design.name
    with source.faults():
        analyses.modelled(source, "auto", False, voice)  # refuses what has no stable equilibrium
        found = run.measured(source.design, setting["quantities"], setting["repeat"], voice.detail)
    path = options.folder(out) / f"{name}-tradeoff.h5"
    files.save(path, found, analyses.provenance(source, Choice("all", "every rung that holds is compared"), sys.argv))
    voice.say(f"wrote {path}")
    if setting["plot"] or (setting["plot"] is None and not as_json):
        from suspension_cli.plots import tradeoff as picture

        analyses.draw(picture.draw(found, source.design.design.title or name), path.with_suffix(".png"), voice)
    if as_json:
        import json

        click.echo(json.dumps(document(name, found)))
    else:
        click.echo(table(found))


def document(name: str, found: Tradeoff) -> dict[str, Any]:
    """The JSON document."""
    return {"command": "tradeoff", "design": name, "repeat": found.repeat, "quantities": [_quantity(panel) for panel in found.panels]}


def _quantity(panel: Panel) -> dict[str, Any]:
    fronts = [{"title": view.title, **{kind: [panel.entries[n].label for n in panel.front(kind, view)] for kind in ("once", "batch")}} for view in panel.views]
    return {
        "quantity": panel.quantity,
        "time": panel.start,
        "item": panel.item,
        "count": panel.count,
        "reference": panel.reference,
        "entries": [_entry(panel, entry) for entry in panel.entries],
        "left_out": [{"rung": item.rung, "method": item.method, "reason": item.reason} for item in panel.left],
        "fronts": fronts,
    }


def _entry(panel: Panel, entry: Entry) -> dict[str, Any]:
    return {
        "rung": entry.rung,
        "method": entry.method,
        "error": dict(zip(panel.component, entry.error.tolist(), strict=True)),
        "once_s": entry.once.tolist(),
        "batch_s": entry.batch.tolist(),
        "once_relative": entry.time("once") / panel.fastest("once"),
        "batch_relative": entry.time("batch") / panel.fastest("batch"),
        "vectorised": entry.vectorised,
    }


def table(found: Tradeoff) -> str:
    """A table for people, one part a quantity; ``*`` marks what no other method beats."""
    return "\n\n".join(_table(panel) for panel in found.panels)


def _table(panel: Panel) -> str:
    from suspension_cli.analysis.tradeoff.result import spell

    lines = [panel.title]
    if panel.entries:
        fastest = {kind: panel.fastest(kind) for kind in ("once", "batch")}
        lines.append(f"  time {panel.start}: 1 is {spell(fastest['once'])}, in a batch {spell(fastest['batch'])} a {panel.item}")
        lines.append(f"  error against {panel.reference}")
        fronts = {kind: {n for view in panel.views for n in panel.front(kind, view)} for kind in fastest}
        lines.append(f"  {'':30}{'once':>12}{'batch':>12}  " + "".join(f"{name:>20}" for name in panel.component))
        for n, entry in enumerate(panel.entries):
            cells = [f"{entry.time(kind) / fastest[kind]:11.4g}{'*' if n in fronts[kind] else ' '}" for kind in fastest]
            lines.append(f"  {entry.label:30}{''.join(cells)}  " + "".join(f"{error:20.1e}" for error in entry.error))
    reasons: dict[str, list[str]] = {}
    for item in panel.left:
        reasons.setdefault(item.reason, []).append(f"{item.rung}, {item.method}")
    lines += [f"  left out: {'; '.join(names)}: {reason}" for reason, names in reasons.items()]
    return "\n".join(lines)
