"""Poses of suspensions of given natural lengths, in which all wires hang as strings.

Such a suspension hangs where its wires let it. Bending points (`clamps`, `hinges`) and the tensions
to which imperfect wires are trimmed are those of that pose, not of the drawing in the file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.imperfections import perturbed, perturbed_part
from suspension_cli.design.schema import Perturbation
from suspension_cli.elements import taut_string
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.solve import Equilibrium
from suspension_cli.scene import applied_imperfections
from suspension_cli.scene.scene import Scene, Wires

if TYPE_CHECKING:
    from jaxtyping import Bool, Inexact
    from numpy.typing import ArrayLike


@dataclass(frozen=True)
class HangingWires:
    """Wires of a suspension in equilibrium, as strings between the given points.

    Attributes
    ----------
    found : Equilibrium
        Of these strings.
    length, tension
        m and N; NaN, as all below, where there is no equilibrium on taut wires.
    rise
        Upward component of the unit vector along each wire towards its lower end.
    upper, lower
        This vector in the frames of the two bodies.
    """

    found: Equilibrium
    length: Inexact[np.ndarray, "*batch wire"]
    tension: Inexact[np.ndarray, "*batch wire"]
    rise: Inexact[np.ndarray, "*batch wire"]
    upper: Inexact[np.ndarray, "*batch wire 3"]
    lower: Inexact[np.ndarray, "*batch wire 3"]


def hang(scene: Scene) -> HangingWires:
    """Find the wires of a scene in equilibrium, as strings between the given points.

    Raises `InputError` if a single scene has none, or a wire is slack in it.
    """
    found = _balance_strings(scene)
    if not scene.batch:
        found.demand(scene)
    now = taut_string.state(scene, found.pose)
    turn = np.swapaxes(found.pose.rotation, -1, -2)
    upper, lower = (
        (turn[..., body, :, :] @ now.direction[..., None])[..., 0]
        for body in (scene.wires.upper, scene.wires.lower)
    )
    taut = np.asarray(found.converged & (found.tension > 0).all(-1))[..., None]
    numbers = (np.where(taut, n, np.nan) for n in (now.length, now.tension, now.direction[..., 2]))
    vectors = (np.where(taut[..., None], own, np.nan) for own in (upper, lower))
    return HangingWires(found, *numbers, *vectors)


def _balance_strings(scene: Scene) -> Equilibrium:
    """Balance strings without torsion between the given points."""
    wires = replace(scene.wires, torsion=np.zeros_like(scene.wires.torsion))
    return equilibrium.solve_once(replace(scene, fibres=None, flex=None, wires=wires))


def lengthened(
    wires: Wires,
    u: Inexact[np.ndarray, "*batch wire 2"],
    effective: Bool[np.ndarray, "... wire"],
    hanging: HangingWires | None,
) -> Wires:
    """Move the ends of wires along them, by the distances `u` away from each other.

    With `hanging` only those of `effective` wires.
    """
    if hanging is None:
        e = wires.span / wires.length[..., None]
        extra = u.sum(-1)
        return replace(
            wires,
            upper_point=wires.upper_point - u[..., :1] * e,
            lower_point=wires.lower_point + u[..., 1:] * e,
            span=wires.span + extra[..., None] * e,
            length=wires.length + extra,
        )
    extra = u.sum(-1)
    whole = wires.length + u.sum(-1)
    above = np.where(effective[..., None], u[..., :1] * hanging.upper, 0.0)
    below = np.where(effective[..., None], u[..., 1:] * hanging.lower, 0.0)
    added = above + below
    span = wires.span + added
    length = np.where(effective, np.sqrt((span**2).sum(-1)), wires.length)
    # |span + added|^2 - (length + extra)^2: no large numbers cancel
    longer = (
        2 * ((wires.span * added).sum(-1) - wires.length * extra) + (added**2).sum(-1) - extra**2
    ) / (length + whole)
    return replace(
        wires,
        upper_point=wires.upper_point - above,
        lower_point=wires.lower_point + below,
        span=span,
        length=length,
        tension=wires.tension + wires.stiffness * longer,
    )


def apply(scene: Scene, item: Perturbation, *, trim: bool = True) -> Scene:
    """Apply one `[[perturbation]]` of a design file to a scene, see `impose`.

    Without `trim` tensions are not those of the pose in which the suspension hangs: nothing is
    balanced.
    """
    part, name = perturbed_part(item)
    given = {row.name: getattr(item, row.name) for row in perturbed(part)}
    amounts = {name: amount for name, amount in given.items() if amount is not None}
    number = applied_imperfections.members(scene, part)[name]
    act = impose if trim else applied_imperfections.impose
    return act(scene, part, number, amounts, item.hold)


def impose(
    scene: Scene,
    part: str,
    number: int,
    amounts: Mapping[str, ArrayLike],
    hold: str = "loaded-length",
) -> Scene:
    """Apply imperfections of one part to a scene, see `scene.applied_imperfections.impose`.

    Where natural lengths are given, a wire is trimmed in the pose in which the nominal scene hangs;
    raises `InputError` if that of a single scene does not exist.
    """
    result = applied_imperfections.impose(scene, part, number, amounts, hold)
    if not scene.solves_pose or part != "wire" or hold != "loaded-length":
        return result
    nominal = scene.drawn or scene
    found = _balance_strings(nominal)
    pose = found.pose
    if not (nominal.batch or found.converged):
        found.demand(nominal)
    # a COM that was moved in its body is elsewhere in the pose, too
    moved = scene.bodies.position - nominal.bodies.position
    pose = replace(pose, shift=pose.shift + (pose.turn @ moved[..., None])[..., 0])
    before, after = (
        one.wires.stiffness[..., number] * taut_string.state(one, pose).elongation[..., number]
        for one in (scene, result)
    )
    tension = result.wires.tension.astype(np.result_type(result.wires.tension, before))
    tension[..., number] += np.where(found.converged, before - after, np.nan)
    return replace(result, wires=replace(result.wires, tension=tension))
