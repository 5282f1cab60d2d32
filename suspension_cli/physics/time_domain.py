"""Closed loops in time: exact mechanics between samples, and filters as in a front end.

At each sample the sensors are read, the filters run, and the forces of actuators are held until the
next one. The mechanics with constant losses, x' = A x + B w, then moves by

    x_(k+1) = exp(A T) x_k + (integral of exp(A t) B over T) w_k

(Franklin, Powell and Workman, Digital Control of Dynamic Systems, 3rd ed., section 4.3). Motions of
the support are held, too, so the rate has to be high above their frequencies. Filters at a divisor
of the rate (`sampled_filters`) make the system periodic: it has matrices of its own for each sample
of a period, in which all of them run once or more.

Without forces at their limits, x_(k+1) = A x_k + f_k is computed for many groups of samples
together: first from rest, which gives the state at the end of each group with a power of A, then
again from these states.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.errors import InputError
from suspension_cli.linear import signals, statespace
from suspension_cli.linear.joined_systems import Matrices, side_by_side
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.statespace import StateSpace, with_constant_loss
from suspension_cli.physics import closed_loop, sampled_filters
from suspension_cli.physics.sampled_filters import Stage

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

    from suspension_cli.physics.local_control import Plant

BLOCK = 4096
"""Least number of samples that are advanced without a limit, before forces are compared with it."""
GROUP = 16
"""Least number of samples of a group, of which a block has many."""
MOST_PERIOD = 4096
"""Most samples in which all filters run at least once."""
ROUNDING = 1e-9
"""Excess of |z| over 1 of a motion without loss, by rounding errors."""
MUCH = 0.1
"""Part of the growth that is left where a loop that causes it is open."""


def hold(system: StateSpace, step: float) -> Matrices:
    """Discretise a system whose inputs are held over steps (s)."""
    from scipy.linalg import expm

    states = len(system.a)
    inputs = system.b.shape[1]
    whole = np.zeros((states + inputs, states + inputs))
    whole[:states, :states] = system.a
    whole[:states, states:] = system.b
    moved = np.asarray(expm(whole * step))
    return Matrices(moved[:states, :states], moved[:states, states:], system.c, system.d)


@dataclass(frozen=True)
class Actuator:
    """What pushes: a coil, or a loop without coils.

    Attributes
    ----------
    limit
        Largest force, N or N m; infinite if none is given.
    """

    name: str
    unit: str
    limit: float


@dataclass(frozen=True)
class Sampled:
    """A plant with its loops closed at a sample rate.

    Inputs are motions of the support, external forces, noise of channels and noise of actuators;
    outputs are motions, then forces of actuators without their noise.

    Attributes
    ----------
    mechanics
        From forces of actuators, external forces and motions of the support to readings of channels
        and motions.
    filters
        Of each node, in series.
    to_nodes, between
        Readings of nodes from channels, and from outputs of nodes.
    to_actuators
        Forces of actuators from outputs of nodes.
    motions
        Number of motions observed.
    """

    rate: float
    actuators: tuple[Actuator, ...]
    mechanics: Matrices
    filters: tuple[tuple[Stage, ...], ...]
    to_nodes: Float[np.ndarray, "node channel"]
    between: Float[np.ndarray, "node node"]
    to_actuators: Float[np.ndarray, "actuator node"]
    motions: int

    @property
    def limits(self) -> Float[np.ndarray, " actuator"]:
        """Largest forces, N or N m."""
        return np.array([one.limit for one in self.actuators])

    @property
    def intervals(self) -> tuple[int, ...]:
        """Numbers of samples at which filters run."""
        return tuple(sorted({stage.every for node in self.filters for stage in node}))

    @property
    def period(self) -> int:
        """Number of samples after which the same filters run again."""
        return math.lcm(*self.intervals)

    def phases(self) -> list[Matrices]:
        """Close the loops at each sample of a period; see `linear`."""
        known: dict[tuple[bool, ...], Matrices] = {}
        found = []
        for sample in range(self.period):
            running = tuple(sample % every == 0 for every in self.intervals)
            if running not in known:
                known[running] = self.linear(sample)
            found.append(known[running])
        return found

    def with_open_loop(self, number: int) -> Sampled:
        """Open one loop."""
        nothing = Stage(replace(Matrices.unchanged(), d=np.zeros((1, 1))))
        return replace(
            self, filters=(*self.filters[:number], (nothing,), *self.filters[number + 1 :])
        )

    def linear(self, sample: int = 0) -> Matrices:
        """Close the loops at a sample, without limits; states of the mechanics come first.

        Inputs are those of the class; outputs motions, then forces of actuators.
        """
        plant = self.mechanics
        nodes = side_by_side([sampled_filters.in_series(node, sample) for node in self.filters])
        count = len(self.actuators)
        channels = self.to_nodes.shape[1]
        # outputs of nodes from states of filters and readings of channels
        loop = np.linalg.inv(np.eye(len(self.between)) - nodes.d @ self.between)
        of_state = loop @ nodes.c
        of_reading = loop @ nodes.d @ self.to_nodes
        reading = plant.c[:channels]
        direct = plant.d[:channels, count:]
        force_of_states = self.to_actuators @ np.hstack([of_reading @ reading, of_state])
        noise = np.eye(channels)
        force_of_inputs = self.to_actuators @ np.hstack([of_reading @ direct, of_reading @ noise])
        pushed = plant.b[:, :count]
        zero = np.zeros((len(plant.a), len(nodes.a)))
        to_filters = self.to_nodes + self.between @ of_reading
        states = np.block(
            [
                [plant.a, zero],
                [nodes.b @ to_filters @ reading, nodes.a + nodes.b @ self.between @ of_state],
            ]
        )
        states[: len(plant.a)] += pushed @ force_of_states
        external = plant.d.shape[1] - count
        of_noise = np.zeros((len(plant.a), channels))
        inputs = np.block(
            [
                [plant.b[:, count:], of_noise, pushed],
                [
                    nodes.b @ to_filters @ direct,
                    nodes.b @ to_filters,
                    np.zeros((len(nodes.a), count)),
                ],
            ]
        )
        inputs[: len(plant.a), : external + channels] += pushed @ force_of_inputs
        moved = np.hstack([plant.c[channels:], np.zeros((self.motions, len(nodes.a)))])
        direct_moved = np.hstack(
            [plant.d[channels:, count:], np.zeros((self.motions, channels + count))]
        )
        direct_force = np.hstack([force_of_inputs, np.zeros((count, count))])
        outputs = np.concatenate([moved, force_of_states])
        through = np.concatenate([direct_moved, direct_force])
        return Matrices(states, inputs, outputs, through)

    def run(
        self,
        take: Callable[[int], Float[np.ndarray, "sample input"]],
        count: int,
        block: int = BLOCK,
    ) -> Iterator[tuple[Float[np.ndarray, "sample output"], Bool[np.ndarray, "sample actuator"]]]:
        """Run from rest: outputs block by block, and where each actuator was at its limit.

        `take` returns the inputs of the next samples, of `count` in all.
        """
        advance = _Advance(self.phases())
        limits = self.limits
        block = -(-block // advance.group) * advance.group
        state = np.zeros(len(advance.phases[0].a))
        for start in range(0, count, block):
            length = min(block, count - start)
            given = np.zeros((block, advance.phases[0].b.shape[1]))
            given[:length] = take(length)
            forced = advance.by_phase(given, "b")
            path, end = advance.linear(state, forced)
            found = advance.by_phase(path, "c") + advance.by_phase(given, "d")
            over = np.abs(found[:, self.motions :]) > limits
            if over.any():
                found, end = self._advance_limited(advance.phases, state, forced, given)
                over = np.abs(found[:, self.motions :]) > limits
                found[:, self.motions :] = np.clip(found[:, self.motions :], -limits, limits)
            state = end
            yield found[:length], over[:length]

    def _advance_limited(
        self,
        phases: Sequence[Matrices],
        state: Float[np.ndarray, " state"],
        forced: Float[np.ndarray, "sample state"],
        given: Float[np.ndarray, "sample input"],
    ) -> tuple[Float[np.ndarray, "sample output"], Float[np.ndarray, " state"]]:
        """Advance with forces of actuators within limits; their outputs are what was demanded.

        The state after the last sample follows.
        """
        limits = self.limits
        pushed = self.mechanics.b[:, : len(limits)]
        outputs = np.empty((len(given), len(phases[0].c)))
        for n, more in enumerate(forced):
            whole = phases[n % len(phases)]
            outputs[n] = whole.c @ state + whole.d @ given[n]
            demanded = outputs[n, self.motions :]
            short = np.clip(demanded, -limits, limits) - demanded
            state = whole.a @ state + more
            state[: len(pushed)] += pushed @ short
        return outputs, state


class _Advance:
    """Advances a periodic system by many groups of samples together."""

    def __init__(self, phases: Sequence[Matrices]) -> None:
        self.phases = phases
        self.group = -(-GROUP // len(phases)) * len(phases)
        self.over_group = _product(phases, self.group)

    def by_phase(
        self, rows: Float[np.ndarray, "sample column"], name: str
    ) -> Float[np.ndarray, "sample row"]:
        """Multiply each sample by the matrix of this name in its phase."""
        period = len(self.phases)
        found = np.empty((len(rows), len(getattr(self.phases[0], name))))
        for n, phase in enumerate(self.phases):
            found[n::period] = rows[n::period] @ getattr(phase, name).T
        return found

    def linear(
        self, state: Float[np.ndarray, " state"], forced: Float[np.ndarray, "sample state"]
    ) -> tuple[Float[np.ndarray, "sample state"], Float[np.ndarray, " state"]]:
        """States at each of whole groups of samples, and after the last."""
        steps = forced.reshape(-1, self.group, len(state))
        change = [self.phases[n % len(self.phases)].a.T for n in range(self.group)]
        from_rest = np.zeros(steps[:, 0].shape)
        for n in range(self.group):
            from_rest = from_rest @ change[n] + steps[:, n]
        now = np.empty_like(from_rest)
        for n, more in enumerate(from_rest):
            now[n] = state
            state = self.over_group @ state + more
        path = np.empty_like(steps)
        for n in range(self.group):
            path[:, n] = now
            now = now @ change[n] + steps[:, n]
        return path.reshape(forced.shape), state


def _product(phases: Sequence[Matrices], count: int) -> Float[np.ndarray, "state state"]:
    """Change of the state over some samples, without inputs."""
    whole = np.eye(len(phases[0].a))
    for n in range(count):
        whole = phases[n % len(phases)].a @ whole
    return whole


def sample(
    plant: Plant,
    rate: float,
    forces: Sequence[Signal],
    ground: Sequence[Signal],
    outputs: Sequence[Signal],
) -> Sampled:
    """Sample a plant with its loops at a rate (Hz).

    The inputs of the result are forces (external ones), then motions of the support (`ground`).
    Raises `InputError` for filters that do not fit the rate, for sensors of the ground, and for
    coils with a range whose driver has a response.
    """
    model = with_constant_loss(plant.model)
    of_osems = np.abs(plant.driving).sum(0) > 0
    coils = plant.coils
    alone = np.flatnonzero(~of_osems).tolist()
    pushed = np.concatenate([coils, plant.pushed[alone]])
    for channel in plant.channels:
        if channel.on_ground.any():
            key = f"control.sensor.{channel.name}.motion"
            problem = "reads the ground, which simulate does not move"
            raise InputError.of(key, problem, "take support")
    for osem in plant.osems:
        if osem.range is not None and osem.driver_response is not None:
            problem = "is a voltage, but simulate does not compute that before driver_response"
            remedy = "leave out range, or driver_response"
            raise InputError.of(f"control.osem.{osem.name}.range", problem, remedy)
    external = [signals.linear_form(one, model) for one in (*forces, *ground)]
    rows = [*plant.sensed, *(signals.linear_form(one, model) for one in outputs)]
    inputs = [*[closed_loop.LOOP] * len(pushed), *forces, *ground]
    drives = np.concatenate([pushed, np.reshape(external, (len(external), model.size))])
    watched = [*[closed_loop.LOOP] * len(plant.sensed), *outputs]
    system = statespace.assemble(model, drives, inputs, np.array(rows), watched)
    dampers = [loop.damper is not None for loop in plant.loops]
    dampers += [False] * (len(plant.network.nodes) - len(dampers))
    filters = tuple(
        sampled_filters.make_stages(node, rate, damper=damper)
        for node, damper in zip(plant.network.nodes, dampers, strict=True)
    )
    to_actuators = np.zeros((len(pushed), len(filters)))
    loops = len(plant.loops)
    to_actuators[: len(coils), :loops] = -plant.driving
    for row, number in enumerate(alone, len(coils)):
        to_actuators[row, number] = -1.0
    actuators = [Actuator(one.name, "N", one.largest_force) for one in plant.osems]
    for number in alone:
        loop = plant.loops[number]
        actuators.append(Actuator(loop.name, signals.unit_of(loop.actuator), np.inf))
    made = Sampled(
        rate=rate,
        actuators=tuple(actuators),
        mechanics=hold(system, 1 / rate),
        filters=filters,
        to_nodes=plant.network.of_channels,
        between=plant.network.of_nodes,
        to_actuators=to_actuators,
        motions=len(outputs),
    )
    if made.period > MOST_PERIOD:
        problem = f"is a multiple of the rates of all filters only every {made.period:,} samples"
        remedy = f"give rates that meet within {MOST_PERIOD:,} samples"
        raise InputError.of("--rate", problem, remedy, f"{rate:g}")
    return made


def largest_growth(sampled: Sampled) -> float:
    """Largest factor of the state per sample, |z|; above 1 it grows."""
    period = sampled.period
    change = _product(sampled.phases(), period)
    return float(np.abs(np.linalg.eigvals(change)).max(initial=0.0)) ** (1 / period)


def find_growing_loops(sampled: Sampled, loops: int) -> list[int]:
    """Find the loops of an unstable system without any of which it grows much less."""
    most = 1 + max(MUCH * (largest_growth(sampled) - 1), ROUNDING)
    return [n for n in range(loops) if largest_growth(sampled.with_open_loop(n)) < most]
