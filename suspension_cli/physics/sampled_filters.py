"""Filters of control loops at the sample rate of a run in time, or at a divisor of it.

A filter in w = 2 rate (z - 1)/(z + 1) (`design.foton`) has its zeros and poles at z = (1 - pi r /
rate) / (1 + pi r / rate); a continuous one is made digital as Foton does. A delay is a number of
samples of the run. A filter whose own rate is lower runs at every few samples, and its output is
held in between, as front ends pass signals between models of different rates.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design import foton
from suspension_cli.design.foton import Filter
from suspension_cli.errors import InputError
from suspension_cli.linear.joined_systems import Matrices

if TYPE_CHECKING:
    from suspension_cli.physics.local_control import Plant
    from suspension_cli.physics.loop_network import Network, Node

MOST_DELAY = 4096
"""Most samples of a delay."""
WHOLE = 1e-6
"""Distance from a whole number of samples up to which a delay is one; relative, of rates."""


@dataclass(frozen=True)
class Stage:
    """A filter that runs at one of `every` samples, and holds its output in between."""

    system: Matrices
    every: int = 1

    def at(self, sample: int) -> Matrices:
        """System of one sample of the run; if it is held in between, a last state is its output."""
        if self.every == 1:
            return self.system
        states = len(self.system.a)
        if sample % self.every:
            last = np.eye(1, states + 1, k=states)
            unread = np.zeros((states + 1, 1))
            return Matrices(np.eye(states + 1), unread, last, np.zeros((1, 1)))
        one = self.system
        forgotten = np.zeros((states + 1, 1))
        return Matrices(
            np.hstack([np.concatenate([one.a, one.c]), forgotten]),
            np.concatenate([one.b, one.d]),
            np.hstack([one.c, np.zeros((1, 1))]),
            one.d,
        )


def make_stages(node: Node, rate: float, *, damper: bool) -> tuple[Stage, ...]:
    """Make the discrete systems in series of a filter at a sample rate (Hz), with its delay.

    What is given last, the response of a loop's own sensor, comes first. A `damper` gets Foton's
    pole at rate / pi. Raises `InputError` for a filter whose rate does not divide that of the run,
    one that does not fit below half the rate, or a delay of too many samples.
    """
    stages = [_make_stage(part, rate, node.key, damper=damper) for part in node.filter.parts[::-1]]
    samples = count_delay(node, rate)
    if samples > MOST_DELAY:
        problem = f"has a delay of {samples:,} samples, more than {MOST_DELAY:,}"
        raise InputError.of(node.key, problem, "lower --rate")
    if samples:
        shift = np.eye(samples, k=-1)
        first = np.eye(samples, 1)
        last = np.eye(1, samples, k=samples - 1)
        stages.append(Stage(Matrices(shift, first, last, np.zeros((1, 1)))))
    return tuple(stages)


def in_series(stages: tuple[Stage, ...], sample: int) -> Matrices:
    """System of stages in series at one sample of the run."""
    made = Matrices.unchanged()
    for stage in stages:
        made = made.then(stage.at(sample))
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
            found.append(f"{node.key}: {delay} is rounded to {samples} samples at {rate:g} Hz")
    return found


def aliasing_filters(network: Network, rate: float) -> list[str]:
    """Describe filters below a rate (Hz) that read signals without a low-pass filter before."""
    found = []
    for number, node in enumerate(network.nodes):
        before = [network.nodes[n] for n in np.flatnonzero(network.upstream[number]).tolist()]
        for slow in node.filter.parts:
            others = (part for one in before for part in one.filter.parts)
            is_filtered = any(part.poles for part in others if part.rate in (0, rate))
            if 0 < slow.rate < rate and not is_filtered:
                found.append(
                    f"{node.key}: reads at {slow.rate:g} Hz without an anti-alias filter, so what"
                    f" is above {slow.rate / 2:g} Hz appears below; give the poles of one in"
                    " sensor_response"
                )
    return found


def _make_stage(part: Filter, rate: float, key: str, *, damper: bool) -> Stage:
    """Make the discrete system of filters of one rate."""
    every = rate / part.rate if part.rate else 1.0
    whole = max(round(every), 1)
    if abs(every - whole) > WHOLE * whole:
        problem = f"has a rate of {part.rate:g} Hz, of which {rate:g} Hz is no multiple"
        higher = int(np.ceil(every)) * part.rate
        raise InputError.of(key, problem, f"give --rate {higher:g}")
    if not part.rate:
        part = _make_digital(part, rate, key, damper=damper)
    return Stage(_sections(part), whole)


def _make_digital(part: Filter, rate: float, key: str, *, damper: bool) -> Filter:
    """Make a continuous filter digital."""
    try:
        made = foton.change_rate(part, rate)
    except foton.FotonError as error:
        raise InputError.of(key, error.problem, error.remedy) from None
    if damper:
        pole = rate / np.pi
        made = Filter(made.gain * pole, made.zeros, (*made.poles, complex(pole)), rate)
    return made


def _sections(part: Filter) -> Matrices:
    """Make the discrete system of a digital filter, in sections of second order."""
    from scipy.signal import tf2ss, zpk2sos

    rate = part.rate

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
