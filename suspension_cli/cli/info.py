"""`pendsus info`: how much model a design needs, and why."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.cli import analyses, options

if TYPE_CHECKING:
    from suspension_cli.analysis.auto import Decision
    from suspension_cli.models.fidelity import Choice
    from suspension_cli.models.indicators import Indicator


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
    """How much model a design needs: indicators of what each refinement would change, and the rung that `auto` takes.

    For the modes, for one response and for its thermal noise.  Writes nothing.
    """
    source, setting = analyses.prepared(ctx, design, overrides)
    with source.faults():
        found, decisions, noise = _weighed(source, setting)
    name = source.design.design.name
    if as_json:
        import json

        click.echo(json.dumps(document(name, setting["tolerance"], found, decisions, noise)))
    else:
        click.echo(text(source.design.design.title or name, setting["tolerance"], found, decisions, noise))


def _weighed(source: analyses.Read, setting: dict[str, Any]) -> tuple[list[Indicator], dict[str, Decision], tuple[str, Choice] | None]:
    import numpy as np

    from suspension_cli.analysis import auto, signals
    from suspension_cli.design.fibres import unsuited
    from suspension_cli.grids import grid
    from suspension_cli.models import indicators, wire_mass

    design, tolerance = source.design, setting["tolerance"]
    frequency = np.array(grid(setting["frequency"], "--frequency", "log", lowest=0.0))
    output = setting["output"] or f"{design.stage[-1].name}.x"

    def transfer(model: Any) -> auto.Transfer:
        known = signals.bodies(model)
        return auto.Transfer([signals.drive(setting["drive"], known)], [signals.motion(output, known)], frequency)

    span = f"{frequency.min():g} to {frequency.max():g} Hz"
    decisions = {
        "frequencies of the modes": auto.decide(design, lambda _: auto.Frequencies(), tolerance),
        f"{output} / {setting['drive']}, {span}": auto.decide(design, transfer, tolerance),
    }
    noise = None
    if not unsuited(design, massive=True):
        noise = (f"thermal noise of {output}, {span}", wire_mass.choose(design, "auto", float(frequency.max()), tolerance))
    return indicators.indicators(design, float(frequency.max())), decisions, noise


def document(name: str, tolerance: float, found: list[Indicator], decisions: dict[str, Decision], noise: tuple[str, Choice] | None) -> dict[str, Any]:
    """The JSON document."""
    choices = [
        {
            "quantity": quantity,
            "fidelity": decision.choice.level,
            "estimated_error": analyses.estimate(decision.choice),
            "reason": decision.choice.reason,
            "refinements": [
                {"name": item.name, "indicator": _finite(item.indicator), "stage": item.stage, "change": item.change, "taken": item.taken}
                for item in decision.refinements
            ],
        }
        for quantity, decision in decisions.items()
    ]
    if noise is not None:
        quantity, choice = noise
        choices.append(
            {"quantity": quantity, "fidelity": choice.level, "estimated_error": analyses.estimate(choice), "reason": choice.reason, "refinements": []}
        )
    indicators = [{"stage": item.stage, "refinement": item.refinement, "value": _finite(item.value)} for item in found]
    return {"command": "info", "design": name, "tolerance": tolerance, "indicators": indicators, "choices": choices}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def text(title: str, tolerance: float, found: list[Indicator], decisions: dict[str, Decision], noise: tuple[str, Choice] | None) -> str:
    """The same for people: a table of indicators a stage, then the choices."""
    names = list(dict.fromkeys(item.refinement for item in found))
    stages = list(dict.fromkeys(item.stage for item in found))
    width = max([len(stage) for stage in stages] + [6])
    lines = [title, "", "About how much each refinement would change, relative:", f"  {'':{width}}  " + "  ".join(names)]
    for stage in stages:
        values = {item.refinement: item.value for item in found if item.stage == stage}
        cells = [f"{_shown(values.get(name)):>{len(name)}}" for name in names]
        lines.append(f"  {stage:{width}}  " + "  ".join(cells))
    lines += ["", f"Rungs that auto takes, for a tolerance of {tolerance:g}:"]
    for quantity, decision in decisions.items():
        lines.append(f"  {quantity}\n    {decision.choice.level}: {decision.choice.reason}")
    if noise is not None:
        lines.append(f"  {noise[0]}\n    {noise[1].level}: {noise[1].reason}")
    return "\n".join(lines)


def _shown(value: float | None) -> str:
    if value is None:
        return "-"
    return "unknown" if math.isnan(value) else f"{value:.1e}"
