"""Energy, tension and geometry of taut elastic strings: straight and massless.

>>> import suspension_cli as sus
>>> from suspension_cli.equilibrium.nominal import expand
>>> from suspension_cli.scene.pose import nominal_pose
>>> scene = expand(sus.example("double").design)
>>> state(scene, nominal_pose(scene)).tension.round(2)  # N
array([27.99, 27.99,  6.62,  6.62,  6.62,  6.62])

At the elongation e = L - l from the nominal length l, a wire stores T0 e + k e^2 / 2. Its gradient
with respect to the span (from the upper to the lower end) is T u, with T = T0 + k e and the unit
vector u; the Hessian is k u u^T + (T / L) (I - u u^T): stiffness along the wire, tension over
length across it (a pendulum). These are the two terms of equation 5 of Husman et al. (2000),
section 4b. Struts (legs of inverted pendulums) are strings that push.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.configuration import (
    Configuration,
    Line,
    batch_first,
    batch_of,
    configuration,
)
from suspension_cli.elements.element import Element
from suspension_cli.elements.energy_derivatives import Derivatives, Terms
from suspension_cli.elements.vectors import (
    cross,
    dot,
    outer,
    plus_unit,
    times,
    transposed,
)
from suspension_cli.scene.pose import Pose, layout
from suspension_cli.scene.scene import Scene, Wires

if TYPE_CHECKING:
    from jaxtyping import Inexact


def state(scene: Scene, pose: Pose, *, struts: bool = False) -> Line:
    """Geometry and tensions of all wires (or struts) in a pose; arrays with batch axes in front."""
    now = configuration(scene, layout(scene), pose)
    lines = now.struts if struts else now.wires
    batch = batch_of(scene, pose)
    names = [item.name for item in fields(lines) if item.name != "ends"]
    return replace(lines, **{name: batch_first(getattr(lines, name), batch) for name in names})


def _kinds(now: Configuration) -> list[tuple[Line, Wires]]:
    """Wires, and struts: those of them that the scene has."""
    kinds = (("wires", now.arrays.wires), ("struts", now.arrays.struts))
    return [(getattr(now, name), wires) for name, wires in kinds if wires.label]


def add_derivatives(now: Configuration, derivatives: Derivatives) -> None:
    """Add the derivatives of the energy of all wires and struts.

    Without `derivatives.stretching`, wires keep their lengths.
    """
    for lines, wires in _kinds(now):
        force = lines.tension * lines.direction
        e = lines.direction
        if not derivatives.curved:
            derivatives.add(lines, Terms(force))
            continue
        tension = lines.tension
        k = wires.stiffness
        if lines is now.wires:
            tension = tension if now.tension is None else now.tension
            k = k if derivatives.stretching else 0.0
        over = tension / lines.length
        s = plus_unit(outer((k - over) * e, e), over)
        derivatives.add(lines, Terms(force, s=s, turning_force=tension * e))


def predicted_tension(
    now: Configuration, step: Inexact[np.ndarray, "coordinate build"]
) -> Inexact[np.ndarray, "wire build"]:
    """Tension of wires after a small step in all coordinates, to first order, N."""
    lines = now.wires
    wires = now.arrays.wires
    motion = step[: 6 * now.shift.shape[1]].reshape(-1, 6, step.shape[-1]).swapaxes(0, 1)
    upper, lower = (motion[:, list(body)] for body in (lines.ends.upper, lines.ends.lower))
    change = lower[:3] - upper[:3]
    change = change + cross(lower[3:], lines.lower_arm) - cross(upper[3:], lines.upper_arm)
    if max(lines.ends.blade, default=-1) >= 0:
        moved = now.tip_motion(step)[:, list(lines.ends.blade)]
        change = change - moved - times(now.turn_of(lines.ends.upper), moved)
    longer = lines.elongation + dot(lines.direction, change)
    return wires.tension + wires.stiffness * longer


def elongations(now: Configuration) -> Inexact[np.ndarray, "coordinate wire build"]:
    """Elongation of each wire per coordinate."""
    lines = now.wires
    numbering = now.arrays.numbering
    e = lines.direction
    ends = lines.ends
    up = cross(e, lines.upper_arm)
    low = cross(lines.lower_arm, e)
    result = np.zeros((numbering.size + 1, len(ends.upper), now.arrays.count), dtype=e.dtype)
    if not ends.upper:
        return result[:-1]
    wire = np.arange(len(ends.upper))
    three = np.arange(3)[:, None]
    for body, sign, turn in ((np.array(ends.upper), -1.0, up), (np.array(ends.lower), 1.0, low)):
        result[6 * body + three, wire] = sign * e
        result[6 * body + three + 3, wire] = turn
    if max(ends.blade) >= 0:
        on_tip = -(e + times(transposed(now.turn_of(ends.upper)), e))
        tips = np.where(
            np.array(ends.blade) >= 0, numbering.blade[list(ends.blade)].T, len(result) - 1
        )
        result[tips, wire] = on_tip
    return result[:-1]


ELEMENT = Element(add_derivatives)
