"""`pendsus damp`: local control."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import options

if TYPE_CHECKING:
    from suspension_cli.analysis.damp import Damped
    from suspension_cli.models.fidelity import Choice


@click.command("damp")
@options.design
@click.option("--output", metavar="SIGNAL", help="The motion that is watched.  [default: x of the last stage]")
@click.option("--impulse", metavar="SIGNAL", help="What gets a unit impulse (1 N s).  [default: the force on what is watched]")
@click.option("--duration", type=click.FloatRange(1e-3, 1e6), default=60.0, show_default=True, help="Of the impulse response, s.")
@click.option("--frequency", default="0.1:100:2000", show_default=True, metavar="GRID", help="For gains and noise, Hz.")
@options.allow_unstable
@options.tolerance
@options.analysis
@click.pass_context
def command(ctx: click.Context, design: str, overrides: tuple[str, ...], out: str, as_json: bool, quiet: bool, verbose: bool, **_: Any) -> None:
    """Close the loops of the design's [control] table.

    Prints poles with their Q, gain and phase margins, the impulse response and the sensor noise at the test mass.
    A closed loop that is unstable is reported first, with its growth rate; it has no margins.
    Writes DIR/NAME-damp.h5 and .png.
    """
    import numpy as np

    from suspension_cli.analysis import damp
    from suspension_cli.analysis.signals import FORCES
    from suspension_cli.cli import analyses, rung
    from suspension_cli.conventions import DOFS
    from suspension_cli.grids import grid
    from suspension_cli.results import damp as files

    voice = options.Voice(quiet, verbose)
    source, setting = analyses.prepared(ctx, design, overrides)
    with source.faults():
        decision = rung.constant(source, setting["fidelity"], setting["tolerance"])
        choice = decision.choice
        model = rung.stood(source, choice, setting["allow_unstable"], voice, decision.model, bends=True)
        output = setting["output"] or f"{model.body[-1]}.x"
        body, dof = output.partition("@")[0].rpartition(".")[::2]
        push: str = setting["impulse"] or (f"{body}.{FORCES[DOFS.index(dof)]}" if dof in DOFS and body in model.body else "support.x")
        frequency = np.array(grid(setting["frequency"], "--frequency", "log", lowest=0.0))
        answer = damp.solve(source.design, model, output, push, frequency, setting["duration"])
    path = options.folder(out) / f"{source.design.design.name}-damp.h5"
    with analyses.written(path, source, voice):
        files.save(path, answer, analyses.provenance(source, choice, sys.argv))
    if not answer.stable:
        voice.warn(f"the closed loop is unstable: {growth(answer)}")
    if setting["plot"] or (setting["plot"] is None and not as_json):
        from suspension_cli.plots import damp as picture

        analyses.draw(picture.draw(answer, source.design.design.title or source.design.design.name), path.with_suffix(".png"), voice)
    if as_json:
        import json

        click.echo(json.dumps(document(source.design.design.name, choice, answer)))
    else:
        options.put(table(choice, answer))


def document(name: str, choice: Choice, answer: Damped) -> dict[str, Any]:
    """The JSON document."""
    from suspension_cli.cli import rung

    closed = answer.closed
    poles = []
    for f, q, growth, p, state in zip(closed.frequency, closed.q, closed.growth_rate, closed.value, closed.state, strict=True):
        pole = {"frequency_hz": float(f), "q": None if growth else _finite(q), "real_per_s": float(p.real), "imag_per_s": float(p.imag), "state": state}
        poles.append(pole | ({"growth_rate_per_s": float(growth)} if growth else {}))
    margins = None
    if answer.margin is not None:
        pairs = zip(answer.loop, answer.margin, strict=True)
        margins = [{"loop": loop} | {key: _finite(value) for key, value in vars(margin).items()} for loop, margin in pairs]
    head = {"command": "damp", "design": name, "fidelity": choice.level, "stable": answer.stable, "output": answer.output, "impulse": answer.drive}
    noise = (answer.noise**2).sum(1) ** 0.5
    head |= {"poles": poles, "margins": margins, "frequency_hz": answer.frequency.tolist(), "sensor_noise_asd": noise.tolist()}
    return head | {"estimated_error": rung.estimate(choice)}


def _finite(value: float) -> float | None:
    """JSON knows no infinity: None stands for 'without limit'."""
    return float(value) if abs(value) < float("inf") else None


def growth(answer: Damped) -> str:
    """The pole that grows fastest, and what to do about it."""
    closed = answer.closed
    worst = int(closed.growth_rate.argmax())
    others = int((closed.growth_rate > 0).sum()) - 1
    more = f" (and {others} more)" if others else ""
    where = f"a pole at {closed.frequency[worst]:.5g} Hz in {closed.state[worst]} grows at {closed.growth_rate[worst]:.4g} 1/s"
    return f"{where}{more}; lower the gain of the loops that drive it, or their phase lag there"


def table(choice: Choice, answer: Damped) -> str:
    """Poles and margins for people."""
    lines = [] if answer.stable else [f"UNSTABLE: {growth(answer)}", ""]
    lines += [f"{choice.level}: {choice.reason}", "", "  closed-loop pole       Q  lives in"]
    closed = answer.closed
    for frequency, q, rate, state in zip(closed.frequency, closed.q, closed.growth_rate, closed.state, strict=True):
        size = "grows" if rate else "undamped" if q == float("inf") else f"{q:.4g}"
        lines.append(f"  {frequency:#11.5g} Hz  {size:>8}  {state}" + (f", {rate:.4g} 1/s" if rate else ""))
    if answer.margin is None:
        return "\n".join([*lines, "", "  An unstable loop has no margins."])
    lines += ["", "  loop           phase margin             gain margin          nearest to -1"]
    for loop, m in zip(answer.loop, answer.margin, strict=True):
        phase = f"{m.phase:.0f} degrees at {m.phase_frequency:.3g} Hz" if m.phase < float("inf") else "gain below 1"
        gain = " and ".join(part for part in (f"x {m.gain_up:.3g}" if m.gain_up < float("inf") else "", f"x {m.gain_down:.3g}" if m.gain_down else "") if part)
        lines.append(f"  {loop:12}  {phase:24} {gain or 'without limit':20} {m.distance:.3g}")
    return "\n".join(lines)
