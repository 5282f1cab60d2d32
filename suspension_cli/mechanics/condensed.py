"""Blocks of a linear model without their massless coordinates, ready to be solved at any frequency."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from suspension_cli.design.scene import Array, Index
from suspension_cli.mechanics import elimination
from suspension_cli.mechanics.model import LinearModel


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
        Coordinates.
    mass, damping : (c, 6 + c) arrays
        Against the support's coordinates and the block's own.
    stiffness : (c, 6 + c) array
        Complex if lossy.
    drop, recover : (m,) int array, (c, m) array
        The massless coordinates, and how a force on them acts on those that are kept: -K_ab K_bb^-1.
    yielding, pulled : (m, m) array, (m, 6) array
        K_bb^-1, and K_bs towards the support.
    tree : Tree
        The coordinates by body; one node if they form no tree.
    own, link, support : tuples of Piece
        Of every node: itself, towards its parent (None for a root), towards the support.
    """

    keep: Index
    mass: Any
    damping: Any
    stiffness: Any
    drop: Index
    recover: Any
    yielding: Any
    pulled: Any
    tree: elimination.Tree
    own: tuple[Piece, ...]
    link: tuple[Piece | None, ...]
    support: tuple[Piece, ...]

    def driven(self, moves: Any, forces: Any) -> Any:
        """Which inputs (i,) drive this block."""
        joined = (self.stiffness[:, :6] != 0) | (self.damping[:, :6] != 0) | (self.mass[:, :6] != 0)
        return (joined.astype(float) @ np.abs(moves) != 0).any(0) | forces[self.keep].any(0) | forces[self.drop].any(0)

    def solve(self, omega: Array, moves: Any, forces: Any) -> Any:
        """Coordinates (c, i, f) for support motions (6, i) and forces (N, i)."""
        square = omega**2
        pushed = (forces[self.keep] + self.recover @ forces[self.drop])[..., None]
        diagonal = [np.broadcast_to(piece.at(omega, square), (*piece.stiffness.shape, len(omega))) for piece in self.own]
        links = [None if piece is None else piece.at(omega, square) for piece in self.link]
        right = [
            pushed[node] if piece.empty else pushed[node] - elimination.multiply(piece.at(omega, square), moves[..., None])
            for node, piece in zip(self.tree.nodes, self.support, strict=True)
        ]
        return elimination.solve_nodes(diagonal, links, right, self.tree)


def condensed_blocks(model: LinearModel) -> list[Block]:
    """All blocks of a model, massless coordinates eliminated (exactly: K_bb does not depend on frequency)."""
    return [prepared(model, number) for number in range(len(model.blocks))]


def prepared(model: LinearModel, number: int) -> Block:
    """One block of a model, worked out once."""
    if number not in model.prepared:
        model.prepared[number] = _block(model, model.blocks[number])
    return model.prepared[number]


def _block(model: LinearModel, block: Index) -> Block:
    light = model.massless[block] & ~(model.damping[block] != 0).any(1)
    keep, drop = block[~light], block[light]
    both = np.concatenate([np.arange(6), keep])
    full = model.stiffness if model.lossy is None else model.lossy
    stiffness = full[np.ix_(keep, both)]
    if not np.iscomplexobj(stiffness) or not stiffness.imag.any():
        stiffness = stiffness.real
    yielding = np.linalg.inv(full[np.ix_(drop, drop)])
    recover = -full[np.ix_(keep, drop)] @ yielding
    if len(drop):
        stiffness = stiffness + recover @ full[np.ix_(drop, both)]
        stiffness[:, 6:] = (stiffness[:, 6:] + stiffness[:, 6:].T) / 2
    mass, damping = model.mass[np.ix_(keep, both)], model.damping[np.ix_(keep, both)]
    coupled = (stiffness[:, 6:] != 0) | (mass[:, 6:] != 0) | (damping[:, 6:] != 0)
    owner = [_owner(model.coordinate[n]) for n in keep]
    order = np.argsort([_rank(model, name) for name in owner], kind="stable")
    keep, owner = keep[order], [owner[n] for n in order]
    columns = np.concatenate([np.arange(6), 6 + order])
    tree = elimination.tree(owner, coupled[np.ix_(order, order)]) or elimination.Tree((np.arange(len(keep)),), (-1,))
    mass, damping, stiffness = (matrix[order[:, None], columns] for matrix in (mass, damping, stiffness))

    def piece(rows: Index, columns: Index) -> Piece:
        return Piece(*(matrix[rows[:, None], columns] for matrix in (stiffness, mass, damping)))

    return Block(
        keep=keep,
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        drop=drop,
        recover=recover[order],
        yielding=yielding,
        pulled=full[np.ix_(drop, np.arange(6))],
        tree=tree,
        own=tuple(piece(node, node + 6) for node in tree.nodes),
        link=tuple(None if above < 0 else piece(tree.nodes[above], node + 6) for node, above in zip(tree.nodes, tree.parent, strict=True)),
        support=tuple(piece(node, np.arange(6)) for node in tree.nodes),
    )


def _owner(coordinate: str) -> str:
    """The body that a coordinate is eliminated with: a blade's tip goes with the stage that hangs on it."""
    return coordinate.split(".", 1)[0]


def _rank(model: LinearModel, owner: str) -> int:
    """Parents first: the frame, then the stages in their order."""
    return -1 if owner == "frame" else model.body.index(owner)
