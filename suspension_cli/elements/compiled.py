"""Forces and stiffness of the elements of one build, as loops that `numba` compiles.

The formulas are those of `string`, `bending`, `blade` and `spring`, which work on arrays of any
type of number; these work on the doubles of one build at a time, some thirty times faster in a
batch. `tests/elements/test_compiled.py` compares both on random scenes.

The numbers of a build are packed into one row per element, in the order given by `WIRE`, `BLADE`,
`SPRING` and `FLEX`. A Hessian has one row and column more than there are coordinates: it takes what
belongs to rigid directions of blades. Only its lower triangle is filled.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from suspension_cli.compiled import compiled
from suspension_cli.elements.compiled_wire import resting

WIRE = ("upper_point", "lower_point", "span", "length", "tension", "stiffness", "torsion")
"""Fields of `Wires` in a row of 13 numbers."""
BLADE = ("tip", "stiffness", "load", "tip_mass")
"""Fields of `Blades` in a row of 10 numbers."""
SPRING = ("upper_point", "lower_point", "stiffness", "preload")
"""Fields of `Springs` in a row of 48 numbers."""
FLEX = ("upper", "lower", "bend", "twist")
"""Fields of `Flex` in a row of 19 numbers."""


@compiled
def rotate(turn: Any, vector: Any, out: Any) -> None:
    """Rotate a vector (3,) by the rotation matrix 1 + `turn` (3, 3)."""
    for i in range(3):
        total = turn[i, 0] * vector[0] + turn[i, 1] * vector[1] + turn[i, 2] * vector[2]
        out[i] = vector[i] + total


@compiled
def add_rotation_hessian(outer: Any, first: int, hessian: Any) -> None:
    """Add the geometric stiffness of a body from its sum of F w^T (3, 3), see
    `geometric_stiffness`.
    """
    trace = outer[0, 0] + outer[1, 1] + outer[2, 2]
    for i in range(3):
        hessian[first + i, first + i] -= trace
        for j in range(i + 1):
            hessian[first + i, first + j] += (outer[i, j] + outer[j, i]) / 2


@compiled
def _fill_jacobian(
    jacobian: Any, upper_arm: Any, lower_arm: Any, turn: Any, on_blade: bool
) -> None:
    """Derivative (3, 15) of a span with respect to both bodies (12) and the tip (3)."""
    jacobian[:] = 0.0
    for start, arm, sign in ((0, upper_arm, -1.0), (6, lower_arm, 1.0)):
        for axis in range(3):
            jacobian[axis, start + axis] = sign
        jacobian[1, start + 3], jacobian[2, start + 3] = -sign * arm[2], sign * arm[1]
        jacobian[0, start + 4], jacobian[2, start + 4] = sign * arm[2], -sign * arm[0]
        jacobian[0, start + 5], jacobian[1, start + 5] = -sign * arm[1], sign * arm[0]
    if on_blade:
        for i in range(3):
            for j in range(3):
                jacobian[i, 12 + j] = -turn[i, j]
            jacobian[i, 12 + i] -= 1.0


@compiled
def _add_outer(outer: Any, factor: float, force: Any, arm: Any) -> None:
    for i in range(3):
        for j in range(3):
            outer[i, j] += factor * force[i] * arm[j]


@compiled
def _cross(a: Any, b: Any, factor: float, out: Any) -> None:
    out[0] = factor * (a[1] * b[2] - a[2] * b[1])
    out[1] = factor * (a[2] * b[0] - a[0] * b[2])
    out[2] = factor * (a[0] * b[1] - a[1] * b[0])


@compiled
def _dot(a: Any, b: Any) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def _add_bending(e: Any, length: float, flex: Any, normal: Any, ends: Any, curved: bool) -> None:
    """Add the derivatives of the energy of bending of one wire, see `bending`.

    `normal` (2, 2, 3): end, plane; `ends` is first (9,), second (9, 9), outer of the upper and
    of the lower body (3, 3), rows (2, 9), flat (3,). The second derivatives only if `curved`.
    """
    first, second, outer_upper, outer_lower, rows, flat = ends
    for plane in range(2):
        upper, mixed, lower = flex[12 + 3 * plane], flex[13 + 3 * plane], flex[14 + 3 * plane]
        a, b = -_dot(e, normal[0, plane]), -_dot(e, normal[1, plane])
        for side in range(2):
            moment = upper * a + mixed * b if side == 0 else mixed * a + lower * b
            n, row, turn = normal[side, plane], rows[side], 3 + 3 * side
            along, over = _dot(n, e), moment / length
            row[:] = 0.0
            for i in range(3):
                flat[i] = n[i] - along * e[i]
                row[i] = -flat[i] / length
            _cross(e, n, 1.0, row[turn : turn + 3])
            for i in range(3):
                first[i] += moment * row[i]
                first[turn + i] += moment * row[turn + i]
                if not curved:
                    continue
                for j in range(3):
                    one = 1.0 if i == j else 0.0
                    product = e[i] * flat[j] + flat[i] * e[j] + along * (one - e[i] * e[j])
                    second[i, j] += over / length * product
                # row i of P [n], P = 1 - e e: e_i x n - e_i (e x n)
                j, k = (i + 1) % 3, (i + 2) % 3
                second[i, turn + j] -= over * n[k]
                second[i, turn + k] += over * n[j]
                for j in range(3):
                    second[i, turn + j] -= over * e[i] * row[turn + j]
            if curved:
                _add_outer(outer_upper if side == 0 else outer_lower, -moment, e, n)
        if curved:
            for i in range(9):
                up = upper * rows[0, i] + mixed * rows[1, i]
                low = mixed * rows[0, i] + lower * rows[1, i]
                for j in range(9):
                    second[i, j] += up * rows[0, j] + low * rows[1, j]


@compiled
def _add_twisting(stiffness: float, normal: Any, ends: Any, curved: bool) -> None:
    """Add the derivatives of the energy of twisting of one wire, see `_add_bending`."""
    first, second, outer_upper, outer_lower, rows, flat = ends
    twist = (_dot(normal[1, 0], normal[0, 1]) - _dot(normal[1, 1], normal[0, 0])) / 2
    torque = stiffness * twist
    row = rows[0]
    _cross(normal[1, 0], normal[0, 1], 0.5, row[:3])
    _cross(normal[1, 1], normal[0, 0], 0.5, flat)
    for i in range(3):
        row[i] -= flat[i]
    for i in range(3):
        first[3 + i] -= torque * row[i]
        first[6 + i] += torque * row[i]
        for j in range(3 if curved else 0):
            own = stiffness * row[i] * row[j]
            second[3 + i, 3 + j] += own
            second[6 + i, 6 + j] += own
            turned = normal[0, 0, i] * normal[1, 1, j] - normal[0, 1, i] * normal[1, 0, j]
            mixed = torque * ((twist if i == j else 0.0) + turned / 2) - own
            second[6 + i, 3 + j] += mixed
            second[3 + j, 6 + i] += mixed
    if curved:
        for sign, low, up in ((0.5, 0, 1), (-0.5, 1, 0)):
            _add_outer(outer_lower, sign * torque, normal[0, up], normal[1, low])
            _add_outer(outer_upper, sign * torque, normal[1, low], normal[0, up])


@compiled
def add_wires(
    upper: Any,
    lower: Any,
    blade: Any,
    place: Any,
    sections: Any,
    wires: Any,
    flex: Any,
    shift: Any,
    turn: Any,
    deflection: Any,
    tension: Any,
    gradient: Any,
    hessian: Any,
    outer: Any,
    on_tips: Any,
    curved: bool,
    form: Any,
) -> None:
    """Add the derivatives of the energy of all wires of one build; the second if `curved`.

    Parameters
    ----------
    upper, lower, blade : (w,) int arrays
        See `Wires`.
    place : (w, 15) int array
        Coordinates of the upper body, the lower body and the tip.
    sections : (w, m, 9) array
        Sections of the wires, see `compiled_wire`; (0, 0, 9) for strings.
    wires, flex : (w, 13) and (w, 19) arrays
        Numbers of the build; no flex, (0, 19), for strings without torsion. With sections, the
        stiffness against bending and twisting is set to that of the tension in this pose.
    shift, turn, deflection
        Pose, see `Pose`.
    tension : (w,) array
        To be filled, N.
    gradient, hessian, outer, on_tips
        To be added to, see `bending.add_derivatives`.
    form : (w, N + 1) array
        If not empty, it is filled with the elongation of each wire per coordinate, and the Hessian
        is that of wires that do not stretch.
    """
    stretched, arms = np.empty(3), np.empty((2, 3))
    change, e, pull, point = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    jacobian, product = np.empty((3, 15)), np.empty((3, 15))
    normal, first, second = np.empty((2, 2, 3)), np.zeros(9), np.zeros((9, 9))
    stretching, whole, section = np.empty((3, 3)), np.empty((4, 4)), np.empty((4, 4))
    rows = np.empty((2, 9))
    bends = len(flex) > 0
    for n in range(len(wires)):
        own, u, l, b = wires[n], upper[n], lower[n], blade[n]
        for i in range(3):
            point[i] = own[i] + (deflection[b, i] if b >= 0 else 0.0)
        rotate(turn[u], point, arms[0])
        rotate(turn[l], own[3:6], arms[1])
        for i in range(3):
            # from displacements alone, so that nothing cancels
            change[i] = (
                shift[l, i]
                - shift[u, i]
                + (turn[l, i, 0] * own[3] + turn[l, i, 1] * own[4] + turn[l, i, 2] * own[5])
                - (turn[u, i, 0] * own[0] + turn[u, i, 1] * own[1] + turn[u, i, 2] * own[2])
            )
        if b >= 0:
            rotate(turn[u], deflection[b], stretched)
            for i in range(3):
                change[i] -= stretched[i]
        square, elongation = 0.0, 0.0
        for i in range(3):
            stretched[i] = own[6 + i] + change[i]
            square += stretched[i] * stretched[i]
            elongation += change[i] * (2 * own[6 + i] + change[i])
        length = math.sqrt(square)
        tension[n] = own[10] + own[11] * elongation / (length + own[9])
        for i in range(3):
            e[i] = stretched[i] / length
        if bends:
            if len(sections) and tension[n] > 0:
                resting(sections[n], length, tension[n], own[12], flex[n, 12:], whole, section)
            first[:] = 0.0
            if curved:
                second[:] = 0.0
            for plane in range(2):
                rotate(turn[u], flex[n, 3 * plane : 3 * plane + 3], normal[0, plane])
                rotate(turn[l], flex[n, 6 + 3 * plane : 9 + 3 * plane], normal[1, plane])
            ends = (first, second, outer[u], outer[l], rows, point)
            _add_bending(e, length, flex[n], normal, ends, curved)
            _add_twisting(flex[n, 18], normal, ends, curved)
        for i in range(3):
            pull[i] = tension[n] * e[i] + first[i]
        _fill_jacobian(jacobian, arms[0], arms[1], turn[u], b >= 0)
        size = 15 if b >= 0 else 12
        for i in range(size):
            gradient[place[n, i]] += (
                jacobian[0, i] * pull[0] + jacobian[1, i] * pull[1] + jacobian[2, i] * pull[2]
            )
        if bends:
            for c in range(6):
                gradient[place[n, c + 3 if c < 3 else c + 6]] += first[3 + c]
        if not curved:
            continue
        over, stiffness = tension[n] / length, own[11]
        if len(form):
            stiffness = 0.0
            for i in range(size):
                form[n, place[n, i]] += (
                    jacobian[0, i] * e[0] + jacobian[1, i] * e[1] + jacobian[2, i] * e[2]
                )
        for i in range(3):
            for j in range(3):
                stretching[i, j] = (stiffness - over) * e[i] * e[j]
                if bends:
                    stretching[i, j] += second[i, j]
            stretching[i, i] += over
        for i in range(3):
            for j in range(15):
                product[i, j] = (
                    stretching[i, 0] * jacobian[0, j]
                    + stretching[i, 1] * jacobian[1, j]
                    + stretching[i, 2] * jacobian[2, j]
                )
        for i in range(size):
            row = hessian[place[n, i]]
            j0, j1, j2 = jacobian[0, i], jacobian[1, i], jacobian[2, i]
            for j in range(i + 1):
                row[place[n, j]] += j0 * product[0, j] + j1 * product[1, j] + j2 * product[2, j]
        _add_outer(outer[l], 1.0, pull, arms[1])
        _add_outer(outer[u], -1.0, pull, arms[0])
        if b >= 0:
            for i in range(3):
                on_tips[b, i] -= pull[i]
        if bends:
            _add_rotations(place[n], size, jacobian, second, hessian)


@compiled
def _add_rotations(place: Any, size: int, jacobian: Any, second: Any, hessian: Any) -> None:
    """Add the second derivatives with respect to the rotations at the ends, and mixed ones."""
    for c in range(6):
        turn = place[c + 3 if c < 3 else c + 6]
        for d in range(c + 1):
            hessian[turn, place[d + 3 if d < 3 else d + 6]] += second[3 + c, 3 + d]
        for i in range(size):
            value = (
                jacobian[0, i] * second[0, 3 + c]
                + jacobian[1, i] * second[1, 3 + c]
                + jacobian[2, i] * second[2, 3 + c]
            )
            row = place[i]
            if row == turn:
                hessian[row, row] += 2 * value
            else:
                hessian[max(row, turn), min(row, turn)] += value


@compiled
def add_blades(
    body: Any,
    tips: Any,
    gravity: float,
    blades: Any,
    turn: Any,
    deflection: Any,
    gradient: Any,
    hessian: Any,
    outer: Any,
    on_tips: Any,
) -> None:
    """Add the derivatives of the energy of all blades of one build, once the wires are added.

    Parameters
    ----------
    body : (b,) int array
    tips : (b, 3) int array
        Coordinates of the tips, see `Layout`.
    blades : (b, 10) array
    """
    point, arm, weight = np.empty(3), np.empty(3), np.zeros(3)
    for n in range(len(blades)):
        own, u = blades[n], body[n]
        for axis in range(3):
            row = tips[n, axis]
            gradient[row] += own[3 + axis] * deflection[n, axis] - own[6 + axis]
            hessian[row, row] += own[3 + axis]
            point[axis] = own[axis] + deflection[n, axis]
        if own[9] != 0:
            weight[2] = gravity * own[9]
            rotate(turn[u], point, arm)
            gradient[6 * u + 2] += weight[2]
            gradient[6 * u + 3] += arm[1] * weight[2]
            gradient[6 * u + 4] -= arm[0] * weight[2]
            for axis in range(3):
                gradient[tips[n, axis]] += (turn[u, 2, axis] + (axis == 2)) * weight[2]
            _add_outer(outer[u], 1.0, weight, arm)
            on_tips[n, 2] += weight[2]
        # the gradient F at a tip, deflected by q, adds -t . [F] R q as its body rotates by t
        f = on_tips[n]
        for axis in range(3):
            r0 = turn[u, 0, axis] + (axis == 0)
            r1 = turn[u, 1, axis] + (axis == 1)
            r2 = turn[u, 2, axis] + (axis == 2)
            row = tips[n, axis]
            hessian[row, 6 * u + 3] -= f[1] * r2 - f[2] * r1
            hessian[row, 6 * u + 4] -= f[2] * r0 - f[0] * r2
            hessian[row, 6 * u + 5] -= f[0] * r1 - f[1] * r0


@compiled
def _cross_matrix(vector: Any, out: Any) -> None:
    out[:] = 0.0
    out[0, 1], out[0, 2] = -vector[2], vector[1]
    out[1, 0], out[1, 2] = vector[2], -vector[0]
    out[2, 0], out[2, 1] = -vector[1], vector[0]


@compiled
def _multiply(a: Any, b: Any, out: Any) -> None:
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            total = 0.0
            for k in range(a.shape[1]):
                total += a[i, k] * b[k, j]
            out[i, j] = total


@compiled
def add_springs(
    upper: Any,
    lower: Any,
    springs: Any,
    shift: Any,
    turn: Any,
    gradient: Any,
    hessian: Any,
) -> None:
    """Add the derivatives of the energy of all springs of one build, see `spring`."""
    eye = np.eye(3)
    reach, arm = np.empty(3), np.empty(3)
    strain, pull, force = np.empty(6), np.empty(6), np.empty(3)
    jacobian, product, skew = np.zeros((6, 12)), np.empty((6, 12)), np.empty((3, 3))
    q, g, part = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    place = np.empty(12, dtype=np.int64)
    for n in range(len(springs)):
        own, u, l = springs[n], upper[n], lower[n]
        above, below = eye + turn[u], eye + turn[l]
        stiffness, to_upper = own[6:42].reshape(6, 6), above.T.copy()
        rotate(turn[l], own[3:6], arm)
        for i in range(3):
            reach[i] = own[i] - own[3 + i] + shift[l, i] - shift[u, i] + arm[i]
            place[i], place[3 + i], place[6 + i], place[9 + i] = (
                6 * u + i,
                6 * u + 3 + i,
                6 * l + i,
                6 * l + 3 + i,
            )
        _multiply(to_upper, below, q)
        for i in range(3):
            strain[i] = _dot(to_upper[i], reach) - own[i]
        strain[3], strain[4] = (q[2, 1] - q[1, 2]) / 2, (q[0, 2] - q[2, 0]) / 2
        strain[5] = (q[1, 0] - q[0, 1]) / 2
        for i in range(6):
            pull[i] = -own[42 + i]
            for j in range(6):
                pull[i] += stiffness[i, j] * strain[j]
        jacobian[:3, :3], jacobian[:3, 6:9] = -to_upper, to_upper
        _cross_matrix(arm, skew)
        _multiply(to_upper, skew, part)
        jacobian[:3, 9:12] = -part
        _cross_matrix(reach, skew)
        _multiply(to_upper, skew, part)
        jacobian[:3, 3:6] = part
        trace = q[0, 0] + q[1, 1] + q[2, 2]
        _multiply(0.5 * (trace * eye - q), to_upper, part)
        jacobian[3:, 3:6], jacobian[3:, 9:12] = -part, part
        _multiply(stiffness, jacobian, product)
        for i in range(12):
            for k in range(6):
                gradient[place[i]] += jacobian[k, i] * pull[k]
            for j in range(i + 1):
                for k in range(6):
                    hessian[place[i], place[j]] += jacobian[k, i] * product[k, j]
        # second derivatives of the strain times the pull
        for i in range(3):
            force[i] = _dot(above[i], pull[:3])
        _cross_matrix(pull[3:], skew)
        _multiply(above, skew, part)
        _multiply(part, below.T.copy(), g)
        trace = g[0, 0] + g[1, 1] + g[2, 2]
        along_arm, along_reach = _dot(arm, force), _dot(reach, force)
        _cross_matrix(force, skew)
        for i in range(3):
            for j in range(3):
                one = 1.0 if i == j else 0.0
                if j <= i:
                    turned = (g[i, j] + g[j, i]) / 4 - trace / 2 * one
                    hessian[6 * l + 3 + i, 6 * l + 3 + j] += (
                        (force[i] * arm[j] + arm[i] * force[j]) / 2 - along_arm * one + turned
                    )
                    hessian[6 * u + 3 + i, 6 * u + 3 + j] += (
                        (force[i] * reach[j] + reach[i] * force[j]) / 2 - along_reach * one + turned
                    )
                mixed = (along_arm + trace / 2) * one - arm[i] * force[j] - g[j, i] / 2
                hessian[6 * l + 3 + j, 6 * u + 3 + i] += mixed
                hessian[6 * l + j, 6 * u + 3 + i] += skew[i, j]
                hessian[6 * u + 3 + i, 6 * u + j] -= skew[i, j]


@compiled
def fill_geometry(
    upper: Any, lower: Any, blade: Any, wires: Any, flex: Any, pose: Any, tension: Any, result: Any
) -> None:
    """Fill the geometry (w, 25) of the wires of one build, see `compiled_wire.add_dynamic`."""
    shift, turn, deflection = pose
    point, other = np.empty(3), np.empty(3)
    for n in range(len(wires)):
        own, row, u, l, b = wires[n], result[n], upper[n], lower[n], blade[n]
        for i in range(3):
            point[i] = own[i] + (deflection[b, i] if b >= 0 else 0.0)
        rotate(turn[u], point, row[6:9])
        rotate(turn[l], own[3:6], row[9:12])
        # the span from displacements: its nominal value and what the ends moved
        rotate(turn[u], deflection[b] if b >= 0 else np.zeros(3), other)
        square = 0.0
        for i in range(3):
            moved = shift[l, i] - shift[u, i] - other[i]
            for j in range(3):
                moved += turn[l, i, j] * own[3 + j] - turn[u, i, j] * own[j]
            row[i] = own[6 + i] + moved
            square += row[i] * row[i]
        length = math.sqrt(square)
        for i in range(3):
            row[i] /= length
        rotate(turn[u], flex[n, :3], point)
        rotate(turn[l], flex[n, 6:9], other)
        for i in range(3):
            point[i] += other[i]
        along, size = _dot(point, row[:3]), 0.0
        for i in range(3):
            row[3 + i] = point[i] - along * row[i]
            size += row[3 + i] ** 2
        for i in range(3):
            row[3 + i] /= math.sqrt(size)
            for j in range(3):
                # the upper end moves with the tip
                row[12 + 3 * i + j] = turn[u, i, j] + (i == j) if b >= 0 else 0.0
        row[21], row[22], row[23], row[24] = length, tension[n], own[11], own[12]
