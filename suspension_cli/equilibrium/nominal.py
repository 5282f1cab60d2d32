"""Scene of a design, with blade loads that match the pose in which the suspension hangs.

A blade without a given load has its tip in the drawn position when it carries its part of the
weight. If the nominal pose is drawn, the loads follow from the drawing. If all wires of a stage
have natural lengths, the pose is solved for, and the loads and the pose depend on each other: the
tensions of least elastic energy that exert the same force and torque as the wires in this pose
define the load of each blade. Starting from the drawing, each step solves for the pose with the
loads of the step before, until they agree; the result does not depend on how the file draws the
bodies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design.derive import gives_natural_lengths
from suspension_cli.design.kept_results import keep_last
from suspension_cli.design.schema import Design
from suspension_cli.elements import taut_string
from suspension_cli.elements import weight as weights
from suspension_cli.elements.configuration import configuration
from suspension_cli.elements.known_elements import have_own_arrays, with_added
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.hanging import apply
from suspension_cli.errors import Fault, InputError
from suspension_cli.scene import expand as scene_expand
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.pose import Pose, layout
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Bool, Inexact

STEPS = 40
"""Most iterations of the loads."""
CONVERGED = 1e-13
"""Change of a load, relative to the weight, at which the iteration stops."""
COARSE = 1e3
"""Multiple of `CONVERGED` accepted after `STEPS`, as rounding of stiff wires may leave it."""


@keep_last
def expand(design: Design) -> Scene:
    """Expand a checked design into its scene, with imperfections.

    Raises `InputError` if a stage cannot balance in its nominal pose, or a wire is slack in it.
    """
    scene = expand_nominal(design)
    for item in design.perturbation:
        scene = apply(scene, item)
    return scene


def expand_geometry(design: Design) -> Scene:
    """Expand a design into the scene that drawings show: nothing is balanced.

    Places and lengths are those of `expand`; loads of blades and tensions are not.
    """
    scene = with_added(scene_expand.expand_as_drawn(design), design)
    for item in design.perturbation:
        scene = apply(scene, item, trim=False)
    return scene


@keep_last
def expand_nominal(design: Design) -> Scene:
    """Expand a design into its scene, without imperfections.

    Raises `InputError` if it does not balance, or the loads of blades do not converge.
    """
    scene = with_added(scene_expand.expand_as_drawn(design), design)
    unknown = _unknown_loads(design, scene)
    return _with_loads_of_pose(scene, unknown) if unknown.any() else scene


def is_as_drawn(design: Design) -> bool:
    """Whether the scene of a design is that of `scene.expand`, whose topology says all."""
    return not (
        design.perturbation
        or gives_natural_lengths(design)
        or any(stage.inverted_pendulum or stage.filter for stage in design.stage)
        or have_own_arrays()
    )


def _unknown_loads(design: Design, scene: Scene) -> Bool[np.ndarray, "blade 3"]:
    """Whether the load of each blade along each axis depends on the pose, bool (b, 3).

    So if all wires of its stage have natural lengths and no load is given.
    """
    result = np.zeros((len(scene.blades.label), 3), dtype=bool)
    for stage in design.stage:
        if stage.wire and all(wire.natural_length is not None for wire in stage.wire):
            for blade in stage.blade:
                number = scene.blades.label.index(f"{stage.name}.{blade.name}")
                result[number] = scene.blades.axes[number] & [True, True, blade.load is None]
    return result


def _with_loads_of_pose(scene: Scene, unknown: Bool[np.ndarray, "blade 3"]) -> Scene:
    """Set the unknown loads of blades to those in equilibrium."""
    numbering = layout(scene)
    poses: list[Pose] = []

    def next_loads(loads: Array) -> Array:
        now = _with_loads(scene, unknown, loads)
        found = equilibrium.solve(now, numbering, start=poses[-1] if poses else None)
        if not found.converged:
            found.demand(now)
        poses.append(found.pose)
        return _blade_loads(now, found.pose)[unknown]

    loads = _fixed_point(next_loads, scene.blades.load[unknown], CONVERGED * float(scene.weight))
    return _with_loads(scene, unknown, loads)


def _with_loads(
    scene: Scene, where: Bool[np.ndarray, "blade 3"], loads: Inexact[np.ndarray, " load"]
) -> Scene:
    """A scene with loads (k,) of blades replaced `where` a mask (b, 3) is set."""
    result = scene.blades.load.copy()
    result[where] = loads
    return replace(scene, blades=replace(scene.blades, load=result))


def _fixed_point(function: Callable[[Array], Array], start: Array, tolerance: float) -> Array:
    """Fixed point (n,) of a function."""
    from scipy.optimize import root

    def change(place: Array) -> Array:
        return function(place) - place

    found: Any = root(change, start, options={"xtol": CONVERGED, "maxfev": STEPS + len(start)})
    last = float(np.abs(found.fun).max())
    if last <= COARSE * tolerance:
        return found.x + found.fun
    problem = f"loads of blades and the pose do not converge (last change {last:.1e} N)"
    remedy = (
        "give each [[stage.blade]] its load, the weight in N at which its tip is where the file"
        " draws it"
    )
    raise InputError([Fault("stage", problem, remedy)])


def _blade_loads(scene: Scene, pose: Pose) -> Array:
    """Forces (b, 3) of the blades on their tips, along the axes of their bodies, N.

    They carry the tip masses, and the wires of each stage at tensions of least energy.
    """
    wires = scene.wires
    blades = scene.blades
    now = taut_string.state(scene, pose)
    arrays = configuration(scene, layout(scene), pose)
    weight = np.zeros((len(blades.label), 3))
    for group in weights.masses(arrays.arrays)[0]:
        force = group.mass * weights.lift(scene, group.places(arrays))
        for n, number in enumerate(group.ends.blade):
            if number >= 0:
                weight[number] += force[:, n, 0]
    to_body = np.swapaxes(pose.rotation, -1, -2)
    result = (to_body[blades.body] @ weight[..., None])[..., 0]
    for body in sorted(set(wires.lower[wires.blade >= 0].tolist())):
        own = np.flatnonzero(wires.lower == body)
        wrenches = scene_expand.wire_wrenches(now.direction[own], now.lower_arm[own])
        along = (to_body[wires.upper[own]] @ now.direction[own][..., None])[..., 0]
        strain = scene_expand.strains(
            wires.stiffness[own], along, wires.blade[own], blades.axes, blades.stiffness
        )
        tension, _ = scene_expand.least_energy(wrenches, -(wrenches.T @ now.tension[own]), strain)
        for n, wire in enumerate(own):
            if wires.blade[wire] >= 0:
                result[wires.blade[wire]] -= tension[n] * along[n]
    return result
