"""Figure of Q and dilution of all modes against frequency, by stage and motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from suspension_cli.conventions import WIRE_MODE_NAMES
from suspension_cli.design.schema import Design
from suspension_cli.drawing import panels
from suspension_cli.drawing.panels import Line, Panel
from suspension_cli.drawing.style import NOTE, LineLook, stage_colours
from suspension_cli.linear.eigenmodes import Modes

BODIES = "bodies"
MARKERS = {BODIES: "x", "violin-x": "<", "violin-y": ">", "stretch": "^", "twist": "v"}
"""Marker of the modes of bodies, and of each motion of a wire; two at one point differ from one."""


def draw(modes: Modes, design: Design, subtitle: str) -> Figure:
    """Draw Q and dilution of every mode against its frequency."""
    colours = stage_colours(stage.name for stage in design.stage)
    stages = np.array([body.partition(".")[0] for body, _ in modes.home])
    motions = np.array([dof for _, dof in modes.home], dtype=object)
    motions[modes.order == 0] = BODIES
    groups = [*dict.fromkeys(zip(stages.tolist(), motions, strict=True))]
    shown = []
    for values, name in ((modes.q, "Q"), (modes.dilution, "dilution")):
        good = np.isfinite(values) & (modes.omega_squared > 0) & (modes.frequency > 0)
        lines = []
        for stage, motion in groups:
            own = good & (stages == stage) & (motions == motion)
            colour, look = colours.get(stage, NOTE), _look(MARKERS[motion])
            lines.append(Line(modes.frequency[own], values[own], "_", colour, look))
        shown.append(Panel(f"{name} (ratio)", lines, 1.7, "log", empty="no losses given", key=()))
    names = {BODIES: BODIES} | WIRE_MODE_NAMES
    key = [Line([], [], name, colour, _look("o")) for name, colour in colours.items()]
    key += [
        Line([], [], names[one], NOTE, _look(MARKERS[one])) for one in MARKERS if one in motions
    ]
    shown[0] = replace(shown[0], key=key)
    frequency = modes.frequency[modes.omega_squared > 0]
    limits = (float(frequency.min()) / 1.2, float(frequency.max()) * 1.2)
    across = panels.Across(limits=limits)
    return panels.draw("Q and dilution factor of all modes", subtitle, shown, across)


def _look(marker: str) -> LineLook:
    return {"linestyle": "none", "marker": marker, "markersize": 4, "fillstyle": "none"}
