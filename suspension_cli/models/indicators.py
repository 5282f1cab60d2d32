"""What each refinement of a model would change, estimated before anything is solved: one dimensionless number a stage.

Bending.  A wire under tension T that is clamped pushes back like a hinge at the distance u = sqrt(EI / T) from its clamp, with a
stiffness sqrt(T EI) against turning (Gonzalez and Saulson, J. Acoust. Soc. Am. 96, 207 (1994)).  Against what the tension does,

    swinging:  u / l,        turning:  sum sqrt(T EI) / (2 sum (T z + k x^2))       (z, x: where the wires hold the body, from its COM)

are the relative changes of frequencies; where a design tells the points at which wires seem to bend, (u / l)^2 is left.  Torsion changes yaw by
sum(GJ / l) / (2 sum(T r^2 / l)).

Mass.  A wire of mass m_w swings with its body as m_w / 3 would, which lowers a frequency by m_w / (6 m); at a frequency f its inertia counts against its
tension as (f / f1)^2, f1 its first violin mode.

Blades in series.  Where a wire leans by an angle theta, the motion of a blade's tip is not along it: of order sin^2(theta) k_blade / k_wire ... but
for motions that only the blade lets through, of order 1; `models.force` tells which stages are so.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from suspension_cli.design.expand import expand
from suspension_cli.design.fibres import Fibre, fibres, unsuited
from suspension_cli.design.scene import Scene
from suspension_cli.design.schema import Design
from suspension_cli.models import force


@dataclass(frozen=True)
class Indicator:
    """One refinement of one stage.

    Attributes
    ----------
    stage : str
    refinement : str
        One of `REFINEMENTS`.
    value : float
        About the relative change of the frequencies that it touches most; NaN where the design does not say enough.
    """

    stage: str
    refinement: str
    value: float


SERIES, BENDING, MASS = "blades as coordinates", "bending and torsion of wires", "mass of wires"
REFINEMENTS = {SERIES: "string", BENDING: "beam", MASS: "violin"}
"""Each refinement, and the rung that has it."""


def indicators(design: Design, highest: float = 0.0) -> list[Indicator]:
    """Indicators of all stages.

    Parameters
    ----------
    design : Design
    highest : float
        The highest frequency asked for, Hz.
    """
    result = [Indicator(stage, SERIES, 1.0) for stage in (force.series_is_approximate(design) if not force.unsuited(design) else ())]
    scene = expand(design)
    known = {massive: not unsuited(design, massive=massive) for massive in (False, True)}
    wires = fibres(design).wire if known[False] else ()
    for n, stage in enumerate(design.stage):
        here = [w for w in range(len(scene.wires.label)) if scene.wires.lower[w] == n + 1]
        if not here:
            continue
        result.append(Indicator(stage.name, BENDING, _bending(scene, wires, here) if wires else math.nan))
        result.append(Indicator(stage.name, MASS, _mass(scene, wires, here, n, highest) if known[True] else math.nan))
    return result


def _bending(scene: Scene, wires: tuple[Fibre, ...], here: list[int]) -> float:
    """The largest relative change of a frequency of one stage by bending or torsion."""
    tension, length, k = scene.wires.tension[here], scene.wires.length[here], scene.wires.stiffness[here]
    rigidity = np.array([_end(wires[w]) for w in here])
    reach = np.sqrt(rigidity / np.maximum(tension, 1e-300)) / length
    effective = np.array([wires[w].effective for w in here])  # then only what is of second order is left
    hinge = np.where(effective, 0.0, np.sqrt(np.maximum(tension, 0.0) * rigidity))
    swing = float(np.where(effective, reach**2, reach).max())
    x, y, z = scene.wires.lower_point[here].T
    turns = [float(hinge.sum() / (2 * abs(float((tension * z + k * across**2).sum())) + 1e-300)) for across in (x, y)]
    twist = sum(1 / sum(section.length / section.twisting for section in wires[w].sections) for w in here)
    yaw = twist / (2 * float((tension * (x**2 + y**2) / length).sum()) + 1e-300)
    return max(swing, *turns, yaw if len(here) > 1 else 0.0)


def _end(fibre: Fibre) -> float:
    """EI of the stiffer plane at the stiffer end: what the clamp feels."""
    return max(max(section.rigidity) for section in (fibre.sections[0], fibre.sections[-1]))


def _mass(scene: Scene, wires: tuple[Fibre, ...], here: list[int], body: int, highest: float) -> float:
    """Relative change by the mass of one stage's wires."""
    mass = sum(section.mass * section.length for w in here for section in wires[w].sections)
    lowest = min(first_violin(wires[w], float(scene.wires.tension[w])) for w in here)
    return max(mass / (6 * float(scene.bodies.mass[body])), (highest / lowest) ** 2)


def first_violin(fibre: Fibre, tension: float) -> float:
    """First violin mode of a wire as a string, Hz: sqrt(T / m_w / l) / 2."""
    mass, length = sum(s.mass * s.length for s in fibre.sections), sum(s.length for s in fibre.sections)
    return math.sqrt(tension / (mass * length)) / 2 if mass > 0 else math.inf
