"""Newton's method for the poses of builds, many at once.

>>> stiffness = np.array([[3.0, -1.0], [-1.0, 1.0]])[:, :, None]  # of one build
>>> factors = factorise(stiffness, linked=np.ones((2, 2), dtype=bool))
>>> factors.solve(np.array([[[1.0]], [[0.0]]]))[:, 0, 0]  # a force on the last coordinate
array([1.5, 0.5])

A step solves K x = -g. The geometric stiffness of a wire, and its resistance to bending, are those
at the tension that the step before predicted to first order: the tension in the pose contains its
stiffness times squares of that step (Magisano, Leonetti and Garcea, Comput. Methods Appl. Mech.
Eng. 313, 986 (2017)). In the first step of imperfect builds they are those at the nominal tensions,
which carry the weight: wires of other lengths may even push in the nominal pose. K lacks the change
of the resistance to bending with the tension, which would leave a fraction of 1e-3 of the error in
each step. So the same factors give the correction for how the tensions change in the step.

A body that hangs from one point turns about it freely. Its stiffness against that is a rounding
error in the equilibrium, where one coordinate is held, and elsewhere as small as the torque that is
left. So its rotation is stiffened by as much, which vanishes together with the residual.

Builds are solved in chunks that fit into the cache of a processor, and leave a chunk when they have
converged. Errors fall quadratically, so the last two steps e and f predict that of the pose after
f, f (f / e)^2: a build for which that is negligible is done without another look at its forces. The
result of a build depends on the others in its chunk by rounding alone.

A step with the factors of an earlier one would cost a third, but it fails: while a wire turns by
1e-3, its stiffness along itself adds to that across as much as the weight does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import BUILDS_AT_ONCE
from suspension_cli.elements import bending, taut_string
from suspension_cli.elements.configuration import Configuration, SceneArrays, builds_last
from suspension_cli.elements.energy_derivatives import Derivatives
from suspension_cli.elements.vectors import Vector
from suspension_cli.elimination import Factors, Pattern, by_body
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
CONVERGED = 1e-11
"""Largest residual (relative to the weight) of an equilibrium, unless rounding leaves more."""
NEGLIGIBLE = 1e-13
"""Predicted residual (relative to the weight) that needs no further step."""
LEFT = 1e-13
"""Predicted error of a pose, over the longest step to it, that is negligible."""
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
    soft: Derivatives  # of the energy without the stretching of wires
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
    pattern: Pattern | None = None  # of the tangent stiffness, if that is known
    elements: Float[np.ndarray, "element build"] | None = None  # of the tangent stiffness
    bent: tuple[Vector, ...] = ()  # see `Derivatives`

    @staticmethod
    def of(
        number: Int[np.ndarray, " build"],
        now: Configuration,
        goal: Float[np.ndarray, "moving build"],
        scale: Float[np.ndarray, "moving build"],
        unit: Float[np.ndarray, "moving build"],
        *,
        curved: bool = True,
    ) -> _Builds:
        """Compute the gradients of builds in their poses; if `curved`, also their stiffness."""
        made = derivatives(now, curved=curved)
        gradient = made.gradient[6:-1] - goal
        known = _Builds(number, now, goal, scale, unit, gradient, _residual(gradient, scale))
        if not curved:
            return known
        pattern = _pattern(made.linked[6:-1, 6:-1])
        elements = made.hessian[6:-1, 6:-1][pattern.row, pattern.column]
        return replace(known, pattern=pattern, elements=elements, bent=made.bent)

    def moved(self, now: Configuration, which: Bool[np.ndarray, " build"]) -> _Builds:
        """Change the poses of some of the builds, and keep these alone."""
        kept = np.flatnonzero(which)
        if len(kept) < len(which):
            now = now.select(kept)
        goal, scale, unit = (array[..., kept] for array in (self.goal, self.scale, self.unit))
        return _Builds.of(self.number[kept], now, goal, scale, unit)

    def select(self, which: Bool[np.ndarray, " build"]) -> _Builds:
        """Keep some of the builds."""
        if which.all():
            return self
        kept = np.flatnonzero(which)
        arrays = (self.goal, self.scale, self.unit, self.gradient, self.residual)
        goal, scale, unit, gradient, residual = (array[..., kept] for array in arrays)
        elements = None if self.elements is None else self.elements[:, kept]
        now = self.now.select(kept)
        number = self.number[kept]
        pattern = self.pattern
        bent = tuple(part[..., kept] for part in self.bent)
        return _Builds(number, now, goal, scale, unit, gradient, residual, pattern, elements, bent)

    def tangent_factors(self, free: list[int]) -> Factors:
        """Factors of the stiffness, with the rotations of bodies that spin freely stiffened."""
        builds = self
        if builds.elements is None:
            builds = self.moved(self.now, np.ones(len(self.number), dtype=bool))
        assert builds.pattern is not None and builds.elements is not None
        row, column = builds.pattern.row, builds.pattern.column
        spins = np.flatnonzero((row == column) & np.isin(row, free))
        builds.elements[spins] += self.residual * self.scale[row[spins]]
        return builds.pattern.factor(builds.elements, HELD)


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
    now = Configuration.of(arrays, start, scene.batch, rows)
    if accept_nominal and scene.drawn is not None:
        nominal = builds_last(scene.drawn.wires.tension, 1, scene.drawn.batch, rows)
        now = replace(now, tension=np.broadcast_to(nominal, (len(nominal), count)))
    builds = _Builds.of(
        np.arange(count),
        now,
        _goal(target, rows, numbering),
        residual_scale(arrays),
        _unit(arrays, numbering),
        curved=scene.drawn is not None,  # else most are balanced as they are
    )
    free = [6 * body + dof for body in spinning_bodies(scene) for dof in (-3, -2, -1)]
    scale = builds.scale
    goal = builds.goal
    reached = _Reached(
        [np.array(getattr(builds.now, name)) for name in MOVING],
        np.full(count, np.nan),
        np.zeros(count, dtype=int),
    )
    moves = np.ones(count, dtype=bool)
    balanced = builds.residual <= BALANCED
    if accept_nominal and balanced.any():
        moves = ~(balanced & _is_as_drawn(scene, rows, builds.now, builds.gradient))
    predicts = bool(scene.batch)
    reached.follow(builds.select(moves), free, limit, predicts=predicts)
    final = Configuration(arrays, *reached.poses)
    soft = derivatives(final, stretching=False)
    residual = _residual(soft.gradient[6:-1] - goal, scale)
    missed = (reached.steps > 0) & (reached.steps < limit) & (residual > CONVERGED)
    if predicts and missed.any():
        builds = builds.moved(final, missed)
        reached.follow(builds, free, limit, predicts=False)
        some = final.select(np.flatnonzero(missed))
        some = replace(some, **{name: pose[..., missed] for name, pose in reached.moving.items()})
        again = derivatives(some, stretching=False)
        soft.hessian[..., missed] = again.hessian
        gradient = again.gradient[6:-1] - goal[:, missed]
        residual[missed] = _residual(gradient, scale[:, missed])
        final = Configuration(arrays, *reached.poses)
    rounding = np.where(reached.steps > 0, _rounding(final, scale), 0.0)
    return Found(final, soft, residual, rounding, reached.pivot, reached.steps)


@dataclass(frozen=True)
class _Reached:
    """Poses that all builds of a chunk have reached so far, and the steps to them."""

    poses: list[np.ndarray]  # arrays `MOVING`
    pivot: Float[np.ndarray, " build"]
    steps: Int[np.ndarray, " build"]

    @property
    def moving(self) -> dict[str, np.ndarray]:
        """The poses by name."""
        return dict(zip(MOVING, self.poses, strict=True))

    def follow(
        self,
        builds: _Builds,
        free: list[int],
        limit: int,
        *,
        predicts: bool,
    ) -> None:
        """Take steps until all `builds` have converged.

        If this `predicts` errors, builds may end without a look at the forces in their last pose.
        """
        count = len(builds.number)
        previous = longest = np.zeros(count)
        moves = np.ones(count, dtype=bool)
        for n in range(limit):
            moves &= self.steps[builds.number] < limit
            builds = builds.select(moves)
            if not len(builds.number):
                break
            factors = builds.tangent_factors(free)
            now, size = _take_step(builds, factors, first=n == 0)
            for name, pose in self.moving.items():
                pose[..., builds.number] = getattr(now, name)
            self.steps[builds.number] += 1
            self.pivot[builds.number] = factors.least
            longest = np.maximum(longest[moves], size)
            last = previous[moves]
            open = np.ones(len(size), dtype=bool)
            if predicts:
                falls = np.where(last > 0, (size / last) ** 2, 1.0)
                arrived = (size * falls < LEFT * longest) & (builds.residual * falls < NEGLIGIBLE)
                open = ~arrived
                if arrived.all():
                    break
            before = builds.residual[open]
            builds = builds.moved(now, open)
            previous = size[open]
            longest = longest[open]
            moves = ~_is_done(previous, before, builds.residual)


def _residual(
    gradient: Float[np.ndarray, "moving build"], scale: Float[np.ndarray, "moving build"]
) -> Float[np.ndarray, " build"]:
    """Largest component of a gradient over its scale."""
    return np.abs(gradient / scale).max(0)


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


def _is_done(
    step: Float[np.ndarray, " build"],
    before: Float[np.ndarray, " build"],
    residual: Float[np.ndarray, " build"],
) -> Bool[np.ndarray, " build"]:
    """Whether a residual has fallen as far as rounding lets it, or is not finite."""
    no_longer_falls = (step < SHORT) & (residual > before / 2)
    converged = (step < LAST_STEP) & (residual < ROUNDED)
    return ~np.isfinite(residual) | no_longer_falls | converged


def _take_step(
    builds: _Builds, factors: Factors, *, first: bool
) -> tuple[Configuration, Float[np.ndarray, " build"]]:
    """Take a step, with the tensions predicted; also, its largest component.

    All but the `first` include how wires resist bending at these tensions.
    """
    now = builds.now
    step = _solve(factors, builds.gradient)
    step /= np.maximum(np.abs(step[6:] / builds.unit).max(0) / CAP, 1.0)
    tension = taut_string.predicted_tension(now, step)
    if builds.bent and not first:
        change = Derivatives(now, curved=False)
        bending.add_growth(now, builds.bent, tension, change)
        step += _solve(factors, change.finish().gradient[6:-1])
    return replace(now.displaced(step), tension=tension), np.abs(step).max(0)


def _solve(
    factors: Factors, gradient: Float[np.ndarray, "moving build"]
) -> Float[np.ndarray, "coordinate build"]:
    """Solve K x = -g for steps in all coordinates."""
    order = factors.pattern.order
    step = np.zeros((6 + len(gradient), gradient.shape[1]))
    step[6 + order] = factors.solve(-gradient[order, None])[:, 0]
    return step


def factorise(
    matrix: Float[np.ndarray, "moving moving build"], linked: Bool[np.ndarray, "moving moving"]
) -> Factors:
    """Factors of tangent stiffnesses, of which the lower triangles are used."""
    pattern = _pattern(linked)
    return pattern.factor(matrix[pattern.row, pattern.column], HELD)


def _pattern(linked: Bool[np.ndarray, "moving moving"]) -> Pattern:
    """Order of elimination of tangent stiffnesses.

    Coordinates are eliminated from the last to the first, tips of blades and lower bodies before
    those above, so that the factors stay as sparse as the tree of bodies. A stable equilibrium has
    positive pivots alone.
    """
    return by_body(np.arange(len(linked)), linked)


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
