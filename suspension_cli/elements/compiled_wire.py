"""Bending and twisting of wires of one build at rest, as loops that `numba` compiles.

The formulas are those of `resting`, which works on arrays;
`tests/equilibrium/test_compiled.py` compares both. A section of a wire is a row of 10 numbers:
length (m), EI in both planes, EA, GJ, I_p/A, mass and polar moment of inertia per length, 1 if it
is round, and the tension beyond that of the wire (N; of wires with mass).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from suspension_cli.compiled import compiled
from suspension_cli.scene.composition import Fibre

if TYPE_CHECKING:
    from jaxtyping import Float, Int

GAP_TERMS = 10
"""Terms of the series of cosh u - sinh(u)/u, for |u| < 1."""
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
def _gap_series(square: float) -> float:
    """Sum cosh u - sinh(u)/u, see `beam`."""
    term, total = square / 6, 0.0 * square
    for k in range(1, GAP_TERMS + 1):
        total += 2 * k * term
        term *= square / ((2 * k + 2) * (2 * k + 3))
    return total


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
