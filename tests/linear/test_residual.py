"""Residuals of equations of motion against rational arithmetic."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from suspension_cli.linear.residual import COARSE, FINE, equations

COUNT = 70
"""More frequencies than have common scales."""


def exact_residual(high, low, moves, forces, omega, solution):
    """b - D v of one input at one frequency, as real and imaginary rows, and the largest term."""
    w = Fraction(float(omega))
    stiffness, mass, damping = (
        [
            [Fraction(float(a)) + Fraction(float(b)) for a, b in zip(*rows, strict=True)]
            for rows in zip(*pair, strict=True)
        ]
        for pair in zip(high, low, strict=True)
    )
    columns = [*((Fraction(float(s)), Fraction(0)) for s in moves), *solution]
    real, imag, largest = [], [], Fraction(0)
    for row, force in enumerate(forces):
        terms = [(Fraction(float(force)), Fraction(0))]
        for n, (x, y) in enumerate(columns):
            a, c = stiffness[row][n] - w * w * mass[row][n], w * damping[row][n]
            terms.append((c * y - a * x, -c * x - a * y))
            largest = max(largest, abs(stiffness[row][n] * x), abs(w * w * mass[row][n] * x))
        real.append(sum(x for x, _ in terms))
        imag.append(sum(y for _, y in terms))
    return real, imag, largest


@pytest.mark.parametrize("damped", [False, True])
def test_against_rational_arithmetic(damped):
    """Solutions whose coordinates differ by six orders, over a decade of frequencies."""
    rng = np.random.default_rng(5)
    high = [rng.normal(size=(3, 9)) for _ in range(3)]
    high[2] *= damped
    low = [1e-17 * part for part in high]
    moves, forces = np.zeros((6, 1)), np.zeros((3, 1))
    moves[1], forces[2] = 1.0, 0.3
    omega = np.geomspace(1.0, 10.0, COUNT)
    grade = np.array([1.0, 1e-3, 1e-6])[:, None, None] / omega**2
    v = grade * rng.normal(size=(3, 1, COUNT))
    if damped:
        v = v + 1j * grade * rng.normal(size=v.shape)
    v_low = 1e-17 * v
    system = equations((high[0], high[1], high[2]), (low[0], low[1], low[2]))
    loads = system.loads(moves, forces)
    first, limit = system.first_residual(omega, loads, v)
    found = [(first, 0.0 * v, 2.0**-105 / limit[0])]
    found += [
        (system.residual(omega, loads, v, v_low, slices=slices), v_low, np.full(COUNT, bound))
        for slices, bound in ((COARSE, 2.0**-85), (FINE, 2.0**-95))
    ]
    for residual, rest, bound in found:
        for f in range(0, COUNT, 9):
            solution = [
                tuple(
                    Fraction(float(a)) + Fraction(float(b))
                    for a, b in ((x.real, y.real), (x.imag, y.imag))
                )
                for x, y in zip(v[:, 0, f], rest[:, 0, f], strict=True)
            ]
            real, imag, largest = exact_residual(
                high, low, moves[:, 0], forces[:, 0], omega[f], solution
            )
            for row in range(3):
                one = residual[row, 0, f]
                error = abs(Fraction(float(one.real)) - real[row]) + abs(
                    Fraction(float(one.imag)) - imag[row]
                )
                # the result is rounded once
                size = abs(one) * 2.0**-51
                assert error <= size + float(largest) * bound[f]
