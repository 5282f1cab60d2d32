"""Textbook methods in double precision: correct formulas that lose accuracy for some numbers."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from scipy import linalg

from suspension_cli import elimination
from suspension_cli.linear.signals import Signal, linear_form
from suspension_cli.linear.statespace import StateSpace
from suspension_cli.linear.structure import Structure
from suspension_cli.linear.system import LinearSystem


def unscaled(model: LinearSystem) -> Any:
    """Solve for omega^2 as eigenvalues of M^-1 K, ascending."""
    return np.sort(
        np.linalg.eigvals(np.linalg.solve(model.mass[6:, 6:], model.stiffness[6:, 6:])).real
    )


def symmetric(model: LinearSystem) -> Any:
    """Solve for omega^2 of the symmetric pair (K, M), ascending."""
    return linalg.eigh(model.stiffness[6:, 6:], model.mass[6:, 6:], eigvals_only=True)


def condense(model: LinearSystem) -> tuple[Any, Any, Any]:
    """Coordinates with mass (c,), their M (c, c) and K (c, 6 + c) with that towards the support."""
    massless = model.massless.copy()
    massless[:6] = False
    kept, eliminated = np.flatnonzero(~massless)[6:], np.flatnonzero(massless)
    columns = np.concatenate([np.arange(6), kept])
    full = model.complete
    stiffness = full[np.ix_(kept, columns)]
    if len(eliminated):
        stiffness = stiffness - full[np.ix_(kept, eliminated)] @ np.linalg.solve(
            full[np.ix_(eliminated, eliminated)], full[np.ix_(eliminated, columns)]
        )
    return kept, model.mass[np.ix_(kept, kept)], stiffness


def modal_sum(model: LinearSystem, frequency: Any, into: Signal, out: Signal) -> Any:
    """Compute a response (f,) to a support motion as a sum over all modes."""
    kept, mass, stiffness = condense(model)
    values, shapes = linalg.eigh((stiffness[:, 6:] + stiffness[:, 6:].T) / 2, mass)
    push = -stiffness[:, :6] @ linear_form(into, model)[:6]
    sensed = linear_form(out, model)[kept]
    residue = (sensed @ shapes) * (shapes.T @ push)
    return (residue / (values - (2 * np.pi * np.asarray(frequency)[:, None]) ** 2)).sum(1)


def dense(model: LinearSystem, frequency: Any, into: Signal, out: Signal) -> Any:
    """Compute a response (f,) by solving all coordinates at once at each frequency."""
    kept, mass, stiffness = condense(model)
    square = (2 * np.pi * np.asarray(frequency)) ** 2
    dynamic = stiffness[:, 6:] - square[:, None, None] * mass
    push = -stiffness[:, :6] @ linear_form(into, model)[:6]
    return (
        np.linalg.solve(dynamic, np.broadcast_to(push[:, None], (len(square), len(push), 1)))[
            ..., 0
        ]
        @ linear_form(out, model)[kept]
    )


def upward(model: LinearSystem, frequency: Any, into: Signal, out: Signal) -> Any:
    """Compute a response (f,) by elimination upward, each blade tip with the body below it."""
    square = (2 * np.pi * np.asarray(frequency)) ** 2
    push, sensed = -model.stiffness[:, :6] @ linear_form(into, model)[:6], linear_form(out, model)
    total = np.zeros(len(square))
    for block in Structure(model).blocks:
        owner = np.array([model.body.index(model.coordinate[n].split(".")[0]) for n in block])
        order = np.argsort(owner, kind="stable")
        own, rows = block[order], np.ix_(block[order], block[order])
        dynamic = model.stiffness[rows][..., None] - square * model.mass[rows][..., None]
        pattern = elimination.by_body(owner[order], np.asarray(dynamic.any(-1)))
        right = np.broadcast_to(push[own, None, None], (len(own), 1, len(square)))
        elements = dynamic[pattern.row, pattern.column]
        total += sensed[own] @ pattern.solve(elements, right)[:, 0]
    return total


def cascade(model: LinearSystem, frequency: Any, body_dof: str) -> Any:
    """Compute a response (f,) of a chain in one direction by transfer matrices from the top.

    The state (displacement, force) is propagated down for a unit displacement and a unit force at
    the top, and the two are combined so that the lower end is free.
    """
    chain = [model.index(body, body_dof) for body in model.body]
    mass = np.diag(model.mass)[chain]
    spring = -np.array(
        [
            model.stiffness[above, own]
            for above, own in zip(
                [model.index(model.body[0], body_dof) - 6, *chain], chain, strict=False
            )
        ]
    )
    result = []
    for square in (2 * np.pi * np.asarray(frequency)) ** 2:
        total = np.eye(2)
        for m, k in zip(mass, spring, strict=True):
            total = (
                np.array([[1.0, 0.0], [-m * square, 1.0]])
                @ np.array([[1.0, 1 / k], [0.0, 1.0]])
                @ total
            )
        result.append(total[0, 0] - total[0, 1] * total[1, 0] / total[1, 1])
    return np.array(result)


def textbook_beam(rigidity: float, tension: float, mass: float, length: float, omega: float) -> Any:
    """Dynamic stiffness (4, 4) on (w1, w1', w2, w2') of a beam under tension, by matrix inversion.

    From cosh, sinh, cos and sin at both ends: forces = N C^-1.
    """
    tau, m = tension / rigidity, mass * omega**2 / rigidity
    a = np.sqrt((tau + np.sqrt(tau**2 + 4 * m)) / 2)
    b = np.sqrt((-tau + np.sqrt(tau**2 + 4 * m)) / 2)
    with np.errstate(all="ignore"):
        ch, sh, c, s = (
            np.cosh(a * length),
            np.sinh(a * length),
            np.cos(b * length),
            np.sin(b * length),
        )
        ends = np.array(
            [[1, 0, 1, 0], [0, a, 0, b], [ch, sh, c, s], [a * sh, a * ch, -b * s, b * c]]
        )
        force = [[0, a**3 - tau * a, 0, -(b**3) - tau * b], [-(a**2), 0, b**2, 0]]
        force += [
            [
                -(a**3) * sh + tau * a * sh,
                -(a**3) * ch + tau * a * ch,
                -(b**3) * s - tau * b * s,
                b**3 * c + tau * b * c,
            ],
            [a**2 * ch, a**2 * sh, -(b**2) * c, -(b**2) * s],
        ]
        try:
            return rigidity * np.array(force) @ np.linalg.inv(ends)
        except np.linalg.LinAlgError:
            return np.full((4, 4), np.nan)


def howson_williams(
    rigidity: float, tension: float, mass: float, length: float, omega: float
) -> Any:
    """Dynamic stiffness (4, 4) of a beam under tension in closed form.

    From functions of the whole length (Howson and Williams, J. Sound Vib. 26, 503 (1973)).
    """
    tau, m = tension / rigidity, mass * omega**2 / rigidity
    a = np.sqrt((tau + np.sqrt(tau**2 + 4 * m)) / 2)
    b = np.sqrt((-tau + np.sqrt(tau**2 + 4 * m)) / 2)
    with np.errstate(all="ignore"):
        ch, sh, c, s = (
            np.cosh(a * length),
            np.sinh(a * length),
            np.cos(b * length),
            np.sin(b * length),
        )
        delta = 2 * a * b * (1 - ch * c) + (a**2 - b**2) * sh * s
        columns = a**2 + b**2
        ww = a * b * columns * (a * sh * c + b * ch * s) / delta
        w12 = -a * b * columns * (a * sh + b * s) / delta
        wt = a * b * ((a**2 - b**2) * (ch * c - 1) + 2 * a * b * sh * s) / delta
        wt12 = a * b * columns * (ch - c) / delta
        tt = columns * (a * ch * s - b * sh * c) / delta
        t12 = columns * (b * sh - a * s) / delta
        e = rigidity
        return e * np.array(
            [[ww, wt, w12, wt12], [wt, tt, -wt12, t12], [w12, -wt12, ww, -wt], [wt12, t12, -wt, tt]]
        )


def polynomials(system: StateSpace, frequency: Any) -> Any:
    """Compute a response (f,) by zeros, poles and gain of `scipy.signal.ss2zpk`.

    These are roots of two polynomials from their coefficients.
    """
    from scipy import signal

    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        zeros, poles, gain = signal.ss2zpk(system.a, system.b, system.c, system.d)
        s = 2j * np.pi * np.asarray(frequency)
        value = np.full(s.shape, complex(gain))
        for n in range(max(len(zeros), len(poles))):
            value = (
                value
                * ((s - zeros[n]) if n < len(zeros) else 1.0)
                / ((s - poles[n]) if n < len(poles) else 1.0)
            )
    return value


def unbalanced(system: StateSpace, frequency: Any) -> Any:
    """Compute a response (f,) by solving (s - A) x = B in SI units, unscaled."""
    s = 2j * np.pi * np.asarray(frequency)[:, None, None]
    x = np.linalg.solve(
        s * np.eye(len(system.a)) - system.a,
        np.broadcast_to(system.b.astype(complex), (len(s), *system.b.shape)),
    )
    return (system.c @ x + system.d)[:, 0, 0]
