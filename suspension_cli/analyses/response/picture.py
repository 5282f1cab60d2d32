"""Bode plots of frequency responses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.drawing import panels
from suspension_cli.drawing.added_points import add_from_model
from suspension_cli.drawing.panels import Across, Line, Panel, Scale
from suspension_cli.drawing.style import stage_colours
from suspension_cli.linear import eigenmodes, signals
from suspension_cli.linear.response import Response
from suspension_cli.models.choice import Transfer

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Result
    from suspension_cli.drawing.added_points import Solve
    from suspension_cli.scene.arrays import Array

PHASE = 1.1
"""Height of a panel of phases, in."""
MANY = 8
"""Number of responses above which the frequencies of modes alone are added."""
ZERO = "0 by symmetry at all frequencies"


def draw(response: Response, title: str, scale: str = "db", stages: Sequence[str] = ()) -> Figure:
    """Draw magnitudes, a panel per unit, and phases against frequency.

    Curves have the colours of the stages of their outputs. `scale` is "db" (20 log10 of the SI
    value) or "absolute" (on a log axis).
    """
    pairs = [(o, i) for o in range(len(response.output)) for i in range(len(response.input))]
    units = list(dict.fromkeys(response.unit[o][i] for o, i in pairs))
    body, many = [body_of(output) for output in response.output], len(pairs) > 1
    by_stage = stage_colours([*stages, *body])
    colours = [by_stage[body[o]] for o, _ in pairs]
    lines = {
        (o, i): Line(
            response.frequency, response.value[:, o, i], _name(response, o, i), colour,
            {"linestyle": dashes},
        )
        for (o, i), colour, dashes in zip(pairs, colours, panels.dashes_of(colours), strict=True)
    }  # fmt: skip
    kind: Scale = "db" if scale == "db" else "log"
    shown = []
    for unit in units:
        own = [line for (o, i), line in lines.items() if response.unit[o][i] == unit]
        key = None if many else ()
        label = label_magnitude(unit, scale == "db")
        shown.append(Panel(label, own, scale=kind, key=key, peaks="find", empty=ZERO))
    phases = [*lines.values()]
    shown.append(Panel("phase (degrees)", phases, PHASE, "phase", key=(), empty=" "))
    logarithmic = response.frequency[0] > 0 and len(response.frequency) > 1
    heading = "Transfer functions" if many else f"Transfer function {_name(response, 0, 0)}"
    heading += ", loops closed" if response.closed_loop else ""
    return panels.draw(heading, title, shown, Across(scale="log" if logarithmic else "linear"))


def _name(response: Response, o: int, i: int) -> str:
    zero = "" if response.value[:, o, i].any() else " = 0 by symmetry"
    return f"{response.output[o]} / {response.input[i]}{zero}"


def body_of(signal: str) -> str:
    """Body of a signal: ``test`` of ``test.x@0,0,0.001``."""
    return signal.partition("@")[0].rpartition(".")[0]


def label_magnitude(unit: str, decibels: bool) -> str:
    """Label of an axis of magnitudes with its unit."""
    if decibels:
        return "magnitude (dB)" if unit in ("m/m", "") else f"magnitude (dB re 1 {unit})"
    return f"magnitude ({unit})" if unit else "magnitude"


def refine(result: Result) -> Response:
    """Add the frequencies that resolve resonances and zeros to a response."""
    data: Response = result.data

    def build() -> tuple[Solve, Array]:
        model = result.linear_system or result.choice.model.system(result.design)
        known = signals.bodies_with_signals(model)
        inputs = [signals.parse_input(text, known) for text in data.input]
        outputs = [signals.parse_output(text, known) for text in data.output]
        if data.closed_loop:
            from suspension_cli.analyses.response.closed_loop import ClosedTransfer

            closed = ClosedTransfer(inputs, outputs, data.frequency, result.design)
            return partial(closed.values, model), np.empty(0)
        modes = eigenmodes.solve(model.constant).frequency
        return partial(Transfer(inputs, outputs, data.frequency).values, model), modes

    few = data.value[0].size <= MANY
    frequency, value = add_from_model(build, data.frequency, data.value, few=few)
    return replace(data, frequency=frequency, value=value)
