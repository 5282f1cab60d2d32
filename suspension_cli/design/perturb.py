"""Imperfections: what a build did to one wire or body, put into a scene.

All of these work on scenes with batch axes too: an amount may be an array of any batch shape.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from suspension_cli.conventions import SUPPORT
from suspension_cli.design.scene import Array, Scene
from suspension_cli.design.schema import Perturbation
from suspension_cli.rotations import rotation_matrix


def apply(scene: Scene, item: Perturbation) -> Scene:
    """Put one `[[perturbation]]` of a design file into a scene."""
    if item.wire is not None:
        zero = (0.0, 0.0, 0.0)
        return wire(
            scene,
            scene.wires.label.index(item.wire),
            k_factor=1.0 if item.k_factor is None else item.k_factor,
            upper_offset=item.upper_offset or zero,
            lower_offset=item.lower_offset or zero,
            length_change=item.length_change or 0.0,
            hold=item.hold,
        )
    assert item.body is not None
    number = 0 if item.body == SUPPORT else scene.bodies.name.index(item.body) + 1
    if item.com_offset is not None:
        scene = move_com(scene, number, item.com_offset)
    if item.rotation is not None:
        scene = turn_mass(scene, number, item.rotation)
    return scene


def wire(
    scene: Scene,
    number: int,
    *,
    k_factor: Any = 1.0,
    upper_offset: Any = (0.0, 0.0, 0.0),
    lower_offset: Any = (0.0, 0.0, 0.0),
    length_change: Any = 0.0,
    hold: str = "loaded-length",
) -> Scene:
    """A scene in which one wire is not like the others.

    Parameters
    ----------
    scene : Scene
    number : int
        The wire, from 0.
    k_factor : (...) array
        On its spring constant.
    upper_offset, lower_offset : (..., 3) arrays
        Of its ends, m.
    length_change : (...) array
        Of its unstretched length, after trimming, m.
    hold : {"loaded-length", "natural-length"}
        Whether the wire is first trimmed so that it carries its nominal tension T in the nominal pose,
        or keeps its unstretched length l - T / k.  Then the tension at the new span L in the nominal pose is
        T, or k' (T / k + L - l), less k' times the change of length.
    """
    wires = scene.wires
    factor, change = _numbers(k_factor), _numbers(length_change)
    upper, lower = _numbers(upper_offset), _numbers(lower_offset)
    old_span, old_length = wires.span[..., number, :], wires.length[..., number]
    old_k, old_tension = wires.stiffness[..., number], wires.tension[..., number]
    shift = lower - upper
    span = old_span + shift
    length = np.sqrt((span**2).sum(-1))
    # L - l without cancellation: (L^2 - l^2) / (L + l)
    longer = (shift * (2 * old_span + shift)).sum(-1) / (length + old_length)
    k = old_k * factor
    tension = old_tension - k * change if hold == "loaded-length" else k * (old_tension / old_k + longer - change)
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
    """A scene in which the COM of one body lies elsewhere relative to all its attachments.

    Parameters
    ----------
    scene : Scene
    number : int
        The body, from 1.
    offset : (..., 3) array
        m.  The inertia given is about the new COM.
    """
    shift = _numbers(offset)
    bodies, wires, blades, springs = scene.bodies, scene.wires, scene.blades, scene.springs
    position = _with(bodies.position, number, bodies.position[..., number, :] + shift, 1)
    return replace(
        scene,
        drawn=scene.drawn or scene,
        bodies=replace(bodies, position=position),
        wires=replace(
            wires, upper_point=_less(wires.upper_point, wires.upper == number, shift), lower_point=_less(wires.lower_point, wires.lower == number, shift)
        ),
        blades=replace(blades, tip=_less(blades.tip, blades.body == number, shift)),
        springs=replace(
            springs,
            upper_point=_less(springs.upper_point, springs.upper == number, shift),
            lower_point=_less(springs.lower_point, springs.lower == number, shift),
        ),
    )


def turn_mass(scene: Scene, number: int, rotation: Any) -> Scene:
    """A scene in which the mass of one body is turned relative to its attachments.

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
    return replace(scene, bodies=replace(scene.bodies, inertia=_with(inertia, number - 1, turned, 2)), drawn=scene.drawn or scene)


def scale_mass(scene: Scene, number: int, factor: Any) -> Scene:
    """A scene in which one body (from 1) has another mass; wires keep their unstretched lengths.  `factor` has the batch shape."""
    mass = scene.bodies.mass
    return replace(
        scene,
        bodies=replace(scene.bodies, mass=_with(mass, number - 1, mass[..., number - 1] * _numbers(factor), 0)),
        drawn=scene.drawn or scene,
    )


def scale_inertia(scene: Scene, number: int, factor: Any) -> Scene:
    """A scene in which one body (from 1) has its moments of inertia times `factor` (..., 3), each by itself; products of inertia go along."""
    inertia, root = scene.bodies.inertia, np.sqrt(_numbers(factor))
    scaled = inertia[..., number - 1, :, :] * root[..., :, None] * root[..., None, :]
    return replace(scene, bodies=replace(scene.bodies, inertia=_with(inertia, number - 1, scaled, 2)), drawn=scene.drawn or scene)


def scale_blade(scene: Scene, number: int, factor: Any) -> Scene:
    """A scene in which one blade (from 0) has another stiffness; it is trimmed to its nominal load in the nominal pose."""
    stiffness = scene.blades.stiffness
    scaled = stiffness[..., number, :] * _numbers(factor)[..., None]
    return replace(scene, blades=replace(scene.blades, stiffness=_with(stiffness, number, scaled, 1)), drawn=scene.drawn or scene)


def _numbers(values: Any) -> Any:
    """Floats, or complex numbers where a derivative is taken by a complex step."""
    array = np.asarray(values)
    return array if array.dtype == complex else array.astype(float)


def _with(values: Array, number: int, item: Array, inner: int) -> Array:
    """A copy of `values` (..., n, [inner axes]) with member `number` replaced, batch axes broadcast."""
    axis = -1 - inner
    batch = np.broadcast_shapes(values.shape[:axis], item.shape[: item.ndim - inner])
    result = np.array(np.broadcast_to(values, batch + values.shape[axis:]), dtype=np.result_type(values, item))
    result[(..., number, *(slice(None),) * inner)] = item
    return result


def _less(points: Array, on: Array, shift: Array) -> Array:
    """Points (..., n, 3) with `shift` (..., 3) taken off those that are `on` the body."""
    return points - np.where(on[:, None], shift[..., None, :], 0.0)
