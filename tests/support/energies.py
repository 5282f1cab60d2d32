"""Energies of the elements of a scene, of which their forces and stiffness are the derivatives."""

from __future__ import annotations

import numpy as np

from suspension_cli.elements import bending, spring, string, weight
from suspension_cli.elements.configuration import batch_of, configuration
from suspension_cli.elements.registry import elements_of
from suspension_cli.elements.vectors import dot, times
from suspension_cli.scene.pose import layout


def energy(scene, pose, elements=None):
    """Energy relative to the nominal pose, J; of all elements, or some."""
    now = configuration(scene, layout(scene), pose)
    chosen = elements_of(scene) if elements is None else elements
    total = sum((ENERGIES[element](now) for element in chosen), np.zeros(now.arrays.count))
    return total.reshape(batch_of(scene, pose))[()]


def weight_energy(now):
    """Energy of all weights relative to the nominal pose, J."""
    scene, position = now.arrays.scene, now.arrays.bodies.position
    slope, points_and_lines = weight._slope(scene), weight.masses(now.arrays)
    moved = [(now.arrays.bodies.mass, position[:, 1:], now.shift[:, 1:])]
    moved += [(group.mass, *moves(now, group)) for group in points_and_lines[0]]
    result = np.zeros(now.arrays.count)
    for mass, start, change in moved:
        # exact for an energy of second order
        result = result + (mass * dot(weight.lift(scene, start + change / 2), change)).sum(0)
    if slope is not None:
        form = slope[:, :, None, None]
        for group in points_and_lines[1]:
            start, change = moves(now, group)
            result = result + (group.mass * dot(times(form, start + change / 2), change)).sum(0)
        turned = weight._turned(now, weight._second_moments(now)) - weight._second_moments(now)
        result = result + (form * turned).sum((0, 1, 2)) / 2
    return result


def moves(now, group):
    """Nominal places of masses at points or nominal spans of lines of mass, and their changes."""
    ends = []
    for end, point in enumerate(group.points):
        body, blade = list(group.ends[end]), None if end else group.ends.blade
        _, moved = now.arms(group.ends[end], point, blade)
        start = now.arrays.bodies.position[:, body] + point
        ends.append((start, now.shift[:, body] + moved))
    return [one[0] - one[1] if len(one) == 2 else one[0] for one in zip(*ends, strict=True)]


def string_energy(now):
    """Elastic energy of all wires and struts relative to the nominal pose, J."""
    result = np.zeros(now.arrays.count)
    for lines, wires in string._kinds(now):
        e = lines.elongation
        result = result + (wires.tension * e + wires.stiffness * e**2 / 2).sum(0)
    return result


def bending_energy(now):
    """Energy of bending and twisting of all wires, J."""
    flex = now.flex
    if flex is None or not now.arrays.wires.label:
        return np.zeros(now.arrays.count)
    upper, lower = bending._normals(now)
    result = (flex.twist * bending._twist(upper, lower)[0] ** 2 / 2).sum(0)
    if flex.bend is not None:
        a, b = (-dot(now.wires.direction[:, None], n) for n in (upper, lower))
        s_uu, s_ul, s_ll = flex.bend.swapaxes(0, 1)
        result = result + (s_uu * a**2 / 2 + s_ul * a * b + s_ll * b**2 / 2).sum((0, 1))
    return result


def spring_energy(now):
    """Elastic energy of all springs relative to the nominal pose, J."""
    result = np.zeros(now.arrays.count)
    for one in spring._strains(now):
        preload = now.arrays.springs.preload[:, one.which]
        pull, twist = spring._pull(now, one)
        pull, twist = pull - preload[:3], twist - preload[3:]
        result = result + (dot(pull, one.strain[0]) + dot(twist, one.strain[1])).sum(0) / 2
    return result


def blade_energy(now):
    """Elastic energy of all blades relative to the nominal pose, J."""
    q, blades = now.deflection, now.arrays.blades
    return (blades.stiffness * q**2 / 2 - blades.load * q).sum((0, 1))


ENERGIES = {
    weight.ELEMENT: weight_energy,
    string.ELEMENT: string_energy,
    bending.ELEMENT: bending_energy,
    spring.ELEMENT: spring_energy,
    spring.BLADES: blade_energy,
}
