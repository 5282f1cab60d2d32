"""Starts of a search for gains of loops: velocity damping by modal decomposition.

A mode of unit modal mass, frequency omega and shape v, in which loops push by p.v and read s.v,
moves by

    q'' + (omega^2 + k) q = 0,    k = sum over loops of (p.v) H(omega) (s.v),

so to first order in H its quality factor is Q = omega^2 / Im k. For a mass m with a velocity damper
c in its own loop, v = 1/sqrt(m) and H = i omega c: Q = m omega / c.

1/Q of all modes are linear in the gains g of the loops. For a chosen Q the gains follow from linear
least squares between their bounds,

    minimise the sum over modes of (Q Im k(g) / omega^2 - 1)^2,

in which modes that the actuators hardly reach hardly count. Of several Q the start is the one that
violates the goals least.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.optimise.evaluator import Evaluator
from suspension_cli.analyses.optimise.search import FEASIBLE, Point, Search
from suspension_cli.physics import local_control
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.solved import Solved, of_designs

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.design.schema import Design

QUALITY_FACTORS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
"""Quality factors of modes that are tried."""
SCALES_A_LOOP = re.compile(r"control\.loop\..+\.(gain|damper|magnitude)")
"""Numbers that are factors of the filter of a loop."""
APART = (0.5, 1.0)
"""Fractions of the range of a number between which the slope of 1/Q is taken."""


@dataclass(frozen=True)
class DampedStart:
    """A design whose loops give the modes a chosen quality factor, and that factor."""

    point: Point
    quality_factor: float


@dataclass(frozen=True)
class ModalDamping:
    """1/Q that loops give the modes of a design, as a linear function of gains.

    Attributes
    ----------
    begin
        1/Q with the gains at their lower bounds.
    range
        Change of 1/Q by each gain over the range between its bounds.
    """

    begin: Float[np.ndarray, " mode"]
    range: Float[np.ndarray, "mode gain"]

    @staticmethod
    def of(evaluator: Evaluator, gains: list[int]) -> ModalDamping | None:
        """Decompose a design into modes; `gains` are free numbers, None without an equilibrium."""
        freed = evaluator.freed
        start = freed.design(freed.begin)
        parts = of_designs([start], evaluator.level, Needs(), allow_unstable=True)
        solved = next((part for _, part in parts), None)
        if solved is None or not solved.hangs.all():
            return None
        lower, upper = freed.bounds[:, gains]
        span = upper - lower
        slope = []
        for number in gains:
            values = np.repeat(freed.begin[None], len(APART), axis=0)
            values[:, number] = APART
            low, high = (invert_quality_factors(solved, freed.design(one)) for one in values)
            names = [item.name for item in freed.goals.free]
            least, most = (freed.values(one)[names[number]] for one in values)
            slope.append((high - low) / (most - least))
        by_range = np.array(slope).T * span
        away = (freed.start[gains] - lower) / span
        return ModalDamping(invert_quality_factors(solved, start) - by_range @ away, by_range)

    def solve(self, quality_factor: float) -> Float[np.ndarray, " gain"]:
        """Gains, as fractions of their ranges, with which the modes have a quality factor."""
        from scipy.optimize import lsq_linear

        matrix = quality_factor * self.range
        wanted = 1 - quality_factor * self.begin
        return lsq_linear(matrix, wanted, (0.0, 1.0), method="bvls").x


def invert_quality_factors(solved: Solved, design: Design) -> Float[np.ndarray, " mode"]:
    """1/Q that the loops of a design give the modes of its mechanics, to first order."""
    plant = local_control.build_plant(design, solved.solver(0))
    squared = solved.spectrum.omega_squared[0]
    oscillates = squared > 0
    shape = solved.spectrum.motion[0, oscillates]
    read = shape @ plant.sensed.T
    pushed = shape @ plant.pushed.T
    hertz = np.sqrt(squared[oscillates]) / (2 * np.pi)
    feedback = np.einsum("ml,mlc,mc->m", pushed, plant.network.controllers(hertz), read)
    return np.imag(feedback) / squared[oscillates]


def find_start(search: Search, own: Point | None) -> DampedStart | None:
    """Find gains by velocity damping, where goals of loops are not met by the file's own numbers.

    `own` is the design of the file, None if it has no value of a goal. Returns None if the goals
    are met, do not concern loops or leave no gain free, or if the loops damp nothing.
    """
    if (own is not None and own.worst <= FEASIBLE) or not concerns_loops(search.evaluator):
        return None
    freed = search.freed
    gains = find_gains(search.evaluator)
    damping = ModalDamping.of(search.evaluator, gains)
    if damping is None or not damping.range.any():
        return None
    lower, upper = freed.bounds[:, gains]
    fractions = []
    for quality_factor in QUALITY_FACTORS:
        values = freed.start.copy()
        values[gains] = lower + (upper - lower) * damping.solve(quality_factor)
        fractions.append(freed.fractions(values))
    values = search.evaluator.values(np.array(fractions))
    judged = map(search.judge, fractions, values)
    known = [
        DampedStart(point, quality_factor)
        for point, quality_factor in zip(judged, QUALITY_FACTORS, strict=True)
        if point is not None
    ]
    return min(known, key=lambda one: one.point.rank, default=None)


def concerns_loops(evaluator: Evaluator) -> bool:
    """Whether goals concern loops, whose gains are free."""
    targets = evaluator.targets.target
    return any(one.quantity.of_loops for one in targets) and bool(find_gains(evaluator))


def find_gains(evaluator: Evaluator) -> list[int]:
    """Numbers, among the free ones, that are factors of the filters of loops."""
    free = evaluator.freed.goals.free
    return [n for n, item in enumerate(free) if SCALES_A_LOOP.fullmatch(item.name)]
