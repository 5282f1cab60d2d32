"""Frequency responses: solve (K + i omega C - omega^2 M) x = f, never sum modes.

Only the blocks that the asked inputs and outputs both touch are solved, each body by body
(`mechanics.elimination`), all frequencies at once; a block without loss or damping in real arithmetic.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.analysis import signals
from suspension_cli.analysis.signals import Signal
from suspension_cli.design.scene import Array, Index
from suspension_cli.errors import Fault, InputError
from suspension_cli.mechanics import elimination
from suspension_cli.mechanics.model import LinearModel

CHUNK = 2048
"""Frequencies solved at once: small enough that their blocks stay in the cache."""


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
    result += (rows[:, :6] @ moves)[..., None]
    count = 0
    for part in condensed_blocks(model):
        touched = part.driven(moves, forces)
        watched = rows[:, part.keep].any(1) | rows[:, part.drop].any(1)
        if not touched.any() or not watched.any():
            continue
        count += 1
        here = np.ix_(watched, touched)
        for start in range(0, len(omega), CHUNK):
            now = slice(start, start + CHUNK)
            x = part.solve(omega[now], moves[:, touched], forces[:, touched])
            _demand_finite(x, omega[now])
            seen = rows[np.ix_(watched, part.keep)] + rows[np.ix_(watched, part.drop)] @ part.recover.T
            result[(*here, now)] += np.einsum("oc,cif->oif", seen, x)
        at_once = part.yielding @ (forces[part.drop] - part.pulled @ moves)
        result[here] += (rows[np.ix_(watched, part.drop)] @ at_once[:, touched])[..., None]
    return np.moveaxis(result, -1, 0), count


def _demand_finite(x: Any, omega: Array) -> None:
    finite = np.isfinite(x).all((0, 1))
    if not finite.all():
        where = omega[~finite][0] / (2 * np.pi)
        remedy = "move it a little, or give the design loss angles or dampers"
        raise InputError([Fault("--frequency", "is a resonance without loss, where the response is infinite", remedy, f"{where:.9g}")])


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
    structure : Tree or None
    """

    keep: Index
    mass: Any
    damping: Any
    stiffness: Any
    drop: Index
    recover: Any
    yielding: Any
    pulled: Any
    structure: elimination.Tree | None

    def driven(self, moves: Any, forces: Any) -> Any:
        """Which inputs (i,) drive this block."""
        joined = (self.stiffness[:, :6] != 0) | (self.damping[:, :6] != 0) | (self.mass[:, :6] != 0)
        return (joined.astype(float) @ np.abs(moves) != 0).any(0) | forces[self.keep].any(0) | forces[self.drop].any(0)

    def dynamic(self, omega: Array) -> Any:
        """K + i omega C - omega^2 M, (c, 6 + c, f); real where it can be."""
        square = self.stiffness[..., None] - self.mass[..., None] * omega**2
        return square + 1j * self.damping[..., None] * omega if self.damping.any() else square

    def solve(self, omega: Array, moves: Any, forces: Any) -> Any:
        """Coordinates (c, i, f) for support motions (6, i) and forces (N, i)."""
        dynamic = self.dynamic(omega)
        right = (forces[self.keep] + self.recover @ forces[self.drop])[..., None] - np.einsum("csf,si->cif", dynamic[:, :6], moves)
        return elimination.solve(dynamic[:, 6:], right, self.structure)


def condensed_blocks(model: LinearModel) -> list[Block]:
    """All blocks of a model, massless coordinates eliminated (exactly: K_bb does not depend on frequency)."""
    return [_block(model, block) for block in model.blocks]


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
    structure = elimination.tree(owner, coupled[np.ix_(order, order)])
    return Block(
        keep,
        mass[np.ix_(order, columns)],
        damping[np.ix_(order, columns)],
        stiffness[np.ix_(order, columns)],
        drop,
        recover[order],
        yielding,
        full[np.ix_(drop, np.arange(6))],
        structure,
    )


def _owner(coordinate: str) -> str:
    """The body that a coordinate is eliminated with: a blade's tip goes with the stage that hangs on it."""
    return coordinate.split(".", 1)[0]


def _rank(model: LinearModel, owner: str) -> int:
    """Parents first: the frame, then the stages in their order."""
    return -1 if owner == "frame" else model.body.index(owner)
