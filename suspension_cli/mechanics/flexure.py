"""What a wire that bends and twists adds to a taut string, in any pose.

The wire leaves its clamps along directions fixed in its two bodies.  Seen along its chord e (the unit vector between its ends) it starts
with a slope a and ends with a slope b in each principal plane p, and is twisted by phi; a beam under the tension of the string stores

    E = sum over p of (S_uu a_p^2 + 2 S_ul a_p b_p + S_ll b_p^2) / 2 + kappa phi^2 / 2,     a_p = -e . n_p (upper body), b_p = -e . n_p (lower body),

to second order in the slopes, with S the static stiffness of `mechanics.beam` against turning its ends (the chord held), n_p the unit
vectors of the planes, fixed in the bodies across the clamps, and phi = (n_1' . m_2 - n_2' . m_1) / 2 (the sine of the twist; m of the
upper, n' of the lower body).  All three are invariant: turning everything costs nothing.  For wires clamped along their chord all slopes
vanish at rest; then only products of first derivatives count, else the second derivatives below, weighted with the moments.

    d(a) = -(n - (n.e) e) . dr / L - e . dn,      d2(a) = dr . (e n_+ + n_+ e + (e.n) P) . dr / L^2 - 2 dr . P . dn / L - e . d2(n),

with r the span, L its length, P = 1 - e e, n_+ = P n, and of dn and d2(n) what a rotation does to a vector (see `mechanics.geometric`).
S is taken at the tension in equilibrium: how it changes with a slight stretching counts only in third order.

A string bends without resistance, but a design may say how much it resists being twisted (`torsion`): then it adds kappa phi^2 / 2 alone, with planes
across the line that it hangs along in the nominal pose.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from suspension_cli.design.scene import Flex, Scene, Wires
from suspension_cli.mechanics import string
from suspension_cli.mechanics.fibre import Strand, fitted, kinds
from suspension_cli.mechanics.geometric import add_arms
from suspension_cli.mechanics.pose import Layout, Pose
from suspension_cli.rotations import cross, cross_matrix


def flexible(scene: Scene, tension: Any = None, length: Any = None) -> Scene:
    """A scene whose wires bend and twist, with the stiffness that they have under a tension and at a length (..., w), by default the nominal ones."""
    assert scene.fibres is not None
    wires = scene.wires
    shape = (*scene.batch, len(wires.label))
    tension, length = wires.tension if tension is None else tension, wires.length if length is None else length
    taut, long, k = (np.broadcast_to(v, shape) for v in (tension, length, wires.stiffness))
    bend, twist = np.empty((*shape, 2, 3)), np.empty(shape)
    given = np.broadcast_to(wires.torsion, shape)
    for alike in kinds(scene.fibres.wire, taut, long, k, given):
        own = (..., alike[0])
        pull = np.ravel(taut[own])
        hung = fitted(scene.fibres.wire[alike[0]], np.ravel(long[own]), np.ravel(k[own]), pull, np.ravel(given[own]))
        strand = Strand(hung, pull, massive=False, lossy=False)
        for plane, part in enumerate(("bend-1", "bend-2")):
            bend[..., alike, plane, :] = _turning(strand.resting(part)).reshape(*scene.batch, 1, 3)
        twist[..., alike] = (strand.resting("twist")[1, 1] / 4).reshape(*scene.batch, 1)
    planes = np.array([fibre.plane for fibre in scene.fibres.wire]).reshape(-1, 3)
    clamps = np.array([fibre.clamp for fibre in scene.fibres.wire]).reshape(-1, 2, 3)
    upper, lower = (_planes(planes, clamps[:, end]) for end in (0, 1))
    return replace(scene, flex=Flex(upper, lower, bend, twist))


def resisting(scene: Scene) -> Flex | None:
    """What the wires of a scene add to taut strings: where they bend and twist, or where a design gives strings a torsion; None if nothing."""
    wires = scene.wires
    if scene.flex is not None or not wires.torsion.any():
        return scene.flex
    along = wires.span / wires.length[..., None]
    across = np.where(np.abs(along[..., :1]) < 0.9, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    planes = _planes(across, along)
    return Flex(planes, planes, None, wires.torsion)


def _turning(stiffness: Any) -> Any:
    """S_uu, S_ul, S_ll (f, 3): against slopes a and b of the ends with no displacement, T_s = (b - a) / 2 and T_a = (a + b) / 2."""
    even, odd, mixed = stiffness[1, 1], stiffness[3, 3], stiffness[1, 3]
    return np.stack([even + odd - 2 * mixed, odd - even, even + odd + 2 * mixed], axis=-1) / 4


def _planes(plane: Any, clamp: Any) -> Any:
    """The unit vectors (..., 2, 3) of the two principal planes across clamps, all (..., 3)."""
    first = plane - (plane * clamp).sum(-1, keepdims=True) * clamp
    first = first / np.sqrt((first**2).sum(-1, keepdims=True))
    return np.stack([first, cross(clamp, first)], axis=-2)


def _vectors(scene: Scene, pose: Pose, flex: Flex) -> tuple[Any, Any]:
    """The planes' unit vectors (..., w, 2, 3) at both ends in global axes."""
    wires = scene.wires
    upper, lower = ((pose.rotation[..., body, None, :, :] @ n[..., None])[..., 0] for body, n in ((wires.upper, flex.upper), (wires.lower, flex.lower)))
    return upper, lower


def _slopes(direction: Any, upper: Any, lower: Any) -> tuple[Any, Any, Any]:
    """a and b (..., w, 2), and the sine of the twist (..., w)."""
    a, b = (-(direction[..., None, :] * n).sum(-1) for n in (upper, lower))
    twist = ((lower[..., 0, :] * upper[..., 1, :]).sum(-1) - (lower[..., 1, :] * upper[..., 0, :]).sum(-1)) / 2
    return a, b, twist


def energy(scene: Scene, pose: Pose) -> Any:
    """Energy of bending and twisting of all wires, J, shape ``batch``."""
    flex = resisting(scene)
    if flex is None:
        return np.zeros(scene.batch)
    a, b, twist = _slopes(string.state(scene, pose).direction, *_vectors(scene, pose, flex))
    twisted = (flex.twist * twist**2).sum(-1) / 2
    if flex.bend is None:
        return twisted
    bent = flex.bend[..., 0] * a**2 + 2 * flex.bend[..., 1] * a * b + flex.bend[..., 2] * b**2
    return bent.sum((-2, -1)) / 2 + twisted


def add(scene: Scene, numbering: Layout, pose: Pose, gradient: Any, hessian: Any, outer: Any, on_tips: Any) -> None:
    """Add gradient (..., N), Hessian (..., N + 1, N + 1), forces times arms and forces on blade tips of bent and twisted wires, in place.

    First against r and the rotations of the upper and the lower body (9 a wire), then against the coordinates that these follow from.
    """
    wires, now, flex = scene.wires, string.state(scene, pose), resisting(scene)
    if flex is None:
        return
    planes = _vectors(scene, pose, flex)
    first = np.zeros((*now.direction.shape[:-1], 9), dtype=scene.kind)
    second = np.zeros((*now.direction.shape[:-1], 9, 9), dtype=scene.kind)
    if flex.bend is not None:
        _bent(wires, flex.bend, now, planes, first, second, outer)
    _twisted(wires, flex.twist, planes, first, second, outer)
    pull = first[..., :3]
    add_arms(outer, wires.lower, pull, now.lower_arm)
    add_arms(outer, wires.upper, -pull, now.upper_arm)
    on_tips -= (np.arange(on_tips.shape[-2])[:, None] == wires.blade).astype(float) @ pull
    ends = _followed(scene, pose, now)
    back = np.swapaxes(ends, -1, -2)
    forces, stiffness = (back @ first[..., None])[..., 0], back @ second @ ends
    for pair in np.unique(np.stack([wires.upper, wires.lower]), axis=1).T:
        own = (wires.upper == pair[0]) & (wires.lower == pair[1])
        force, matrix = forces[..., own, :12].sum(-2), stiffness[..., own, :12, :12].sum(-3)
        for i, one in enumerate(pair):
            gradient[..., 6 * one : 6 * one + 6] += force[..., 6 * i : 6 * i + 6]
            for j, other in enumerate(pair):
                hessian[..., 6 * one : 6 * one + 6, 6 * other : 6 * other + 6] += matrix[..., 6 * i : 6 * i + 6, 6 * j : 6 * j + 6]
    for n in np.flatnonzero(wires.blade >= 0):
        tip = numbering.blade[wires.blade[n]]
        moves = np.flatnonzero(tip < numbering.size)
        bodies = (6 * np.array([[wires.upper[n]], [wires.lower[n]]]) + np.arange(6)).ravel()
        rows, block = tip[moves], stiffness[..., n, 12 + moves, :]
        gradient[..., rows] += forces[..., n, 12 + moves]
        hessian[..., rows[:, None], rows] += block[..., 12 + moves]
        hessian[..., rows[:, None], bodies] += block[..., :12]
        hessian[..., bodies[:, None], rows] += np.swapaxes(block[..., :12], -1, -2)


def _bent(wires: Wires, bend: Any, now: string.State, ends: tuple[Any, Any], first: Any, second: Any, outer: Any) -> None:
    """Add gradient (..., w, 9) and Hessian (..., w, 9, 9) of bending, in place; what the planes' vectors hold as arms goes to `outer`."""
    e, over = now.direction, 1 / now.length
    a, b, _ = _slopes(e, *ends)
    moments = (bend[..., 0] * a + bend[..., 1] * b, bend[..., 1] * a + bend[..., 2] * b)
    across = np.eye(3) - e[..., :, None] * e[..., None, :]  # P
    rows = np.zeros((*e.shape[:-1], 2, 2, 9), dtype=e.dtype)  # end, plane: derivatives of the slopes
    for side, (n, body, turn) in enumerate(zip(ends, (wires.upper, wires.lower), (slice(3, 6), slice(6, 9)), strict=True)):
        for plane in (0, 1):
            normal, moment = n[..., plane, :], moments[side][..., plane]
            along = (normal * e).sum(-1)
            flat = normal - along[..., None] * e  # n_+
            rows[..., side, plane, :3], rows[..., side, plane, turn] = -flat * over[..., None], cross(e, normal)
            product = e[..., :, None] * flat[..., None, :]
            curve = product + np.swapaxes(product, -1, -2) + along[..., None, None] * across
            second[..., :3, :3] += (moment * over**2)[..., None, None] * curve
            mixed = (moment * over)[..., None, None] * (across @ cross_matrix(normal))
            second[..., :3, turn] += mixed
            second[..., turn, :3] += np.swapaxes(mixed, -1, -2)
            first += moment[..., None] * rows[..., side, plane, :]
            add_arms(outer, body, -moment[..., None] * e, normal)
    form = np.stack([bend[..., :2], bend[..., 1:]], axis=-3)  # end, plane, end
    held = (form[..., None] * np.swapaxes(rows, -3, -2)[..., None, :, :, :]).sum(-2)
    flat_rows = rows.reshape(*e.shape[:-1], 4, 9)
    second += np.swapaxes(flat_rows, -1, -2) @ held.reshape(*e.shape[:-1], 4, 9)


def twist_forms(scene: Scene, pose: Pose, flex: Flex) -> Any:
    """How the twist of each wire goes with the rotations of its upper and its lower body, (..., w, 6)."""
    return _twist_forms(*_vectors(scene, pose, flex))


def _twist_forms(upper: Any, lower: Any) -> Any:
    """d(phi) = t . (n_1' x m_2 - n_2' x m_1) / 2 for a rotation t of the lower body less that of the upper one."""
    row = (cross(lower[..., 0, :], upper[..., 1, :]) - cross(lower[..., 1, :], upper[..., 0, :])) / 2
    return np.concatenate([-row, row], axis=-1)


def _twisted(wires: Wires, stiffness: Any, ends: tuple[Any, Any], first: Any, second: Any, outer: Any) -> None:
    """The same of twisting."""
    upper, lower = ends
    _, _, twist = _slopes(upper[..., 0, :], upper, lower)
    torque, turn = stiffness * twist, _twist_forms(upper, lower)
    first[..., 3:] += torque[..., None] * turn
    second[..., 3:, 3:] += stiffness[..., None, None] * turn[..., :, None] * turn[..., None, :]
    mixed = upper[..., 0, :, None] * lower[..., 1, None, :] - upper[..., 1, :, None] * lower[..., 0, None, :]
    mixed = torque[..., None, None] * (twist[..., None, None] * np.eye(3) + mixed / 2)  # lower, upper
    second[..., 6:, 3:6] += mixed
    second[..., 3:6, 6:] += np.swapaxes(mixed, -1, -2)
    for sign, low, up in ((0.5, 0, 1), (-0.5, 1, 0)):
        add_arms(outer, wires.lower, sign * torque[..., None] * upper[..., up, :], lower[..., low, :])
        add_arms(outer, wires.upper, sign * torque[..., None] * lower[..., low, :], upper[..., up, :])


def _followed(scene: Scene, pose: Pose, now: string.State) -> Any:
    """r and the two rotations (..., w, 9, 15) from shift and rotation of the upper and the lower body, and from the blade's tip."""
    wires = scene.wires
    result = np.zeros((*now.direction.shape[:-1], 9, 15), dtype=now.direction.dtype)
    result[..., :3, :3], result[..., :3, 6:9] = -np.eye(3), np.eye(3)
    result[..., :3, 3:6], result[..., :3, 9:12] = cross_matrix(now.upper_arm), -cross_matrix(now.lower_arm)
    result[..., 3:6, 3:6] = result[..., 6:, 9:12] = np.eye(3)
    result[..., :3, 12:] = np.where((wires.blade >= 0)[:, None, None], -pose.rotation[..., wires.upper, :, :], 0.0)
    return result
