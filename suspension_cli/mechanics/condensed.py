"""Blocks of a linear model without their massless coordinates, ready to be solved at any frequency."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from suspension_cli.design.scene import Array, Index
from suspension_cli.mechanics import elimination, packed, reduction, stretching
from suspension_cli.mechanics.invariance import completed
from suspension_cli.mechanics.model import LinearModel

BURIED = 1e-6
"""Relative distance from the resonance of a part within which elimination leaves too few digits to refine."""
NOTHING = np.zeros(0, dtype=np.intp)


@dataclass(frozen=True)
class Piece:
    """Some rows and columns of K + i omega C - omega^2 M; arrays (r, s)."""

    stiffness: Any
    mass: Any
    damping: Any

    def at(self, omega: Array, square: Array) -> Any:
        """Its value (r, s, f), or (r, s, 1) where it does not depend on frequency; real where it can be."""
        if not self.moving and not self.resisting:
            return self.stiffness[..., None]
        result = np.empty((*self.stiffness.shape, len(omega)), dtype=complex if self.resisting else self.stiffness.dtype)
        result[:] = self.stiffness[..., None]
        for r, c in self.moving:
            result[r, c] -= self.mass[r, c] * square
        for r, c in self.resisting:
            result[r, c] += (1j * self.damping[r, c]) * omega
        return result

    def times(self, columns: Any, omega: Array, square: Array) -> Any:
        """Its product (r, k, f), or (r, k, 1), with constant columns (s, k)."""
        if not self.moving and not self.resisting:
            return (self.stiffness @ columns)[..., None]
        return Piece(self.stiffness @ columns, self.mass @ columns, self.damping @ columns).at(omega, square)

    @cached_property
    def moving(self) -> list[Any]:
        """Where mass is."""
        return np.argwhere(self.mass).tolist()

    @cached_property
    def resisting(self) -> list[Any]:
        """Where damping is."""
        return np.argwhere(self.damping).tolist()

    @cached_property
    def empty(self) -> bool:
        """Whether it is 0 at any frequency."""
        return not (self.stiffness.any() or self.mass.any() or self.damping.any())


@dataclass(frozen=True)
class Block:
    """One block of a model without its massless coordinates, ready to be solved at any frequency.

    Attributes
    ----------
    keep : (c,) int array
        Coordinates; that of a tip that stays (it has mass) is counted from where its wires would hold it (`stretching.held`).
    mass, damping : (c, 6 + c) arrays
        Against the support's coordinates and the block's own.
    stiffness : (c, 6 + c) array
        Complex if lossy.
    stiffness_low, mass_low, damping_low : (c, 6 + c) arrays
        What rounding took from the elements of these (`invariance`).
    drop, recover : (m,) int array, (c, m) array
        The massless coordinates, and how a force on them acts on those that are kept: -K_ab K_bb^-1.
    yielding, pulled : (m, m) array, (m, 6) array
        K_bb^-1, and K_bs towards the support.
    settled : (c, 6) array
        Where the coordinates stand when the support has moved by 1 and all has come to rest: S = -K^-1 K_s.  All 0 for a motion of the
        support that leaves no place to rest.
    resonances : (r,) array
        Undamped, rad/s, ascending; 0 for what is not held or not stable.
    parts : (p,) array
        The same, ascending, of each part of the tree by itself, hanging from a body that is held.
    tree : Tree
        The coordinates by body; one node if they form no tree.
    own, link, support, carried : tuples of Piece
        Of every node: itself, towards its parent (None for a root), towards the support, and towards the support once the coordinates are
        counted from where they would settle.
    """

    keep: Index
    mass: Any
    damping: Any
    stiffness: Any
    stiffness_low: Any
    mass_low: Any
    damping_low: Any
    drop: Index
    recover: Any
    yielding: Any
    pulled: Any
    settled: Any
    resonances: Any
    parts: Any
    tree: elimination.Tree
    own: tuple[Piece, ...]
    link: tuple[Piece | None, ...]
    support: tuple[Piece, ...]
    carried: tuple[Piece, ...]

    def driven(self, moves: Any, forces: Any) -> Any:
        """Which inputs (i,) drive this block."""
        return (self._joined @ np.abs(moves) != 0).any(0) | forces[self.keep].any(0) | forces[self.drop].any(0)

    @cached_property
    def _joined(self) -> Any:
        """Which motions of the support pull on which coordinates: 0 or 1, (c, 6)."""
        return ((self.stiffness[:, :6] != 0) | (self.damping[:, :6] != 0) | (self.mass[:, :6] != 0)).astype(float)

    def pushed(self, forces: Any) -> Any:
        """Forces (c, i) on the coordinates that are kept, from all (N, i)."""
        result, dropped = forces[self.keep], forces[self.drop]
        return result + self.recover @ dropped if dropped.any() else result

    def measured(self, omega: Array, limit: float) -> elimination.Factors:
        """K + i omega C - omega^2 M at some ascending frequencies (f,) in rad/s, ready to be solved, with what elimination loses measured.

        Where growth is above the limit systems are to be solved densely.
        """
        return elimination.factored(*self._systems(omega), self.tree, limit)

    def factored(self, omega: Array) -> elimination.Factors | packed.Packed:
        """The same unmeasured: to be solved densely but where a part is so close to resonating by itself that refining has nothing to start from."""
        buried = self._buried(omega)
        if self.plan is None:
            return elimination.factored(*self._systems(omega), self.tree, buried=buried)
        whole = elimination.whole(*self._systems(omega[buried]), self.tree) if len(buried) else None
        return packed.factored(self.plan, omega, buried, whole)

    def _systems(self, omega: Array) -> tuple[list[Any], list[Any]]:
        """The matrix of each node, and between its parent and it."""
        square = omega**2
        diagonal = [_everywhere(piece.at(omega, square), len(omega)) for piece in self.own]
        return diagonal, [None if piece is None else piece.at(omega, square) for piece in self.link]

    def _buried(self, omega: Array) -> Any:
        """Which of some ascending frequencies are too close to a part's own resonance."""
        first, last = omega.searchsorted(self._surroundings)
        if (first == last).all():
            return NOTHING
        return np.unique(np.concatenate([np.arange(a, b) for a, b in zip(first.tolist(), last.tolist(), strict=True)]))

    @cached_property
    def _surroundings(self) -> Any:
        """Between what frequencies (2, p) a part resonates."""
        return np.array([self.parts * (1 - BURIED), self.parts * (1 + BURIED)])

    @cached_property
    def plan(self) -> packed.Plan | None:
        """How it is eliminated in large steps, where that is possible."""
        return packed.plan(self.tree, self.own, self.link, self.support, self.carried)

    def solve(self, factors: elimination.Factors | packed.Packed, omega: Array, moves: Any, pushed: Any, *, carried: bool) -> Any:
        """Coordinates (c, i, f) for support motions (6, i) and forces (c, i).

        Far below the resonances all that a motion of the support does is to carry the coordinates to S s, which no inertia resists, and what is
        left of x = S s + u follows from

            (K + i omega C - omega^2 M) u = omega^2 (M_s + M S) s - i omega (C_s + C S) s

        in which nothing cancels, where in (...) x = -K_s s + ... it would be all but omega^2 of everything.  Far above them it is the other
        way round.
        """
        if isinstance(factors, packed.Packed):
            result = factors.solve(moves, pushed, carried=carried)
            return np.add(result, (self.settled @ moves)[..., None], out=result) if carried else result
        square = omega**2
        moved, forced = moves.any(0).nonzero()[0], pushed.any(0).nonzero()[0]
        right = []
        for piece, where in zip(self.carried if carried else self.support, self.tree.where, strict=True):
            force = elimination.Columns(forced, pushed[where][:, forced, None]).needed()
            if len(moved) and not piece.empty:
                force = elimination.Columns(moved, piece.times(-moves[:, moved], omega, square)).joined(force)
            right.append(force)
        result = factors.solve_columns(right, moves.shape[1])
        return result + (self.settled @ moves)[..., None] if carried else result

    def corrected(self, factors: elimination.Factors | packed.Packed, right: Any) -> Any:
        """Coordinates (c, P) for right sides (c, P), one a system."""
        if isinstance(factors, packed.Packed):
            return factors.corrected(right)
        only = np.zeros(1, dtype=np.intp)
        return factors.solve_columns([elimination.Columns(only, right[where][:, None]) for where in self.tree.where], 1)[:, 0]

    @cached_property
    def kept(self) -> dict[Any, Any]:
        """What an analysis works out once for this block and keeps for its next call."""
        return {}


def _everywhere(values: Any, count: int) -> Any:
    """The same for every frequency where there is but one."""
    return values if values.shape[-1] == count else np.broadcast_to(values, (*values.shape[:-1], count))


def condensed_blocks(model: LinearModel) -> list[Block]:
    """All blocks of a model, massless coordinates eliminated (exactly: K_bb does not depend on frequency)."""
    return [prepared(model, number) for number in range(len(model.blocks))]


def prepared(model: LinearModel, number: int) -> Block:
    """One block of a model, worked out once."""
    if number not in model.prepared:
        model.prepared[number] = _block(model, model.blocks[number])
    return model.prepared[number]


def _block(model: LinearModel, block: Index) -> Block:
    tips = np.array([_owner(model.coordinate[n]) != "frame" for n in block])  # nothing asks for their motion, nothing pushes them
    light = model.massless[block] & tips & ~(model.damping[block] != 0).any(1)
    keep, drop = block[~light], block[light]
    full = model.stiffness if model.lossy is None else model.lossy
    if not np.iscomplexobj(full) or not full[block].imag.any():
        full = full.real
    held = stretching.held(model, block, ~light & (block >= 6 * (len(model.body) + 1)) & tips)
    whole, follows, free = _without_tips(model, full, block, light, held)
    order = np.argsort([_rank(model, _owner(model.coordinate[n])) for n in keep], kind="stable")
    keep, columns = keep[order], np.concatenate([np.arange(6), 6 + order])
    whole = reduction.Reduced(*(part[order[:, None], columns] for part in (whole.real, whole.imag)))
    stiffness, low = reduction.rounded(whole)
    damping_low, undamped = completed(model.damping, model, keep)
    own = np.concatenate([np.arange(6), 6 + np.flatnonzero(~light)[order]])

    both = np.concatenate([np.arange(6), keep])
    mass, damping, damping_low = model.mass[np.ix_(keep, both)], model.damping[np.ix_(keep, both)], damping_low[:, both]
    mass_low = np.zeros_like(mass)
    if held is not None:
        (mass, mass_low), (damping, damping_low) = (reduction.turned(*parts, held[np.ix_(own, own)]) for parts in ((mass, mass_low), (damping, damping_low)))
    matrices = stiffness, mass, damping
    settled = reduction.settled(whole, np.zeros((len(keep), 6)) if model.rigid is None else model.rigid[keep], free)
    left, settled = _left(matrices, (mass_low, damping_low), settled, free & undamped)
    coupled = np.logical_or.reduce([matrix[:, 6:] != 0 for matrix in matrices])
    tree = elimination.tree([_owner(model.coordinate[n]) for n in keep], coupled) or elimination.Tree((np.arange(len(keep)),), (-1,))

    def piece(rows: Index, columns: Index) -> Piece:
        return Piece(*(matrix[rows[:, None], columns] for matrix in matrices))

    return Block(
        keep=keep,
        mass=matrices[1],
        damping=matrices[2],
        stiffness=stiffness,
        stiffness_low=low,
        mass_low=mass_low,
        damping_low=damping_low,
        drop=drop,
        recover=-follows[:, columns[6:]].T,
        yielding=np.linalg.inv(full[np.ix_(drop, drop)]),
        pulled=full[np.ix_(drop, np.arange(6))],
        settled=settled,
        resonances=reduction.resonances(stiffness.real, matrices[1]),
        parts=_parts(stiffness.real, matrices[1], tree),
        tree=tree,
        own=tuple(piece(node, node + 6) for node in tree.nodes),
        link=tuple(None if above < 0 else piece(tree.nodes[above], node + 6) for node, above in zip(tree.nodes, tree.parent, strict=True)),
        support=tuple(piece(node, np.arange(6)) for node in tree.nodes),
        carried=tuple(Piece(*(matrix[node] for matrix in left)) for node in tree.nodes),
    )


def _parts(stiffness: Any, mass: Any, tree: elimination.Tree) -> Any:
    """Resonances of all that hangs from each node's parent with it."""
    below = [list(node) for node in tree.nodes]
    found = [np.zeros(0)]
    for n in range(len(tree.nodes) - 1, -1, -1):
        if tree.parent[n] >= 0:
            rows = np.sort(np.array(below[n], dtype=np.intp))
            columns = np.concatenate([np.arange(6), 6 + rows])
            found.append(reduction.resonances(stiffness[np.ix_(rows, columns)], mass[np.ix_(rows, columns)]))
            below[tree.parent[n]] += below[n]
    return np.unique(np.concatenate(found))


def _without_tips(model: LinearModel, full: Any, block: Index, light: Any, held: Any) -> tuple[reduction.Reduced, Any, Any]:
    """The stiffness of what is kept, how the tips follow, and which motions of everything cost nothing."""
    both = np.concatenate([np.arange(6), block])
    low = model.low
    real, free = completed(full.real, model, block, None if low is None else low.real)
    imag, alike = completed(full.imag, model, block, None if low is None else low.imag)
    high, rest = full[np.ix_(block, both)], (real + 1j * imag)[:, both]
    if held is not None:
        high, rest = reduction.turned(high, rest, held)
    whole, follows = reduction.reduced(high, rest, light)
    return whole, follows, free & alike


def _left(matrices: tuple[Any, Any, Any], low: tuple[Any, Any], settled: Any, undamped: Any) -> tuple[tuple[Any, Any, Any], Any]:
    """What still acts on coordinates counted from where they would settle (K, M and C towards the support), and where that is."""
    stiffness, mass, damping = matrices
    rests = np.isfinite(settled).all(0)
    settled = np.where(rests, settled, 0.0)
    resisted = reduction.left_over(damping, low[1], settled)
    resisted[:, undamped] = 0.0
    return (np.where(rests, 0.0, stiffness[:, :6]), reduction.left_over(mass, low[0], settled), resisted), settled


def _owner(coordinate: str) -> str:
    """The body that a coordinate is eliminated with: a blade's tip goes with the stage that hangs on it."""
    return coordinate.split(".", 1)[0]


def _rank(model: LinearModel, owner: str) -> int:
    """Parents first: the frame, then the stages in their order."""
    return -1 if owner == "frame" else model.body.index(owner)
