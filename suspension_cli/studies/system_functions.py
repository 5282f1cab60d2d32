"""Elements of linear systems as analytic functions of the numbers of their designs.

Modes are not analytic where they cross, but the matrices are of which they are the modes. Soft
stiffness, elongations of wires and their stiffness are kept apart, as in `linear.system`: in their
sum the errors of a stiff wire would exceed the stiffness of a pendulum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Float

LEAST = 1e-3
"""Size of an element, over that which its coordinates suggest, below which errors do not matter."""


@dataclass(frozen=True)
class Layout:
    """Order of the elements: upper halves of mass and soft stiffness, elongations, stiffness of
    wires; as in the system of the nominal design.
    """

    nominal: LinearSystem

    @property
    def least(self) -> Float[np.ndarray, " function"]:
        """Sizes below which errors are relative to these."""
        nominal = self.nominal
        row, column = np.triu_indices(nominal.size)
        sizes = []
        for matrix in (nominal.mass, nominal.stiffness):
            own = np.sqrt(np.abs(np.diagonal(matrix)))
            sizes.append(LEAST * own[row] * own[column])
        wires = np.broadcast_to(
            np.abs(nominal.elongation).max(0, initial=0.0), nominal.elongation.shape
        )
        return np.concatenate([*sizes, LEAST * wires.ravel(), np.zeros(len(nominal.k))])

    def functions(self, model: LinearSystem) -> Float[np.ndarray, "design function"]:
        """Elements of the systems of a batch, without losses."""
        (count,) = model.batch
        row, column = np.triu_indices(model.size)
        parts = [np.real(matrix)[..., row, column] for matrix in (model.mass, model.soft)]
        elongation = np.real(model.elongation)
        *batch, wires, size = elongation.shape
        parts.append(elongation.reshape(*batch, wires * size))
        parts.append(np.real(model.k))
        return np.hstack([np.broadcast_to(part, (count, part.shape[-1])) for part in parts])

    def system(self, functions: Float[np.ndarray, "design function"]) -> LinearSystem:
        """Batch of systems with these elements, without damping and terms in frequency."""
        nominal = self.nominal
        size = nominal.size
        wires = nominal.elongation.shape[-2]
        half = size * (size + 1) // 2
        mass, soft, elongation, k = np.split(
            functions, [half, 2 * half, 2 * half + wires * size], axis=1
        )
        return replace(
            nominal,
            mass=_symmetric(mass, size),
            soft=_symmetric(soft, size),
            elongation=elongation.reshape(len(functions), wires, size),
            k=k,
            damping=np.zeros((size, size)),
            orientation=None,
            terms=(),
            rigid=None,
            ground=None,
        )


def _symmetric(
    half: Float[np.ndarray, "design element"], size: int
) -> Float[np.ndarray, "design coordinate coordinate"]:
    row, column = np.triu_indices(size)
    result = np.empty((len(half), size, size))
    result[:, row, column] = half
    result[:, column, row] = half
    return result
