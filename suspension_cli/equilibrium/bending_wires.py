"""Equilibrium of wires whose bending stiffness depends on the tension to be found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from suspension_cli.elements.bending import with_bending
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.clamps import to_clamps
from suspension_cli.equilibrium.hanging import HangingWires
from suspension_cli.equilibrium.solve import Equilibrium
from suspension_cli.scene.pose import Layout
from suspension_cli.scene.scene import Scene


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
    scene, hanging = to_clamps(scene)
    drawn = scene.drawn and _with_bending(scene.drawn, hanging)
    scene = replace(_with_bending(scene, hanging), drawn=drawn)
    found = equilibrium.solve(scene, numbering, start=hanging and hanging.found.pose)
    if scene.batch and hanging is not None:
        found = _without_unknown_clamps(found, hanging)
    if found.bend is not None:
        assert scene.flex is not None and found.twist is not None
        flex = replace(scene.flex, bend=found.bend, twist=found.twist)
        scene = replace(scene, flex=flex)
    return scene, found


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
        return with_bending(scene)
    return with_bending(scene, hanging.tension, hanging.length)
