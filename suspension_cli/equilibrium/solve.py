"""Equilibrium of a scene, by Newton's method with exact finite rotations and tangent stiffness.

>>> import suspension_cli as sus
>>> from suspension_cli.equilibrium.nominal import expand
>>> found = solve(expand(sus.example("imperfect").design))
>>> (1e6 * found.pose.shift[1]).round()  # the mirror hangs so far from its nominal place, um
array([ 75., -48., -10.])

During the search wires may push, so that the energy is smooth; that all are taut is checked at the
end. A saddle point is an equilibrium too: an unstable suspension is a finding, not an error, so the
search goes to the stationary point next to the nominal pose and does not slide down from it.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.elements import taut_string
from suspension_cli.elements.configuration import Configuration, SceneArrays, batch_first
from suspension_cli.equilibrium.energy import derivatives, gradient_and_stiffness
from suspension_cli.equilibrium.newton import (
    BALANCED,
    CONVERGED,
    Found,
    chunks,
    factorise,
    search,
)
from suspension_cli.equilibrium.tree import residual_scale
from suspension_cli.errors import Fault, InputError
from suspension_cli.scene.arrays import inner_axes
from suspension_cli.scene.pose import Layout, Pose, layout, nominal_pose
from suspension_cli.scene.scene import Scene, scale_imperfections, select_scenes

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact

COARSE = 1e-4
"""Residual (relative to the weight) from rounding above which a result is useless."""
ITERATIONS = 25
"""Most Newton steps of a search."""
STEPS = (10, 80)
"""Continuation steps where Newton's method is not reliable; the second if the first does not end in
a stable pose."""
CORRECTIONS = 4
"""Newton steps after each continuation step."""
NEUTRAL = 1e-12
"""Stiffness, relative to that with all other coordinates fixed, below which a motion is neutral
within rounding, not unstable."""
CLEAR = 1e-6
"""Least pivot of the tangent stiffness, over its diagonal element, above which a pose is stable;
below it the last step, free rotations and rounding need a closer look."""
KEPT = 8
"""Equilibria of single scenes that are kept: of strings and of wires that bend, of few designs."""
SAME = 1e-6
"""Largest difference of positions, m, and relative one of tensions, of the same equilibrium."""
PARTS_OF_POSE = inner_axes(Pose)
"""Arrays of a pose, and their axes beyond the batch."""
ARRAYS = ("residual", "rounding", "tension", "pivot", "soft", "form", "bend", "twist")
"""Arrays of an equilibrium beside its pose; the last two may be None."""


@dataclass(frozen=True)
class Equilibrium:
    """Pose in which a scene balances.

    Attributes
    ----------
    residual
        Largest unbalanced force on a body over the weight that it carries, or torque over that
        weight times the lever arm of the body.
    rounding
        Part of the residual that rounding may cause.
    iterations
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

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """All arrays, those of the pose too."""
        named = [(self, name) for name in ARRAYS] + [(self.pose, name) for name in PARTS_OF_POSE]
        arrays = {name: getattr(owner, name) for owner, name in named}
        return {name: array for name, array in arrays.items() if array is not None}

    @staticmethod
    def of(arrays: dict[str, np.ndarray], iterations: int) -> Equilibrium:
        """Take an equilibrium from its `arrays`."""
        pose = Pose(*(arrays[name] for name in PARTS_OF_POSE))
        own: dict[str, Any] = {name: arrays.get(name) for name in ARRAYS}
        return Equilibrium(pose=pose, iterations=iterations, **own)

    def select(self, which: Bool[np.ndarray, "*batch"] | int) -> Equilibrium:
        """Select scenes of a batch, as `stack.select_scenes`."""
        arrays = {name: array[which] for name, array in self.arrays.items()}
        return Equilibrium.of(arrays, self.iterations)

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

    A scene has any batch axes; none depends on the others. `start` replaces the nominal pose. The
    result is not necessarily converged, see `Equilibrium.demand`.
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
        begin = nominal_pose(some)
        if nominal is not None:
            pose = _broadcast_pose(nominal.pose, scene.batch)
            begin = Pose(*(getattr(pose, name)[suspect] for name in PARTS_OF_POSE))
        better = _continue(some, numbering, begin, steps)
        settled = _is_stable(some, numbering, better)
        if scene.drawn is None:  # of imperfect builds the branch bends: shorter steps may leave it
            settled |= taut[suspect] & _agree(better, found.select(suspect))
        reached = suspect.copy()
        reached[suspect] = better.converged
        found = _replace(found, reached, better.select(better.converged))
        suspect[suspect] = ~(better.converged & settled)
    return found


def solve_once(
    scene: Scene, numbering: Layout | None = None, start: Pose | None = None
) -> Equilibrium:
    """Find an equilibrium as `solve` does; that of a scene like one of the last few is known.

    All models of a command, its checks, and designs that differ in their losses alone hang alike.
    """
    if scene.batch:
        return solve(scene, numbering, start)
    key = (*_forces_in(scene), *_content(start))
    if key not in _known:
        while len(_known) >= KEPT:
            del _known[next(iter(_known))]
        _known[key] = solve(scene, numbering, start)
    return _known[key]


_known: dict[tuple[Hashable, ...], Equilibrium] = {}
"""Equilibria found last, by all that they depend on."""


def _forces_in(scene: Scene) -> tuple[Hashable, ...]:
    """All of a scene that its equilibrium depends on: not the losses."""
    parts = [*scene.parts.values(), scene.flex, scene.field]
    known = [value for part in parts for value in _content(part)]
    drawn = None if scene.drawn is None else _forces_in(scene.drawn)
    return (scene.gravity, scene.solves_pose, drawn, *known)


def _content(part: Any) -> Iterator[Hashable]:
    """All fields of a part of a scene but its losses, arrays as bytes."""
    for one in () if part is None else fields(part):
        value = getattr(part, one.name)
        if one.name != "loss":
            is_array = isinstance(value, np.ndarray)
            yield (value.shape, value.tobytes()) if is_array else value


def _broadcast_pose(pose: Pose, batch: tuple[int, ...]) -> Pose:
    def spread(part: np.ndarray, inner: int) -> np.ndarray:
        return np.broadcast_to(part, batch + part.shape[part.ndim - inner :])

    return Pose(*(spread(getattr(pose, name), inner) for name, inner in PARTS_OF_POSE.items()))


def _replace(
    found: Equilibrium, where: Bool[np.ndarray, "*batch"], new: Equilibrium
) -> Equilibrium:
    """Replace the results of a batch `where` there are new ones (given for these alone)."""
    arrays = {}
    others = new.arrays
    for name, old in found.arrays.items():
        arrays[name] = np.array(np.broadcast_to(old, where.shape + others[name].shape[1:]))
        arrays[name][where] = others[name]
    return Equilibrium.of(arrays, max(found.iterations, new.iterations))


def _agree(first: Equilibrium, second: Equilibrium) -> Bool[np.ndarray, " build"]:
    """Whether equilibria of a batch that were found in two ways are the same.

    A saddle is no stray result then. Rotations are not compared: neutral ones are undetermined.
    """
    moved = np.abs(first.pose.shift - second.pose.shift).max((-2, -1), initial=0.0)
    changed = np.abs(first.tension / second.tension - 1).max(-1, initial=0.0)
    return (moved < SAME) & (changed < SAME)


def _is_stable(scene: Scene, numbering: Layout, found: Equilibrium) -> Bool[np.ndarray, "*batch"]:
    """Whether each tangent stiffness is positive definite, apart from neutral motions."""
    result = np.asarray(found.pivot > CLEAR)
    unclear = ~result
    if unclear.any():
        some = select_scenes(scene, unclear)
        pose = found.select(unclear).pose
        result[unclear] = _has_no_soft_direction(some, numbering, pose)
    return result


def _has_no_soft_direction(
    scene: Scene, numbering: Layout, pose: Pose
) -> Bool[np.ndarray, " build"]:
    arrays = replace(SceneArrays.of(scene, numbering), follows=True)
    now = Configuration.of(arrays, pose, scene.batch)
    root = np.sqrt(residual_scale(arrays))
    stiffness = np.moveaxis(derivatives(now).symmetric(), 0, -1)[6:, 6:]
    scaled = np.nan_to_num(stiffness) / (root[:, None] * root)
    own = np.einsum("iip->ip", scaled)
    own += NEUTRAL * np.abs(own)
    return factorise(scaled, np.ones(scaled.shape[:2], dtype=bool)).least > 0


def _continue(scene: Scene, numbering: Layout, pose: Pose, steps: int) -> Equilibrium:
    """Follow the equilibrium from the nominal design's pose in small steps."""
    with np.errstate(all="ignore"):
        nominal_gradient = (
            gradient_and_stiffness(scene, numbering, pose)[0] if scene.drawn is None else 0.0
        )
        for n in range(1, steps):
            if scene.drawn is None:  # reduce the forces that hold it in the nominal pose
                now = scene
                target = nominal_gradient * (1 - n / steps)
            else:  # increase the imperfections
                now = scale_imperfections(scene, n / steps)
                target = 0.0
            pose = _newton(now, numbering, pose, target, CORRECTIONS).pose
        return _newton(scene, numbering, pose, 0.0, ITERATIONS)


@np.errstate(all="ignore")
def _as_drawn(scene: Scene, rows: slice, numbering: Layout, nominal: Pose) -> Found | None:
    """Builds of a scene without imperfections that all balance in their nominal pose, else None.

    What `search` finds for these, but their forces and stiffness are computed together. Wires that
    bend have `flex` at their nominal tensions and lengths, which are those in this pose.
    """
    if scene.drawn is not None or scene.solves_pose:
        return None
    count = rows.stop - rows.start
    arrays = SceneArrays.of(scene, numbering, rows, count)
    now = Configuration.of(arrays, nominal, scene.batch, rows)
    soft = derivatives(now, stretching=False)
    residual = np.abs(soft.gradient[6:-1] / residual_scale(arrays)).max(0)
    if not (residual <= BALANCED).all():
        return None
    none = np.zeros(count)
    return Found(now, soft, residual, none, np.full(count, np.nan), np.zeros(count, dtype=int))


def _newton(
    scene: Scene,
    numbering: Layout,
    pose: Pose,
    target: Float[np.ndarray, "*batch coordinate"] | float,
    limit: int,
    *,
    accept_nominal: bool = False,
) -> Equilibrium:
    """Newton's method in chunks of builds, see `newton.search`."""
    count = math.prod(scene.batch)
    size = numbering.size
    wires = len(scene.wires.label)
    soft = np.empty((size, size, count))  # builds last, as summed
    form = np.empty((size, wires, count))
    parts = []
    steps = 0
    for rows in chunks(count, size):
        found = _as_drawn(scene, rows, numbering, pose) if accept_nominal else None
        if found is None:
            found = search(
                scene, rows, numbering, pose, target, limit, accept_nominal=accept_nominal
            )
        now = found.now
        steps = max(steps, int(found.steps.max(initial=0)))
        found.soft.symmetric(soft[..., rows])
        form[..., rows] = taut_string.elongations(now)
        own = {name: getattr(now, name) for name in PARTS_OF_POSE} | {"tension": now.wires.tension}
        if scene.flex is not None and now.flex is not None:
            own |= {name: getattr(now.flex, name) for name in ("bend", "twist")}
        batch = (now.arrays.count,)
        own = {name: batch_first(part, batch) for name, part in own.items() if part is not None}
        parts.append(
            own | {name: getattr(found, name) for name in ("residual", "rounding", "pivot")}
        )
    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    whole |= {"soft": soft.T, "form": form.T}
    shaped = {name: part.reshape((*scene.batch, *part.shape[1:])) for name, part in whole.items()}
    return Equilibrium.of({name: part[()] for name, part in shaped.items()}, steps)
