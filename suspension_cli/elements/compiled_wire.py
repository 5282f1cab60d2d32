"""Bending and twisting of wires of one build, as loops that `numba` compiles.

The formulas are those of `beam`, `rod`, `joined_sections` and `dynamic_wire`, which work on arrays;
`tests/elements/test_compiled.py` compares both. A section of a wire is a row of 9 numbers: length
(m), EI in both planes, EA, GJ, I_p/A, mass and polar moment of inertia per length, and 1 if it is
round.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from suspension_cli.compiled import compiled
from suspension_cli.elements.beam import COEFFICIENT, EPS, SERIES, TERMS
from suspension_cli.scene.composition import Fibre

_COEFFICIENT = np.array(COEFFICIENT)
LENGTH, SOFT, STIFF, STRETCHING, TWISTING, POLAR_AREA, MASS, POLAR, ROUND = range(9)
"""Columns of a section."""


def wire_sections(fibres: tuple[Fibre, ...]) -> Any:
    """Sections of wires (w, m, 9), those that a wire has fewer of with no length."""
    most = max((len(fibre.sections) for fibre in fibres), default=0)
    result = np.zeros((len(fibres), most, 9))
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
            )
    return result


@compiled
def _static_rotations(rigidity: float, tension: float, length: float, result: Any) -> None:
    """Static stiffness (4, 4) of a beam under tension on w_1, w'_1, w_2, w'_2, without loss."""
    h = length / 2
    alpha = math.sqrt(tension / rigidity)
    u = alpha * h
    if u < 1.0:
        square = u * u
        # 1 - tanh(u)/u = (u cosh u - sinh u)/(u cosh u), by the series of its numerator / u^3
        term, total = 1.0, 0.0
        for k in range(1, 12):
            term *= 1.0 / ((2 * k) * (2 * k + 1))
            total += 2 * k * term
            term *= square
        gap = total * square / math.cosh(u)
        t = h * (1 - gap)
    else:
        t = math.tanh(u) / alpha
        gap = 1 - t / h
    # u^2 / gap tends to 3 without tension
    ratio = 3.0 if u == 0.0 else u * u / gap
    even = 2 * rigidity / t
    odd_ww = 2 * rigidity * ratio / h**3
    odd_wt, odd_tt = -odd_ww * t, odd_ww * h * t
    # W_a = (w_2 - w_1)/2, T_s = (w'_2 - w'_1)/2, T_a = (w'_1 + w'_2)/2
    result[0, 0] = result[2, 2] = odd_ww / 4
    result[0, 2] = result[2, 0] = -odd_ww / 4
    result[0, 1] = result[1, 0] = result[0, 3] = result[3, 0] = -odd_wt / 4
    result[2, 1] = result[1, 2] = result[2, 3] = result[3, 2] = odd_wt / 4
    result[1, 1] = result[3, 3] = (even + odd_tt) / 4
    result[1, 3] = result[3, 1] = (odd_tt - even) / 4


@compiled
def join(upper: Any, lower: Any) -> None:
    """Join two beams (4, 4) on w and w' of their ends, the result in place of the upper one."""
    a = upper[2, 2] + lower[0, 0]
    b = upper[2, 3] + lower[0, 1]
    d = upper[3, 3] + lower[1, 1]
    over = 1 / (a * d - b * b)
    c = np.empty((2, 4), dtype=upper.dtype)
    for i in range(2):
        for j in range(2):
            c[i, j] = upper[2 + i, j]
            c[i, 2 + j] = lower[i, 2 + j]
    for i in range(2):
        for j in range(2):
            upper[2 + i, 2 + j] = lower[2 + i, 2 + j]
            upper[2 + i, j] = upper[i, 2 + j] = upper[0, 0] * 0
    for j in range(4):
        first = (d * c[0, j] - b * c[1, j]) * over
        second = (a * c[1, j] - b * c[0, j]) * over
        for i in range(4):
            upper[i, j] -= c[0, i] * first + c[1, i] * second


@compiled
def resting(
    sections: Any, length: float, tension: float, torsion: float, flex: Any, whole: Any, part: Any
) -> None:
    """Fill the static stiffness of a wire against rotation of its ends, and against twisting.

    Parameters
    ----------
    sections : (m, 9) array
        Those of no length are left out.
    length, tension, torsion : float
        Of the wire in this pose, m and N; torsional stiffness that the design gives, or 0, N m/rad.
    flex : (7,) array
        To be filled: S_uu, S_ul, S_ll in both planes, and the torsional stiffness.
    whole, part : (4, 4) arrays
        Scratch.
    """
    drawn = 0.0
    for m in range(len(sections)):
        drawn += sections[m, LENGTH]
    stretch, twist = length / drawn, 0.0
    for plane in range(2):
        if plane == 1 and sections[0, ROUND] == 1.0:
            flex[3:6] = flex[:3]
            continue
        started = False
        for m in range(len(sections)):
            own = sections[m]
            if own[LENGTH] == 0.0:
                continue
            target = part if started else whole
            _static_rotations(own[SOFT + plane], tension, own[LENGTH] * stretch, target)
            if started:
                join(whole, part)
            started = True
        flex[3 * plane] = whole[1, 1]
        flex[3 * plane + 1] = whole[1, 3]
        flex[3 * plane + 2] = whole[3, 3]
    for m in range(len(sections)):
        own = sections[m]
        if own[LENGTH] > 0.0:
            twist += own[LENGTH] * stretch / (own[TWISTING] + tension * own[POLAR_AREA])
    flex[6] = torsion if torsion > 0 else 1 / twist
