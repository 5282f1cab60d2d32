"""State space and poles of a suspension with its loops closed.

>>> from suspension_cli.design import reader
>>> from suspension_cli.models import registry
>>> design = reader.parse(reader.template("single", "single"))
>>> plant = local_control.build_plant(design, registry.STRING.system(design))
>>> find_poles(plant).frequency[:3].round(2)  # without loops
array([0.94, 0.94, 1.56])
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.elimination import connected_groups
from suspension_cli.errors import InputError
from suspension_cli.linear import (
    quality,
    roots,
    signals,
    statespace,
)
from suspension_cli.linear.damped import LostModeError, change_of_stiffness, has_steep_tables
from suspension_cli.linear.oscillations import find_oscillations, settle
from suspension_cli.linear.roots import ClosedBlock, Feedback, Roots
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.solver import Solvable, Solver
from suspension_cli.linear.statespace import Poles, StateSpace, with_constant_loss
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from suspension_cli.physics import local_control
from suspension_cli.physics.local_control import Plant
from suspension_cli.physics.loop_network import Node
from suspension_cli.physics.loop_realisation import delay_poles, realise_nodes, viscous_damper

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

    from suspension_cli.models.base import Model
    from suspension_cli.physics.log import Log

STILL = 1e-12
"""Fraction of the largest pole below which a pole is that of a free coordinate."""
SURE = 1.0
"""Decay within a delay, nepers, up to which no pole is one of its approximation."""
NYQUIST = 0.9
"""Fraction of half the rate of a digital filter from which its poles may be aliases."""
FAR = 50.0
"""Decay within a delay, nepers, beyond which poles are given up."""
GROWING = 1e-18
"""Growth rate over frequency up to which it is a rounding error of the power of loops."""
RISING = (0.1, 0.2, 0.4, 0.7, 1.0)
"""Fractions of the gain of loops at which poles of filters are followed."""
SAME = 1e-6
"""Relative distance of two poles up to which they are one."""
BY_NUMBER = 1e-3
"""Relative distance within which poles that coincide are counted; rounding moves four by 1e-4."""
COINCIDENT = 1e-2
"""Largest spread of such poles over that distance."""
WHOLE = 1e-3
"""Largest distance of a number of poles from a whole one; a pole near the circle leaves 0.5."""
BESIDE = 1 + 1e-6
"""Factor from a start value to where the force of a loop is evaluated: it may be a pole of it."""
LOOP = Signal("", "", 0, (0.0, 0.0, 0.0), acts=True)
"""Stands for the force and the reading of a loop, which are inside the closed system."""


def find_steady_poles(
    design: Design,
    system: Solvable,
    kind: Model,
    motion: str,
    log: Log | None = None,
    allow_unstable: bool | None = None,
) -> Poles:
    """Find the poles, closed-loop if there are loops, on wires without mass.

    Raises `InputError` if one grows, as there is no steady `motion` then ("response", ...); with
    `allow_unstable` warns of it. This is None if the command has no such option.
    """
    massless = registry.BEAM.system(design) if kind.has_wire_mass else system
    found = find_poles(local_control.build_plant(design, massless))
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
    """
    model = plant.model
    drives = np.array([signals.linear_form(one, model) for one in inputs])
    rows = np.array([signals.linear_form(one, model) for one in outputs])
    return close_loops(plant, inputs, drives, outputs, rows)


def close_loops(
    plant: Plant,
    inputs: list[Signal],
    drives: Float[np.ndarray, "input coordinate"],
    outputs: list[Signal],
    rows: Float[np.ndarray, "output coordinate"],
    noise: Float[np.ndarray, "input node"] | None = None,
    demands: Float[np.ndarray, "output node"] | None = None,
) -> StateSpace:
    """Build the closed-loop state space of signals with given linear forms.

    Inputs may add to what filters read (`noise`), and outputs may have those of filters
    (`demands`). With the forces and inputs of filters w, and z = (sensed motions, outputs of
    filters), w = F z + N e closes the loops of

        x' = A x + B w + B_e e,    z = C x + D w + D_e e,    y = C_o x + D_o w + D_oe e + V z.
    """
    from scipy.linalg import block_diag

    model = plant.model
    network = plant.network
    count = len(network.nodes)
    sensed = plant.node_sensed
    pushed = plant.node_pushed
    i = len(inputs)
    o = len(outputs)
    # velocity dampers are part of the damping matrix, which may become asymmetric
    viscous = np.zeros(count)
    viscous[: len(plant.loops)] = [viscous_damper(loop) for loop in plant.loops]
    model = replace(model, damping=model.damping + (pushed.T * viscous) @ sensed)
    drives, rows = (
        np.concatenate([given.reshape(-1, model.size), own])
        for given, own in ((drives, pushed), (rows, sensed))
    )
    within = [LOOP] * count
    bare = statespace.assemble(
        model, drives, [*inputs, *within], rows, [*outputs, *within], undriven=not inputs
    )
    if not count:
        return bare
    made = realise_nodes(plant)
    filters = [(f.A, f.B, f.C, f.D) for f in made]
    # inputs: external ones, forces of loops, what filters sense; outputs likewise
    a, b, c, d = (
        np.asarray(block_diag(*parts))
        for parts in zip((bare.a, bare.b, bare.c, bare.d), *filters, strict=True)
    )
    one = np.eye(count)
    none = np.zeros((count, count))
    entering = np.zeros((2 * count, i))
    if noise is not None:
        entering[count:] = noise.T
    leaving = np.zeros((o, 2 * count))
    if demands is not None:
        leaving[:, count:] = demands
    through = d[o:, i:]
    feedback = np.block([[none, -one], [one, network.of_nodes]])
    solved = np.linalg.inv(np.eye(2 * count) - through @ feedback)
    # z = solved (C x + applied e)
    applied = d[o:, :i] + through @ entering
    back = b[:, i:] @ feedback @ solved
    forward = (d[:o, i:] @ feedback + leaving) @ solved
    names = [
        f"{node.name} {k}"
        for node, (states, *_) in zip(network.nodes, filters, strict=True)
        for k in range(1, len(states) + 1)
    ]
    return replace(
        bare,
        a=a + back @ c[o:],
        b=b[:, :i] + back @ applied + b[:, i:] @ entering,
        c=c[:o] + forward @ c[o:],
        d=d[:o, :i] + forward @ applied + d[:o, i:] @ entering,
        state=(*bare.state, *names),
        state_unit=(*bare.state_unit, *["1"] * len(names)),
        input=bare.input[:i],
        input_unit=bare.input_unit[:i],
        output=bare.output[:o],
        output_unit=bare.output_unit[:o],
    )


def find_poles(plant: Plant) -> Poles:
    """Find the closed-loop poles of a plant without wire mass, one of each conjugate pair.

    Raises `InputError` if one is lost.
    """
    forward = _feed_forward(plant)
    every = range(len(plant.network.nodes))
    forward_nodes = [plant.network.nodes[n] for n in forward]
    plant = _with_states(plant.select([n for n in every if n not in forward]))
    fixed = plant.with_model(with_constant_loss(plant.model))
    found = [_find_in_block(plant, fixed, *both) for both in _build_blocks(plant)]
    found.append(_poles_of_filters(forward_nodes, plant.model.size))
    value = np.concatenate([one.value for one in found])
    states = [state for one in found for state in one.state]
    motion = np.concatenate([one.motion for one in found if one.motion is not None])
    order = np.argsort(np.abs(value), kind="stable")
    return Poles(value[order], tuple(states[n] for n in order), motion[order])


def _feed_forward(plant: Plant) -> list[int]:
    """Number the filters that read no motion of a body, also through others.

    They are in no loop: their poles are those of the filters, and move no other pole.
    """
    reads = plant.node_sensed[:, 6:].any(1)
    return [n for n, read in enumerate(plant.network.upstream) if not (read & reads).any()]


def _poles_of_filters(nodes: Sequence[Node], size: int) -> Poles:
    """List the poles of filters with Im s >= 0, without motions of the coordinates."""
    value = []
    state = []
    for node in nodes:
        every = [(pole, part.rate) for part in node.filter.parts for pole in part.poles]
        for number, (pole, rate) in enumerate(every, 1):
            s = complex(-2 * np.pi * pole)
            if s.imag >= 0:
                value.append(move_pole(s, rate) if rate else s)
                state.append(f"{node.name} {number}")
    none = np.zeros((len(value), size), dtype=complex)
    return Poles(np.array(value, dtype=complex), tuple(state), none)


def follow_poles(plant: Plant, known: Poles) -> Poles:
    """Find the closed-loop poles of a plant, also with wire mass, from those of another model.

    Both models have the same coordinates. One that is lost keeps its value.
    """
    plant = _with_states(plant)
    value = known.value.copy()
    assert known.motion is not None
    for block, numbers in _build_blocks(plant):
        within = _Within(plant, block, tuple(numbers))
        own = np.flatnonzero(known.motion[:, within.bodily].any(1))
        states = tuple(known.state[n] for n in own)
        found, _, lost = within.refine(_Starts(known.value[own], states, known.motion[own]))
        value[own[~lost]] = found[~lost]
    return replace(known, value=value)


def _with_states(plant: Plant) -> Plant:
    """Give terms with states coordinates, in which their poles are as harmless as others."""
    model = statespace.with_states(plant.model)
    if model is plant.model:
        return plant
    more = ((0, 0), (0, model.size - plant.model.size))
    sensed = np.pad(plant.sensed, more)
    pushed = np.pad(plant.pushed, more)
    return replace(plant, solver=Solver(model), sensed=sensed, pushed=pushed)


def _build_blocks(plant: Plant) -> list[tuple[ClosedBlock, list[int]]]:
    """Coordinates that couple to no others, with the numbers of the filters that act on them."""
    pencil = plant.solver.pencil
    nodes = plant.network.nodes
    reads = plant.network.of_nodes
    pushed = plant.node_pushed
    sensed = plant.node_sensed
    touched = _touched_coordinates(plant)
    linked = pencil.coupled | (touched.T.astype(float) @ touched > 0)
    blocks = []
    for group in connected_groups(linked[6:, 6:]):
        keep = 6 + group[np.argsort(pencil.owner[6 + group], kind="stable")]
        numbers = np.flatnonzero(touched[:, keep].any(1)).tolist()
        loops = tuple(
            Feedback(sensed[n], reads[n, numbers], pushed[n], nodes[n].filter, nodes[n].delay)
            for n in numbers
        )
        pull = np.asarray(linked[keep, :6].any(0))
        blocks.append((ClosedBlock(pencil, keep, pull, loops), numbers))
    return blocks


def _touched_coordinates(plant: Plant) -> Bool[np.ndarray, "node coordinate"]:
    """Which coordinates each filter senses or pushes, itself or through filters that it is tied to.

    Filters are tied if one reads another, also through others.
    """
    upstream = plant.network.upstream
    own = (plant.node_pushed != 0) | (plant.node_sensed != 0)
    groups = connected_groups(upstream | upstream.T)
    result = np.zeros_like(own)
    for group in groups:
        result[group] = own[group].any(0)
    return result


def _find_in_block(plant: Plant, fixed: Plant, block: ClosedBlock, numbers: list[int]) -> Poles:
    """Find the poles of one block; `fixed` has the plant's losses as constant matrices.

    Without losses and delays the starts are eigenvalues, which need no other search. Raises
    `LostModeError` if one of others is lost, unless it may be a pole of the approximated delay.
    """
    within = _Within(plant, block, tuple(numbers))
    if not len(within.bodily):
        none = np.zeros(0, dtype=complex)
        return Poles(none, (), np.zeros((0, plant.model.size), dtype=complex))
    start = within.counted() if within.has_steep_tables else within.solve(fixed.model)
    value, motion, lost = within.refine(start)
    if within.is_lossy and lost.any():
        start = within.settled(start, lost)
        value, motion, lost = within.refine(start)
    within.find_coincident(start, value, lost)
    fast = -np.real(start.value) * within.delay
    lost |= ~(fast <= FAR) | within.is_alias(start, value)
    if within.delay:
        within.search_again(value, lost)
    vital = lost & (fast <= SURE) & ~within.at_half_the_rate(start)
    if vital.any():
        if within.is_lossy or within.delay:
            n = int(np.flatnonzero(vital)[0])
            raise LostModeError.of_loops(start.state[n], abs(start.value[n]) / (2 * np.pi))
        value = start.value
    left = np.flatnonzero(~lost | vital)
    return Poles(value[left], tuple(start.state[n] for n in left), motion[left])


def _move_filter_poles(
    value: Complex[np.ndarray, " pole"], state: tuple[str, ...], nodes: Sequence[Node]
) -> Complex[np.ndarray, " pole"]:
    """Move start values that are poles of digital filters to where these are.

    The state space takes s for w.
    """
    by_name = {node.name: node for node in nodes}
    result = value.astype(complex)
    for n, name in enumerate(state):
        node = by_name.get(name.rpartition(" ")[0])
        if node is None or not node.filter.period:
            continue
        near = [
            (abs(value[n] + 2 * np.pi * pole), part.rate)
            for part in node.filter.parts
            for pole in part.poles
        ]
        # those of the fraction that stands for the delay stay where they are
        near += [(abs(value[n] - pole), 0.0) for pole in delay_poles(node.delay)]
        if near and (rate := min(near)[1]):
            result[n] = move_pole(result[n], rate)
    return result


def move_pole(w: complex, rate: float) -> complex:
    """Move a pole of a digital filter from w to s = 2 rate artanh(w / 2 rate), with Im s >= 0.

    Where w is real and beyond 2 rate, z is negative, and the pole is at half the rate; where it is
    2 rate, z is 0 and s infinite.
    """
    with np.errstate(all="ignore"):
        moved = 2 * rate * np.arctanh(complex(w) / (2 * rate))
    return complex(np.real(moved), np.abs(np.imag(moved)))


@dataclass(frozen=True)
class _Starts:
    """Poles of a closed loop with constant matrices: s, the leading state, and motions."""

    value: Complex[np.ndarray, " pole"]
    state: tuple[str, ...]
    motion: Complex[np.ndarray, "pole coordinate"]

    @property
    def of_filter(self) -> Bool[np.ndarray, " pole"]:
        """Which have a state of a filter as leading state."""
        return np.array([statespace.is_of_filter(name) for name in self.state], dtype=bool)

    def followed_by(self, other: _Starts) -> _Starts:
        """Append others."""
        return _Starts(
            np.append(self.value, other.value),
            (*self.state, *other.state),
            np.concatenate([self.motion, other.motion]),
        )

    def with_real_poles_apart(self) -> _Starts:
        """Replace pairs that rounding has made of equal real poles by two real ones each."""
        imaginary = np.imag(self.value)
        pair = (imaginary > 0) & (imaginary < BY_NUMBER * np.abs(self.value))
        real = replace(self, value=np.where(pair, np.real(self.value), self.value))
        return real.followed_by(real.select(pair)) if pair.any() else real

    def select(self, some: Bool[np.ndarray, " pole"] | list[int]) -> _Starts:
        """Select some."""
        chosen = np.arange(len(self.value))[some]
        return _Starts(
            self.value[chosen], tuple(self.state[n] for n in chosen), self.motion[chosen]
        )


@dataclass(frozen=True)
class _Within:
    """One block of a plant, with the numbers of its loops."""

    plant: Plant
    block: ClosedBlock
    numbers: tuple[int, ...]

    @cached_property
    def bodily(self) -> Int[np.ndarray, " coordinate"]:
        """Coordinates of bodies."""
        return self.block.keep[self.block.keep < 6 + 6 * len(self.plant.model.body)]

    @property
    def delay(self) -> float:
        """Longest delay of a loop, s."""
        return max((one.delay + one.filter.period for one in self.block.loops), default=0.0)

    def at_half_the_rate(self, start: _Starts) -> Bool[np.ndarray, " pole"]:
        """Mark starts in digital filters near half their rate, which may be one pole or none.

        There z is negative, and a start and its mirror image belong to the same pole.
        """
        if not self.rates:
            return np.zeros(len(start.value), dtype=bool)
        return start.of_filter & (np.abs(start.value) > NYQUIST * np.pi * min(self.rates))

    def is_alias(
        self, start: _Starts, value: Complex[np.ndarray, " pole"]
    ) -> Bool[np.ndarray, " pole"]:
        """Mark poles of filters above half of all sample rates, which repeat those below."""
        if not self.rates:
            return np.zeros(len(value), dtype=bool)
        return start.of_filter & (np.imag(value) > np.pi * max(self.rates) * (1 + SAME))

    @property
    def rates(self) -> list[float]:
        """Sample rates of the digital filters, Hz."""
        return [one.rate for loop in self.block.loops for one in loop.filter.parts if one.rate]

    @property
    def is_lossy(self) -> bool:
        """Whether the stiffness has losses, or depends on frequency."""
        terms = any(not term.is_viscous for _, term in self.block.terms)
        return terms or bool(self.block.loss.any())

    @property
    def has_steep_tables(self) -> bool:
        """See `linear.damped.has_steep_tables`."""
        still = self.plant.solver.spectrum
        own = still.motion[:, self.block.keep].any(1)
        return has_steep_tables(self.block, still.omega_squared[own], still.motion[own])

    def solve(self, model: LinearSystem) -> _Starts:
        """Solve for the poles with constant matrices; those of free coordinates are 0."""
        own = self.plant.with_model(model).select(list(self.numbers))
        body = model.body
        motions = [
            Signal("", body[n // 6 - 1], n % 6, (0.0, 0.0, 0.0), False)
            for n in self.bodily.tolist()
        ]
        found, shape = statespace.find_poles(build_closed_loop(own, [], motions))
        value = found.value.copy()
        motion = np.zeros((len(found.value), model.size), dtype=complex)
        motion[:, self.bodily] = shape.T
        value[np.abs(value) <= STILL * np.abs(value).max(initial=0.0)] = 0.0
        value = _move_filter_poles(value, found.state, own.network.nodes)
        return _Starts(value, found.state, motion).with_real_poles_apart()

    def at(self, omega: float, share: float = 1.0) -> _Starts:
        """Solve for the oscillating poles with the stiffness at a frequency (rad/s).

        Losses are dampers that dissipate as much.
        """
        model = self.plant.model
        soft, k = change_of_stiffness(self.block, omega, share)
        loss = np.imag(soft) + (model.elongation.T * np.imag(k)) @ model.elongation
        fixed = replace(
            model,
            soft=np.real(model.soft) + np.real(soft),
            k=np.real(model.k) + np.real(k),
            damping=model.damping + (loss + loss.T) / (2 * omega),
            terms=tuple(term for term in model.terms if term.is_viscous),
        )
        found = self.solve(with_constant_loss(fixed))
        return found.select(np.imag(found.value) > 0)

    def poles_at(
        self, omega: float, share: float
    ) -> tuple[Complex[np.ndarray, " pole"], Complex[np.ndarray, "pole coordinate"]]:
        """See `at`."""
        found = self.at(omega, share)
        return found.value, found.motion

    def counted(self) -> _Starts:
        """Find starts by counting those that oscillate."""
        found = self.solve(with_constant_loss(self.plant.model))
        result = found.select(np.imag(found.value) == 0)
        for value in find_oscillations(self.poles_at)[0].tolist():
            result = result.followed_by(self._nearest(value))
        return result

    def settled(self, start: _Starts, lost: Bool[np.ndarray, " pole"]) -> _Starts:
        """Replace lost starts that oscillate by poles with the stiffness at their frequencies."""
        value = start.value.copy()
        motion = start.motion.copy()
        for n in np.flatnonzero(lost & (np.imag(value) > 0)):
            for found in settle(self.poles_at, complex(value[n]), motion[n]):
                value[n], motion[n] = found
        return replace(start, value=value, motion=motion)

    def _nearest(self, value: complex) -> _Starts:
        """The pole nearest to a value with the stiffness at its frequency."""
        found = self.at(value.imag)
        return found.select([int(np.abs(found.value - value).argmin())])

    def refine(
        self, start: _Starts
    ) -> tuple[
        Complex[np.ndarray, " pole"],
        Complex[np.ndarray, "pole coordinate"],
        Bool[np.ndarray, " pole"],
    ]:
        """Find the poles with all losses and delays, and motions; mark those that are lost.

        These keep their start.
        """
        value = start.value.copy()
        motion = start.motion.copy()
        block = self.block
        # of the approximated delay, or a delay of samples, z = 0
        lost = ~(-np.real(value) * self.delay <= FAR)
        value[lost] = 0.0
        pencil = self.plant.solver.pencil
        for chosen in (np.imag(value) > 0, (np.imag(value) == 0) & (value != 0)):
            some = np.flatnonzero(chosen)
            if not len(some):
                continue
            starts = Roots.starts(
                [block], value[some], np.zeros(len(some), dtype=int), motion[some]
            )
            forces = _forces(block, starts)
            forces[:] = roots.solve_filters(block, value[some] * BESIDE, motion[some])
            forces[:, ~motion[some].any(1)] = 1.0  # without motion the loops alone act
            loss = "all" if np.imag(value[some[0]]) else "dampers"
            found = roots.find_roots(pencil, [block], starts, loss=loss)
            kept = ~(found.lost | roots.repeated(found))
            lost[some] = ~kept
            if kept.any():
                own = found.select(kept)
                value[some[kept]] = _refine_decays(self.plant, block, own)
                motion[some[kept]] = own.motions([block], self.plant.model.size)
        return value, motion, lost

    def find_coincident(
        self,
        start: _Starts,
        value: Complex[np.ndarray, " pole"],
        lost: Bool[np.ndarray, " pole"],
    ) -> None:
        """Find lost poles, in place, that coincide with others, as those of the halves of a blend.

        Such poles share one shape, so that a search finds one of them and with few digits. They are
        found by their number and their sum.
        """
        pencil = self.plant.solver.pencil
        for n in np.flatnonzero(lost & (start.value != 0)):
            centre = complex(start.value[n])
            radius = BY_NUMBER * abs(centre)
            near = np.abs(start.value - centre) < radius
            if not lost[n] or near.sum() < 2:
                continue
            loss = "all" if centre.imag else "dampers"
            count, first, second = roots.sums_within(pencil, self.block, centre, radius, loss)
            mean = first / near.sum()
            spread = abs(second / near.sum() - mean**2) ** 0.5
            if abs(count - near.sum()) < WHOLE and spread < COINCIDENT * radius:
                found = centre + mean
                # real ones stay real: the sum has an imaginary part from rounding
                value[near & lost] = found if centre.imag else found.real
                lost &= ~near

    def search_again(
        self, value: Complex[np.ndarray, " pole"], missing: Bool[np.ndarray, " pole"]
    ) -> None:
        """Find poles that are missing, in place: from those of digital filters with the loops open.

        They are followed while the gain of the loops rises.
        """
        loops = self.block.loops
        parts = [one for loop in loops for one in loop.filter.parts if one.rate]
        every = [move_pole(-2 * np.pi * pole, one.rate) for one in parts for pole in one.poles]
        start = np.array([one for one in every if np.isfinite(one) and one != 0], dtype=complex)
        if not missing.any() or not len(start):
            return
        found = np.unique(start)
        for share in RISING:
            filters = [replace(one.filter, gain=one.filter.gain * share) for one in loops]
            scaled = tuple(
                replace(one, filter=own) for one, own in zip(loops, filters, strict=True)
            )
            within = replace(self, block=replace(self.block, loops=scaled))
            still = np.zeros((len(found), self.plant.model.size), dtype=complex)
            found, _, lost = within.refine(_Starts(found, ("",) * len(found), still))
            found = found[~lost]
        highest = np.pi * max(one.rate for one in parts) * (1 + SAME)
        for pole in found:
            known = np.isclose(value[~missing], pole, rtol=SAME, atol=0.0).any()
            if missing.any() and not known and np.imag(pole) <= highest:
                free = np.flatnonzero(missing)[0]
                value[free] = pole
                missing[free] = False


def _forces(block: ClosedBlock, found: Roots) -> Complex[np.ndarray, "loop root"]:
    """Outputs of the filters of a block, which are its last unknowns."""
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
