"""Equilibrium of a scene, by Newton's method with exact finite rotations and tangent stiffness.

During the search wires may push, so that the energy is smooth; that all are taut is checked at the
end. A saddle point is an equilibrium too: an unstable suspension is a finding, not an error, so the
search goes to the stationary point next to the nominal pose and does not slide down from it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements import string
from suspension_cli.elements.registry import uncompiled
from suspension_cli.equilibrium.definite import positive_definite
from suspension_cli.equilibrium.energy import gradient_and_stiffness
from suspension_cli.equilibrium.free_rotations import free_rotations, single_point_stages
from suspension_cli.equilibrium.residual_scale import (
    ROUNDINGS,
    largest_lever_arm,
    residual_scale,
)
from suspension_cli.errors import Fault, InputError
from suspension_cli.scene.arrays import inner_axes
from suspension_cli.scene.pose import Layout, Pose, displace, layout, nominal_pose
from suspension_cli.scene.scene import Scene
from suspension_cli.scene.stack import scale_imperfections, select_scenes

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact

BALANCED = 1e-14
"""Residual (relative to the weight) of a nominal pose that needs no search."""
CONVERGED = 1e-11
"""Largest residual (relative to the weight) of an equilibrium, unless rounding leaves more."""
COARSE = 1e-4
"""Residual (relative to the weight) from rounding above which a result is useless."""
SEARCH_END = 1e-12
"""Residual (relative to the weight) at which the search stops; it also stops where rounding keeps
the residual above this."""
LAST_STEP = 1e-8
"""Step (m or rad) after which the error is below rounding, as convergence is quadratic."""
ITERATIONS = 15
"""Most Newton steps of a search."""
STEPS = (10, 80)
"""Continuation steps where Newton's method is not reliable; the second if the first does not end in
a stable pose."""
CORRECTIONS = 4
"""Newton steps after each continuation step."""
CAP = 0.3
"""Longest step in rad, and in units of the largest lever arm."""
NEUTRAL = 1e-13
"""Stiffness, relative to that with all other coordinates fixed, below which a motion is neutral
within rounding, not unstable."""
CLEAR = 1e-5
"""Least pivot of the last factorisation, over its diagonal element, above which a pose is stable,
as later steps are at most 1e-6; below it the pose itself is checked."""
PARTS_OF_POSE = inner_axes(Pose)
"""Arrays of a pose, and their axes beyond the batch."""
ARRAYS = ("residual", "rounding", "tension", "stiffness", "pivot", "flex")
"""Arrays of an equilibrium beside its pose; the last three may be None."""


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
    stiffness
        Tangent stiffness in this pose, N/m, N and N m; None where compiled loops solved a batch.
    pivot
        Least pivot of the last factorisation, over its diagonal element, if known.
    flex
        In a batch: S_uu, S_ul, S_ll in both planes and the stiffness against twisting of wires that
        bend, at these tensions, N m/rad.
    """

    pose: Pose
    residual: Float[np.ndarray, "*batch"]
    rounding: Float[np.ndarray, "*batch"]
    iterations: int
    tension: Inexact[np.ndarray, "*batch wire"]
    stiffness: Inexact[np.ndarray, "*batch coordinate coordinate"] | None = None
    pivot: Float[np.ndarray, "*batch"] | None = None
    flex: Inexact[np.ndarray, "*batch bent_wire 7"] | None = None

    @property
    def converged(self) -> Bool[np.ndarray, "*batch"]:
        """Whether each scene of the batch has an equilibrium near its nominal pose, bool (...)."""
        return self.residual < np.maximum(
            CONVERGED, np.where(self.rounding < COARSE, self.rounding, 0.0)
        )

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
        if found.stiffness is not None:
            better = replace(better, stiffness=_tangent_stiffness(some, numbering, better))
        reached = suspect.copy()
        reached[suspect] = better.converged
        found = _replace(found, reached, _select(better, better.converged))
        suspect[suspect] = ~(better.converged & _is_stable(some, numbering, better))
    return found


def solve_again(
    scene: Scene, numbering: Layout, found: Equilibrium, which: Bool[np.ndarray, "*batch"]
) -> Equilibrium:
    """Solve some scenes of a batch from where they are, or a scene without batch axes."""
    if not scene.batch:
        return solve(scene, numbering, start=found.pose)
    start = _select_pose(found.pose, which)
    return _replace(found, which, solve(select_scenes(scene, which), numbering, start=start))


def _select_pose(pose: Pose, where: Bool[np.ndarray, "*batch"]) -> Pose:
    return Pose(*(getattr(pose, name)[where] for name in PARTS_OF_POSE))


def _broadcast_pose(pose: Pose, batch: tuple[int, ...]) -> Pose:
    def spread(part: np.ndarray, inner: int) -> np.ndarray:
        return np.broadcast_to(part, batch + part.shape[part.ndim - inner :])

    return Pose(*(spread(getattr(pose, name), inner) for name, inner in PARTS_OF_POSE.items()))


def _select(found: Equilibrium, where: Bool[np.ndarray, "*batch"]) -> Equilibrium:
    arrays = {name: getattr(found, name) for name in ARRAYS}
    chosen = {name: None if array is None else array[where] for name, array in arrays.items()}
    return replace(found, pose=_select_pose(found.pose, where), **chosen)


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
        if some is None and old is not None and name != "stiffness":
            some = np.full((1, *old.shape[1:]), np.nan)
        arrays[name] = None if old is None or some is None else merge(old, some)
    return Equilibrium(pose=pose, iterations=max(found.iterations, new.iterations), **arrays)


def _is_stable(scene: Scene, numbering: Layout, found: Equilibrium) -> Bool[np.ndarray, "*batch"]:
    """Whether each tangent stiffness is positive definite, apart from free rotations."""
    if found.pivot is None:
        return _has_no_soft_direction(scene, numbering, found)
    result = found.pivot > CLEAR
    if not result.all():
        unclear = ~result
        some = _select(found, unclear)
        result[unclear] = _has_no_soft_direction(select_scenes(scene, unclear), numbering, some)
    return result


def _tangent_stiffness(
    scene: Scene, numbering: Layout, found: Equilibrium
) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
    """Tangent stiffness (..., N, N) in equilibrium, which the compiled loops do not give."""
    if found.stiffness is not None:
        return found.stiffness
    from suspension_cli.equilibrium import compiled  # takes half a second

    return compiled.tangent(scene, numbering, found.pose).stiffness


def _has_no_soft_direction(
    scene: Scene, numbering: Layout, found: Equilibrium
) -> Bool[np.ndarray, "*batch"]:
    root = np.sqrt(residual_scale(scene, numbering))
    stiffness = _tangent_stiffness(scene, numbering, found)
    scaled = np.nan_to_num(stiffness[..., 6:, 6:]) / (root[..., :, None] * root[..., None, :])
    own = np.abs(np.diagonal(scaled, axis1=-2, axis2=-1))
    free = free_rotations(scene, numbering, found.pose, single_point_stages(scene))
    free = free * root[..., None]
    stiffened = (
        own.max(-1)[..., None, None]
        * (free @ np.swapaxes(free, -1, -2))
        / np.maximum((free**2).sum((-2, -1)), 1.0)[..., None, None]
    )
    return positive_definite(scaled + stiffened + NEUTRAL * own[..., None] * np.eye(own.shape[-1]))


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
            pose = _newton(now, numbering, pose, target, CORRECTIONS).pose
        return _newton(scene, numbering, pose, 0.0, ITERATIONS)


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
    Compiled loops solve a batch, unless a stage hangs at a single point or the loops lack the
    formulas of an element.
    """
    loops = not uncompiled(scene) and not single_point_stages(scene)
    if len(scene.batch) == 1 and loops:
        return _newton_compiled(
            scene, numbering, pose, target, limit, accept_nominal=accept_nominal
        )
    return _newton_arrays(scene, numbering, pose, target, limit, accept_nominal=accept_nominal)


def _newton_compiled(
    scene: Scene,
    numbering: Layout,
    pose: Pose,
    target: Float[np.ndarray, "*batch coordinate"] | float,
    limit: int,
    *,
    accept_nominal: bool = False,
) -> Equilibrium:
    from suspension_cli.equilibrium import compiled  # takes half a second

    limits = compiled.Limits(limit, BALANCED, LAST_STEP, CAP)
    pose = _broadcast_pose(pose, scene.batch)
    reached, parts, steps, status = compiled.newton(
        scene, numbering, pose, target, limits, accept_nominal=accept_nominal
    )
    found = Equilibrium(pose=reached, iterations=steps, **parts)
    left, nominal = status == compiled.FAILED, status == compiled.NOMINAL
    if nominal.any():
        some = select_scenes(scene, nominal)
        gradient, _ = gradient_and_stiffness(some, numbering, nominal_pose(some))
        nominal[nominal] = np.logical_not(_is_as_drawn(some, numbering, gradient))
    again = _newton_arrays
    if scene.flex is not None:  # arrays do not know the stiffness of bending at unknown tensions
        found.residual[left] = np.nan
        left, again = np.zeros_like(left), _newton_compiled
    left |= nominal
    if not left.any():
        return found
    goal = target[left] if isinstance(target, np.ndarray) else target
    start = _select_pose(pose, left)
    return _replace(found, left, again(select_scenes(scene, left), numbering, start, goal, limit))


def _newton_arrays(
    scene: Scene,
    numbering: Layout,
    pose: Pose,
    target: Float[np.ndarray, "*batch coordinate"] | float,
    limit: int,
    *,
    accept_nominal: bool = False,
) -> Equilibrium:
    """Newton's method on arrays, for any type of number."""
    scale, free = residual_scale(scene, numbering), slice(6, None)
    wanted = target if isinstance(target, float | int) else target[..., free]
    gradient, hessian = gradient_and_stiffness(scene, numbering, pose)
    residual = _largest((gradient[..., free] - wanted) / scale)
    converged = (residual <= BALANCED) & accept_nominal & _is_as_drawn(scene, numbering, gradient)
    if np.all(converged):
        tension = string.state(scene, pose).tension
        return Equilibrium(pose, residual, np.zeros_like(residual), 0, tension, hessian)
    stages = single_point_stages(scene)
    rotations = np.array([name.endswith((".roll", ".pitch", ".yaw")) for name in numbering.name])
    cap = CAP * np.where(rotations[free], 1.0, largest_lever_arm(scene)[..., None])
    count, remainder = 0, None
    while count < limit and not np.all(converged):
        if scene.batch and 2 * np.count_nonzero(converged) > converged.size:
            # most scenes have converged: continue with the others alone
            others = ~converged
            goal = target[others] if isinstance(target, np.ndarray) else target
            start = _select_pose(pose, others)
            remainder = (
                others,
                _newton_arrays(select_scenes(scene, others), numbering, start, goal, limit - count),
            )
            break
        step = newton_step(
            gradient[..., free] - wanted,
            hessian[..., free, free],
            scale,
            free_rotations(scene, numbering, pose, stages),
        )
        step = step / np.maximum(_largest(step / cap), 1.0)[..., None]
        step = np.where(converged[..., None], 0.0, step)
        whole = np.concatenate([np.zeros((*step.shape[:-1], 6)), step], axis=-1)
        pose = displace(numbering, pose, whole)
        gradient, hessian = gradient_and_stiffness(scene, numbering, pose)
        before, residual = residual, _largest((gradient[..., free] - wanted) / scale)
        converged = converged | (
            (_largest(step) < LAST_STEP) & ((residual < SEARCH_END) | (residual > before / 2))
        )
        count += 1
    tension = string.state(scene, pose).tension
    rounding = _rounding(scene, pose, tension, scale)
    found = Equilibrium(pose, residual, rounding, count, tension, hessian)
    if remainder is None:
        return found
    where, rest = remainder
    return _replace(found, where, replace(rest, iterations=count + rest.iterations))


def _is_as_drawn(
    scene: Scene, numbering: Layout, gradient: Inexact[np.ndarray, "*batch coordinate"]
) -> Bool[np.ndarray, "*batch"] | bool:
    """Whether imperfections leave all forces in the nominal pose bitwise unchanged."""
    if scene.drawn is None:
        return True
    nominal, _ = gradient_and_stiffness(scene.drawn, numbering, nominal_pose(scene.drawn))
    return (gradient == nominal).all(-1)


def _rounding(
    scene: Scene,
    pose: Pose,
    tension: Inexact[np.ndarray, "*batch wire"],
    scale: Float[np.ndarray, "*batch moving"],
) -> Float[np.ndarray, "*batch"]:
    """Residual (...) that rounding may cause.

    eps times the tension of a wire and its stiffness times the motion of both its ends.
    """
    wires = scene.wires
    if not wires.label:
        return np.zeros(scene.batch)
    turn, shift = np.abs(pose.turn).max((-2, -1)), np.abs(pose.shift).max(-1)
    ends = ((wires.upper, wires.upper_point), (wires.lower, wires.lower_point))
    motion = sum(shift[..., body] + turn[..., body] * np.abs(point).max(-1) for body, point in ends)
    force = ROUNDINGS * np.finfo(float).eps * (np.abs(tension) + wires.stiffness * motion)
    return (force / scale[..., 6 * (wires.lower - 1)]).max(-1)


def _largest(values: Inexact[np.ndarray, "*batch size"]) -> Float[np.ndarray, "*batch"]:
    return np.abs(values).max(-1)


def newton_step(
    gradient: Inexact[np.ndarray, "*batch moving"],
    hessian: Inexact[np.ndarray, "*batch moving moving"],
    scale: Inexact[np.ndarray, "*batch moving"],
    free: Inexact[np.ndarray, "*batch moving free"],
) -> Inexact[np.ndarray, "*batch moving"]:
    """Newton step -K^-1 g (..., M) without free rotations.

    K is bordered by the free rotations, to which g is orthogonal in any pose.

    Parameters
    ----------
    gradient
        N and N m.
    hessian
        N/m, N and N m.
    scale
        From `residual_scale`; scales rows and columns.
    free
        From `free_rotations`.
    """
    root = np.sqrt(scale)
    scaled = hessian / (root[..., :, None] * root[..., None, :])
    force = gradient / root
    rigid = free.shape[-1]
    if rigid:
        border = free * root[..., None]
        border = border / np.sqrt((border**2).sum(-2, keepdims=True))
        corner = np.zeros((*border.shape[:-2], rigid, rigid))
        scaled = np.block([[scaled, border], [np.swapaxes(border, -1, -2), corner]])
        force = np.concatenate([force, np.zeros((*force.shape[:-1], rigid))], -1)
    return -_solve_each(scaled, force)[..., : gradient.shape[-1]] / root


def _solve_each(
    matrix: Inexact[np.ndarray, "*batch size size"], right: Inexact[np.ndarray, "*batch size"]
) -> Inexact[np.ndarray, "*batch size"]:
    """Solve many systems; a singular one gets its smallest solution."""
    try:
        return np.linalg.solve(matrix, right[..., None])[..., 0]
    except np.linalg.LinAlgError:
        if matrix.ndim == 2:
            return np.linalg.pinv(np.nan_to_num(matrix), rcond=1e-12, hermitian=True) @ right
        return np.stack([_solve_each(m, r) for m, r in zip(matrix, right, strict=True)])
