"""Many imperfect builds of one design at once: equilibrium, linear model and response of each.

All work is on arrays over the builds; nothing that one build gets depends on which others are computed with it, to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analysis.modes import RIGID
from suspension_cli.analysis.signals import Signal, row
from suspension_cli.conventions import PARITY_X, PARITY_Y, SUPPORT
from suspension_cli.design.scene import Array, Scene
from suspension_cli.design.schema import Design
from suspension_cli.mechanics import assemble
from suspension_cli.mechanics.blocks import mirrored
from suspension_cli.mechanics.equilibrium import Equilibrium, solve
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.mechanics.pose import layout
from suspension_cli.models.surroundings import surrounded

GOOD, SLACK, UNBALANCED, UNSTABLE, IMPOSSIBLE = 0, 1, 2, 3, 4
STATUS = ("good", "a wire is slack", "no equilibrium near the nominal pose", "the equilibrium is unstable", "the design is not possible")
"""What the status of a build means."""
NOTHING = complex(np.nan, np.nan)
"""Response of a build that failed."""
SYSTEMS = 4096
"""Systems (builds times frequencies) solved at once, at most, unless there are more builds."""


@dataclass(frozen=True)
class Column:
    """One dataset that a job fills, first axes the points.

    Attributes
    ----------
    name : str
    dtype : str
    shape : tuple of int
        Of one point.
    units : str
    axes : tuple of str
        Names of the datasets that are the scales of `shape`.
    """

    name: str
    dtype: str
    shape: tuple[int, ...]
    units: str
    axes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Builds:
    """Balanced builds.

    Attributes
    ----------
    model : LinearModel
        With the builds as first axis; only builds with status `GOOD` mean anything.
    status : (p,) uint8 array
    wire : (p,) int16 array
        The first slack wire, or -1.
    residual : (p,) array
        Largest force left over, of the weight.
    mirrors : (p, 2) bool array
        Whether each build maps on itself when x, or y, is mirrored.
    """

    model: LinearModel
    status: Any
    wire: Any
    residual: Any
    mirrors: Any


def balance(scene: Scene, design: Design, *, allow_unstable: bool = False, split: bool = False) -> Builds:
    """Equilibrium and linear model of every scene of a batch with one axis; an unstable one is a failure unless that is allowed.

    `split` looks for mirror symmetries that all scenes share: then what one scene gets depends on the others, unless all have the same ones.
    """
    numbering = layout(scene)
    with np.errstate(all="ignore"):
        found = solve(scene, numbering)
        model = surrounded(assemble.linear_model(scene, found, split=split), design)
        slack = found.tension <= 0
        status = np.full(scene.batch, GOOD, dtype=np.uint8)
        if not allow_unstable:
            status[grows(model)] = UNSTABLE
        status[slack.any(-1)] = SLACK
        status[~found.converged] = UNBALANCED
    wire = np.full(status.shape, -1, dtype=np.int16)
    wire[status == SLACK] = slack[status == SLACK].argmax(-1) if slack.shape[-1] else -1
    return Builds(oriented(model, found), status, wire, found.residual, mirrored(scene))


def oriented(model: LinearModel, found: Equilibrium) -> LinearModel:
    """A model that tells how its bodies are turned even if none of the batch is."""
    return replace(model, orientation=model.orientation if model.orientation is not None else found.pose.rotation)


def grows(model: LinearModel) -> Any:
    """Models (p,) of which a mode grows, by more than rounding makes of a rigid one: K + c M is not positive definite for a tiny c."""
    stiffness, mass = np.nan_to_num(model.stiffness[..., 6:, 6:]), model.mass[..., 6:, 6:]
    k, m = (np.diagonal(matrix, axis1=-2, axis2=-1) for matrix in (stiffness, mass))
    largest = np.where(m > 0, np.abs(k) / np.where(m > 0, m, 1.0), 0.0).sum(-1)
    return ~_positive(stiffness + np.nan_to_num(RIGID * largest[..., None, None] * mass))


def _positive(matrix: Any) -> Any:
    """Which matrices (p, n, n) are positive definite, each by itself."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        if len(matrix) == 1:
            return np.zeros(1, dtype=bool)
        middle = len(matrix) // 2
        return np.concatenate([_positive(matrix[:middle]), _positive(matrix[middle:])])
    return np.ones(len(matrix), dtype=bool)


def transfer(builds: Builds, frequency: Array, inputs: list[Signal], outputs: list[Signal]) -> Any:
    """Responses (p, f, o, i) of all builds; NaN where a build failed, exactly 0 where its symmetry forbids any.

    Parameters
    ----------
    builds : Builds
    frequency : (f,) array
        Hz.
    inputs, outputs : list of Signal
    """
    model, acts = builds.model, np.array([signal.acts for signal in inputs])
    rows = np.stack([row(signal, model) for signal in outputs], axis=-2)  # (p, o, N)
    drives = np.stack([row(signal, model) for signal in inputs], axis=-1)  # (p, N, i)
    moves, forces = np.where(acts, 0.0, drives[..., :6, :]), np.where(acts, drives[..., 6:, :], 0.0)
    omega = 2 * np.pi * np.asarray(frequency)
    result = np.full((*builds.status.shape, len(omega), len(outputs), len(inputs)), NOTHING)
    good = np.flatnonzero(builds.status == GOOD)
    step = max(1, SYSTEMS // max(len(good), 1))
    systems = _Systems.of(model, good)
    for start in range(0, len(omega) if len(good) else 0, step):
        now = slice(start, start + step)
        x = systems.solve(omega[now], moves[good], forces[good])
        result[good, now] = rows[good][:, None, :, 6:] @ x + (rows[good][..., :6] @ moves[good])[:, None]
    for o, out in enumerate(outputs):
        for i, into in enumerate(inputs):
            result[..., o, i] = np.where((forbidden(builds.mirrors, out, into) & (builds.status == GOOD))[..., None], 0.0, result[..., o, i])
    return result


@dataclass(frozen=True)
class _Systems:
    """K + i omega C - omega^2 M of builds without the coordinates that have neither mass nor damping (tips of blades).

    With them LU loses digits: 4e-11 of the vertical motion of an imperfect triple at 50 Hz, without 1e-14.

    Attributes
    ----------
    keep, drop : (c,) and (m,) int arrays
        Coordinates of the model, the support's left out; bodies from the top down, blades with the stage that hangs on them.
    stiffness, mass, damping : (p, c, 6 + c) arrays
        Against the support's coordinates and their own.
    yielding, follow : (p, m, m), (p, m, 6 + c) arrays
        K_bb^-1 of the coordinates dropped, and K_bb^-1 times their stiffness against the others.
    """

    keep: Any
    drop: Any
    stiffness: Any
    mass: Any
    damping: Any
    yielding: Any
    follow: Any

    @staticmethod
    def of(model: LinearModel, which: Any) -> _Systems:
        """The systems of some builds."""
        owner, known = [name.split(".", 1)[0] for name in model.coordinate], (SUPPORT, "frame", *model.body)
        order = np.argsort([known.index(name) for name in owner], kind="stable")[6:]
        damped = (model.damping != 0).any(-1).reshape(-1, model.size).any(0)
        light = (model.massless & ~damped)[order]
        keep, drop = order[~light], order[light]
        both = np.concatenate([np.arange(6), keep])

        def some(matrix: Any, rows: Any, columns: Any) -> Any:
            whole = np.broadcast_to(matrix, (*model.batch, model.size, model.size))
            return whole[which[:, None, None], rows[:, None], columns]

        full = model.stiffness if model.lossy is None else model.lossy
        stiffness, mass, damping = (some(matrix, keep, both) for matrix in (full, model.mass, model.damping))
        yielding = solved(some(full, drop, drop), np.eye(len(drop)))
        follow = yielding @ some(full, drop, both)
        if len(drop):
            stiffness = stiffness - some(full, keep, drop) @ follow
            stiffness[..., 6:] = (stiffness[..., 6:] + np.swapaxes(stiffness[..., 6:], -1, -2)) / 2
        return _Systems(keep - 6, drop - 6, stiffness, mass, damping, yielding, follow)

    def solve(self, omega: Array, moves: Any, forces: Any) -> Any:
        """Coordinates (p, f, n, i), in the model's order, for motions (p, 6, i) of the support and forces (p, n, i)."""
        dynamic = self.stiffness[:, None] - (omega**2)[:, None, None] * self.mass[:, None]
        if self.damping.any():
            dynamic = dynamic + (1j * omega)[:, None, None] * self.damping[:, None]
        pushed = forces[:, self.keep] - np.swapaxes(self.follow[..., 6:], -1, -2) @ forces[:, self.drop]
        right = pushed[:, None] - dynamic[..., :6] @ moves[:, None]
        size = len(self.keep)
        kept = solved(dynamic[..., 6:].reshape(-1, size, size), right.reshape(-1, size, right.shape[-1])).reshape(right.shape)
        result = np.empty((*right.shape[:2], size + len(self.drop), right.shape[-1]), dtype=kept.dtype)
        result[:, :, self.keep] = kept
        given = np.concatenate([np.broadcast_to(moves[:, None], (*right.shape[:2], *moves.shape[1:])), kept], axis=-2)
        result[:, :, self.drop] = (self.yielding @ forces[:, self.drop])[:, None] - self.follow[:, None] @ given
        return result


def solved(matrix: Any, right: Any) -> Any:
    """Solutions (p, n, i) of systems (p, n, n); a singular one gives NaN and does not touch the others."""
    try:
        return np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        if matrix.ndim == 2:
            return np.full(right.shape, np.nan)
        return np.stack([solved(m, r) for m, r in zip(matrix, np.broadcast_to(right, (len(matrix), *right.shape[-2:])), strict=True)])


def forbidden(mirrors: Any, out: Signal, into: Signal) -> Any:
    """Builds (p,) whose symmetry forbids any response of one signal to another: they have opposite parity under a mirror."""
    result = np.zeros(mirrors.shape[:-1], dtype=bool)
    for axis, parity in enumerate((PARITY_X, PARITY_Y)):
        on_plane = out.point[axis] == 0 and into.point[axis] == 0
        if on_plane and parity[out.dof] != parity[into.dof]:
            result |= mirrors[..., axis]
    return result
