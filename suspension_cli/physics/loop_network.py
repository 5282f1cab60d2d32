"""Filters of control loops as a network, from readings of sensors to forces.

Each filter is a node with the output v = N(f) (E y + W v): a sum of readings y of sensors, which
are the channels, and of outputs of nodes. The first nodes are the loops, whose forces are u = -v.
So with the diagonal matrix N of the filters, and the rows P of the loops,

    u = -K (y + n),    K = P (1 - N W)^-1 N E.

A loop that reads one sensor is one node, and K is diagonal. A computed sensor has a node for each
input that has a filter; what it reads of the force of a loop enters W. In a blend with the filters
F_k and the rest 1 - sum F_k the sum is taken as y_r + sum F_k (y_k - y_r), which needs no filter
for the rest.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.foton import Filter
from suspension_cli.design.loop_filters import make_response

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact

    from suspension_cli.design.control import Control, Loop
    from suspension_cli.design.loop_sensors import Sensor, SensorInput

Sum = dict[tuple[str, int], float]
"""Sum of readings of channels, ("channel", number), and outputs of nodes, ("node", number)."""


@dataclass(frozen=True)
class Node:
    """One filter, whose output is `delay` (s) late.

    `name` is that of its loop or of the input of a sensor, `key` what gives it in the design.
    """

    name: str
    filter: Filter
    delay: float = 0.0
    key: str = ""

    def at(
        self, frequency: Inexact[np.ndarray, "*frequency"] | complex
    ) -> Complex[np.ndarray, "*frequency"]:
        """Evaluate the filter with its delay at frequencies in Hz."""
        f = np.asarray(frequency)
        return self.filter.at(f) * np.exp(-2j * np.pi * self.delay * f)


def make_node(loop: Loop) -> Node:
    """Make the node of a loop: its filter, the response of its own sensor, and its delay.

    A filter of gain 0 has no poles: it feeds nothing, so they are no poles of the suspension.
    """
    key = f"control.loop.{loop.name}"
    made = loop.controller_and_sensor
    return Node(f"loop {loop.name}", made if made.gain else Filter(0.0), loop.delay, key)


@dataclass(frozen=True)
class Network:
    """Nodes, those of loops first, and what each reads.

    Attributes
    ----------
    loops
        Number of loops.
    of_channels, of_nodes
        E and W, see the start of this module.
    """

    nodes: tuple[Node, ...]
    loops: int
    of_channels: Float[np.ndarray, "node channel"]
    of_nodes: Float[np.ndarray, "node node"]

    def select(self, keep: list[int]) -> Network:
        """Keep some nodes, by number; their channels stay."""
        return Network(
            tuple(self.nodes[n] for n in keep),
            sum(n < self.loops for n in keep),
            self.of_channels[keep],
            self.of_nodes[np.ix_(keep, keep)],
        )

    @property
    def upstream(self) -> Bool[np.ndarray, "node node"]:
        """Which nodes each node reads, itself included, also through others."""
        reached = np.eye(len(self.nodes), dtype=bool) | (self.of_nodes != 0)
        for _ in self.nodes:
            reached = reached | (reached.astype(int) @ reached.astype(int) > 0)
        return reached

    def solve(
        self, frequency: Inexact[np.ndarray, " frequency"]
    ) -> Complex[np.ndarray, "frequency node channel"]:
        """Solve for the outputs of all nodes over the readings of channels, frequencies in Hz."""
        gains = np.array([node.at(frequency) for node in self.nodes], dtype=complex)
        gains = gains.reshape(len(self.nodes), len(frequency)).T[:, :, None]
        driven = gains * self.of_channels
        coupled = np.flatnonzero(self.of_nodes.any(0) | self.of_nodes.any(1))
        if len(coupled):
            own = np.ix_(coupled, coupled)
            matrix = np.eye(len(coupled)) - gains[:, coupled] * self.of_nodes[own]
            driven[:, coupled] = np.linalg.solve(matrix, driven[:, coupled])
        return driven

    def controllers(
        self, frequency: Float[np.ndarray, " frequency"]
    ) -> Complex[np.ndarray, "frequency loop channel"]:
        """Evaluate K from readings of channels to loops, whose forces are u = -K y, at Hz."""
        return self.solve(frequency)[:, : self.loops]


@dataclass
class _Builder:
    """Network that grows while sensors are asked for; each sensor becomes part of it once."""

    control: Control
    gravity: float
    nodes: list[Node] = field(default_factory=list)
    reads: list[Sum] = field(default_factory=list)
    channels: list[Loop | Sensor] = field(default_factory=list)
    done: dict[str, Sum] = field(default_factory=dict)

    def add(self, node: Node, reads: Sum) -> Sum:
        """Append a node, and return its output."""
        self.nodes.append(node)
        self.reads.append(reads)
        return {("node", len(self.nodes) - 1): 1.0}

    def channel(self, owner: Loop | Sensor) -> Sum:
        """Append a channel, and return its reading."""
        self.channels.append(owner)
        return {("channel", len(self.channels) - 1): 1.0}

    def reading(self, sensor: Sensor) -> Sum:
        """Build the reading of a sensor, unless it is built already."""
        if sensor.name not in self.done:
            made = self.physical(sensor) if sensor.motion else self.computed(sensor)
            self.done[sensor.name] = made
        return self.done[sensor.name]

    def physical(self, sensor: Sensor) -> Sum:
        """Build the reading of a sensor of motions."""
        reads = self.channel(sensor)
        if sensor.response is None:
            return reads
        key = f"control.sensor.{sensor.name}.response"
        made = make_response(sensor.response)
        whole = self.add(Node(f"sensor {sensor.name}", made, key=key), reads)
        tilt = sensor.tilt_reading
        if tilt is None:
            return whole
        angle, through = tilt
        through = replace(through, gain=through.gain * self.gravity)
        node = Node(f"sensor {angle.name}", through, key=key)
        return _add(whole, self.add(node, self.channel(angle)), 1.0)

    def computed(self, sensor: Sensor) -> Sum:
        """Build the sum of the inputs of a computed sensor."""
        named = {one.name: one for one in self.control.sensor}
        rest = self.reading(named[sensor.rest]) if sensor.rest else {}
        total = dict(rest)
        for number, one in enumerate(sensor.inputs, 1):
            if one.is_rest:
                continue
            whole = self.source(one, named)
            difference = _add(whole, rest, -1.0)
            if not one.key_of_filter:
                total = _add(total, difference, one.gain)
            else:
                key = f"control.sensor.{sensor.name}.inputs.{number}.{one.key_of_filter}"
                node = Node(f"sensor {sensor.name}.{number}", one.made, key=key)
                total = _add(total, self.add(node, difference), 1.0)
        return total

    def source(self, one: SensorInput, named: dict[str, Sensor]) -> Sum:
        """What an input reads: a sensor, or the force of a loop, -v."""
        if one.sensor is not None:
            return self.reading(named[one.sensor])
        number = [loop.name for loop in self.control.loop].index(one.drive or "")
        return {("node", number): -1.0}


def _add(first: Sum, second: Sum, factor: float) -> Sum:
    """Add a sum times a factor to another."""
    result = dict(first)
    for source, weight in second.items():
        result[source] = result.get(source, 0.0) + factor * weight
    return result


def build(control: Control | None, gravity: float) -> tuple[Network, list[Loop | Sensor]]:
    """Build the network of all loops, and list what owns each channel it reads.

    These are sensors, what they read of tilt by `gravity` (m/s^2), and loops that read a motion by
    its own name.
    """
    if control is None:
        none = np.zeros((0, 0))
        return Network((), 0, none, none), []
    made = _Builder(control, gravity)
    for loop in control.loop:
        made.add(make_node(loop), {})
    for number, loop in enumerate(control.loop):
        sensor = control.named_sensor(loop)
        made.reads[number] = made.channel(loop) if sensor is None else made.reading(sensor)
    count = len(made.nodes)
    of_channels = np.zeros((count, len(made.channels)))
    of_nodes = np.zeros((count, count))
    for row, reads in enumerate(made.reads):
        for (kind, number), weight in reads.items():
            matrix = of_channels if kind == "channel" else of_nodes
            matrix[row, number] = weight
    return Network(tuple(made.nodes), len(control.loop), of_channels, of_nodes), made.channels
