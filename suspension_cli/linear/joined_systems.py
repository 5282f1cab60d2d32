"""Systems of matrices in series and side by side, continuous or sampled.

>>> low_pass = Matrices(*(np.array([[x]]) for x in (-1.0, 1.0, 1.0, 0.0)))  # x' = -x + u, y = x
>>> low_pass.then(low_pass).a
array([[-1.,  0.],
       [ 1., -1.]])
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Float


@dataclass(frozen=True)
class Matrices:
    """A linear system: change (or next value) of the state a x + b u, output c x + d u."""

    a: Float[np.ndarray, "state state"]
    b: Float[np.ndarray, "state input"]
    c: Float[np.ndarray, "output state"]
    d: Float[np.ndarray, "output input"]

    @staticmethod
    def unchanged(count: int = 1) -> Matrices:
        """Make the system without states whose outputs are its inputs."""
        return Matrices(np.zeros((0, 0)), np.zeros((0, count)), np.zeros((count, 0)), np.eye(count))

    def then(self, after: Matrices) -> Matrices:
        """Put another system in series behind this one."""
        none = np.zeros((len(self.a), len(after.a)))
        return Matrices(
            np.block([[self.a, none], [after.b @ self.c, after.a]]),
            np.concatenate([self.b, after.b @ self.d]),
            np.concatenate([after.d @ self.c, after.c], axis=1),
            after.d @ self.d,
        )


def side_by_side(parts: Sequence[Matrices]) -> Matrices:
    """Join systems that do not touch one another."""
    from scipy.linalg import block_diag

    def joined(name: str) -> Any:
        found = [getattr(one, name) for one in parts]
        return np.asarray(block_diag(*found)) if found else np.zeros((0, 0))

    return Matrices(joined("a"), joined("b"), joined("c"), joined("d"))
