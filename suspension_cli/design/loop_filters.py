"""Filters of control loops, from the keys of `[[control.loop]]`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from suspension_cli.design import foton
from suspension_cli.design.foton import Filter
from suspension_cli.design.schema import Loop


def expand_roots(given: Sequence[float | list[float]]) -> list[complex]:
    """List roots in Hz as complex numbers; a pair [re, im] stands for both conjugates."""
    result: list[complex] = []
    for root in given:
        result += (
            [complex(*root), complex(root[0], -root[1])]
            if isinstance(root, list)
            else [complex(root)]
        )
    return result


def without_gain_at(loop: Loop) -> Filter:
    """Return the filter H of a loop before `gain_at` is applied, without sensor and delay."""
    if loop.damper is not None:
        return Filter(2 * math.pi * loop.damper, (0j,))
    if loop.filter is not None:
        return foton.parse(loop.filter)
    gain = (1.0 if loop.gain_at is not None else 0.0) if loop.gain is None else loop.gain
    return Filter(gain, tuple(expand_roots(loop.zeros)), tuple(expand_roots(loop.poles)))


def controller(loop: Loop) -> Filter:
    """Return the filter H of a loop, without sensor and delay."""
    bare = without_gain_at(loop)
    if loop.gain_at is None:
        return bare
    size = abs(bare.at(loop.gain_at.frequency))
    return replace(bare, gain=bare.gain * loop.gain_at.magnitude / size)


def controller_and_sensor(loop: Loop) -> Filter:
    """Return the filter from motion to force: controller and sensor, without the delay."""
    made = controller(loop)
    return made if loop.sensor_response is None else made * foton.parse(loop.sensor_response)


def is_velocity_damper(loop: Loop) -> bool:
    """Whether the loop acts as a viscous damper: without sensor dynamics and delay."""
    return loop.damper is not None and loop.sensor_response is None and loop.delay == 0
