"""What local control does to a suspension: poles, margins, impulse response, sensor noise at the test mass."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from suspension_cli.analysis import control, export, lightly, margins, poles, signals
from suspension_cli.analysis.control import Plant
from suspension_cli.analysis.margins import Margins
from suspension_cli.analysis.poles import Poles
from suspension_cli.analysis.rational import rational
from suspension_cli.design.scene import Array
from suspension_cli.design.schema import Design
from suspension_cli.mechanics.model import LinearModel

STILL = 1e-6
"""Share of the lowest frequency of a pole or zero at which everything stands still, to 1e-12."""
REAL = 1e-3
"""Imaginary over real part of a loop gain that goes to a real number towards 0 Hz."""


@dataclass(frozen=True)
class Damped:
    """Local control of one design.

    Attributes
    ----------
    loop : tuple of str
        Names of the loops.
    open, closed : Poles
        Of the suspension (with its own losses), and with all loops closed.
    margin : tuple of Margins or None
        Of each loop, the others closed; None if the closed loop is unstable.
    output, drive : str
        What is watched, and what gets the impulse.
    time, impulse, undamped : (t,) arrays
        s, and the output's response to a unit impulse, with and without the loops.
    frequency, noise : (f,), (f, l) arrays
        Hz, and each sensor's noise at the output, m/sqrt(Hz) or rad/sqrt(Hz).
    gain : (f, l) complex array
        Loop gains.
    """

    loop: tuple[str, ...]
    open: Poles
    closed: Poles
    margin: tuple[Margins, ...] | None
    output: str
    drive: str
    time: Array
    impulse: Array
    undamped: Array
    frequency: Array
    noise: Array
    gain: Array

    @property
    def stable(self) -> bool:
        """Whether no closed-loop pole grows."""
        return self.closed.stable


def solve(design: Design, model: LinearModel, output: str, drive: str, frequency: Array, duration: float, samples: int = 4001) -> Damped:
    """Close the loops of a design.

    Poles, margins, loop gains and noise take losses as they are, impulse responses those of modes (`rational`).

    Parameters
    ----------
    design : Design
        With a `[control]` table.
    model : LinearModel
        Without wires that have mass.
    output, drive : str
        Signals: a motion, and a force (or motion of the support) that gets a unit impulse.
    frequency : (f,) array
        For the noise, Hz.
    duration : float
        Of the impulse response, s.
    """
    plant, constant = control.plant(design, model), control.plant(design, rational(model))
    known = signals.bodies(model)
    watched, driven = signals.motion(output, known), signals.drive(drive, known)
    every = _all_motions(model)
    closed = lightly.refined(poles.poles(control.closed_loop(constant, [], every)), plant)
    bare = lightly.refined(poles.poles(control.closed_loop(_open(constant), [], every)), _open(plant))
    answer = control.closed(plant, frequency, [driven], [watched])
    corners = features(constant, closed)
    time = np.linspace(0.0, duration, samples)
    return Damped(
        loop=tuple(loop.name for loop in plant.loops),
        open=bare,
        closed=closed,
        margin=tuple(margins.margins(partial(control.loop_gains, plant), corners, _static(plant, corners[0]))) if closed.stable else None,
        output=output,
        drive=drive,
        time=time,
        impulse=poles.impulse(control.closed_loop(constant, [driven], [watched]), time)[:, 0, 0],
        undamped=poles.impulse(control.closed_loop(_open(constant), [driven], [watched]), time)[:, 0, 0],
        frequency=frequency,
        noise=answer.noise[:, 0],
        gain=answer.loop_gain,
    )


def _open(plant: Plant) -> Plant:
    """The same without loops."""
    nothing = np.zeros((0, plant.model.size))
    return Plant(plant.model, (), [], [], nothing, nothing)


def _all_motions(model: LinearModel) -> list[signals.Signal]:
    """Every motion of every body, so that no mode is left out."""
    known = signals.bodies(model)
    return [signals.motion(f"{body}.{dof}", known) for body in model.body for dof in signals.DOFS]


def features(plant: Plant, closed: Poles) -> Array:
    """Frequencies (n,) in Hz at which loop gains L may have poles and zeros, and 1 + L zeros, with the width of each beside it.

    Of a plant with constant matrices: those of each loop's mechanics, the other loops closed, those of its filter, and the poles with all loops closed.
    """
    found = [closed.value / (2 * np.pi)]
    for n, loop in enumerate(plant.loops):
        form = export.zero_pole_gain(control.broken(plant, n))
        found += [form.zeros[0][0] / (2 * np.pi), form.poles[0][0] / (2 * np.pi)]
        found += [np.array(control.roots(given), dtype=complex) for given in (loop.zeros, loop.poles)]
    every = np.concatenate(found)
    every = every[np.isfinite(every) & (np.abs(every) > 0)]
    centre, width = np.abs(np.imag(every)), np.abs(np.real(every))
    return np.unique(np.concatenate([np.abs(every), *(np.abs(centre + side * width) for side in (-3.0, -1.0, 0.0, 1.0, 3.0))]))


def _static(plant: Plant, lowest: float) -> Array:
    """Loop gains (l,) far below the lowest pole and zero, without losses, which do not act there; infinite where they are not real."""
    found = control.loop_gains(replace(plant, model=replace(plant.model, terms=(), lossy=None)), np.array([STILL * lowest]))[0]
    real, imag = np.real(found), np.imag(found)
    return np.where(np.abs(imag) <= REAL * np.abs(real), real, np.inf)
