"""The linear model of small motions: what every rung of the ladder gives and every analysis takes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.conventions import DOFS
from suspension_cli.design.scene import Index

if TYPE_CHECKING:
    from suspension_cli.mechanics.dispersion import Term
    from suspension_cli.mechanics.stretching import Stretching


@dataclass(frozen=True)
class LinearModel:
    """M x'' + C x' + K x = f, the support's coordinates included.

    The coordinates are, in this order: six of the support, six of every body, then those of blade tips.  The tips may
    be combined (sum and difference of two blades that mirror each other) so that motions of different symmetry share no
    element; the coordinates of bodies always stand for themselves.

    Attributes
    ----------
    body : tuple of str
        Names of the stages.
    coordinate : tuple of str
        N names: ``support.x``, ..., ``test.yaw``, ``test.blade1.z``.
    basis : (N, N) array
        The named coordinates (rows) in terms of the model's own (columns).
    massless : (N,) bool array
        Coordinates without inertia (tips of blades without tip mass).
    mass, stiffness, damping : (..., N, N) arrays
        SI; exactly symmetric; exactly 0 where a symmetry forbids a coupling.
    lossy : (..., N, N) complex array or None
        The stiffness with loss angles, k (1 + i phi); None if nothing is lossy.
    low : (N, N) array or None
        What rounding to doubles takes from the elements of the lossy stiffness, or of the stiffness if nothing is lossy; None if that is not known.
    stretched : Stretching or None
        How much of the stiffness is the stretching of wires; None if that is not known.
    orientation : (..., n + 1, 3, 3) array or None
        Rotation of each body (support first) from its nominal orientation; None if none is turned.
    residual : float
        Largest force left over in the equilibrium, as a share of the weight.
    wire : tuple of str
        Names of the wires (string rung).
    terms : tuple of Term
        What depends on frequency (`beam`, `violin`): see `mechanics.dispersion`.
    rigid : (..., N, 6) array or None
        How the coordinates go when everything moves with the support as one body, for unit motions of the support in m and rad: 0 for what
        is told relative to a body (tips of blades, the frame).  None if that is not known.
    """

    body: tuple[str, ...]
    coordinate: tuple[str, ...]
    basis: Any
    massless: Any
    mass: Any
    stiffness: Any
    damping: Any
    lossy: Any = None
    low: Any = None
    stretched: Stretching | None = None
    orientation: Any = None
    residual: float = 0.0
    wire: tuple[str, ...] = ()
    terms: tuple[Term, ...] = ()
    rigid: Any = None

    @property
    def size(self) -> int:
        """Number N of coordinates."""
        return len(self.coordinate)

    @property
    def batch(self) -> tuple[int, ...]:
        """Shape of the batch axes."""
        return np.broadcast_shapes(self.mass.shape[:-2], self.stiffness.shape[:-2])

    def index(self, body: str, dof: str) -> int:
        """The coordinate of a body."""
        return 6 * (self.body.index(body) + 1) + DOFS.index(dof)

    @cached_property
    def pulled(self) -> Any:
        """Which of the support's motions pull on which coordinates: (N, 6) bool; without batch axes."""
        full = self.stiffness if self.lossy is None else self.lossy
        return (full[:, :6] != 0) | (self.damping[:, :6] != 0) | (self.mass[:, :6] != 0)

    @cached_property
    def prepared(self) -> dict[Any, Any]:
        """What a solver works out once for each block and keeps here for its next call."""
        return {}

    @cached_property
    def member(self) -> Any:
        """Number of the block that each coordinate is in, (N,); -1 for the support's."""
        result = np.full(self.size, -1)
        for number, group in enumerate(self.blocks):
            result[group] = number
        return result

    @cached_property
    def blocks(self) -> tuple[Index, ...]:
        """Groups of coordinates that do not couple: the connected parts of the graph of non-zero elements.

        The support is left out.  Ordered by their first coordinate.
        """
        joined = np.zeros((self.size, self.size), dtype=bool)
        dispersive = (matrix for term in self.terms for matrix in term.matrices)
        for matrix in (self.mass, self.stiffness, self.damping, *(() if self.lossy is None else (self.lossy,)), *dispersive):
            joined |= (matrix != 0).reshape(-1, self.size, self.size).any(0)
        joined |= joined.T  # a damper may sense one body and push another
        # each row as the bits of one integer: a handful of coordinates is quickest that way
        rows = [int.from_bytes(row.tobytes(), "little") for row in np.packbits(joined, axis=1, bitorder="little")]
        left = (1 << self.size) - (1 << 6)
        found: list[Index] = []
        while left:
            group, front = 0, left & -left
            while front:
                group |= front
                reached = 0
                for n in range(self.size):
                    if front >> n & 1:
                        reached |= rows[n]
                front = reached & left & ~group
            left &= ~group
            found.append(np.array([n for n in range(self.size) if group >> n & 1]))
        return tuple(found)
