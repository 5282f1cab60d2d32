"""Vectors and matrices of three dimensions whose components are the first axes of arrays.

A vector is an array (3, ...), a matrix one (3, 3, ...) of rows and columns; the axes behind run
over elements and builds. So NumPy works along contiguous rows of builds, and each formula serves
one design and a million.
"""

from __future__ import annotations

import numpy as np

Vector = np.ndarray
"""An array (3, ...)."""
Matrix = np.ndarray
"""An array (3, 3, ...)."""
Scalar = np.ndarray
"""An array (...) of numbers."""


def dot(a: Vector, b: Vector) -> Scalar:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Vector product; if `a` is a matrix M, [b]^T M: that of each column and b."""
    first = a[1] * b[2] - a[2] * b[1]
    result = np.empty((3, *first.shape), dtype=first.dtype)
    result[0] = first
    np.subtract(a[2] * b[0], a[0] * b[2], out=result[1])
    np.subtract(a[0] * b[1], a[1] * b[0], out=result[2])
    return result


def times_cross(m: Matrix, a: Vector) -> Matrix:
    """Product M [a] with the matrix [a] of the vector product: of each row and a."""
    return transposed(cross(transposed(m), a))


def cross_matrix(a: Vector) -> Matrix:
    """Matrix [a] of the vector product: [a] b = a x b."""
    result = np.zeros((3, *a.shape), dtype=a.dtype)
    result[0, 1] = -a[2]
    result[0, 2] = a[1]
    result[1, 2] = -a[0]
    result[1, 0] = a[2]
    result[2, 0] = -a[1]
    result[2, 1] = a[0]
    return result


def outer(a: Vector, b: Vector) -> Matrix:
    """Product a b^T of two vectors."""
    return a[:, None] * b


def times(m: Matrix, a: Vector) -> Vector:
    """Matrix times vector."""
    return m[:, 0] * a[0] + m[:, 1] * a[1] + m[:, 2] * a[2]


def product(m: Matrix, n: Matrix) -> Matrix:
    """Matrix times matrix."""
    return m[:, 0, None] * n[0] + m[:, 1, None] * n[1] + m[:, 2, None] * n[2]


def transposed(m: Matrix) -> Matrix:
    """Transpose of a matrix."""
    return m.swapaxes(0, 1)


def symmetric(m: Matrix) -> Matrix:
    """Symmetric part of a matrix."""
    return (m + transposed(m)) / 2


def unit(value: Scalar) -> Matrix:
    """Multiple of the unit matrix."""
    result = np.zeros((3, 3, *value.shape), dtype=value.dtype)
    result[0, 0] = result[1, 1] = result[2, 2] = value
    return result


def plus_unit(m: Matrix, value: Scalar) -> Matrix:
    """Matrix plus a multiple of the unit matrix, in place."""
    for axis in range(3):
        m[axis, axis] += value
    return m


def turning(products: Matrix) -> Matrix:
    """Second derivative of F . w with respect to rotations of w: (F w^T + w F^T)/2 - F . w.

    From the products F w^T, or their sum over some points. A point at the arm w of a body moves to
    w + t x w + t x (t x w)/2 when the body rotates by a vector t, so the gradient F of an energy
    with respect to the point's place adds F . (t x (t x w))/2 to second order: geometric stiffness
    (compare Goldstein, Classical Mechanics, section 4.8).
    """
    return plus_unit(symmetric(products), -(products[0, 0] + products[1, 1] + products[2, 2]))
