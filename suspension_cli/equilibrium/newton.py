"""Newton's method for the poses of builds, many at once.

A step solves K x = -g with the factors of the tangent stiffness; close to the pose these are used
again. The geometric stiffness of a wire, and its resistance to bending, are those at the tension
that the step before predicted to first order: the tension in the pose contains its stiffness times
squares of that step (Magisano, Leonetti and Garcea, Comput. Methods Appl. Mech. Eng. 313, 986
(2017)). The first step of imperfect builds is taken with the factors of the nominal design.

Builds are solved in chunks that fit into the cache of a processor, and leave a chunk when they have
converged. The result of a build depends on the others in its chunk by rounding alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.elements import string
from suspension_cli.elements.configuration import Configuration, SceneArrays
from suspension_cli.elimination import Factors, by_body
from suspension_cli.equilibrium.energy import derivatives
from suspension_cli.equilibrium.free_rotations import free_rotations, single_point_stages
from suspension_cli.equilibrium.residual_scale import (
    ROUNDINGS,
    largest_lever_arm,
    residual_scale,
)
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
"""Step (m or rad) after which the error is below 1e-12, as each step is at least 30 times shorter
than the one before."""
SHORT = 1e-8
"""Step (m or rad) after which a residual that does not fall any more is due to rounding."""
NEAR = 1e-6
"""Residual (relative to the weight) below which factors are used again: a step then changes the
stiffness by so little that the next residual is some 1e3 times smaller."""
HELD = 1e-14
"""Pivot over the stiffness of its coordinate below which it is a rounding error: the coordinate has
no stiffness of its own, and is held."""
CAP = 0.3
"""Longest step in rad, and in units of the largest lever arm."""
BUILDS, NUMBERS = 512, 1 << 22
"""Most builds in a chunk, and most numbers in their matrices."""


def chunks(count: int, size: int) -> list[slice]:
    """Chunks of builds with matrices of `size` rows."""
    step = max(1, min(BUILDS, NUMBERS // size**2))
    return [slice(start, min(start + step, count)) for start in range(0, max(count, 1), step)]


@dataclass(frozen=True)
class Search:
    """Where to search, and how long.

    Attributes
    ----------
    numbering
        Of the coordinates.
    start
        Pose.
    target
        Gradient to reach, N and N m.
    steps
        Most steps.
    accept_nominal
        Whether to leave a nominal pose that balances as it is.
    """

    numbering: Layout
    start: Pose
    target: Float[np.ndarray, "*batch coordinate"] | float
    steps: int
    accept_nominal: bool


@dataclass(frozen=True)
class Found:
    """Poses of the builds of a chunk, see `Equilibrium`; builds come last."""

    now: Configuration
    residual: Float[np.ndarray, " build"]
    rounding: Float[np.ndarray, " build"]
    pivot: Float[np.ndarray, " build"]
    steps: Int[np.ndarray, " build"]


@np.errstate(all="ignore")
def search(scene: Scene, rows: slice, wanted: Search) -> Found:
    """Search for the poses of the builds `rows` of a scene."""
    count, numbering = rows.stop - rows.start, wanted.numbering
    arrays = replace(SceneArrays.of(scene, numbering, rows, count), follows=True)
    now = Configuration.of(arrays, wanted.start, scene.batch, rows)
    moving = [np.array(getattr(now, name)) for name in MOVING]
    begin = _State.at(now, wanted, rows)
    residual, steps = begin.residual.copy(), np.zeros(count, dtype=int)
    pivot = np.full(count, np.nan)
    left = np.arange(count)
    if wanted.accept_nominal and (residual <= BALANCED).any():
        as_drawn = (residual <= BALANCED) & _is_as_drawn(scene, rows, now, begin.gradient)
        left = np.flatnonzero(~as_drawn)
    queue = [begin.select(left)]
    while queue:
        state = queue.pop()
        while len(state.builds) and state.steps < wanted.steps:
            done = state.advance()
            done |= state.steps == wanted.steps
            which = state.builds[done]
            for whole, name in zip(moving, MOVING, strict=True):
                whole[..., which] = getattr(state.now, name)[..., done]
            residual[which], steps[which] = state.residual[done], state.steps
            pivot[which] = state.least_pivot[done]
            near = ~done & (state.residual < NEAR) & (not state.is_near and state.steps > 1)
            # a few builds cost as much time in two groups as in one full step more
            if 2 * near.sum() > len(near):
                queue.append(replace(state.select(np.flatnonzero(near)), is_near=True))
                done |= near
            state = state.select(np.flatnonzero(~done))
    now = Configuration(arrays, *moving)
    rounding = np.where(steps > 0, _rounding(now, begin.scale), 0.0)
    return Found(now, residual, rounding, pivot, steps)


MOVING = ("shift", "turn", "deflection")
"""Arrays of a configuration that change with the pose."""


@dataclass
class _State:
    """Builds on their way.

    Attributes
    ----------
    builds
        Their numbers in the chunk.
    now, target, scale, unit
        Configuration, with the tensions that the last step predicted; gradient to reach, scale of
        the residual, and unit of each coordinate.
    residual, gradient
        Largest residual, and what is left to the target.
    factors
        Of the tangent stiffness.
    is_near
        Whether to use the factors again, as long as the residual falls.
    """

    builds: Int[np.ndarray, " build"]
    now: Configuration
    target: Float[np.ndarray, " moving #build"]
    scale: Float[np.ndarray, "moving build"]
    unit: Float[np.ndarray, "moving build"]
    stages: list[tuple[int, int]]
    gradient: Float[np.ndarray, "moving build"]
    residual: Float[np.ndarray, " build"]
    factors: Factors | None = None
    is_near: bool = False
    is_slow: bool = False
    steps: int = 0

    @classmethod
    def at(cls, now: Configuration, wanted: Search, rows: slice) -> _State:
        """All builds of a chunk at the start."""
        arrays, target = now.arrays, np.zeros((1, 1))
        if isinstance(wanted.target, np.ndarray):
            target = wanted.target.reshape(-1, wanted.target.shape[-1])[:, 6:]
            target = (target if len(target) == 1 else target[rows]).T
        rotations = [name.endswith((".roll", ".pitch", ".yaw")) for name in wanted.numbering.name]
        unit = np.where(np.array(rotations[6:])[:, None], 1.0, largest_lever_arm(arrays))
        scale, builds = residual_scale(arrays), np.arange(arrays.count)
        stages, none = single_point_stages(arrays.scene), np.zeros(0)
        state = cls(builds, now, target, scale, unit, stages, none, none)
        state._evaluate()
        if wanted.accept_nominal and arrays.scene.drawn is not None and arrays.count:
            state.factors = state._nominal_factors(arrays.scene.drawn, rows)
        return state

    @property
    def least_pivot(self) -> Float[np.ndarray, " build"]:
        """Least pivot of the tangent stiffness with which the last step was taken."""
        least = np.nan if self.factors is None else self.factors.least
        return np.broadcast_to(least, self.residual.shape)

    def _nominal_factors(self, drawn: Scene, rows: slice) -> Factors:
        """Factors of the nominal design, with which all builds take their first step."""
        first = slice(rows.start, rows.start + 1)
        arrays = SceneArrays.of(drawn, self.now.arrays.numbering, first, 1)
        now = replace(self.now.select(np.zeros(1, dtype=int)), arrays=arrays)
        return replace(self, now=now, scale=self.scale[:, :1])._factorise()

    def select(self, which: Int[np.ndarray, " build"]) -> _State:
        """Some of the builds."""
        if len(which) == len(self.builds):
            return replace(self)
        names = ("builds", "scale", "unit", "gradient", "residual")
        parts: dict[str, Any] = {name: getattr(self, name)[..., which] for name in names}
        target = self.target if self.target.shape[-1] == 1 else self.target[:, which]
        factors = None if self.factors is None else self.factors.select(which)
        now = self.now.select(which)
        return replace(self, now=now, target=target, factors=factors, **parts)

    def advance(self) -> Bool[np.ndarray, " build"]:
        """Take a step; also, which builds have converged (or are lost)."""
        again = self.is_near and not self.is_slow
        if self.factors is None or (self.steps and not again):
            self.factors = self._factorise()
        order, step = self.factors.pattern.order, np.empty_like(self.gradient)
        step[order] = self.factors.solve(-self.gradient[order, None])[:, 0]
        if self.stages:
            step = self._without_free_rotations(step)
        step /= np.maximum(np.abs(step / self.unit).max(0) / CAP, 1.0)
        whole = np.concatenate([np.zeros((6, step.shape[1])), step])
        tension = string.predicted_tension(self.now, whole)
        self.now, before = replace(self.now.displaced(whole), tension=tension), self.residual
        self._evaluate()
        self.steps += 1
        size, lost = np.abs(step).max(0), ~np.isfinite(self.residual)
        # as far as rounding lets the residual fall
        stagnant = (size < SHORT) & (self.residual > before / 2)
        done = lost | stagnant | (size < LAST_STEP) & (self.residual < ROUNDED)
        self.is_slow = bool((~done & (self.residual > before / 30)).any())
        return done

    def _evaluate(self) -> None:
        self.gradient = derivatives(self.now, curved=False).gradient[6:-1] - self.target
        self.residual = np.abs(self.gradient / self.scale).max(0)

    def _factorise(self) -> Factors:
        """Factors of K; coordinates of free rotations, to which g is orthogonal, are stiffened."""
        made = derivatives(self.now)
        matrix, linked = made.hessian[6:-1, 6:-1], made.linked[6:-1, 6:-1]
        if self.stages:
            stiff = (np.einsum("iip->ip", matrix) / self.scale).max(0)
            for _, load in self._free_rotations():
                matrix = matrix + stiff * load[:, None] * load
                moved = (load != 0).any(-1)
                linked = linked | (moved[:, None] & moved)
        return factorise(matrix, linked)

    def _free_rotations(
        self,
    ) -> list[tuple[Float[np.ndarray, "moving build"], Float[np.ndarray, "moving build"]]]:
        """Motion in each free rotation and its product with the scale, which is normalised."""
        free = free_rotations(self.now, self.stages)
        free = free / np.sqrt((free**2 * self.scale[:, None]).sum(0))
        return [(own, own * self.scale) for own in free.swapaxes(0, 1)]

    def _without_free_rotations(
        self, step: Float[np.ndarray, "moving build"]
    ) -> Float[np.ndarray, "moving build"]:
        for free, load in self._free_rotations():
            step = step - free * (load * step).sum(0)
        return step


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
    turn, shift = np.abs(now.turn).max((0, 1)), np.abs(now.shift).max(0)
    ends = ((wires.upper, wires.upper_point), (wires.lower, wires.lower_point))
    motion = sum(shift[body] + turn[body] * np.abs(point).max(0) for body, point in ends)
    force = ROUNDINGS * np.finfo(float).eps * (np.abs(now.wires.tension) + wires.stiffness * motion)
    return (force / scale[6 * (wires.lower - 1)]).max(0)
