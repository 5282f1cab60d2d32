"""Forces and stiffness of the elements of one build, as loops that `numba` compiles.

The formulas are those of `string`, `bending`, `blade` and `spring`, which work on arrays of any
type of number. The functions here work on the doubles of one build at a time, some hundred times
faster in a batch. `tests/equilibrium/test_compiled.py` compares both on random scenes.

The numbers of a build are packed into one row per element, in the order given by `WIRE`, `BLADE`,
`SPRING` and `FLEX`.

The span d of a wire changes with translations x and small rotations t of the upper and the lower
body, whose attachments have the arms a and b, and with the deflection q of a blade tip on a body
turned by R:  dd = x_l - x_u + [a] t_u - [b] t_l - R q,  where [a] v = a x v. With the force F on
the span, dF = S dd + X_u t_u + X_l t_l (a string has no X), and with

    A = S [a] + X_u,   B = S [b] - X_l,   dF = S (x_l - x_u - R q) + A t_u - B t_l,

all blocks of the stiffness follow: S between translations, A and B between these and rotations,
and from the change of the torques [a]^T F and -[b]^T F (and of those that bending and twisting
exert, with second derivatives Y)

    [a]^T A + X_u^T [a] + Y_uu,  -[b]^T A + X_l^T [a] + Y_lu,  [b]^T B - X_l^T [b] + Y_ll

between rotations, to which the rotation of the arms themselves adds (see `geometric_stiffness`).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.compiled import compiled, inlined
from suspension_cli.elements.compiled_arrays import Derivatives, PoseArrays, WireRows
from suspension_cli.elements.compiled_vectors import (
    Matrix,
    Vector,
    add_block,
    add_lower,
    add_vector,
    added,
    cross,
    cross_matrix,
    cross_times,
    diagonal,
    dot,
    matrix,
    minus,
    multiple,
    outer,
    plus,
    product,
    scaled,
    subtract_block,
    subtracted,
    symmetric,
    times,
    times_cross,
    trace,
    transposed,
    turned,
    turning,
    vector,
)
from suspension_cli.elements.compiled_wire import resting
from suspension_cli.elements.lean import SERIES, SMALL

if TYPE_CHECKING:
    from jaxtyping import Float, Int

WIRE = ("upper_point", "lower_point", "span", "length", "tension", "stiffness", "torsion")
"""Fields of `Wires` in a row of 13 numbers."""
UPPER_POINT, LOWER_POINT, SPAN, LENGTH, TENSION, STIFFNESS, TORSION = 0, 3, 6, 9, 10, 11, 12
BLADE = ("stiffness", "load")
"""Fields of `Blades` in a row of 6 numbers."""
BLADE_STIFFNESS, LOAD = 0, 3
SPRING = ("upper_point", "lower_point", "stiffness", "preload", "leg")
"""Fields of `Springs` in a row of 49 numbers."""
SPRING_STIFFNESS, PRELOAD, LEG = 6, 42, 48
FLEX = ("upper", "lower", "bend", "twist")
"""Fields of `Flex` in a row of 19 numbers."""
UPPER_NORMALS, LOWER_NORMALS, BEND, TWIST = 0, 6, 12, 18


@inlined
def _reach(wires: WireRows, pose: PoseArrays, n: int) -> tuple[Vector, Vector, Vector, Vector]:
    """Arms of both ends of a wire, the change of its span from the nominal one, and its span."""
    shift, turn, deflection = pose
    u, l, b = wires.ends[n, 0], wires.ends[n, 1], wires.ends[n, 2]
    turn_u, turn_l = matrix(turn, u), matrix(turn, l)
    upper, lower = vector(wires.numbers, n, UPPER_POINT), vector(wires.numbers, n, LOWER_POINT)
    deflected = vector(deflection, b, 0) if b >= 0 else (0.0, 0.0, 0.0)
    # from displacements alone, so that nothing cancels
    moved = minus(vector(shift, l, 0), vector(shift, u, 0))
    change = plus(moved, minus(times(turn_l, lower), times(turn_u, upper)))
    change = minus(change, turned(turn_u, deflected))
    span = plus(vector(wires.numbers, n, SPAN), change)
    return turned(turn_u, plus(upper, deflected)), turned(turn_l, lower), change, span


@inlined
def _slopes(
    e: Vector, upper: Vector, lower: Vector, flex: Float[np.ndarray, "wire 19"], n: int, plane: int
) -> tuple[float, float, float, float, float]:
    """Stiffness S_uu, S_ul, S_ll of a wire in one plane, and the moments at its ends, N m."""
    first = BEND + 3 * plane
    s_uu, s_ul, s_ll = flex[n, first], flex[n, first + 1], flex[n, first + 2]
    a, b = -dot(e, upper), -dot(e, lower)
    return s_uu, s_ul, s_ll, s_uu * a + s_ul * b, s_ul * a + s_ll * b


@inlined
def _across(e: Vector, n: Vector) -> Vector:
    """The part of a vector across the wire."""
    return minus(n, scaled(dot(n, e), e))


@inlined
def _add_bending_force(
    e: Vector,
    length: float,
    upper: Vector,
    lower: Vector,
    flex: Float[np.ndarray, "wire 19"],
    n: int,
    plane: int,
    forces: tuple[Vector, Vector, Vector],
) -> tuple[Vector, Vector, Vector]:
    """Add the force on the span and the torques on both bodies of bending in one plane.

    See `bending`; `upper` and `lower` are the normals of the plane at the ends.
    """
    force, torque_u, torque_l = forces
    _, _, _, m_u, m_l = _slopes(e, upper, lower, flex, n, plane)
    sheared = plus(scaled(m_u, _across(e, upper)), scaled(m_l, _across(e, lower)))
    return (
        minus(force, scaled(1 / length, sheared)),
        plus(torque_u, scaled(m_u, cross(e, upper))),
        plus(torque_l, scaled(m_l, cross(e, lower))),
    )


@inlined
def _turned_slope(e: Vector, moment: float, n: Vector) -> Matrix:
    """Second derivative of a slope -e . n times a moment, in the span at length 1."""
    along, flat = dot(e, n), _across(e, n)
    mixed = added(outer(e, flat), outer(flat, e))
    return multiple(moment, added(mixed, multiple(along, subtracted(diagonal(1.0), outer(e, e)))))


@inlined
def _add_bending_stiffness(
    e: Vector,
    length: float,
    upper: Vector,
    lower: Vector,
    flex: Float[np.ndarray, "wire 19"],
    n: int,
    plane: int,
    parts: tuple[Matrix, Matrix, Matrix, Matrix, Matrix, Matrix],
) -> tuple[Matrix, Matrix, Matrix, Matrix, Matrix, Matrix]:
    """Add bending in one plane to S, X_u, X_l, Y_uu, Y_lu and Y_ll."""
    s, x_u, x_l, y_uu, y_lu, y_ll = parts
    s_uu, s_ul, s_ll, m_u, m_l = _slopes(e, upper, lower, flex, n, plane)
    f_u, f_l, c_u, c_l = _across(e, upper), _across(e, lower), cross(e, upper), cross(e, lower)
    on_u = plus(scaled(s_uu, f_u), scaled(s_ul, f_l))
    on_l = plus(scaled(s_ul, f_u), scaled(s_ll, f_l))
    bent = added(
        added(outer(f_u, on_u), outer(f_l, on_l)),
        added(_turned_slope(e, m_u, upper), _turned_slope(e, m_l, lower)),
    )
    turn_u = subtracted(cross_matrix(upper), outer(e, c_u))
    turn_l = subtracted(cross_matrix(lower), outer(e, c_l))
    return (
        added(s, multiple(1 / (length * length), bent)),
        added(x_u, multiple(1 / length, subtracted(multiple(m_u, turn_u), outer(on_u, c_u)))),
        added(x_l, multiple(1 / length, subtracted(multiple(m_l, turn_l), outer(on_l, c_l)))),
        added(y_uu, added(multiple(s_uu, outer(c_u, c_u)), turning(scaled(-m_u, e), upper))),
        added(y_lu, multiple(s_ul, outer(c_l, c_u))),
        added(y_ll, added(multiple(s_ll, outer(c_l, c_l)), turning(scaled(-m_l, e), lower))),
    )


@inlined
def _twist(normals: tuple[Vector, Vector, Vector, Vector]) -> tuple[float, Vector]:
    """Twist of a wire, rad, and its derivative with respect to the rotation of the lower body."""
    u_1, u_2, l_1, l_2 = normals
    return (dot(l_1, u_2) - dot(l_2, u_1)) / 2, scaled(0.5, minus(cross(l_1, u_2), cross(l_2, u_1)))


@inlined
def _add_twisting_stiffness(
    stiffness: float,
    normals: tuple[Vector, Vector, Vector, Vector],
    parts: tuple[Matrix, Matrix, Matrix],
) -> tuple[Matrix, Matrix, Matrix]:
    """Add twisting to Y_uu, Y_lu and Y_ll."""
    y_uu, y_lu, y_ll = parts
    u_1, u_2, l_1, l_2 = normals
    twist, row = _twist(normals)
    torque, own = stiffness * twist, multiple(stiffness, outer(row, row))
    half = scaled(torque / 2, u_1), scaled(torque / 2, u_2)
    mixed = added(diagonal(torque * twist), subtracted(outer(half[0], l_2), outer(half[1], l_1)))
    on_l = subtracted(turning(half[1], l_1), turning(half[0], l_2))
    on_u = subtracted(turning(l_1, half[1]), turning(l_2, half[0]))
    return (
        added(y_uu, added(own, on_u)),
        added(y_lu, subtracted(mixed, own)),
        added(y_ll, added(own, on_l)),
    )


@compiled
def add_wires(
    wires: WireRows,
    tips: Int[np.ndarray, "blade 3"],
    pose: PoseArrays,
    tension: Float[np.ndarray, " wire"],
    derivatives: Derivatives,
    curved: bool,
    form: Float[np.ndarray, "_ _"],
) -> None:
    """Add the derivatives of the energy of all wires of one build, the second ones if `curved`.

    Parameters
    ----------
    wires
        With sections, the stiffness against bending and twisting in `flex` is set to that of the
        tension in this pose.
    tips
        Coordinates of the tips of blades, see `Layout`.
    tension
        To be filled, N.
    form
        (0, 0), or (w, N) to be filled with the elongation of each wire per coordinate; the Hessian
        is then that of wires that do not stretch.
    """
    ends, sections, numbers, flex = wires
    gradient, hessian, on_tips = derivatives
    bends, stretches, size = len(flex) > 0, len(form) == 0, len(gradient)
    nothing = (0.0, 0.0, 0.0)
    none = (nothing, nothing, nothing)
    for n in range(len(numbers)):
        u, l, b = ends[n, 0], ends[n, 1], ends[n, 2]
        turn_u, turn_l = matrix(pose.turn, u), matrix(pose.turn, l)
        arm_u, arm_l, change, span = _reach(wires, pose, n)
        length = math.sqrt(dot(span, span))
        longer = dot(change, plus(vector(numbers, n, SPAN), span)) / (length + numbers[n, LENGTH])
        pull = numbers[n, TENSION] + numbers[n, STIFFNESS] * longer
        tension[n] = pull
        e = scaled(1 / length, span)
        force, torque_u, torque_l = scaled(pull, e), nothing, nothing
        u_1, u_2, l_1, l_2 = e, e, e, e
        if bends:
            if len(sections) and pull > 0:
                resting(sections, n, length, pull, numbers[n, TORSION], flex)
            u_1 = turned(turn_u, vector(flex, n, UPPER_NORMALS))
            u_2 = turned(turn_u, vector(flex, n, UPPER_NORMALS + 3))
            l_1 = turned(turn_l, vector(flex, n, LOWER_NORMALS))
            l_2 = turned(turn_l, vector(flex, n, LOWER_NORMALS + 3))
            forces = force, torque_u, torque_l
            forces = _add_bending_force(e, length, u_1, l_1, flex, n, 0, forces)
            forces = _add_bending_force(e, length, u_2, l_2, flex, n, 1, forces)
            force, torque_u, torque_l = forces
            twist, row = _twist((u_1, u_2, l_1, l_2))
            torque = scaled(flex[n, TWIST] * twist, row)
            torque_u, torque_l = minus(torque_u, torque), plus(torque_l, torque)
        x_u, t_u, x_l, t_l = 6 * u, 6 * u + 3, 6 * l, 6 * l + 3
        add_vector(gradient, x_u, scaled(-1.0, force))
        add_vector(gradient, t_u, plus(torque_u, cross(force, arm_u)))
        add_vector(gradient, x_l, force)
        add_vector(gradient, t_l, plus(torque_l, cross(arm_l, force)))
        if b >= 0:
            for axis in range(3):
                on_tips[b, axis] -= force[axis]
        if not curved:
            continue
        rotation = added(diagonal(1.0), turn_u)
        if not stretches:
            add_vector(form[n], x_u, scaled(-1.0, e))
            add_vector(form[n], t_u, cross(e, arm_u))
            add_vector(form[n], x_l, e)
            add_vector(form[n], t_l, cross(arm_l, e))
            along = times(transposed(rotation), e)
            for axis in range(3 if b >= 0 else 0):
                if tips[b, axis] < size:
                    form[n, tips[b, axis]] -= along[axis]
        over = pull / length
        k = (numbers[n, STIFFNESS] if stretches else 0.0) - over
        s = added(diagonal(over), multiple(k, outer(e, e)))
        uu, lu, ll = turning(scaled(-1.0, force), arm_u), none, turning(force, arm_l)
        if bends:
            parts = s, none, none, uu, lu, ll
            parts = _add_bending_stiffness(e, length, u_1, l_1, flex, n, 0, parts)
            parts = _add_bending_stiffness(e, length, u_2, l_2, flex, n, 1, parts)
            s, xu, xl, uu, lu, ll = parts
            twisted = _add_twisting_stiffness(flex[n, TWIST], (u_1, u_2, l_1, l_2), (uu, lu, ll))
            uu, lu, ll = twisted
            uu = added(uu, times_cross(transposed(xu), arm_u))
            lu = added(lu, times_cross(transposed(xl), arm_u))
            ll = subtracted(ll, times_cross(transposed(xl), arm_l))
            to_u = added(times_cross(s, arm_u), xu)
            to_l = subtracted(times_cross(s, arm_l), xl)
        else:
            to_u, to_l = times_cross(s, arm_u), times_cross(s, arm_l)
        add_lower(hessian, x_u, s)
        subtract_block(hessian, t_u, x_u, transposed(to_u))
        add_lower(hessian, t_u, added(uu, cross_times(arm_u, to_u)))
        subtract_block(hessian, x_l, x_u, s)
        add_block(hessian, x_l, t_u, to_u)
        add_block(hessian, t_l, x_u, transposed(to_l))
        add_block(hessian, t_l, t_u, subtracted(lu, cross_times(arm_l, to_u)))
        add_lower(hessian, x_l, s)
        subtract_block(hessian, t_l, x_l, transposed(to_l))
        add_lower(hessian, t_l, added(ll, cross_times(arm_l, to_l)))
        if b < 0:
            continue
        for axis in range(3):
            tip = tips[b, axis]
            if tip == size:
                continue
            moves = rotation[0][axis], rotation[1][axis], rotation[2][axis]
            stiff = times(s, moves)
            on_u, on_l = times(transposed(to_u), moves), times(transposed(to_l), moves)
            add_vector(hessian[tip], x_u, stiff)
            add_vector(hessian[tip], t_u, scaled(-1.0, on_u))
            add_vector(hessian[tip], x_l, scaled(-1.0, stiff))
            add_vector(hessian[tip], t_l, on_l)
            for other in range(axis + 1):
                if tips[b, other] < size:
                    hessian[tip, tips[b, other]] += (
                        rotation[0][other] * stiff[0]
                        + rotation[1][other] * stiff[1]
                        + rotation[2][other] * stiff[2]
                    )


@compiled
def add_blades(
    body: Int[np.ndarray, " blade"],
    tips: Int[np.ndarray, "blade 3"],
    blades: Float[np.ndarray, "blade 6"],
    pose: PoseArrays,
    derivatives: Derivatives,
    curved: bool,
) -> None:
    """Add the derivatives of the energy of all blades of one build, once all else is added.

    The gradient `on_tips` is then that of the energy of all that the tips carry.
    """
    gradient, hessian, on_tips = derivatives
    _, turn, deflection = pose
    for n in range(len(blades)):
        rotation, pulled = added(diagonal(1.0), matrix(turn, body[n])), vector(on_tips, n, 0)
        for axis in range(3):
            tip = tips[n, axis]
            if tip == len(gradient):
                continue
            moves = rotation[0][axis], rotation[1][axis], rotation[2][axis]
            k = blades[n, BLADE_STIFFNESS + axis]
            gradient[tip] += k * deflection[n, axis] - blades[n, LOAD + axis] + dot(moves, pulled)
            if curved:
                hessian[tip, tip] += k
                # the gradient F at a tip, deflected by q, adds -t . [F] R q as its body rotates
                add_vector(hessian[tip], 6 * body[n] + 3, cross(moves, pulled))


@inlined
def _form(springs: Float[np.ndarray, "spring 49"], n: int, first: int) -> Matrix:
    """Block of the stiffness (6, 6) of a spring, from its first column."""
    return vector(springs, n, first), vector(springs, n, first + 6), vector(springs, n, first + 12)


@inlined
def _lean(delta: Vector, length: float) -> tuple[Vector, Matrix, Vector, Matrix]:
    """Lean of a leg with its derivatives by delta, and gradient and Hessian of L f, see `lean`."""
    x, y, z = delta[0], delta[1], length + delta[2]
    q = x * x + y * y
    t, n = q / (z * z), z * z + q
    if t < SMALL:
        a, first, second = 0.0, 0.0, 0.0
        for power in range(SERIES.shape[1] - 1, -1, -1):
            a = a * t + SERIES[0, power]
            first = first * t + SERIES[1, power]
            second = second * t + SERIES[2, power]
    else:
        a = math.atan(math.sqrt(t)) / math.sqrt(t)
        first = (1 / (1 + t) - a) / (2 * t)
        second = -(1 / (1 + t) ** 2 + 3 * first) / (2 * t)
    f, f_q, f_qq = length * a / z, length * first / z**3, length * second / z**5
    f_qz, f_zz = length / n**2, length * 2 * z / n**2
    across, slope = (x, y, 0.0), (2 * f_q * x, 2 * f_q * y, -length / n)
    curve = (
        (2 * f_q + 4 * f_qq * x * x, 4 * f_qq * x * y, 2 * x * f_qz),
        (4 * f_qq * x * y, 2 * f_q + 4 * f_qq * y * y, 2 * y * f_qz),
        (2 * x * f_qz, 2 * y * f_qz, f_zz),
    )
    rates = added(((f, 0.0, 0.0), (0.0, f, 0.0), (0.0, 0.0, 1.0)), outer(across, slope))
    return (f * x, f * y, delta[2]), rates, slope, curve


@compiled
def add_springs(
    ends: Int[np.ndarray, "spring 2"],
    springs: Float[np.ndarray, "spring 49"],
    pose: PoseArrays,
    derivatives: Derivatives,
    curved: bool,
) -> None:
    """Add the derivatives of the energy of all springs of one build, see `spring`.

    In terms of dF = S (x_l - x_u) + A t_u - B t_l, as for wires, A = S [r] - C and B = S [w] - C.
    """
    (shift, turn, _), (gradient, hessian, _) = pose, derivatives
    for n in range(len(springs)):
        u, l = ends[n, 0], ends[n, 1]
        above, below = added(diagonal(1.0), matrix(turn, u)), added(diagonal(1.0), matrix(turn, l))
        to_upper = transposed(above)
        upper, lower = vector(springs, n, 0), vector(springs, n, 3)
        arm = turned(matrix(turn, l), lower)
        moved = minus(plus(minus(upper, lower), vector(shift, l, 0)), vector(shift, u, 0))
        reach = plus(moved, arm)
        q = product(to_upper, below)
        delta = minus(times(to_upper, reach), upper)
        phi = (q[2][1] - q[1][2]) / 2, (q[0][2] - q[2][0]) / 2, (q[1][0] - q[0][1]) / 2
        straight, mixed, turns = (
            _form(springs, n, SPRING_STIFFNESS),
            _form(springs, n, SPRING_STIFFNESS + 3),
            _form(springs, n, SPRING_STIFFNESS + 21),
        )
        # d(phi) = spin (t_l - t_u)
        spin = product(multiple(0.5, subtracted(diagonal(trace(q)), q)), to_upper)
        length, across, slope = springs[n, LEG], (delta[0], delta[1], 0.0), delta
        rates, curve = diagonal(1.0), diagonal(0.0)
        if length > 0:
            delta, rates, slope, curve = _lean(delta, length)
            axis = below[0][2], below[1][2], below[2][2]
            tilts = product(to_upper, cross_matrix(axis))
            phi, spin = (-q[1][2], q[0][2], phi[2]), (tilts[1], scaled(-1.0, tilts[0]), spin[2])
        pull = minus(plus(times(straight, delta), times(mixed, phi)), vector(springs, n, PRELOAD))
        twist = plus(times(transposed(mixed), delta), times(turns, phi))
        twist = minus(twist, vector(springs, n, PRELOAD + 3))
        if length > 0:
            flat = (pull[0], pull[1], 0.0)
            curve = added(multiple(dot(flat, across), curve), outer(flat, slope))
            curve = added(curve, outer(slope, flat))
            straight = added(product(product(transposed(rates), straight), rates), curve)
            mixed, pull = product(transposed(rates), mixed), times(transposed(rates), pull)
        force, torque = times(above, pull), times(transposed(spin), twist)
        x_u, t_u, x_l, t_l = 6 * u, 6 * u + 3, 6 * l, 6 * l + 3
        add_vector(gradient, x_u, scaled(-1.0, force))
        add_vector(gradient, t_u, minus(cross(force, reach), torque))
        add_vector(gradient, x_l, force)
        add_vector(gradient, t_l, plus(cross(arm, force), torque))
        if not curved:
            continue
        s, c = product(product(above, straight), to_upper), product(product(above, mixed), spin)
        to_u, to_l = subtracted(times_cross(s, reach), c), subtracted(times_cross(s, arm), c)
        back = transposed(c)
        # second derivatives of phi times its pull
        skew = cross_matrix(twist)
        if length > 0:
            skew = (
                (0.0, skew[0][1], 2 * twist[1]),
                (skew[1][0], 0.0, -2 * twist[0]),
                (0.0, 0.0, 0.0),
            )
        g = product(product(above, skew), transposed(below))
        stiff = product(product(transposed(spin), turns), spin)
        own = subtracted(added(stiff, multiple(0.5, symmetric(g))), diagonal(trace(g) / 2))
        uu = added(
            turning(force, reach), subtracted(cross_times(reach, to_u), times_cross(back, reach))
        )
        ll = added(turning(force, arm), subtracted(cross_times(arm, to_l), times_cross(back, arm)))
        lu = subtracted(diagonal(dot(arm, force) + trace(g) / 2), outer(force, arm))
        lu = subtracted(lu, added(stiff, multiple(0.5, g)))
        lu = added(lu, subtracted(times_cross(back, reach), cross_times(arm, to_u)))
        on_u = subtracted(to_u, cross_matrix(force))
        add_lower(hessian, x_u, s)
        subtract_block(hessian, t_u, x_u, transposed(on_u))
        add_lower(hessian, t_u, added(own, uu))
        subtract_block(hessian, x_l, x_u, s)
        add_block(hessian, x_l, t_u, on_u)
        add_block(hessian, t_l, x_u, transposed(to_l))
        add_block(hessian, t_l, t_u, lu)
        add_lower(hessian, x_l, s)
        subtract_block(hessian, t_l, x_l, transposed(to_l))
        add_lower(hessian, t_l, added(own, ll))


@compiled
def fill_geometry(
    wires: WireRows,
    pose: PoseArrays,
    tension: Float[np.ndarray, " wire"],
    result: Float[np.ndarray, "wire 25"],
) -> None:
    """Fill the geometry of the wires of one build, see `compiled_wire.WireArrays`."""
    ends, _, numbers, flex = wires
    for n in range(len(numbers)):
        u, l, b = ends[n, 0], ends[n, 1], ends[n, 2]
        turn_u, turn_l = matrix(pose.turn, u), matrix(pose.turn, l)
        arm_u, arm_l, _, span = _reach(wires, pose, n)
        length = math.sqrt(dot(span, span))
        e = scaled(1 / length, span)
        both = plus(
            turned(turn_u, vector(flex, n, UPPER_NORMALS)),
            turned(turn_l, vector(flex, n, LOWER_NORMALS)),
        )
        normal = _across(e, both)
        normal = scaled(1 / math.sqrt(dot(normal, normal)), normal)
        # the upper end moves with the tip
        moves = multiple(1.0 if b >= 0 else 0.0, added(diagonal(1.0), turn_u))
        result[n] = 0.0
        add_vector(result[n], 0, e)
        add_vector(result[n], 3, normal)
        add_vector(result[n], 6, arm_u)
        add_vector(result[n], 9, arm_l)
        for i in range(3):
            add_vector(result[n], 12 + 3 * i, moves[i])
        result[n, 21], result[n, 22] = length, tension[n]
        result[n, 23], result[n, 24] = numbers[n, STIFFNESS], numbers[n, TORSION]
