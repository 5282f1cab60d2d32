"""Imperfections: errors of a build in one part, applied to a scene.

All functions work on scenes with batch axes; an amount may be an array of any batch shape.
`design.imperfections` has the table of names, units and neutral values.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from suspension_cli.conventions import SUPPORT
from suspension_cli.design.filters import SUFFIX
from suspension_cli.rotations import rotation_matrix
from suspension_cli.scene.arrays import Array, frames
from suspension_cli.scene.scene import Scene, spring_of_leg


def members(scene: Scene, part: str) -> dict[str, int]:
    """Map the names of all parts of a kind to their numbers, see `impose`.

    The blades of a filter are called by its stage, and numbered behind those of wires.
    """
    if part == "body":
        return {name: n for n, name in enumerate((SUPPORT, *scene.bodies.name))}
    if part == "link":
        labels = [label.removesuffix(".link") for label in scene.springs.label]
        linked = zip(labels, scene.springs.label, strict=True)
        return {name: n for n, (name, label) in enumerate(linked) if name != label}
    labels = {"wire": scene.wires, "blade": scene.blades, "leg": scene.struts}[part].label
    found = {label: n for n, label in enumerate(labels)}
    if part == "blade":
        bodies = scene.bodies.name
        filters = [name for name in bodies if name + SUFFIX in bodies]
        found |= {name: len(labels) + bodies.index(name) for name in filters}
    return found


def impose(
    scene: Scene, part: str, number: int, amounts: Mapping[str, Any], hold: str = "loaded-length"
) -> Scene:
    """Apply imperfections of one part to a scene.

    Parameters
    ----------
    scene : Scene
    part : str
        One of `PARTS`.
    number : int
        The wire, blade or leg from 0, the body from 1, the link as a spring of the scene; of the
        blades of a filter the number of its body, less 1, behind the blades of wires.
    amounts : mapping of (...) or (..., 3) arrays
        By name of `design.imperfections`.
    hold : {"loaded-length", "natural-length"}
        See `wire`.
    """
    if part == "wire":
        return wire(scene, number, **amounts, hold=hold)
    for name, amount in amounts.items():
        scene = ACTIONS[part, name](scene, number, amount)
    return scene


def wire(
    scene: Scene,
    number: int,
    *,
    k_factor: Any = 1.0,
    radius_factor: Any = 1.0,
    upper_offset: Any = (0.0, 0.0, 0.0),
    lower_offset: Any = (0.0, 0.0, 0.0),
    length_change: Any = 0.0,
    hold: str = "loaded-length",
) -> Scene:
    """Change one wire of a scene.

    Parameters
    ----------
    scene : Scene
    number : int
        The wire, from 0.
    k_factor, radius_factor : (...) arrays
        On its spring constant, and on its radius, with whose square the spring constant goes.
    upper_offset, lower_offset : (..., 3) arrays
        Of its ends, m.
    length_change : (...) array
        Of its unstretched length, after trimming, m.
    hold : {"loaded-length", "natural-length"}
        The wire is first trimmed so that it carries its nominal tension T in the nominal pose, or
        keeps its unstretched length l - T / k. With its new spring constant k' and span L in the
        nominal pose, its tension there is T, or k' (T / k + L - l), less k' times the change of
        length.
    """
    wires = scene.wires
    factor = _numbers(k_factor) * _numbers(radius_factor) ** 2
    change = _numbers(length_change)
    upper, lower = _numbers(upper_offset), _numbers(lower_offset)
    old_span, old_length = wires.span[..., number, :], wires.length[..., number]
    old_k, old_tension = wires.stiffness[..., number], wires.tension[..., number]
    shift = lower - upper
    span = old_span + shift
    length = np.sqrt((span**2).sum(-1))
    # L - l without cancellation: (L^2 - l^2) / (L + l)
    longer = (shift * (2 * old_span + shift)).sum(-1) / (length + old_length)
    k = old_k * factor
    tension = (
        old_tension - k * change
        if hold == "loaded-length"
        else k * (old_tension / old_k + longer - change)
    )
    changed = replace(
        wires,
        upper_point=_with(wires.upper_point, number, wires.upper_point[..., number, :] + upper, 1),
        lower_point=_with(wires.lower_point, number, wires.lower_point[..., number, :] + lower, 1),
        span=_with(wires.span, number, span, 1),
        length=_with(wires.length, number, length, 0),
        tension=_with(wires.tension, number, tension, 0),
        stiffness=_with(wires.stiffness, number, k, 0),
    )
    return replace(scene, wires=changed, drawn=scene.drawn or scene)


def move_com(scene: Scene, number: int, offset: Any) -> Scene:
    """Move the COM of one body relative to all its attachments.

    Parameters
    ----------
    scene : Scene
    number : int
        The body, from 1.
    offset : (..., 3) array
        m. The inertia is then about the new COM.
    """
    shift, bodies = _numbers(offset), scene.bodies
    position = _with(bodies.position, number, bodies.position[..., number, :] + shift, 1)

    def moved(part: Any) -> Any:
        points = {}
        for name, frame in frames(type(part)).items():
            on = getattr(part, frame) == number
            step = shift.reshape(*shift.shape[:-1], *(1,) * on.ndim, 3)
            points[name] = getattr(part, name) - np.where(on[..., None], step, 0.0)
        return replace(part, **points)

    parts = {name: moved(part) for name, part in scene.parts.items()}
    parts["bodies"] = replace(bodies, position=position)
    return replace(scene, drawn=scene.drawn or scene, **parts)


def turn_mass(scene: Scene, number: int, rotation: Any) -> Scene:
    """Turn the mass of one body relative to its attachments.

    Parameters
    ----------
    scene : Scene
    number : int
        The body, from 1.
    rotation : (..., 3) array
        Rotation vector, rad: the inertia becomes R I R^T.
    """
    turn = rotation_matrix(_numbers(rotation))
    inertia = scene.bodies.inertia
    turned = turn @ inertia[..., number - 1, :, :] @ np.swapaxes(turn, -1, -2)
    turned = (turned + np.swapaxes(turned, -1, -2)) / 2
    return replace(
        scene,
        bodies=replace(scene.bodies, inertia=_with(inertia, number - 1, turned, 2)),
        drawn=scene.drawn or scene,
    )


def scale_mass(scene: Scene, number: int, factor: Any) -> Scene:
    """Multiply the mass of one body (from 1) by a factor (...).

    Wires keep their unstretched lengths.
    """
    mass = scene.bodies.mass
    return replace(
        scene,
        bodies=replace(
            scene.bodies, mass=_with(mass, number - 1, mass[..., number - 1] * _numbers(factor), 0)
        ),
        drawn=scene.drawn or scene,
    )


def scale_inertia(scene: Scene, number: int, factor: Any) -> Scene:
    """Multiply the moments of inertia of one body (from 1) by factors (..., 3).

    Products of inertia scale with the geometric mean of the two factors.
    """
    inertia, root = scene.bodies.inertia, np.sqrt(_numbers(factor))
    scaled = inertia[..., number - 1, :, :] * root[..., :, None] * root[..., None, :]
    return replace(
        scene,
        bodies=replace(scene.bodies, inertia=_with(inertia, number - 1, scaled, 2)),
        drawn=scene.drawn or scene,
    )


def scale_blade(scene: Scene, number: int, factor: Any) -> Scene:
    """Multiply the stiffness of one blade (from 0), or of those of a filter, by a factor (...).

    The blades are trimmed to their nominal load in the nominal pose.
    """
    count = len(scene.blades.label)
    if number >= count:
        body = number - count + 1
        keystone = scene.bodies.name.index(scene.bodies.name[body - 1] + SUFFIX) + 1
        springs = scene.springs
        own = np.flatnonzero((springs.upper == body) & (springs.lower == keystone))
        return scale_spring(scene, int(own[0]), factor)
    stiffness = scene.blades.stiffness
    scaled = stiffness[..., number, :] * _numbers(factor)[..., None]
    return replace(
        scene,
        blades=replace(scene.blades, stiffness=_with(stiffness, number, scaled, 1)),
        drawn=scene.drawn or scene,
    )


def scale_spring(scene: Scene, number: int, factor: Any) -> Scene:
    """Multiply the stiffness of one spring (from 0) by a factor (...); its preload stays."""
    stiffness = scene.springs.stiffness
    scaled = stiffness[..., number, :, :] * _numbers(factor)[..., None, None]
    return replace(
        scene,
        springs=replace(scene.springs, stiffness=_with(stiffness, number, scaled, 2)),
        drawn=scene.drawn or scene,
    )


def scale_leg(scene: Scene, number: int, factor: Any) -> Scene:
    """Multiply the stiffness of the flexures of one leg (from 0) by a factor (...)."""
    return scale_spring(scene, spring_of_leg(scene, number), factor)


def lengthen_leg(scene: Scene, number: int, change: Any) -> Scene:
    """Change the unloaded length of one leg (from 0) by (...), m."""
    struts = scene.struts
    tension = struts.tension[..., number] - struts.stiffness[..., number] * _numbers(change)
    return replace(
        scene,
        struts=replace(struts, tension=_with(struts.tension, number, tension, 0)),
        drawn=scene.drawn or scene,
    )


ACTIONS = {
    ("body", "com_offset"): move_com,
    ("body", "rotation"): turn_mass,
    ("body", "mass_factor"): scale_mass,
    ("body", "inertia_factor"): scale_inertia,
    ("blade", "stiffness_factor"): scale_blade,
    ("leg", "stiffness_factor"): scale_leg,
    ("leg", "length_change"): lengthen_leg,
    ("link", "stiffness_factor"): scale_spring,
}
"""How each imperfection of a part acts on a scene; those of a wire act in `wire`."""


def _numbers(values: Any) -> Any:
    """Convert to floats, or to complex numbers where a derivative is taken by a complex step."""
    array = np.asarray(values)
    return array if array.dtype == complex else array.astype(float)


def _with(values: Array, number: int, item: Array, inner: int) -> Array:
    """Copy `values` (..., n, [inner axes]) with member `number` replaced, batch axes broadcast."""
    axis = -1 - inner
    batch = np.broadcast_shapes(values.shape[:axis], item.shape[: item.ndim - inner])
    result = np.array(
        np.broadcast_to(values, batch + values.shape[axis:]), dtype=np.result_type(values, item)
    )
    result[(..., number, *(slice(None),) * inner)] = item
    return result
