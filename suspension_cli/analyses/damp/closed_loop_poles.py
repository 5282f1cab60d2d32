"""Closed-loop state space and poles of local control.

Poles are roots of the pencil of the design with the forces of loops as unknowns. Start values are
the poles of the state space, with constant matrices for losses and fractions for delays.
`linear.roots` finds the roots near them, with losses at the frequency of each pole and exact
delays. Of the infinitely many poles of a closed loop with delay, those near poles of the state
space are found.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.damp.control import Plant
from suspension_cli.conventions import DOFS
from suspension_cli.design.schema import Loop
from suspension_cli.elimination import connected_groups
from suspension_cli.linear import poles, quality, roots, signals, statespace
from suspension_cli.linear.frequency_terms import is_light
from suspension_cli.linear.pencil import Pencil
from suspension_cli.linear.poles import Poles
from suspension_cli.linear.roots import ClosedBlock, Feedback, Roots
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.statespace import StateSpace, with_constant_loss
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Complex

PADE = 8
"""Order of Pade's approximation of a delay T; its error is 5e-4 up to omega T = 8."""
STILL = 1e-12
"""Fraction of the largest pole below which a pole is that of a free coordinate."""
FAR = 50.0
"""Decay within a delay, nepers, beyond which poles are given up."""
GROWING = 1e-18
"""Growth rate over frequency up to which it is a rounding error of the power of loops."""
BESIDE = 1 + 1e-6
"""Factor from a start value to where the force of a loop is evaluated: it may be a pole of it."""


def build_closed_loop(plant: Plant, inputs: list[Signal], outputs: list[Signal]) -> StateSpace:
    """Build the closed-loop state space: states of the mechanics, then of the filters.

    Without inputs it has all poles of the observed blocks.

    With the forces w of the loops and what their filters sense, and z = (sensed motions, outputs
    of filters), w = F z closes the loops of

        x' = A x + B w + B_e e,    z = C x + D w + D_e e,    y = C_o x + D_o w + D_oe e.
    """
    from scipy.linalg import block_diag

    model = _add_dampers(plant)
    drives, rows = (
        np.array([*(signals.linear_form(s, model) for s in some), *loops])
        for some, loops in ((inputs, plant.pushed), (outputs, plant.sensed))
    )
    bare = statespace.assemble(
        model,
        drives,
        [*inputs, *plant.actuator],
        rows,
        [*outputs, *plant.sensor],
        undriven=not inputs,
    )
    count, i, o = len(plant.loops), len(inputs), len(outputs)
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


def _add_dampers(plant: Plant) -> LinearSystem:
    """Add velocity dampers to the damping matrix, which may become asymmetric."""
    damping = plant.model.damping.copy()
    for loop, sensed, pushed in zip(plant.loops, plant.sensed, plant.pushed, strict=True):
        damping += _viscous(loop) * np.outer(pushed, sensed)
    return replace(plant.model, damping=damping)


def _viscous(loop: Loop) -> float:
    """Force per velocity of a damper without sensor dynamics, N s/m or N m s/rad; else 0."""
    return loop.damper if loop.damper is not None and loop.sensor_response is None else 0.0


def realise(loop: Loop) -> Any:
    """Realise filter, sensor and delay of a loop (rad/s); of a damper, what its delay changes.

    Returns a `scipy.signal.StateSpace`.
    """
    from scipy.signal import StateSpace, zpk2ss

    delay = _realise_delay(loop.delay)
    if damper := _viscous(loop):
        # its force without delay is in the damping matrix: left is c s (exp(-s T) - 1)
        rate = damper * delay.C @ delay.A, damper * delay.C @ delay.B
        return StateSpace(delay.A, delay.B, *rate)
    made = loop.controller_and_sensor
    zeros, poles = (-2 * np.pi * np.array(roots) for roots in (made.zeros, made.poles))
    gain = made.gain * (2 * np.pi) ** (len(poles) - len(zeros))
    return StateSpace(*zpk2ss(zeros, poles, gain)) * delay if len(poles) else delay * gain


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
    model = plant.model
    fixed = replace(plant, model=with_constant_loss(model))
    known = signals.bodies_with_signals(model)
    every = [signals.parse_output(f"{body}.{dof}", known) for body in model.body for dof in DOFS]
    start, shape = poles.solve(build_closed_loop(fixed, [], every))
    value = np.where(np.abs(start.value) <= STILL * np.abs(start.value).max(), 0.0, start.value)
    blocks = _build_blocks(plant)
    member = _find_blocks(start.state, plant, blocks)
    motion = np.zeros((len(value), model.size), dtype=complex)
    motion[:, 6 : 6 + len(every)] = shape.T
    delay = np.array([max((one.delay for one in b.loops), default=0.0) for b in blocks])[member]
    spurious = -np.real(value) * delay > FAR  # of the approximated delay
    value[spurious] = 0.0
    for chosen in (np.imag(value) > 0, (np.imag(value) == 0) & (value != 0)):
        some = np.flatnonzero(chosen)
        if len(some):
            starts = _build_starts(value[some], member[some], motion[some], blocks)
            loss = "all" if np.imag(value[some[0]]) else "dampers"
            found = roots.find_roots(Pencil.of(model), blocks, starts, loss=loss)
            kept = ~(found.lost | roots.repeated(found))
            spurious[some] = ~kept & (delay[some] > 0)
            value[some[kept]] = _refine_decays(plant, blocks, found.select(kept))
    order = np.argsort(np.abs(value), kind="stable")
    order = order[~spurious[order]]
    return Poles(value[order], tuple(start.state[n] for n in order))


def _build_blocks(plant: Plant) -> list[ClosedBlock]:
    """Coordinates that couple to no others, with the loops that act on them."""
    pencil = Pencil.of(plant.model)
    linked = pencil.coupled.copy()
    loops = []
    for loop, sensed, pushed in zip(plant.loops, plant.sensed, plant.pushed, strict=True):
        linked |= np.outer(pushed, sensed) != 0
        made, turn = loop.controller_and_sensor, 2 * np.pi
        zeros, places = (np.array(some, dtype=complex) * turn for some in (made.zeros, made.poles))
        gain = made.gain * turn ** (len(places) - len(zeros))
        loops.append(Feedback(sensed, pushed, gain, zeros, places, loop.delay))
    blocks = []
    for group in connected_groups(linked[6:, 6:]):
        keep = 6 + group[np.argsort(pencil.owner[6 + group], kind="stable")]
        acting = tuple(one for one in loops if one.pushed[keep].any() or one.sensed[keep].any())
        blocks.append(ClosedBlock(pencil, keep, np.asarray(linked[keep, :6].any(0)), acting))
    return blocks


def _find_blocks(states: tuple[str, ...], plant: Plant, blocks: list[ClosedBlock]) -> np.ndarray:
    """Find the block of each state, such as ``frame.x momentum`` or ``loop roll 2``."""
    place = {name: n for n, name in enumerate(plant.model.coordinate)}
    for loop, pushed in zip(plant.loops, plant.pushed, strict=True):
        place[f"loop {loop.name}"] = int(np.flatnonzero(pushed[6:])[0]) + 6
    for term in filter(is_light, plant.model.terms):
        place |= dict.fromkeys(statespace.names_of_light(term), int(term.columns[-1]))
    numbers = [place[name if name in place else name.rpartition(" ")[0]] for name in states]
    return np.array([next(n for n, b in enumerate(blocks) if at in b.keep) for at in numbers])


def _build_starts(
    value: Complex[np.ndarray, " pole"],
    member: np.ndarray,
    motion: Complex[np.ndarray, "pole coordinate"],
    blocks: list[ClosedBlock],
) -> Roots:
    """Start values with the forces of loops."""
    result = Roots.starts(blocks, value, member, motion)
    for n, number in enumerate(member.tolist()):
        for place, loop in _forces(blocks[number]):
            (_, (over,), (under,)), _ = loop.at(value[[n]] * BESIDE)
            result.motion[place, n] = over / under * (loop.sensed @ motion[n])
    return result


def _forces(block: ClosedBlock) -> Iterator[tuple[int, Feedback]]:
    """Iterate over the loops of a block and the numbers of their forces among its unknowns."""
    return enumerate(block.loops, len(block.owner) - len(block.loops))


def _refine_decays(
    plant: Plant, blocks: list[ClosedBlock], found: Roots
) -> Complex[np.ndarray, " pole"]:
    """Compute slow decays from dissipation and the power of loops (see `linear.quality`)."""
    motion = found.motions(blocks, plant.model.size)
    power = np.zeros(len(motion))
    for n, number in enumerate(found.block.tolist()):
        for place, loop in _forces(blocks[number]):
            power[n] += np.imag(np.conj(motion[n]) @ loop.pushed * found.motion[place, n])
    value = quality.evaluate(plant.model, found.value, motion, power).value
    steady = (np.real(value) > 0) & (np.real(value) <= GROWING * np.abs(value))
    return np.where(steady, 1j * np.imag(value), value)
