"""Filters of control loops that damp all modes within a given time, with the least sensor noise.

One loop is designed at a time, with the others closed. Its plant is what lies between the force of
its actuator and the reading of its sensor, in modal coordinates, with a roll-off of second order at
the actuator. The filter is that of a linear quadratic regulator on a Kalman filter (LQG), both with
a prescribed degree of stability: with A + a 1 in place of A in both Riccati equations all poles
decay at least as exp(-a t) (Anderson and Moore, Optimal Control: Linear Quadratic Methods, 1990,
section 3.5). A search over the roll-off, the rates a, and the weights of force and of sensor noise
finds, of the filters whose sensitivity stays below a limit, the one with the least noise of one
motion at one frequency, or with the largest of the smallest margins to what the design requires.

The H-infinity filter of the same weights bounds the largest gain, not the mean square, from forces
and sensor noise to coordinates and force by gamma (Doyle, Glover, Khargonekar and Francis, IEEE
Trans. Autom. Control 34, 831 (1989), theorem 3). With X and Y of the two Riccati equations

    A' X + X A - X (B B' / r - B_1 B_1' / gamma^2) X + 1 = 0,    B_1 = 1,

and its dual, and Z = (1 - Y X / gamma^2)^-1, the filter is

    x' = (A + X / gamma^2 - B B' X / r - Z Y C' C / v) x + Z Y C' y / v,    u = -B' X x / r.

Its limit for a large gamma is the LQG filter. Next to the smallest gamma it has poles at
frequencies without bound, so gamma is a multiple of that.

Riccati solvers fail or err on unscaled equations of a pendulum. So time is in units of the mean
frequency of the modes, each mode has coordinates in which it is driven as much as it is sensed, and
force and reading have a unit gain. Modes above a frequency, and modes that the actuator hardly
reaches, are left out and counted only by their compliance; the closed loop is judged with them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.foton import Filter
from suspension_cli.design.loop_filters import make_response
from suspension_cli.errors import InputError
from suspension_cli.physics import local_control
from suspension_cli.physics.judged_filters import Judge, TriedFilter
from suspension_cli.physics.local_control import Plant
from suspension_cli.physics.modal_plants import PlantModes, ScaledPlant, open_loop
from suspension_cli.physics.optimal_filters import both_of_pairs, make_filter
from suspension_cli.physics.riccati_equations import bound_all, solve_riccati
from suspension_cli.physics.wanted_loops import Wanted, rank_margins

if TYPE_CHECKING:
    from suspension_cli.design.control import Loop
    from suspension_cli.design.schema import Design
    from suspension_cli.linear.solver import Solvable

ROLL_OFFS = np.geomspace(0.2, 4.0, 9)
"""Roll-off frequencies that are tried, over that of the highest mode that is damped."""
RATES = (1.05, 1.3, 1.7, 2.2, 3.0)
"""Decay rates that are tried, over the slowest that is allowed."""
WEIGHTS = (1e4, 1e2, 1.0)
"""Weights of the force, and of sensor noise, that are tried, over those of the coordinates."""
STARTS = 8
"""Filters, from the quietest to the loudest, of which the search for requirements starts with the
best."""
BESIDE = 0.5
"""Distance of a zero from a pole, over the decay of either, up to which both may go."""
LOUDER = 1.1
"""Factor by which the noise may rise where they go."""


@dataclass(frozen=True)
class Method:
    """A kind of optimal filter: what is tried of it.

    Attributes
    ----------
    rates
        Decay rates, over the slowest that is allowed.
    weights
        Weights of the force, and of sensor noise.
    bounds
        gamma over its smallest value.
    """

    rates: tuple[float, ...]
    weights: tuple[float, ...]
    bounds: tuple[float, ...] = (math.inf,)


METHODS = {
    "lqg": Method(RATES, WEIGHTS),
    # the same without the prescribed decay, which weights alone have to bring
    "h2": Method((0.0,), tuple(10.0**power for power in range(2, -7, -1))),
    "hinf": Method((1.05, 2.0), WEIGHTS, (1.2, 2.0)),
}
"""Kinds of optimal filters by name."""


@dataclass(frozen=True)
class OptimalLoop:
    """A filter that was found, and its closed loop with all modes and constant losses.

    Attributes
    ----------
    loop
        Name of the loop.
    filter
        H from reading to force, u = -H y.
    settling
        Longest time of a mode that is damped, s.
    sensitivity
        Largest magnitude of the sensitivity.
    noise
        Motion of the output over motion that the sensor reports falsely, at the frequency wanted.
    roll_off
        Frequency of its roll-off, Hz.
    left_out
        Frequencies of modes below the highest that the actuator hardly reaches, Hz.
    """

    loop: str
    filter: Filter
    settling: float
    sensitivity: float
    noise: float
    roll_off: float
    left_out: tuple[float, ...]


def solve(
    design: Design, system: Solvable, number: int, wanted: Wanted, method: str = "lqg"
) -> OptimalLoop:
    """Find the filter of one loop of a design, by its number, with the other loops closed.

    `method` is one of `METHODS`. Raises `InputError` if the loop reads or feeds the filter of a
    named sensor, if it reaches no mode, or if no filter that was tried does what is wanted.
    """
    plant = local_control.build_plant(design, system)
    name = plant.loops[number].name
    _demand_alone(plant, number)
    opened = open_loop(plant, number, wanted.output)
    modes = PlantModes.of(opened, wanted)
    if not modes.kept.any():
        problem = f"reaches no mode below {wanted.highest:g} Hz"
        raise InputError.of(f"control.loop.{name}", problem, "raise --highest, or move the loop")
    heard = _evaluate_reading(plant.loops[number], wanted.quiet_at)
    judge = Judge.of(opened, modes, wanted, heard)
    tried = sorted(
        _try_all(ScaledPlant.of(modes), judge, wanted, METHODS[method]), key=lambda one: one.noise
    )
    best = _find_best(tried, judge, wanted)
    if best is None:
        raise _describe_failure(name, tried, judge, modes, wanted)
    best = _without_pairs(best, judge, wanted)
    closed = judge.close(best)
    assert closed is not None
    left_out = tuple(np.sort(modes.frequency[modes.weak]).tolist())
    return OptimalLoop(name, best.filter, *closed, best.noise, best.roll_off, left_out)


def _find_best(tried: Sequence[TriedFilter], judge: Judge, wanted: Wanted) -> TriedFilter | None:
    """Find the best of the filters that do what is wanted; they are given in order of noise.

    Without requirements it is the quietest one. With them it is the one with the largest of the
    smallest margins, to which a search goes from neighbour to neighbour in the table of numbers
    that were tried.
    """
    if wanted.margins is None:
        return next((one for one in tried if judge.accepts(one, wanted)), None)
    good = [one for one in tried if judge.accepts(one, wanted)]
    if not good:
        return None
    known: dict[tuple[int, ...], list[float]] = {}

    def rank(one: TriedFilter) -> list[float]:
        """Margins in steps of `SMALL`, the smallest first: at equal ones the next one counts."""
        if one.place not in known:
            known[one.place] = rank_margins(wanted, one.filter)
        return known[one.place]

    spread = np.unique(np.linspace(0, len(good) - 1, STARTS).round().astype(int))
    best = max((good[n] for n in spread), key=rank)
    while True:
        beside = [one for one in good if _are_neighbours(one.place, best.place)]
        better = max([best, *beside], key=rank)
        if better is best:
            return best
        best = better


def _are_neighbours(one: tuple[int, ...], other: tuple[int, ...]) -> bool:
    """Whether two places in the table of what is tried differ by one step of one number."""
    return sum(abs(a - b) for a, b in zip(one, other, strict=True)) == 1


def _describe_failure(
    name: str, tried: Sequence[TriedFilter], judge: Judge, modes: PlantModes, wanted: Wanted
) -> InputError:
    """Describe that no filter does what is wanted."""
    problem = (
        f"no filter was found that settles within {wanted.settling:g} s with a sensitivity below"
        f" {wanted.sensitivity:g}"
    )
    closed = (judge.close(one) for one in tried)
    nearest = next((one for one in closed if one is not None), None)
    if nearest is not None:
        problem += f" (the quietest: {nearest[0]:.3g} s, {nearest[1]:.3g})"
    else:
        hardest = modes.frequency[modes.find_hardest(1 / wanted.settling)]
        problem += f"; the mode at {hardest:.4g} Hz asks for most force"
    remedy = "allow a longer --settling or a larger --sensitivity, or a lower --highest"
    return InputError.of(f"control.loop.{name}", problem, remedy)


def _evaluate_reading(loop: Loop, frequency: float) -> complex:
    """Evaluate the response of the own sensor of a loop at a frequency in Hz."""
    given = loop.sensor_response
    return 1.0 + 0j if given is None else complex(make_response(given).at(frequency))


def _demand_alone(plant: Plant, number: int) -> None:
    """Raise `InputError` for a loop that reads, or feeds, the filter of a named sensor."""
    reads = plant.network.of_nodes
    if reads[number].any() or reads[:, number].any():
        name = plant.loops[number].name
        problem = "reads or feeds a sensor that is computed, or that has a response"
        remedy = "design a loop that reads motions, with sensor_response of its own"
        raise InputError.of(f"control.loop.{name}", problem, remedy)


def _without_pairs(one: TriedFilter, judge: Judge, wanted: Wanted) -> TriedFilter:
    """Remove poles that have a zero beside them, while the closed loop does what is wanted.

    The noise may rise by the factor `LOUDER`; margins to requirements may not become smaller.
    """
    best = one
    rank = [] if wanted.margins is None else rank_margins(wanted, one.filter)
    for pole in sorted(_upper(one.filter.poles), key=lambda root: _distance(root, one.filter)):
        zeros = _upper(best.filter.zeros)
        alike = [zero for zero in zeros if bool(zero.imag) == bool(pole.imag)]
        if not alike:
            continue
        zero = min(alike, key=lambda root: abs(root - pole))
        if abs(zero - pole) > BESIDE * max(abs(pole.real), abs(zero.real)):
            continue
        poles = [root for root in _upper(best.filter.poles) if root != pole]
        zeros.remove(zero)
        shorter = Filter(best.filter.gain, both_of_pairs(zeros), both_of_pairs(poles))
        peak, noise = judge.rate(shorter)
        tried = replace(best, filter=shorter, noise=noise)
        if peak > wanted.sensitivity or not judge.accepts(tried, wanted):
            continue
        if wanted.margins is None:
            kept = noise <= LOUDER * one.noise
        else:
            kept = rank_margins(wanted, shorter) >= rank
        if kept:
            best = tried
    return best


def _upper(roots: tuple[complex, ...]) -> list[complex]:
    """One root of each pair."""
    return [root for root in roots if root.imag >= 0]


def _distance(pole: complex, made: Filter) -> float:
    """Distance of a pole from the zero nearest to it, over its decay."""
    nearest = min((abs(zero - pole) for zero in made.zeros), default=np.inf)
    return nearest / max(abs(pole.real), 1e-300)


def _try_all(
    scaled: ScaledPlant, judge: Judge, wanted: Wanted, method: Method
) -> Iterator[TriedFilter]:
    """Find filters with all roll-offs, rates and weights, that may do what is wanted."""
    weights = method.weights
    pairs = list(product(range(len(weights)), repeat=2))
    for (i, ratio), (j, rate) in product(enumerate(ROLL_OFFS), enumerate(method.rates)):
        roll_off = float(ratio * judge.highest_mode)
        plant = scaled.with_roll_off(roll_off)
        shift = rate / wanted.settling * scaled.unit
        shifted = replace(plant, a=plant.a + shift * np.eye(len(plant.a)))
        regulators = [solve_riccati(shifted.a, shifted.b, weight) for weight in weights]
        filters = [solve_riccati(shifted.a.T, shifted.c, weight) for weight in weights]
        for k, m in pairs:
            x, y = regulators[k], filters[m]
            if x is None or y is None:
                continue
            own = weights[k], weights[m]
            for n, solution in enumerate(bound_all(shifted, x, y, own, method.bounds)):
                if solution is None:
                    continue
                made = make_filter(plant, solution, own, roll_off)
                if made is None:
                    continue
                peak, noise = judge.rate(made)
                if peak <= wanted.sensitivity:
                    yield TriedFilter(made, roll_off, noise, (i, j, k, m, n))
