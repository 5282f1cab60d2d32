"""Closed loops in time: exact mechanics between samples, and filters as in a front end.

At each sample the sensors are read, the filters run, and the forces of actuators are held until the
next one. The mechanics with constant losses, x' = A x + B w, then moves by

    x_(k+1) = exp(A T) x_k + (integral of exp(A t) B over T) w_k

(Franklin, Powell and Workman, Digital Control of Dynamic Systems, 3rd ed., section 4.3). Motions of
the support are held, too, so the rate has to be high above their frequencies. A filter in
w = 2 rate (z - 1)/(z + 1) (`design.foton`) has its zeros and poles at z = (1 - pi r / rate) /
(1 + pi r / rate); a continuous one is made digital as Foton does. A delay is a number of samples.

Noise of a one-sided density P is white noise of the density 1 times sqrt(P) in the frequencies of
the whole run, so its spectrum is exact and repeats with the run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design import foton
from suspension_cli.design.foton import Filter
from suspension_cli.errors import InputError
from suspension_cli.linear import signals, statespace
from suspension_cli.linear.joined_systems import Matrices, side_by_side
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.statespace import StateSpace, with_constant_loss
from suspension_cli.physics import closed_loop

if TYPE_CHECKING:
    from jaxtyping import Bool, Float
    from numpy.random import Generator

    from suspension_cli.physics.local_control import Plant
    from suspension_cli.physics.loop_network import Node

TOGETHER = 4096
"""Samples that are advanced without a limit, before forces are compared with their limits."""
MOST_DELAY = 4096
"""Most samples of a delay."""
WHOLE = 1e-6
"""Distance from a whole number of samples up to which a delay is one."""


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


def digitise(node: Node, rate: float, *, damper: bool) -> Matrices:
    """Make the discrete system of a filter at a sample rate (Hz), with its delay.

    A `damper` gets Foton's pole at rate / pi. Raises `InputError` for a filter of another rate,
    one that does not fit below half the rate, or a delay of too many samples.
    """
    made = Matrices.unchanged()
    for part in node.filter.parts:
        made = made.then(_sections(_at_rate(part, rate, node.key, damper=damper), rate))
    samples = count_delay(node, rate)
    if samples > MOST_DELAY:
        problem = f"has a delay of {samples:,} samples, more than {MOST_DELAY:,}"
        raise InputError.of(node.key, problem, "lower --rate")
    if samples:
        shift = np.eye(samples, k=-1)
        first = np.eye(samples, 1)
        last = np.eye(1, samples, k=samples - 1)
        made = made.then(Matrices(shift, first, last, np.zeros((1, 1))))
    return made


def count_delay(node: Node, rate: float) -> int:
    """Number of samples to which the delay of a filter is rounded at a sample rate (Hz)."""
    return round(node.delay * rate)


def rounded_delays(plant: Plant, rate: float) -> list[str]:
    """Describe the delays that are no whole number of samples at a rate (Hz)."""
    found = []
    for node in plant.network.nodes:
        samples = count_delay(node, rate)
        if abs(node.delay * rate - samples) > WHOLE:
            delay = f"the delay of {node.delay:g} s"
            found.append(f"{node.key}: {delay} is rounded to {samples} samples")
    return found


def _at_rate(part: Filter, rate: float, key: str, *, damper: bool) -> Filter:
    """Make a filter digital, unless it is."""
    if part.rate == rate:
        return part
    if part.rate:
        problem = f"has a rate of {part.rate:g} Hz"
        raise InputError.of(key, problem, f"give --rate {part.rate:g}")
    try:
        made = foton.change_rate(part, rate)
    except foton.FotonError as error:
        raise InputError.of(key, error.problem, error.remedy) from None
    if damper:
        pole = rate / np.pi
        made = Filter(made.gain * pole, made.zeros, (*made.poles, complex(pole)), rate)
    return made


def _sections(part: Filter, rate: float) -> Matrices:
    """Make the discrete system of a digital filter, in sections of second order."""
    from scipy.signal import tf2ss, zpk2sos

    def move(roots: tuple[complex, ...]) -> tuple[np.ndarray, float]:
        scaled = np.pi * np.array(roots, dtype=complex) / rate
        return (1 - scaled) / (1 + scaled), float(np.real(np.prod((1 + scaled) * rate / np.pi)))

    zeros, over = move(part.zeros)
    poles, under = move(part.poles)
    zeros = np.append(zeros, -np.ones(len(poles) - len(zeros)))
    made = Matrices.unchanged()
    if not len(poles):
        return replace(made, d=np.full((1, 1), part.gain))
    for section in zpk2sos(zeros, poles, part.gain * over / under):
        above, below = np.split(section, 2)
        if not below[2] and not above[2]:
            above, below = above[:2], below[:2]
        made = made.then(Matrices(*tf2ss(above, below)))
    return made


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
        From readings of nodes to their outputs.
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
    filters: Matrices
    to_nodes: Float[np.ndarray, "node channel"]
    between: Float[np.ndarray, "node node"]
    to_actuators: Float[np.ndarray, "actuator node"]
    motions: int

    @property
    def limits(self) -> Float[np.ndarray, " actuator"]:
        """Largest forces, N or N m."""
        return np.array([one.limit for one in self.actuators])

    def linear(self) -> Matrices:
        """Close the loops without limits; states of the mechanics come first.

        Inputs are those of the class; outputs motions, then forces of actuators.
        """
        plant = self.mechanics
        nodes = self.filters
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
        given: Float[np.ndarray, "sample input"],
        progress: Callable[[int], None] = lambda _: None,
    ) -> tuple[Float[np.ndarray, "sample output"], Bool[np.ndarray, "sample actuator"]]:
        """Run from rest: outputs, and where each actuator was at its limit."""
        whole = self.linear()
        limits = self.limits
        state = np.zeros(len(whole.a))
        outputs = np.empty((len(given), len(whole.c)))
        limited = np.zeros((len(given), len(limits)), dtype=bool)
        for start in range(0, len(given), TOGETHER):
            some = slice(start, start + TOGETHER)
            forced = given[some] @ whole.b.T
            path = _advance(whole.a, state, forced)
            found = path[:-1] @ whole.c.T + given[some] @ whole.d.T
            over = np.abs(found[:, self.motions :]) > limits
            if over.any():
                path, found = self._advance_limited(whole, state, forced, given[some])
                forces = found[:, self.motions :]
                over = np.abs(forces) > limits
                found[:, self.motions :] = np.clip(forces, -limits, limits)
            state = path[-1]
            outputs[some] = found
            limited[some] = over
            progress(min(start + TOGETHER, len(given)))
        return outputs, limited

    def _advance_limited(
        self,
        whole: Matrices,
        state: Float[np.ndarray, " state"],
        forced: Float[np.ndarray, "sample state"],
        given: Float[np.ndarray, "sample input"],
    ) -> tuple[Float[np.ndarray, "later state"], Float[np.ndarray, "sample output"]]:
        """Advance with forces of actuators within limits; their outputs are what was demanded."""
        limits = self.limits
        pushed = self.mechanics.b[:, : len(limits)]
        path = np.empty((len(forced) + 1, len(state)))
        path[0] = state
        outputs = given @ whole.d.T
        for n, more in enumerate(forced):
            outputs[n] += whole.c @ state
            demanded = outputs[n, self.motions :]
            short = np.clip(demanded, -limits, limits) - demanded
            state = whole.a @ state + more
            state[: len(pushed)] += pushed @ short
            path[n + 1] = state
        return path, outputs


def _advance(
    a: Float[np.ndarray, "state state"],
    state: Float[np.ndarray, " state"],
    forced: Float[np.ndarray, "sample state"],
) -> Float[np.ndarray, "later state"]:
    """States before each sample, and after the last."""
    path = np.empty((len(forced) + 1, len(state)))
    path[0] = state
    for n, more in enumerate(forced):
        state = a @ state + more
        path[n + 1] = state
    return path


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
    filters = [
        digitise(node, rate, damper=n < len(plant.loops) and plant.loops[n].damper is not None)
        for n, node in enumerate(plant.network.nodes)
    ]
    to_actuators = np.zeros((len(pushed), len(filters)))
    loops = len(plant.loops)
    to_actuators[: len(coils), :loops] = -plant.driving
    for row, number in enumerate(alone, len(coils)):
        to_actuators[row, number] = -1.0
    actuators = [Actuator(one.name, "N", one.largest_force) for one in plant.osems]
    for number in alone:
        loop = plant.loops[number]
        actuators.append(Actuator(loop.name, signals.unit_of(loop.actuator), np.inf))
    return Sampled(
        rate=rate,
        actuators=tuple(actuators),
        mechanics=hold(system, 1 / rate),
        filters=side_by_side(filters),
        to_nodes=plant.network.of_channels,
        between=plant.network.of_nodes,
        to_actuators=to_actuators,
        motions=len(outputs),
    )


def draw_noise(
    density: Callable[[Float[np.ndarray, " frequency"]], Float[np.ndarray, " frequency"]],
    count: int,
    rate: float,
    generator: Generator,
) -> Float[np.ndarray, " sample"]:
    """Draw noise of a one-sided amplitude spectral density, given at frequencies in Hz above 0."""
    white = generator.standard_normal(count) * np.sqrt(rate / 2)
    spectrum = np.fft.rfft(white)
    frequency = np.fft.rfftfreq(count, 1 / rate)
    spectrum[0] = 0.0
    spectrum[1:] *= density(frequency[1:])
    return np.fft.irfft(spectrum, count)


def largest_growth(whole: Matrices) -> float:
    """Largest modulus of the poles z of a closed loop; above 1 it grows."""
    return float(np.abs(np.linalg.eigvals(whole.a)).max(initial=0.0))
