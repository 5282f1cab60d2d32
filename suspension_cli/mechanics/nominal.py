"""Design -> Scene, with blades that carry what hangs on them where the suspension really hangs.

A blade without a given load has its tip where the file draws it once it carries its share.  In a nominal pose that is drawn, that share follows from the
drawing.  Where natural lengths of wires are given the pose is solved for, and the loads F and the pose q depend on each other: in q the wires of a
stage hold up what they hold up, and the tensions of least elastic energy that do the same say what each blade carries.  Starting from the drawing,
each step solves for q with the loads of the step before; how the file draws the bodies then matters no more.  A step changes F by about the share of a
wire's length by which the last change moved the tips, so a few are enough.
"""

from __future__ import annotations

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
"""At most; each gains a digit or more."""
SETTLED = 1e-14
"""Change of a load, as a share of the weight, that is the last one."""


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
    """Along which axes (b, 3) the loads of blades follow from the pose: where wires of their stage have natural lengths and no load is given."""
    result = np.zeros((len(scene.blades.label), 3), dtype=bool)
    for stage in design.stage:
        if any(wire.natural_length is not None for wire in stage.wire):
            for blade in stage.blade:
                number = scene.blades.label.index(f"{stage.name}.{blade.name}")
                result[number] = scene.blades.axes[number] & [True, True, blade.load is None]
    return result


def _settled(scene: Scene, following: Any) -> Scene:
    """A scene with the loads that blades have in the pose in which it hangs; a complex step is carried along."""
    numbering, size = layout(scene), SETTLED * float(np.real(scene.weight))
    whole, pose = real(scene), None
    for _ in range(STEPS):
        found = equilibrium.solve(whole, numbering, start=pose)
        if not found.converged:
            found.demand(whole)
        pose = found.pose
        load = np.where(following, _carried(whole, pose), whole.blades.load)
        change = np.abs(load - whole.blades.load).max()
        whole = _loaded(whole, load)
        if change <= size:
            break
    else:
        remedy = "give each [[stage.blade]] its load, the weight in N at which its tip is where the file draws it"
        raise InputError([Fault("stage", f"loads of blades and the pose do not settle (last change {change:.1e} N)", remedy)])
    if not np.issubdtype(scene.kind, np.complexfloating):
        return whole
    tracked = _loaded(scene, np.where(following, whole.blades.load, scene.blades.load))
    for _ in range(STEPS):
        load = np.where(following, whole.blades.load + 1j * _carried(tracked, _moved(tracked, numbering, pose)).imag, scene.blades.load)
        change = np.abs(load - tracked.blades.load).max()
        tracked = _loaded(tracked, load)
        if change <= SETTLED * np.abs(load.imag).max():
            break
    return tracked


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
