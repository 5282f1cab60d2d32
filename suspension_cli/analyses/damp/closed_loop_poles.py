"""Closed-loop poles of a design: roots of its pencil with the forces of loops as unknowns.

Start values are the poles of the closed-loop state space, whose losses are constant matrices.
`linear.roots` finds the roots near them, with losses at the frequency of each pole and exact delays
(approximate in state spaces). Of the infinitely many poles of a closed loop with delay, those near
poles of the state space are found.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.damp import control_statespace
from suspension_cli.analyses.damp.control import Plant
from suspension_cli.conventions import DOFS
from suspension_cli.elimination import connected_groups
from suspension_cli.linear import poles, quality, roots, signals
from suspension_cli.linear.pencil import Pencil
from suspension_cli.linear.poles import Poles
from suspension_cli.linear.roots import ClosedBlock, Feedback, Roots
from suspension_cli.linear.statespace import with_constant_loss

if TYPE_CHECKING:
    from jaxtyping import Complex

STILL = 1e-12
"""Fraction of the largest pole below which a pole is that of a free coordinate."""
FAR = 50.0
"""Decay within a delay, nepers, beyond which poles are given up."""
GROWING = 1e-18
"""Growth rate over frequency up to which it is a rounding error of the power of loops."""
BESIDE = 1 + 1e-6
"""Factor from a start value to where the force of a loop is evaluated: it may be a pole of it."""


def find(plant: Plant) -> Poles:
    """Find the closed-loop poles of a plant without wire mass, one of each conjugate pair."""
    model = plant.model
    fixed = replace(plant, model=with_constant_loss(model))
    known = signals.bodies_with_signals(model)
    every = [signals.parse_output(f"{body}.{dof}", known) for body in model.body for dof in DOFS]
    start, shape = poles.solve(control_statespace.build_closed_loop(fixed, [], every))
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
        first = int(np.flatnonzero(pushed[6:])[0]) + 6
        place |= {f"loop {loop.name}": first}
        place |= {f"loop {loop.name} {control_statespace.DELAY}": first}
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
