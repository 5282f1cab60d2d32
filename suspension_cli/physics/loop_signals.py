"""Inputs and outputs of closed loops by name, their responses, and the state space between them.

Besides motions and forces there are, by the names of loops, sensors and OSEMs,

- inputs ``sensor.NAME``, noise of a sensor as motion, and ``actuator.NAME``, a force (torque) that
  is added to that of a loop or coil, as its noise is;
- outputs ``sensor.NAME``, the reading of a sensor with its noise (of a loop that reads a motion by
  its own name before `sensor_response`), and ``drive.NAME``, the force that a loop demands, or that
  is demanded of a coil.

With the coordinates q, readings y of channels, their noise n, and the outputs v of all filters
(`loop_network`), an output is the sum f . q + r . (y + n) + d . v.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elimination import connected_groups
from suspension_cli.errors import InputError, format_value, suggest
from suspension_cli.linear import response, signals
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.statespace import Poles
from suspension_cli.physics import closed_loop, local_control

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float

    from suspension_cli.design.schema import Design
    from suspension_cli.linear.solver import Solvable
    from suspension_cli.linear.statespace import StateSpace
    from suspension_cli.physics.local_control import Plant

SENSOR = "sensor"
ACTUATOR = "actuator"
DRIVE = "drive"
"""First parts of the names of signals of loops."""

Motions = Sequence[tuple[float, Signal]]
"""Motions or forces with factors."""


@dataclass(frozen=True)
class End:
    """An input or output of closed loops.

    Attributes
    ----------
    signal
        Name, unit, and whether it is a force.
    motions
        Forces, given motions or observed motions of bodies that it is the sum of.
    channel
        Factors of the readings of channels with their noise; of an input, what is added to these.
    node
        Factors of the outputs of filters; of an input 0.
    """

    signal: Signal
    motions: Motions
    channel: Float[np.ndarray, " channel"]
    node: Float[np.ndarray, " node"]

    def form(self, plant: Plant) -> Float[np.ndarray, " coordinate"]:
        """Linear form of the motions in the coordinates of a plant."""
        result = np.zeros(plant.model.size)
        for factor, signal in self.motions:
            result += factor * signals.linear_form(signal, plant.model)
        return result


@dataclass(frozen=True)
class ClosedLoops:
    """Loops of a design that are closed, between inputs and outputs by name.

    Attributes
    ----------
    design
        With `[control]`.
    inputs, outputs
        What drives the loops from outside, and what is observed.
    kept
        Numbers of the filters through which inputs may reach outputs, or that are tied to these.
    """

    design: Design
    inputs: tuple[End, ...]
    outputs: tuple[End, ...]
    kept: list[int] = field(default_factory=list)

    def plant(self, system: Solvable) -> Plant:
        """Build the plant of a model, with the filters that are kept."""
        return local_control.build_plant(self.design, system).select(self.kept)

    def build(self, system: Solvable) -> StateSpace:
        """Build the state space of a model without wire mass, with its loops closed."""
        plant = self.plant(system)
        entering = self._channels(self.inputs) @ plant.network.of_channels.T
        # what a reading has of the noise of its channel goes past the loops
        read = self._channels(self.outputs)
        forms = self._forms(self.outputs, plant) + read @ plant.sensed
        made = closed_loop.close_loops(
            plant,
            [one.signal for one in self.inputs],
            self._forms(self.inputs, plant),
            [one.signal for one in self.outputs],
            forms,
            entering,
            self._nodes(self.outputs),
        )
        return replace(made, d=made.d + read @ self._channels(self.inputs).T)

    def solve(
        self, system: Solvable, frequency: Float[np.ndarray, " frequency"], more: Sequence[Signal]
    ) -> Complex[np.ndarray, "frequency output input"]:
        """Solve the complete equations at frequencies in Hz, with `more` motions as last outputs.

        With the readings r of channels and their noise, v = T r, and K the rows of T of loops,

            u = -(1 + K G_yu)^-1 K (G_ye e + n),    r = G_ye e + n + G_yu u.
        """
        plant = self.plant(system)
        inputs = self._forms(self.inputs, plant)
        outputs = self._forms(self.outputs, plant)
        others = [signals.linear_form(one, plant.model) for one in more]
        others = np.reshape(others, (len(more), plant.model.size))
        observed = np.concatenate([outputs, others])
        loops = len(plant.loops)
        opened, _ = response.transfer(
            plant.solver,
            2 * np.pi * frequency,
            np.concatenate([inputs, plant.pushed]),
            [*(one.signal.acts for one in self.inputs), *[True] * loops],
            np.concatenate([observed, plant.sensed]),
        )
        moved, read = np.split(opened, [len(observed)], axis=1)
        moved, pushed = np.split(moved, [len(inputs)], axis=2)
        read, fed_back = np.split(read, [len(inputs)], axis=2)
        read = read + self._channels(self.inputs).T
        of_nodes = plant.network.solve(frequency)
        k = of_nodes[:, :loops]
        forces = -np.linalg.solve(np.eye(loops) + k @ fed_back, k @ read)
        read = read + fed_back @ forces
        value = moved + pushed @ forces
        value[:, : len(outputs)] += self._channels(self.outputs) @ read
        value[:, : len(outputs)] += self._nodes(self.outputs) @ of_nodes @ read
        return value

    def reduced_to_involved(self, plant: Plant) -> ClosedLoops:
        """Keep only filters through which inputs may reach outputs."""
        return replace(self, kept=np.flatnonzero(self._find_involved(plant)[1]).tolist())

    def _find_involved(
        self, plant: Plant
    ) -> tuple[Bool[np.ndarray, " coordinate"], Bool[np.ndarray, " node"]]:
        """Find coordinates and filters in groups that inputs drive and outputs observe."""
        network = plant.network
        coupled = plant.solver.pencil.coupled
        size = plant.model.size
        coupled = coupled[:size, :size]
        touched = (plant.node_sensed != 0) | (plant.node_pushed != 0)
        linked = np.block(
            [
                [coupled[6:, 6:], touched[:, 6:].T],
                [touched[:, 6:], network.of_nodes != 0],
            ]
        )
        forms = self._forms(self.inputs, plant)
        acts = np.array([one.signal.acts for one in self.inputs], dtype=bool)
        moved = (forms[~acts, :6] != 0).any(0)
        entering = (self._channels(self.inputs) != 0).any(0)
        driven = np.concatenate(
            [
                (forms[acts, 6:] != 0).any(0) | coupled[6:, :6][:, moved].any(1),
                (plant.node_sensed[:, :6] != 0)[:, moved].any(1)
                | (network.of_channels != 0)[:, entering].any(1),
            ]
        )
        read = (self._channels(self.outputs) != 0).any(0)
        seen = (self._forms(self.outputs, plant) != 0).any(0) | (plant.sensed[read] != 0).any(0)
        demanded = np.array([one.node for one in self.outputs]) != 0
        observed = np.append(seen[6:], demanded.any(0))
        result = np.zeros(len(linked), dtype=bool)
        for group in connected_groups(linked):
            result[group] = driven[group].any() and observed[group].any()
        own, filters = np.split(result, [size - 6])
        return np.append(np.zeros(6, dtype=bool), own), filters

    def observed(self) -> list[Signal]:
        """List the outputs, of which those of bodies are motions."""
        return [one.signal for one in self.outputs]

    def select(self, system: Solvable, poles: Poles) -> Poles:
        """Select the poles that are in the state space: of coordinates and filters involved."""
        plant = local_control.build_plant(self.design, system)
        involved = self._find_involved(plant)[0]
        names = [plant.network.nodes[n].name for n in self.kept]
        assert poles.motion is not None
        moves = poles.motion[:, : plant.model.size][:, involved].any(1)
        of_filter = [state.rpartition(" ")[0] in names for state in poles.state]
        some = np.flatnonzero(moves | np.array(of_filter, dtype=bool))
        states = tuple(poles.state[n] for n in some)
        return Poles(poles.value[some], states, poles.motion[some])

    def pairs(self, system: Solvable) -> tuple[list[Signal], list[Signal]]:
        """List the forces and motions of bodies that pass through the mechanics.

        Those of inputs and of loops that are kept, and those of outputs and of their sensors.
        """
        plant = local_control.build_plant(self.design, system)
        network = plant.network.select(self.kept)
        known = signals.bodies_with_signals(plant.model)
        loops = [plant.loops[n] for n in self.kept if n < len(plant.loops)]
        ends = [local_control.parse_actuator(loop, plant.osems, known) for loop in loops]
        read = (network.of_channels != 0).any(0) | (self._channels(self.outputs) != 0).any(0)
        drives = [*(one.motions for one in self.inputs), *(one.motions for one in ends)]
        channels = [one for one, wanted in zip(plant.channels, read, strict=True) if wanted]
        moved = [*(one.motions for one in self.outputs), *(one.motions for one in channels)]
        return _distinct(drives), _distinct(moved)

    def _forms(self, ends: Sequence[End], plant: Plant) -> Float[np.ndarray, "end coordinate"]:
        return np.reshape([one.form(plant) for one in ends], (len(ends), plant.model.size))

    def _channels(self, ends: Sequence[End]) -> Float[np.ndarray, "end channel"]:
        return np.array([one.channel for one in ends])

    def _nodes(self, ends: Sequence[End]) -> Float[np.ndarray, "end node"]:
        return np.array([one.node for one in ends])[:, self.kept]


def _distinct(sums: Sequence[Motions]) -> list[Signal]:
    """List the motions or forces of sums once each, without those of the ground."""
    every = [signal for motions in sums for _, signal in motions if not signal.is_ground]
    return list({replace(signal, text=""): signal for signal in every}.values())


def parse(
    design: Design, system: Solvable, inputs: Sequence[str], outputs: Sequence[str]
) -> ClosedLoops:
    """Parse inputs and outputs of the closed loops of a design; filters not involved are left out.

    Raises `InputError` if there is none of a name, or if its response grows with frequency.
    """
    plant = local_control.build_plant(design, system)
    known = _Known(design, plant)
    closed = ClosedLoops(
        design,
        tuple(known.input(text) for text in inputs),
        tuple(known.output(text) for text in outputs),
    )
    every = replace(closed, kept=list(range(len(plant.network.nodes))))
    return every.reduced_to_involved(plant)


def list_names(design: Design, system: Solvable) -> tuple[list[str], list[str]]:
    """List the inputs and the outputs that are no motions of bodies and no forces on these."""
    known = _Known(design, local_control.build_plant(design, system))
    return [*known.sensor_noise, *known.actuator_noise], [*known.readings, *known.drives]


@dataclass(frozen=True)
class _Known:
    """Signals of the loops of a plant by their names."""

    design: Design
    plant: Plant

    def input(self, text: str) -> End:
        """Parse an input."""
        if text.partition(".")[0] in (SENSOR, ACTUATOR):
            return _find(text, "--input", self.sensor_noise | self.actuator_noise)
        known = signals.bodies_with_signals(self.plant.model)
        return self._of_body(signals.parse_input(text, known))

    def output(self, text: str) -> End:
        """Parse an output."""
        if text.partition(".")[0] in (SENSOR, DRIVE):
            return _find(text, "--output", self.readings | self.drives)
        known = signals.bodies_with_signals(self.plant.model)
        return self._of_body(signals.parse_output(text, known))

    @property
    def sensor_noise(self) -> dict[str, End]:
        """Noise of sensors, but for those of dampers, whose force grows with its frequency."""
        plant = self.plant
        damped = plant.network.of_channels[: len(plant.loops)][self._dampers].any(0)
        rows = [*np.eye(len(plant.channels)), *plant.reading.T]
        # OSEMs read in m
        dofs = [*(one.motions[0][1].dof for one in plant.channels), *[0] * len(plant.osems)]
        found = {}
        for one, row, dof in zip(plant.sensors, rows, dofs, strict=True):
            if not (row != 0)[damped].any():
                signal = _named(f"{SENSOR}.{one.name}", dof, acts=False)
                found[signal.text] = End(signal, (), row, self._none)
        return found

    @property
    def actuator_noise(self) -> dict[str, End]:
        """Forces that are added to those of loops and coils."""
        plant = self.plant
        motions = [*self._pushed, *map(local_control.coil_forces, plant.osems)]
        none = np.zeros(len(plant.channels))
        found = {}
        for one, pushed in zip(plant.actuators, motions, strict=True):
            signal = _named(f"{ACTUATOR}.{one.name}", pushed[0][1].dof, acts=True)
            found[signal.text] = End(signal, pushed, none, self._none)
        return found

    @property
    def readings(self) -> dict[str, End]:
        """Readings of sensors, and what loops read of motions by their own names."""
        plant = self.plant
        network = plant.network
        unit = np.eye(len(network.nodes))
        nodes = [one.name for one in network.nodes]
        found = {}
        for n, channel in enumerate(plant.channels):
            row = np.eye(len(plant.channels))[n]
            node = self._none
            if (responds := f"{SENSOR} {channel.name}") in nodes:
                row = np.zeros(len(plant.channels))
                node = unit[nodes.index(responds)]
            signal = _named(f"{SENSOR}.{channel.name}", channel.motions[0][1].dof, acts=False)
            found[signal.text] = End(signal, (), row, node)
        control = self.design.control
        for n, loop in enumerate(plant.loops):
            sensor = None if control is None else control.named_sensor(loop)
            if sensor is None or sensor.motions:
                continue
            signal = _named(f"{SENSOR}.{sensor.name}", self._pushed[n][0][1].dof, acts=False)
            found[signal.text] = End(signal, (), network.of_channels[n], network.of_nodes[n])
        return found

    @property
    def drives(self) -> dict[str, End]:
        """Forces demanded by loops, but for dampers, and of coils that these do not drive."""
        plant = self.plant
        loops = len(plant.loops)
        none = np.zeros(len(plant.channels))
        rows = [*np.eye(loops), *plant.driving]
        motions = [*self._pushed, *map(local_control.coil_forces, plant.osems)]
        found = {}
        for one, row, pushed in zip(plant.actuators, rows, motions, strict=True):
            if (row != 0)[self._dampers].any():
                continue
            signal = _named(f"{DRIVE}.{one.name}", pushed[0][1].dof, acts=True)
            node = np.pad(-row, (0, len(self._none) - loops))
            found[signal.text] = End(signal, (), none, node)
        return found

    @property
    def _dampers(self) -> Bool[np.ndarray, " loop"]:
        """Which loops have a force that grows with frequency."""
        loops = self.plant.loops
        alone = (loop.damper is not None and loop.sensor_response is None for loop in loops)
        return np.array([*alone], dtype=bool)

    @property
    def _none(self) -> Float[np.ndarray, " node"]:
        return np.zeros(len(self.plant.network.nodes))

    @property
    def _pushed(self) -> list[Motions]:
        """Forces of loops."""
        known = signals.bodies_with_signals(self.plant.model)
        parsed = (
            local_control.parse_actuator(loop, self.plant.osems, known) for loop in self.plant.loops
        )
        return [one.motions for one in parsed]

    def _of_body(self, signal: Signal) -> End:
        """Make the end that is a motion or a force."""
        return End(signal, [(1.0, signal)], np.zeros(len(self.plant.channels)), self._none)


def _named(text: str, dof: int, *, acts: bool) -> Signal:
    """Make a signal of the loops, of the unit of a motion or force along a coordinate."""
    return Signal(text, "", dof, (0.0, 0.0, 0.0), acts)


def _find(text: str, option: str, known: dict[str, End]) -> End:
    """Find a signal by its name."""
    if text in known:
        return known[text]
    problem = "is no signal of the loops, or one that grows with frequency, of a damper"
    raise InputError.of(option, problem, suggest(text, list(known)), format_value(text))
