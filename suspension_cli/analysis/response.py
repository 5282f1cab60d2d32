"""Frequency responses: solve (K + i omega C - omega^2 M) x = f, never sum modes.

Only the blocks that the asked inputs and outputs both touch are solved, each body by body
(`mechanics.elimination`), all frequencies at once; a block without loss or damping in real arithmetic.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from suspension_cli.analysis import signals
from suspension_cli.analysis.signals import Signal
from suspension_cli.design.scene import Array, Index
from suspension_cli.errors import Fault, InputError
from suspension_cli.mechanics import elimination
from suspension_cli.mechanics.model import LinearModel

CHUNK = 1 << 17
"""Numbers (coordinates times inputs times frequencies) worked on at once: few enough to stay in the cache."""


@dataclass(frozen=True)
class Response:
    """Responses of outputs to inputs.

    Attributes
    ----------
    frequency : (f,) array
        Hz.
    input, output : tuple of str
        Signals.
    unit : tuple of tuple of str
        Unit of each output over each input, [output][input].
    value : (f, output, input) complex array
    blocks : int
        How many blocks had to be solved.
    """

    frequency: Array
    input: tuple[str, ...]
    output: tuple[str, ...]
    unit: tuple[tuple[str, ...], ...]
    value: Any
    blocks: int


def solve(model: LinearModel, frequency: Array, inputs: list[Signal], outputs: list[Signal]) -> Response:
    """Responses of a model without batch axes.

    Parameters
    ----------
    model : LinearModel
    frequency : (f,) array
        Hz; 0 gives the static response.
    inputs : list of Signal
        Motions of the support; forces and torques on bodies.
    outputs : list of Signal
        Motions.

    Returns
    -------
    Response

    Raises
    ------
    InputError
        At a frequency that is a lossless resonance to the last bit.
    """
    rows = np.array([signals.row(signal, model) for signal in outputs])
    drives = np.array([signals.row(signal, model) for signal in inputs])
    value, count = transfer(model, 2 * np.pi * np.asarray(frequency, dtype=float), drives, [s.acts for s in inputs], rows)
    unit = tuple(tuple(f"{out.unit}/{into.unit}".replace("/N m", "/(N m)") for into in inputs) for out in outputs)
    return Response(np.asarray(frequency), tuple(s.text for s in inputs), tuple(s.text for s in outputs), unit, value, count)


def transfer(model: LinearModel, omega: Array, drives: Array, acts: list[bool], rows: Array) -> tuple[Any, int]:
    """Transfer matrix (f, o, i) from drives to linear forms of the coordinates, and how many blocks it took.

    Parameters
    ----------
    model : LinearModel
    omega : (f,) array
        rad/s.
    drives : (i, N) array
        Forces as generalised forces, support motions as unit vectors of the support's coordinates.
    acts : list of bool
        Which drives are forces.
    rows : (o, N) array
    """
    moves = np.array([np.zeros_like(d[:6]) if act else d[:6] for d, act in zip(drives, acts, strict=True)]).T  # (6, i)
    forces = np.array([d if act else np.zeros_like(d) for d, act in zip(drives, acts, strict=True)]).T  # (N, i)
    result = np.zeros((len(rows), drives.shape[0], len(omega)), dtype=complex)
    _add(result, rows[:, :6] @ moves)
    reached = rows[:, :6] @ moves != 0  # memory that nothing has reached stays untouched
    count, pulled, moved = 0, _pulled(model), moves.any(1)
    for number, group in enumerate(model.blocks):
        watched = np.flatnonzero(rows[:, group].any(1))
        if not len(watched) or not (forces[group].any() or pulled[group][:, moved].any()):
            continue
        part = _prepared(model, number)
        touched = np.flatnonzero(part.driven(moves, forces))
        count += 1
        seen = rows[np.ix_(watched, part.keep)] + rows[np.ix_(watched, part.drop)] @ part.recover.T
        step = min(max(CHUNK // max(len(part.keep) * len(touched), 1), 256), 4096)
        for start in range(0, len(omega) if len(part.keep) else 0, step):
            now = slice(start, start + step)
            x = part.solve(omega[now], moves[:, touched], forces[:, touched])
            _demand_finite(x, omega[now])
            for row, form in zip(watched, seen, strict=True):
                motion = _combined(form, x)
                for column, i in enumerate(touched):
                    if reached[row, i]:
                        result[row, i, now] += motion[column]
                    else:
                        result[row, i, now] = motion[column]
        reached[np.ix_(watched, touched)] = True
        at_once = part.yielding @ (forces[part.drop] - part.pulled @ moves)
        _add(result, _scattered(rows[np.ix_(watched, part.drop)] @ at_once, watched, len(rows)))
    return np.moveaxis(result, -1, 0), count


def _demand_finite(x: Any, omega: Array) -> None:
    """Raise `InputError` where a system was singular to the last bit."""
    bad = ~np.isfinite(x).all((0, 1))
    if bad.any():
        at = float(omega[bad][0]) / (2 * np.pi)
        raise InputError(
            [Fault("--frequency", "is a resonance without loss, where the response is infinite", "move it, or give loss_angle or damping", f"{at!r}")]
        )


def _pulled(model: LinearModel) -> Any:
    """Which of the support's motions pull on which coordinates: (N, 6) bool."""
    full = model.stiffness if model.lossy is None else model.lossy
    return (full[:, :6] != 0) | (model.damping[:, :6] != 0) | (model.mass[:, :6] != 0)


def _combined(form: Array, x: Any) -> Any:
    """A linear form (c,) of coordinates (c, i, f); just the coordinate where it is one."""
    chosen = np.flatnonzero(form)
    if len(chosen) == 1 and form[chosen[0]] == 1.0:
        return x[chosen[0]]
    return sum(form[c] * x[c] for c in chosen)


def _add(result: Any, constant: Any) -> None:
    """Add what does not depend on frequency (o, i), where it is not 0."""
    for o, i in np.argwhere(constant != 0):
        result[o, i] += constant[o, i]


def _scattered(values: Any, rows: Any, count: int) -> Any:
    """Rows of values placed among `count` rows of zeros."""
    result = np.zeros((count, values.shape[1]), dtype=values.dtype)
    result[rows] = values
    return result


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
    return [_prepared(model, number) for number in range(len(model.blocks))]


def _prepared(model: LinearModel, number: int) -> Block:
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
