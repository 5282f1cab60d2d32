"""What local control does to a suspension: poles, margins, impulse response, sensor noise at the test mass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from suspension_cli.analysis import control, lightly, poles, signals
from suspension_cli.analysis.poles import Margins, Poles
from suspension_cli.design.scene import Array
from suspension_cli.design.schema import Design
from suspension_cli.mechanics.model import LinearModel

LINEWIDTHS = np.concatenate([-np.geomspace(30, 0.03, 25), np.geomspace(0.03, 30, 25)])
"""Offsets from each pole, in its half widths, at which loop gains are sampled; not 0, where without loss they are infinite."""


@dataclass(frozen=True)
class Damped:
    """Local control of one design.

    Attributes
    ----------
    loop : tuple of str
        Names of the loops.
    open, closed : Poles
        Of the suspension (with its own losses), and with all loops closed.
    margin : tuple of Margins
        Of each loop, the others closed.
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
    margin: tuple[Margins, ...]
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
        return bool((self.closed.value.real <= self.closed.rounding * np.abs(self.closed.value)).all())


def solve(design: Design, model: LinearModel, output: str, drive: str, frequency: Array, duration: float, samples: int = 4001) -> Damped:
    """Close the loops of a design.

    Parameters
    ----------
    design : Design
        With a `[control]` table.
    model : LinearModel
    output, drive : str
        Signals: a motion, and a force (or motion of the support) that gets a unit impulse.
    frequency : (f,) array
        For the noise, Hz.
    duration : float
        Of the impulse response, s.
    """
    plant = control.plant(design, model)
    known = signals.bodies(model)
    watched, driven = signals.motion(output, known), signals.drive(drive, known)
    closed_system = control.closed_loop(plant, [driven], [watched])
    everything = control.closed_loop(plant, [], _all_motions(model))
    open_plant = control.Plant(model, (), [], [], np.zeros((0, model.size)), np.zeros((0, model.size)))
    open_system = control.closed_loop(open_plant, [driven], [watched])
    closed = lightly.refined(poles.poles(everything), plant)
    bare = lightly.refined(poles.poles(control.closed_loop(open_plant, [], _all_motions(model))), open_plant)
    fine = fine_grid(frequency, closed, bare)
    answer = control.closed(plant, frequency, [driven], [watched])
    gains = control.closed(plant, fine, [driven], [watched]).loop_gain
    time = np.linspace(0.0, duration, samples)
    return Damped(
        loop=tuple(loop.name for loop in plant.loops),
        open=bare,
        closed=closed,
        margin=tuple(poles.margins(fine, gains[:, n]) for n in range(gains.shape[1])),
        output=output,
        drive=drive,
        time=time,
        impulse=poles.impulse(closed_system, time)[:, 0, 0],
        undamped=poles.impulse(open_system, time)[:, 0, 0],
        frequency=frequency,
        noise=answer.noise[:, 0],
        gain=answer.loop_gain,
    )


def _all_motions(model: LinearModel) -> list[signals.Signal]:
    """Every motion of every body, so that no mode is left out."""
    known = signals.bodies(model)
    return [signals.motion(f"{body}.{dof}", known) for body in model.body for dof in signals.DOFS]


def fine_grid(frequency: Array, *poles: Poles) -> Array:
    """Frequencies that resolve every resonance, Hz."""
    extra = [frequency]
    for group in poles:
        for centre, decay in zip(group.frequency, -group.value.real / (2 * np.pi), strict=True):
            extra.append(centre + LINEWIDTHS * max(abs(decay), 1e-6 * centre))
    every = np.unique(np.concatenate(extra))
    return every[every > 0]
