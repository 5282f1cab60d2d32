"""Many imperfect builds of one design at once: equilibrium, linear model and response of each.

All work is on arrays over the builds; nothing that one build gets depends on which others are computed with it, to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analysis.graded import RIGID
from suspension_cli.analysis.signals import Signal, row
from suspension_cli.analysis.systems import Systems, dispersive
from suspension_cli.conventions import PARITY_X, PARITY_Y
from suspension_cli.design.scene import Array, Scene
from suspension_cli.design.schema import Design
from suspension_cli.mechanics import assemble, assorted
from suspension_cli.mechanics.assorted import Assorted
from suspension_cli.mechanics.blocks import mirrored
from suspension_cli.mechanics.definite import positive_definite
from suspension_cli.mechanics.equilibrium import Equilibrium, solve
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.mechanics.pose import layout
from suspension_cli.models.fidelity import bending
from suspension_cli.models.surroundings import framed, surrounded

GOOD, SLACK, UNBALANCED, UNSTABLE, IMPOSSIBLE = 0, 1, 2, 3, 4
STATUS = ("good", "a wire is slack", "no equilibrium near the nominal pose", "the equilibrium is unstable", "the design is not possible")
"""What the status of a build means."""
NOTHING = complex(np.nan, np.nan)
"""Response of a build that failed."""
SYSTEMS = 4096
"""Systems (builds times frequencies) solved at once, at most, unless there are more builds; a quarter of that where wires bend, which takes more memory."""


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
    terms : tuple of Assorted
        What depends on frequency (`beam`, `violin`).
    """

    model: LinearModel
    status: Any
    wire: Any
    residual: Any
    mirrors: Any
    terms: tuple[Assorted, ...] = ()


def balance(scene: Scene, design: Design, *, level: str = "string", allow_unstable: bool = False, split: bool = False) -> Builds:
    """Equilibrium and linear model of every scene of a batch with one axis; an unstable one is a failure unless that is allowed.

    `split` looks for mirror symmetries that all scenes share: then what one scene gets depends on the others, unless all have the same ones.
    `level` may be ``string``, ``beam`` or ``violin``.
    """
    terms: tuple[Assorted, ...] = ()
    with np.errstate(all="ignore"):
        if level == "string":
            found = solve(scene, layout(scene))
            plain = assemble.linear_model(scene, found, split=split)
        else:
            scene, drag = bending(scene, design)
            plain, found, terms = assorted.linear_model(scene, drag, massive=level == "violin", split=split)
        model, terms = surrounded(plain, design), framed(terms, plain.size, design)
        slack = found.tension <= 0
        status = np.full(scene.batch, GOOD, dtype=np.uint8)
        if not allow_unstable:
            status[grows(model)] = UNSTABLE
        status[slack.any(-1)] = SLACK
        status[~found.converged] = UNBALANCED
    wire = np.full(status.shape, -1, dtype=np.int16)
    wire[status == SLACK] = slack[status == SLACK].argmax(-1) if slack.shape[-1] else -1
    return Builds(oriented(model, found), status, wire, found.residual, mirrored(scene), terms)


def oriented(model: LinearModel, found: Equilibrium) -> LinearModel:
    """A model that tells how its bodies are turned even if none of the batch is."""
    return replace(model, orientation=model.orientation if model.orientation is not None else found.pose.rotation)


def grows(model: LinearModel) -> Any:
    """Models (p,) of which a mode grows, by more than rounding makes of a rigid one: K + c M is not positive definite for a tiny c."""
    stiffness, mass = np.nan_to_num(model.stiffness[..., 6:, 6:]), model.mass[..., 6:, 6:]
    k, m = (np.diagonal(matrix, axis1=-2, axis2=-1) for matrix in (stiffness, mass))
    largest = np.where(m > 0, np.abs(k) / np.where(m > 0, m, 1.0), 0.0).sum(-1)
    return ~positive_definite(stiffness + np.nan_to_num(RIGID * largest[..., None, None] * mass))


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
    step = max(1, SYSTEMS // (4 if builds.terms else 1) // max(len(good), 1))
    systems = None if builds.terms else Systems.of(model, good)
    for start in range(0, len(omega) if len(good) else 0, step):
        now = slice(start, start + step)
        x = dispersive(model, builds.terms, good, omega[now], moves, forces) if systems is None else systems.solve(omega[now], moves[good], forces[good])
        result[good, now] = rows[good][:, None, :, 6:] @ x + (rows[good][..., :6] @ moves[good])[:, None]
    for o, out in enumerate(outputs):
        for i, into in enumerate(inputs):
            result[..., o, i] = np.where((forbidden(builds.mirrors, out, into) & (builds.status == GOOD))[..., None], 0.0, result[..., o, i])
    return result


def forbidden(mirrors: Any, out: Signal, into: Signal) -> Any:
    """Builds (p,) whose symmetry forbids any response of one signal to another: they have opposite parity under a mirror."""
    result = np.zeros(mirrors.shape[:-1], dtype=bool)
    for axis, parity in enumerate((PARITY_X, PARITY_Y)):
        on_plane = out.point[axis] == 0 and into.point[axis] == 0
        if on_plane and parity[out.dof] != parity[into.dof]:
            result |= mirrors[..., axis]
    return result
