"""`pendsus info`: how complete a model a design needs, and why."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import click

from suspension_cli.analyses import options, settings
from suspension_cli.analyses.analysis import as_number
from suspension_cli.analyses.check import warnings
from suspension_cli.cli import terminal
from suspension_cli.cli.runner import Command

if TYPE_CHECKING:
    from suspension_cli.design.reader import Source
    from suspension_cli.linear.eigenmodes import Modes
    from suspension_cli.models.auto import Decision
    from suspension_cli.models.estimates import Estimates
    from suspension_cli.models.registry import Choice


@click.command("info", cls=Command, params=[options.DESIGN, *options.INFO])
@click.pass_context
def command(
    ctx: click.Context, design: str, overrides: tuple[str, ...], as_json: bool, **_: Any
) -> None:
    """Estimate how complete a model a design needs, and the model that `auto` takes.

    For the modes, for one response and for its thermal noise. Writes nothing.

    Example: pendsus info my.toml --output test.pitch
    """
    from suspension_cli.errors import attribute_faults_to

    source, setting = settings.prepared(ctx, design, overrides)
    with attribute_faults_to(source.file):
        found, simplest, decisions, noise = _weighed(source, setting)
    warnings.warn_implausible(source.design, terminal.Voice())
    name = source.design.design.name
    if as_json:
        import json

        click.echo(json.dumps(document(name, setting["tolerance"], found, decisions, noise)))
    else:
        terminal.put(
            text(
                source.design.design.title or name,
                setting["tolerance"],
                found,
                simplest,
                decisions,
                noise,
            )
        )


def _weighed(
    source: Source, setting: dict[str, Any]
) -> tuple[Estimates, Modes, dict[str, Decision], tuple[str, Choice] | None]:
    import numpy as np

    from suspension_cli.grids import parse_grid
    from suspension_cli.linear import eigenmodes, signals
    from suspension_cli.models import auto, registry
    from suspension_cli.models.estimates import estimates
    from suspension_cli.models.quantity_of_interest import Frequencies, Transfer
    from suspension_cli.scene.fibres import explain_unsuitable

    design, tolerance = source.design, setting["tolerance"]
    frequency = np.array(parse_grid(setting["frequency"], "--frequency", "log", lowest=0.0))
    output = setting["output"] or f"{design.stage[-1].name}.x"

    def transfer(model: Any) -> Transfer:
        known = signals.bodies_with_signals(model)
        return Transfer(
            [signals.parse_input(setting["drive"], known)],
            [signals.parse_output(output, known)],
            frequency,
        )

    span = f"{frequency.min():g} to {frequency.max():g} Hz"
    decisions = {
        "frequencies of the modes": auto.decide(design, lambda _: Frequencies(), tolerance),
        f"{output} / {setting['drive']}, {span}": auto.decide(design, transfer, tolerance),
    }
    noise = None
    if not explain_unsuitable(design, massive=True):
        noise = (
            f"thermal noise of {output}, {span}",
            auto.for_thermal_noise(design, "auto", float(frequency.max()), tolerance),
        )
    simplest = eigenmodes.solve(registry.choose(design).model.system(design))
    return estimates(design, simplest), simplest, decisions, noise


def document(
    name: str,
    tolerance: float,
    found: Estimates,
    decisions: dict[str, Decision],
    noise: tuple[str, Choice] | None,
) -> dict[str, Any]:
    """Build the JSON document."""
    choices = [
        {
            "quantity": quantity,
            "fidelity": decision.choice.level,
            "estimated_error": as_number(decision.choice.error),
            "reason": decision.choice.reason,
            "refinements": [
                {
                    "name": item.name,
                    "indicator": as_number(item.indicator),
                    "stage": item.stage,
                    "change": None if item.change is None else as_number(item.change),
                    "taken": item.taken,
                }
                for item in decision.refinements
            ],
        }
        for quantity, decision in decisions.items()
    ]
    if noise is not None:
        quantity, choice = noise
        choices.append(
            {
                "quantity": quantity,
                "fidelity": choice.level,
                "estimated_error": as_number(choice.error),
                "reason": choice.reason,
                "refinements": [],
            }
        )
    indicators = [
        {"stage": stage, "refinement": name, "value": as_number(float(values[n]))}
        for n, stage in enumerate(found.stage)
        for name, values in _largest(found).items()
    ]
    return {
        "command": "info",
        "design": name,
        "tolerance": tolerance,
        "indicators": indicators,
        "choices": choices,
    }


def text(
    title: str,
    tolerance: float,
    found: Estimates,
    simplest: Modes,
    decisions: dict[str, Decision],
    noise: tuple[str, Choice] | None,
) -> str:
    """Format a table of the estimates of each stage, then the chosen models."""
    columns = _largest(found)
    width = max([len(stage) for stage in found.stage] + [6])
    lines = [title, ""]
    if found.stage:
        lines.append(
            "Estimated relative change, by each refinement of a stage's wires, of the frequency"
            " that it changes most:"
        )
        lines.append(f"  {'':{width}}  " + "  ".join(columns) + "  first violin mode")
    else:
        lines.append("No stage hangs on wires.")
    for n, stage in enumerate(found.stage):
        cells = [f"{_shown(float(values[n])):>{len(name)}}" for name, values in columns.items()]
        lines.append(
            f"  {stage:{width}}  " + "  ".join(cells) + f"  {_hertz(float(found.violin[n])):>17}"
        )
    if any(math.isinf(float(value)) for values in columns.values() for value in values):
        lines.append(f"  without bound: {_why(simplest)}")
    lines += ["", f"Models that auto takes, for a tolerance of {tolerance:g}:"]
    for quantity, decision in decisions.items():
        lines.append(f"  {quantity}\n    {decision.choice.line}")
    if noise is not None:
        lines.append(f"  {noise[0]}\n    {noise[1].line}")
    return "\n".join(lines)


def _largest(found: Estimates) -> dict[str, Any]:
    """Largest change of a mode by each refinement of each stage's wires, (s,) each."""
    from suspension_cli.models.base import BENDING, MASS

    return {BENDING: found.bending.max(0), MASS: found.mass.max(0)}


def _shown(value: float) -> str:
    return (
        "unknown" if math.isnan(value) else "without bound" if math.isinf(value) else f"{value:.1e}"
    )


def _why(simplest: Modes) -> str:
    """Explain an infinite estimate."""
    from suspension_cli.models import auto

    return (
        auto.unrestrained_mode(simplest, unstable=False)
        or "a mode lies near or above the first violin mode of these wires"
    )


def _hertz(value: float) -> str:
    return "unknown" if math.isnan(value) else "none" if math.isinf(value) else f"{value:.4g} Hz"
