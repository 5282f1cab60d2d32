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
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from suspension_cli.design.scene import Flex, Scene
from suspension_cli.mechanics import string
from suspension_cli.mechanics.fibre import Strand, fitted
from suspension_cli.mechanics.geometric import add_arms
from suspension_cli.mechanics.pose import Layout, Pose
from suspension_cli.rotations import cross_matrix


def flexible(scene: Scene, tension: Any = None, length: Any = None) -> Scene:
    """A scene whose wires bend and twist, with the stiffness that they have under a tension and at a length (..., w), by default the nominal ones."""
    assert scene.fibres is not None
    wires = scene.wires
    shape = (*scene.batch, len(wires.label))
    taut, long, k = (np.broadcast_to(v, shape) for v in (wires.tension if tension is None else tension, wires.length if length is None else length, wires.stiffness))
    bend, twist = np.empty((*shape, 2, 3)), np.empty(shape)
    for number, fibre in enumerate(scene.fibres.wire):
        own = (..., number)
        hung = fitted(fibre, np.ravel(long[own]), np.ravel(k[own]))
        rest = Strand(hung, np.ravel(taut[own]), massive=False, lossy=False).rest
        for plane, part in enumerate(("bend-1", "bend-2")):
            bend[..., number, plane, :] = _turning(rest[part]).reshape(*scene.batch, 3)
        twist[own] = (rest["twist"][1, 1] / 4).reshape(scene.batch)
    planes = [[_planes(fibre.plane, clamp) for clamp in fibre.clamp] for fibre in scene.fibres.wire]
    flex = Flex(*(np.array([p[end] for p in planes]).reshape(-1, 2, 3) for end in (0, 1)), bend, twist)
    return replace(scene, flex=flex)


def _turning(stiffness: Any) -> Any:
    """S_uu, S_ul, S_ll (f, 3): against slopes a and b of the ends with no displacement, T_s = (b - a) / 2 and T_a = (a + b) / 2."""
    even, odd, mixed = stiffness[1, 1], stiffness[3, 3], stiffness[1, 3]
    return np.stack([even + odd - 2 * mixed, odd - even, even + odd + 2 * mixed], axis=-1) / 4


def _planes(plane: Any, clamp: Any) -> Any:
    """The unit vectors (2, 3) of the two principal planes across a clamp."""
    first = plane - (plane @ clamp) * clamp
    first = first / np.sqrt(first @ first)
    return np.array([first, np.cross(clamp, first)])


def _vectors(scene: Scene, pose: Pose) -> tuple[Any, Any]:
    """The planes' unit vectors (..., w, 2, 3) at both ends in global axes."""
    flex, wires = scene.flex, scene.wires
    assert flex is not None
    upper, lower = ((pose.rotation[..., body, None, :, :] @ n[..., None])[..., 0] for body, n in ((wires.upper, flex.upper), (wires.lower, flex.lower)))
    return upper, lower


def _slopes(direction: Any, upper: Any, lower: Any) -> tuple[Any, Any, Any]:
    """a and b (..., w, 2), and the sine of the twist (..., w)."""
    a, b = (-(direction[..., None, :] * n).sum(-1) for n in (upper, lower))
    twist = ((lower[..., 0, :] * upper[..., 1, :]).sum(-1) - (lower[..., 1, :] * upper[..., 0, :]).sum(-1)) / 2
    return a, b, twist


def energy(scene: Scene, pose: Pose) -> Any:
    """Energy of bending and twisting of all wires, J, shape ``batch``."""
    flex = scene.flex
    assert flex is not None
    a, b, twist = _slopes(string.state(scene, pose).direction, *_vectors(scene, pose))
    bent = flex.bend[..., 0] * a**2 + 2 * flex.bend[..., 1] * a * b + flex.bend[..., 2] * b**2
    return bent.sum((-2, -1)) / 2 + (flex.twist * twist**2).sum(-1) / 2


def add(scene: Scene, numbering: Layout, pose: Pose, gradient: Any, hessian: Any, outer: Any, on_tips: Any) -> None:
    """Add gradient (..., N), Hessian (..., N, N), forces times arms and forces on blade tips of bent and twisted wires, in place."""
    flex, wires, now = scene.flex, scene.wires, string.state(scene, pose)
    assert flex is not None
    e, over = now.direction, 1 / now.length[..., None, None]
    upper, lower = _vectors(scene, pose)
    a, b, twist = _slopes(e, upper, lower)
    span = string.span_jacobian(scene, numbering, pose, now)
    turn = {"upper": _turn_jacobian(numbering, wires.upper, upper), "lower": _turn_jacobian(numbering, wires.lower, lower)}
    moments = (flex.bend[..., 0] * a + flex.bend[..., 1] * b, flex.bend[..., 1] * a + flex.bend[..., 2] * b)
    rows = []
    across = np.eye(3) - e[..., :, None] * e[..., None, :]  # P
    for n, body, moment, side in ((upper, wires.upper, moments[0], "upper"), (lower, wires.lower, moments[1], "lower")):
        flat = n - (n * e[..., None, :]).sum(-1, keepdims=True) * e[..., None, :]  # n_+
        by_span = (span[..., :, :, None, :] * (flat * over)[..., None, :, :, :]).sum(-1)
        rows.append(-by_span - (turn[side] * e[..., None, :, None, :]).sum(-1))
        pull = -(moment[..., None] * flat * over).sum(-2)
        add_arms(outer, wires.lower, pull, now.lower_arm)
        add_arms(outer, wires.upper, -pull, now.upper_arm)
        on_tips -= (np.arange(on_tips.shape[-2])[:, None] == wires.blade).astype(float) @ pull
        product = e[..., None, :, None] * flat[..., None, :]
        curve = product + np.swapaxes(product, -1, -2) + (e[..., None, :] * n).sum(-1)[..., None, None] * across[..., None, :, :]
        curve = (moment[..., None, None] * curve).sum(-3) * over**2
        hessian += _outer(_each(span, curve), _flat(span))
        mixed = -_outer(_flat(span), _each((moment[..., None, :, :, None] * turn[side]).sum(-2), across * over))
        hessian += mixed + np.swapaxes(mixed, -1, -2)
        for plane in (0, 1):
            add_arms(outer, body, -moment[..., plane, None] * e, n[..., plane, :])
    for plane in (0, 1):
        (up, low), (uu, ul, ll) = (r[..., plane] for r in rows), np.moveaxis(flex.bend[..., None, :, plane, :], -1, 0)
        gradient += (up * moments[0][..., None, :, plane] + low * moments[1][..., None, :, plane]).sum(-1)
        hessian += _outer(up * uu + low * ul, up) + _outer(up * ul + low * ll, low)
    _add_twist(scene, twist, upper, lower, turn, gradient, hessian, outer)


def _add_twist(scene: Scene, twist: Any, upper: Any, lower: Any, turn: dict[str, Any], gradient: Any, hessian: Any, outer: Any) -> None:
    flex, wires = scene.flex, scene.wires
    assert flex is not None
    torque = flex.twist * twist
    row = 0.0
    for sign, low, up in ((0.5, 0, 1), (-0.5, 1, 0)):
        by_low, by_up = turn["lower"][..., low, :], turn["upper"][..., up, :]
        row = row + sign * ((by_low * upper[..., None, :, up, :]).sum(-1) + (by_up * lower[..., None, :, low, :]).sum(-1))
        mixed = sign * _outer(_flat(by_low * torque[..., None, :, None]), _flat(by_up))
        hessian += mixed + np.swapaxes(mixed, -1, -2)
        add_arms(outer, wires.lower, sign * torque[..., None] * upper[..., up, :], lower[..., low, :])
        add_arms(outer, wires.upper, sign * torque[..., None] * lower[..., low, :], upper[..., up, :])
    gradient += (row * torque[..., None, :]).sum(-1)
    hessian += _outer(row * flex.twist[..., None, :], row)


def _outer(a: Any, b: Any) -> Any:
    return a @ np.swapaxes(b, -1, -2)


def _flat(vectors: Any) -> Any:
    """Vectors (..., N, w, 3) of all wires in one row (..., N, 3 w)."""
    return vectors.reshape(*vectors.shape[:-2], -1)


def _each(vectors: Any, matrix: Any) -> Any:
    """Vectors (..., N, w, 3) times the symmetric matrix (..., w, 3, 3) of their wire, in one row."""
    return _flat((vectors[..., None, :] * matrix[..., None, :, :, :]).sum(-1))


def _turn_jacobian(numbering: Layout, body: Any, vector: Any) -> Any:
    """How the planes' vectors (..., w, 2, 3) turn with the coordinates: (..., N, w, 2, 3); t x n for a small rotation t."""
    result = np.zeros((*vector.shape[:-3], numbering.size, *vector.shape[-3:]))
    turned = np.swapaxes(cross_matrix(vector), -1, -2)  # row axis: what t along that axis does, -(n x axis) = axis x n
    for axis in range(3):
        result[..., 6 * body + 3 + axis, np.arange(len(body)), :, :] = -turned[..., axis, :]
    return result
