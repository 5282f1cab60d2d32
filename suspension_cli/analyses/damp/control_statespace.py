"""State spaces of local control: closed loops, filters and delays."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from math import factorial
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.damp.control import Plant
from suspension_cli.design.schema import Loop
from suspension_cli.linear import signals, statespace
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

Realisation = tuple[Array, Array, Array, Array]
"""State space A, B, C, D of real matrices."""

PADE = 8
"""Order of Pade's approximation of a delay T; its error is 5e-4 up to omega T = 8."""
DELAY = "delay"
"""Word in the names of states that approximate a delay."""


def build_closed_loop(
    plant: Plant, inputs: list[Signal], outputs: list[Signal]
) -> statespace.StateSpace:
    """Build the closed-loop state space: states of the mechanics, then of the filters.

    Without inputs it has all poles of the observed blocks.
    """
    model = plant.model
    drives, rows = (
        np.array([signals.linear_form(s, model) for s in some]).reshape(-1, model.size)
        for some in (inputs, outputs)
    )
    return _close_loops(plant, drives, inputs, rows, outputs)


def build_broken_loop(plant: Plant, n: int) -> statespace.StateSpace:
    """Build the state space from actuator to sensor of loop n, the other loops closed."""
    others = plant.with_loops([k for k in range(len(plant.loops)) if k != n])
    return _close_loops(
        others, plant.pushed[[n]], [plant.actuator[n]], plant.sensed[[n]], [plant.sensor[n]]
    )


def _close_loops(
    plant: Plant, drives: Array, inputs: list[Signal], rows: Array, outputs: list[Signal]
) -> statespace.StateSpace:
    """Build the closed-loop state space between drives (i, N) and rows (o, N)."""
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
        if not loop.is_velocity_damper:
            # states of the filter, then of its delay
            realised = realise_filter(loop)
            delayed = realise_delayed_filter(loop) if loop.delay else realised
            a, b, c, d = _feed_back(a, b, c, d, i + n, o + n, delayed)
            new, own = len(delayed[0]), len(realised[0])
            names += [f"loop {loop.name} {k + 1}" for k in range(own)]
            names += [f"loop {loop.name} {DELAY} {k + 1}" for k in range(new - own)]
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
    """Add velocity dampers to the damping matrix, which may become asymmetric."""
    damping = plant.model.damping.copy()
    for loop, sensed, pushed in zip(plant.loops, plant.sensed, plant.pushed, strict=True):
        if loop.damper is not None and loop.is_velocity_damper:
            damping = damping + loop.damper * np.outer(pushed, sensed)
    return replace(plant.model, damping=damping)


def realise_filter(loop: Loop) -> Realisation:
    """Realise filter and sensor of a loop without delay as A, B, C, D (rad/s).

    Empty for a damper, whose gain grows with frequency.
    """
    from scipy.signal import zpk2ss

    made = loop.controller_and_sensor
    if len(made.zeros) > len(made.poles):
        return np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.zeros((1, 1))
    zeros, poles = (-2 * np.pi * np.array(roots) for roots in (made.zeros, made.poles))
    gain = made.gain * (2 * np.pi) ** (len(poles) - len(zeros))
    if not len(poles):
        return np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.array([[gain]])
    return zpk2ss(zeros, poles, gain)


def realise_delayed_filter(loop: Loop) -> Realisation:
    """Realise the filter of a loop with its delay as Pade's fraction of order `PADE` over `PADE`.

    For a damper, whose gain grows with frequency, the order is `PADE` - 1 over `PADE`.
    """
    made = loop.controller_and_sensor
    if len(made.zeros) > len(made.poles):  # a damper
        zeros, poles = _pade_roots(PADE - 1, PADE)
        scale = loop.delay**-1
        zeros = np.append(zeros, 0.0)
        return _realise_sections(zeros * scale, poles * scale, made.gain / (2 * np.pi), loop.delay)
    fa, fb, fc, fd = realise_filter(loop)
    zeros, poles = (roots / loop.delay for roots in _pade_roots(PADE, PADE))
    da, db, dc, dd = _realise_sections(zeros, poles, 1.0, loop.delay)
    # in series: motion -> filter -> delay
    a = np.block([[fa, np.zeros((len(fa), len(da)))], [db @ fc, da]])
    return a, np.concatenate([fb, db @ fd]), np.concatenate([dd @ fc, dc], axis=1), dd @ fd


@cache
def _pade_roots(m: int, n: int) -> tuple[Complex[np.ndarray, " m"], Complex[np.ndarray, " n"]]:
    """Zeros and poles of Pade's approximation of exp(-x), of order m over n.

    Golub and Van Loan, Matrix Computations, 4th ed., section 9.3.1.
    """
    over, under = (
        [
            factorial(m + n - j) * factorial(top) * sign**j / (factorial(j) * factorial(top - j))
            for j in range(top + 1)
        ]
        for top, sign in ((m, -1), (n, 1))
    )
    return np.roots(over[::-1]), np.roots(under[::-1])


def _realise_sections(
    zeros: Complex[np.ndarray, " zero"],
    poles: Complex[np.ndarray, " pole"],
    gain: float,
    delay: float,
) -> Realisation:
    """Realise a delay as sections of second order with states of similar size.

    Parameters
    ----------
    zeros, poles
        rad/s; an even number of poles.
    gain
        Response at 0, or its slope if there is a zero at 0.
    delay
        s.
    """
    from scipy.signal import zpk2sos

    # in units of 1 / delay, in which the roots are of order 1
    sections = zpk2sos(zeros * delay, poles * delay, 1.0, analog=True)
    a, b, c, d = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1))
    for b0, b1, b2, _, a1, a2 in sections:
        w = np.sqrt(a2)
        sa = np.array([[0.0, w], [-w, -a1]]) / delay
        sb = np.array([[0.0], [w]]) / delay
        sc = np.array([[(b2 - b0 * a2) / a2, (b1 - b0 * a1) / w]])
        a = np.block([[a, np.zeros((len(a), 2))], [sb @ c, sa]])
        b, c, d = np.concatenate([b, sb @ d]), np.concatenate([b0 * c, sc], axis=1), b0 * d
    # normalise the response at 0, or its slope
    at_zero = (d - c @ np.linalg.solve(a, b))[0, 0]
    if (zeros == 0).any():
        at_zero = -(c @ np.linalg.solve(a, np.linalg.solve(a, b)))[0, 0]
    return a, b, c * (gain / at_zero), d * (gain / at_zero)


def _feed_back(
    a: Float[np.ndarray, "state state"],
    b: Float[np.ndarray, "state input"],
    c: Float[np.ndarray, "output state"],
    d: Float[np.ndarray, "output input"],
    into: int,
    out: int,
    filtered: Realisation,
) -> Realisation:
    """Close the loop u = -H y from output `out` to input `into` of a state space.

    With y = C x + D e + d u (d is 0 unless the actuator pushes a massless coordinate),
    u = -(1 + D_H d)^-1 (C_H x_H + D_H (C x + D e)).
    """
    fa, fb, fc, fd = filtered
    push, see, see_e, direct = b[:, [into]], c[[out]], d[[out]], d[out, into]
    factor = -1.0 / (1.0 + fd * direct)
    from_x, from_f, from_e = factor @ fd @ see, factor @ fc, factor @ fd @ see_e  # parts of u
    top = np.concatenate([a + push @ from_x, push @ from_f], axis=1)
    bottom = np.concatenate([fb @ (see + direct * from_x), fa + direct * fb @ from_f], axis=1)
    drive = np.concatenate([b + push @ from_e, fb @ (see_e + direct * from_e)])
    feed = d[:, [into]]
    out_x = np.concatenate([c + feed @ from_x, feed @ from_f], axis=1)
    return np.concatenate([top, bottom]), drive, out_x, d + feed @ from_e
