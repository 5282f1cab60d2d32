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
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design.foton import Filter
from suspension_cli.design.loop_filters import make_response
from suspension_cli.errors import InputError
from suspension_cli.linear import signals
from suspension_cli.linear.joined_systems import Matrices, side_by_side
from suspension_cli.linear.statespace import StateSpace, with_constant_loss
from suspension_cli.physics import closed_loop, local_control
from suspension_cli.physics.local_control import Plant

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float

    from suspension_cli.design.control import Loop
    from suspension_cli.design.schema import Design
    from suspension_cli.linear.solver import Solvable

ROLL_OFFS = np.geomspace(0.2, 4.0, 9)
"""Roll-off frequencies that are tried, over that of the highest mode that is damped."""
RATES = (1.05, 1.3, 1.7, 2.2, 3.0)
"""Decay rates that are tried, over the slowest that is allowed."""
WEIGHTS = (1e4, 1e2, 1.0)
"""Weights of the force, and of sensor noise, that are tried, over those of the coordinates."""
CLOSER = 1.1
"""Ratio of two bounds gamma, of which one is possible and one is not, that ends their bisection."""
RIGHT = 1e-8
"""Largest relative residual of a solution of a Riccati equation."""
REACHED = 1e-4
"""Strength of a mode between force and reading, over that of the strongest, from which it is damped
unless another limit is given."""
UNTOUCHED = 1e-12
"""The same of a mode of another symmetry, by rounding errors."""
STILL = 1e-9
"""Growth over frequency up to which a pole without loss grows by rounding errors."""
POINTS = 600
"""Frequencies of a logarithmic grid for the sensitivity; others are around the modes."""
WIDTHS = (-10.0, -3.0, -1.0, -0.3, 0.0, 0.3, 1.0, 3.0, 10.0)
"""Distances from modes, in widths of these."""
LARGEST = 1e4
"""Largest gamma that is tried, over a lower limit of it."""
STARTS = 8
"""Filters, from the quietest to the loudest, of which the search for requirements starts with the
best."""
SMALL = 0.01
"""Difference of two margins to requirements that is none."""
BESIDE = 0.5
"""Distance of a zero from a pole, over the decay of either, up to which both may go."""
LOUDER = 1.1
"""Factor by which the noise may rise where they go."""
DIGITS = 9
"""Significant digits of zeros and poles."""


@dataclass(frozen=True)
class Wanted:
    """What a loop has to do.

    Attributes
    ----------
    settling
        Longest time in which the amplitude of a mode falls to 1/e, s.
    sensitivity
        Largest magnitude of the sensitivity.
    output
        Motion whose noise from the sensor is to be least.
    quiet_at
        Frequency of that noise, Hz.
    highest
        Frequency up to which modes are damped, Hz.
    reached
        Strength of a mode, over that of the strongest, from which it is damped.
    margins
        Computes the margins to all that the design requires, of a filter; these count instead of
        the noise.
    """

    settling: float
    sensitivity: float
    output: str
    quiet_at: float
    highest: float
    reached: float = REACHED
    margins: Callable[[Filter], Sequence[float]] | None = None


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
    opened = _open(plant, number, wanted.output)
    modes = _Modes.of(opened, wanted)
    if not modes.kept.any():
        problem = f"reaches no mode below {wanted.highest:g} Hz"
        raise InputError.of(f"control.loop.{name}", problem, "raise --highest, or move the loop")
    heard = _evaluate_reading(plant.loops[number], wanted.quiet_at)
    judge = _Judge.of(opened, modes, wanted, heard)
    tried = sorted(
        _try_all(_Scaled.of(modes), judge, wanted, METHODS[method]), key=lambda one: one.noise
    )
    best = _find_best(tried, judge, wanted)
    if best is None:
        raise _describe_failure(name, tried, judge, modes, wanted)
    best = _without_pairs(best, judge, wanted)
    closed = judge.close(best)
    assert closed is not None
    left_out = tuple(np.sort(modes.frequency[modes.weak]).tolist())
    return OptimalLoop(name, best.filter, *closed, best.noise, best.roll_off, left_out)


def _find_best(tried: Sequence[_Tried], judge: _Judge, wanted: Wanted) -> _Tried | None:
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

    def rank(one: _Tried) -> list[float]:
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


def rank_margins(wanted: Wanted, made: Filter) -> list[float]:
    """Sort the margins of a filter to what is required, the smallest first, in steps of `SMALL`."""
    assert wanted.margins is not None
    steps = np.round(np.array(wanted.margins(made)) / SMALL)
    return np.sort(SMALL * steps).tolist()


def _are_neighbours(one: tuple[int, ...], other: tuple[int, ...]) -> bool:
    """Whether two places in the table of what is tried differ by one step of one number."""
    return sum(abs(a - b) for a, b in zip(one, other, strict=True)) == 1


def _describe_failure(
    name: str, tried: Sequence[_Tried], judge: _Judge, modes: _Modes, wanted: Wanted
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


def _open(plant: Plant, number: int, output: str) -> StateSpace:
    """Build the system from the force of a loop to its reading and to the output.

    The other loops are closed; the reading is that behind the loop's delay and sensor response.
    """
    model = with_constant_loss(plant.model)
    known = signals.bodies_with_signals(model)
    observed = signals.parse_output(output, known)
    others = [n for n in range(len(plant.network.nodes)) if n != number]
    rows = np.array([plant.node_sensed[number], signals.linear_form(observed, model)])
    rest = plant.with_model(model).select(others)
    pushed = plant.pushed[number][None]
    made = closed_loop.close_loops(rest, [closed_loop.LOOP], pushed, [closed_loop.LOOP] * 2, rows)
    loop = plant.loops[number]
    reading = closed_loop.realise_reading(loop)
    behind = [Matrices(reading.A, reading.B, reading.C, reading.D), Matrices.unchanged()]
    whole = Matrices(made.a, made.b, made.c, made.d).then(side_by_side(behind))
    states = len(reading.A)
    names = (*made.state, *(f"loop {loop.name} {n}" for n in range(1, states + 1)))
    units = (*made.state_unit, *["1"] * states)
    return replace(made, a=whole.a, b=whole.b, c=whole.c, d=whole.d, state=names, state_unit=units)


@dataclass(frozen=True)
class _Modes:
    """Poles of a plant, one of each pair, with what drives each and what it adds to the reading.

    Attributes
    ----------
    value
        Poles, rad/s.
    driven, sensed
        In the coordinate z of each, z' = value z + driven u; the reading is 2 Re(sensed z) of a
        pair, sensed z of a real pole.
    kept, weak
        Modes that are damped, and those below the highest that are hardly reached.
    """

    value: Complex[np.ndarray, " mode"]
    driven: Complex[np.ndarray, " mode"]
    sensed: Complex[np.ndarray, " mode"]
    kept: Bool[np.ndarray, " mode"]
    weak: Bool[np.ndarray, " mode"]

    @staticmethod
    def of(opened: StateSpace, wanted: Wanted) -> _Modes:
        """Find the modes of a plant; those up to a frequency that are reached are kept."""
        own = opened.balanced()
        every, shapes = np.linalg.eig(own.a)
        driven = np.linalg.solve(shapes, own.b.astype(complex))[:, 0]
        sensed = own.c[0] @ shapes
        one = np.imag(every) >= 0
        value = every[one]
        size = np.abs(driven[one] * sensed[one]) / np.maximum(np.abs(value), 1e-300)
        low = np.abs(value) <= 2 * np.pi * wanted.highest
        reached = size > wanted.reached * size.max(initial=0.0)
        weak = low & ~reached & (size > UNTOUCHED * size.max(initial=0.0))
        return _Modes(value, driven[one], sensed[one], low & reached, weak)

    @property
    def frequency(self) -> Float[np.ndarray, " mode"]:
        """Frequencies, Hz."""
        return np.abs(self.value) / (2 * np.pi)

    def find_hardest(self, rate: float) -> int:
        """Number of the mode that asks for most force to decay at a rate (1/s).

        A weak filter of gain g moves a pole by g driven sensed, to first order.
        """
        kept = np.flatnonzero(self.kept)
        missing = np.maximum(rate + np.real(self.value[kept]), 0.0)
        force = missing / np.abs(self.driven[kept] * self.sensed[kept])
        return int(kept[force.argmax()])

    @property
    def compliance_left(self) -> float:
        """Static response of the modes that are left out."""
        left = -self.driven * self.sensed / self.value
        twice = np.where(np.imag(self.value) > 0, 2.0, 1.0)
        return float(np.real(left * twice)[~self.kept].sum())


@dataclass(frozen=True)
class _Scaled:
    """The modes that are damped, as a scaled system: real blocks, unit time, force and reading.

    `unit` is its unit of time, s; `gain` the response that 1 stands for; `through` what the modes
    that are left out add.
    """

    a: Float[np.ndarray, "state state"]
    b: Float[np.ndarray, " state"]
    c: Float[np.ndarray, " state"]
    through: float
    unit: float
    gain: float

    @staticmethod
    def of(modes: _Modes) -> _Scaled:
        """Scale the modes that are kept."""
        value = modes.value[modes.kept]
        driven = modes.driven[modes.kept]
        sensed = modes.sensed[modes.kept]
        unit = float(1 / np.exp(np.log(np.abs(value)).mean()))
        blocks = []
        forces = []
        readings = []
        for pole, force, reading in zip(value * unit, driven * unit, sensed, strict=True):
            # as strongly driven as sensed
            size = np.sqrt(np.abs(reading) / np.abs(force))
            drive = force * size
            sense = reading / size
            if pole.imag:
                blocks.append([[pole.real, -pole.imag], [pole.imag, pole.real]])
                forces += [drive.real, drive.imag]
                readings += [2 * sense.real, -2 * sense.imag]
            else:
                blocks.append([[pole.real]])
                forces.append(drive.real)
                readings.append(sense.real)
        from scipy.linalg import block_diag

        b = np.array(forces)
        c = np.array(readings)
        of_force = np.abs(b).max()
        of_reading = np.abs(c).max()
        gain = float(of_force * of_reading)
        a = np.asarray(block_diag(*blocks))
        return _Scaled(a, b / of_force, c / of_reading, modes.compliance_left / gain, unit, gain)

    def with_roll_off(self, frequency: float) -> _Scaled:
        """Put a Butterworth low-pass of second order, at a frequency in Hz, before the force."""
        corner = 2 * np.pi * frequency * self.unit
        count = len(self.a)
        a = np.zeros((count + 2, count + 2))
        a[:count, :count] = self.a
        a[:count, count] = self.b
        a[count, count + 1] = corner
        a[count + 1, count] = -corner
        a[count + 1, count + 1] = -np.sqrt(2) * corner
        b = np.zeros(count + 2)
        b[-1] = corner
        c = np.append(self.c, [self.through, 0.0])
        return replace(self, a=a, b=b, c=c, through=0.0)


@dataclass(frozen=True)
class _Tried:
    """A filter, the frequency of its roll-off (Hz), and its noise (see `OptimalLoop`).

    `place` are the numbers of roll-off, rate, weights and bound in the table of what is tried.
    """

    filter: Filter
    roll_off: float
    noise: float
    place: tuple[int, ...]


def _without_pairs(one: _Tried, judge: _Judge, wanted: Wanted) -> _Tried:
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
        shorter = Filter(best.filter.gain, _both(zeros), _both(poles))
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


def _both(roots: list[complex]) -> tuple[complex, ...]:
    """Both roots of each pair."""
    pairs = ((root, root.conjugate()) if root.imag else (root,) for root in roots)
    return tuple(root for pair in pairs for root in pair)


def _distance(pole: complex, made: Filter) -> float:
    """Distance of a pole from the zero nearest to it, over its decay."""
    nearest = min((abs(zero - pole) for zero in made.zeros), default=np.inf)
    return nearest / max(abs(pole.real), 1e-300)


def _try_all(scaled: _Scaled, judge: _Judge, wanted: Wanted, method: Method) -> Iterator[_Tried]:
    """Find filters with all roll-offs, rates and weights, that may do what is wanted."""
    weights = method.weights
    pairs = list(product(range(len(weights)), repeat=2))
    for (i, ratio), (j, rate) in product(enumerate(ROLL_OFFS), enumerate(method.rates)):
        roll_off = float(ratio * judge.highest_mode)
        plant = scaled.with_roll_off(roll_off)
        shift = rate / wanted.settling * scaled.unit
        shifted = replace(plant, a=plant.a + shift * np.eye(len(plant.a)))
        regulators = [_solve_riccati(shifted.a, shifted.b, weight) for weight in weights]
        filters = [_solve_riccati(shifted.a.T, shifted.c, weight) for weight in weights]
        for k, m in pairs:
            x, y = regulators[k], filters[m]
            if x is None or y is None:
                continue
            own = weights[k], weights[m]
            for n, solution in enumerate(_bound_all(shifted, x, y, own, method.bounds)):
                if solution is None:
                    continue
                made = _make_filter(plant, solution, own, roll_off)
                if made is None:
                    continue
                peak, noise = judge.rate(made)
                if peak <= wanted.sensitivity:
                    yield _Tried(made, roll_off, noise, (i, j, k, m, n))


@dataclass(frozen=True)
class _Riccati:
    """Solutions X and Y of both Riccati equations for a bound gamma."""

    x: Float[np.ndarray, "state state"]
    y: Float[np.ndarray, "state state"]
    bound: float


def _bound_all(
    plant: _Scaled,
    x: Float[np.ndarray, "state state"],
    y: Float[np.ndarray, "state state"],
    weights: tuple[float, float],
    bounds: Sequence[float],
) -> Iterator[_Riccati | None]:
    """Solve for each gamma, over the smallest possible one, from X and Y without a bound."""
    if list(bounds) == [math.inf]:
        yield _Riccati(x, y, math.inf)
        return
    smallest = _find_smallest_bound(plant, x, y, weights)
    for ratio in bounds:
        yield None if smallest is None else _solve_bounded(plant, weights, ratio * smallest)


def _find_smallest_bound(
    plant: _Scaled,
    x: Float[np.ndarray, "state state"],
    y: Float[np.ndarray, "state state"],
    weights: tuple[float, float],
) -> float | None:
    """Find the smallest gamma by bisection; None if its equations have no accurate solution.

    X and Y grow as gamma falls, and the spectral radius of X Y has to be below gamma^2: with those
    without a bound that gives a gamma that is too small.
    """
    low = math.sqrt(np.abs(np.linalg.eigvals(x @ y)).max())
    high = 2 * low
    largest = LARGEST * low
    while _solve_bounded(plant, weights, high) is None:
        low = high
        high *= 2
        if high > largest:
            return None
    while high > CLOSER * low:
        middle = math.sqrt(low * high)
        if _solve_bounded(plant, weights, middle) is None:
            low = middle
        else:
            high = middle
    return high


def _solve_bounded(plant: _Scaled, weights: tuple[float, float], bound: float) -> _Riccati | None:
    """Solve both equations for a gamma; None if it is too small."""
    x = _solve_riccati(plant.a, plant.b, weights[0], bound)
    if x is None:
        return None
    y = _solve_riccati(plant.a.T, plant.c, weights[1], bound)
    if y is None or np.abs(np.linalg.eigvals(x @ y)).max() >= bound**2:
        return None
    return _Riccati(x, y, bound)


def _solve_riccati(
    a: Float[np.ndarray, "state state"],
    b: Float[np.ndarray, " state"],
    weight: float,
    bound: float = math.inf,
) -> Float[np.ndarray, "state state"] | None:
    """Solve A' X + X A - X (B B' / weight - 1 / bound^2) X + 1 = 0 for a stabilising X > 0.

    Of a Kalman filter, with the transposed matrices. None if there is none, or it is not accurate.
    """
    from scipy.linalg import solve_continuous_are

    one = np.eye(len(a))
    drive = b[:, None]
    cost = np.array([[weight]])
    if bound < math.inf:
        drive = np.hstack([drive, one])
        cost = np.diag([weight, *np.full(len(a), -(bound**2))])
    try:
        found = solve_continuous_are(a, drive, one, cost)
    except (np.linalg.LinAlgError, ValueError):
        return None
    by_force = (found @ b)[:, None] * (found @ b) / weight
    quadratic = by_force - found @ found / bound**2
    residual = a.T @ found + found @ a - quadratic + one
    if not np.abs(residual).max() <= RIGHT * np.abs(by_force).max():
        return None
    if not (np.linalg.eigvalsh(found) > 0).all():
        return None
    return found


def _make_filter(
    plant: _Scaled, solution: _Riccati, weights: tuple[float, float], roll_off: float
) -> Filter | None:
    """Make the filter of a regulator on an observer; None if it is unstable itself."""
    bound = solution.bound
    feedback = solution.x @ plant.b / weights[0]
    rise = np.eye(len(plant.a)) - solution.y @ solution.x / bound**2
    gain = np.linalg.solve(rise, solution.y @ plant.c / weights[1])
    a = plant.a + solution.x / bound**2
    a = a - np.outer(plant.b, feedback) - np.outer(gain, plant.c)
    poles = np.linalg.eigvals(a)
    if not (np.real(poles) < 0).all():
        return None
    # the poles of the roll-off, which the filter has in series, are zeros of the rest
    hertz = 1 / (2 * np.pi * plant.unit)
    corner = roll_off * np.exp(0.25j * np.pi)
    zeros = -_find_zeros(a, gain, feedback) * hertz
    off = np.minimum(np.abs(zeros - corner), np.abs(zeros - corner.conjugate()))
    zeros = zeros[np.argsort(off)[2:]]
    bare = Filter(1.0, _rounded(zeros), _rounded(-poles * hertz))
    # the gain is that of the matrices, at a frequency amid the modes
    at = hertz
    value = feedback @ np.linalg.solve(1j * np.eye(len(a)) - a, gain.astype(complex))
    low_pass = 1 / (1 + np.sqrt(2) * 1j * at / roll_off - (at / roll_off) ** 2)
    size = value * low_pass / plant.gain / bare.at(at)
    return replace(bare, gain=float(np.real(size)))


def _find_zeros(
    a: Float[np.ndarray, "state state"],
    b: Float[np.ndarray, " state"],
    c: Float[np.ndarray, " state"],
) -> Complex[np.ndarray, " zero"]:
    """Find the finite zeros of c (s - a)^-1 b: eigenvalues of a pencil."""
    from scipy.linalg import eig

    count = len(a)
    pencil = np.zeros((count + 1, count + 1))
    pencil[:count, :count] = a
    pencil[:count, count] = b
    pencil[count, :count] = c
    mass = np.diag([*np.ones(count), 0.0])
    found: Any = eig(pencil, mass, right=False, homogeneous_eigvals=True)
    over, under = found
    finite = np.argsort(-np.abs(under) / np.hypot(np.abs(over), np.abs(under)))[: count - 1]
    return over[finite] / under[finite]


def _rounded(roots: Complex[np.ndarray, " root"]) -> tuple[complex, ...]:
    """Round roots in Hz, conjugate pairs exactly conjugate."""
    rounded = [
        complex(*(float(f"{part:.{DIGITS}g}") for part in (root.real, root.imag)))
        for root in roots
        if root.imag >= 0
    ]
    return _both(rounded)


@dataclass(frozen=True)
class _Judge:
    """The plant with all modes, for the sensitivity and the noise of a filter.

    Attributes
    ----------
    frequency
        Hz, with points around all modes; the last is that of the noise.
    reading, moved
        Responses of reading and output to the force, there.
    heard
        Response of the sensor, by which its noise, a motion, becomes a reading.
    others
        Poles that are left out: the closed-loop poles nearest to them are not judged.
    """

    opened: StateSpace
    frequency: Float[np.ndarray, " frequency"]
    reading: Complex[np.ndarray, " frequency"]
    moved: complex
    heard: complex
    highest: float
    highest_mode: float
    others: Complex[np.ndarray, " pole"]

    @staticmethod
    def of(opened: StateSpace, modes: _Modes, wanted: Wanted, heard: complex) -> _Judge:
        """Prepare the judgement of filters."""
        own = modes.frequency[modes.kept]
        centre = np.abs(np.imag(modes.value)) / (2 * np.pi)
        width = np.abs(np.real(modes.value)) / (2 * np.pi)
        around = np.concatenate([centre + side * width for side in WIDTHS])
        grid = np.geomspace(own.min() / 30, 30 * own.max(), POINTS)
        some = np.append(np.union1d(grid, around[around > 0]), wanted.quiet_at)
        value = opened.at(some)[:, :, 0]
        return _Judge(
            opened,
            some,
            value[:, 0],
            complex(value[-1, 1]),
            heard,
            wanted.highest,
            float(own.max()),
            modes.value[~modes.kept],
        )

    def rate(self, made: Filter) -> tuple[float, float]:
        """Compute the largest sensitivity, and the noise, of a filter."""
        through = made.at(self.frequency)
        sensitivity = 1 / (1 + through * self.reading)
        noise = abs(self.moved * through[-1] * self.heard * sensitivity[-1])
        return float(np.abs(sensitivity).max()), float(noise)

    def accepts(self, one: _Tried, wanted: Wanted) -> bool:
        """Whether a closed loop is stable, and its settling and sensitivity are as wanted."""
        closed = self.close(one)
        if closed is None:
            return False
        settling, sensitivity = closed
        return settling <= wanted.settling and sensitivity <= wanted.sensitivity

    def close(self, one: _Tried) -> tuple[float, float] | None:
        """Close the loop with all modes: settling (s) and sensitivity; None if it is unstable."""
        node = closed_loop.Node("", one.filter)
        made = closed_loop.realise(node)
        plant = self.opened
        forward = -made.C
        a = np.block([[plant.a, plant.b @ forward], [made.B @ plant.c[:1], made.A]])
        count = len(plant.a)
        a[count:, count:] += made.B @ plant.d[:1] @ forward
        poles = np.linalg.eigvals(a)
        if not (np.real(poles) < STILL * np.abs(poles)).all():
            return None
        upper = poles[np.imag(poles) >= 0]
        left = [int(np.abs(upper - other).argmin()) for other in self.others]
        low = np.abs(upper) <= 2 * np.pi * self.highest
        low[left] = False
        settling = float(-1 / np.real(upper[low]).max(initial=-np.inf))
        return settling, self.rate(one.filter)[0]
