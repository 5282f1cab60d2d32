"""`pendsus thermal`: thermal noise, split by what dissipates."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import analyses, limits, options, rung

if TYPE_CHECKING:
    from suspension_cli.analysis.thermal import Thermal
    from suspension_cli.models.fidelity import Choice

DEFAULT_GRID = "0.1:1000:2000"
LEADING = 0.01
"""Share of the power from which a source is named in the summary."""
NAMED = 3
"""Sources named at each frequency, at most."""


@click.command("thermal")
@options.design
@click.option(
    "--output", "outputs", multiple=True, metavar="SIGNAL", help="test.x, test.pitch, test.x@0,0,0.001, ... (repeatable).  [default: x of the last stage]"
)
@click.option("--frequency", default=DEFAULT_GRID, show_default=True, metavar="GRID", help="start:stop:count[:log|lin], a comma list or a number; Hz.")
@click.option("--arm", type=click.FloatRange(0, 1e7), default=0.0, metavar="LENGTH", help="Watch x along the beam of an arm this long (m), e.g. 4000.")
@options.allow_unstable
@options.tolerance
@options.analysis
@click.pass_context
def command(ctx: click.Context, design: str, overrides: tuple[str, ...], out: str, as_json: bool, quiet: bool, verbose: bool, **_: Any) -> None:
    """Thermal noise of motions, split by what dissipates.

    The beam of a long arm is not level where it meets the mirrors, so it sees a little of their vertical motion: --arm.
    Writes DIR/NAME-thermal.h5 and .png.
    """
    from suspension_cli.design.lossless import without_loss
    from suspension_cli.results import thermal as files

    voice = options.Voice(quiet, verbose)
    source, setting = analyses.prepared(ctx, design, overrides)
    with source.faults():
        choice, noises = _solved(source, setting, voice)
    name = source.design.design.name
    lossless = without_loss(source.design, choice.level)
    for line in limits.lossless(lossless, choice.level):
        voice.warn(f"{name}: {line}")
    path = options.folder(out) / f"{name}-thermal.h5"
    with analyses.written(path, source, voice):
        files.save(path, noises, analyses.provenance(source, choice, sys.argv))
    if setting["plot"] or (setting["plot"] is None and not as_json):
        from suspension_cli.plots import thermal as picture

        analyses.draw(picture.draw(noises, source.design.design.title or name), path.with_suffix(".png"), voice)
    if as_json:
        import json

        click.echo(json.dumps(document(name, choice, noises, [part.part for part in lossless])))
    else:
        options.put(summary(choice, noises))


def _solved(source: Any, setting: dict[str, Any], voice: options.Voice) -> tuple[Choice, list[Thermal]]:
    from dataclasses import replace

    import numpy as np

    from suspension_cli.analysis import thermal
    from suspension_cli.errors import Fault, InputError, shown
    from suspension_cli.grids import grid
    from suspension_cli.models import wire_mass

    frequency = np.array(grid(setting["frequency"], "--frequency", "log", lowest=0.0))
    choice = wire_mass.choose(source.design, setting["fidelity"], float(frequency.max()), setting["tolerance"])
    model = rung.stood(source, choice, setting["allow_unstable"], voice)
    if not setting["arm"] >= 0:
        raise InputError([Fault("--arm", "must be a length", "give it in m, e.g. 4000", shown(setting["arm"]))])
    tilt = thermal.arm_tilt(setting["arm"])
    noises = []
    for text in setting["outputs"] or (f"{model.body[-1]}.x",):
        signal, row = thermal.observed(model, text, tilt)
        _demand_observable(signal, tilt)
        noise = thermal.solve(model, frequency, row, signal, source.design.constants.temperature)
        _demand_loss(noise)
        noises.append(replace(noise, tilt=tilt))
    return choice, noises


def _demand_observable(signal: Any, tilt: float) -> None:
    from suspension_cli.conventions import DOFS, SUPPORT
    from suspension_cli.errors import Fault, InputError, shown

    if signal.body == SUPPORT:
        raise InputError([Fault("--output", "the support is at rest and has no thermal noise", "name a stage, for example test.x", shown(signal.text))])
    if tilt and DOFS[signal.dof] != "x":
        raise InputError([Fault("--arm", f"is for motion along x, not {signal.text}", "leave it out, or give outputs along x")])


def _demand_loss(noise: Thermal) -> None:
    from suspension_cli.errors import Fault, InputError, shown

    if not noise.source:
        remedy = "give the materials of its wires a loss (--set materials.NAME.loss_angle=1e-4), or blades a loss_angle, [gas] or [stage.damping]"
        raise InputError([Fault("--output", "nothing that moves with it dissipates, so it has no thermal noise", remedy, shown(noise.output))])


def document(name: str, choice: Choice, noises: list[Thermal], lossless: list[str]) -> dict[str, Any]:
    """The JSON document: the noise of one motion flat, that of several in a list; `lossless` names the parts without loss."""
    each = [
        {
            "output": noise.output,
            "unit": f"{noise.unit}/sqrt(Hz)",
            "tilt_rad": noise.tilt,
            "displacement_asd": noise.amplitude.tolist(),
            "contributions": {source: part.tolist() for source, part in noise.parts.items()},
        }
        for noise in noises
    ]
    head = {"command": "thermal", "design": name, "fidelity": choice.level, "frequency_hz": noises[0].frequency.tolist()}
    return head | (each[0] if len(each) == 1 else {"noises": each}) | {"estimated_error": rung.estimate(choice), "without_loss": lossless}


def summary(choice: Choice, noises: list[Thermal]) -> str:
    """A few lines for people: the noise at a few frequencies, and where it comes from there."""
    lines = [f"{choice.level}: {choice.reason}"]
    for noise in noises:
        along = f" along a beam that rises by {1e6 * noise.tilt:.3g} urad" if noise.tilt else ""
        lines.append(f"{noise.output}{along}: thermal noise in {noise.unit}/sqrt(Hz), and the shares of its power")
        for n in told(noise.frequency):
            power = noise.density[:, n]
            order = sorted(range(len(power)), key=lambda s: -power[s])[:NAMED]
            shares = (f"{noise.source[s]} {_percent(power[s] / power.sum())}" for s in order if power[s] >= LEADING * power.sum())
            lines.append(f"{noise.frequency[n]:>10.4g} Hz  {noise.amplitude[n]:.3e}  {', '.join(shares)}")
    return "\n".join(lines)


def _percent(share: float) -> str:
    return f"{100 * share:.{0 if share >= 0.1 else 1}f} %"


def told(frequency: Any) -> list[int]:
    """Places in a grid nearest to 1 Hz, 10 Hz and so on, within it; its ends if there are none."""
    import math

    import numpy as np

    low, high = float(frequency.min()), float(frequency.max())
    decades = [10.0**n for n in range(math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9) + 1)]
    targets = decades or [low, high]
    return list(dict.fromkeys(int(np.abs(np.log(frequency / at)).argmin()) for at in targets))
