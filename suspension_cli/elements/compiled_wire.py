"""Bending and twisting of wires of one build, as loops that `numba` compiles.

The formulas are those of `beam`, `rod`, `joined_sections` and `dynamic_wire`, which work on arrays;
`tests/equilibrium/test_compiled.py` compares both. A section of a wire is a row of 10 numbers:
length (m), EI in both planes, EA, GJ, I_p/A, mass and polar moment of inertia per length, 1 if it
is round, and the tension beyond that of the wire (N; of wires with mass).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from suspension_cli.compiled import compiled
from suspension_cli.elements.beam import COEFFICIENT, EPS, GAP_TERMS, SERIES, TERMS
from suspension_cli.elements.compiled_vectors import (
    Vector,
    add_vector,
    cross,
    times,
    transposed,
    vector,
)
from suspension_cli.scene.composition import Fibre

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Int

Number = TypeVar("Number", float, complex)

_COEFFICIENT = np.array(COEFFICIENT)
LENGTH, SOFT, STIFF, STRETCHING, TWISTING, POLAR_AREA, MASS, POLAR, ROUND, OFFSET = range(10)
"""Columns of a section."""
Slopes = tuple[float, float, float]
"""Static stiffness aa, ab, bb of a beam on the slopes a and b of its ends to the chord, N m."""


class WireArrays(NamedTuple):
    """Wires of many builds in equilibrium.

    Attributes
    ----------
    place
        Coordinates of the upper body, the lower body and the tip of each wire; N for none.
    sections
        See the docstring of this module.
    geometry
        Unit vector e along the wire, n_1 of its first plane, arms of its upper and lower end,
        motion of the upper end with the tip (9), length, tension, stiffness and torsion (0 where
        the design gives none).
    """

    place: Int[np.ndarray, "wire 15"]
    sections: Float[np.ndarray, "wire section 10"]
    geometry: Float[np.ndarray, "build wire 25"]


class Losses(NamedTuple):
    """Losses of wires; `add_dynamic` takes them of all wires, with frequencies in front of angles.

    Attributes
    ----------
    angles
        Loss angles: bulk and surface of bending in both planes, of stretching and twisting; then
        the thermoelastic ones of bending at a coefficient of expansion of 1 (1/K).
    slopes
        That coefficient without tension, 1/K, and its decrease per tension, 1/(K N).
    drag
        Of the gas, per length, for both planes, stretching and twisting.
    """

    angles: Float[np.ndarray, "... section 6"]
    slopes: Float[np.ndarray, "... section 2"]
    drag: Float[np.ndarray, "... section 4"]


def wire_sections(fibres: tuple[Fibre, ...]) -> Float[np.ndarray, "wire section 10"]:
    """Sections of wires; a wire with fewer sections than others has some of no length."""
    most = max((len(fibre.sections) for fibre in fibres), default=0)
    result = np.zeros((len(fibres), most, 10))
    for n, fibre in enumerate(fibres):
        for m, own in enumerate(fibre.sections):
            result[n, m] = (
                own.length,
                *own.rigidity,
                own.stretching,
                own.twisting,
                own.polar_area,
                own.mass,
                own.polar,
                own.round,
                own.tension_offset,
            )
    return result


@compiled
def _static_slopes(rigidity: float, tension: float, length: float) -> Slopes:
    """Static stiffness of a beam under tension on the slopes a, b of its ends to the chord.

    Without loss; the chord alone has T L.
    """
    h = length / 2
    alpha = math.sqrt(tension / rigidity)
    u = alpha * h
    if u < 1.0:
        square = u * u
        gap = _gap_series(square) / math.cosh(u)  # 1 - tanh(u)/u
        t = h * (1 - gap)
    else:
        t = math.tanh(u) / alpha
        gap = 1 - t / h
    # u^2 / gap tends to 3 without tension
    ratio = 3.0 if u == 0.0 else u * u / gap
    even, odd = 2 * rigidity / t, 2 * rigidity * ratio * t / (h * h)
    return (odd + even) / 4, (odd - even) / 4, (odd + even) / 4


@compiled
def join_slopes(upper: Slopes, lower: Slopes, above: float, below: float, tension: float) -> Slopes:
    """Join two beams of given lengths at rest, see `joined_sections`."""
    p, q = 1 / above, 1 / below
    string = tension * (p + q)
    # of the node: at eta, between eta and zeta, at zeta; then with a and with b
    ee = p * p * (upper[0] + 2 * upper[1] + upper[2]) + string
    ee += q * q * (lower[0] + 2 * lower[1] + lower[2])
    ez = q * (lower[0] + lower[1]) - p * (upper[1] + upper[2])
    zz = upper[2] + lower[0]
    ea, za = -p * (upper[0] + upper[1]), upper[1]
    eb, zb = q * (lower[1] + lower[2]), lower[1]
    over = 1 / (ee * zz - ez * ez)
    eta_a, zeta_a = (ez * za - zz * ea) * over, (ez * ea - ee * za) * over
    eta_b, zeta_b = (ez * zb - zz * eb) * over, (ez * eb - ee * zb) * over
    # slopes (a, b) of the upper and of the lower beam, for a = 1 and for b = 1 of both together
    first = (1 - p * eta_a, zeta_a - p * eta_a, zeta_a + q * eta_a, q * eta_a)
    second = (-p * eta_b, zeta_b - p * eta_b, zeta_b + q * eta_b, 1 + q * eta_b)
    return (
        _slope_energy(upper, lower, first, first) + string * eta_a * eta_a,
        _slope_energy(upper, lower, first, second) + string * eta_a * eta_b,
        _slope_energy(upper, lower, second, second) + string * eta_b * eta_b,
    )


@compiled
def _slope_energy(
    upper: Slopes,
    lower: Slopes,
    one: tuple[float, float, float, float],
    other: tuple[float, float, float, float],
) -> float:
    return (
        upper[0] * one[0] * other[0]
        + upper[1] * (one[0] * other[1] + one[1] * other[0])
        + upper[2] * one[1] * other[1]
        + lower[0] * one[2] * other[2]
        + lower[1] * (one[2] * other[3] + one[3] * other[2])
        + lower[2] * one[3] * other[3]
    )


@compiled
def _gap_series(square: Number) -> Number:
    """Sum cosh u - sinh(u)/u, see `beam`."""
    term, total = square / 6, 0.0 * square
    for k in range(1, GAP_TERMS + 1):
        total += 2 * k * term
        term *= square / ((2 * k + 2) * (2 * k + 3))
    return total


@compiled
def join(
    upper: Complex[np.ndarray, "4 4"], lower: Complex[np.ndarray, "4 4"], above: float, below: float
) -> None:
    """Join two beams of given lengths on (W, phi, a, b), in place of the upper one.

    See `joined_sections`.
    """
    p, q = 1 / above, -1 / below
    node = np.empty((2, 4), dtype=np.complex128)  # forces on eta and zeta per W, phi, a, b
    push, pull = np.empty(4, dtype=np.complex128), np.empty(4, dtype=np.complex128)
    for k in range(4):
        push[k] = upper[k, 0] / 2 + p * (upper[k, 1] - upper[k, 2] - upper[k, 3])
        pull[k] = lower[k, 0] / 2 + q * (lower[k, 1] - lower[k, 2] - lower[k, 3])
    ee = push[0] / 2 + p * (push[1] - push[2] - push[3])
    ee += pull[0] / 2 + q * (pull[1] - pull[2] - pull[3])
    ez, zz = push[3] + pull[2], upper[3, 3] + lower[2, 2]
    node[0, 0], node[1, 0] = push[0] + pull[0], upper[0, 3] + lower[0, 2]
    node[0, 1] = push[1] + pull[1] - below / 2 * push[0] + above / 2 * pull[0]
    node[1, 1] = upper[1, 3] + lower[1, 2] - below / 2 * upper[0, 3] + above / 2 * lower[0, 2]
    node[0, 2], node[1, 2] = push[2], upper[2, 3]
    node[0, 3], node[1, 3] = pull[3], lower[2, 3]
    over = 1 / (ee * zz - ez * ez)
    one, other = np.empty((4, 4), dtype=np.complex128), np.empty((4, 4), dtype=np.complex128)
    for j in range(4):
        eta = (ez * node[1, j] - zz * node[0, j]) * over
        zeta = (ez * node[0, j] - ee * node[1, j]) * over
        one[0, j] = other[0, j] = eta / 2
        one[1, j], one[2, j], one[3, j] = p * eta, -p * eta, zeta - p * eta
        other[1, j], other[2, j], other[3, j] = q * eta, zeta - q * eta, -q * eta
    for form, length in ((one, -below), (other, above)):
        form[0, 0] += 1.0
        form[0, 1] += length / 2
        form[1, 1] += 1.0
    one[2, 2] += 1.0
    other[3, 3] += 1.0
    force = np.empty((2, 4), dtype=np.complex128)
    whole = np.empty((4, 4), dtype=np.complex128)
    for j in range(4):
        for k in range(4):
            first = second = 0.0 * ee
            for i in range(4):
                first += upper[k, i] * one[i, j]
                second += lower[k, i] * other[i, j]
            force[0, k], force[1, k] = first, second
        for i in range(j + 1):
            total = 0.0 * ee
            for k in range(4):
                total += one[k, i] * force[0, k] + other[k, i] * force[1, k]
            whole[i, j] = whole[j, i] = total
    for i in range(4):
        for j in range(4):
            upper[i, j] = whole[i, j]


@compiled
def _to_ends(stiffness: Complex[np.ndarray, "4 4"], length: float) -> None:
    """Transform a stiffness on (W, phi, a, b) to w_1, w'_1, w_2, w'_2, in place."""
    for _ in range(2):
        for k in range(4):
            row = stiffness[k]
            mean, chord = row[0] / 2, (row[1] - row[2] - row[3]) / length
            row[0], row[1], row[2] = mean - chord, row[2], mean + chord
        for i in range(4):
            for j in range(i):
                stiffness[i, j], stiffness[j, i] = stiffness[j, i], stiffness[i, j]


@compiled
def _resting_slopes(
    sections: Float[np.ndarray, "wire section 10"],
    wire: int,
    plane: int,
    tension: float,
    stretch: float,
) -> Slopes:
    """Static stiffness of a wire on the slopes of its ends to the chord in one plane."""
    whole, above = (0.0, 0.0, 0.0), 0.0
    for m in range(sections.shape[1]):
        own = sections[wire, m, LENGTH] * stretch
        if own > 0.0:
            part = _static_slopes(sections[wire, m, SOFT + plane], tension, own)
            whole = join_slopes(whole, part, above, own, tension) if above > 0.0 else part
            above += own
    return whole


@compiled
def hinge_distances(
    sections: Float[np.ndarray, "wire section 10"],
    wire: int,
    iterations: int,
    length: Float[np.ndarray, " build"],
    tension: Float[np.ndarray, " build"],
    result: Float[np.ndarray, "build 2"],
) -> None:
    """Fill the distances of the hinges of one wire from its clamps, see `equilibrium.clamps`.

    Parameters
    ----------
    wire, iterations
        Number of the wire, and of steps of the iteration.
    length, tension
        Length between the hinges, m, and tension, N.
    result
        At the upper and the lower end, m.
    """
    drawn = 0.0
    for m in range(sections.shape[1]):
        drawn += sections[wire, m, LENGTH]
    for p in range(len(length)):
        upper = lower = 0.0
        for _ in range(iterations):
            stretch = (length[p] + upper + lower) / drawn
            aa, ab, bb = _resting_slopes(sections, wire, 0, tension[p], stretch)
            total = drawn * stretch
            rigid = tension[p] * total + aa + 2 * ab + bb  # against turning the chord alone
            upper, lower = (aa + ab) * total / rigid, (ab + bb) * total / rigid
        result[p, 0], result[p, 1] = upper, lower


@compiled
def resting(
    sections: Float[np.ndarray, "wire section 10"],
    wire: int,
    length: float,
    tension: float,
    torsion: float,
    flex: Float[np.ndarray, "wire 19"],
) -> None:
    """Fill the static stiffness of a wire against rotation of its ends, and against twisting.

    Parameters
    ----------
    wire
        Number of the wire.
    length, tension, torsion
        Of the wire in this pose, m and N; torsional stiffness that the design gives, or 0, N m/rad.
    flex
        Its last 7 columns are filled: S_uu, S_ul, S_ll in both planes, and the torsional stiffness.
    """
    drawn, twist = 0.0, 0.0
    first, last = flex.shape[1] - 7, flex.shape[1] - 1
    for m in range(sections.shape[1]):
        drawn += sections[wire, m, LENGTH]
    stretch = length / drawn
    for plane in range(2):
        column = first + 3 * plane
        if plane == 1 and sections[wire, 0, ROUND] == 1.0:
            for i in range(3):
                flex[wire, column + i] = flex[wire, first + i]
            continue
        slopes = _resting_slopes(sections, wire, plane, tension, stretch)
        flex[wire, column], flex[wire, column + 1], flex[wire, column + 2] = slopes
    for m in range(sections.shape[1]):
        own = sections[wire, m, LENGTH] * stretch
        if own > 0.0:
            stiffness = sections[wire, m, TWISTING] + tension * sections[wire, m, POLAR_AREA]
            twist += own / stiffness
    flex[wire, last] = torsion if torsion > 0 else 1 / twist


@compiled
def _odd_series(p: complex, n: complex) -> complex:
    """Sum the series of N, see `beam._series`."""
    complete = np.empty(TERMS + 1, dtype=np.complex128)
    complete[0] = power = 1.0 + 0.0j
    for k in range(TERMS):
        power *= n
        complete[k + 1] = p * complete[k] + power
    product, total = p * n, 0.0j
    for j in range(TERMS // 2 - 1, -1, -1):
        inner = 0.0j
        for i in range(j + 1, TERMS):
            inner += _COEFFICIENT[i, j] * complete[i - j - 1]
        total = total * product + inner
    return total


@compiled
def _tanh(z: complex) -> complex:
    """Hyperbolic tangent for Re z >= 0; that of the library overflows."""
    if abs(z) < 1.0:
        return np.tanh(z)
    decay = np.exp(-2 * z)
    return (1 - decay) / (1 + decay)


@compiled
def _dynamic_beam(
    rigidity: complex,
    tension: float,
    mass: complex,
    length: float,
    omega: float,
    result: Complex[np.ndarray, "4 4"],
) -> None:
    """Dynamic stiffness of a beam under tension on (W, phi, a, b), see `beam`."""
    h = length / 2
    tau, m = tension / rigidity, mass * omega * omega / rigidity
    alpha2 = (tau + np.sqrt(tau * tau + 4 * m)) / 2
    if alpha2 == 0:
        alpha2 = (1e-8 / h) ** 2 + 0.0j
    beta2 = m / alpha2
    alpha, beta = np.sqrt(alpha2), np.sqrt(beta2)
    tanh, cos = _tanh(alpha * h) / alpha, np.cos(beta * h)
    sin = h + 0.0j if beta == 0 else np.sin(beta * h) / beta
    sum2 = alpha2 + beta2
    if abs(sum2) * h * h < SERIES:
        p, n = alpha2 * h * h, -beta2 * h * h
        odd = h * (p - n) * _odd_series(p, n) / np.cosh(alpha * h)
    else:
        odd = sin - cos * tanh
    if odd == 0:
        odd = EPS * (abs(sin) + abs(cos * tanh)) + 0.0j
    even = beta2 * sin + alpha2 * cos * tanh
    if even == 0:
        even = EPS * (abs(beta2 * sin) + abs(alpha2 * cos * tanh)) + 0.0j
    p, n = -beta2 * h * h, alpha2 * h * h
    behind = h * _gap_series(p) if abs(p) < 1 else h * cos - sin
    lag = h * _gap_series(n) / np.cosh(alpha * h) if abs(n) < 1 else h - tanh
    twice, product = 2 * rigidity, alpha2 * beta2
    even_wt, even_tt = twice * product * odd / even, twice * sum2 * cos / even
    odd_pd = -twice * (alpha2 * tanh * behind + beta2 * sin * lag) / odd
    odd_dd = twice * sum2 * sin * tanh / odd
    result[0, 0] = -twice * product * sum2 * sin * tanh / even
    result[1, 1] = tension * length + twice * sum2 * behind * lag / odd
    result[0, 1] = result[1, 0] = 0.0
    result[0, 2] = result[2, 0] = -even_wt / 2
    result[0, 3] = result[3, 0] = even_wt / 2
    result[1, 2] = result[2, 1] = result[1, 3] = result[3, 1] = odd_pd / 2
    result[2, 2] = result[3, 3] = (odd_dd + even_tt) / 4
    result[2, 3] = result[3, 2] = (odd_dd - even_tt) / 4


@compiled
def _join_rod(
    rigidity: complex,
    mass: complex,
    length: float,
    omega: float,
    springs: Complex[np.ndarray, " 3"],
    first: bool,
) -> None:
    """Join a rod below others: springs between the ends and to the ground.

    See `joined_sections.join_rods`.
    """
    h = length / 2
    kappa2 = mass * omega * omega / rigidity
    angle = np.sqrt(kappa2) * h
    tanc = 1.0 + 0.0j if angle == 0 else np.tan(angle) / angle
    even, odd = -2 * rigidity * kappa2 * h * tanc, 2 * rigidity / h / tanc
    below, end = (odd - even) / 4, even / 2
    if below == 0:  # no wave reaches the other end
        below = EPS * (abs(odd) + abs(even)) + 0.0j
    if first:
        springs[0], springs[1], springs[2] = below, end, end
        return
    spring, lower = springs[0], springs[2]
    own, ground = spring + below + lower + end, lower + end
    if own == 0:
        own = EPS * (abs(spring) + abs(below) + abs(lower) + abs(end)) + 0.0j
    springs[1] += spring * ground / own
    springs[2] = end + below * ground / own
    springs[0] = spring * below / own


@compiled
def add_dynamic(
    which: Int[np.ndarray, " system"],
    omega: Float[np.ndarray, " system"],
    number: Int[np.ndarray, " system"],
    wires: WireArrays,
    losses: Losses,
    massive: bool,
    dynamic: Complex[np.ndarray, "system coordinate coordinate"],
    compliance: Complex[np.ndarray, "system wire"],
) -> None:
    """Add F(omega) - F(0) of all wires to the stiffness of many systems; set their compliances.

    Parameters
    ----------
    which, omega, number
        Build, frequency (rad/s) and number of the frequency of each system.
    massive
        Whether the wires have inertia.
    dynamic
        To be added to; coordinates of rigid directions of tips are N and left out.
    compliance
        To be filled, m/N.
    """
    place, sections, geometry = wires
    angles, slopes, drag = losses
    whole, part = np.empty((4, 4), dtype=np.complex128), np.empty((4, 4), dtype=np.complex128)
    up, low = np.empty((2, 9)), np.empty((2, 6))
    springs = np.empty(3, dtype=np.complex128)
    for q in range(len(which)):
        w = omega[q]
        for n in range(place.shape[0]):
            own, where, target = geometry[which[q]], place[n], dynamic[q]
            length, tension, k, torsion = own[n, 21], own[n, 22], own[n, 23], own[n, 24]
            e, normal = vector(own, n, 0), vector(own, n, 3)
            drawn, stretching, twisting = 0.0, 0.0, 0.0
            for m in range(sections.shape[1]):
                row = sections[n, m]
                if row[LENGTH] > 0.0:
                    drawn += row[LENGTH]
                    stretching += row[LENGTH] / row[STRETCHING]
                    twisting += row[LENGTH] / (row[TWISTING] + tension * row[POLAR_AREA])
            stretch = length / drawn
            stiffer = k * stretching * stretch
            turning = torsion * twisting * stretch if torsion > 0 else 1.0
            for plane in range(2):
                if plane == 0 or sections[n, 0, ROUND] == 0.0:
                    own_losses = Losses(angles[number[q], n], slopes[n], drag[n])
                    _join_bends(
                        sections[n], own_losses, plane, w, stretch, tension, massive, whole, part
                    )
                _fill_forms(own, n, normal, up, low)
                normal = cross(e, normal)
                _add_block(up, up, whole[:2, :2], where, UPPER, UPPER, target)
                _add_block(low, up, whole[2:, :2], where, LOWER, UPPER, target)
                _add_block(low, low, whole[2:, 2:], where, LOWER, LOWER, target)
            for part_of_rod in range(2):  # stretching, twisting
                first = True
                for m in range(sections.shape[1]):
                    row, lost = sections[n, m], angles[number[q], n, m]
                    if row[LENGTH] == 0.0:
                        continue
                    if part_of_rod == 0:
                        rigidity = row[STRETCHING] * stiffer * (1 + 1j * lost[2])
                        inertia = row[MASS] + 0.0j
                    else:
                        own_torsion = row[TWISTING] * (1 + 1j * lost[3])
                        rigidity = (own_torsion + tension * row[POLAR_AREA]) * turning
                        inertia = row[POLAR] + 0.0j
                    if massive and w > 0:
                        inertia -= 1j * drag[n, m, 2 + part_of_rod] / w
                    elif not massive:
                        inertia = 0.0j
                    _join_rod(rigidity, inertia, row[LENGTH] * stretch, w, springs, first)
                    first = False
                if part_of_rod == 0:
                    compliance[q, n] = 1 / springs[0]
                    if massive:
                        _fill_forms(own, n, e, up, low)
                        _add_along(up[0], springs[1], where, UPPER, target)
                        _add_along(low[0], springs[2], where, LOWER, target)
                else:
                    change = springs[0] - turning / (twisting * stretch)
                    _add_twist(e, change, springs[1], springs[2], where, target)


UPPER = np.array([0, 1, 2, 3, 4, 5, 12, 13, 14])
LOWER = np.array([6, 7, 8, 9, 10, 11])


@compiled
def _fill_forms(
    geometry: Float[np.ndarray, "wire 25"],
    wire: int,
    n: Vector,
    up: Float[np.ndarray, "2 9"],
    low: Float[np.ndarray, "2 6"],
) -> None:
    """Deflection along n and slope there of the upper and of the lower end, per coordinate."""
    moves = vector(geometry, wire, 12), vector(geometry, wire, 15), vector(geometry, wire, 18)
    slope = cross(vector(geometry, wire, 0), n)
    up[:], low[:] = 0.0, 0.0
    add_vector(up[0], 0, n)
    add_vector(up[0], 3, cross(vector(geometry, wire, 6), n))
    add_vector(up[0], 6, times(transposed(moves), n))
    add_vector(up[1], 3, slope)
    add_vector(low[0], 0, n)
    add_vector(low[0], 3, cross(vector(geometry, wire, 9), n))
    add_vector(low[1], 3, slope)


@compiled
def _add_block(
    left: Float[np.ndarray, "2 row"],
    right: Float[np.ndarray, "2 column"],
    block: Complex[np.ndarray, "2 2"],
    where: Int[np.ndarray, " 15"],
    rows: Int[np.ndarray, " row"],
    columns: Int[np.ndarray, " column"],
    target: Complex[np.ndarray, "coordinate coordinate"],
) -> None:
    """Add L^T B R to a symmetric matrix at some coordinates, and its mirror image."""
    same, size = left.shape[1] == right.shape[1], len(target)
    for i in range(left.shape[1]):
        a = where[rows[i]]
        if a == size:
            continue
        first = block[0, 0] * left[0, i] + block[1, 0] * left[1, i]
        second = block[0, 1] * left[0, i] + block[1, 1] * left[1, i]
        for j in range(i + 1 if same else right.shape[1]):
            b = where[columns[j]]
            if b < size:
                value = first * right[0, j] + second * right[1, j]
                target[a, b] += value
                if a != b:
                    target[b, a] += value


@compiled
def _add_along(
    form: Float[np.ndarray, " row"],
    stiffness: complex,
    where: Int[np.ndarray, " 15"],
    rows: Int[np.ndarray, " row"],
    target: Complex[np.ndarray, "coordinate coordinate"],
) -> None:
    """Add a spring between one end of a wire, along it, and the ground."""
    size = len(target)
    for i in range(len(form)):
        a = where[rows[i]]
        for j in range(i + 1 if a < size else 0):
            b = where[rows[j]]
            if b < size:
                value = stiffness * (form[i] * form[j])
                target[a, b] += value
                if a != b:
                    target[b, a] += value


@compiled
def _add_twist(
    e: Vector,
    between: complex,
    upper: complex,
    lower: complex,
    where: Int[np.ndarray, " 15"],
    target: Complex[np.ndarray, "coordinate coordinate"],
) -> None:
    """Add springs against twisting between both ends, and between each end and the ground."""
    for i in range(3):
        for j in range(3):
            product = e[i] * e[j]
            u, l, v, k = where[3 + i], where[9 + i], where[3 + j], where[9 + j]
            target[u, v] += (between + upper) * product
            target[l, k] += (between + lower) * product
            target[u, k] -= between * product
            target[l, v] -= between * product


@compiled
def _join_bends(
    sections: Float[np.ndarray, "section 10"],
    losses: Losses,
    plane: int,
    omega: float,
    stretch: float,
    tension: float,
    massive: bool,
    whole: Complex[np.ndarray, "4 4"],
    part: Complex[np.ndarray, "4 4"],
) -> None:
    """Fill `whole` with F(omega) - F(0) of bending in one plane, on w and w' of both ends.

    `part` is scratch.
    """
    angles, slopes, drag = losses
    still, above = (0.0, 0.0, 0.0), 0.0
    for m in range(len(sections)):
        row = sections[m]
        if row[LENGTH] == 0.0:
            continue
        coefficient = slopes[m, 0] - slopes[m, 1] * tension
        angle = angles[m, plane] + angles[m, 4 + plane] * coefficient * coefficient
        rigidity, length = row[SOFT + plane], row[LENGTH] * stretch
        inertia = 0.0j
        if massive:
            inertia = row[MASS] - (1j * drag[m, plane] / omega if omega > 0 else 0.0j)
        lossy = rigidity * (1 + 1j * angle)
        own_tension = tension + (row[OFFSET] if massive else 0.0)
        first = above == 0.0
        _dynamic_beam(lossy, own_tension, inertia, length, omega, whole if first else part)
        rest = _static_slopes(rigidity, tension, length)
        if not first:
            join(whole, part, above, length)
            rest = join_slopes(still, rest, above, length, tension)
        still = rest
        above += length
    whole[1, 1] -= tension * above
    whole[2, 2] -= still[0]
    whole[2, 3] -= still[1]
    whole[3, 2] -= still[1]
    whole[3, 3] -= still[2]
    _to_ends(whole, above)
