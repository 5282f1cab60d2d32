"""State spaces of filters of loops, of dampers and of delays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design.control import Loop
from suspension_cli.design.foton import Filter
from suspension_cli.design.loop_filters import make_response
from suspension_cli.physics.local_control import Plant
from suspension_cli.physics.loop_network import Node

if TYPE_CHECKING:
    from jaxtyping import Complex


PADE = 8
"""Order of Pade's approximation of a delay T."""
PADE_ERROR = 5e-4
"""Its largest error up to omega T = `PADE_RANGE`."""
PADE_RANGE = 8.0
DIRECT = 6
"""Most poles of a filter whose polynomials keep their digits; others become sections in series."""


def viscous_damper(loop: Loop) -> float:
    """Force per velocity of a damper without sensor dynamics, N s/m or N m s/rad; else 0."""
    return loop.damper if loop.damper is not None and loop.sensor_response is None else 0.0


def realise_nodes(plant: Plant) -> list[Any]:
    """Realise the nodes of the network of a plant, see `realise`; of dampers without dynamics 0."""
    dampers = [viscous_damper(loop) for loop in plant.loops]
    others = len(plant.network.nodes) - len(dampers)
    every = zip(plant.network.nodes, [*dampers, *[0.0] * others], strict=True)
    return [realise(node, damper) for node, damper in every]


def realise(node: Node, damper: float = 0.0) -> Any:
    """Realise filter, sensor and delay of a loop (rad/s); of a `damper`, what its delay changes.

    Returns a `scipy.signal.StateSpace`.
    """
    from scipy.signal import StateSpace, zpk2ss

    delay = _realise_delay(node.delay)
    if damper:
        # its force without delay is in the damping matrix: left is c s (exp(-s T) - 1)
        rate = damper * delay.C @ delay.A, damper * delay.C @ delay.B
        return StateSpace(delay.A, delay.B, *rate)
    made = node.filter.continuous
    zeros, poles = (-2 * np.pi * np.array(roots) for roots in (made.zeros, made.poles))
    gain = made.gain * (2 * np.pi) ** (len(poles) - len(zeros))
    if len(poles) <= DIRECT:
        return StateSpace(*zpk2ss(zeros, poles, gain)) * delay if len(poles) else delay * gain
    for own_zeros, own_poles in _pair_roots(zeros, poles):
        delay = StateSpace(*zpk2ss(own_zeros, own_poles, 1.0)) * delay
    return delay * gain


def _pair_roots(
    zeros: Complex[np.ndarray, " zero"], poles: Complex[np.ndarray, " pole"]
) -> list[tuple[list[complex], list[complex]]]:
    """Share the zeros and poles of a proper filter among sections of second order, one of first.

    Each pair of poles gets the pair of zeros nearest to it, else real zeros. (zpk2sos of
    `scipy.signal` fails for some analogue filters with fewer zeros than poles.)
    """
    real = sorted(poles[np.imag(poles) == 0], key=abs)
    sections = [[pole, pole.conjugate()] for pole in poles[np.imag(poles) > 0]]
    sections += [real[n : n + 2] for n in range(0, len(real), 2)]
    pairs = [*zeros[np.imag(zeros) > 0]]
    single = sorted(zeros[np.imag(zeros) == 0], key=abs)
    result = []
    for own in sections:
        chosen: list[complex] = []
        if pairs and len(own) == 2:
            nearest = int(np.argmin([abs(zero - own[0]) for zero in pairs]))
            zero = pairs.pop(nearest)
            chosen = [zero, zero.conjugate()]
        else:
            while single and len(chosen) < len(own):
                chosen.append(single.pop(0))
        result.append((chosen, own))
    return result


def realise_reading(loop: Loop) -> Any:
    """Realise the response of the sensor and the delay of a loop (rad/s)."""
    made = Filter(1.0) if loop.sensor_response is None else make_response(loop.sensor_response)
    return realise(Node("", made, loop.delay))


def _realise_delay(delay: float) -> Any:
    """Realise a delay T as Pade's fraction, in sections (s^2 - b s + w^2) / (s^2 + b s + w^2).

    Its denominator is a Bessel polynomial in s T / 2 (Storch, Proc. IRE 42, 1666 (1954)).
    """
    from scipy.signal import StateSpace

    result: Any = StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.eye(1))
    for pole in delay_poles(delay):
        w = abs(pole)
        b = -2 * pole.real
        a = np.array([[0.0, w], [-w, -b]])
        result = result * StateSpace(a, [[0.0], [w]], [[0.0, -2 * b / w]], np.eye(1))
    return result


def delay_poles(delay: float) -> Complex[np.ndarray, " pole"]:
    """Compute the poles of Pade's fraction of a delay, with Im s > 0; none without a delay."""
    from scipy.signal import besselap

    if not delay:
        return np.zeros(0, dtype=complex)
    roots = np.asarray(besselap(PADE, norm="delay")[1])
    return 2 * roots[roots.imag > 0] / delay
