"""Clamps of wires of which the design gives the effective bending points.

A wire whose far end is displaced sideways acts on its clamp with a shear force V and a moment M, as
if it were hinged at u = M / V from there (sqrt(EI / T) for a long uniform one; Gonzalez and
Saulson, J. Acoust. Soc. Am. 96, 207 (1994)). So the clamps lie u beyond the bending points, in line
with the wire, which leaves the forces that carry the weight unchanged. For a ribbon u is taken in
its soft plane.

Tension, length and direction of a wire are those of the nominal suspension: imperfections change
them, but not a clamp that is there already. Where the design gives natural lengths, they are those
of strings without torsion that hang between the bending points, in the pose that is solved for.
The clamps are then fixed in their bodies along these strings, and an unstretched wire is longer by
both u: nothing depends on where the file draws the bodies.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.elements import bending, joined_sections, string
from suspension_cli.elements.dynamic_wire import TautWire, fit_to_equilibrium, group_identical
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.equilibrium.nominal import (
    drop_complex_step,
    expand_nominal,
    first_order_pose,
)
from suspension_cli.equilibrium.solve import Equilibrium
from suspension_cli.errors import InputError
from suspension_cli.scene import fibres as fibres_of
from suspension_cli.scene.composition import Fibre, Fibres, Section
from suspension_cli.scene.pose import layout
from suspension_cli.scene.scene import Scene, Wires

if TYPE_CHECKING:
    from jaxtyping import Bool, Inexact

ITERATIONS = 4
"""Iterations of the distance u from clamp to hinge; each reduces the change by the factor u / l."""
MIRRORED = 1e-9
"""Relative difference, left by Newton's method, up to which wires at mirrored points hang alike."""
ALONG_X = 1e-6
"""Squared sine of the angle to x, below which the first plane of a wire is that of y instead."""


@dataclass(frozen=True)
class HangingWires:
    """Wires of a suspension as they hang, as strings between the points that the design gives.

    Attributes
    ----------
    found : Equilibrium
        Of these strings, without complex steps.
    length, tension
        m and N; NaN, like all that follows, where there is no equilibrium on taut wires.
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


def to_clamps(scene: Scene) -> tuple[Scene, HangingWires | None]:
    """Move the ends of wires to their clamps, where the design gives the bending points instead.

    Those of the nominal scene of an imperfect one too.

    Parameters
    ----------
    scene : Scene
        With `fibres`, and at most one batch axis.

    Returns
    -------
    scene : Scene
        With the principal planes of its wires in `flex`.
    hanging : HangingWires or None
        Wires of the nominal scene, where the clamps follow from a pose that is solved for; lengths
        are those between clamps.

    Raises
    ------
    InputError
        If this pose is that of a single scene and does not exist, or a wire is slack in it.
    """
    fibres = scene.fibres
    assert fibres is not None
    drawn = None if scene.drawn is None else replace(scene.drawn, fibres=fibres)
    nominal, hanging = drawn or scene, None
    effective = np.array([fibre.effective for fibre in fibres.wire], dtype=bool)
    u: Any = 0.0
    if effective.any():
        hanging = hang(nominal) if fibres.solves_pose else None
        u = _all_distances(nominal, hanging)

    def moved(one: Scene) -> Scene:
        if effective.any():
            one = replace(one, wires=_lengthened(one.wires, u, effective, hanging))
        one = bending.with_planes(one)
        return one if hanging is None else _with_hanging_planes(one, effective, hanging)

    scene = replace(moved(scene), drawn=None if drawn is None else moved(drawn))
    return scene, hanging and replace(hanging, length=hanging.length + u.sum(-1))


def compose(design: Design) -> Fibres:
    """List the composition of wires and blades, as `fibres.compose` does.

    The tension that wires of some weight have along them follows from the slope at which they hang.
    """
    made = fibres_of.compose(design)
    if not (made.solves_pose and design.constants.wire_weight):
        return made
    try:
        nominal = expand_nominal(design)
        hanging = hang(nominal)
    except InputError:  # whoever needs its equilibrium reports it
        return made
    slopes = hanging.rise * nominal.wires.length / nominal.wires.span[..., 2]
    wires = (
        replace(
            fibre,
            sections=tuple(
                replace(own, tension_offset=own.tension_offset * slope) for own in fibre.sections
            ),
        )
        for fibre, slope in zip(made.wire, slopes.tolist(), strict=True)
    )
    return replace(made, wire=tuple(wires))


def hang(scene: Scene) -> HangingWires:
    """Find the wires of a scene as they hang, as strings between the given points.

    Exactly equal where wires are mirror images, so that the clamps keep the symmetry.

    Raises
    ------
    InputError
        If a single scene has no equilibrium, or a wire is slack in it.
    """
    wires = scene.wires
    strings = replace(
        scene, fibres=None, flex=None, wires=replace(wires, torsion=np.zeros_like(wires.torsion))
    )
    numbering, plain = layout(strings), strings
    if np.issubdtype(strings.kind, np.complexfloating):
        plain = drop_complex_step(strings)
    found = equilibrium.solve(plain, numbering)
    if not scene.batch:
        found.demand(plain)
    pose = found.pose if plain is strings else first_order_pose(strings, numbering, found.pose)
    now = string.state(strings, pose)
    turn = np.swapaxes(pose.rotation, -1, -2)
    numbers = [now.length[..., None], now.tension[..., None], now.direction[..., 2:]]
    for body in (wires.upper, wires.lower):
        numbers.append((turn[..., body, :, :] @ now.direction[..., None])[..., 0])
    each = _equal_if_mirrored(scene, np.concatenate(numbers, axis=-1))
    taut = found.converged & (found.tension > 0).all(-1)
    each = np.where(np.asarray(taut)[..., None, None], each, np.nan)
    return HangingWires(
        found, *(each[..., n] for n in range(3)), upper=each[..., 3:6], lower=each[..., 6:]
    )


def _equal_if_mirrored(
    scene: Scene, numbers: Inexact[np.ndarray, "*batch wire 9"]
) -> Inexact[np.ndarray, "*batch wire 9"]:
    """Make lengths, tensions and directions of wires at mirrored points equal but for their signs.

    Only where the difference is rounding.
    """
    wires = scene.wires
    bodies = np.stack([wires.upper, wires.lower], axis=-1)
    own = (bodies[:, None] == bodies).all(-1)
    points = np.concatenate(
        [wires.upper_point, wires.lower_point, wires.stiffness[..., None]], axis=-1
    )
    for axis in (0, 1):
        flip = np.where(np.arange(3) == axis, -1.0, 1.0)
        mirror = np.concatenate([flip, flip, [1.0]])
        same = own & (points[..., :, None, :] == (points * mirror)[..., None, :, :]).all(-1)
        paired = ((same.sum(-1) == 1) & (same.sum(-2) == 1)).all(-1)
        images = same.astype(float) @ numbers * np.concatenate([np.ones(3), flip, flip])
        even = (numbers + images) / 2
        alike = (
            paired
            & _close(np.real(even), np.real(numbers))
            & _close(np.imag(even), np.imag(numbers))
        )
        numbers = np.where(alike[..., None, None], even, numbers)
    return numbers


def _close(
    even: Inexact[np.ndarray, "*batch wire 9"], numbers: Inexact[np.ndarray, "*batch wire 9"]
) -> Bool[np.ndarray, "*batch"]:
    """Whether all numbers are as even as rounding lets them be."""
    scale = np.abs(numbers).max(-2, keepdims=True)
    scale[..., 2:] = scale[..., 2:].max(-1, keepdims=True)  # components of unit vectors
    return (np.abs(even - numbers) <= MIRRORED * scale).all((-2, -1))


def _lengthened(
    wires: Wires,
    u: Inexact[np.ndarray, "*batch wire 2"],
    effective: Bool[np.ndarray, " wire"],
    hanging: HangingWires | None,
) -> Wires:
    """Wires between clamps at the distances `u` beyond their ends."""
    if hanging is None:
        e, extra = wires.span / wires.length[..., None], u.sum(-1)
        return replace(
            wires,
            upper_point=wires.upper_point - u[..., :1] * e,
            lower_point=wires.lower_point + u[..., 1:] * e,
            span=wires.span + extra[..., None] * e,
            length=wires.length + extra,
        )
    extra, whole = u.sum(-1), wires.length + u.sum(-1)
    above = np.where(effective[:, None], u[..., :1] * hanging.upper, 0.0)
    below = np.where(effective[:, None], u[..., 1:] * hanging.lower, 0.0)
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


def _with_hanging_planes(
    scene: Scene, effective: Bool[np.ndarray, " wire"], hanging: HangingWires
) -> Scene:
    """Turn the principal planes of wires with bending points to their clamps as these hang."""
    flex = scene.flex
    assert flex is not None
    along_x = np.real(1 - hanging.upper[..., :1] ** 2) < ALONG_X
    across = np.where(along_x, np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0]))
    upper, lower = (
        np.where(effective[:, None, None], bending.principal_planes(across, clamp), given)
        for clamp, given in ((hanging.upper, flex.upper), (hanging.lower, flex.lower))
    )
    return replace(scene, flex=replace(flex, upper=upper, lower=lower))


def _all_distances(
    nominal: Scene, hanging: HangingWires | None
) -> Inexact[np.ndarray, "*batch wire 2"]:
    """Distances of the bending points of all wires from their clamps, m; 0 of other wires."""
    fibres, wires = nominal.fibres, nominal.wires
    assert fibres is not None
    kind = np.result_type(nominal.kind, *(s.rigidity[0] for f in fibres.wire for s in f.sections))
    shape = (*nominal.batch, len(wires.label))
    result = np.zeros((*shape, 2), dtype=kind)
    at = wires if hanging is None else hanging
    numbers = [np.broadcast_to(v, shape) for v in (at.length, wires.stiffness, at.tension)]
    for group in group_identical(fibres.wire, *numbers):
        fibre = fibres.wire[group[0]]
        if fibre.effective:
            own = [v[..., group[0]] for v in numbers]
            if nominal.batch and kind == np.float64:
                distance = _batch_distances(fibre, *own)
            elif nominal.batch:
                distance = _hinge_distances(fibre, *own)
            else:
                distance = _known_distances(fibre.sections, *(v.item() for v in own))
            result[..., group, :] = distance[..., None, :]
    return result


@lru_cache(maxsize=bending.KNOWN)
def _known_distances(
    sections: tuple[Section, ...], *numbers: complex
) -> Inexact[np.ndarray, "*batch 2"]:
    """Hinge distances (2,) of one wire; most do not change from one design to the next."""
    found = _hinge_distances(bending.bare_fibre(sections), *map(np.asarray, numbers))
    return found if np.imag(found).any() else np.real(found)


def _batch_distances(fibre: Fibre, length: Any, k: Any, tension: Any) -> Any:
    """Hinge distances (p, 2) of a wire in many builds, see `_hinge_distances`."""
    from suspension_cli.compiled import constant  # takes half a second
    from suspension_cli.elements import compiled_wire

    del k  # bending does not depend on it
    result = np.empty((*length.shape, 2))
    compiled_wire.hinge_distances(
        compiled_wire.wire_sections((fibre,)),
        0,
        ITERATIONS,
        constant(length),
        constant(tension),
        result,
    )
    return result


def _hinge_distances(
    fibre: Fibre,
    length: Inexact[np.ndarray, "*batch"],
    k: Inexact[np.ndarray, "*batch"],
    tension: Inexact[np.ndarray, "*batch"],
) -> Inexact[np.ndarray, "*batch 2"]:
    """Distances (..., 2) of the hinges of a wire from its upper and its lower clamp, m.

    Parameters
    ----------
    fibre : Fibre
    length
        Between the hinges, m.
    k, tension
        N/m and N.
    """
    upper = lower = np.zeros(length.size)
    for _ in range(ITERATIONS):
        whole = fit_to_equilibrium(
            fibre, length.ravel() + upper + lower, k.ravel(), tension.ravel(), 0.0
        )
        strand = TautWire(whole, tension.ravel(), massive=False, lossy=False)
        stiffness = joined_sections.to_ends(strand.resting("bend-1"))  # of w_1, w'_1, w_2, w'_2
        upper, lower = stiffness[1, 2] / stiffness[0, 2], stiffness[3, 0] / stiffness[2, 0]
        upper, lower = (ratio * np.sign(ratio.real) for ratio in (upper, lower))
    return np.stack([upper, lower], axis=-1).reshape(*length.shape, 2)
