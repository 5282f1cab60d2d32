"""Where a suspension really hangs: exact finite rotations, Newton with the exact tangent stiffness.

Wires are taken as linear springs while the search goes on (they may push), so that the energy is smooth; that all
of them pull is checked at the end.  A saddle point counts as an equilibrium: an unstable one is a finding, not an
error, so the search goes to the stationary point next to the nominal pose and does not slide down from it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.design.scene import Scene
from suspension_cli.design.stack import blended, picked
from suspension_cli.errors import Fault, InputError
from suspension_cli.mechanics import string
from suspension_cli.mechanics.definite import positive_definite
from suspension_cli.mechanics.pose import Layout, Pose, displaced, layout, nominal_pose
from suspension_cli.mechanics.shares import lever_arm, units
from suspension_cli.mechanics.spins import free_to_spin, spins
from suspension_cli.mechanics.tangent import tangent

BALANCED = 1e-14
"""Residual (of the weight) of a nominal pose that needs no search."""
CONVERGED = 1e-11
"""Residual (of the weight) below which a search has found its equilibrium, unless rounding of lengths does not let it fall so far."""
COARSE = 1e-4
"""Residual (of the weight) left by rounding of lengths above which there is nothing to be said of an equilibrium."""
SETTLED = 1e-12
"""Residual (of the weight) at which the search stops; it stops too where rounding lets the residual fall no further."""
LAST_STEP = 1e-8
"""Step (m or rad) after which the error is below rounding, as convergence is quadratic."""
ITERATIONS = 15
STEPS = (10, 80)
"""In how many an equilibrium is followed where Newton's method alone is not to be trusted; the second if the first does not end in a stable pose."""
CORRECTIONS = 4
"""Newton steps after each."""
ROUNDINGS = 16
"""How many rounding errors of a displacement add up in the forces on a body, at most."""
CAP = 0.3
"""Longest step in rad, and in units of the largest lever arm."""
NEUTRAL = 1e-13
"""Stiffness (relative to what the same coordinate has with all others held) below which a motion costs nothing but for rounding: it is no instability."""
PARTS_OF_POSE = ("shift", "turn", "deflection")
PARTS_OF_RESULT = ("residual", "rounding", "tension", "stiffness")


@dataclass(frozen=True)
class Equilibrium:
    """The pose in which a scene balances.

    Attributes
    ----------
    pose : Pose
    residual : (...) array
        Largest force left over on a body as a share of the weight that it carries, largest torque as a share of that times its lever arm.
    rounding : (...) array
        What of it may be rounding of the tensions and lengths of wires.
    iterations : int
        Newton steps taken; 0 if the nominal pose balances.
    tension : (..., w) array
        N.
    stiffness : (..., N, N) array
        The tangent stiffness in this pose.
    """

    pose: Pose
    residual: Any
    rounding: Any
    iterations: int
    tension: Any
    stiffness: Any

    @property
    def converged(self) -> Any:
        """Whether each scene of the batch has an equilibrium near its nominal pose."""
        return self.residual < np.maximum(CONVERGED, np.where(self.rounding < COARSE, self.rounding, 0.0))

    def demand(self, scene: Scene) -> None:
        """Raise `InputError` unless every scene of the batch balances on taut wires."""
        if not np.all(self.converged):
            worst = float(np.max(np.nan_to_num(self.residual, nan=np.inf)))
            if float(np.max(np.nan_to_num(self.rounding))) >= COARSE:
                stiffest = float(scene.wires.stiffness.max())
                problem = f"wires of {stiffest:.1e} N/m are too stiff to be balanced: rounding of their lengths leaves {worst:.1e} of the weight"
                raise InputError([Fault("stage", problem, "give them the k = E A / l of a real wire, at most 1e13 N/m or so")])
            remedy = "check natural lengths, positions and the size of the perturbations"
            raise InputError([Fault("stage", f"no equilibrium found near the nominal pose (residual {worst:.1e} of the weight)", remedy)])
        low = self.tension.min(tuple(range(self.tension.ndim - 1)), initial=np.inf)
        faults = [
            Fault(_key(label), f"wire {label} is slack in equilibrium (tension {tension:.3g} N)", "shorten it, or leave it out")
            for label, tension in zip(scene.wires.label, low, strict=True)
            if not tension > 0
        ]
        if faults:
            raise InputError(faults)


def _key(label: str) -> str:
    return f"stage.{label.rsplit('.', 1)[0]}.wire"


def solve(scene: Scene, numbering: Layout | None = None, start: Pose | None = None) -> Equilibrium:
    """Find the equilibrium of a scene near its nominal pose.

    Newton's method goes there in a few steps.  Where it does not settle, or ends where a wire is slack or the pose is unstable
    (it may have overshot to another stationary point), the equilibrium is followed instead from where the nominal design hangs, while the imperfections
    grow from nothing; or, where the nominal pose is solved for, while the forces that hold it as drawn are let go of.

    Parameters
    ----------
    scene : Scene
        With any batch axes; all scenes of a batch are solved at once, none depends on the others.
    numbering : Layout, optional
    start : Pose, optional
        Where to start from instead of the nominal pose.

    Returns
    -------
    Equilibrium
        Not necessarily converged: see `Equilibrium.demand`.
    """
    numbering = numbering or layout(scene)
    pose = start or nominal_pose(scene)
    found = _newton(scene, numbering, pose, 0.0, ITERATIONS, rest=start is None)
    if found.iterations == 0:
        return found
    sound = found.converged & (found.tension > 0).all(-1)
    doubtful = np.asarray(~(sound & _stable(scene, numbering, found)))
    if not doubtful.any():
        return found
    nominal = None if scene.drawn is None else solve(scene.drawn, numbering)
    if nominal is not None and scene.drawn is not None:
        doubtful &= ~(sound & ~_stable(scene.drawn, numbering, nominal))  # of an unstable design the branch is unstable from its beginning
    for steps in STEPS:
        if not doubtful.any():
            break
        some = picked(scene, doubtful)
        begin = nominal_pose(some) if nominal is None else _picked_pose(_spread(nominal.pose, scene.batch), doubtful)
        better = _followed(some, numbering, begin, steps)
        found = _merged(found, doubtful, better)
        doubtful[doubtful] = ~(better.converged & _stable(some, numbering, better))
    return found


def stepped(scene: Scene, steps: int) -> Equilibrium:
    """Where so many Newton steps from the nominal pose lead, converged or not: one is the linear solution, none the nominal pose."""
    return _newton(scene, layout(scene), nominal_pose(scene), 0.0, steps)


def resolved(scene: Scene, numbering: Layout, found: Equilibrium, where: Any) -> Equilibrium:
    """Equilibria of a batch with those `where` something in the scene has changed sought anew, from where they were."""
    if not scene.batch:
        return solve(scene, numbering, start=found.pose)
    return _placed(found, where, solve(picked(scene, where), numbering, start=_picked_pose(found.pose, where)))


def _picked_pose(pose: Pose, where: Any) -> Pose:
    return Pose(*(getattr(pose, name)[where] for name in PARTS_OF_POSE))


def _placed(found: Equilibrium, where: Any, new: Equilibrium) -> Equilibrium:
    """Results of a batch with those `where` others were found (given for these alone) replaced."""

    def take(old: Any, some: Any) -> Any:
        result = np.array(np.broadcast_to(old, where.shape + some.shape[1:]))
        result[where] = some
        return result

    pose = Pose(*(take(getattr(found.pose, name), getattr(new.pose, name)) for name in PARTS_OF_POSE))
    parts = {name: take(getattr(found, name), getattr(new, name)) for name in PARTS_OF_RESULT}
    return Equilibrium(pose=pose, iterations=max(found.iterations, new.iterations), **parts)


def _stable(scene: Scene, numbering: Layout, found: Equilibrium) -> Any:
    """Whether the tangent stiffness of each scene is positive definite, but for the motions that cost nothing."""
    root = np.sqrt(units(scene, numbering))
    scaled = np.nan_to_num(found.stiffness[..., 6:, 6:]) / (root[..., :, None] * root[..., None, :])
    own = np.abs(np.diagonal(scaled, axis1=-2, axis2=-1))
    free = spins(scene, numbering, found.pose, free_to_spin(scene)) * root[..., None]
    held = own.max(-1)[..., None, None] * (free @ np.swapaxes(free, -1, -2)) / np.maximum((free**2).sum((-2, -1)), 1.0)[..., None, None]
    return positive_definite(scaled + held + NEUTRAL * own[..., None] * np.eye(own.shape[-1]))


def _followed(scene: Scene, numbering: Layout, pose: Pose, steps: int) -> Equilibrium:
    """The equilibrium on the branch of the nominal design, followed in small steps from where that hangs."""
    with np.errstate(all="ignore"):
        held = tangent(scene, numbering, pose)[0] if scene.drawn is None else 0.0
        for n in range(1, steps):
            if scene.drawn is None:  # let go little by little of what holds it in the nominal pose
                pose = _newton(scene, numbering, pose, held * (1 - n / steps), CORRECTIONS).pose
            else:  # let the imperfections grow
                pose = _newton(blended(scene, n / steps), numbering, pose, 0.0, CORRECTIONS).pose
        return _newton(scene, numbering, pose, 0.0, ITERATIONS)


def _spread(pose: Pose, batch: tuple[int, ...]) -> Pose:
    """A pose of all scenes of a batch."""
    inner = {"shift": 2, "turn": 3, "deflection": 2}
    parts = {name: getattr(pose, name) for name in PARTS_OF_POSE}
    return Pose(**{name: np.broadcast_to(part, batch + part.shape[part.ndim - inner[name] :]) for name, part in parts.items()})


def _merged(found: Equilibrium, where: Any, better: Equilibrium) -> Equilibrium:
    """Results of a batch with those `where` a second try was made (given for these alone) replaced, if it converged."""
    chosen = where.copy()
    chosen[where] = better.converged
    kept = better.converged
    pose = _picked_pose(better.pose, kept)
    parts = {name: getattr(better, name)[kept] for name in PARTS_OF_RESULT}
    return _placed(found, chosen, Equilibrium(pose=pose, iterations=better.iterations, **parts))


def _newton(scene: Scene, numbering: Layout, pose: Pose, target: Any, most: int, *, rest: bool = False) -> Equilibrium:
    """Newton's method to the pose in which the gradient equals a target (..., N); a nominal pose at `rest` is left alone."""
    unit, free = units(scene, numbering), slice(6, None)
    wanted = target if np.isscalar(target) else target[..., free]
    gradient, hessian = tangent(scene, numbering, pose)
    left = _size((gradient[..., free] - wanted) / unit)
    settled = (left <= BALANCED) & rest & _as_drawn(scene, numbering, gradient)
    if np.all(settled):
        return Equilibrium(pose, left, np.zeros_like(left), 0, string.state(scene, pose).tension, hessian)
    spinning = free_to_spin(scene)
    cap = CAP * np.where(_is_rotation(numbering)[free], 1.0, lever_arm(scene)[..., None])
    count, rest_of = 0, None
    while count < most and not np.all(settled):
        if scene.batch and 2 * np.count_nonzero(settled) > settled.size:  # most are there: go on with the others alone
            left_over = ~settled
            goal = target[left_over] if isinstance(target, np.ndarray) else target
            rest_of = left_over, _newton(picked(scene, left_over), numbering, _picked_pose(pose, left_over), goal, most - count)
            break
        step = newton_step(gradient[..., free] - wanted, hessian[..., free, free], unit, spins(scene, numbering, pose, spinning))
        over = np.maximum(_size(step / cap), 1.0)
        step = np.where(settled[..., None], 0.0, step / over[..., None])
        whole = np.concatenate([np.zeros((*step.shape[:-1], 6)), step], axis=-1)
        pose = displaced(numbering, pose, whole)
        gradient, hessian = tangent(scene, numbering, pose)
        before, left = left, _size((gradient[..., free] - wanted) / unit)
        settled = settled | ((_size(step) < LAST_STEP) & ((left < SETTLED) | (left > before / 2)))
        count += 1
    tension = string.state(scene, pose).tension
    found = Equilibrium(pose, left, _rounding(scene, pose, tension, unit), count, tension, hessian)
    if rest_of is None:
        return found
    where, others = rest_of
    return _placed(found, where, replace(others, iterations=count + others.iterations))


def _as_drawn(scene: Scene, numbering: Layout, gradient: Any) -> Any:
    """Whether the imperfections of each scene leave all forces in the nominal pose just as they were drawn: then what is left over is rounding."""
    if scene.drawn is None:
        return True
    meant, _ = tangent(scene.drawn, numbering, nominal_pose(scene.drawn))
    return (gradient == meant).all(-1)


def _rounding(scene: Scene, pose: Pose, tension: Any, unit: Any) -> Any:
    """The residual (...) that rounding may leave: eps times the tension of a wire, and its stiffness times how far both its ends have moved."""
    wires = scene.wires
    if not wires.label:
        return np.zeros(scene.batch)
    turn, moved = np.abs(pose.turn).max((-2, -1)), np.abs(pose.shift).max(-1)
    ends = ((wires.upper, wires.upper_point), (wires.lower, wires.lower_point))
    reach = sum(moved[..., body] + turn[..., body] * np.abs(point).max(-1) for body, point in ends)
    force = ROUNDINGS * np.finfo(float).eps * (np.abs(tension) + wires.stiffness * reach)
    return (force / unit[..., 6 * (wires.lower - 1)]).max(-1)


def _is_rotation(numbering: Layout) -> Any:
    return np.array([name.rsplit(".", 1)[1] in ("roll", "pitch", "yaw") for name in numbering.name])


def _size(values: Any) -> Any:
    return np.abs(values).max(-1)


def newton_step(gradient: Any, hessian: Any, unit: Any, free: Any) -> Any:
    """The step -K^-1 g, without turning where that costs nothing: K bordered by the spins, which are orthogonal to g in any pose."""
    root = np.sqrt(unit)
    scaled = hessian / (root[..., :, None] * root[..., None, :])
    force = gradient / root
    rigid = free.shape[-1]
    if rigid:
        border = free * root[..., None]
        border = border / np.sqrt((border**2).sum(-2, keepdims=True))
        corner = np.zeros((*border.shape[:-2], rigid, rigid))
        scaled = np.concatenate([np.concatenate([scaled, border], -1), np.concatenate([np.swapaxes(border, -1, -2), corner], -1)], -2)
        force = np.concatenate([force, np.zeros((*force.shape[:-1], rigid))], -1)
    return -_solved(scaled, force)[..., : gradient.shape[-1]] / root


def _solved(matrix: Any, right: Any) -> Any:
    """Solutions of many systems; a singular one takes the smallest, and does not touch the others."""
    try:
        return np.linalg.solve(matrix, right[..., None])[..., 0]
    except np.linalg.LinAlgError:
        if matrix.ndim == 2:
            return np.linalg.pinv(np.nan_to_num(matrix), rcond=1e-12, hermitian=True) @ right
        return np.stack([_solved(m, r) for m, r in zip(matrix, right, strict=True)])
