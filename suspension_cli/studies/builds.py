"""Equilibrium, linear model and response of many imperfect builds of one design at once.

All functions work on arrays over the builds. The result for one build depends on the others that
are computed with it by rounding alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from suspension_cli.conventions import PARITY_X, PARITY_Y
from suspension_cli.design.schema import Design
from suspension_cli.elimination import solve_each
from suspension_cli.equilibrium.solve import CLEAR, Equilibrium
from suspension_cli.linear import batch_modes
from suspension_cli.linear.response import transfer_builds
from suspension_cli.linear.signals import Signal, linear_form
from suspension_cli.linear.statespace import ROUNDING, with_states
from suspension_cli.linear.symmetry import is_symmetric_in
from suspension_cli.linear.system import LinearSystem
from suspension_cli.linear.terms import TermWithStates
from suspension_cli.models import registry
from suspension_cli.models.surroundings import surrounded
from suspension_cli.rotations import rotation_vector
from suspension_cli.scene.pose import Pose
from suspension_cli.scene.scene import Scene
from suspension_cli.studies.freed_memory import keep_freed_memory

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

GOOD = 0
SLACK = 1
UNBALANCED = 2
UNSTABLE = 3
IMPOSSIBLE = 4
STATUS = (
    "good",
    "a wire is slack",
    "no equilibrium near the nominal pose",
    "the equilibrium is unstable",
    "the design is not possible",
)
"""Meanings of the status of a build."""
DRIVEN = 1e-6
"""Growth without oscillation, over the fastest pole of a build, above which it is no rounding error
of a rigid mode."""
FAST = 0.1
"""Decay rate over the modulus of a pole above which no loss angle can make it grow."""
NOTHING = complex(np.nan, np.nan)
"""Response of a build that failed."""


def blank(count: int, **columns: tuple[str, tuple[int, ...]]) -> dict[str, np.ndarray]:
    """Results of builds of designs that are not possible: arrays of dtypes and shapes per build."""
    value = {"u1": IMPOSSIBLE, "i2": -1, "c16": NOTHING}
    return {
        name: np.full((count, *shape), value.get(dtype, np.nan), dtype)
        for name, (dtype, shape) in columns.items()
    }


@dataclass(frozen=True)
class Builds:
    """Balanced builds, along the first axis of their model, which is valid where `GOOD`.

    `wire` is the first slack wire, or -1; `residual` the largest residual force, relative to the
    weight; `mirrors` says whether builds may be symmetric when x, or y, is mirrored: without a
    scene all of them are.
    """

    model: LinearSystem
    status: Int[np.ndarray, " build"]
    wire: Int[np.ndarray, " build"]
    residual: Float[np.ndarray, " build"]
    mirrors: tuple[bool, bool]
    scene: Scene | None = None
    equilibrium: Equilibrium | None = None

    @property
    def pose(self) -> Pose | None:
        """Poses in equilibrium."""
        return None if self.equilibrium is None else self.equilibrium.pose

    def is_symmetric_in(self, axis: int) -> Bool[np.ndarray, " build"]:
        """Whether each build is symmetric in x (axis 0) or y (1)."""
        if axis not in self._symmetric:
            known = np.full(self.status.shape, self.mirrors[axis])
            if self.mirrors[axis] and self.scene is not None:
                known = is_symmetric_in(self.scene, axis)
            self._symmetric[axis] = known
        return self._symmetric[axis]

    @cached_property
    def _symmetric(self) -> dict[int, Bool[np.ndarray, " build"]]:
        """Symmetries that were asked for, by axis."""
        return {}

    @property
    def outcome(self) -> dict[str, np.ndarray]:
        """Columns that tell whether builds hang."""
        return {"residual": self.residual, "status": self.status, "slack_wire": self.wire}

    @cached_property
    def static(self) -> Float[np.ndarray, "build body 6"]:
        """Static displacements (x, y, z, m) and rotation vectors (rad) of bodies as drawn.

        The displacement is that of the point of a body where its COM is as drawn. Where an
        imperfection moves the COM by c in a body that turns by R, that is u - (R - 1) c, with u the
        displacement of the COM.
        """
        scene = self.scene
        pose = self.pose
        assert scene is not None and pose is not None
        drawn = scene.drawn or scene
        offset = (scene.bodies.position - drawn.bodies.position)[..., 1:, :]
        shift = pose.shift[..., 1:, :]
        turn = pose.turn[..., 1:, :, :]
        moved = shift - (turn @ offset[..., None])[..., 0]
        rotation = rotation_vector(turn)
        shape = np.broadcast_shapes(moved.shape, rotation.shape, (*scene.batch, 1, 3))
        return np.concatenate(
            [np.broadcast_to(moved, shape), np.broadcast_to(rotation, shape)], axis=-1
        )


def balance(
    scene: Scene,
    design: Design,
    *,
    level: str = registry.STRING.name,
    allow_unstable: bool = False,
    split: bool = False,
) -> Builds:
    """Balance every scene of a batch of one design, and build its linear model.

    The scene has one batch axis; `level` is a model that supports builds (`registry.SCENE_MODELS`).
    If `allow_unstable`, an unstable equilibrium has status `GOOD`. If `split`, mirror symmetries
    that all scenes share are used; the result for one scene then depends on the others, unless all
    have equal symmetries.
    """
    keep_freed_memory()
    physics = registry.scene_model(level)
    scene = physics.completed(scene, design)
    with np.errstate(all="ignore"):
        plain, found = physics.in_equilibrium(scene, design, split=split)
        model = surrounded(plain, design, (scene.drawn or scene).bodies.position)
        slack = found.tension <= 0
        status = np.full(scene.batch, GOOD, dtype=np.uint8)
        if not allow_unstable:
            status[_unstable(model, found, design)] = UNSTABLE
        status[slack.any(-1)] = SLACK
        status[~found.converged] = UNBALANCED
        if not allow_unstable:
            mark_driven(status, model)
    wire = np.full(status.shape, -1, dtype=np.int16)
    wire[status == SLACK] = slack[status == SLACK].argmax(-1) if slack.shape[-1] else -1
    if model.orientation is None:  # no body of the batch is turned
        model = replace(model, orientation=found.pose.rotation)
    # the height of a mirror turns the axis of its cavity, as its pitch does
    mirrors = not design.cavity, True
    return Builds(model, status, wire, found.residual, mirrors, scene, found)


def _unstable(
    model: LinearSystem, found: Equilibrium, design: Design
) -> Bool[np.ndarray, " build"]:
    """Find builds with an unstable mode.

    The pivots of the tangent stiffness identify most stable ones, unless the support structure
    moves too, or light pushes.
    """
    if found.pivot is None or design.support is not None or design.cavity:
        return batch_modes.grows(model)
    unclear = ~(found.pivot > CLEAR)
    if unclear.any():
        unclear[unclear] = batch_modes.grows(model.select(np.flatnonzero(unclear)))
    return unclear


def mark_driven(status: Int[np.ndarray, " build"], model: LinearSystem) -> None:
    """Mark, in their status, good builds in which active parts make a mode grow.

    The poles s and shapes x of M, C and the static stiffness, with the states of light, give the
    growth, as in `linear.damped`: -2 sigma omega x^H M x = x^H K''(omega) x + omega x^H C x, exact
    for dampers and light. Coordinates without inertia and damping follow statically.
    """
    if not model.active:
        return
    from scipy.linalg import eig

    constant = replace(model, terms=model.terms_with_states)
    for n in np.flatnonzero(status == GOOD).tolist():
        system = with_states(constant.select(n)).constant
        own = [matrix[6:, 6:] for matrix in (system.mass, system.damping, system.stiffness)]
        inert = system.massless[6:] & ~own[1].any(0)
        to_all = np.eye(len(inert))[:, ~inert]
        to_all[inert] = -solve_each(own[2][np.ix_(inert, inert)], own[2][np.ix_(inert, ~inert)])
        mass, damping, stiffness = (to_all.T @ matrix @ to_all for matrix in own)
        zero = np.zeros_like(mass)
        one = np.eye(len(mass))
        found: Any = eig(
            np.block([[zero, one], [-stiffness, -damping]]),
            np.block([[one, zero], [zero, mass]]),
        )
        finite = np.isfinite(found[0])
        s = found[0][finite]
        x = found[1][: len(mass), finite]
        creeps = (np.real(s)[np.imag(s) == 0] > DRIVEN * np.abs(s).max()).any()
        # of light, which decays fast, the bodies have too little for their motion to tell
        some = (np.imag(s) > 0) & (np.real(s) > -FAST * np.abs(s))
        x = x[:, some]
        omega = np.imag(s)[some]
        lost = omega * np.einsum("ip,ij,jp->p", x.conj(), damping, x).real
        lost += _loss_of(model, n, omega, (to_all @ x)[: model.size - 6])
        energy = np.einsum("ip,ij,jp->p", x.conj(), mass, x).real
        if creeps or (lost < -2 * ROUNDING * omega**2 * energy).any():
            status[n] = UNSTABLE


def _loss_of(
    model: LinearSystem,
    build: int,
    omega: Float[np.ndarray, " mode"],
    x: Complex[np.ndarray, "coordinate mode"],
) -> Float[np.ndarray, " mode"]:
    """Loss x^H K''(omega) x of modes of one build, without light; `x` lacks the support."""
    if not len(omega):
        return np.zeros(0)
    others = tuple(term for term in model.terms if not isinstance(term, TermWithStates))
    plain = replace(model, terms=others)
    loss = np.imag(plain.select(np.full(len(omega), build)).at(omega).complete)
    loss = np.broadcast_to(loss, (len(omega), model.size, model.size))[:, 6:, 6:]
    return np.einsum("ip,pij,jp->p", x.conj(), loss, x).real


def transfer(
    builds: Builds,
    frequency: Float[np.ndarray, " frequency"],
    inputs: list[Signal],
    outputs: list[Signal],
) -> Complex[np.ndarray, "build frequency output input"]:
    """Responses of all builds at frequencies in Hz; NaN where one failed, 0 by symmetry."""
    good = np.flatnonzero(builds.status == GOOD)
    omega = 2 * np.pi * np.asarray(frequency)
    result = np.full((*builds.status.shape, len(omega), len(outputs), len(inputs)), NOTHING)
    for of_ground in (False, True):
        some = [n for n, signal in enumerate(inputs) if signal.is_ground == of_ground]
        if not some:
            continue
        rows = np.stack([linear_form(signal, builds.model) for signal in outputs], axis=-2)
        drives = np.stack([linear_form(inputs[n], builds.model) for n in some], axis=-1)
        model = builds.model
        if of_ground:
            rows[..., :6] = 0.0  # the support is at rest
            model = model.driven_by_ground
        acts = np.array([inputs[n].acts for n in some])
        moves = np.where(acts, 0.0, drives[..., :6, :])
        forces = np.where(acts, drives, 0.0)
        found = transfer_builds(model, good, omega, moves, forces, rows)
        places = good.tolist(), range(len(omega)), range(len(outputs)), some
        result[np.ix_(*map(list, places))] = found
    for o, out in enumerate(outputs):
        for i, into in enumerate(inputs):
            none = forbidden(builds, out, into) & (builds.status == GOOD)
            result[none, :, o, i] = 0.0
    return result


class Ratio(Protocol):
    """A response at a frequency, Hz, or the ratio of two."""

    @property
    def over(self) -> Signal:
        """The motion."""
        ...

    @property
    def under(self) -> Signal | None:
        """The motion that divides it; None for a response."""
        ...

    @property
    def input(self) -> Signal:
        """The input."""
        ...

    @property
    def frequency(self) -> float:
        """Frequency, Hz."""
        ...


def responses(builds: Builds, ratios: Sequence[Ratio]) -> Complex[np.ndarray, "build response"]:
    """Evaluate responses, or ratios of two, at one frequency each; SI, NaN where a build failed."""
    found = np.empty((len(builds.status), len(ratios)), dtype=complex)
    for n, ratio in enumerate(ratios):
        outputs = [ratio.over] if ratio.under is None else [ratio.over, ratio.under]
        with np.errstate(all="ignore"):  # of builds that failed
            values = transfer(builds, np.array([ratio.frequency]), [ratio.input], outputs)
        values = values[:, 0, :, 0]
        found[:, n] = values[:, 0] if ratio.under is None else divide(values[:, 0], values[:, 1])
    return found


def divide(over: np.ndarray, under: np.ndarray) -> Complex[np.ndarray, "*shape"]:
    """Divide complex responses; exactly 0 where a symmetry makes `over` vanish."""
    with np.errstate(all="ignore"):
        return np.where((over == 0) & (np.abs(under) > 0), 0.0, over / under)


def count_failures(
    status: Int[np.ndarray, "*build"], meaning: tuple[str, ...] = STATUS
) -> dict[str, int]:
    """Count builds by reason of failure."""
    return {
        reason: int((status == code).sum())
        for code, reason in enumerate(meaning)
        if code != GOOD and (status == code).any()
    }


def forbidden(builds: Builds, out: Signal, into: Signal) -> Bool[np.ndarray, " build"]:
    """Find builds in which two signals have opposite parity under a mirror, so no response."""
    result = np.zeros(builds.status.shape, dtype=bool)
    for axis, parity in enumerate((PARITY_X, PARITY_Y)):
        on_plane = out.point[axis] == 0 and into.point[axis] == 0
        if on_plane and parity[out.dof] != parity[into.dof]:
            result |= builds.is_symmetric_in(axis)
    return result
