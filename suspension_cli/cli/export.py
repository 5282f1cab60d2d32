"""`pendsus export`: the model as state space for control tools."""

from __future__ import annotations

import dataclasses
import math
import sys
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import options

if TYPE_CHECKING:
    from suspension_cli.analysis.export import Exported
    from suspension_cli.models.fidelity import Choice

FORMATS = ("mat", "npz", "hdf5", "zpk", "control")
SUFFIX = {"mat": ".mat", "npz": ".npz", "hdf5": ".h5", "zpk": "-zpk.h5", "control": "-control.json"}


@click.command("export")
@options.design
@click.option(
    "--format", "form", type=click.Choice(FORMATS), default="mat", show_default=True, help="mat: MATLAB; zpk: zeros, poles, gain; control: python-control."
)
@click.option("--input", "inputs", multiple=True, metavar="SIGNAL", help="Repeatable.  [default: the support's six motions and six forces on the first stage]")
@click.option("--output", "outputs", multiple=True, metavar="SIGNAL", help="Repeatable.  [default: the six motions of the first and of the last stage]")
@click.option("--loss/--no-loss", default=False, show_default=True, help="Whether loss angles go in, as viscous damping of each mode.")
@options.allow_unstable
@options.overrides
@options.out
@options.fidelity
@options.tolerance
@options.as_json_only
@options.quiet
@options.verbose
@click.pass_context
def command(ctx: click.Context, design: str, overrides: tuple[str, ...], out: str, as_json: bool, quiet: bool, verbose: bool, **_: Any) -> None:
    """Write the model from inputs to outputs as DIR/NAME-statespace.*.

    States, inputs and outputs have names and units.  The band in which the export agrees with the direct solution is measured
    and stands in its metadata.
    """
    from suspension_cli.analysis import export, signals
    from suspension_cli.analysis.rational import rational
    from suspension_cli.cli import analyses, rung
    from suspension_cli.results import export as files

    voice = options.Voice(quiet, verbose)
    source, setting = analyses.prepared(ctx, design, overrides)
    with source.faults():
        decision = rung.constant(source, setting["fidelity"], setting["tolerance"])
        choice = decision.choice
        direct = rung.stood(source, choice, setting["allow_unstable"], voice, decision.model, bends=True)
        model = rational(direct)
        lossy = model.lossy is not None
        if not setting["loss"]:
            model = direct = dataclasses.replace(model, lossy=None)
        known = signals.bodies(model)
        drives, motions = signals.everything(model)
        inputs = [signals.drive(text, known) for text in setting["inputs"] or drives]
        outputs = [signals.motion(text, known) for text in setting["outputs"] or motions]
        made = export.build(model, inputs, outputs, direct, zpk=setting["form"] == "zpk")
    path = options.folder(out) / f"{source.design.design.name}-statespace{SUFFIX[setting['form']]}"
    with analyses.written(path, source, voice):
        files.save(path, setting["form"], made, analyses.provenance(source, choice, sys.argv))
    if lossy and setting["loss"]:
        voice.warn("loss angles went in as viscous damping of each mode: Q is right, isolation far above the modes is not (see the band)")
    elif lossy:
        voice.warn("loss angles were left out: isolation is right, Q is infinite (with --loss it is the other way round)")
    if as_json:
        import json

        click.echo(json.dumps(document(source.design.design.name, choice, setting["form"], str(path), made)))
    else:
        options.put(
            f"{choice.level}: {choice.reason}\n{len(made.system.state)} states, {len(made.system.input)} inputs, {len(made.system.output)} outputs; "
            f"{agreement(made)}\n(worst {made.worst:.1e}, up to 100 times the highest mode)"
        )


def agreement(made: Exported) -> str:
    """The band in which an export agrees with the direct solution, in words."""
    if made.band is None:
        return f"there is no band in which it agrees with the direct solution to {made.tolerance:g} ({made.tried[0]:.3g} to {made.tried[1]:.4g} Hz tried)"
    return f"agrees with the direct solution to {made.tolerance:g} from {made.band[0]:.3g} to {made.band[1]:.4g} Hz"


def document(name: str, choice: Choice, form: str, path: str, made: Exported) -> dict[str, Any]:
    """The JSON document."""
    from suspension_cli.cli import rung

    system = made.system
    head = {"command": "export", "design": name, "fidelity": choice.level, "format": form, "file": path}
    return head | {
        "state": list(system.state),
        "input": list(system.input),
        "output": list(system.output),
        "band_hz": list(made.band) if made.band else None,
        "tolerance": made.tolerance,
        "worst_error": made.worst if math.isfinite(made.worst) else None,
        "estimated_error": rung.estimate(choice),
    }
