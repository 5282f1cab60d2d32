"""`pendsus tradeoff`: what every rung and method costs for a design, and what it gets wrong."""

from __future__ import annotations

import os
import sys
import time
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import limits, options

if TYPE_CHECKING:
    from suspension_cli.analysis.tradeoff.result import Entry, Panel, Tradeoff
    from suspension_cli.cli.analyses import Read

NAMES = ("modes", "response", "thermal", "coupling", "equilibrium")
"""As `analysis.tradeoff.comparisons.QUANTITIES`, which is not imported just to print help."""
REPEAT = 7


@click.command("tradeoff")
@options.design
@click.option("--quantity", "quantities", multiple=True, type=click.Choice(NAMES), help="Compare for this alone (repeatable).  [default: all]")
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

    Rungs against the top one that holds; methods against 50-digit arithmetic on the same rung.  Times are the processor's, on one thread, taken in
    turns.  Writes DIR/NAME-tradeoff.h5 and .png.
    """
    for library in ("OPENBLAS", "OMP", "MKL"):  # read when numpy is imported, below
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    from suspension_cli.analysis.tradeoff import run
    from suspension_cli.cli import analyses
    from suspension_cli.cli.progress import Bar
    from suspension_cli.models.fidelity import Choice
    from suspension_cli.results import tradeoff as files

    voice = options.Voice(quiet, verbose)
    source, setting = analyses.prepared(ctx, design, overrides)
    name = source.design.design.name
    with source.faults(), Bar(enabled=not quiet) as bar:
        _demand_stable(source)
        began = time.monotonic()
        found = run.measured(
            source.design, setting["quantities"], setting["repeat"], lambda done, count: bar(done, count, done / max(time.monotonic() - began, 1e-9))
        )
    limits.implausible(source.design, voice)
    path = options.folder(out) / f"{name}-tradeoff.h5"
    with analyses.written(path, source, voice):
        files.save(path, found, analyses.provenance(source, Choice("all", "every rung that holds is compared"), sys.argv))
    if setting["plot"] or (setting["plot"] is None and not as_json):
        from suspension_cli.plots import tradeoff as picture

        analyses.draw(picture.draw(found, source.design.design.title or name), path.with_suffix(".png"), voice)
    if as_json:
        import json

        click.echo(json.dumps(document(name, found)))
    else:
        options.put(table(found))


def _demand_stable(source: Read) -> None:
    from suspension_cli.analysis import modes
    from suspension_cli.errors import Fault, InputError
    from suspension_cli.models import fidelity

    found = modes.solve(fidelity.linear_model(source.design, "string"))
    if not found.stable:
        problem = f"the equilibrium is unstable on strings: {found.label[0]} grows at {found.growth_rate[0]:.4g} 1/s"
        raise InputError([Fault("stage", problem, "make it stable (raise d, say): only then are there responses to compare")])


def document(name: str, found: Tradeoff) -> dict[str, Any]:
    """The JSON document."""
    head = {"command": "tradeoff", "design": name, "repeat": found.repeat, "threads": found.threads}
    return head | {"comparisons": [_comparison(panel) for panel in found.panels]}


def _comparison(panel: Panel) -> dict[str, Any]:
    fronts = [{"title": view.title, **{kind: [panel.entries[n].label for n in panel.front(kind, view)] for kind in ("once", "batch")}} for view in panel.views]
    return {
        "quantity": panel.quantity,
        "compares": panel.compares,
        "time": panel.start,
        "item": panel.item,
        "count": panel.count,
        "reference": panel.reference,
        "entries": [_entry(panel, entry) for entry in panel.entries],
        "left_out": [{"rung": item.rung, "method": item.method, "reason": item.reason} for item in panel.left],
        "fronts": fronts,
    }


def _entry(panel: Panel, entry: Entry) -> dict[str, Any]:
    from suspension_cli.cli import analyses

    return {
        "rung": entry.rung,
        "method": entry.method,
        "error": dict(zip(panel.component, analyses.plain(entry.error), strict=True)),
        "once_s": entry.once.tolist(),
        "batch_s": entry.batch.tolist(),
        "once_relative": entry.time("once") / panel.fastest("once"),
        "batch_relative": entry.time("batch") / panel.fastest("batch"),
        "vectorised": entry.vectorised,
    }


def table(found: Tradeoff) -> str:
    """A table for people, one part a comparison."""
    head = (
        f"median times of {found.repeat} samples{f' on {found.threads} thread' + 's' * (found.threads > 1) if found.threads else ''}, relative to the "
        "fastest, lower to upper quartile in brackets\n"
        "* no other is both faster and more accurate    o: no arrays, so a batch is done one by one    errors are relative; below 1e-12 they are rounding"
    )
    return "\n\n".join([head, *map(_table, found.panels)])


def _table(panel: Panel) -> str:
    from suspension_cli.analysis.tradeoff.result import KINDS, spell, told

    lines = [f"{panel.title}: {panel.compares}"]
    if panel.entries:
        fastest = {kind: panel.fastest(kind) for kind in KINDS}
        fronts = {kind: {n for view in panel.views for n in panel.front(kind, view)} for kind in KINDS}
        lines.append(f"  error against {panel.reference}")
        lines.append(f"  time {panel.start}: 1 is {spell(fastest['once'])}; {spell(fastest['batch'])} a {panel.item} in a batch of {panel.count}")
        rows = [["", "once", "in a batch", *panel.component]]
        for n, entry in enumerate(panel.entries):
            times = (_time(entry, kind, fastest[kind], n in fronts[kind]) for kind in KINDS)
            rows.append([entry.label, *times, *map(told, entry.error)])
        wide = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines += ["  " + "  ".join(f"{cell:{'<' if n < 3 else '>'}{wide[n]}}" for n, cell in enumerate(row)) for row in rows]
    reasons: dict[str, list[str]] = {}
    for item in panel.left:
        reasons.setdefault(item.reason, []).append(item.rung if panel.compares == "rungs" else item.method)
    lines += [f"  left out: {', '.join(names)}: {reason}" for reason, names in reasons.items()]
    return "\n".join(lines)


def _time(entry: Entry, kind: str, fastest: float, best: bool) -> str:
    """``1.88 (1.82 to 1.93) *``."""
    low, middle, high = (f"{value:.3g}" if value < 999.5 else f"{float(f'{value:.3g}'):,.0f}" for value in getattr(entry, kind) / fastest)
    marks = ("*" if best else "") + ("o" if kind == "batch" and not entry.vectorised else "")
    return f"{middle} ({low} to {high}) {marks}"
