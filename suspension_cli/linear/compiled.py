"""Responses of many systems at one frequency each, as one loop that `numba` compiles.

A system is D(omega) = K + i omega C - omega^2 M with the stretching of its wires kept apart (see
`stretching`): the tension s of a wire of stiffness k is a coordinate of its own,

    ( D     a   ) (x)   (f)
    ( a^T  -1/k ) (s) = (0),

so a wire may be 1e10 times stiffer than the blade that carries it. The factors L D L^T eliminate
massless blade tips first, then tensions, then bodies from below, without pivoting; each solution is
refined with a residual in twice the digits (Higham, Accuracy and Stability of Numerical Algorithms,
2nd ed., chapter 12). Where a pivot is too small the system is left to the caller.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from suspension_cli.compiled import compiled, constant, factorise, residual, substitute
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact, Int

SMALL = 1e-6
"""Least pivot, relative to the element on the diagonal, of factors that are used. They lose up
to six digits then, which refining the solution once restores."""


class Matrices(NamedTuple):
    """Matrices of many builds.

    Attributes
    ----------
    soft, loss
        Real and imaginary part of the stiffness without the stretching of wires; the loss is
        (0, N, N) for none.
    mass, damping
        The damping is (0, N, N) for none.
    form
        Elongation of each wire per coordinate.
    """

    soft: Float[np.ndarray, "build 6+coordinate 6+coordinate"]
    mass: Float[np.ndarray, "build 6+coordinate 6+coordinate"]
    loss: Float[np.ndarray, "_ 6+coordinate 6+coordinate"]
    damping: Float[np.ndarray, "_ 6+coordinate 6+coordinate"]
    form: Float[np.ndarray, "build wire 6+coordinate"]


class Systems(NamedTuple):
    """Systems to be solved.

    Attributes
    ----------
    which, omega
        Build and frequency, rad/s, of each.
    added
        Stiffness beyond that of the build; (0, N, N) for none.
    compliance
        1/k of each wire, m/N.
    """

    which: Int[np.ndarray, " system"]
    omega: Float[np.ndarray, " system"]
    added: Inexact[np.ndarray, "_ 6+coordinate 6+coordinate"]
    compliance: Inexact[np.ndarray, "system wire"]


@compiled
def respond(
    order: Int[np.ndarray, " coordinate"],
    first_light: int,
    refinements: int,
    unit: complex,
    matrices: Matrices,
    systems: Systems,
    moves: Float[np.ndarray, "build 6 input"],
    forces: Float[np.ndarray, "build coordinate input"],
    result: Inexact[np.ndarray, "system coordinate input"],
    good: Bool[np.ndarray, " system"],
) -> None:
    """Compute the motion of many systems that motions of the support and forces cause.

    Parameters
    ----------
    order
        Coordinates but the support's: bodies from the top down, then massless tips.
    first_light
        Number of those with mass.
    refinements
        Number of corrections of each solution.
    unit
        1j; any number in real systems, which have no damping.
    moves, forces
        Motion of the support and forces on the other coordinates, for each input.
    result
        To be filled: coordinates but the support's, in the order of the model.
    good
        To be filled: whether the pivots were large enough.
    """
    soft, mass, loss, damping, form = matrices
    which, omega, added, compliance = systems
    free, wires = len(order), form.shape[1]
    size, last = free + wires, first_light + wires
    kind = result.dtype
    matrix, factor = np.zeros((size, size), dtype=kind), np.zeros((size, size), dtype=kind)
    pivot, x, b = np.empty(size, dtype=kind), np.empty(size, dtype=kind), np.empty(size, dtype=kind)
    left, work = np.empty(size, dtype=kind), np.empty((2, size))
    where = np.empty(size, dtype=np.int64)
    place = np.empty(free, dtype=np.int64)
    for n in range(free):
        place[n] = n if n < first_light else n + wires
    drawn = np.zeros((size, 6), dtype=kind)
    for q in range(len(which)):
        p, w = which[q], omega[q]
        square = w * w
        for n in range(free):
            i = order[n]
            for m in range(n + 1):
                j = order[m]
                value = soft[p, i, j] - square * mass[p, i, j]
                matrix[place[n], place[m]] = value
            for j in range(6):
                drawn[place[n], j] = soft[p, i, j] - square * mass[p, i, j]
        if len(loss):
            _add_further(order, place, unit, loss[p], matrix, drawn)
        if len(damping):
            _add_further(order, place, unit * w, damping[p], matrix, drawn)
        if len(added):
            _add_further(order, place, unit * 0.0 + 1.0, added[q], matrix, drawn)
        for n in range(wires):
            row = first_light + n
            for m in range(wires):
                matrix[row, first_light + m] = 0.0
            matrix[row, row] = -compliance[q, n]
            for m in range(free):
                value = form[p, n, order[m]]
                if place[m] < row:
                    matrix[row, place[m]] = value
                else:
                    matrix[place[m], row] = value
            for j in range(6):
                drawn[row, j] = form[p, n, j]
        good[q] = factorise(matrix, factor, pivot, where, 0, 0) > SMALL
        if not good[q]:
            continue
        for column in range(moves.shape[2]):
            for i in range(first_light, last):
                b[i] = 0.0
            for n in range(free):
                b[place[n]] = forces[p, order[n] - 6, column]
            for j in range(6):
                if moves[p, j, column] != 0.0:
                    for i in range(size):
                        b[i] -= drawn[i, j] * moves[p, j, column]
            for i in range(size):
                x[i] = b[i]
            substitute(factor, x)
            for _ in range(refinements):
                residual(matrix, x, b, work, left)
                substitute(factor, left)
                for i in range(size):
                    x[i] += left[i]
            for n in range(free):
                result[q, order[n] - 6, column] = x[place[n]]


@compiled
def _add_further(
    order: Int[np.ndarray, " coordinate"],
    place: Int[np.ndarray, " coordinate"],
    factor: complex,
    further: Inexact[np.ndarray, "6+coordinate 6+coordinate"],
    matrix: Inexact[np.ndarray, "row row"],
    drawn: Inexact[np.ndarray, "row 6"],
) -> None:
    """Add a multiple of a matrix to the stiffness of one system."""
    for n in range(len(order)):
        i = order[n]
        for m in range(n + 1):
            matrix[place[n], place[m]] += factor * further[i, order[m]]
        for j in range(6):
            drawn[place[n], j] += factor * further[i, j]


@compiled
def condense_tips(
    order: Int[np.ndarray, " coordinate"],
    first_light: int,
    soft: Float[np.ndarray, "build 6+coordinate 6+coordinate"],
    form: Float[np.ndarray, "build wire 6+coordinate"],
    compliance: Float[np.ndarray, "build wire"],
    result: Float[np.ndarray, "build 6+coordinate 6+coordinate"],
) -> None:
    """Eliminate massless tips from the stiffness of many builds, wires kept apart.

    Parameters
    ----------
    order, first_light, soft, form
        See `respond` and `Matrices`.
    compliance
        1/k of each wire, m/N.
    result
        To be filled: the condensed stiffness; a tip has no coupling and the stiffness 1 N/m.
    """
    free, wires = len(order), form.shape[1]
    size = free + wires
    matrix, factor = np.zeros((size, size)), np.zeros((size, size))
    pivot, where = np.empty(size), np.empty(size, dtype=np.int64)
    for p in range(len(soft)):
        for n in range(free):
            i = order[n]
            row = n if n < first_light else n + wires
            for m in range(n + 1):
                matrix[row, m if m < first_light else m + wires] = soft[p, i, order[m]]
        for n in range(wires):
            row = first_light + n
            for m in range(wires):
                matrix[row, first_light + m] = 0.0
            matrix[row, row] = -compliance[p, n]
            for m in range(free):
                if m < first_light:
                    matrix[row, m] = form[p, n, order[m]]
                else:
                    matrix[m + wires, row] = form[p, n, order[m]]
        factorise(matrix, factor, pivot, where, first_light, 0)
        result[p] = 0.0
        for n in range(free):
            for m in range(n + 1 if n < first_light else 0):
                result[p, order[n], order[m]] = result[p, order[m], order[n]] = factor[n, m]
            if n >= first_light:
                result[p, order[n], order[n]] = 1.0


@compiled
def scale_by_mass(
    mass: Float[np.ndarray, "build coordinate coordinate"],
    stiffness: Float[np.ndarray, "build coordinate coordinate"],
    root: Float[np.ndarray, "build coordinate coordinate"],
    dynamic: Float[np.ndarray, "build coordinate coordinate"],
) -> None:
    """Fill `root` with L, M = L L^T, and `dynamic` with L^-1 K L^-T, of many builds."""
    size = mass.shape[-1]
    for p in range(len(mass)):
        for i in range(size):
            for j in range(i + 1):
                total = mass[p, i, j]
                for k in range(j):
                    total -= root[p, i, k] * root[p, j, k]
                root[p, i, j] = math.sqrt(total) if i == j else total / root[p, j, j]
                root[p, j, i] = root[p, i, j] if i == j else 0.0
        # rows of L^-1 K, then the same on columns, of which the lower triangle is enough
        for i in range(size):
            for j in range(size):
                dynamic[p, i, j] = stiffness[p, i, j]
            for k in range(i):
                factor = root[p, i, k]
                if factor != 0.0:
                    for j in range(size):
                        dynamic[p, i, j] -= factor * dynamic[p, k, j]
            over = 1 / root[p, i, i]
            for j in range(size):
                dynamic[p, i, j] *= over
        for i in range(size):
            for j in range(i + 1):
                total = dynamic[p, i, j]
                for k in range(j):
                    total -= root[p, j, k] * dynamic[p, i, k]
                dynamic[p, i, j] = total / root[p, j, j]
        for i in range(size):
            for j in range(i):
                dynamic[p, j, i] = dynamic[p, i, j]


def without_tips(model: LinearSystem) -> LinearSystem:
    """A batch of lossless systems without the coupling of massless tips, which are condensed."""
    separated = model.separated
    assert separated is not None
    light = model.massless[6:]
    order = 6 + np.concatenate([np.flatnonzero(~light), np.flatnonzero(light)])
    soft = constant(np.real(separated.soft))
    stiffness = np.broadcast_to(np.real(separated.stiffness), separated.form.shape[:2])
    result = np.empty(soft.shape)
    form, compliance = constant(separated.form), constant(1 / stiffness)
    condense_tips(order, int((~light).sum()), soft, form, compliance, result)
    return replace(model, stiffness=result, lossy=None, separated=None)
