"""Many imperfect builds of one design at once: equilibrium, linear model and response of each.

All work is on arrays over the builds; nothing that one build gets depends on which others are computed with it, to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analysis.modes import RIGID
from suspension_cli.analysis.signals import Signal, row
from suspension_cli.conventions import PARITY_X, PARITY_Y
from suspension_cli.design.scene import Array, Scene
from suspension_cli.design.schema import Design
from suspension_cli.mechanics import assemble
from suspension_cli.mechanics.blocks import mirrored
from suspension_cli.mechanics.equilibrium import CONVERGED, solve
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.mechanics.pose import layout
from suspension_cli.models.surroundings import surrounded

GOOD, SLACK, UNBALANCED, UNSTABLE, IMPOSSIBLE = 0, 1, 2, 3, 4
STATUS = ("good", "a wire is slack", "no equilibrium near the nominal pose", "the equilibrium is unstable", "the design is not possible")
"""What the status of a build means."""
NOTHING = complex(np.nan, np.nan)
"""Response of a build that failed."""


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


def balance(scene: Scene, design: Design, *, allow_unstable: bool = False) -> Builds:
    """Equilibrium and linear model of every scene of a batch with one axis; an unstable one is a failure unless that is allowed."""
    numbering = layout(scene)
    with np.errstate(all="ignore"):
        found = solve(scene, numbering)
        model = surrounded(assemble.linear_model(scene, found, split=False), design)
        slack = found.tension <= 0
        status = np.full(scene.batch, GOOD, dtype=np.uint8)
        if not allow_unstable:
            status[grows(model)] = UNSTABLE
        status[slack.any(-1)] = SLACK
        status[~(found.residual < CONVERGED)] = UNBALANCED
    wire = np.where(status == SLACK, slack.argmax(-1), -1).astype(np.int16)
    orientation = model.orientation if model.orientation is not None else found.pose.rotation
    return Builds(replace(model, orientation=orientation), status, wire, found.residual, mirrored(scene))


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
    model = builds.model
    full = model.stiffness if model.lossy is None else model.lossy
    rows = np.stack([row(signal, model) for signal in outputs], axis=-2)  # (p, o, N)
    drives = np.stack([row(signal, model) for signal in inputs], axis=-1)  # (p, N, i)
    acts = np.array([signal.acts for signal in inputs])
    moves, forces = np.where(acts, 0.0, drives[..., :6, :]), np.where(acts, drives[..., 6:, :], 0.0)
    result = np.empty((*builds.status.shape, len(frequency), len(outputs), len(inputs)), dtype=complex)
    for n, omega in enumerate(2 * np.pi * np.asarray(frequency)):
        dynamic = full[..., 6:, :] - omega**2 * model.mass[..., 6:, :]
        if model.damping.any():
            dynamic = dynamic + 1j * omega * model.damping[..., 6:, :]
        x = solved(dynamic[..., 6:], forces - dynamic[..., :6] @ moves)
        result[..., n, :, :] = rows[..., 6:] @ x + rows[..., :6] @ moves
    result[builds.status != GOOD] = NOTHING
    for o, out in enumerate(outputs):
        for i, into in enumerate(inputs):
            result[..., o, i] = np.where((forbidden(builds.mirrors, out, into) & (builds.status == GOOD))[..., None], 0.0, result[..., o, i])
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
