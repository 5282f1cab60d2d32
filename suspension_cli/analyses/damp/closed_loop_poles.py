"""Closed-loop state space and poles of local control.

Poles are roots of the pencil of the design with the forces of loops as unknowns. Start values are
the poles of the state space, with constant matrices for losses and fractions for delays.
`linear.roots` finds the roots near them, with losses at the frequency of each pole and exact
delays. Of the infinitely many poles of a closed loop with delay, those near poles of the state
space are found.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.damp.control import Plant
from suspension_cli.design.control import Loop
from suspension_cli.elimination import connected_groups
from suspension_cli.linear import poles, quality, roots, signals, statespace
from suspension_cli.linear.pencil import Pencil
from suspension_cli.linear.poles import Poles
from suspension_cli.linear.roots import ClosedBlock, Feedback, Roots
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.statespace import StateSpace, with_constant_loss

if TYPE_CHECKING:
    from jaxtyping import Complex

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


def find(plant: Plant) -> Poles:
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
    start, shape = poles.solve(build_closed_loop(own, [], motions))
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
