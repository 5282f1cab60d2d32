"""How wires that bend hang: from their clamps, as stiff against bending as the tension that they come to bear makes them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from suspension_cli.design.fibres import Fibre
from suspension_cli.design.scene import Scene
from suspension_cli.mechanics import equilibrium, flexure, joined, string
from suspension_cli.mechanics.equilibrium import Equilibrium
from suspension_cli.mechanics.fibre import Strand, fitted, kinds
from suspension_cli.mechanics.pose import Layout

SETTLED = 1e-12
"""Relative change of tensions after which the stiffness of wires against bending need not be taken anew."""
HINGES = 4
"""How often the place of a wire's clamps is worked out anew for its length between them; each time changes the last change by u / l."""
PASSES = 4


def balanced(scene: Scene, numbering: Layout) -> tuple[Scene, Equilibrium]:
    """The equilibrium of a scene with fibres.

    Parameters
    ----------
    scene : Scene
        With any batch axes (at most one); `fibres` filled.
    numbering : Layout

    Returns
    -------
    scene : Scene
        With its wires between their clamps, and `flex` filled for the tensions and lengths in equilibrium.
    found : Equilibrium
        Not necessarily converged: see `Equilibrium.demand`.  Nothing that one scene of a batch gets depends on the others.
    """
    scene = _stiff(scene)
    found = equilibrium.solve(scene, numbering)
    shape = (*scene.batch, len(scene.wires.label))
    tension, length = (np.broadcast_to(v, shape) for v in (scene.wires.tension, scene.wires.length))
    least = 0.0  # however little a wire's tension has changed, its stiffness changes in proportion
    for _ in range(PASSES):
        taut = found.converged & (found.tension > 0).all(-1)
        moved = taut & (np.abs(found.tension - tension) > least * np.abs(tension)).any(-1)
        if not moved.any():
            break
        tension = np.where(moved[..., None], found.tension, tension)
        length = np.where(moved[..., None], string.state(scene, found.pose).length, length)
        scene = flexure.flexible(scene, tension, length)
        found = equilibrium.resolved(scene, numbering, found, moved)
        least = SETTLED
    return scene, found


def _stiff(scene: Scene) -> Scene:
    """A scene whose wires hang between their clamps and bend, and so do those of what it was meant to be: then forces can be compared."""
    drawn = scene.drawn
    if drawn is not None:
        drawn = flexure.flexible(_to_clamps(replace(drawn, fibres=scene.fibres)))
    return replace(flexure.flexible(_to_clamps(scene)), drawn=drawn)


def _to_clamps(scene: Scene) -> Scene:
    """A scene whose wires end at their clamps, where the design tells the points at which they seem to bend.

    A wire whose far end is pulled aside pushes on its clamp with a shear V and a moment M, as if it were hinged at u = M / V from there (sqrt(EI / T) for
    a long uniform one; Gonzalez and Saulson, J. Acoust. Soc. Am. 96, 207 (1994)).  So its clamps lie u beyond those points, in line with the wire:
    what carries the weight is the same.  Of a ribbon it is the soft plane that counts.
    """
    fibres, wires = scene.fibres, scene.wires
    assert fibres is not None
    if not any(fibre.effective for fibre in fibres.wire):
        return scene
    ends = np.zeros((*scene.batch, len(wires.label), 2))
    shape = (*scene.batch, len(wires.label))
    hung = [np.broadcast_to(v, shape) for v in (wires.length, wires.stiffness, wires.tension)]
    for alike in kinds(fibres.wire, *hung):
        if fibres.wire[alike[0]].effective:
            ends[..., alike, :] = _hinges(fibres.wire[alike[0]], *(v[..., alike[0]] for v in hung))[..., None, :]
    e, longer = wires.span / wires.length[..., None], ends.sum(-1)
    moved = replace(
        wires,
        upper_point=wires.upper_point - ends[..., :1] * e,
        lower_point=wires.lower_point + ends[..., 1:] * e,
        span=wires.span + longer[..., None] * e,
        length=wires.length + longer,
    )
    return replace(scene, wires=moved)


def _hinges(fibre: Fibre, length: Any, k: Any, tension: Any) -> Any:
    """How far (..., 2) from its upper and its lower clamp a wire seems to bend, m, in its first plane, if it is that much longer than drawn."""
    upper = lower = np.zeros(length.size)
    for _ in range(HINGES):
        longer = fitted(fibre, length.ravel() + upper + lower, k.ravel(), tension.ravel(), 0.0)
        ends = joined.ends(Strand(longer, tension.ravel(), massive=False, lossy=False).resting("bend-1"))  # w_1, w'_1, w_2, w'_2
        upper, lower = np.abs(ends[1, 2] / ends[0, 2]), np.abs(ends[3, 0] / ends[2, 0])
    return np.stack([upper, lower], axis=-1).reshape(*length.shape, 2)
