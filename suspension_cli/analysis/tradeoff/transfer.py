"""Responses by every rung and method."""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.analysis import export, modes, response, signals, statespace
from suspension_cli.analysis.tradeoff import exact
from suspension_cli.analysis.tradeoff.subject import Answer, Prepare, Subject
from suspension_cli.design.scene import Array, Index
from suspension_cli.mechanics import stacks
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.models import fidelity

SWEEP = 2000
"""Frequencies in a batch."""
BAND = 2 * np.pi * np.geomspace(0.1, 1000.0, SWEEP)
"""rad/s, over which they run."""


def reference(subject: Subject) -> Any:
    """The response on the top rung, its matrices solved in 50 digits."""
    model = subject.model(subject.top)
    return exact.response(model, subject.omega, *subject.forms(model))


def digits_reference(subject: Subject) -> Any:
    """The response of the string rung's matrices in 50 digits."""
    model = subject.model("string")
    return exact.response(model, subject.omega, *subject.forms(model))


def chain(model: LinearModel, omega: Array, drive: Array, row: Array) -> Any:
    """Eliminated body by body: what `pendsus response` does."""
    return response.transfer(model, omega, drive[None], [False], row[None])[0][:, 0, 0]


def dense(model: LinearModel, omega: Array, drive: Array, row: Array) -> Any:
    """One LAPACK solve a frequency on each block that is touched.

    Scaled, so that units do not choose the pivots, and from the top down: both keep digits of long chains.
    """
    full = model.stiffness if model.lossy is None else model.lossy
    result = np.full(len(omega), row[:6] @ drive[:6], dtype=complex)
    place = {name: n for n, name in enumerate(model.body)}
    for touched in _touched(model, drive, row):
        block = np.array(sorted(touched, key=lambda n: place.get(model.coordinate[n].split(".", 1)[0], -1)))
        both = np.ix_(block, np.concatenate([np.arange(6), block]))
        dynamic = full[both][..., None] - omega**2 * model.mass[both][..., None]
        if model.damping[both].any():
            dynamic = dynamic + 1j * omega * model.damping[both][..., None]
        pushed = -np.einsum("csf,s->cf", dynamic[:, :6], drive[:6])
        result += row[block] @ stacks.dense(dynamic[:, 6:], pushed[:, None])[:, 0]
    return result


def _touched(model: LinearModel, drive: Array, row: Array) -> list[Index]:
    """The blocks that are driven and seen."""
    pulled = model.pulled[:, drive[:6] != 0].any(1)
    return [block for block in model.blocks if row[block].any() and pulled[block].any()]


# What may be kept is told apart from what each frequency takes: from a model and two linear forms, what gives the response at any frequencies.


def chained(model: LinearModel, drive: Array, row: Array) -> Answer:
    """The chain elimination; the model itself keeps what it prepares."""
    return lambda omega: chain(model, omega, drive, row)


def modal(model: LinearModel, drive: Array, row: Array) -> Answer:
    """Sum over modes, phi (phi . f) / (omega_m^2 + i phi K'' phi + i omega phi C phi - omega^2): right as far as losses do not couple them.

    Of the modes no more than the sum needs: omega_m^2 and shapes of the blocks touched.
    """
    parts = [_modes(model, block) for block in _touched(model, drive, row)]
    poles = np.concatenate([np.zeros(0), *(values for values, _ in parts)])
    shapes = np.concatenate([np.zeros((0, model.size)), *(found for _, found in parts)])
    full = model.stiffness if model.lossy is None else model.lossy
    seen, direct = shapes @ row, row[:6] @ drive[:6]
    k, c, m = (-(shapes @ (matrix[:, :6] @ drive[:6])) * seen for matrix in (full, model.damping, model.mass))
    loss, damping = ((shapes @ matrix * shapes).sum(-1) for matrix in (np.imag(full), model.damping))

    def at(omega: Array) -> Any:
        square = omega[:, None] ** 2
        driven, stiff = k - square * m if m.any() else k, (poles + 1j * loss if loss.any() else poles) - square
        if c.any():
            driven = driven + 1j * omega[:, None] * c
        if damping.any():
            stiff = stiff + 1j * omega[:, None] * damping
        return (driven / stiff).sum(-1) + direct

    return at


def _modes(model: LinearModel, block: Index) -> tuple[Array, Array]:
    """omega^2 (m,) and shapes (m, N) of unit modal mass of a block."""
    kept, mass, stiffness, recover = modes.condensed(model, block)
    inverse = np.linalg.inv(np.linalg.cholesky(mass))
    dynamic = inverse @ stiffness @ inverse.T
    values, vectors = np.linalg.eigh((dynamic + dynamic.T) / 2)
    own = vectors.T @ inverse
    shapes = np.zeros((len(values), model.size))
    shapes[:, kept] = own
    shapes[:, block[model.massless[block]]] = own @ recover.T
    return values, shapes


def realised(model: LinearModel, drive: Array, row: Array) -> Answer:
    """C (i omega - A)^-1 B + D, A balanced."""
    system = _system(model, drive, row)
    return lambda omega: system.at(omega / (2 * np.pi))[:, 0, 0]


def factored(model: LinearModel, drive: Array, row: Array) -> Answer:
    """Gain times the product over zeros and poles."""
    found = export.zero_pole_gain(_system(model, drive, row))
    return lambda omega: found.at(omega / (2 * np.pi))[:, 0, 0]


def _system(model: LinearModel, drive: Array, row: Array) -> statespace.StateSpace:
    known = signals.bodies(model)
    into, out = signals.drive("support.x", known), signals.motion(f"{model.body[-1]}.x", known)
    return statespace.assemble(model, drive[None], [into], row[None], [out])


def on_rung(rung: str) -> tuple[Any, Any]:
    """What `pendsus response` does, from the design on: at the frequencies compared, and over a band."""
    return _timed(lambda subject: fidelity.linear_model(subject.design, rung), chain)


def on_matrices(solve: Any) -> tuple[Any, Any]:
    """A method from the string rung's matrices on."""
    return _timed(lambda subject: subject.fresh("string"), solve)


def prepared(prepare: Prepare) -> tuple[Any, Any]:
    """The same of a method that tells apart what it may keep, done anew each time."""
    return on_matrices(lambda model, omega, drive, row: prepare(model, drive, row)(omega))


def kept(prepare: Prepare) -> tuple[Any, Any]:
    """The same with all that is kept prepared before."""
    return (lambda subject: subject.kept(prepare)(subject.omega)), (lambda subject: lambda: subject.kept(prepare)(BAND))


def _timed(model_of: Any, solve: Any) -> tuple[Any, Any]:
    def at(subject: Subject, omega: Array) -> Any:
        model = model_of(subject)
        return solve(model, omega, *subject.forms(model))

    return (lambda subject: at(subject, subject.omega)), (lambda subject: lambda: at(subject, BAND))
