"""Stiffness that loss angles add, in a basis of modes, at many frequencies.

L(omega) = L_0 + sum over n of f_n(omega) A_n, where the f_n of hundreds of wires are nearly linear
combinations of a few functions. These follow from singular vectors u_r of the values f_n(omega_j)
at the modes: to rounding, L = L_0 + sum over r of c_r(omega) B_r, c_r = sum of u_rn f_n, B_r = sum
of u_rn A_n. Where that fails, all f_n are used.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear.frequency_terms import Term, is_massive
from suspension_cli.scene.arrays import Array, Index

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact, Int

MANY = 30
"""Number of functions of frequency from which they are combined."""
DEPENDENT = 1e-15
"""Relative singular value below which functions count as linearly dependent."""
EXACT = 1e-13
"""Largest relative error of combined functions."""


class ElasticLosses:
    """X^T L(omega) X for a basis X of motions.

    Parameters
    ----------
    constant
        X^T L_0 X.
    omega
        Frequencies of the modes, rad/s.
    parts
        Terms in frequency, and X^T A_n X of each of their functions, see `transform`.
    """

    def __init__(
        self,
        constant: Complex[np.ndarray, "coordinate coordinate"],
        omega: Float[np.ndarray, " mode"],
        parts: Sequence[tuple[Term, Float[np.ndarray, "function coordinate coordinate"]]] = (),
    ) -> None:
        self._constant = constant
        used = [(term, matrices, matrices.any((1, 2))) for term, matrices in parts]
        self._terms = [(term, np.flatnonzero(some)) for term, _, some in used if some.any()]
        self._matrices = np.concatenate(
            [np.zeros((0, *constant.shape)), *(matrices[some] for _, matrices, some in used)]
        )
        self._modes = omega
        self._restricted: dict[tuple[bytes, bool], tuple[Array, Array]] = {}

    @property
    def is_constant(self) -> bool:
        """Whether L does not depend on frequency."""
        return not self._terms

    def at(
        self, omega: Inexact[np.ndarray, " frequency"], place: Index
    ) -> Complex[np.ndarray, "frequency some some"]:
        """Elements between the coordinates `place` at frequencies in rad/s.

        The imaginary part of a frequency counts for the mass of wires alone.
        """
        values, combined = self._coefficients(omega)
        constant, matrices = self._within(place, combined=combined)
        result = np.empty((len(omega), *constant.shape), dtype=complex)
        flat = matrices.reshape(len(matrices), constant.size)
        result.real = (np.real(values).T @ flat).reshape(result.shape) + np.real(constant)
        result.imag = (np.imag(values).T @ flat).reshape(result.shape) + np.imag(constant)
        return result

    def diagonal(
        self, omega: Float[np.ndarray, " frequency"], place: Index
    ) -> Complex[np.ndarray, "frequency some"]:
        """Diagonal elements at frequencies."""
        values, combined = self._coefficients(omega)
        constant, matrices = self._within(place, combined=combined)
        return constant.diagonal() + values.T @ np.diagonal(matrices, axis1=1, axis2=2)

    def rows(
        self,
        omega: Float[np.ndarray, " frequency"],
        place: Index,
        row: Int[np.ndarray, " frequency"],
    ) -> Complex[np.ndarray, "frequency some"]:
        """One `row` of `place` at each frequency."""
        values, combined = self._coefficients(omega)
        constant, matrices = self._within(place, combined=combined)
        return constant[row] + np.einsum("nf,nfk->fk", values, matrices[:, row])

    def _within(self, place: Index, *, combined: bool) -> tuple[Array, Array]:
        """L_0 and the matrices between some coordinates."""
        key = (np.asarray(place).tobytes(), combined)
        if key not in self._restricted:
            matrices = self._combination[2] if combined else self._matrices
            rows = np.asarray(place)[:, None]
            self._restricted[key] = (self._constant[rows, place], matrices[:, rows, place])
        return self._restricted[key]

    def _functions(
        self, omega: Inexact[np.ndarray, " frequency"]
    ) -> Inexact[np.ndarray, "function frequency"]:
        """All f_n."""
        return np.concatenate(
            [
                np.zeros((0, len(omega)), dtype=complex),
                *(
                    term.at(omega if is_massive(term) else np.real(omega)).all_functions()[which]
                    for term, which in self._terms
                ),
            ]
        )

    def _coefficients(
        self, omega: Inexact[np.ndarray, " frequency"]
    ) -> tuple[Inexact[np.ndarray, "function frequency"], bool]:
        """Factors of the matrices at each frequency, and whether these are the combined ones."""
        values = self._functions(omega)
        if len(values) <= MANY:
            return values, False
        scale, vectors, _ = self._combination
        scaled = values / scale[:, None]
        result = vectors.T @ scaled
        error = np.abs(scaled - vectors @ result).max(0)
        if (error > EXACT * np.abs(scaled).max(0)).any():
            return values, False
        return result, True

    @cached_property
    def _combination(self) -> tuple[Array, Array, Array]:
        """Scale (n,) of each function, singular vectors (n, r) and combined matrices (r, k, k)."""
        values = self._functions(self._modes)
        scale = np.abs(values).max(1, initial=0.0)
        scale = np.where(scale > 0, scale, 1.0)
        scaled = values / scale[:, None]
        scaled = scaled / np.maximum(np.abs(scaled).max(0), np.finfo(float).tiny)
        vectors, size, _ = np.linalg.svd(
            np.concatenate([scaled.real, scaled.imag], axis=1), full_matrices=False
        )
        vectors = vectors[:, size > DEPENDENT * size.max(initial=0.0)]
        return scale, vectors, np.tensordot(vectors.T * scale, self._matrices, 1)


def transform(
    matrices: Float[np.ndarray, "function all all"],
    moves: Float[np.ndarray, "coordinate own"],
    group: Int[np.ndarray, " own"],
) -> Float[np.ndarray, "function coordinate coordinate"]:
    """Matrices X^T A_n X between motions, from the coordinates that a term acts on."""
    acts_on = np.flatnonzero((matrices != 0).any((0, 1))[group])
    own = group[acts_on]
    return moves[:, acts_on] @ matrices[:, own[:, None], own] @ moves[:, acts_on].T
