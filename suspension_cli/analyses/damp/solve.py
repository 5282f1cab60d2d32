"""Local control of a suspension: poles, margins, impulse response, sensor noise.

Poles are roots of the pencil of the design with the forces of loops as unknowns. Start values are
the poles of the state space, with constant matrices for losses and fractions for delays.
`linear.roots` finds the roots near them, with losses at the frequency of each pole and exact
delays. Of the infinitely many poles of a closed loop with delay, those near poles of the state
space are found.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.damp import control, margins
from suspension_cli.analyses.damp.control import OsemMatrices, Plant
from suspension_cli.analyses.damp.margins import Margins, SensitivityPeak
from suspension_cli.design.control import Loop
from suspension_cli.design.schema import Design
from suspension_cli.elimination import connected_groups
from suspension_cli.errors import InputError
from suspension_cli.files.declared import along, derived, in_unit
from suspension_cli.linear import quality, roots, signals, statespace
from suspension_cli.linear.pencil import Pencil
from suspension_cli.linear.roots import ClosedBlock, Feedback, Roots
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.statespace import Poles, StateSpace, with_constant_loss
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

    from suspension_cli.analyses.analysis import Log
    from suspension_cli.models.base import Model

SAMPLES = 4001
"""Number of times of impulse responses."""
PADE = 8
"""Order of Pade's approximation of a delay T; its error is 5e-4 up to omega T = 8."""
DIRECT = 6
"""Most poles of a filter whose polynomials keep their digits; others become sections in series."""
STILL = 1e-12
"""Fraction of the largest pole below which a pole is that of a free coordinate."""
FAR = 50.0
"""Decay within a delay, nepers, beyond which poles are given up."""
GROWING = 1e-18
"""Growth rate over frequency up to which it is a rounding error of the power of loops."""
BESIDE = 1 + 1e-6
"""Factor from a start value to where the force of a loop is evaluated: it may be a pole of it."""
LOOP = Signal("", "", 0, (0.0, 0.0, 0.0), acts=True)
"""Stands for the force and the reading of a loop, which are inside the closed system."""


@dataclass(frozen=True)
class LocalControl:
    """Poles, margins, impulse response and sensor noise of one design with local control.

    Attributes
    ----------
    loop
        Names of the loops (l).
    open, closed
        Poles with all loops open and closed, rad/s.
    margin
        Of each loop, the others closed; None if the closed loop is unstable.
    output, drive
        Observed motion, and signal that gets the impulse.
    time
        s.
    impulse, undamped
        Responses of the output to a unit impulse with loops closed and open, SI.
    frequency
        Hz.
    sensor, noise
        Loops and OSEMs, and the noise of the sensor of each at the output, m/sqrt(Hz) or
        rad/sqrt(Hz).
    gain
        Loop gains, the other loops closed.
    fine_frequency, fine
        The curves of pictures: loop gains at more frequencies, which resolve resonances; None until
        they are drawn or saved.
    sensitivity
        Margin of all loops at once; None if the closed loop is unstable.
    osems
        Matrices of the stages with OSEMs; None without OSEMs.
    """

    loop: tuple[str, ...]
    open: Poles
    closed: Poles
    margin: tuple[Margins, ...] | None = field(metadata=along("loop"))
    output: str
    drive: str
    time: Float[np.ndarray, " time"] = field(metadata=in_unit("s"))
    impulse: Float[np.ndarray, " time"] = field(metadata=in_unit("{unit}/({drive_unit} s)"))
    undamped: Float[np.ndarray, " time"] = field(metadata=in_unit("{unit}/({drive_unit} s)"))
    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    sensor: tuple[str, ...]
    noise: Float[np.ndarray, "frequency sensor"] = field(metadata=in_unit("{unit}/Hz^0.5"))
    gain: Complex[np.ndarray, "frequency loop"]
    sensitivity: SensitivityPeak | None = None
    osems: tuple[OsemMatrices, ...] | None = None
    fine_frequency: Float[np.ndarray, " fine_frequency"] | None = field(
        default=None, metadata=in_unit("Hz")
    )
    fine: Complex[np.ndarray, "fine_frequency loop"] | None = None

    @property
    @derived()
    def unit(self) -> str:
        """Unit of the output."""
        return signals.unit_of(self.output)

    @property
    @derived()
    def drive_unit(self) -> str:
        """Unit of the signal that gets the impulse."""
        return signals.unit_of(self.drive)

    @property
    @derived()
    def stable(self) -> bool:
        """Whether no closed-loop pole grows."""
        return self.closed.stable

    @property
    def growth(self) -> str:
        """The pole that grows fastest, with a remedy."""
        return "; ".join(describe_growth(self.closed))


def solve(
    design: Design,
    model: LinearSystem,
    output: str,
    drive: str,
    frequency: Float[np.ndarray, " frequency"],
    duration: float,
    samples: int = SAMPLES,
) -> LocalControl:
    """Compute the closed-loop behaviour of a design with local control.

    `drive` gets the impulse, whose response lasts `duration` in s. Impulse responses approximate
    losses by constant matrices (`with_constant_loss`); all else has the losses of the model, which
    must be one without wire mass.
    """
    control.demand_loops(design)
    plant = control.build_plant(design, model)
    closed, opened = (find_poles(one) for one in (plant, plant.with_loops([])))
    known = signals.bodies_with_signals(model)
    observed = signals.parse_output(output, known)
    driven = signals.parse_input(drive, known, "--impulse")
    margin, peak = find_margins(plant, closed) if closed.stable else (None, None)
    constant = replace(plant, model=with_constant_loss(model))
    time = np.linspace(0.0, duration, samples)
    impulse, undamped = (
        statespace.impulse(build_closed_loop(fixed, [driven], [observed]), time)[:, 0, 0]
        for fixed in (constant, constant.with_loops([]))
    )
    return LocalControl(
        loop=tuple(loop.name for loop in plant.loops),
        open=opened,
        closed=closed,
        margin=margin,
        output=output,
        drive=drive,
        time=time,
        impulse=impulse,
        undamped=undamped,
        frequency=frequency,
        sensor=tuple(one.name for one in plant.parts),
        noise=control.solve_responses(plant, frequency, [], [observed]).noise[:, 0],
        gain=control.compute_loop_gains(plant, frequency),
        sensitivity=peak,
        osems=control.compute_matrices(plant.osems) or None,
    )


def find_margins(plant: Plant, closed: Poles) -> tuple[tuple[Margins, ...], SensitivityPeak]:
    """Find the margins of each loop and of all at once, from stable closed-loop poles."""
    corners = _find_corner_frequencies(plant, closed)
    gain = partial(control.compute_loop_gains, plant)
    peak = margins.find_peak(partial(control.compute_sensitivity, plant), corners)
    return tuple(margins.compute_margins(gain, corners)), peak


def _find_corner_frequencies(plant: Plant, closed: Poles) -> Float[np.ndarray, " frequency"]:
    """Find frequencies (Hz) of closed-loop poles and of roots of filters, and beside them.

    A resonance narrow in a loop gain L with the others closed is as near to a closed-loop pole,
    where 1 + L is 0, as it is wide.
    """
    filters = [loop.controller_and_sensor.continuous for loop in plant.loops]
    found = [root for one in filters for root in (*one.zeros, *one.poles)]
    every: Complex[np.ndarray, " root"] = np.append(closed.value / (2 * np.pi), found)
    every = every[np.abs(every) > 0]
    centre, width = np.abs(np.imag(every)), np.abs(np.real(every))
    beside = [np.abs(centre + side * width) for side in (-3.0, -1.0, 0.0, 1.0, 3.0)]
    return np.unique(np.concatenate([np.abs(every), *beside]))


def find_steady_poles(
    design: Design,
    model: LinearSystem,
    kind: Model,
    motion: str,
    log: Log | None = None,
    allow_unstable: bool | None = None,
) -> Poles:
    """Find the poles, closed-loop if there are loops, on wires without mass.

    Raises `InputError` if one grows, as there is no steady `motion` then ("response", ...); with
    `allow_unstable` warns of it. This is None if the command has no such option.
    """
    massless = registry.BEAM.system(design) if kind.has_wire_mass else model
    found = find_poles(control.build_plant(design, massless))
    if not found.stable:
        where, remedy = describe_growth(found)
        if not allow_unstable:
            problem = f"the closed loop is unstable, so it has no steady {motion}: {where}"
            way = " (pendsus damp)" if allow_unstable is None else ", or give --allow-unstable"
            raise InputError.of("control", problem, remedy + way)
        assert log is not None
        log.warn(f"the closed loop is unstable: {where}; {remedy}")
    return found


def describe_growth(closed: Poles) -> tuple[str, str]:
    """Describe the pole that grows fastest, and a remedy."""
    worst = int(closed.growth_rate.argmax())
    others = int((closed.growth_rate > 0).sum()) - 1
    more = f" (and {others} more)" if others else ""
    where = (
        f"a pole at {closed.frequency[worst]:.5g} Hz in {closed.state[worst]} grows at"
        f" {closed.growth_rate[worst]:.4g} 1/s"
    )
    remedy = "check the sign of the loops that drive it, or lower their gain or phase lag there"
    return where + more, remedy


def build_closed_loop(plant: Plant, inputs: list[Signal], outputs: list[Signal]) -> StateSpace:
    """Build the closed-loop state space: states of the mechanics, then of the filters.

    Without inputs it has all poles of the observed blocks.

    With the forces w of the loops and what their filters sense, and z = (sensed motions, outputs
    of filters), w = F z closes the loops of

        x' = A x + B w + B_e e,    z = C x + D w + D_e e,    y = C_o x + D_o w + D_oe e.
    """
    from scipy.linalg import block_diag

    model, count, i, o = plant.model, len(plant.loops), len(inputs), len(outputs)
    # velocity dampers are part of the damping matrix, which may become asymmetric
    viscous = np.array([_viscous(loop) for loop in plant.loops])
    model = replace(model, damping=model.damping + (plant.pushed.T * viscous) @ plant.sensed)
    drives, rows = (
        np.array([*(signals.linear_form(s, model) for s in some), *loops])
        for some, loops in ((inputs, plant.pushed), (outputs, plant.sensed))
    )
    within = [LOOP] * count
    bare = statespace.assemble(
        model, drives, [*inputs, *within], rows, [*outputs, *within], undriven=not inputs
    )
    if not count:
        return bare
    filters = [(f.A, f.B, f.C, f.D) for f in map(realise, plant.loops)]
    # inputs: external ones, forces of loops, what filters sense; outputs likewise
    a, b, c, d = (
        np.asarray(block_diag(*parts))
        for parts in zip((bare.a, bare.b, bare.c, bare.d), *filters, strict=True)
    )
    one, none = np.eye(count), np.zeros((count, count))
    feedback = np.block([[none, -one], [one, none]])
    feedback = feedback @ np.linalg.inv(np.eye(2 * count) - d[o:, i:] @ feedback)
    back, through = b[:, i:] @ feedback, d[:o, i:] @ feedback
    names = [
        f"loop {loop.name} {k}"
        for loop, (states, *_) in zip(plant.loops, filters, strict=True)
        for k in range(1, len(states) + 1)
    ]
    return replace(
        bare,
        a=a + back @ c[o:],
        b=b[:, :i] + back @ d[o:, :i],
        c=c[:o] + through @ c[o:],
        d=d[:o, :i] + through @ d[o:, :i],
        state=(*bare.state, *names),
        state_unit=(*bare.state_unit, *["1"] * len(names)),
        input=bare.input[:i],
        input_unit=bare.input_unit[:i],
        output=bare.output[:o],
        output_unit=bare.output_unit[:o],
    )


def _viscous(loop: Loop) -> float:
    """Force per velocity of a damper without sensor dynamics, N s/m or N m s/rad; else 0."""
    return loop.damper if loop.damper is not None and loop.sensor_response is None else 0.0


def realise(loop: Loop) -> Any:
    """Realise filter, sensor and delay of a loop (rad/s); of a damper, what its delay changes.

    Returns a `scipy.signal.StateSpace`.
    """
    from scipy.signal import StateSpace, tf2ss, zpk2sos, zpk2ss

    delay = _realise_delay(loop.delay)
    if damper := _viscous(loop):
        # its force without delay is in the damping matrix: left is c s (exp(-s T) - 1)
        rate = damper * delay.C @ delay.A, damper * delay.C @ delay.B
        return StateSpace(delay.A, delay.B, *rate)
    made = loop.controller_and_sensor.continuous
    zeros, poles = (-2 * np.pi * np.array(roots) for roots in (made.zeros, made.poles))
    gain = made.gain * (2 * np.pi) ** (len(poles) - len(zeros))
    if len(poles) <= DIRECT:
        return StateSpace(*zpk2ss(zeros, poles, gain)) * delay if len(poles) else delay * gain
    for section in zpk2sos(zeros, poles, gain, analog=True):
        halves = (np.trim_zeros(half, "f") for half in np.split(section, 2))
        delay = StateSpace(*tf2ss(*halves)) * delay
    return delay


def _realise_delay(delay: float) -> Any:
    """Realise a delay T as Pade's fraction, in sections (s^2 - b s + w^2) / (s^2 + b s + w^2).

    Its denominator is a Bessel polynomial in s T / 2 (Storch, Proc. IRE 42, 1666 (1954)).
    """
    from scipy.signal import StateSpace, besselap

    result: Any = StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.eye(1))
    roots = np.asarray(besselap(PADE, norm="delay")[1]) if delay else np.zeros(0)
    for pole in 2 * roots[roots.imag > 0] / (delay or 1.0):
        w, b = abs(pole), -2 * pole.real
        a = np.array([[0.0, w], [-w, -b]])
        result = result * StateSpace(a, [[0.0], [w]], [[0.0, -2 * b / w]], np.eye(1))
    return result


def find_poles(plant: Plant) -> Poles:
    """Find the closed-loop poles of a plant without wire mass, one of each conjugate pair."""
    fixed = replace(plant, model=with_constant_loss(plant.model))
    found = [_find_in_block(plant, fixed, *both) for both in _build_blocks(plant)]
    value = np.concatenate([one.value for one in found])
    states = [state for one in found for state in one.state]
    order = np.argsort(np.abs(value), kind="stable")
    return Poles(value[order], tuple(states[n] for n in order))


def _build_blocks(plant: Plant) -> list[tuple[ClosedBlock, list[int]]]:
    """Coordinates that couple to no others, with the numbers of the loops that act on them."""
    pencil = Pencil.of(plant.model)
    linked = pencil.coupled | ((plant.pushed != 0).T.astype(float) @ (plant.sensed != 0) > 0)
    blocks = []
    for group in connected_groups(linked[6:, 6:]):
        keep = 6 + group[np.argsort(pencil.owner[6 + group], kind="stable")]
        acting = (plant.pushed[:, keep] != 0).any(1) | (plant.sensed[:, keep] != 0).any(1)
        numbers = np.flatnonzero(acting).tolist()
        loops = tuple(
            Feedback(plant.sensed[n], plant.pushed[n], loop.controller_and_sensor, loop.delay)
            for n, loop in enumerate(plant.loops)
            if n in numbers
        )
        pull = np.asarray(linked[keep, :6].any(0))
        blocks.append((ClosedBlock(pencil, keep, pull, loops), numbers))
    return blocks


def _find_in_block(plant: Plant, fixed: Plant, block: ClosedBlock, numbers: list[int]) -> Poles:
    """Find the poles of one block; `fixed` has the plant's losses as constant matrices."""
    model = plant.model
    bodily = block.keep[block.keep < 6 + 6 * len(model.body)]
    if not len(bodily):
        return Poles(np.zeros(0, dtype=complex), ())
    own = fixed.with_loops(numbers)
    motions = [Signal("", model.body[n // 6 - 1], n % 6, (0.0, 0.0, 0.0), False) for n in bodily]
    start, shape = statespace.find_poles(build_closed_loop(own, [], motions))
    value = np.where(np.abs(start.value) <= STILL * np.abs(start.value).max(), 0.0, start.value)
    motion = np.zeros((len(value), model.size), dtype=complex)
    motion[:, bodily] = shape.T
    delay = max((one.delay + one.filter.period for one in block.loops), default=0.0)
    spurious = -np.real(value) * delay > FAR  # of the approximated delay
    value[spurious] = 0.0
    for chosen in (np.imag(value) > 0, (np.imag(value) == 0) & (value != 0)):
        some = np.flatnonzero(chosen)
        if not len(some):
            continue
        starts = Roots.starts([block], value[some], np.zeros(len(some), dtype=int), motion[some])
        for force, loop in zip(_forces(block, starts), block.loops, strict=True):
            _, over, under = loop.at(value[some] * BESIDE)[0]
            force[:] = over / under * (motion[some] @ loop.sensed)
        loss = "all" if np.imag(value[some[0]]) else "dampers"
        found = roots.find_roots(Pencil.of(model), [block], starts, loss=loss)
        kept = ~(found.lost | roots.repeated(found))
        spurious[some] = ~kept & (delay > 0)
        value[some[kept]] = _refine_decays(plant, block, found.select(kept))
    left = np.flatnonzero(~spurious)
    return Poles(value[left], tuple(start.state[n] for n in left))


def _forces(block: ClosedBlock, found: Roots) -> Complex[np.ndarray, "loop root"]:
    """Forces of the loops of a block, which are its last unknowns."""
    return found.motion[len(block.owner) - len(block.loops) :]


def _refine_decays(plant: Plant, block: ClosedBlock, found: Roots) -> Complex[np.ndarray, " pole"]:
    """Compute slow decays from dissipation and the power of loops (see `linear.quality`)."""
    motion = found.motions([block], plant.model.size)
    power = np.zeros(len(motion))
    for force, loop in zip(_forces(block, found), block.loops, strict=True):
        power += np.imag(np.conj(motion @ loop.pushed) * force)
    value = quality.evaluate(plant.model, found.value, motion, power).value
    steady = (np.real(value) > 0) & (np.real(value) <= GROWING * np.abs(value))
    return np.where(steady, 1j * np.imag(value), value)
