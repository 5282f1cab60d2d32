"""Newton's method for the poses of builds, many at once.

>>> stiffness = np.array([[3.0, -1.0], [-1.0, 1.0]])[:, :, None]  # of one build
>>> factors = factorise(stiffness, linked=np.ones((2, 2), dtype=bool))
>>> factors.solve(np.array([[[1.0]], [[0.0]]]))[:, 0, 0]  # a force on the last coordinate
array([1.5, 0.5])

A step solves K x = -g. The geometric stiffness of a wire, and its resistance to bending, are those
at the tension that the step before predicted to first order: the tension in the pose contains its
stiffness times squares of that step (Magisano, Leonetti and Garcea, Comput. Methods Appl. Mech.
Eng. 313, 986 (2017)). The first step of imperfect builds is taken with the factors of the nominal
design.

A body that hangs from one point turns about it freely. Its stiffness against that is a rounding
error in the equilibrium, where one coordinate is held, and elsewhere as small as the torque that is
left. So its rotation is stiffened by as much, which vanishes together with the residual.

Builds are solved in chunks that fit into the cache of a processor, and leave a chunk when they have
converged. The result of a build depends on the others in its chunk by rounding alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import BUILDS_AT_ONCE
from suspension_cli.elements import taut_string
from suspension_cli.elements.configuration import Configuration, SceneArrays
from suspension_cli.elimination import Factors, by_body
from suspension_cli.equilibrium.energy import derivatives
from suspension_cli.equilibrium.tree import largest_lever_arm, residual_scale, spinning_bodies
from suspension_cli.scene.pose import Layout, Pose
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

BALANCED = 1e-14
"""Residual (relative to the weight) of a nominal pose that needs no search."""
ROUNDED = 1e-14
"""Residual (relative to the weight) that rounding may leave; the search also ends where rounding
keeps it above this."""
LAST_STEP = 1e-10
"""Step (m or rad) after which rounding is all that is left, as Newton's method squares errors."""
SHORT = 1e-8
"""Step (m or rad) after which a residual that does not fall any more is due to rounding."""
HELD = 1e-12
"""Pivot over the stiffness of its coordinate below which it is a rounding error."""
CAP = 0.3
"""Longest step in rad, and in units of the largest lever arm."""
NUMBERS = 1 << 22
"""Most numbers in the matrices of a chunk."""
ROUNDINGS = 16
"""Most rounding errors of a displacement that add up in the forces on a body."""
MOVING = ("shift", "turn", "deflection")
"""Arrays of a configuration that change with the pose."""


@dataclass(frozen=True)
class Found:
    """Poses of the builds of a chunk, see `Equilibrium`; builds come last."""

    now: Configuration
    residual: Float[np.ndarray, " build"]
    rounding: Float[np.ndarray, " build"]
    pivot: Float[np.ndarray, " build"]
    steps: Int[np.ndarray, " build"]


def chunks(count: int, size: int) -> list[slice]:
    """Chunks of builds with matrices of `size` rows."""
    step = max(1, min(BUILDS_AT_ONCE, NUMBERS // size**2))
    return [slice(start, min(start + step, count)) for start in range(0, max(count, 1), step)]


@dataclass(frozen=True)
class _Builds:
    """Builds of a chunk in one pose each, and how far these are from the equilibrium."""

    number: Int[np.ndarray, " build"]  # in the chunk
    now: Configuration
    goal: Float[np.ndarray, "moving build"]  # gradient that is searched, N and N m
    scale: Float[np.ndarray, "moving build"]  # see `tree.residual_scale`
    unit: Float[np.ndarray, "moving build"]  # of coordinates, m and rad
    gradient: Float[np.ndarray, "moving build"]  # beyond the goal, N and N m
    residual: Float[np.ndarray, " build"]  # its largest component over the scale

    @staticmethod
    def of(
        number: Int[np.ndarray, " build"],
        now: Configuration,
        goal: Float[np.ndarray, "moving build"],
        scale: Float[np.ndarray, "moving build"],
        unit: Float[np.ndarray, "moving build"],
    ) -> _Builds:
        """Compute the gradients of builds in their poses."""
        gradient = derivatives(now, curved=False).gradient[6:-1] - goal
        residual = np.abs(gradient / scale).max(0)
        return _Builds(number, now, goal, scale, unit, gradient, residual)

    def moved(self, now: Configuration) -> _Builds:
        """Change the poses."""
        return _Builds.of(self.number, now, self.goal, self.scale, self.unit)

    def select(self, which: Bool[np.ndarray, " build"]) -> _Builds:
        """Keep some of the builds."""
        if which.all():
            return self
        kept = np.flatnonzero(which)
        arrays = (self.goal, self.scale, self.unit, self.gradient, self.residual)
        chosen = [array[..., kept] for array in arrays]
        return _Builds(self.number[kept], self.now.select(kept), *chosen)


@np.errstate(all="ignore")
def search(
    scene: Scene,
    rows: slice,
    numbering: Layout,
    start: Pose,
    target: Float[np.ndarray, "*batch coordinate"] | float,
    limit: int,
    *,
    accept_nominal: bool,
) -> Found:
    """Search for the poses of the builds `rows` in which the gradient equals a target, N and N m.

    At most `limit` steps. With `accept_nominal`, a nominal pose that balances is left as it is.
    """
    count = rows.stop - rows.start
    arrays = replace(SceneArrays.of(scene, numbering, rows, count), follows=True)
    builds = _Builds.of(
        np.arange(count),
        Configuration.of(arrays, start, scene.batch, rows),
        _goal(target, rows, numbering),
        residual_scale(arrays),
        _unit(arrays, numbering),
    )
    free = [6 * body + dof for body in spinning_bodies(scene) for dof in (-3, -2, -1)]
    # results of all builds; `builds` are those that still move
    scale = builds.scale
    poses = [np.array(getattr(builds.now, name)) for name in MOVING]
    residual = builds.residual.copy()
    pivot = np.full(count, np.nan)
    steps = np.zeros(count, dtype=int)
    moves = np.ones(count, dtype=bool)
    balanced = builds.residual <= BALANCED
    if accept_nominal and balanced.any():
        moves = ~(balanced & _is_as_drawn(scene, rows, builds.now, builds.gradient))
    factors = None
    if accept_nominal and scene.drawn is not None and count:
        # the first step of imperfect builds
        nominal = SceneArrays.of(scene.drawn, numbering, slice(rows.start, rows.start + 1), 1)
        as_drawn = replace(builds.now.select(np.zeros(1, dtype=int)), arrays=nominal)
        factors = _tangent_factors(as_drawn, free, builds.residual[:1] * scale[free, :1])
    for step in range(1, limit + 1):
        builds = builds.select(moves)
        if not len(builds.number):
            break
        if factors is None or step > 1:
            factors = _tangent_factors(builds.now, free, builds.residual * builds.scale[free])
        before = builds.residual
        now, longest = _take_step(builds.now, factors, builds.gradient, builds.unit)
        builds = builds.moved(now)
        moves = ~_is_done(longest, before, builds.residual) & (step < limit)
        ended = builds.number[~moves]
        for pose, name in zip(poses, MOVING, strict=True):
            pose[..., ended] = getattr(now, name)[..., ~moves]
        residual[ended] = builds.residual[~moves]
        steps[ended] = step
        pivot[ended] = np.broadcast_to(factors.least, moves.shape)[~moves]
    final = Configuration(arrays, *poses)
    rounding = np.where(steps > 0, _rounding(final, scale), 0.0)
    return Found(final, residual, rounding, pivot, steps)


def _goal(
    target: Float[np.ndarray, "*batch coordinate"] | float, rows: slice, numbering: Layout
) -> Float[np.ndarray, "moving build"]:
    """Target gradients of the builds `rows`; 0 if no array is given."""
    goal = np.zeros((numbering.size - 6, rows.stop - rows.start))
    if isinstance(target, np.ndarray):
        given = target.reshape(-1, target.shape[-1])[:, 6:].T
        goal += given if given.shape[1] == 1 else given[:, rows]
    return goal


def _unit(arrays: SceneArrays, numbering: Layout) -> Float[np.ndarray, "moving build"]:
    """Units in which steps are measured: 1 rad, and the largest lever arm, m."""
    rotates = [unit == "rad" for unit in numbering.unit[6:]]
    return np.where(rotates, 1.0, largest_lever_arm(arrays)[:, None]).T


def _tangent_factors(
    now: Configuration, free: list[int], stiffening: Float[np.ndarray, "free build"]
) -> Factors:
    """Factors of the tangent stiffness, with the rotations of bodies that spin freely stiffened."""
    made = derivatives(now)
    matrix = made.hessian[6:-1, 6:-1]
    linked = made.linked[6:-1, 6:-1]
    np.einsum("iip->ip", matrix)[free] += stiffening
    return factorise(matrix, linked)


def _is_done(
    step: Float[np.ndarray, " build"],
    before: Float[np.ndarray, " build"],
    residual: Float[np.ndarray, " build"],
) -> Bool[np.ndarray, " build"]:
    """Whether a residual has fallen as far as rounding lets it, or is lost."""
    lost = ~np.isfinite(residual)
    no_longer_falls = (step < SHORT) & (residual > before / 2)
    converged = (step < LAST_STEP) & (residual < ROUNDED)
    return lost | no_longer_falls | converged


def _take_step(
    now: Configuration,
    factors: Factors,
    gradient: Float[np.ndarray, "moving build"],
    unit: Float[np.ndarray, "moving build"],
) -> tuple[Configuration, Float[np.ndarray, " build"]]:
    """Take a step, with the tensions predicted; also, its largest component."""
    x = np.empty_like(gradient)
    order = factors.pattern.order
    x[order] = factors.solve(-gradient[order, None])[:, 0]
    x /= np.maximum(np.abs(x / unit).max(0) / CAP, 1.0)
    whole = np.concatenate([np.zeros((6, x.shape[1])), x])
    tension = taut_string.predicted_tension(now, whole)
    return replace(now.displaced(whole), tension=tension), np.abs(x).max(0)


def factorise(
    matrix: Float[np.ndarray, "moving moving build"], linked: Bool[np.ndarray, "moving moving"]
) -> Factors:
    """Factors of tangent stiffnesses, of which the lower triangles are used.

    Coordinates are eliminated from the last to the first, tips of blades and lower bodies before
    those above, so that the factors stay as sparse as the tree of bodies. A stable equilibrium has
    positive pivots alone.
    """
    pattern = by_body(np.arange(len(linked)), linked)
    return pattern.factor(matrix[pattern.row, pattern.column], HELD)


def _is_as_drawn(
    scene: Scene,
    rows: slice,
    now: Configuration,
    gradient: Float[np.ndarray, "moving build"],
) -> Bool[np.ndarray, " build"]:
    """Whether imperfections leave all forces in the nominal pose bitwise unchanged."""
    if scene.drawn is None:
        return np.ones(now.arrays.count, dtype=bool)
    arrays = SceneArrays.of(scene.drawn, now.arrays.numbering, rows, now.arrays.count)
    drawn = replace(now, arrays=replace(arrays, follows=True))
    return (gradient == derivatives(drawn, curved=False).gradient[6:-1]).all(0)


def _rounding(
    now: Configuration, scale: Float[np.ndarray, "moving build"]
) -> Float[np.ndarray, " build"]:
    """Residual that rounding may cause.

    eps times the tension of a wire and its stiffness times the motion of both its ends.
    """
    wires = now.arrays.wires
    if not wires.label:
        return np.zeros(now.arrays.count)
    turn = np.abs(now.turn).max((0, 1))
    shift = np.abs(now.shift).max(0)
    ends = ((wires.upper, wires.upper_point), (wires.lower, wires.lower_point))
    motion = sum(shift[body] + turn[body] * np.abs(point).max(0) for body, point in ends)
    force = ROUNDINGS * np.finfo(float).eps * (np.abs(now.wires.tension) + wires.stiffness * motion)
    return (force / scale[6 * (wires.lower - 1)]).max(0)
