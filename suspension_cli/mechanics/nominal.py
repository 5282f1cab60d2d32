"""Design -> Scene, with blades that carry what hangs on them where the suspension really hangs.

A blade without a given load has its tip where the file draws it once it carries its share.  In a nominal pose that is drawn, that share follows from
the drawing.  Where the natural lengths of all wires of a stage are given the pose is solved for, and the loads F and the pose q depend on each other: in
q the wires of the stage hold up what they hold up, and the tensions of least elastic energy that do the same say what each blade carries.  Starting from
the drawing, each step solves for q with the loads of the step before, until they agree; how the file draws the bodies then matters no more.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from suspension_cli.design import expand as drawing
from suspension_cli.design import perturb, statics
from suspension_cli.design.scene import Array, Scene
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError
from suspension_cli.mechanics import equilibrium, string
from suspension_cli.mechanics.pose import Layout, Pose, displaced, layout
from suspension_cli.mechanics.shares import units
from suspension_cli.mechanics.spins import free_to_spin, spins
from suspension_cli.mechanics.tangent import tangent

STEPS = 40
"""At most."""
SETTLED = 1e-13
"""Change of a load, as a share of the weight, that is the last one."""
COARSE = 1e3
"""Times that, where rounding of stiff wires lets it fall no further."""


def expand(design: Design) -> Scene:
    """The scene that a checked design stands for, imperfections included.

    Raises
    ------
    InputError
        If a stage cannot balance in its nominal pose, or a wire would be slack in it.
    """
    scene = nominal(design)
    for item in design.perturbation:
        scene = perturb.apply(scene, item)
    return scene


def nominal(design: Design) -> Scene:
    """The scene of a design without its imperfections.

    Raises
    ------
    InputError
        If it does not balance, or loads of blades and the pose do not settle.
    """
    scene = drawing.nominal(design)
    following = _following(design, scene)
    return _settled(scene, following) if following.any() else scene


def _following(design: Design, scene: Scene) -> Any:
    """Along which axes (b, 3) the loads of blades follow from the pose: where all wires of their stage have natural lengths and no load is given."""
    result = np.zeros((len(scene.blades.label), 3), dtype=bool)
    for stage in design.stage:
        if stage.wire and all(wire.natural_length is not None for wire in stage.wire):
            for blade in stage.blade:
                number = scene.blades.label.index(f"{stage.name}.{blade.name}")
                result[number] = scene.blades.axes[number] & [True, True, blade.load is None]
    return result


def _settled(scene: Scene, following: Any) -> Scene:
    """A scene with the loads that blades have in the pose in which it hangs; a complex step is carried along."""
    numbering, whole = layout(scene), real(scene)
    poses: list[Pose] = []

    def again(loads: Array) -> Array:
        now = _loaded(whole, _with(whole.blades.load, following, loads))
        found = equilibrium.solve(now, numbering, start=poses[-1] if poses else None)
        if not found.converged:
            found.demand(now)
        poses.append(found.pose)
        return _carried(now, found.pose)[following]

    loads = _fixed_point(again, whole.blades.load[following], SETTLED * float(whole.weight))
    whole = _loaded(whole, _with(whole.blades.load, following, loads))
    if not np.issubdtype(scene.kind, np.complexfloating):
        return whole

    def rate(rates: Array) -> Array:
        now = _loaded(scene, _with(scene.blades.load, following, loads + 1j * rates))
        return _carried(now, _moved(now, numbering, poses[-1])).imag[following]

    first = rate(np.zeros(len(loads)))
    rates = _fixed_point(rate, first, SETTLED * np.abs(first).max())
    return _loaded(scene, _with(scene.blades.load, following, loads + 1j * rates))


def _with(values: Array, where: Any, some: Any) -> Any:
    result = values.astype(np.result_type(values, some))
    result[where] = some
    return result


def _fixed_point(function: Callable[[Array], Array], start: Array, size: float) -> Array:
    """A point (n,) that a function takes to itself within a size, by Anderson's method.

    Each step goes to where the function's change along the steps before, taken as linear, says that it stays where it is (Walker and Ni, SIAM J.
    Numer. Anal. 49, 1715 (2011)): for n numbers, some n + 2 steps.
    """
    places, changes = [start], [function(start) - start]
    for _ in range(STEPS):
        last = changes[-1]
        if np.abs(last).max() <= size:
            return places[-1] + last
        moved, altered = np.diff(np.array(places), axis=0).T, np.diff(np.array(changes), axis=0).T
        share = np.linalg.lstsq(altered, last, rcond=1e-12)[0] if len(places) > 1 else np.zeros(0)
        place = places[-1] + last - ((moved + altered) @ share if len(places) > 1 else 0.0)
        places.append(place)
        changes.append(function(place) - place)
        if len(places) > len(start) + 3:
            del places[0], changes[0]
    if np.abs(changes[-1]).max() <= COARSE * size:  # as near as rounding lets it come
        return places[-1]
    remedy = "give each [[stage.blade]] its load, the weight in N at which its tip is where the file draws it"
    raise InputError([Fault("stage", f"loads of blades and the pose do not settle (last change {np.abs(changes[-1]).max():.1e} N)", remedy)])


def _loaded(scene: Scene, load: Array) -> Scene:
    return replace(scene, blades=replace(scene.blades, load=load))


def real(scene: Scene) -> Scene:
    """A scene without the complex step that it may carry."""
    parts = {
        name: replace(part, **{key: value.real for key, value in vars(part).items() if isinstance(value, np.ndarray) and value.dtype == complex})
        for name in ("bodies", "wires", "blades", "springs")
        for part in [getattr(scene, name)]
    }
    return replace(scene, gravity=np.real(scene.gravity), **parts)


def _moved(scene: Scene, numbering: Layout, pose: Pose) -> Pose:
    """The pose of a scene with a complex step, to first order in it, from that of the scene without: dq = -K^-1 dg."""
    gradient, stiffness = tangent(scene, numbering, pose)
    free = slice(6, None)
    there = real(scene)
    held = spins(there, numbering, pose, free_to_spin(there))
    step = equilibrium.newton_step(gradient.imag[free], stiffness.real[free, free], units(there, numbering), held)
    return displaced(numbering, pose, 1j * np.concatenate([np.zeros(6), step]))


def _carried(scene: Scene, pose: Pose) -> Array:
    """Forces (b, 3) of the blades on their tips that hold up tip masses and the wires of each stage, these at tensions of least energy."""
    wires, blades, now = scene.wires, scene.blades, string.state(scene, pose)
    up = np.swapaxes(pose.rotation, -1, -2)[blades.body]
    result = (up @ (blades.tip_mass[:, None] * np.array([0.0, 0.0, scene.gravity]))[..., None])[..., 0]
    for body in np.unique(wires.lower[wires.blade >= 0]):
        mine = np.flatnonzero(wires.lower == body)
        wrenches = statics.wire_wrenches(now.direction[mine], now.lower_arm[mine])
        along = (np.swapaxes(pose.rotation, -1, -2)[wires.upper[mine]] @ now.direction[mine][..., None])[..., 0]  # in the frame that the blades are fixed in
        compliance = statics.compliance(wires.stiffness[mine], along, wires.blade[mine], blades.axes, blades.stiffness)
        tension, _ = statics.least_energy(wrenches, -(wrenches.T @ now.tension[mine]), compliance)
        for n, wire in enumerate(mine):
            if wires.blade[wire] >= 0:
                result[wires.blade[wire]] -= tension[n] * along[n]
    return result
