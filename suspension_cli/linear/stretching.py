"""Stretching stiffness of wires, kept separate so that stiff wires cost soft parts no digits.

An elongation e = a . x of a wire stores k (a . x)^2 / 2, so a stiffness is a soft part plus a sum
of k a a^T. In one double the sum of k and of a blade's stiffness 1e10 times smaller keeps six
digits of the latter, and eliminating the blade's tip squares that loss. Two remedies:

- The sum is taken in double-double arithmetic, and the low parts of its elements are kept.
- The tension of a wire becomes a coordinate (p in m, with the force s p): with  k e = s p  each
  k a a^T becomes

      ( soft   s a    )
      ( s a^T  -s^2/k )

  with k in one element alone, as a compliance. Eliminating a tip then adds the compliances of wire
  and blade, and nothing cancels however large k is (mixed formulation: Zienkiewicz and Taylor, The
  Finite Element Method, 5th ed., vol. 1, chapter 11).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear.double_double import DoubleDouble
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact

ALIKE = 1e-13
"""Relative difference of two linear forms that counts as rounding."""


@dataclass(frozen=True)
class Stretching:
    """Elongations and stiffnesses of wires.

    Attributes
    ----------
    form, low
        Elongation of each wire per coordinate, and its low part.
    stiffness
        N/m; complex if lossy.
    allowed
        Elements of a matrix that the symmetry allows.
    soft
        The stiffness without the stretching; complex if lossy.
    """

    form: Float[np.ndarray, "wire coordinate"]
    low: Float[np.ndarray, "wire coordinate"]
    stiffness: Inexact[np.ndarray, " wire"]
    allowed: Bool[np.ndarray, "coordinate coordinate"]
    soft: Inexact[np.ndarray, "coordinate coordinate"]

    def added(self, matrix: DoubleDouble, stiffness: Float[np.ndarray, " wire"]) -> DoubleDouble:
        """Add the sum of k a a^T, for stiffnesses k, to a matrix, exactly symmetric.

        A wire acts on few coordinates, so only products of non-zero elements are formed. Those of
        the upper triangle are summed in layers, each with one product per element of the matrix.
        """
        size = self.form.shape[1]
        some = (self.form != 0) | (self.low != 0)
        width = int(some.sum(1).max(initial=0))
        place = np.argsort(~some, axis=1, kind="stable")[:, :width]
        form = DoubleDouble(
            np.take_along_axis(self.form, place, 1), np.take_along_axis(self.low, place, 1)
        )
        first, second = np.triu_indices(width)
        row, column = place[:, first], place[:, second]
        used = np.take_along_axis(some, column, 1) & self.allowed[row, column]
        wire = np.nonzero(used)[0]
        element = (row * size + column)[used]
        product = form[:, first][used] * form[:, second][used]
        product = product * DoubleDouble.of(np.asarray(stiffness)[wire])
        order = np.argsort(element, kind="stable")
        starts = np.flatnonzero(np.diff(element[order], prepend=-1))
        layer = np.empty(len(order), dtype=np.intp)
        layer[order] = np.arange(len(order)) - np.repeat(
            starts, np.diff(np.append(starts, len(order)))
        )
        high, low = np.zeros(size * size), np.zeros(size * size)
        for number in range(int(layer.max(initial=-1)) + 1):
            here = layer == number
            where = element[here]
            total = DoubleDouble(high[where], low[where]) + product[here]
            high[where], low[where] = total.high, total.low
        upper = (part.reshape(size, size) for part in (high, low))
        return matrix + DoubleDouble(*(part + np.triu(part, 1).T for part in upper))

    def spread(self, from_new: Float[np.ndarray, "coordinate new"]) -> Stretching:
        """Change to new coordinates: old = `from_new` @ new."""
        reach = (from_new != 0).astype(float)
        return replace(
            self,
            form=self.form @ from_new,
            low=self.low @ from_new,
            allowed=reach.T @ self.allowed @ reach > 0,
        )


@dataclass(frozen=True)
class Separated:
    """Stiffness of many builds, apart from the stretching of wires.

    Attributes
    ----------
    soft
        Stiffness without the stretching, with its losses; N/m, N and N m.
    form
        Elongation of each wire per coordinate.
    stiffness
        k of the wires, with their losses, N/m: the rest of the stiffness is the sum of k a a^T.
    """

    soft: Inexact[np.ndarray, "build coordinate coordinate"]
    form: Float[np.ndarray, "build wire coordinate"]
    stiffness: Inexact[np.ndarray, "*#build wire"]


def distinct(
    forms: Float[np.ndarray, "wire coordinate"],
) -> tuple[Float[np.ndarray, "row coordinate"], list[list[int]]]:
    """Find the non-zero forms that differ by more than sign, and the wires of each."""
    size = np.abs(forms).max(1, initial=0.0)
    rows: list[Array] = []
    members: list[list[int]] = []
    for n in np.flatnonzero(size > 0).tolist():
        form, tolerance = forms[n], ALIKE * size[n]
        known = next(
            (
                m
                for m, row in enumerate(rows)
                if min(np.abs(row - form).max(), np.abs(row + form).max()) <= tolerance
            ),
            None,
        )
        if known is None:
            rows.append(form)
            members.append([n])
        else:
            members[known].append(n)
    return np.array(rows).reshape(-1, forms.shape[1]), members
