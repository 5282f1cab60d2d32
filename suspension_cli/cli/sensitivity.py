"""`pendsus sensitivity`: what a small change of each number of a design does."""

from __future__ import annotations

import dataclasses
import sys
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import options

if TYPE_CHECKING:
    from suspension_cli.analysis.sensitivity import Sensitivity
    from suspension_cli.models.fidelity import Choice

ACROSS = 8
"""Columns of one table."""
LEAST = 0.0005
"""Change in % below which a row is left out of a table."""


@click.command("sensitivity")
@options.design
@options.results
@options.allow_unstable
@options.analysis
@click.pass_context
def command(ctx: click.Context, design: str, overrides: tuple[str, ...], out: str, as_json: bool, quiet: bool, verbose: bool, **_: Any) -> None:
    """What 1 % of every number of a design moves its modes, responses and couplings by.

    First derivatives, the change of the equilibrium included.  Writes DIR/NAME-sensitivity.h5 and .png.
    """
    from suspension_cli.analysis import modes, scalars, sensitivity, signals
    from suspension_cli.cli import analyses, rung
    from suspension_cli.results import sensitivity as files

    voice = options.Voice(quiet, verbose)
    source, setting = analyses.prepared(ctx, design, overrides)
    with source.faults():
        decision = rung.differentiable(setting["fidelity"], source, rung.several(setting["result"]))
        choice = decision.choice
        model = rung.stood(source, choice, setting["allow_unstable"], voice, decision.model, bends=True)
        asked = scalars.parse(list(setting["result"]) or [scalars.ALL], modes.solve(dataclasses.replace(model, terms=())), signals.bodies(model))
        found = sensitivity.solve(source.text, asked, choice.level)
    rung.tell(source, decision, voice, tuple(rung.DIFFERENTIABLE))
    path = options.folder(out) / f"{source.design.design.name}-sensitivity.h5"
    with analyses.written(path, source, voice):
        files.save(path, found, analyses.provenance(source, choice, sys.argv))
    fixed = [name for name, free in zip(found.parameter, found.free, strict=True) if not free]
    if fixed:
        voice.say(f"cannot change alone, as the suspension would not balance as it is drawn: {', '.join(fixed)}")
    if setting["plot"] or (setting["plot"] is None and not as_json):
        from suspension_cli.plots import sensitivity as picture

        analyses.draw(picture.draw(found, source.design.design.title or source.design.design.name, choice.level), path.with_suffix(".png"), voice)
    if as_json:
        import json

        click.echo(json.dumps(document(source.design.design.name, choice, found)))
    else:
        options.put("\n".join([f"{choice.level}: {choice.reason}", *table(found)]))


def document(name: str, choice: Choice, found: Sensitivity) -> dict[str, Any]:
    """The JSON document: parameters first; null where there is no derivative."""
    from suspension_cli.cli import rung
    from suspension_cli.cli.analyses import plain

    numbers = [{"name": n, "value": float(v), "free": bool(f)} for n, v, f in zip(found.parameter, found.value, found.free, strict=True)]
    results = [{"name": n, "unit": u, "nominal": plain(v)} for n, u, v in zip(found.result, found.unit, found.nominal, strict=True)]
    head = {"command": "sensitivity", "design": name, "fidelity": choice.level}
    return head | {
        "parameters": numbers,
        "results": results,
        "derivative": plain(found.derivative),
        "one_percent": plain(found.one_percent),
        "estimated_error": rung.estimate(choice),
    }


def table(found: Sensitivity) -> list[str]:
    """What 1 % of this moves that by, so many columns at once."""
    import numpy as np

    change = found.one_percent
    wide = max((len(name) for name in found.parameter), default=0)
    lines = ["", "1 % of a number moves a result by so many % (by so much, where the result is 0):"]
    for start in range(0, len(found.result), ACROSS):
        here = range(start, min(start + ACROSS, len(found.result)))
        lines += ["", *(f"  [{n + 1}] {found.result[n]}  {found.nominal[n]:#.5g} {found.unit[n] if found.unit[n] != '1' else ''}".rstrip() for n in here)]
        lines.append(" " * (wide + 11) + "".join(f"{f'[{n + 1}]':>9}" for n in here))
        for name, value, row in zip(found.parameter, found.value, change, strict=True):
            cells = [_cell(row[n], found.nominal[n] == 0) for n in here]
            if any(np.isfinite(row[n]) and (abs(row[n]) >= LEAST or (found.nominal[n] == 0 and row[n] != 0)) for n in here):
                lines.append(f"{name:{wide}} {value:10.4g}" + "".join(f"{cell:>9}" for cell in cells))
    return lines


def _cell(value: float, absolute: bool) -> str:
    if value != value:
        return "-"
    if absolute:
        return f"{value:.1e}" if value else "0"
    return f"{value:+.3f}" if abs(value) >= LEAST else "0"
