"""Energies of a scene in any pose, from places of points, lengths and strains alone: forces and
stiffness are their derivatives.

Poses may be complex and have batch axes. Each function takes a scene and a pose; what it gives is
relative to any constant.
"""

from __future__ import annotations

import numpy as np

from suspension_cli.elements import bending, spring, taut_string, weight
from suspension_cli.scene.pose import nominal_pose


def energy(scene, pose, elements=None):
    """Energy relative to the nominal pose, J; of all elements, or some."""
    chosen = ENERGIES.values() if elements is None else [ENERGIES[one] for one in elements]
    none = np.zeros(pose.shift.shape[:-2], dtype=pose.shift.dtype)
    return sum((own(scene, pose) - own(scene, nominal_pose(scene)) for own in chosen), none)


def points(scene):
    """All masses as points: each a mass, and the points of bodies and blades that it lies between.

    Every body is six points on its principal axes, a wire or bar of any moments of mass three.
    """
    bodies, wires, blades, bars = scene.bodies, scene.wires, scene.blades, scene.bars
    for n, (mass, inertia) in enumerate(zip(bodies.mass, bodies.inertia, strict=True), 1):
        moments, axes = np.linalg.eigh(inertia)
        for second, axis in zip(moments.sum() / 2 - moments, axes.T, strict=True):
            for sign in (1, -1):
                yield mass / 6, [(1.0, n, sign * np.sqrt(3 * second / mass) * axis, -1)]
    for n, mass in enumerate(blades.tip_mass):
        yield mass, [(1.0, blades.body[n], blades.tip[n], n)]
    lines = [(moments, *ends_of(wires, n)) for n, moments in enumerate(wires.mass)]
    for ends, at, moments in zip(bars.body, bars.point, bars.inertia, strict=True):
        lines.append((moments, (ends[0], at[0], -1), (ends[1], at[1], -1)))
    for (uu, ul, ll), upper, lower in lines:
        for mass, share in ((uu - ul, 0.0), (4 * ul, 0.5), (ll - ul, 1.0)):
            yield mass, [(1 - share, *upper), (share, *lower)]


def ends_of(wires, n):
    """Body, point and blade of both ends of a wire."""
    upper = wires.upper[n], wires.upper_point[n], wires.blade[n]
    return upper, (wires.lower[n], wires.lower_point[n], -1)


def place_of(scene, pose, parts):
    """Place of a point between points of bodies and blades."""
    result = 0.0
    for share, body, point, blade in parts:
        arm = point + (pose.deflection[..., blade, :] if blade >= 0 else 0.0)
        turned = (pose.rotation[..., body, :, :] @ arm[..., None])[..., 0]
        result = result + share * (scene.bodies.position[body] + pose.shift[..., body, :] + turned)
    return result


def weight_energy(scene, pose):
    vector, slope = np.array([0.0, 0.0, -scene.gravity]), np.zeros((3, 3))
    if scene.field is not None:
        vector, slope = scene.field.vector, scene.field.gradient
    result = 0.0
    for mass, parts in points(scene):
        r = place_of(scene, pose, parts)
        result = result - mass * (r @ vector + ((r @ slope) * r).sum(-1) / 2)
    return result


def chord(scene, pose, wires, n):
    """Vector from the upper to the lower end of a wire or strut, and its length."""
    upper, lower = (place_of(scene, pose, [(1.0, *end)]) for end in ends_of(wires, n))
    span = lower - upper
    return span, np.sqrt((span**2).sum(-1))


def string_energy(scene, pose):
    result = 0.0
    for wires in (scene.wires, scene.struts):
        for n, k in enumerate(wires.stiffness):
            e = chord(scene, pose, wires, n)[1] - wires.length[n]
            result = result + wires.tension[n] * e + k / 2 * e**2
    return result


def bending_energy(scene, pose):
    """Of slopes against the chord in both planes, and of the sine of the twist."""
    flex, wires, result = scene.flex, scene.wires, 0.0
    for n in range(len(wires.label)):
        twist = wires.torsion[n] if flex is None else flex.twist[n]
        planes = [np.linalg.svd(wires.span[n][None])[2][1:]] * 2  # any two across its line
        if flex is not None:
            planes = flex.upper[n], flex.lower[n]
        upper, lower = (
            pose.rotation[..., body[n], :, :] @ own.T
            for body, own in zip((wires.upper, wires.lower), planes, strict=True)
        )
        mixed = np.swapaxes(lower, -1, -2) @ upper
        result = result + twist / 8 * (mixed[..., 0, 1] - mixed[..., 1, 0]) ** 2
        if flex is not None and flex.bend is not None:
            span, length = chord(scene, pose, wires, n)
            direction = (span / length[..., None])[..., None, :]
            a, b = (-(direction @ normals)[..., 0, :] for normals in (upper, lower))
            uu, ul, ll = flex.bend[n].T
            result = result + (uu * a**2 / 2 + ul * a * b + ll * b**2 / 2).sum(-1)
    return result


def spring_energy(scene, pose):
    """Of strains in the frame of the upper body; flexures of a leg resist its lean and the tilt."""
    springs, result = scene.springs, 0.0
    for n, leg in enumerate(springs.leg):
        above, below = springs.upper[n], springs.lower[n]
        frame = np.swapaxes(pose.rotation[..., above, :, :], -1, -2)
        ends = (below, springs.lower_point[n]), (above, springs.upper_point[n])
        lower, upper = (place_of(scene, pose, [(1.0, *end, -1)]) for end in ends)
        delta = (frame @ (lower - upper)[..., None])[..., 0]
        q = frame @ pose.rotation[..., below, :, :]
        turn = [q[..., i, j] - q[..., j, i] for i, j in ((2, 1), (0, 2), (1, 0))]
        strain = np.concatenate([delta, np.stack(turn, axis=-1) / 2], axis=-1)
        if leg:
            across = np.sqrt((delta[..., :2] ** 2).sum(-1) + 1e-200)
            lean = leg * np.arctan(across / (leg + delta[..., 2])) / across
            strain[..., :2] = lean[..., None] * delta[..., :2]
            strain[..., 3], strain[..., 4] = -q[..., 1, 2], q[..., 0, 2]
        work = ((strain @ springs.stiffness[n]) * strain).sum(-1) / 2
        result = result + work - strain @ springs.preload[n]
    return result


def blade_energy(scene, pose):
    q, blades = pose.deflection, scene.blades
    return (blades.stiffness * q**2 / 2 - blades.load * q).sum((-1, -2))


ENERGIES = {
    weight.ELEMENT: weight_energy,
    taut_string.ELEMENT: string_energy,
    bending.ELEMENT: bending_energy,
    spring.ELEMENT: spring_energy,
    spring.BLADES: blade_energy,
}
