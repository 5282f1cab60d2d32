"""Vectors and matrices of three dimensions for compiled loops.

A vector is a tuple of three doubles and a matrix a tuple of its three rows: unlike small arrays
they stay in the registers of the processor.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.compiled import inlined

if TYPE_CHECKING:
    from jaxtyping import Float

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]


@inlined
def vector(table: Float[np.ndarray, "row column"], row: int, column: int) -> Vector:
    """Three neighbouring elements of a row of a table."""
    return table[row, column], table[row, column + 1], table[row, column + 2]


@inlined
def matrix(stack: Float[np.ndarray, "matrix 3 3"], n: int) -> Matrix:
    """One matrix of a stack (n, 3, 3)."""
    return (
        (stack[n, 0, 0], stack[n, 0, 1], stack[n, 0, 2]),
        (stack[n, 1, 0], stack[n, 1, 1], stack[n, 1, 2]),
        (stack[n, 2, 0], stack[n, 2, 1], stack[n, 2, 2]),
    )


@inlined
def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@inlined
def plus(a: Vector, b: Vector) -> Vector:
    """Sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined
def minus(a: Vector, b: Vector) -> Vector:
    """Difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def scaled(factor: float, a: Vector) -> Vector:
    """Multiple of a vector."""
    return factor * a[0], factor * a[1], factor * a[2]


@inlined
def times(m: Matrix, a: Vector) -> Vector:
    """Matrix times vector."""
    return dot(m[0], a), dot(m[1], a), dot(m[2], a)


@inlined
def product(m: Matrix, n: Matrix) -> Matrix:
    """Matrix times matrix."""
    columns = transposed(n)
    return times(columns, m[0]), times(columns, m[1]), times(columns, m[2])


@inlined
def trace(m: Matrix) -> float:
    """Sum of the diagonal."""
    return m[0][0] + m[1][1] + m[2][2]


@inlined
def transposed(m: Matrix) -> Matrix:
    """Transpose of a matrix."""
    return (
        (m[0][0], m[1][0], m[2][0]),
        (m[0][1], m[1][1], m[2][1]),
        (m[0][2], m[1][2], m[2][2]),
    )


@inlined
def added(m: Matrix, n: Matrix) -> Matrix:
    """Sum of two matrices."""
    return plus(m[0], n[0]), plus(m[1], n[1]), plus(m[2], n[2])


@inlined
def subtracted(m: Matrix, n: Matrix) -> Matrix:
    """Difference of two matrices."""
    return minus(m[0], n[0]), minus(m[1], n[1]), minus(m[2], n[2])


@inlined
def multiple(factor: float, m: Matrix) -> Matrix:
    """Multiple of a matrix."""
    return scaled(factor, m[0]), scaled(factor, m[1]), scaled(factor, m[2])


@inlined
def diagonal(value: float) -> Matrix:
    """Multiple of the unit matrix."""
    return (value, 0.0, 0.0), (0.0, value, 0.0), (0.0, 0.0, value)


@inlined
def outer(a: Vector, b: Vector) -> Matrix:
    """Product a b^T of two vectors."""
    return scaled(a[0], b), scaled(a[1], b), scaled(a[2], b)


@inlined
def symmetric(m: Matrix) -> Matrix:
    """Symmetric part of a matrix."""
    return multiple(0.5, added(m, transposed(m)))


@inlined
def times_cross(m: Matrix, a: Vector) -> Matrix:
    """Product M [a], see `cross_matrix`."""
    return cross(m[0], a), cross(m[1], a), cross(m[2], a)


@inlined
def cross_times(a: Vector, m: Matrix) -> Matrix:
    """Product [a]^T M, the transpose of M^T [a]."""
    return transposed(times_cross(transposed(m), a))


@inlined
def cross_matrix(a: Vector) -> Matrix:
    """Matrix [a] of the vector product: [a] b = a x b."""
    return (0.0, -a[2], a[1]), (a[2], 0.0, -a[0]), (-a[1], a[0], 0.0)


@inlined
def turned(m: Matrix, a: Vector) -> Vector:
    """Rotate a vector by 1 + M."""
    return plus(a, times(m, a))


@inlined
def turning(force: Vector, arm: Vector) -> Matrix:
    """Second derivative of F . R a with respect to rotations, (F w^T + w F^T)/2 - F . w, w = R a.

    See `geometric_stiffness`.
    """
    return subtracted(symmetric(outer(force, arm)), diagonal(dot(force, arm)))


@inlined
def add_vector(target: Float[np.ndarray, " element"], first: int, a: Vector) -> None:
    """Add a vector to three neighbouring elements."""
    target[first] += a[0]
    target[first + 1] += a[1]
    target[first + 2] += a[2]


@inlined
def add_block(target: Float[np.ndarray, "row column"], row: int, column: int, m: Matrix) -> None:
    """Add a matrix to a block of a larger one."""
    target[row, column] += m[0][0]
    target[row, column + 1] += m[0][1]
    target[row, column + 2] += m[0][2]
    target[row + 1, column] += m[1][0]
    target[row + 1, column + 1] += m[1][1]
    target[row + 1, column + 2] += m[1][2]
    target[row + 2, column] += m[2][0]
    target[row + 2, column + 1] += m[2][1]
    target[row + 2, column + 2] += m[2][2]


@inlined
def subtract_block(
    target: Float[np.ndarray, "row column"], row: int, column: int, m: Matrix
) -> None:
    """Subtract a matrix from a block of a larger one."""
    add_block(target, row, column, multiple(-1.0, m))


@inlined
def add_lower(target: Float[np.ndarray, "row row"], first: int, m: Matrix) -> None:
    """Add the lower triangle of a matrix to a block on the diagonal."""
    target[first, first] += m[0][0]
    target[first + 1, first] += m[1][0]
    target[first + 1, first + 1] += m[1][1]
    target[first + 2, first] += m[2][0]
    target[first + 2, first + 1] += m[2][1]
    target[first + 2, first + 2] += m[2][2]
