"""`pendsus response`: transfer functions, solved frequency by frequency."""

from __future__ import annotations

import sys
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import analyses, options, rung

if TYPE_CHECKING:
    from suspension_cli.analysis.asked import Transfer
    from suspension_cli.analysis.peaks import Largest
    from suspension_cli.analysis.response import Response
    from suspension_cli.mechanics.model import LinearModel
    from suspension_cli.models.fidelity import Choice

DEFAULT_GRID = "0.1:100:2000"


@click.command("response")
@options.design
@click.option(
    "--input", "inputs", multiple=True, metavar="SIGNAL", help="support.x, upper.force_x, upper.torque_pitch, ... (repeatable).  [default: support.x]"
)
@click.option(
    "--output", "outputs", multiple=True, metavar="SIGNAL", help="test.x, test.pitch, test.x@0,0,0.001, ... (repeatable).  [default: x of the last stage]"
)
@click.option("--frequency", default=DEFAULT_GRID, show_default=True, metavar="GRID", help="start:stop:count[:log|lin], a comma list or a number; Hz.")
@click.option("--scale", type=click.Choice(["db", "absolute"]), default="db", show_default=True, help="Magnitude axis of the plot.")
@options.allow_unstable
@options.tolerance
@options.analysis
@click.pass_context
def command(ctx: click.Context, design: str, overrides: tuple[str, ...], out: str, as_json: bool, quiet: bool, verbose: bool, **_: Any) -> None:
    """Frequency responses of motions to motions of the support and to forces.

    Several inputs and outputs give a matrix.  Writes DIR/NAME-response.h5 and .png.
    """
    from suspension_cli.analysis import peaks, response
    from suspension_cli.results import response as files

    voice = options.Voice(quiet, verbose)
    source, setting = analyses.prepared(ctx, design, overrides)
    with source.faults():
        asker = partial(_asked, setting=setting)
        decision = rung.weighed(source, setting["fidelity"], asker, setting["tolerance"])
        choice = decision.choice
        model = rung.stood(source, choice, setting["allow_unstable"], voice, decision.model, bends=True)
        asked = _asked(model, setting)
        answer = response.solve(model, asked.frequency, asked.inputs, asked.outputs)
    path = options.folder(out) / f"{source.design.design.name}-response.h5"
    origin = analyses.provenance(source, choice, sys.argv)
    with analyses.written(path, source, voice):
        files.save(path, answer, origin)
    if setting["plot"] or (setting["plot"] is None and not as_json):
        from suspension_cli.plots import response as picture

        analyses.draw(picture.draw(answer, source.design.design.title or source.design.design.name, setting["scale"]), path.with_suffix(".png"), voice)
    if as_json:
        import json

        click.echo(json.dumps(document(source.design.design.name, choice, answer)))
    else:
        options.put(summary(answer, choice, peaks.largest(model, answer, asked.inputs, asked.outputs)))


def _asked(model: LinearModel, setting: dict[str, Any]) -> Transfer:
    """What is asked for, in terms of any model of the design."""
    import numpy as np

    from suspension_cli.analysis import signals
    from suspension_cli.analysis.asked import Transfer
    from suspension_cli.grids import grid

    bodies = (*signals.bodies(model),)
    inputs = [signals.drive(text, bodies) for text in setting["inputs"] or ("support.x",)]
    outputs = [signals.motion(text, bodies) for text in setting["outputs"] or (f"{model.body[-1]}.x",)]
    return Transfer(inputs, outputs, np.array(grid(setting["frequency"], "--frequency", "log", lowest=0.0)))


def document(name: str, choice: Choice, answer: Response) -> dict[str, Any]:
    """The JSON document: one response flat, several in a list."""
    pairs = [
        {"input": into, "output": out, "unit": answer.unit[o][i], "real": answer.value[:, o, i].real.tolist(), "imag": answer.value[:, o, i].imag.tolist()}
        for o, out in enumerate(answer.output)
        for i, into in enumerate(answer.input)
    ]
    head = {"command": "response", "design": name, "fidelity": choice.level, "frequency_hz": answer.frequency.tolist()}
    return head | (pairs[0] if len(pairs) == 1 else {"responses": pairs}) | {"estimated_error": rung.estimate(choice)}


def summary(answer: Response, choice: Any, largest: Largest) -> str:
    """A few lines for people: the ends of every response and its peak, which may lie between the points of the grid."""
    import numpy as np

    lines = [f"{choice.level}: {choice.reason}"]
    first, last = answer.frequency[0], answer.frequency[-1]
    for o, out in enumerate(answer.output):
        for i, into in enumerate(answer.input):
            size = np.abs(answer.value[:, o, i])
            top = f"{largest.size[o, i]:.4g}" if np.isfinite(largest.size[o, i]) else "infinite (nothing dissipates there)"
            lines.append(
                f"{out} / {into} ({answer.unit[o][i]}): {size[0]:.4g} at {first:.4g} Hz, {size[-1]:.4g} at {last:.4g} Hz, "
                f"largest {top} at {largest.frequency[o, i]:.6g} Hz"
            )
    return "\n".join(lines)
