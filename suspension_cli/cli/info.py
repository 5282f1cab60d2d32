"""`pendsus info`: how much model a design needs, and why."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import analyses, limits, options, rung

if TYPE_CHECKING:
    from suspension_cli.analysis.auto import Decision
    from suspension_cli.analysis.estimates import Estimates
    from suspension_cli.analysis.modes import Modes
    from suspension_cli.models.fidelity import Choice


@click.command("info")
@options.design
@options.overrides
@click.option("--input", "drive", default="support.x", show_default=True, metavar="SIGNAL", help="What drives the response that is asked about.")
@click.option("--output", "output", metavar="SIGNAL", help="Its output, and that of the thermal noise.  [default: x of the last stage]")
@click.option("--frequency", default="0.1:100:2000", show_default=True, metavar="GRID", help="Their frequencies, Hz.")
@options.tolerance
@options.as_json_only
@click.pass_context
def command(ctx: click.Context, design: str, overrides: tuple[str, ...], as_json: bool, **_: Any) -> None:
    """How much model a design needs: estimates of what each refinement would change, and the rung that `auto` takes.

    For the modes, for one response and for its thermal noise.  Writes nothing.
    """
    source, setting = analyses.prepared(ctx, design, overrides)
    with source.faults():
        found, simplest, decisions, noise = _weighed(source, setting)
    limits.implausible(source.design, options.Voice(quiet=False, verbose=False))
    name = source.design.design.name
    if as_json:
        import json

        click.echo(json.dumps(document(name, setting["tolerance"], found, decisions, noise)))
    else:
        options.put(text(source.design.design.title or name, setting["tolerance"], found, simplest, decisions, noise))


def _weighed(source: analyses.Read, setting: dict[str, Any]) -> tuple[Estimates, Modes, dict[str, Decision], tuple[str, Choice] | None]:
    import numpy as np

    from suspension_cli.analysis import auto, modes, signals
    from suspension_cli.analysis.asked import Frequencies, Transfer
    from suspension_cli.analysis.estimates import estimates
    from suspension_cli.design.fibres import unsuited
    from suspension_cli.grids import grid
    from suspension_cli.models import fidelity, wire_mass

    design, tolerance = source.design, setting["tolerance"]
    frequency = np.array(grid(setting["frequency"], "--frequency", "log", lowest=0.0))
    output = setting["output"] or f"{design.stage[-1].name}.x"

    def transfer(model: Any) -> Transfer:
        known = signals.bodies(model)
        return Transfer([signals.drive(setting["drive"], known)], [signals.motion(output, known)], frequency)

    span = f"{frequency.min():g} to {frequency.max():g} Hz"
    decisions = {
        "frequencies of the modes": auto.decide(design, lambda _: Frequencies(), tolerance),
        f"{output} / {setting['drive']}, {span}": auto.decide(design, transfer, tolerance),
    }
    noise = None
    if not unsuited(design, massive=True):
        noise = (f"thermal noise of {output}, {span}", wire_mass.choose(design, "auto", float(frequency.max()), tolerance))
    simplest = modes.solve(fidelity.linear_model(design, fidelity.choose(design).level))
    return estimates(design, simplest), simplest, decisions, noise


def document(name: str, tolerance: float, found: Estimates, decisions: dict[str, Decision], noise: tuple[str, Choice] | None) -> dict[str, Any]:
    """The JSON document."""
    choices = [
        {
            "quantity": quantity,
            "fidelity": decision.choice.level,
            "estimated_error": rung.estimate(decision.choice),
            "reason": decision.choice.reason,
            "refinements": [
                {
                    "name": item.name,
                    "indicator": _finite(item.indicator),
                    "stage": item.stage,
                    "change": None if item.change is None else _finite(item.change),
                    "taken": item.taken,
                }
                for item in decision.refinements
            ],
        }
        for quantity, decision in decisions.items()
    ]
    if noise is not None:
        quantity, choice = noise
        choices.append({"quantity": quantity, "fidelity": choice.level, "estimated_error": rung.estimate(choice), "reason": choice.reason, "refinements": []})
    indicators = [
        {"stage": stage, "refinement": name, "value": _finite(float(values[n]))}
        for n, stage in enumerate(found.stage)
        for name, values in _largest(found).items()
    ]
    return {"command": "info", "design": name, "tolerance": tolerance, "indicators": indicators, "choices": choices}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def text(title: str, tolerance: float, found: Estimates, simplest: Modes, decisions: dict[str, Decision], noise: tuple[str, Choice] | None) -> str:
    """The same for people: a table of indicators a stage, then the choices."""
    columns = _largest(found)
    width = max([len(stage) for stage in found.stage] + [6])
    lines = [title, ""]
    if found.stage:
        lines.append("About how much each refinement of a stage's wires would change the frequency that it changes most, relative:")
        lines.append(f"  {'':{width}}  " + "  ".join(columns) + "  first violin mode")
    else:
        lines.append("No stage hangs on wires.")
    for n, stage in enumerate(found.stage):
        cells = [f"{_shown(float(values[n])):>{len(name)}}" for name, values in columns.items()]
        lines.append(f"  {stage:{width}}  " + "  ".join(cells) + f"  {_hertz(float(found.violin[n])):>17}")
    if any(math.isinf(float(value)) for values in columns.values() for value in values):
        lines.append(f"  without bound: {_why(simplest)}")
    lines += ["", f"Rungs that auto takes, for a tolerance of {tolerance:g}:"]
    for quantity, decision in decisions.items():
        lines.append(f"  {quantity}\n    {decision.choice.level}: {decision.choice.reason}")
    if noise is not None:
        lines.append(f"  {noise[0]}\n    {noise[1].level}: {noise[1].reason}")
    return "\n".join(lines)


def _largest(found: Estimates) -> dict[str, Any]:
    """What each refinement of each stage's wires changes of the mode that it changes most: (s,) each."""
    from suspension_cli.analysis.estimates import BENDING, MASS

    return {BENDING: found.bending.max(0), MASS: found.mass.max(0)}


def _shown(value: float) -> str:
    return "unknown" if math.isnan(value) else "without bound" if math.isinf(value) else f"{value:.1e}"


def _why(simplest: Modes) -> str:
    """Why an indicator is infinite."""
    from suspension_cli.analysis import auto

    return auto.unheld(simplest, unstable=False) or "a mode lies near or above the first violin mode of these wires"


def _hertz(value: float) -> str:
    return "unknown" if math.isnan(value) else "none" if math.isinf(value) else f"{value:.4g} Hz"
