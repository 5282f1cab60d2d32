"""Loops of local control on a model, their OSEMs, and closed-loop responses.

The loops apply u = -K(f) (y + n) with the motions y that sensors read, and their noise n; K is a
diagonal matrix if each loop reads one sensor of its own (`loop_network`). A sensor with
``reference = "support"`` measures motion relative to the support structure, taken as rigid up to
the sensor; its actuator pushes against this structure. With the open-loop responses G of motions x
to these forces,

    u = U (y_open + n),    U = -(1 + K G_yu)^-1 K,    x = x_open + G_xu u,

so whatever sensors read with the loops open acts as their noise.

An OSEM at the point p of a body reads s = d . (x + t x p) = d . x + (p x d) . t along its direction
d if the body moves by x and turns by t: a row of a matrix A, s = A q. Its coil acts by the same
row, F = A^T f (virtual work), or, as measured, by that of another matrix, F = B^T f. A loop that
reads g . q gives the sensors the weights g A^+ with the pseudo-inverse A^+, one that pushes by F =
g u the coils g B^+. They touch no other coordinate if g A^+ A = g, and of all such weights have the
least sum of squares: the least noise of equal OSEMs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design import noise_spectra
from suspension_cli.design.control import Loop, Osem
from suspension_cli.design.derive import gravity_strength
from suspension_cli.design.locked_stages import as_in_file, locked_names
from suspension_cli.design.loop_sensors import Sensor
from suspension_cli.design.noise_spectra import MotionNoise
from suspension_cli.design.schema import Design
from suspension_cli.errors import InputError, format_value
from suspension_cli.files.declared import in_unit
from suspension_cli.linear import response, signals
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.solver import Solvable, Solver
from suspension_cli.linear.system import LinearSystem
from suspension_cli.physics import loop_network
from suspension_cli.physics.loop_network import Network

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

BESIDE = 1e-13
"""Relative step from a frequency where the open- or closed-loop response is infinite."""
TINY = 1e-11
"""Relative size of singular values, errors of g A^+ A and weights that are rounding errors of 0."""


@dataclass(frozen=True)
class Channel:
    """One reading of motions, by a loop or a sensor that has its name.

    `sensor_noise` is that of its own, `motions` are what it reads, with factors, and `on_ground` is
    its reading of the six motions of the ground.
    """

    name: str
    sensor_noise: MotionNoise
    motions: Sequence[tuple[float, Signal]]
    on_ground: Float[np.ndarray, " 6"]


@dataclass(frozen=True)
class Plant:
    """A model with its loops, their sensors and actuators as linear forms in the coordinates.

    `reading` are readings of channels from those of OSEMs, `driving` forces of coils from those of
    loops.
    """

    solver: Solver
    loops: Sequence[Loop]
    network: Network
    channels: Sequence[Channel]
    sensed: Float[np.ndarray, "*#build channel coordinate"]
    pushed: Float[np.ndarray, "*#build loop coordinate"]
    osems: Sequence[Osem]
    reading: Float[np.ndarray, "channel osem"]
    driving: Float[np.ndarray, "osem loop"]

    @property
    def model(self) -> LinearSystem:
        """The linear system."""
        return self.solver.system

    def with_model(self, model: LinearSystem) -> Plant:
        """The plant with another system of the same coordinates."""
        return replace(self, solver=Solver(model))

    @property
    def sensors(self) -> list[Channel | Osem]:
        """What has noise of a sensor; channels of stages with OSEMs have none."""
        return [*self.channels, *self.osems]

    @property
    def actuators(self) -> list[Loop | Osem]:
        """What has noise of an actuator; loops of stages with OSEMs have none."""
        return [*self.loops, *self.osems]

    @property
    def node_sensed(self) -> Float[np.ndarray, "node coordinate"]:
        """Linear forms of what each node of the network reads of motions."""
        return self.network.of_channels @ self.sensed

    @property
    def node_pushed(self) -> Float[np.ndarray, "node coordinate"]:
        """Linear forms of the forces of each node of the network: those of loops alone push."""
        others = len(self.network.nodes) - len(self.loops)
        return np.concatenate([self.pushed, np.zeros((others, self.model.size))])

    @property
    def coils(self) -> Float[np.ndarray, "osem coordinate"]:
        """Linear forms of the forces of the coils of OSEMs."""
        result = np.zeros((len(self.osems), self.model.size))
        for row, osem in zip(result, self.osems, strict=True):
            for part, end in coil_forces(osem):
                row += part * signals.linear_form(end, self.model)
        return result

    def select(self, nodes: list[int]) -> Plant:
        """Keep some nodes of the network, by number; loops come first."""
        keep = [n for n in nodes if n < len(self.loops)]
        return replace(
            self,
            loops=[self.loops[n] for n in keep],
            network=self.network.select(nodes),
            pushed=self.pushed[keep],
            driving=self.driving[:, keep],
        )

    def select_builds(self, which: Int[np.ndarray, " build"]) -> Plant:
        """Select some of many builds."""
        size = self.model.size
        count = self.model.batch[0]
        sensed = np.broadcast_to(self.sensed, (count, len(self.channels), size))
        pushed = np.broadcast_to(self.pushed, (count, len(self.loops), size))
        selected = self.with_model(self.model.select(which))
        return replace(selected, sensed=sensed[which], pushed=pushed[which])

    def without_loops(self) -> Plant:
        """Open all loops."""
        none = np.zeros((0, 0))
        return replace(
            self,
            loops=[],
            network=Network((), 0, none, none),
            channels=[],
            sensed=self.sensed[:0],
            pushed=self.pushed[:0],
            reading=self.reading[:0],
            driving=self.driving[:, :0],
        )


def demand_loops(design: Design) -> None:
    """Raise `InputError` if a design has no loops, or only such of locked stages."""
    if design.control is None and as_in_file(design).control is not None:
        held = ", ".join(locked_names(design))
        problem = f"has only loops that sense or act on {held}, which do not move"
        raise InputError.of("control", problem, "remove locked = true")
    if design.control is None:
        remedy = "add [[control.loop]] with sensor, actuator and damper or gain"
        raise InputError.of("control", "missing", remedy)


def build_plant(design: Design, system: Solvable) -> Plant:
    """Build the plant of a design's loops, if it has any, on its model, or on that of many builds.

    Raises `InputError` if a sensor or actuator names no signal of the model.
    """
    solver = Solver.of(system)
    model = solver.system
    control = design.control
    loops = () if control is None else control.loop
    osems = () if control is None else control.osem
    known = signals.bodies_with_signals(model)
    network, owners = loop_network.build(control, gravity_strength(design))
    read = [parse_sensor(owner, osems, model.body, known) for owner in owners]
    pushed = [parse_actuator(loop, osems, known) for loop in loops]
    forms = [signals.linear_form(end.motions[0][1], model) for end in pushed]
    return Plant(
        solver=solver,
        loops=loops,
        network=network,
        channels=[_make_channel(*both) for both in zip(owners, read, strict=True)],
        sensed=_stack([_sense(end, model) for end in read], model),
        pushed=_stack(forms, model),
        osems=osems,
        reading=np.reshape([end.weights for end in read], (len(owners), len(osems))),
        driving=np.reshape([end.weights for end in pushed], (len(loops), len(osems))).T,
    )


def coil_forces(osem: Osem) -> list[tuple[float, Signal]]:
    """List the forces and torques of which that of a coil is the sum, with factors."""
    centre = (0.0, 0.0, 0.0)
    parts = enumerate(osem.driving_row)
    ends = [(part, Signal(osem.name, osem.stage, n, centre, acts=True)) for n, part in parts]
    return [(part, _relate(end, osem)) for part, end in ends if part]


@dataclass(frozen=True)
class LoopEnd:
    """What a sensor reads or an actuator pushes: motions with factors, and weights of all OSEMs."""

    motions: Sequence[tuple[float, Signal]]
    weights: Float[np.ndarray, " osem"]


def _make_channel(owner: Loop | Sensor, read: LoopEnd) -> Channel:
    """Make the channel of a sensor, or of a loop that reads a motion by its name."""
    on_ground = np.zeros(6)
    for factor, signal in read.motions:
        if signal.is_ground:
            on_ground[signal.dof] += factor
    return Channel(owner.name, owner.sensor_noise, read.motions, on_ground)


def _sense(read: LoopEnd, model: LinearSystem) -> Float[np.ndarray, " coordinate"]:
    """Linear form of what a sensor reads of the coordinates."""
    form = np.zeros(model.size)
    for factor, signal in read.motions:
        if not signal.is_ground:
            form = form + factor * signals.linear_form(signal, model)
    return form


def _stack(
    forms: Sequence[Float[np.ndarray, "*#build coordinate"]], model: LinearSystem
) -> Float[np.ndarray, "*#build form coordinate"]:
    """Stack linear forms; builds, if there are any, stay in front."""
    if not forms:
        return np.zeros((0, model.size))
    return np.stack(np.broadcast_arrays(*forms), axis=-2)


def _relate(signal: Signal, loop: Loop | Osem) -> Signal:
    """Relate a signal to the reference of its loop or OSEM."""
    to_support = loop.reference == "support" and not signal.against
    return replace(signal, against=SUPPORT) if to_support else signal


def parse_sensor(
    owner: Loop | Sensor, osems: Sequence[Osem], stages: Sequence[str], known: tuple[str, ...]
) -> LoopEnd:
    """Parse what a sensor reads, or a loop by the name of a motion.

    Raises `InputError` if it is no motion (of a stage, for a loop), if the OSEMs of the stage do
    not resolve it, or if it has noise of its own besides theirs.
    """
    if isinstance(owner, Loop):
        key = f"control.loop.{owner.name}.sensor"
        signal = signals.parse(owner.sensor, key, known)
        if signal.acts or signal.body not in stages:
            remedy = "write for example upper.x, or name a [[control.sensor]] that reads it"
            problem = "is not a motion of a stage"
            raise InputError.of(key, problem, remedy, format_value(owner.sensor))
        reference = signal.against or owner.reference
        noisy = bool(owner.sensor_noise)
        weights = _weigh(signal, reference, osems, key, f"{key}_noise" if noisy else "")
        return LoopEnd([(1.0, _relate(signal, owner))], weights)
    key = f"control.sensor.{owner.name}.motion"
    noise_key = f"control.sensor.{owner.name}.sensor_noise" if owner.sensor_noise else ""
    motions = []
    total = np.zeros(len(osems))
    for text, factor in owner.motions.items():
        signal = signals.parse(text, key, known)
        if signal.acts:
            remedy = "write a motion: upper.x, upper~support.x, support.x"
            raise InputError.of(key, "is a force, not a motion", remedy, format_value(text))
        reference = signal.against or "inertial"
        total += factor * _weigh(signal, reference, osems, key, noise_key)
        motions.append((factor, signal))
    return LoopEnd(motions, total)


def parse_actuator(loop: Loop, osems: Sequence[Osem], known: tuple[str, ...]) -> LoopEnd:
    """Parse the actuator of a loop.

    Raises `InputError` if it is no force, if the OSEMs of the stage do not resolve it, or if it
    has noise of its own besides theirs.
    """
    key = f"control.loop.{loop.name}.actuator"
    signal = signals.parse(loop.actuator, key, known)
    if not signal.acts:
        remedy = "write for example upper.force_x"
        raise InputError.of(key, "is not a force or torque", remedy, format_value(loop.actuator))
    noise_key = f"{key}_noise" if loop.actuator_noise else ""
    weights = _weigh(signal, signal.against or loop.reference, osems, key, noise_key)
    return LoopEnd([(1.0, _relate(signal, loop))], weights)


def _weigh(
    signal: Signal, reference: str, osems: Sequence[Osem], key: str, noise_key: str
) -> Float[np.ndarray, " osem"]:
    """Compute the weights of all OSEMs in a signal; 0 without OSEMs of its stage and reference.

    Raises `InputError` if they do not resolve it, or if it has noise (`noise_key`) besides theirs.
    """
    weights = np.zeros(len(osems))
    own = _of_stage(osems, signal.body, reference)
    if not own.any():
        return weights
    if noise_key:
        problem = f"conflicts with the OSEMs of {signal.body}, whose noise enters the loop"
        raise InputError.of(noise_key, problem, "give the noise of each OSEM alone")
    some = [osem for osem, chosen in zip(osems, own, strict=True) if chosen]
    form = np.eye(6)[signal.dof]
    if signal.dof < 3:
        form[3:] = np.cross(signal.point, form[:3])
    rows = driving_rows(some) if signal.acts else sensing_rows(some)
    weights[own], resolved = compute_weights(form, rows)
    if not resolved:
        names = resolved_coordinates(rows)
        remedy = f"add OSEMs: these resolve {', '.join(names) or 'no coordinate alone'}"
        problem = f"is not resolved by the OSEMs of {signal.body}"
        raise InputError.of(key, problem, remedy, format_value(signal.text))
    return weights


@dataclass(frozen=True)
class OsemMatrices:
    """Matrices of the OSEMs of one stage.

    `to_euler` gives the coordinates that they resolve (m, rad) from readings (m), `to_coil` forces
    of coils (N) from forces and torques on the coordinates (N, N m).
    """

    stage: str
    reference: str
    osem: tuple[str, ...]
    coordinate: tuple[str, ...]
    to_euler: Float[np.ndarray, "coordinate osem"] = field(metadata=in_unit("SI"))
    to_coil: Float[np.ndarray, "osem coordinate"] = field(metadata=in_unit("SI"))


def compute_matrices(osems: Sequence[Osem]) -> tuple[OsemMatrices, ...]:
    """Compute the matrices of each stage with OSEMs (of each reference, if there are two)."""
    found = []
    for place in dict.fromkeys((one.stage, one.reference) for one in osems):
        some = [osems[n] for n in np.flatnonzero(_of_stage(osems, *place)).tolist()]
        reading, read = compute_weights(np.eye(6), sensing_rows(some))
        pushing, pushed = compute_weights(np.eye(6), driving_rows(some))
        known = read & pushed
        names = tuple(dof for dof, one in zip(DOFS, known, strict=True) if one)
        osem_names = tuple(one.name for one in some)
        found.append(OsemMatrices(*place, osem_names, names, reading[known], pushing[known].T))
    return tuple(found)


def _of_stage(osems: Sequence[Osem], stage: str, reference: str) -> Bool[np.ndarray, " osem"]:
    """Which OSEMs are those of a stage with a reference."""
    return np.array([(o.stage, o.reference) == (stage, reference) for o in osems], dtype=bool)


def sensing_rows(osems: Sequence[Osem]) -> Float[np.ndarray, "osem 6"]:
    """Readings of OSEMs per motion of their stage."""
    return np.array([one.sensing_row for one in osems], dtype=float).reshape(-1, 6)


def driving_rows(osems: Sequence[Osem]) -> Float[np.ndarray, "osem 6"]:
    """Forces and torques on their stage per force of the coil of each OSEM."""
    return np.array([one.driving_row for one in osems], dtype=float).reshape(-1, 6)


def resolved_coordinates(rows: Float[np.ndarray, "osem 6"]) -> tuple[str, ...]:
    """List the coordinates that sensors, or coils, with these rows resolve."""
    _, resolved = compute_weights(np.eye(6), rows)
    return tuple(dof for dof, one in zip(DOFS, resolved, strict=True) if one)


def compute_weights(
    form: Float[np.ndarray, "*form 6"], rows: Float[np.ndarray, "osem 6"]
) -> tuple[Float[np.ndarray, "*form osem"], np.ndarray]:
    """Compute weights g A^+ of linear forms g, and whether the rows A resolve each."""
    size = np.linalg.norm(rows, axis=0)  # rotations to the scale of displacements
    size[size == 0] = 1.0
    weights = (form / size) @ np.linalg.pinv(rows / size, rcond=TINY)
    largest = np.abs(weights).max(-1, keepdims=True)
    weights = np.where(np.abs(weights) > TINY * largest, weights, 0.0)
    return weights, (np.abs(weights @ rows - form) <= TINY * size).all(-1)


def evaluate_noise(
    part: Channel | Osem, frequency: Float[np.ndarray, " frequency"]
) -> Float[np.ndarray, " frequency"]:
    """Evaluate the noise of a sensor, as motion, at frequencies in Hz."""
    own = part.sensor_noise
    return noise_spectra.density(own, frequency)


def evaluate_actuator_noise(
    part: Loop | Osem, frequency: Float[np.ndarray, " frequency"]
) -> Float[np.ndarray, " frequency"]:
    """Evaluate the noise of the force or torque of a loop or coil at frequencies in Hz."""
    if isinstance(part, Osem):
        return part.actuator_density(frequency)
    return noise_spectra.density(part.actuator_noise, frequency)


@dataclass(frozen=True)
class LoopResponses:
    """Responses of some outputs with all loops closed: of motions, or of forces of coils.

    Attributes
    ----------
    external
        Outputs over external inputs.
    sensing
        Outputs over noise of the sensor of each of `Plant.channels`.
    pushing
        Outputs over noise forces at each of `Plant.actuators`.
    """

    plant: Plant
    frequency: Float[np.ndarray, " frequency"]
    external: Complex[np.ndarray, "frequency output input"]
    sensing: Complex[np.ndarray, "frequency output channel"]
    pushing: Complex[np.ndarray, "frequency output actuator"]

    @property
    def sensor_noise(self) -> Float[np.ndarray, "frequency output sensor"]:
        """Amplitude spectral density at each output from each of `Plant.sensors`.

        Unit of the output over sqrt(Hz).
        """
        plant = self.plant
        to_channels = np.hstack([np.eye(len(plant.channels)), plant.reading])
        noise = [evaluate_noise(part, self.frequency) for part in plant.sensors]
        return np.abs(self.sensing @ to_channels) * self._by_frequency(noise)

    @property
    def actuator_noise(self) -> Float[np.ndarray, "frequency output actuator"]:
        """Amplitude spectral density at each output from each of `Plant.actuators`."""
        noise = [evaluate_actuator_noise(part, self.frequency) for part in self.plant.actuators]
        return np.abs(self.pushing) * self._by_frequency(noise)

    def _by_frequency(
        self, noise: list[Float[np.ndarray, " frequency"]]
    ) -> Float[np.ndarray, "frequency 1 part"]:
        return np.array(noise).reshape(len(noise), len(self.frequency)).T[:, None]


def solve_responses(
    plant: Plant,
    frequency: Float[np.ndarray, " frequency"],
    inputs: list[Signal],
    outputs: list[Signal],
) -> Complex[np.ndarray, "frequency output input"]:
    """Solve for closed-loop responses of motions to external inputs at frequencies in Hz."""
    motions, _ = solve_loops(plant, frequency, inputs, outputs)
    return motions.external


def solve_sensor_noise(
    plant: Plant, frequency: Float[np.ndarray, " frequency"], output: Signal
) -> Float[np.ndarray, "frequency sensor"]:
    """Solve for the noise of a motion from each of `Plant.sensors`.

    It is an amplitude spectral density, m/sqrt(Hz) or rad/sqrt(Hz), at frequencies in Hz.
    """
    motions, _ = solve_loops(plant, frequency, [], [output])
    return motions.sensor_noise[:, 0]


def solve_loops(
    plant: Plant,
    frequency: Float[np.ndarray, " frequency"],
    inputs: list[Signal],
    outputs: list[Signal],
) -> tuple[LoopResponses, LoopResponses]:
    """Solve for closed-loop responses of motions, and of the forces demanded of coils of OSEMs.

    At frequencies in Hz, to external inputs and to the noise of sensors and actuators.
    """
    model = plant.model
    driven = np.array([signals.linear_form(signal, model) for signal in inputs])
    observed = np.array([signals.linear_form(signal, model) for signal in outputs])
    actuators = len(plant.actuators)
    opened, _ = response.transfer(
        plant.solver,
        2 * np.pi * frequency,
        np.concatenate([driven.reshape(-1, model.size), plant.pushed, plant.coils]),
        [*(signal.acts for signal in inputs), *[True] * actuators],
        np.concatenate([observed.reshape(-1, model.size), plant.sensed]),
        ground=[*(signal.is_ground for signal in inputs), *[False] * actuators],
    )
    moved = opened[:, : len(outputs)]
    read = opened[:, len(outputs) :]
    forces = slice(len(inputs), len(inputs) + len(plant.loops))
    for n, signal in enumerate(inputs):
        if signal.is_ground:
            read[:, :, n] += [channel.on_ground[signal.dof] for channel in plant.channels]
    # u = U (y_open + n), see the start of this module
    k = plant.network.controllers(frequency)
    one = np.eye(len(plant.loops))
    controller = -np.linalg.solve(one + k @ read[:, :, forces], k)
    results = []
    for direct, through in ((moved, moved[:, :, forces]), (0.0, plant.driving[None])):
        sensing = through @ controller
        value = direct + sensing @ read
        external, pushing = np.split(value, [len(inputs)], axis=2)
        results.append(LoopResponses(plant, frequency, external, sensing, pushing))
    motions, coils = results
    return motions, coils


def compute_loop_gains(
    plant: Plant, frequency: Float[np.ndarray, " frequency"]
) -> Complex[np.ndarray, "frequency loop"]:
    """Compute the gain of each loop, broken at its actuator with the others closed.

    It is -1 at a closed-loop pole on the imaginary axis. Frequencies are in Hz; at a resonance
    without loss the gain is taken beside it. With S = (1 + K G)^-1 it is (S K G)_kk / S_kk. Sensors
    that read the force of a loop read what it demands.
    """
    return close_others(compute_open_loop(plant, frequency))


def close_others(
    gain: Complex[np.ndarray, "frequency loop loop"],
) -> Complex[np.ndarray, "frequency loop"]:
    """Compute the gain of each loop, the others closed, from K G."""
    sensitivity = np.linalg.inv(np.eye(gain.shape[-1]) + gain)
    closed = np.einsum("fkl,flk->fk", gain, sensitivity)
    return closed / np.einsum("fkk->fk", sensitivity)


def compute_sensitivity(
    plant: Plant, frequency: Float[np.ndarray, " frequency"]
) -> Complex[np.ndarray, "frequency loop loop"]:
    """Compute the sensitivity S = (1 + K G)^-1 from disturbances at actuators to total forces."""
    return np.linalg.inv(np.eye(len(plant.loops)) + compute_open_loop(plant, frequency))


def compute_open_loop(
    plant: Plant, frequency: Float[np.ndarray, " frequency"]
) -> Complex[np.ndarray, "frequency loop loop"]:
    """Compute K G at frequencies in Hz, beside resonances without loss, of open or closed loops."""
    acts = [True] * len(plant.loops)

    def solve(at: Float[np.ndarray, " point"]) -> Complex[np.ndarray, "point loop loop"]:
        omega = 2 * np.pi * at
        g, _ = response.transfer(
            plant.solver, omega, plant.pushed, acts, plant.sensed, finite=False
        )
        return plant.network.controllers(at) @ g

    with np.errstate(all="ignore"):
        result = solve(frequency)
        singular = np.linalg.det(np.eye(result.shape[-1]) + result) == 0
        beside = singular | ~np.isfinite(result).all((1, 2))
        if beside.any():
            result[beside] = solve(frequency[beside] * (1 + BESIDE))
    return result
