"""Equilibrium of a scene, by Newton's method with exact finite rotations and tangent stiffness.

During the search wires may push, so that the energy is smooth; that all are taut is checked at the
end. A saddle point is an equilibrium too: an unstable suspension is a finding, not an error, so the
search goes to the stationary point next to the nominal pose and does not slide down from it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements import string
from suspension_cli.elements.configuration import Configuration, SceneArrays, batch_first
from suspension_cli.equilibrium.energy import derivatives, gradient_and_stiffness
from suspension_cli.equilibrium.free_rotations import free_rotations, single_point_stages
from suspension_cli.equilibrium.newton import Found, Search, chunks, factorise, search
from suspension_cli.equilibrium.residual_scale import residual_scale
from suspension_cli.errors import Fault, InputError
from suspension_cli.scene.arrays import inner_axes
from suspension_cli.scene.pose import Layout, Pose, layout, nominal_pose
from suspension_cli.scene.scene import Scene
from suspension_cli.scene.stack import scale_imperfections, select_scenes

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact

CONVERGED = 1e-11
"""Largest residual (relative to the weight) of an equilibrium, unless rounding leaves more."""
COARSE = 1e-4
"""Residual (relative to the weight) from rounding above which a result is useless."""
ITERATIONS = 25
"""Most Newton steps of a search."""
STEPS = (10, 80)
"""Continuation steps where Newton's method is not reliable; the second if the first does not end in
a stable pose."""
CORRECTIONS = 4
"""Newton steps after each continuation step."""
NEUTRAL = 1e-13
"""Stiffness, relative to that with all other coordinates fixed, below which a motion is neutral
within rounding, not unstable."""
CLEAR = 1e-6
"""Least pivot of the tangent stiffness, over its diagonal element, above which a pose is stable;
below it the last step, free rotations and rounding need a closer look."""
PARTS_OF_POSE = inner_axes(Pose)
"""Arrays of a pose, and their axes beyond the batch."""
ARRAYS = ("residual", "rounding", "tension", "pivot", "soft", "form", "bend", "twist")
"""Arrays of an equilibrium beside its pose; the last two may be None."""


@dataclass(frozen=True)
class Equilibrium:
    """Pose in which a scene balances.

    Attributes
    ----------
    pose : Pose
    residual
        Largest unbalanced force on a body over the weight that it carries, or torque over that
        weight times the lever arm of the body.
    rounding
        Part of the residual that rounding may cause.
    iterations : int
        Newton steps taken; 0 if the nominal pose balances.
    tension
        N.
    pivot
        Least pivot of the tangent stiffness before the last step, over its diagonal element; NaN if
        no step was taken.
    soft
        Tangent stiffness in this pose if wires kept their lengths, N/m, N and N m.
    form
        Elongation of each wire per coordinate.
    bend, twist
        Of wires that resist bending or twisting, at these tensions, see `Flex`.
    """

    pose: Pose
    residual: Float[np.ndarray, "*batch"]
    rounding: Float[np.ndarray, "*batch"]
    iterations: int
    tension: Inexact[np.ndarray, "*batch wire"]
    pivot: Float[np.ndarray, "*batch"]
    soft: Inexact[np.ndarray, "*batch coordinate coordinate"]
    form: Inexact[np.ndarray, "*batch wire coordinate"]
    bend: Inexact[np.ndarray, "*batch wire 2 3"] | None = None
    twist: Inexact[np.ndarray, "*batch wire"] | None = None

    @property
    def converged(self) -> Bool[np.ndarray, "*batch"]:
        """Whether each scene of the batch has an equilibrium near its nominal pose, bool (...)."""
        return self.residual < np.maximum(
            CONVERGED, np.where(self.rounding < COARSE, self.rounding, 0.0)
        )

    def select(self, which: Bool[np.ndarray, "*batch"] | int) -> Equilibrium:
        """Select scenes of a batch, as `stack.select_scenes`."""
        arrays = {name: getattr(self, name) for name in ARRAYS}
        chosen = {name: None if array is None else array[which] for name, array in arrays.items()}
        return replace(self, pose=_select_pose(self.pose, which), **chosen)

    def demand(self, scene: Scene) -> None:
        """Raise `InputError` unless every scene of the batch balances on taut wires."""
        if not np.all(self.converged):
            raise InputError([self._no_balance(scene)])
        low = self.tension.min(tuple(range(self.tension.ndim - 1)), initial=np.inf)
        faults = [
            Fault(
                f"stage.{label.rsplit('.', 1)[0]}.wire",
                f"wire {label} is slack in equilibrium (tension {tension:.3g} N)",
                "shorten it, or leave it out",
            )
            for label, tension in zip(scene.wires.label, low, strict=True)
            if not tension > 0
        ]
        if faults:
            raise InputError(faults)

    def _no_balance(self, scene: Scene) -> Fault:
        worst = float(np.max(np.nan_to_num(self.residual, nan=np.inf)))
        if float(np.max(np.nan_to_num(self.rounding))) >= COARSE:
            return Fault(
                "stage",
                f"wires of {float(scene.wires.stiffness.max()):.1e} N/m are too stiff to be"
                f" balanced: rounding of their lengths leaves {worst:.1e} of the weight unbalanced",
                "give them the k = E A / l of a real wire, at most 1e13 N/m or so",
            )
        return Fault(
            "stage",
            "no equilibrium found near the nominal pose (unbalanced force"
            f" {worst:.1e} of the weight)",
            "check natural lengths, positions and the size of the perturbations",
        )


def solve(scene: Scene, numbering: Layout | None = None, start: Pose | None = None) -> Equilibrium:
    """Find the equilibrium of a scene near its nominal pose.

    Newton's method takes a few steps. Where it does not converge, or ends with a slack wire or in
    an unstable pose (perhaps another stationary point), continuation follows the equilibrium: from
    that of the nominal design, while the imperfections grow from zero; or, if the nominal pose is
    unknown, while the forces that hold the scene as drawn fall to zero.

    Parameters
    ----------
    scene : Scene
        With any batch axes; no scene depends on the others.
    start : Pose, optional
        Instead of the nominal pose.

    Returns
    -------
    Equilibrium
        Not necessarily converged: see `Equilibrium.demand`.
    """
    numbering = numbering or layout(scene)
    found = _newton(
        scene,
        numbering,
        nominal_pose(scene) if start is None else _broadcast_pose(start, scene.batch),
        0.0,
        ITERATIONS,
        accept_nominal=start is None,
    )
    if found.iterations == 0:
        return found
    taut = found.converged & (found.tension > 0).all(-1)
    suspect = np.asarray(~(taut & _is_stable(scene, numbering, found)))
    if not suspect.any():
        return found
    nominal = None if scene.drawn is None else solve(scene.drawn, numbering)
    if nominal is not None and scene.drawn is not None:
        # if the nominal design is unstable, so is the whole branch
        suspect &= ~(taut & ~_is_stable(scene.drawn, numbering, nominal))
    for steps in STEPS:
        if not suspect.any():
            break
        some = select_scenes(scene, suspect)
        begin = (
            nominal_pose(some)
            if nominal is None
            else _select_pose(_broadcast_pose(nominal.pose, scene.batch), suspect)
        )
        better = _continue(some, numbering, begin, steps)
        reached = suspect.copy()
        reached[suspect] = better.converged
        found = _replace(found, reached, better.select(better.converged))
        suspect[suspect] = ~(better.converged & _is_stable(some, numbering, better))
    return found


def _select_pose(pose: Pose, where: Bool[np.ndarray, "*batch"] | int) -> Pose:
    return Pose(*(getattr(pose, name)[where] for name in PARTS_OF_POSE))


def _broadcast_pose(pose: Pose, batch: tuple[int, ...]) -> Pose:
    def spread(part: np.ndarray, inner: int) -> np.ndarray:
        return np.broadcast_to(part, batch + part.shape[part.ndim - inner :])

    return Pose(*(spread(getattr(pose, name), inner) for name, inner in PARTS_OF_POSE.items()))


def _replace(
    found: Equilibrium, where: Bool[np.ndarray, "*batch"], new: Equilibrium
) -> Equilibrium:
    """Replace the results of a batch `where` there are new ones (given for these alone)."""

    def merge(old: np.ndarray, some: np.ndarray) -> np.ndarray:
        result = np.array(np.broadcast_to(old, where.shape + np.shape(some)[1:]))
        result[where] = some
        return result

    pose = Pose(
        *(merge(getattr(found.pose, name), getattr(new.pose, name)) for name in PARTS_OF_POSE)
    )
    arrays = {}
    for name in ARRAYS:
        old, some = getattr(found, name), getattr(new, name)
        arrays[name] = None if old is None or some is None else merge(old, some)
    return Equilibrium(pose=pose, iterations=max(found.iterations, new.iterations), **arrays)


def _is_stable(scene: Scene, numbering: Layout, found: Equilibrium) -> Bool[np.ndarray, "*batch"]:
    """Whether each tangent stiffness is positive definite, apart from free rotations."""
    result = np.asarray(found.pivot > CLEAR)
    unclear = ~result
    if not scene.batch:
        return result if result else _has_no_soft_direction(scene, numbering, found)
    if unclear.any():
        some = found.select(unclear)
        result[unclear] = _has_no_soft_direction(select_scenes(scene, unclear), numbering, some)
    return result


def _has_no_soft_direction(
    scene: Scene, numbering: Layout, found: Equilibrium
) -> Bool[np.ndarray, "*batch"]:
    arrays = replace(SceneArrays.of(scene, numbering), follows=True)
    now = Configuration.of(arrays, found.pose, scene.batch)
    root = np.sqrt(residual_scale(arrays))
    stiffness = np.moveaxis(derivatives(now).symmetric(), 0, -1)[6:, 6:]
    scaled = np.nan_to_num(stiffness) / (root[:, None] * root)
    own = np.abs(np.einsum("iip->ip", scaled))
    stages = single_point_stages(scene)
    if stages:
        free = free_rotations(now, stages) * root[:, None]
        free = free / np.sqrt(np.maximum((free**2).sum((0, 1)), 1.0))
        scaled = scaled + own.max(0) * np.einsum("irp,jrp->ijp", free, free)
    np.einsum("iip->ip", scaled)[:] += NEUTRAL * own
    factors = factorise(scaled, np.ones(scaled.shape[:2], dtype=bool))
    return (factors.least > 0).reshape(scene.batch)


def _continue(scene: Scene, numbering: Layout, pose: Pose, steps: int) -> Equilibrium:
    """Follow the equilibrium from the nominal design's pose in small steps."""
    with np.errstate(all="ignore"):
        nominal_gradient = (
            gradient_and_stiffness(scene, numbering, pose)[0] if scene.drawn is None else 0.0
        )
        for n in range(1, steps):
            if scene.drawn is None:  # reduce the forces that hold it in the nominal pose
                now, target = scene, nominal_gradient * (1 - n / steps)
            else:  # increase the imperfections
                now, target = scale_imperfections(scene, n / steps), 0.0
            pose = _poses(now, Search(numbering, pose, target, CORRECTIONS, False))
        return _newton(scene, numbering, pose, 0.0, ITERATIONS)


def _poses(scene: Scene, wanted: Search) -> Pose:
    """Poses that a search ends in."""
    parts = [search(scene, rows, wanted).now for rows in _chunks(scene, wanted.numbering)]
    together = (
        np.concatenate([getattr(part, name) for part in parts], axis=-1) for name in PARTS_OF_POSE
    )
    return Pose(*(batch_first(part, scene.batch) for part in together))


def _chunks(scene: Scene, numbering: Layout) -> list[slice]:
    return chunks(math.prod(scene.batch), numbering.size)


def _newton(
    scene: Scene,
    numbering: Layout,
    pose: Pose,
    target: Float[np.ndarray, "*batch coordinate"] | float,
    limit: int,
    *,
    accept_nominal: bool = False,
) -> Equilibrium:
    """Newton's method for the pose in which the gradient equals `target` (..., N), N and N m.

    At most `limit` steps. With `accept_nominal` a nominal pose that balances is returned unchanged.
    """
    wanted = Search(numbering, pose, target, limit, accept_nominal)
    count, size, wires = math.prod(scene.batch), numbering.size, len(scene.wires.label)
    # builds last, as summed
    soft, form, parts = np.empty((size, size, count)), np.empty((size, wires, count)), []
    for rows in _chunks(scene, numbering):
        found = search(scene, rows, wanted)
        derivatives(found.now, stretching=False).symmetric(soft[..., rows])
        form[..., rows] = string.elongations(found.now)
        parts.append(_arrays_of(found))
    whole = {"soft": soft.T, "form": form.T}
    for name, first in parts[0].items():
        whole[name] = first if len(parts) == 1 else np.concatenate([part[name] for part in parts])
    arrays = {
        name: value.reshape((*scene.batch, *value.shape[1:]))[()] for name, value in whole.items()
    }
    pose = Pose(*(arrays.pop(name) for name in PARTS_OF_POSE))
    steps = int(arrays.pop("steps").max(initial=0))
    return Equilibrium(pose=pose, iterations=steps, **arrays)


def _arrays_of(found: Found) -> dict[str, np.ndarray]:
    """Arrays of the builds of a chunk, which come first."""
    now, batch = found.now, (found.now.arrays.count,)
    arrays = {name: getattr(now, name) for name in PARTS_OF_POSE} | {"tension": now.wires.tension}
    if now.arrays.scene.flex is not None and now.flex is not None:
        flex = {name: getattr(now.flex, name) for name in ("bend", "twist")}
        arrays |= {name: value for name, value in flex.items() if value is not None}
    arrays = {name: batch_first(value, batch) for name, value in arrays.items()}
    names = ("residual", "rounding", "pivot", "steps")
    return arrays | {name: getattr(found, name) for name in names}
