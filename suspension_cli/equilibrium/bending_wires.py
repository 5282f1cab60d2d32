"""Equilibrium of wires whose bending stiffness depends on the tension to be found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from suspension_cli.elements import bending, string
from suspension_cli.elements.registry import uncompiled
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.clamps import HangingWires, to_clamps
from suspension_cli.equilibrium.solve import Equilibrium
from suspension_cli.scene.pose import Layout
from suspension_cli.scene.scene import Scene

CONVERGED = 1e-12
"""Relative change of tensions below which the bending stiffness is not updated."""
PASSES = 4
"""Most updates of the bending stiffness."""


def solve_bending(scene: Scene, numbering: Layout) -> tuple[Scene, Equilibrium]:
    """Find the equilibrium of a scene whose wires bend.

    Parameters
    ----------
    scene : Scene
        With `fibres`, and at most one batch axis.

    Returns
    -------
    scene : Scene
        With wires between their clamps, and `flex` at the tensions and lengths in equilibrium.
    found : Equilibrium
        Not necessarily converged: see `Equilibrium.demand`.
    """
    if scene.batch and not uncompiled(scene):
        return _solve_batch(scene, numbering)
    scene, hanging = to_clamps(scene)
    drawn = scene.drawn and _with_bending(scene.drawn, hanging)
    scene = replace(_with_bending(scene, hanging), drawn=drawn)
    found = equilibrium.solve(scene, numbering, start=hanging and hanging.found.pose)
    # the first time any change counts
    now, threshold = hanging or scene.wires, 0.0
    tension, length = now.tension, now.length
    for _ in range(PASSES):
        taut = found.converged & (found.tension > 0).all(-1)
        changed = np.abs(found.tension - tension) > threshold * np.abs(tension)
        left = np.asarray(taut & changed.any(-1))
        if not left.any():
            break
        tension = np.where(left[..., None], found.tension, tension)
        length = np.where(left[..., None], string.state(scene, found.pose).length, length)
        scene = bending.with_bending(scene, tension, length)
        found = equilibrium.solve_again(scene, numbering, found, left)
        threshold = CONVERGED
    if scene.batch and hanging is not None:
        found = _without_unknown_clamps(found, hanging)
    return scene, found


def _solve_batch(scene: Scene, numbering: Layout) -> tuple[Scene, Equilibrium]:
    """Find the equilibria of many builds by compiled loops, which update the bending stiffness."""
    scene, hanging = to_clamps(scene)
    drawn = scene.drawn
    if drawn is not None and not drawn.batch:
        scene = replace(scene, drawn=_with_bending(drawn, hanging))
    found = equilibrium.solve(scene, numbering, start=hanging and hanging.found.pose)
    if hanging is not None:
        found = _without_unknown_clamps(found, hanging)
    assert scene.flex is not None and found.flex is not None
    bend = found.flex[..., :6].reshape(*found.flex.shape[:-1], 2, 3)
    return replace(scene, flex=replace(scene.flex, bend=bend, twist=found.flex[..., 6])), found


def _without_unknown_clamps(found: Equilibrium, hanging: HangingWires) -> Equilibrium:
    """Report the strings that define the clamps, where these strings have no equilibrium."""
    unknown = np.asarray(np.isnan(hanging.tension).any(-1))
    strings = hanging.found
    return replace(
        found,
        residual=np.where(unknown, strings.residual, found.residual),
        tension=np.where(unknown[..., None], strings.tension, found.tension),
    )


def _with_bending(scene: Scene, hanging: HangingWires | None) -> Scene:
    """Fill the bending stiffness of wires, at nominal tensions or those of hanging wires."""
    if hanging is None:
        return bending.with_bending(scene)
    return bending.with_bending(scene, hanging.tension, hanging.length)
