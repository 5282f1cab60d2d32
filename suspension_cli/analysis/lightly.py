"""Poles that hardly decay, with all digits of their decay.

The eigenvalues of a state space have real parts wrong by a rounding of the largest of them: a Q of 1e10 drowns.  In the shape x that a pole
s = sigma + i omega has in Z(s) x = 0, though, x^H Z x is 0 too, and its imaginary part tells the decay by what alone dissipates or feeds,

    -2 sigma omega x^H M x = x^H K'' x + omega x^H C x + Im(sum over loops of H(s) (x^H push) (sense x)),

as M, K and C are symmetric: nothing of the stiffness is left in it, and an error in x counts as one of x does, not of the stiffness.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from suspension_cli.analysis import control
from suspension_cli.analysis.control import Plant
from suspension_cli.analysis.poles import Poles
from suspension_cli.analysis.quality import NOTHING

SLOW = 1e-3
"""Decay over frequency below which a pole is worked out again."""
STEPS = 4
"""Of inverse iteration; each brings the shape as much nearer as its own pole is nearer than others."""
NEAR = 1e-9
"""Change of a decay, over the frequency, up to which it may have been a rounding error."""
ASIDE = 1e-12
"""How far beside a pole, as a share of it, its shape is solved for, as on it there may be no solution."""


def refined(found: Poles, plant: Plant) -> Poles:
    """The poles of a plant with its loops closed, those that hardly decay (or grow) with all digits; exactly imaginary where nothing acts."""
    model = plant.model
    values = np.where(np.abs(found.value.real) <= found.rounding * np.abs(found.value), 1j * found.value.imag, found.value)
    joined = np.abs(model.damping)
    for pushed, sensed in zip(plant.pushed, plant.sensed, strict=True):
        joined = joined + np.abs(np.outer(pushed, sensed))
    groups = replace(model, damping=joined).blocks
    known = {name: n for n, name in enumerate(model.coordinate)}
    for n, (value, state) in enumerate(zip(found.value, found.state, strict=True)):
        place = known.get(state.split(" ", 1)[0])
        if place is None or value.imag == 0 or abs(value.real) > SLOW * abs(value):
            continue
        group = next(group for group in groups if place in group)
        better = _refined(complex(value), plant, group)
        if abs(better.real - value.real) <= NEAR * abs(value):  # else one shape stands for two poles at one frequency
            values[n] = better
    return Poles(values, found.state)


def _refined(s: complex, plant: Plant, group: Any) -> complex:
    """A pole near s whose shape lies in a group of coordinates: the same frequency, and the decay that its shape has."""
    model, here = plant.model, np.ix_(group, group)
    mass, stiffness, damping = model.mass[here], model.stiffness[here], model.damping[here]
    lost = np.zeros_like(mass) if model.lossy is None else model.lossy[here].imag
    pushed, sensed = plant.pushed[:, group], plant.sensed[:, group]

    def fed(at: complex) -> Any:
        return np.array([control.filter_response(loop, np.asarray(at / (2j * np.pi))) for loop in plant.loops], dtype=complex)

    root = np.sqrt(np.abs(np.diag(stiffness)) + abs(s) ** 2 * np.diag(mass))
    shape = np.random.default_rng(0).normal(size=len(group)).astype(complex)
    for _ in range(STEPS):
        near = s * (1 + ASIDE)
        dynamic = stiffness + 1j * lost + near * damping + near**2 * mass + (pushed.T * fed(near)) @ sensed
        shape = np.linalg.solve(dynamic / np.outer(root, root), shape)
        shape = shape / np.abs(shape).max()
        x = shape / root
        weight, gain = (x.conj() @ mass @ x).real, fed(s) * (pushed @ x.conj()) * (sensed @ x)
        acting = (x.conj() @ lost @ x).real + s.imag * (x.conj() @ damping @ x).real + gain.sum().imag
        sigma = -acting / (2 * s.imag * weight) if abs(acting) > NOTHING * s.imag**2 * weight else 0.0
        s = complex(sigma, s.imag)
    return s
