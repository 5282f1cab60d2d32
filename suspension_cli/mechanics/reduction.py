"""Stiffness without massless coordinates, and what follows from it at rest: in twofold arithmetic, once for each block."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.design.scene import Array
from suspension_cli.mechanics import twofold
from suspension_cli.mechanics.twofold import Twofold


@dataclass(frozen=True)
class Reduced:
    """Stiffness without the massless coordinates, against the support and those kept (c, 6 + c), in twofold; complex ones as real and imaginary part."""

    real: Twofold
    imag: Twofold

    @property
    def lossy(self) -> bool:
        """Whether any of it is."""
        return bool(self.imag.high.any())

    def embedded(self, columns: slice) -> Twofold:
        """Some columns as real matrices: (c, q), or (2 c, 2 q) if lossy."""
        real, imag = self.real[:, columns], self.imag[:, columns]
        return _embedded(real, imag) if self.lossy else real


def turned(full: Any, low: Any, basis: Array) -> tuple[Any, Any]:
    """Some rows (n, 6 + n) of a matrix, and what rounding took from them, in other coordinates: from these the old ones follow as basis (6 + n, 6 + n)."""
    own, whole = Twofold.of(basis[6:, 6:].T), Twofold.of(basis)
    real, imag = (own @ Twofold(*parts) @ whole for parts in ((full.real, low.real), (full.imag, low.imag)))
    return (real.high + 1j * imag.high, real.low + 1j * imag.low) if np.iscomplexobj(full) else (real.high, real.low)


def _embedded(real: Twofold, imag: Twofold) -> Twofold:
    """((A, -B), (B, A)) for A + i B."""
    high = np.block([[real.high, -imag.high], [imag.high, real.high]])
    return Twofold(high, np.block([[real.low, -imag.low], [imag.low, real.low]]))


def reduced(full: Any, low: Any, light: Any) -> tuple[Reduced, Any]:
    """Schur complement K_aa - K_ab K_bb^-1 K_ba of some rows of the stiffness (n, 6 + n); and K_bb^-1 K_b as doubles (m, 6 + c).

    The tips' share cancels most of a wire's stiffness where the blade is much softer, so this is done in twofold.
    """

    def part(rows: Any, columns: Any) -> tuple[Twofold, Twofold]:
        where = np.ix_(rows, columns)
        return Twofold(full.real[where], low.real[where]), Twofold(full.imag[where], low.imag[where])

    stays, columns = np.flatnonzero(~light), np.concatenate([np.arange(6), 6 + np.flatnonzero(~light)])
    drops, gone = np.flatnonzero(light), 6 + np.flatnonzero(light)
    kept = part(stays, columns)
    if not len(drops):
        return Reduced(*kept), np.zeros((0, len(columns)))
    (real, imag), count = part(drops, columns), len(drops)
    follows = twofold.solve(_embedded(*part(drops, gone)), Twofold.stacked([real, imag]))
    taken = _embedded(*part(stays, gone)) @ follows
    result = Reduced(kept[0] - taken[: len(stays)], kept[1] - taken[len(stays) :])
    return result, follows.value[:count] + 1j * follows.value[count:] if result.lossy else follows.value[:count]


def rounded(stiffness: Reduced) -> tuple[Any, Any]:
    """The stiffness in doubles, exactly symmetric, and what that leaves out."""
    parts = []
    for part in (stiffness.real, stiffness.imag):
        high = part.high.copy()
        high[:, 6:] = (high[:, 6:] + high[:, 6:].T) / 2
        parts.append((high, (part - Twofold.of(high)).value))
    (real, low), (imag, imag_low) = parts
    return (real + 1j * imag, low + 1j * imag_low) if stiffness.lossy else (real, low)


def settled(stiffness: Reduced, rigid: Any, free: Any) -> Any:
    """S = -K^-1 K_s (c, 6): how everything moves as one where that costs nothing, else solved for in twofold; not finite where K is singular."""
    count = len(stiffness.real.high)
    found = -twofold.solve(stiffness.embedded(slice(6, None)), stiffness.embedded(slice(0, 6))).value
    result = found[:count, :6] + 1j * found[count:, :6] if stiffness.lossy else found
    result[:, free] = rigid[:, free]
    return result


def left_over(matrix: Any, low: Any, settled_at: Any) -> Any:
    """A_s + A S (c, 6), rounded once."""
    of, towards = Twofold(matrix[:, 6:], low[:, 6:]), Twofold(matrix[:, :6], low[:, :6])
    real = (towards + of @ Twofold.of(settled_at.real)).value
    return real + 1j * (of @ Twofold.of(settled_at.imag)).value if np.iscomplexobj(settled_at) and settled_at.imag.any() else real


def resonances(stiffness: Any, mass: Any) -> Any:
    """Undamped resonances, rad/s; 0 for what is not held or not stable."""
    heavy = (mass[:, 6:] != 0).any(1)
    own, light = stiffness[:, 6:], np.flatnonzero(~heavy)
    kept = np.flatnonzero(heavy)
    held = own[np.ix_(kept, kept)]
    if len(light):
        held = held - own[np.ix_(kept, light)] @ np.linalg.solve(own[np.ix_(light, light)], own[np.ix_(light, kept)])
    root = np.linalg.inv(np.linalg.cholesky(mass[np.ix_(kept, kept + 6)]))
    dynamic = root @ held @ root.T
    return np.sqrt(np.maximum(np.linalg.eigvalsh((dynamic + dynamic.T) / 2), 0.0))
