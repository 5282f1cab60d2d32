"""Local control: loops from sensors to actuators, closed.

Each loop applies u = -H(f) (y + n) with its sensor's motion y and noise n.  A sensor that refers to the support
measures the motion of the body relative to the support structure, as if that reached there rigidly, and the actuator pushes against the
same structure.  Closed-loop responses come from the open-loop ones, which are solved directly:
x = G_e e + G_u u, u = -(1 + H G_yu)^-1 H (G_ye e + n).  Poles come from the state space, and are refined (`lightly`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.analysis import response, signals, statespace
from suspension_cli.analysis.signals import Signal
from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design.derive import com_positions
from suspension_cli.design.scene import Array
from suspension_cli.design.schema import Design, Loop
from suspension_cli.errors import Fault, InputError, shown
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.rotations import cross_matrix

BESIDE = (0.0, 1e-15, -1e-15, 3e-15, -3e-15, 1e-14, -1e-14)
"""Relative steps aside, tried in turn, from a frequency at which there is no finite response."""


@dataclass(frozen=True)
class Plant:
    """A model with the sensors and actuators of its loops.

    Attributes
    ----------
    model : LinearModel
    loops : tuple of Loop
    sensor, actuator : lists of Signal
    sensed, pushed : (l, N) arrays
        What the sensors measure and what the actuators push, as linear forms of the coordinates.
    """

    model: LinearModel
    loops: tuple[Loop, ...]
    sensor: list[Signal]
    actuator: list[Signal]
    sensed: Array
    pushed: Array


def plant(design: Design, model: LinearModel) -> Plant:
    """The loops of a design on its model.

    Raises
    ------
    InputError
        If there is no loop, or a sensor or actuator names nothing.
    """
    if design.control is None:
        raise InputError([Fault("control", "missing", "add [[control.loop]] with sensor, actuator and damper or gain")])
    known, positions = signals.bodies(model), com_positions(design)
    sensors, actuators, sensed, pushed = [], [], [], []
    for loop in design.control.loop:
        sensor, actuator = sensor_of(loop, model.body, known), actuator_of(loop, known)
        sensors.append(sensor)
        actuators.append(actuator)
        sensed.append(_relative(sensor, model, positions, loop.reference))
        pushed.append(_relative(actuator, model, positions, loop.reference))
    return Plant(model, tuple(design.control.loop), sensors, actuators, np.array(sensed), np.array(pushed))


def sensor_of(loop: Loop, stages: tuple[str, ...], known: tuple[str, ...]) -> Signal:
    """The motion that a loop senses; `InputError` if it is none of a stage."""
    key = f"control.loop.{loop.name}.sensor"
    sensor = signals.parse(loop.sensor, key, known)
    if sensor.acts or sensor.body not in stages:
        raise InputError([Fault(key, "is no motion of a stage", "write for example upper.x", shown(loop.sensor))])
    return sensor


def actuator_of(loop: Loop, known: tuple[str, ...]) -> Signal:
    """The force with which a loop acts; `InputError` if it is none."""
    key = f"control.loop.{loop.name}.actuator"
    actuator = signals.parse(loop.actuator, key, known)
    if not actuator.acts:
        raise InputError([Fault(key, "is no force or torque", "write for example upper.force_x", shown(loop.actuator))])
    return actuator


def _relative(signal: Signal, model: LinearModel, positions: dict[str, Any], reference: str) -> Array:
    """A motion relative to the support structure (the frame included, where it moves)."""
    row = signals.row(signal, model)
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


def filter_response(loop: Loop, frequency: Array) -> Any:
    """H of one loop at frequencies in Hz: N/m or N m/rad, (f,)."""
    f = 1j * np.asarray(frequency)
    if loop.damper is not None:
        return loop.damper * 2 * np.pi * f
    zeros, poles = roots(loop.zeros), roots(loop.poles)
    result = np.full(f.shape, complex(loop.gain or 0.0))
    for zero in zeros:
        result = result * (f + zero)
    for pole in poles:
        result = result / (f + pole)
    return result


def roots(given: list[Any]) -> list[complex]:
    """Roots in Hz; a pair [re, im] stands for both conjugates."""
    result: list[complex] = []
    for root in given:
        result += [complex(*root), complex(root[0], -root[1])] if isinstance(root, list) else [complex(root)]
    return result


@dataclass(frozen=True)
class Closed:
    """Responses with the loops closed.

    Attributes
    ----------
    frequency : (f,) array
        Hz.
    value : (f, o, i) complex array
        Outputs over external inputs.
    noise : (f, o, l) array
        Amplitude spectral density at each output from each sensor's noise, m/sqrt(Hz) or rad/sqrt(Hz).
    loop_gain : (f, l) complex array
        H G of each loop broken at its actuator, the others closed: it is stable by itself while 1 + H G stays away from 0.
    """

    frequency: Array
    value: Any
    noise: Array
    loop_gain: Any


def closed(plant: Plant, frequency: Array, inputs: list[Signal], outputs: list[Signal]) -> Closed:
    """Closed-loop responses, sensor noise at the outputs and loop gains."""
    model, count = plant.model, len(plant.loops)
    rows = np.concatenate([np.array([signals.row(s, model) for s in outputs]), plant.sensed])
    drives = np.concatenate([np.array([signals.row(s, model) for s in inputs]), plant.pushed])
    acts = [*(s.acts for s in inputs), *([True] * count)]
    g, _ = response.transfer(model, 2 * np.pi * frequency, drives, acts, rows)
    i, o = len(inputs), len(outputs)
    h = _filters(plant, frequency)
    to_actuator = np.linalg.solve(np.eye(count) + h[:, :, None] * g[:, o:, i:], h[:, :, None] * np.eye(count))
    value = g[:, :o, :i] - g[:, :o, i:] @ to_actuator @ g[:, o:, :i]
    densities = np.array([loop.sensor_noise for loop in plant.loops])
    noise = np.abs(g[:, :o, i:] @ to_actuator) * densities
    return Closed(frequency, value, noise, _loop_gains(h, g[:, o:, i:]))


def loop_gains(plant: Plant, frequency: Array) -> Any:
    """Gain (f, l) of each loop broken at its actuator, the others closed, at frequencies in Hz; beside a resonance without loss for one on it."""
    result = np.full((len(frequency), len(plant.loops)), np.nan, dtype=complex)
    left = np.arange(len(frequency))
    with np.errstate(all="ignore"):
        for beside in BESIDE:
            at = frequency[left] * (1 + beside)
            g, _ = response.transfer(plant.model, 2 * np.pi * at, plant.pushed, [True] * len(plant.loops), plant.sensed, finite=False)
            known = np.isfinite(g).all((1, 2))
            result[left[known]] = _loop_gains(_filters(plant, at[known]), g[known])
            left = left[~known]
            if not len(left):
                break
    return result


def _filters(plant: Plant, frequency: Array) -> Any:
    """H (f, l) of all loops."""
    return np.stack([filter_response(loop, frequency) for loop in plant.loops], axis=-1)


def _loop_gains(h: Any, g: Any) -> Any:
    """Gain of each loop with the others closed, (f, l): H_k times the plant that the others leave."""
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


def closed_loop(plant: Plant, inputs: list[Signal], outputs: list[Signal]) -> statespace.StateSpace:
    """State space with the loops closed: the mechanics' states, then those of the filters.

    Without inputs it holds every block that is watched, driven or not (for all poles).
    """
    model = plant.model
    drives, rows = (np.array([signals.row(s, model) for s in some]).reshape(-1, model.size) for some in (inputs, outputs))
    return _closed_loop(plant, drives, inputs, rows, outputs)


def broken(plant: Plant, n: int) -> statespace.StateSpace:
    """State space from the actuator of loop n to its sensor, the other loops closed."""
    keep = [k for k in range(len(plant.loops)) if k != n]
    others = Plant(
        plant.model,
        tuple(plant.loops[k] for k in keep),
        [plant.sensor[k] for k in keep],
        [plant.actuator[k] for k in keep],
        plant.sensed[keep],
        plant.pushed[keep],
    )
    return _closed_loop(others, plant.pushed[[n]], [plant.actuator[n]], plant.sensed[[n]], [plant.sensor[n]])


def _closed_loop(plant: Plant, drives: Array, inputs: list[Signal], rows: Array, outputs: list[Signal]) -> statespace.StateSpace:
    """State space with the loops closed, from linear forms (i, N) that drive to linear forms (o, N) that are watched."""
    rows, drives = np.concatenate([rows, plant.sensed]), np.concatenate([drives, plant.pushed])
    bare = statespace.assemble(_with_dampers(plant), drives, [*inputs, *plant.actuator], rows, [*outputs, *plant.sensor], undriven=not inputs)
    i, o = len(inputs), len(outputs)
    a, b, c, d = bare.a, bare.b, bare.c, bare.d
    names, units = list(bare.state), list(bare.state_unit)
    for n, loop in enumerate(plant.loops):
        if loop.damper is None:
            a, b, c, d = _feed_back(a, b, c, d, i + n, o + n, filter_matrices(loop))
            new = len(a) - len(names)
            names += [f"loop {loop.name} {k + 1}" for k in range(new)]
            units += ["1"] * new
    return statespace.StateSpace(
        a, b[:, :i], c[:o], d[:o, :i], tuple(names), tuple(units), bare.input[:i], bare.input_unit[:i], bare.output[:o], bare.output_unit[:o]
    )


def _with_dampers(plant: Plant) -> LinearModel:
    """The model with its velocity dampers as viscous forces; they need not be symmetric."""
    from dataclasses import replace

    damping = plant.model.damping.copy()
    for loop, sensed, pushed in zip(plant.loops, plant.sensed, plant.pushed, strict=True):
        if loop.damper is not None:
            damping = damping + loop.damper * np.outer(pushed, sensed)
    return replace(plant.model, damping=damping)


def filter_matrices(loop: Loop) -> tuple[Array, Array, Array, Array]:
    """A, B, C, D of a loop's filter H, from its roots in rad/s."""
    from scipy.signal import zpk2ss

    zeros, poles = (-2 * np.pi * np.array(roots(given)) for given in (loop.zeros, loop.poles))
    gain = (loop.gain or 0.0) * (2 * np.pi) ** (len(poles) - len(zeros))
    if not len(poles):
        return np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[gain]])
    return zpk2ss(zeros, poles, gain)


def _feed_back(a: Array, b: Array, c: Array, d: Array, into: int, out: int, filtered: tuple[Array, Array, Array, Array]) -> tuple[Array, Array, Array, Array]:
    """Close u = -H y from output `out` to input `into`.

    With y = C x + D e + d u (d is 0 but where an actuator pushes something without mass) and H in state space,
    u = -(1 + D_H d)^-1 (C_H x_H + D_H (C x + D e)).
    """
    fa, fb, fc, fd = filtered
    push, see, see_e, at_once = b[:, [into]], c[[out]], d[[out]], d[out, into]
    share = 1.0 / (1.0 + fd * at_once)
    from_x, from_f, from_e = -share @ fd @ see, -share @ fc, -share @ fd @ see_e  # u, term by term
    top = np.concatenate([a + push @ from_x, push @ from_f], axis=1)
    bottom = np.concatenate([fb @ (see + at_once * from_x), fa + at_once * fb @ from_f], axis=1)
    drive = np.concatenate([b + push @ from_e, fb @ (see_e + at_once * from_e)])
    feed = d[:, [into]]
    return np.concatenate([top, bottom]), drive, np.concatenate([c + feed @ from_x, feed @ from_f], axis=1), d + feed @ from_e
