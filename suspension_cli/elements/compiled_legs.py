"""Forces and stiffness of the legs of inverted pendulums in one build, as a compiled loop.

The formulas are those of `string`, with a negative tension, and of `bar`. A leg joins the same
bodies as the spring of its flexures; its numbers follow those of that spring in one row.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.compiled import compiled
from suspension_cli.scene.scene import spring_of_leg

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.scene.scene import Scene

FIRST = 48
"""First column of a leg in the row of its spring."""
WIDTH = 14
"""Columns of a leg: foot (3), top (3), span (3), length, tension, stiffness, and the masses whose
weight rests on foot and top."""


def pack_legs(scene: Scene) -> Float[np.ndarray, "build spring 14"]:
    """Pack struts and bars of a batch of scenes, one row per spring; 0 for a spring without leg."""
    struts, springs, bars = scene.struts, scene.springs, scene.bars
    result = np.zeros((*scene.batch, len(springs.label), WIDTH))
    for n, label in enumerate(struts.label):
        row = spring_of_leg(scene, n)
        result[..., row, 0:3] = struts.upper_point[..., n, :]
        result[..., row, 3:6] = struts.lower_point[..., n, :]
        result[..., row, 6:9] = struts.span[..., n, :]
        result[..., row, 9] = struts.length[..., n]
        result[..., row, 10] = struts.tension[..., n]
        result[..., row, 11] = struts.stiffness[..., n]
        if label in bars.label:
            result[..., row, 12:] = bars.loads[..., bars.label.index(label), :]
    return result


@compiled
def add_legs(
    upper: Any,
    lower: Any,
    gravity: float,
    rows: Any,
    shift: Any,
    turn: Any,
    gradient: Any,
    hessian: Any,
    curved: bool,
) -> None:
    """Add the derivatives of the energy of all legs of one build, in place.

    Parameters
    ----------
    upper, lower : (s,) int arrays
        Bodies of the springs.
    gravity : float
        m/s^2; 0 if `compiled_weight` adds the weight of the legs.
    rows : (s, 62) array
        Springs with their legs, see `FIRST`.
    shift, turn
        Pose, see `Pose`.
    gradient, hessian
        To be added to; of the Hessian the lower triangle.
    curved : bool
        Whether to add to the Hessian.
    """
    arms, jacobian, place = np.empty((2, 3)), np.empty((3, 12)), np.empty(12, dtype=np.int64)
    span, change, e, product = np.empty(3), np.empty(3), np.empty(3), np.empty((3, 12))
    outer = np.empty((2, 3, 3))
    for n in range(len(rows)):
        own = rows[n, FIRST:]
        if own[9] == 0.0:
            continue
        bodies = (upper[n], lower[n])
        square, elongation = 0.0, 0.0
        for i in range(3):
            change[i] = shift[bodies[1], i] - shift[bodies[0], i]
            for side in range(2):
                moved = 0.0
                for j in range(3):
                    moved += turn[bodies[side], i, j] * own[3 * side + j]
                arms[side, i] = own[3 * side + i] + moved
                change[i] += moved if side else -moved
            span[i] = own[6 + i] + change[i]
            square += span[i] * span[i]
            elongation += change[i] * (2 * own[6 + i] + change[i])
        length = math.sqrt(square)
        tension = own[10] + own[11] * elongation / (length + own[9])
        over = tension / length
        outer[:] = 0.0
        jacobian[:] = 0.0
        for side in range(2):
            sign, arm = (1.0 if side else -1.0), arms[side]
            for i in range(3):
                place[6 * side + i] = 6 * bodies[side] + i
                place[6 * side + 3 + i] = 6 * bodies[side] + 3 + i
                jacobian[i, 6 * side + i] = sign
            start = 6 * side + 3
            jacobian[1, start], jacobian[2, start] = -sign * arm[2], sign * arm[1]
            jacobian[0, start + 1], jacobian[2, start + 1] = sign * arm[2], -sign * arm[0]
            jacobian[0, start + 2], jacobian[1, start + 2] = -sign * arm[1], sign * arm[0]
            weight = gravity * own[12 + side]
            first = 6 * bodies[side]
            gradient[first + 2] += weight
            gradient[first + 3] += arm[1] * weight
            gradient[first + 4] -= arm[0] * weight
            for i in range(3):
                e[i] = span[i] / length
                outer[side, 2, i] += weight * arm[i]
            for i in range(3):
                for j in range(3):
                    outer[side, i, j] += sign * tension * e[i] * arm[j]
        for c in range(12):
            along = jacobian[0, c] * e[0] + jacobian[1, c] * e[1] + jacobian[2, c] * e[2]
            gradient[place[c]] += tension * along
            for i in range(3):
                product[i, c] = (own[11] - over) * e[i] * along + over * jacobian[i, c]
        if not curved:
            continue
        for c in range(12):
            for d in range(12):
                if place[d] <= place[c]:
                    hessian[place[c], place[d]] += (
                        jacobian[0, c] * product[0, d]
                        + jacobian[1, c] * product[1, d]
                        + jacobian[2, c] * product[2, d]
                    )
        for side in range(2):
            first = 6 * bodies[side] + 3
            trace = outer[side, 0, 0] + outer[side, 1, 1] + outer[side, 2, 2]
            for i in range(3):
                hessian[first + i, first + i] -= trace
                for j in range(i + 1):
                    value = (outer[side, i, j] + outer[side, j, i]) / 2
                    hessian[first + i, first + j] += value
