"""Energy, forces and stiffness of wires against bending and twisting, in any pose.

A wire leaves its clamps along directions fixed in its two bodies. Relative to its chord e (the unit
vector between its ends) it has slopes a at the upper and b at the lower end in each principal plane
p, and a twist phi. Beyond the energy of a taut string a beam under its tension stores

    E = sum over p of (S_uu a_p^2 + 2 S_ul a_p b_p + S_ll b_p^2) / 2 + kappa phi^2 / 2,
    a_p = -e . n_p (upper body),   b_p = -e . n_p (lower body),
    phi = (n_1' . m_2 - n_2' . m_1) / 2 (the sine of the twist; m: upper, n': lower body),

to second order in the slopes, with S the static stiffness of `elements.beam` against rotation of
its ends (the chord fixed) and n_p the unit vectors of the planes, fixed in the bodies across the
clamps. A common rotation changes none of the three. If the clamps point along the chord, all slopes
vanish at rest and only products of first derivatives count; else also the second derivatives, times
the moments:

    d(a)  = -(n - (n.e) e) . dr / L - e . dn,
    d2(a) = dr . (e n_+ + n_+ e + (e.n) P) . dr / L^2 - 2 dr . P . dn / L - e . d2(n),

with r the span, L its length, P = 1 - e e, n_+ = P n, and dn, d2(n) the changes of a vector in a
rotation (see `elements.geometric_stiffness`). S is taken at the tension in equilibrium: its change
with stretching is of third order.

A string has no bending stiffness, but a design may give its torsional stiffness (`torsion`): it
adds kappa phi^2 / 2 alone, with planes across its line in the nominal pose.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements import string
from suspension_cli.elements.dynamic_wire import TautWire, fit_to_equilibrium, group_identical
from suspension_cli.elements.element import Derivatives, Element
from suspension_cli.elements.geometric_stiffness import add_arms
from suspension_cli.rotations import cross, cross_matrix
from suspension_cli.scene.composition import Fibre, Section
from suspension_cli.scene.pose import Layout, Pose
from suspension_cli.scene.scene import Flex, Scene, Wires

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

KNOWN = 512
"""Wires whose stiffness is kept."""


def with_bending(
    scene: Scene,
    tension: Inexact[np.ndarray, "*batch wire"] | None = None,
    length: Inexact[np.ndarray, "*batch wire"] | None = None,
) -> Scene:
    """Fill `flex` of a scene with `fibres`: its wires bend and twist.

    `tension` (N) and `length` (m) are those at which the stiffness is taken; nominal by default.
    """
    assert scene.fibres is not None
    wires = scene.wires
    shape = (*scene.batch, len(wires.label))
    numbers = (
        wires.length if length is None else length,
        wires.stiffness,
        wires.tension if tension is None else tension,
        wires.torsion,
    )
    numbers = [np.broadcast_to(value, shape) for value in numbers]
    found: list[tuple[list[int], np.ndarray, np.ndarray]] = []
    for group in group_identical(scene.fibres.wire, *numbers):
        fibre, own = scene.fibres.wire[group[0]], [value[..., group[0]] for value in numbers]
        resistance = (
            _resistance(fibre, *map(np.ravel, own))
            if scene.batch
            else _known_resistance(fibre.sections, *(value.item() for value in own))
        )
        found.append((group, *resistance))
    bend, twist = np.empty((*shape, 2, 3)), np.empty(shape)
    for group, slopes, turning in found:
        bend[..., group, :, :] = slopes.reshape(*scene.batch, 1, 2, 3)
        twist[..., group] = turning.reshape(*scene.batch, 1)
    scene = with_planes(scene) if scene.flex is None else scene
    assert scene.flex is not None
    return replace(scene, flex=replace(scene.flex, bend=bend, twist=twist))


def _resistance(
    fibre: Fibre,
    length: Inexact[np.ndarray, " build"],
    stiffness: Inexact[np.ndarray, " build"],
    tension: Inexact[np.ndarray, " build"],
    torsion: Inexact[np.ndarray, " build"],
) -> tuple[Inexact[np.ndarray, "build 2 3"], Inexact[np.ndarray, " build"]]:
    """Stiffness of a wire against slopes (f, 2, 3) and twist (f,), for (f,) numbers."""
    fibre = fit_to_equilibrium(fibre, length, stiffness, tension, torsion)
    strand = TautWire(fibre, tension, massive=False, lossy=False)
    planes = [_slope_stiffness(strand.resting(part)) for part in ("bend-1", "bend-2")]
    return np.stack(planes, axis=-2), strand.resting("twist")[1, 1] / 4


@lru_cache(maxsize=KNOWN)
def _known_resistance(
    sections: tuple[Section, ...], *numbers: float
) -> tuple[Float[np.ndarray, "1 2 3"], Float[np.ndarray, " 1"]]:
    """Resistance of one wire, cached: most wires do not differ between designs."""
    return _resistance(bare_fibre(sections), *(np.array([number]) for number in numbers))


def bare_fibre(sections: tuple[Section, ...]) -> Fibre:
    """A fibre of these sections, enough for its static stiffness."""
    nowhere = np.zeros(3)
    return Fibre("", sections, nowhere, (nowhere, nowhere), (0.0, 0.0))


def with_planes(scene: Scene) -> Scene:
    """Fill `flex` of a scene with the principal planes of its wires, without stiffness."""
    assert scene.fibres is not None
    planes = np.array([fibre.plane for fibre in scene.fibres.wire]).reshape(-1, 3)
    clamps = np.array([fibre.clamp for fibre in scene.fibres.wire]).reshape(-1, 2, 3)
    upper, lower = (principal_planes(planes, clamps[:, end]) for end in (0, 1))
    bend, twist = np.zeros((len(planes), 2, 3)), np.zeros(len(planes))
    return replace(scene, flex=Flex(upper, lower, bend, twist))


def wire_resistance(scene: Scene) -> Flex | None:
    """Bending and torsional stiffness of wires, or the given torsion of strings; or None."""
    wires = scene.wires
    if scene.flex is not None or not wires.torsion.any():
        return scene.flex
    along = wires.span / wires.length[..., None]
    across = np.where(
        np.abs(along[..., :1]) < 0.9, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    )
    planes = principal_planes(across, along)
    return Flex(planes, planes, None, wires.torsion)


def _slope_stiffness(stiffness: Inexact[np.ndarray, "4 4 build"]) -> Inexact[np.ndarray, "build 3"]:
    """S_uu, S_ul, S_ll (f, 3), from T_s = (b - a) / 2 and T_a = (a + b) / 2."""
    even, odd, mixed = stiffness[1, 1], stiffness[3, 3], stiffness[1, 3]
    return np.stack([even + odd - 2 * mixed, odd - even, even + odd + 2 * mixed], axis=-1) / 4


def principal_planes(
    plane: Inexact[np.ndarray, "*wire 3"], clamp: Inexact[np.ndarray, "*wire 3"]
) -> Inexact[np.ndarray, "*wire 2 3"]:
    """Unit vectors (..., 2, 3) of both principal planes, across a clamp (..., 3)."""
    first = plane - (plane * clamp).sum(-1, keepdims=True) * clamp
    first = first / np.sqrt((first**2).sum(-1, keepdims=True))
    return np.stack([first, cross(clamp, first)], axis=-2)


def _normals(
    scene: Scene, pose: Pose, flex: Flex
) -> tuple[Inexact[np.ndarray, "*batch wire 2 3"], Inexact[np.ndarray, "*batch wire 2 3"]]:
    """Unit vectors (..., w, 2, 3) of the planes at the upper and lower end in global axes."""
    wires = scene.wires
    upper, lower = (
        (pose.rotation[..., body, None, :, :] @ n[..., None])[..., 0]
        for body, n in ((wires.upper, flex.upper), (wires.lower, flex.lower))
    )
    return upper, lower


def _slopes(
    direction: Inexact[np.ndarray, "*batch wire 3"],
    upper: Inexact[np.ndarray, "*batch wire 2 3"],
    lower: Inexact[np.ndarray, "*batch wire 2 3"],
) -> tuple[
    Inexact[np.ndarray, "*batch wire 2"],
    Inexact[np.ndarray, "*batch wire 2"],
    Inexact[np.ndarray, "*batch wire"],
]:
    """Slopes a and b (..., w, 2), and the sine of the twist (..., w)."""
    a, b = (-(direction[..., None, :] * n).sum(-1) for n in (upper, lower))
    twist = (
        (lower[..., 0, :] * upper[..., 1, :]).sum(-1)
        - (lower[..., 1, :] * upper[..., 0, :]).sum(-1)
    ) / 2
    return a, b, twist


def energy(scene: Scene, pose: Pose) -> Inexact[np.ndarray, "*batch"]:
    """Energy (...) of bending and twisting of all wires, J."""
    flex = wire_resistance(scene)
    if flex is None:
        return np.zeros(scene.batch)
    a, b, twist = _slopes(string.state(scene, pose).direction, *_normals(scene, pose, flex))
    twisting = (flex.twist * twist**2).sum(-1) / 2
    if flex.bend is None:
        return twisting
    bending = flex.bend[..., 0] * a**2 + 2 * flex.bend[..., 1] * a * b + flex.bend[..., 2] * b**2
    return bending.sum((-2, -1)) / 2 + twisting


def add_derivatives(scene: Scene, numbering: Layout, pose: Pose, derivatives: Derivatives) -> None:
    """Add the derivatives of the energy of bending and twisting.

    The second ones are taken with respect to the span and the rotations of the upper and lower body
    (9 per wire), then transformed to the coordinates.
    """
    flex, wires = wire_resistance(scene), scene.wires
    if flex is None:
        return
    now, normals = string.state(scene, pose), _normals(scene, pose, flex)
    hessian, outer = derivatives.hessian, derivatives.outer
    pull = np.zeros(now.direction.shape)
    second = np.zeros((*now.direction.shape[:-1], 9, 9))
    if flex.bend is not None:
        _add_bending(wires, flex.bend, now, normals, pull, second, outer)
    _add_twisting(wires, flex.twist, normals, second, outer)
    derivatives.add_forces(wires.lower, pull, now.lower_arm)
    derivatives.add_forces(wires.upper, -pull, now.upper_arm, wires.blade)
    jacobian = _jacobian(scene, pose, now)
    stiffness = np.swapaxes(jacobian, -1, -2) @ second @ jacobian
    for pair in sorted(set(zip(wires.upper.tolist(), wires.lower.tolist(), strict=True))):
        own = (wires.upper == pair[0]) & (wires.lower == pair[1])
        matrix = stiffness[..., own, :12, :12].sum(-3)
        for i, one in enumerate(pair):
            for j, other in enumerate(pair):
                hessian[..., 6 * one : 6 * one + 6, 6 * other : 6 * other + 6] += matrix[
                    ..., 6 * i : 6 * i + 6, 6 * j : 6 * j + 6
                ]
    for n in np.flatnonzero(wires.blade >= 0):
        tip = numbering.blade[wires.blade[n]]
        moves = np.flatnonzero(tip < numbering.size)
        bodies = (6 * np.array([[wires.upper[n]], [wires.lower[n]]]) + np.arange(6)).ravel()
        rows, block = tip[moves], stiffness[..., n, 12 + moves, :]
        hessian[..., rows[:, None], rows] += block[..., 12 + moves]
        hessian[..., rows[:, None], bodies] += block[..., :12]
        hessian[..., bodies[:, None], rows] += np.swapaxes(block[..., :12], -1, -2)


def _add_bending(
    wires: Wires,
    bend: Inexact[np.ndarray, "... wire 2 3"],
    now: string.State,
    normals: tuple[Inexact[np.ndarray, "*batch wire 2 3"], Inexact[np.ndarray, "*batch wire 2 3"]],
    pull: Inexact[np.ndarray, "*batch wire 3"],
    second: Inexact[np.ndarray, "*batch wire 9 9"],
    outer: Inexact[np.ndarray, "*batch 1+body 3 3"],
) -> None:
    """Add gradient (..., w, 3) in the span and Hessian (..., w, 9, 9) of bending, in place.

    Normals act as arms of forces: these go to `outer`.
    """
    e, over = now.direction, 1 / now.length
    a, b, _ = _slopes(e, *normals)
    moments = (bend[..., 0] * a + bend[..., 1] * b, bend[..., 1] * a + bend[..., 2] * b)
    across = np.eye(3) - e[..., :, None] * e[..., None, :]  # P
    rows = np.zeros((*e.shape[:-1], 2, 2, 9), dtype=e.dtype)  # d(slope) by end and plane
    for side, (n, body, turn) in enumerate(
        zip(normals, (wires.upper, wires.lower), (slice(3, 6), slice(6, 9)), strict=True)
    ):
        for plane in (0, 1):
            normal, moment = n[..., plane, :], moments[side][..., plane]
            along = (normal * e).sum(-1)
            flat = normal - along[..., None] * e  # n_+
            rows[..., side, plane, :3] = -flat * over[..., None]
            rows[..., side, plane, turn] = cross(e, normal)
            product = e[..., :, None] * flat[..., None, :]
            curve = product + np.swapaxes(product, -1, -2) + along[..., None, None] * across
            second[..., :3, :3] += (moment * over**2)[..., None, None] * curve
            mixed = (moment * over)[..., None, None] * (across @ cross_matrix(normal))
            second[..., :3, turn] += mixed
            second[..., turn, :3] += np.swapaxes(mixed, -1, -2)
            pull += moment[..., None] * rows[..., side, plane, :3]
            add_arms(outer, body, -moment[..., None] * e, normal)
    form = np.stack([bend[..., :2], bend[..., 1:]], axis=-3)  # end, plane, end
    moment_rows = (form[..., None] * np.swapaxes(rows, -3, -2)[..., None, :, :, :]).sum(-2)
    flat_rows = rows.reshape(*e.shape[:-1], 4, 9)
    second += np.swapaxes(flat_rows, -1, -2) @ moment_rows.reshape(*e.shape[:-1], 4, 9)


def loss_matrix(
    scene: Scene, numbering: Layout, pose: Pose
) -> Inexact[np.ndarray, "*batch coordinate coordinate"] | float:
    """Imaginary part (..., N, N) of the stiffness against twisting of wires."""
    wires, flex = scene.wires, wire_resistance(scene)
    if flex is None or not wires.loss.any():
        return 0.0
    result = np.zeros((*scene.batch, numbering.size, numbering.size))
    turn = _twist_forms(*_normals(scene, pose, flex))
    lost = (flex.twist * wires.loss)[..., None, None] * turn[..., :, None] * turn[..., None, :]
    for n in np.flatnonzero(wires.loss).tolist():
        rows = np.concatenate(
            [6 * body[n] + np.arange(3, 6) for body in (wires.upper, wires.lower)]
        )
        result[..., rows[:, None], rows] += lost[..., n, :, :]
    return result


def _twist_forms(
    upper: Inexact[np.ndarray, "*batch wire 2 3"], lower: Inexact[np.ndarray, "*batch wire 2 3"]
) -> Inexact[np.ndarray, "*batch wire 6"]:
    """d(phi) = t . (n_1' x m_2 - n_2' x m_1) / 2, t the rotation of the lower minus upper body."""
    row = (
        cross(lower[..., 0, :], upper[..., 1, :]) - cross(lower[..., 1, :], upper[..., 0, :])
    ) / 2
    return np.concatenate([-row, row], axis=-1)


def _add_twisting(
    wires: Wires,
    stiffness: Inexact[np.ndarray, "... wire"],
    normals: tuple[Inexact[np.ndarray, "*batch wire 2 3"], Inexact[np.ndarray, "*batch wire 2 3"]],
    second: Inexact[np.ndarray, "*batch wire 9 9"],
    outer: Inexact[np.ndarray, "*batch 1+body 3 3"],
) -> None:
    """Add the Hessian (..., w, 9, 9) of twisting, and its forces on normals to `outer`."""
    upper, lower = normals
    _, _, twist = _slopes(upper[..., 0, :], upper, lower)
    torque, turn = stiffness * twist, _twist_forms(upper, lower)
    second[..., 3:, 3:] += stiffness[..., None, None] * turn[..., :, None] * turn[..., None, :]
    mixed = (
        upper[..., 0, :, None] * lower[..., 1, None, :]
        - upper[..., 1, :, None] * lower[..., 0, None, :]
    )
    # rows: rotation of the lower body, columns: of the upper one
    mixed = torque[..., None, None] * (twist[..., None, None] * np.eye(3) + mixed / 2)
    second[..., 6:, 3:6] += mixed
    second[..., 3:6, 6:] += np.swapaxes(mixed, -1, -2)
    for sign, low, up in ((0.5, 0, 1), (-0.5, 1, 0)):
        n, m = lower[..., low, :], upper[..., up, :]
        add_arms(outer, wires.lower, sign * torque[..., None] * m, n)
        add_arms(outer, wires.upper, sign * torque[..., None] * n, m)


def _jacobian(
    scene: Scene, pose: Pose, now: string.State
) -> Inexact[np.ndarray, "*batch wire 9 15"]:
    """Derivative (..., w, 9, 15) of the span and both rotations.

    With respect to displacement and rotation of the upper and lower body, and the blade's tip.
    """
    wires = scene.wires
    result = np.zeros((*now.direction.shape[:-1], 9, 15), dtype=now.direction.dtype)
    result[..., :3, :3], result[..., :3, 6:9] = -np.eye(3), np.eye(3)
    result[..., :3, 3:6] = cross_matrix(now.upper_arm)
    result[..., :3, 9:12] = -cross_matrix(now.lower_arm)
    result[..., 3:6, 3:6] = result[..., 6:, 9:12] = np.eye(3)
    result[..., :3, 12:] = np.where(
        (wires.blade >= 0)[:, None, None], -pose.rotation[..., wires.upper, :, :], 0.0
    )
    return result


ELEMENT = Element(energy, add_derivatives, loss=loss_matrix, compiled=True)
