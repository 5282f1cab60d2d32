"""Loops of local control on a model, their OSEMs, and closed-loop responses.

Each loop applies u = -H(f) (y + n) with its sensor's motion y and noise n. A sensor with
``reference = "support"`` measures motion relative to the support structure, taken as rigid up to
the sensor; its actuator pushes against this structure. With the open-loop responses G of motions x
to these forces,

    u = U (y_open + n),    U = -(1 + H G_yu)^-1 H,    x = x_open + G_xu u,

so whatever sensors read with the loops open acts as their noise.

An OSEM at the point p of a body reads s = d . (x + t x p) = d . x + (p x d) . t along its direction
d if the body moves by x and turns by t: a row of the sensing matrix S, s = S q. Its coil acts by
the same row, F = S^T f (virtual work). So a loop that reads g . q, or pushes by F = g u, gives the
OSEMs the weights g S^+ with the pseudo-inverse S^+. They touch no other coordinate if g S^+ S = g,
and of all such weights have the least sum of squares: the least noise of equal OSEMs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design import noise_spectra
from suspension_cli.design.control import Loop, Osem
from suspension_cli.design.locked_stages import as_in_file, locked_names
from suspension_cli.design.schema import Design
from suspension_cli.errors import InputError, format_value
from suspension_cli.files.declared import derived, in_unit
from suspension_cli.linear import response, signals
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.solver import Solvable, Solver
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact

End = Literal["sensor", "actuator"]

BESIDE = 1e-13
"""Relative step from a frequency where the open- or closed-loop response is infinite."""
TINY = 1e-11
"""Relative size of singular values, errors of g S^+ S and weights that are rounding errors of 0."""


@dataclass(frozen=True)
class Plant:
    """A model with its loops, their sensors and actuators as linear forms in the coordinates.

    `reading` are readings of loops from those of OSEMs, `driving` forces of coils from those of
    loops.
    """

    solver: Solver
    loops: Sequence[Loop]
    sensed: Float[np.ndarray, "loop coordinate"]
    pushed: Float[np.ndarray, "loop coordinate"]
    osems: Sequence[Osem]
    reading: Float[np.ndarray, "loop osem"]
    driving: Float[np.ndarray, "osem loop"]

    @property
    def model(self) -> LinearSystem:
        """The linear system."""
        return self.solver.system

    def with_model(self, model: LinearSystem) -> Plant:
        """The plant with another system of the same coordinates."""
        return replace(self, solver=Solver(model))

    @property
    def parts(self) -> list[Loop | Osem]:
        """What has a sensor and an actuator with noise; loops of stages with OSEMs have none."""
        return [*self.loops, *self.osems]

    @property
    def coils(self) -> Float[np.ndarray, "osem coordinate"]:
        """Linear forms of the motions along OSEMs, and of the forces of their coils."""
        result = np.zeros((len(self.osems), self.model.size))
        for row, osem in zip(result, self.osems, strict=True):
            for n, part in enumerate(osem.vector):
                end = Signal(osem.name, osem.stage, n, osem.at, acts=True)
                row += part * signals.linear_form(_relate(end, osem), self.model)
        return result

    def with_loops(self, keep: list[int]) -> Plant:
        """Select loops by number."""
        return replace(
            self,
            loops=[self.loops[n] for n in keep],
            sensed=self.sensed[keep],
            pushed=self.pushed[keep],
            reading=self.reading[keep],
            driving=self.driving[:, keep],
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
    """Build the plant of a design's loops, if it has any, on its model.

    Raises `InputError` if a sensor or actuator names no signal of the model.
    """
    solver = Solver.of(system)
    model = solver.system
    known = signals.bodies_with_signals(model)
    control = design.control
    loops = () if control is None else control.loop
    given = () if control is None else control.osem
    forms = []
    weights = []
    for end in ("sensor", "actuator"):
        parsed = [parse_end(loop, end, given, model.body, known) for loop in loops]
        rows = [signals.linear_form(signal, model) for signal, _ in parsed]
        forms.append(np.array(rows).reshape(len(loops), model.size))
        weights.append(np.reshape([own for _, own in parsed], (len(loops), len(given))))
    (sensed, pushed) = forms
    (reading, driving) = weights
    return Plant(solver, loops, sensed, pushed, given, reading, driving.T)


def _relate(signal: Signal, loop: Loop | Osem) -> Signal:
    """Relate a signal to the reference of its loop or OSEM."""
    to_support = loop.reference == "support" and not signal.against
    return replace(signal, against=SUPPORT) if to_support else signal


def parse_end(
    loop: Loop, end: End, osems: Sequence[Osem], stages: Sequence[str], known: tuple[str, ...]
) -> tuple[Signal, Float[np.ndarray, " osem"]]:
    """Parse the sensor or actuator of a loop, and compute the weights of all OSEMs in it.

    These are 0 for OSEMs of other stages or references. Raises `InputError` if the signal is no
    motion of a stage or no force, if the OSEMs do not resolve it, or if the loop gives noise of its
    own besides theirs.
    """
    key = f"control.loop.{loop.name}.{end}"
    text = getattr(loop, end)
    signal = signals.parse(text, key, known)
    if end == "sensor" and (signal.acts or signal.body not in stages):
        remedy = "write for example upper.x"
        raise InputError.of(key, "is not a motion of a stage", remedy, format_value(text))
    if end == "actuator" and not signal.acts:
        remedy = "write for example upper.force_x"
        raise InputError.of(key, "is not a force or torque", remedy, format_value(text))
    weights = np.zeros(len(osems))
    own = _of_stage(osems, signal.body, signal.against or loop.reference)
    if own.any():
        if getattr(loop, f"{end}_noise"):
            problem = f"conflicts with the OSEMs of {signal.body}, whose noise enters the loop"
            raise InputError.of(f"{key}_noise", problem, "give the noise of each OSEM alone")
        some = [osem for osem, chosen in zip(osems, own, strict=True) if chosen]
        form = np.eye(6)[signal.dof]
        if signal.dof < 3:
            form[3:] = np.cross(signal.point, form[:3])
        weights[own], resolved = compute_weights(form, some)
        if not resolved:
            names = compute_matrices(some)[0].coordinate
            remedy = f"add OSEMs: these resolve {', '.join(names) or 'no coordinate alone'}"
            problem = f"is not resolved by the OSEMs of {signal.body}"
            raise InputError.of(key, problem, remedy, format_value(text))
    return _relate(signal, loop), weights


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

    @property
    @derived("SI")
    def to_coil(self) -> Float[np.ndarray, "osem coordinate"]:
        """The transpose of `to_euler`."""
        return self.to_euler.T


def compute_matrices(osems: Sequence[Osem]) -> tuple[OsemMatrices, ...]:
    """Compute the matrices of each stage with OSEMs (of each reference, if there are two)."""
    found = []
    for place in dict.fromkeys((one.stage, one.reference) for one in osems):
        some = [osems[n] for n in np.flatnonzero(_of_stage(osems, *place)).tolist()]
        weights, known = compute_weights(np.eye(6), some)
        names = tuple(dof for dof, one in zip(DOFS, known, strict=True) if one)
        found.append(OsemMatrices(*place, tuple(one.name for one in some), names, weights[known]))
    return tuple(found)


def _of_stage(osems: Sequence[Osem], stage: str, reference: str) -> Bool[np.ndarray, " osem"]:
    """Which OSEMs are those of a stage with a reference."""
    return np.array([(o.stage, o.reference) == (stage, reference) for o in osems], dtype=bool)


def compute_weights(
    form: Float[np.ndarray, "*form 6"], osems: Sequence[Osem]
) -> tuple[Float[np.ndarray, "*form osem"], np.ndarray]:
    """Compute weights g S^+ of linear forms g, and whether the OSEMs of a body resolve each."""
    along = np.array([one.vector for one in osems])
    sensing = np.hstack([along, np.cross([one.at for one in osems], along)])
    size = np.linalg.norm(sensing, axis=0)  # rotations to the scale of displacements
    size[size == 0] = 1.0
    weights = (form / size) @ np.linalg.pinv(sensing / size, rcond=TINY)
    largest = np.abs(weights).max(-1, keepdims=True)
    weights = np.where(np.abs(weights) > TINY * largest, weights, 0.0)
    return weights, (np.abs(weights @ sensing - form) <= TINY * size).all(-1)


def evaluate_filter(
    loop: Loop, frequency: Inexact[np.ndarray, "*frequency"] | complex
) -> Complex[np.ndarray, "*frequency"]:
    """Evaluate H of a loop (filter, sensor, delay) at frequencies in Hz; N/m or N m/rad."""
    f = np.asarray(frequency)
    return loop.controller_and_sensor.at(f) * np.exp(-2j * np.pi * loop.delay * f)


def evaluate_filters(
    plant: Plant, frequency: Float[np.ndarray, " frequency"]
) -> Inexact[np.ndarray, "frequency loop"]:
    """Evaluate H of all loops at frequencies in Hz."""
    found = [evaluate_filter(loop, frequency) for loop in plant.loops]
    return np.array(found).reshape(len(plant.loops), len(frequency)).T


def evaluate_noise(
    part: Loop | Osem, frequency: Float[np.ndarray, " frequency"]
) -> Float[np.ndarray, " frequency"]:
    """Evaluate the sensor noise of a loop or OSEM, as motion, at frequencies in Hz."""
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
        Outputs over noise of the sensor of each loop.
    pushing
        Outputs over noise forces at the actuator of each of `Plant.parts`.
    """

    plant: Plant
    frequency: Float[np.ndarray, " frequency"]
    external: Complex[np.ndarray, "frequency output input"]
    sensing: Complex[np.ndarray, "frequency output loop"]
    pushing: Complex[np.ndarray, "frequency output part"]

    @property
    def sensor_noise(self) -> Float[np.ndarray, "frequency output part"]:
        """Amplitude spectral density at each output from the sensor of each of `Plant.parts`.

        Unit of the output over sqrt(Hz).
        """
        of_parts = np.hstack([np.eye(len(self.plant.loops)), self.plant.reading])
        return np.abs(self.sensing @ of_parts) * self._of_parts(evaluate_noise)[:, None]

    @property
    def actuator_noise(self) -> Float[np.ndarray, "frequency output part"]:
        """Amplitude spectral density at each output from the actuator of each of `Plant.parts`."""
        return np.abs(self.pushing) * self._of_parts(evaluate_actuator_noise)[:, None]

    def _of_parts(
        self, evaluate: Callable[[Loop | Osem, Float[np.ndarray, " frequency"]], np.ndarray]
    ) -> Float[np.ndarray, "frequency part"]:
        parts = self.plant.parts
        found = np.array([evaluate(part, self.frequency) for part in parts])
        return found.reshape(len(parts), len(self.frequency)).T


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
) -> Float[np.ndarray, "frequency part"]:
    """Solve for the noise of a motion from the sensor of each of `Plant.parts`.

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
    parts = len(plant.parts)
    opened, _ = response.transfer(
        plant.solver,
        2 * np.pi * frequency,
        np.concatenate([driven.reshape(-1, model.size), plant.pushed, plant.coils]),
        [*(signal.acts for signal in inputs), *[True] * parts],
        np.concatenate([observed.reshape(-1, model.size), plant.sensed]),
        ground=[*(signal.is_ground for signal in inputs), *[False] * parts],
    )
    moved = opened[:, : len(outputs)]
    read = opened[:, len(outputs) :]
    forces = slice(len(inputs), len(inputs) + len(plant.loops))
    # u = U (y_open + n), see the start of this module
    h = evaluate_filters(plant, frequency)[:, :, None]
    one = np.eye(len(plant.loops))
    controller = -np.linalg.solve(one + h * read[:, :, forces], h * one)
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
    without loss the gain is taken beside it. With S = (1 + H G)^-1 it is (S H G)_kk / S_kk.
    """
    gain = compute_open_loop(plant, frequency)
    one = np.broadcast_to(np.eye(gain.shape[-1]), gain.shape)
    both = np.linalg.solve(one + gain, np.concatenate([gain, one], axis=-1))
    closed, sensitivity = (np.einsum("fkk->fk", part) for part in np.split(both, 2, axis=-1))
    return closed / sensitivity


def compute_sensitivity(
    plant: Plant, frequency: Float[np.ndarray, " frequency"]
) -> Complex[np.ndarray, "frequency loop loop"]:
    """Compute the sensitivity S = (1 + H G)^-1 from disturbances at actuators to total forces."""
    return np.linalg.inv(np.eye(len(plant.loops)) + compute_open_loop(plant, frequency))


def compute_open_loop(
    plant: Plant, frequency: Float[np.ndarray, " frequency"]
) -> Complex[np.ndarray, "frequency loop loop"]:
    """Compute H G at frequencies in Hz, beside resonances without loss, of open or closed loops."""
    acts = [True] * len(plant.loops)

    def solve(at: Float[np.ndarray, " point"]) -> Complex[np.ndarray, "point loop loop"]:
        omega = 2 * np.pi * at
        g, _ = response.transfer(
            plant.solver, omega, plant.pushed, acts, plant.sensed, finite=False
        )
        return evaluate_filters(plant, at)[:, :, None] * g

    with np.errstate(all="ignore"):
        result = solve(frequency)
        singular = np.linalg.det(np.eye(result.shape[-1]) + result) == 0
        beside = singular | ~np.isfinite(result).all((1, 2))
        if beside.any():
            result[beside] = solve(frequency[beside] * (1 + BESIDE))
    return result
