"""Closed-loop responses and state spaces of local control.

Each loop applies u = -H(f) (y + n) with its sensor's motion y and noise n. A sensor with
``reference = "support"`` measures the motion of the body relative to the support structure, taken
as rigid up to the sensor, and the actuator pushes against this structure. Closed-loop responses
follow from the open-loop ones, which are solved directly: x = G_e e + G_u u,
u = -(1 + H G_yu)^-1 H (G_ye e + n). Poles follow from the state space and are refined in
`closed_loop_poles`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design.derive import com_positions
from suspension_cli.design.schema import Design, Loop
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.linear import response, signals, statespace
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem
from suspension_cli.rotations import cross_matrix
from suspension_cli.scene.arrays import Array

BESIDE = (0.0, 1e-15, -1e-15, 3e-15, -3e-15, 1e-14, -1e-14)
"""Relative steps, tried in turn, away from a frequency at which the response is infinite."""


@dataclass(frozen=True)
class Plant:
    """A model with the sensors and actuators of its loops.

    Attributes
    ----------
    model : LinearSystem
    loops : tuple of Loop
    sensor, actuator : list of Signal
    sensed, pushed : (l, N) arrays
        Sensed motions and actuator forces as linear forms of the coordinates.
    """

    model: LinearSystem
    loops: tuple[Loop, ...]
    sensor: list[Signal]
    actuator: list[Signal]
    sensed: Array
    pushed: Array

    def with_loops(self, keep: list[int]) -> Plant:
        """Select some of the loops, by number."""
        return Plant(
            self.model,
            tuple(self.loops[n] for n in keep),
            [self.sensor[n] for n in keep],
            [self.actuator[n] for n in keep],
            self.sensed[keep],
            self.pushed[keep],
        )


def build_plant(design: Design, model: LinearSystem) -> Plant:
    """Build the plant of a design's loops on its model.

    Raises
    ------
    InputError
        If there is no loop, or a sensor or actuator names no signal of the model.
    """
    if design.control is None:
        raise InputError(
            [
                Fault(
                    "control",
                    "missing",
                    "add [[control.loop]] with sensor, actuator and damper or gain",
                )
            ]
        )
    known, positions = signals.bodies_with_signals(model), com_positions(design)
    sensors, actuators, sensed, pushed = [], [], [], []
    for loop in design.control.loop:
        sensor, actuator = parse_sensor(loop, model.body, known), parse_actuator(loop, known)
        sensors.append(sensor)
        actuators.append(actuator)
        sensed.append(_relative_form(sensor, model, positions, loop.reference))
        pushed.append(_relative_form(actuator, model, positions, loop.reference))
    return Plant(
        model, tuple(design.control.loop), sensors, actuators, np.array(sensed), np.array(pushed)
    )


def parse_sensor(loop: Loop, stages: tuple[str, ...], known: tuple[str, ...]) -> Signal:
    """Parse the sensor of a loop; `InputError` if it is not a motion of a stage."""
    key = f"control.loop.{loop.name}.sensor"
    sensor = signals.parse(loop.sensor, key, known)
    if sensor.acts or sensor.body not in stages:
        raise InputError(
            [
                Fault(
                    key,
                    "is not a motion of a stage",
                    "write for example upper.x",
                    format_value(loop.sensor),
                )
            ]
        )
    return sensor


def parse_actuator(loop: Loop, known: tuple[str, ...]) -> Signal:
    """Parse the actuator of a loop; `InputError` if it is not a force or torque."""
    key = f"control.loop.{loop.name}.actuator"
    actuator = signals.parse(loop.actuator, key, known)
    if not actuator.acts:
        raise InputError(
            [
                Fault(
                    key,
                    "is not a force or torque",
                    "write for example upper.force_x",
                    format_value(loop.actuator),
                )
            ]
        )
    return actuator


def _relative_form(
    signal: Signal, model: LinearSystem, positions: dict[str, Any], reference: str
) -> Array:
    """Linear form (N,) of a signal, relative to the support structure if that is the reference.

    A frame moves with the structure.
    """
    row = signals.linear_form(signal, model)
    if reference != "support":
        return row
    place = np.array(positions[signal.body]) + np.array(signal.point)
    structure = np.zeros(6)
    structure[signal.dof] = 1.0
    if signal.dof < 3:
        structure[3:] = -cross_matrix(place - np.array(positions[SUPPORT]))[signal.dof]
    row = row.copy()
    row[:6] -= structure
    for n, dof in enumerate(DOFS):
        if f"frame.{dof}" in model.coordinate:
            row[model.coordinate.index(f"frame.{dof}")] -= structure[n]
    return row


def evaluate_filter(loop: Loop, frequency: Array) -> Any:
    """Evaluate the filter H (f,) of a loop at frequencies (f,) in Hz: N/m or N m/rad."""
    f = 1j * np.asarray(frequency)
    if loop.damper is not None:
        return loop.damper * 2 * np.pi * f
    result = np.full(f.shape, complex(loop.gain or 0.0))
    for zero in expand_roots(loop.zeros):
        result = result * (f + zero)
    for pole in expand_roots(loop.poles):
        result = result / (f + pole)
    return result


def expand_roots(given: list[Any]) -> list[complex]:
    """List roots in Hz as complex numbers; a pair [re, im] stands for both conjugates."""
    result: list[complex] = []
    for root in given:
        result += (
            [complex(*root), complex(root[0], -root[1])]
            if isinstance(root, list)
            else [complex(root)]
        )
    return result


@dataclass(frozen=True)
class ClosedLoopResponse:
    """Closed-loop responses, sensor noise and loop gains.

    Attributes
    ----------
    frequency : (f,) array
        Hz.
    value : (f, o, i) complex array
        Outputs over external inputs.
    noise : (f, o, l) array
        Amplitude spectral density at each output from each sensor's noise, m/sqrt(Hz) or
        rad/sqrt(Hz).
    actuator_noise : (f, o, l) array
        Of the noise of each actuator, added to the force that the loop commands.
    loop_gain : (f, l) complex array
        H G of each loop broken at its actuator, the others closed; a closed-loop pole on the
        imaginary axis has 1 + H G = 0.
    """

    frequency: Array
    value: Any
    noise: Array
    actuator_noise: Array
    loop_gain: Any


def solve_responses(
    plant: Plant, frequency: Array, inputs: list[Signal], outputs: list[Signal]
) -> ClosedLoopResponse:
    """Solve for closed-loop responses, noise of sensors and actuators at the outputs, loop gains.

    Parameters
    ----------
    plant : Plant
    frequency : (f,) array
        Hz.
    inputs, outputs : list of Signal
        External drives (i) and observed motions (o).
    """
    model, count = plant.model, len(plant.loops)
    rows = np.concatenate(
        [np.array([signals.linear_form(s, model) for s in outputs]), plant.sensed]
    )
    given = np.array([signals.linear_form(s, model) for s in inputs]).reshape(-1, model.size)
    drives = np.concatenate([given, plant.pushed])
    acts = [*(s.acts for s in inputs), *([True] * count)]
    g, _ = response.transfer(model, 2 * np.pi * frequency, drives, acts, rows)
    i, o = len(inputs), len(outputs)
    h = evaluate_filters(plant, frequency)
    to_actuator = np.linalg.solve(
        np.eye(count) + h[:, :, None] * g[:, o:, i:], h[:, :, None] * np.eye(count)
    )
    value = g[:, :o, :i] - g[:, :o, i:] @ to_actuator @ g[:, o:, :i]
    densities = np.array([loop.sensor_noise for loop in plant.loops])
    noise = np.abs(g[:, :o, i:] @ to_actuator) * densities
    # a force n at the actuators is u = n - H y: x = G_u (1 + H G_yu)^-1 n
    pushed = g[:, :o, i:] - g[:, :o, i:] @ to_actuator @ g[:, o:, i:]
    actuator_noise = np.abs(pushed) * np.array([loop.actuator_noise for loop in plant.loops])
    return ClosedLoopResponse(frequency, value, noise, actuator_noise, _loop_gains(h, g[:, o:, i:]))


def compute_loop_gains(plant: Plant, frequency: Array) -> Any:
    """Compute the gain (f, l) of each loop with the others closed, at frequencies (f,) in Hz.

    Each loop is broken at its actuator. At a resonance without loss the gain is taken beside it.
    """
    result = np.full((len(frequency), len(plant.loops)), np.nan, dtype=complex)
    left = np.arange(len(frequency))
    with np.errstate(all="ignore"):
        for beside in BESIDE:
            at = frequency[left] * (1 + beside)
            g, _ = response.transfer(
                plant.model,
                2 * np.pi * at,
                plant.pushed,
                [True] * len(plant.loops),
                plant.sensed,
                finite=False,
            )
            known = np.isfinite(g).all((1, 2))
            result[left[known]] = _loop_gains(evaluate_filters(plant, at[known]), g[known])
            left = left[~known]
            if not len(left):
                break
    return result


def evaluate_filters(plant: Plant, frequency: Array) -> Any:
    """Evaluate H (f, l) of all loops at frequencies in Hz."""
    return (
        np.array([evaluate_filter(loop, frequency) for loop in plant.loops])
        .reshape(len(plant.loops), len(frequency))
        .T
    )


def _loop_gains(h: Any, g: Any) -> Any:
    """Gain (f, l) of each loop, the others closed, from H (f, l) and the open-loop G (f, l, l)."""
    count = h.shape[1]
    result = np.zeros(h.shape, dtype=complex)
    for k in range(count):
        others = [n for n in range(count) if n != k]
        left = g[:, k, k]
        if others:
            inner = np.eye(len(others)) + h[:, others, None] * g[:, others][:, :, others]
            back = np.linalg.solve(inner, h[:, others, None] * g[:, others, k][:, :, None])
            left = left - (g[:, k, others][:, None, :] @ back)[:, 0, 0]
        result[:, k] = h[:, k] * left
    return result


def build_closed_loop(
    plant: Plant, inputs: list[Signal], outputs: list[Signal]
) -> statespace.StateSpace:
    """Build the closed-loop state space: states of the mechanics, then of the filters.

    Without inputs it contains every observed block, driven or not, and so all their poles.
    """
    model = plant.model
    drives, rows = (
        np.array([signals.linear_form(s, model) for s in some]).reshape(-1, model.size)
        for some in (inputs, outputs)
    )
    return _close_loops(plant, drives, inputs, rows, outputs)


def build_broken_loop(plant: Plant, n: int) -> statespace.StateSpace:
    """Build the state space from the actuator of loop n to its sensor, the other loops closed."""
    others = plant.with_loops([k for k in range(len(plant.loops)) if k != n])
    return _close_loops(
        others, plant.pushed[[n]], [plant.actuator[n]], plant.sensed[[n]], [plant.sensor[n]]
    )


def _close_loops(
    plant: Plant, drives: Array, inputs: list[Signal], rows: Array, outputs: list[Signal]
) -> statespace.StateSpace:
    """Build the closed-loop state space between linear forms of drives (i, N) and rows (o, N)."""
    rows, drives = np.concatenate([rows, plant.sensed]), np.concatenate([drives, plant.pushed])
    bare = statespace.assemble(
        _add_dampers(plant),
        drives,
        [*inputs, *plant.actuator],
        rows,
        [*outputs, *plant.sensor],
        undriven=not inputs,
    )
    i, o = len(inputs), len(outputs)
    a, b, c, d = bare.a, bare.b, bare.c, bare.d
    names, units = list(bare.state), list(bare.state_unit)
    for n, loop in enumerate(plant.loops):
        if loop.damper is None:
            a, b, c, d = _feed_back(a, b, c, d, i + n, o + n, realise_filter(loop))
            new = len(a) - len(names)
            names += [f"loop {loop.name} {k + 1}" for k in range(new)]
            units += ["1"] * new
    return statespace.StateSpace(
        a,
        b[:, :i],
        c[:o],
        d[:o, :i],
        tuple(names),
        tuple(units),
        bare.input[:i],
        bare.input_unit[:i],
        bare.output[:o],
        bare.output_unit[:o],
    )


def _add_dampers(plant: Plant) -> LinearSystem:
    """Add velocity dampers to the damping matrix, which need not stay symmetric."""
    damping = plant.model.damping.copy()
    for loop, sensed, pushed in zip(plant.loops, plant.sensed, plant.pushed, strict=True):
        if loop.damper is not None:
            damping = damping + loop.damper * np.outer(pushed, sensed)
    return replace(plant.model, damping=damping)


def realise_filter(loop: Loop) -> tuple[Array, Array, Array, Array]:
    """Realise the filter H of a loop as a state space A, B, C, D (rad/s)."""
    from scipy.signal import zpk2ss

    zeros, poles = (
        -2 * np.pi * np.array(expand_roots(given)) for given in (loop.zeros, loop.poles)
    )
    gain = (loop.gain or 0.0) * (2 * np.pi) ** (len(poles) - len(zeros))
    if not len(poles):
        return np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[gain]])
    return zpk2ss(zeros, poles, gain)


def _feed_back(
    a: Array,
    b: Array,
    c: Array,
    d: Array,
    into: int,
    out: int,
    filtered: tuple[Array, Array, Array, Array],
) -> tuple[Array, Array, Array, Array]:
    """Close the loop u = -H y from output `out` to input `into` of a state space.

    With y = C x + D e + d u (d is 0 unless the actuator pushes a massless coordinate) and H in
    state space, u = -(1 + D_H d)^-1 (C_H x_H + D_H (C x + D e)).
    """
    fa, fb, fc, fd = filtered
    push, see, see_e, direct = b[:, [into]], c[[out]], d[[out]], d[out, into]
    factor = 1.0 / (1.0 + fd * direct)
    from_x, from_f, from_e = (
        -factor @ fd @ see,
        -factor @ fc,
        -factor @ fd @ see_e,
    )  # the parts of u
    top = np.concatenate([a + push @ from_x, push @ from_f], axis=1)
    bottom = np.concatenate([fb @ (see + direct * from_x), fa + direct * fb @ from_f], axis=1)
    drive = np.concatenate([b + push @ from_e, fb @ (see_e + direct * from_e)])
    feed = d[:, [into]]
    return (
        np.concatenate([top, bottom]),
        drive,
        np.concatenate([c + feed @ from_x, feed @ from_f], axis=1),
        d + feed @ from_e,
    )
