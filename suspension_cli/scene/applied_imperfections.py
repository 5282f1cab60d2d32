"""Imperfections: errors of a build in one part, applied to a scene.

Scenes may have batch axes, amounts any batch shape. `design.imperfections` has the table of names,
units and neutral values.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.conventions import SUPPORT
from suspension_cli.design.towers import SUFFIX
from suspension_cli.rotations import rotation_matrix
from suspension_cli.scene.arrays import Array, Part, frames, inner_axes
from suspension_cli.scene.scene import Scene, Wires

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def members(scene: Scene, part: str) -> dict[str, int]:
    """Map the names of all parts of a kind to their numbers.

    Wires, blades and legs count from 0, bodies from 1, links as springs of the scene. Blades of a
    filter have the name of its stage, and their number as a spring behind those of other blades.
    """
    if part == "body":
        return {name: n for n, name in enumerate((SUPPORT, *scene.bodies.name))}
    labels = {"wire": scene.wires, "blade": scene.blades, "leg": scene.struts}
    names: tuple[str, ...] = labels[part].label if part in labels else ()
    found: dict[str, int] = {label: n for n, label in enumerate(names)}
    ending = {"blade": f"{SUFFIX}.blades", "link": ".link"}.get(part)
    for n, label in enumerate(scene.springs.label, len(names)):
        if ending is not None and label.endswith(ending):
            found[label.removesuffix(ending)] = n
    return found


def impose(
    scene: Scene,
    part: str,
    number: int,
    amounts: Mapping[str, ArrayLike],
    hold: str = "loaded-length",
) -> Scene:
    """Apply imperfections of one part to a scene.

    `part` is one of `PARTS`, with a number from `members`; `amounts` are arrays (...) or (..., 3)
    by name of `design.imperfections`; `hold` is explained at `wire`.
    """
    if part == "wire":
        return wire(scene, number, **amounts, hold=hold)
    for name, amount in amounts.items():
        if name in ACTIONS:
            scene = ACTIONS[name](scene, number, amount)
        else:
            scene = scale(scene, part, number, amount)
    return scene


def wire(
    scene: Scene,
    number: int,
    *,
    k_factor: ArrayLike = 1.0,
    radius_factor: ArrayLike = 1.0,
    upper_offset: ArrayLike = (0.0, 0.0, 0.0),
    lower_offset: ArrayLike = (0.0, 0.0, 0.0),
    length_change: ArrayLike = 0.0,
    hold: str = "loaded-length",
) -> Scene:
    """Change one wire of a scene (from 0).

    Its spring constant by `k_factor` and the square of `radius_factor`, its ends by offsets
    (..., 3), its unstretched length, after trimming, by `length_change`, in m. The wire is first
    trimmed to its nominal tension T in the nominal pose (`hold` is ``"loaded-length"``), or keeps
    its unstretched length l - T / k (``"natural-length"``). With its new spring constant k' and
    span L in the nominal pose, its tension there is T, or k' (T / k + L - l), less k' times the
    change of length.
    """
    old = {name: _member(scene.wires, name, number) for name in inner_axes(Wires)}
    upper = _numbers(upper_offset)
    lower = _numbers(lower_offset)
    change = _numbers(length_change)
    shift = lower - upper
    span = old["span"] + shift
    length = np.sqrt((span**2).sum(-1))
    # L - l without cancellation: (L^2 - l^2) / (L + l)
    longer = (shift * (2 * old["span"] + shift)).sum(-1) / (length + old["length"])
    k = old["stiffness"] * _numbers(k_factor) * _numbers(radius_factor) ** 2
    tension = old["tension"] - k * change
    if hold == "natural-length":
        tension = k * (old["tension"] / old["stiffness"] + longer - change)
    return _with(
        scene,
        "wires",
        number,
        upper_point=old["upper_point"] + upper,
        lower_point=old["lower_point"] + lower,
        span=span,
        length=length,
        tension=tension,
        stiffness=k,
    )


def move_com(scene: Scene, number: int, offset: ArrayLike) -> Scene:
    """Move the COM of one body (from 1) relative to its attachments by an offset (..., 3), m.

    The inertia is about the new COM.
    """
    shift = _numbers(offset)

    def moved(part: Part) -> Part:
        points = {}
        for name, frame in frames(type(part)).items():
            on = getattr(part, frame) == number
            step = shift.reshape(*shift.shape[:-1], *(1,) * on.ndim, 3)
            points[name] = getattr(part, name) - np.where(on[..., None], step, 0.0)
        return replace(part, **points)

    position = scene.bodies.position[..., number, :] + shift
    scene = _with(scene, "bodies", number, position=position)
    return scene.with_parts({name: moved(part) for name, part in scene.parts.items()})


def turn_mass(scene: Scene, number: int, rotation: ArrayLike) -> Scene:
    """Turn the mass of one body (from 1) relative to its attachments.

    Its inertia becomes R I R^T, with the rotation R by the vector `rotation` (..., 3), rad.
    """
    turn = rotation_matrix(_numbers(rotation))
    inertia = turn @ _member(scene.bodies, "inertia", number - 1) @ np.swapaxes(turn, -1, -2)
    inertia = (inertia + np.swapaxes(inertia, -1, -2)) / 2
    return _with(scene, "bodies", number - 1, inertia=inertia)


def scale_inertia(scene: Scene, number: int, factor: ArrayLike) -> Scene:
    """Multiply the moments of inertia of one body (from 1) by factors (..., 3).

    Products of inertia scale with the geometric mean of the two factors.
    """
    root = np.sqrt(_numbers(factor))
    return _scaled(scene, "bodies", "inertia", number - 1, root[..., :, None] * root[..., None, :])


def scale(scene: Scene, part: str, number: int, factor: ArrayLike) -> Scene:
    """Multiply the mass of a body, or the stiffness of another part, by a factor (...).

    Wires keep unstretched lengths, and springs their preloads. Blades are trimmed to their nominal
    load in the nominal pose; those of a filter and the flexures of a leg are springs.
    """
    home = {"body": "bodies", "blade": "blades"}.get(part, "springs")
    if part == "body":
        number -= 1
    elif part == "leg":
        number = scene.springs.label.index(scene.struts.label[number])
    elif part == "blade" and number >= len(scene.blades.label):
        home = "springs"
        number = number - len(scene.blades.label)
    name = "mass" if part == "body" else "stiffness"
    axes = inner_axes(type(scene.parts[home]))[name] - 1
    return _scaled(scene, home, name, number, _numbers(factor)[(..., *[None] * axes)])


def lengthen_leg(scene: Scene, number: int, change: ArrayLike) -> Scene:
    """Change the unloaded length of one leg (from 0) by (...), m."""
    struts = scene.struts
    tension = struts.tension[..., number] - struts.stiffness[..., number] * _numbers(change)
    return _with(scene, "struts", number, tension=tension)


ACTIONS = {
    "com_offset": move_com,
    "rotation": turn_mass,
    "inertia_factor": scale_inertia,
    "length_change": lengthen_leg,
}
"""How imperfections act on a scene, but those of a wire, see `wire`, and those that `scale`."""


def _numbers(values: ArrayLike) -> Array:
    return np.asarray(values, dtype=float)


def _member(part: Any, name: str, number: int) -> Array:
    """One array of a member of a part."""
    values = getattr(part, name)
    return values.take(number, values.ndim - inner_axes(type(part))[name])


def _scaled(scene: Scene, part: str, name: str, number: int, factor: Array) -> Scene:
    """Multiply one array of a member of a part."""
    value = _member(scene.parts[part], name, number)
    return _with(scene, part, number, **{name: value * factor})


def _with(scene: Scene, part: str, number: int, **items: Array) -> Scene:
    """Replace member `number` of arrays of a part of a scene, batch axes broadcast."""
    old = scene.parts[part]
    changed = {}
    for name, item in items.items():
        values = getattr(old, name)
        inner = inner_axes(type(old))[name]
        batch = np.broadcast_shapes(values.shape[:-inner], item.shape[: item.ndim - inner + 1])
        changed[name] = np.broadcast_to(values, batch + values.shape[-inner:]).copy()
        changed[name][(..., number, *(slice(None),) * (inner - 1))] = item
    result = scene.with_parts({part: replace(old, **changed)})
    return replace(result, drawn=scene.drawn or scene)
