"""Methods as people write them: correct, in double precision, and each with the numbers in which it fails."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from scipy import linalg

from suspension_cli.analysis.signals import Signal, row
from suspension_cli.analysis.statespace import StateSpace
from suspension_cli.mechanics import elimination
from suspension_cli.mechanics.model import LinearModel


def unscaled(model: LinearModel) -> Any:
    """omega^2 as eigenvalues of M^-1 K, ascending."""
    return np.sort(np.linalg.eigvals(np.linalg.solve(model.mass[6:, 6:], model.stiffness[6:, 6:])).real)


def symmetric(model: LinearModel) -> Any:
    """omega^2 of the symmetric pair (K, M), ascending."""
    return linalg.eigh(model.stiffness[6:, 6:], model.mass[6:, 6:], eigvals_only=True)


def condensed(model: LinearModel) -> tuple[Any, Any, Any]:
    """M, K and K towards the support of the coordinates with mass."""
    light = model.massless.copy()
    light[:6] = False
    keep, drop = np.flatnonzero(~light)[6:], np.flatnonzero(light)
    both = np.concatenate([np.arange(6), keep])
    full = model.stiffness if model.lossy is None else model.lossy
    stiffness = full[np.ix_(keep, both)]
    if len(drop):
        stiffness = stiffness - full[np.ix_(keep, drop)] @ np.linalg.solve(full[np.ix_(drop, drop)], full[np.ix_(drop, both)])
    return keep, model.mass[np.ix_(keep, keep)], stiffness


def modal_sum(model: LinearModel, frequency: Any, into: Signal, out: Signal) -> Any:
    """A response (f,) to a motion of the support as a sum over the modes of the whole system."""
    keep, mass, stiffness = condensed(model)
    values, shapes = linalg.eigh((stiffness[:, 6:] + stiffness[:, 6:].T) / 2, mass)
    push = -stiffness[:, :6] @ row(into, model)[:6]
    seen = row(out, model)[keep]
    residue = (seen @ shapes) * (shapes.T @ push)
    return (residue / (values - (2 * np.pi * np.asarray(frequency)[:, None]) ** 2)).sum(1)


def dense(model: LinearModel, frequency: Any, into: Signal, out: Signal) -> Any:
    """The same by solving all coordinates at once at every frequency."""
    keep, mass, stiffness = condensed(model)
    square = (2 * np.pi * np.asarray(frequency)) ** 2
    dynamic = stiffness[:, 6:] - square[:, None, None] * mass
    push = -stiffness[:, :6] @ row(into, model)[:6]
    return np.linalg.solve(dynamic, np.broadcast_to(push[:, None], (len(square), len(push), 1)))[..., 0] @ row(out, model)[keep]


def upward(model: LinearModel, frequency: Any, into: Signal, out: Signal) -> Any:
    """The same from the last body up, tips of blades with the body that hangs on them, in closed form where these are two coordinates."""
    square = (2 * np.pi * np.asarray(frequency)) ** 2
    push, seen = -model.stiffness[:, :6] @ row(into, model)[:6], row(out, model)
    total = np.zeros(len(square))
    for block in model.blocks:
        owner = [model.coordinate[n].split(".")[0] for n in block]
        order = np.argsort([model.body.index(name) for name in owner], kind="stable")
        own, rows = block[order], np.ix_(block[order], block[order])
        dynamic = model.stiffness[rows][..., None] - square * model.mass[rows][..., None]
        tree = elimination.tree([owner[n] for n in order], dynamic.any(-1))
        right = np.broadcast_to(push[own, None, None], (len(own), 1, len(square)))
        total += seen[own] @ elimination.solve(dynamic, right, tree)[:, 0]
    return total


def cascade(model: LinearModel, frequency: Any, body_dof: str) -> Any:
    """The same for a chain whose bodies move in one direction only, by transfer matrices (displacement, force) from the top to the bottom.

    The state is carried down from the top for a free and for a unit force there, and the two are combined so that the lower end is free.
    """
    chain = [model.index(body, body_dof) for body in model.body]
    mass = np.diag(model.mass)[chain]
    spring = -np.array([model.stiffness[above, own] for above, own in zip([model.index(model.body[0], body_dof) - 6, *chain], chain, strict=False)])
    result = []
    for square in (2 * np.pi * np.asarray(frequency)) ** 2:
        total = np.eye(2)
        for m, k in zip(mass, spring, strict=True):
            total = np.array([[1.0, 0.0], [-m * square, 1.0]]) @ np.array([[1.0, 1 / k], [0.0, 1.0]]) @ total
        result.append(total[0, 0] - total[0, 1] * total[1, 0] / total[1, 1])
    return np.array(result)


def textbook_beam(rigidity: float, tension: float, mass: float, length: float, omega: float) -> Any:
    """Dynamic stiffness (4, 4) on (w1, w1', w2, w2') of a beam under tension from cosh, sinh, cos, sin at both ends: forces = N C^-1."""
    tau, m = tension / rigidity, mass * omega**2 / rigidity
    a = np.sqrt((tau + np.sqrt(tau**2 + 4 * m)) / 2)
    b = np.sqrt((-tau + np.sqrt(tau**2 + 4 * m)) / 2)
    with np.errstate(all="ignore"):
        ch, sh, c, s = np.cosh(a * length), np.sinh(a * length), np.cos(b * length), np.sin(b * length)
        ends = np.array([[1, 0, 1, 0], [0, a, 0, b], [ch, sh, c, s], [a * sh, a * ch, -b * s, b * c]])
        force = [[0, a**3 - tau * a, 0, -(b**3) - tau * b], [-(a**2), 0, b**2, 0]]
        force += [
            [-(a**3) * sh + tau * a * sh, -(a**3) * ch + tau * a * ch, -(b**3) * s - tau * b * s, b**3 * c + tau * b * c],
            [a**2 * ch, a**2 * sh, -(b**2) * c, -(b**2) * s],
        ]
        try:
            return rigidity * np.array(force) @ np.linalg.inv(ends)
        except np.linalg.LinAlgError:
            return np.full((4, 4), np.nan)


def howson_williams(rigidity: float, tension: float, mass: float, length: float, omega: float) -> Any:
    """The six elements of the same in closed form (Howson and Williams, J. Sound Vib. 26, 503 (1973)), from functions of the whole length."""
    tau, m = tension / rigidity, mass * omega**2 / rigidity
    a = np.sqrt((tau + np.sqrt(tau**2 + 4 * m)) / 2)
    b = np.sqrt((-tau + np.sqrt(tau**2 + 4 * m)) / 2)
    with np.errstate(all="ignore"):
        ch, sh, c, s = np.cosh(a * length), np.sinh(a * length), np.cos(b * length), np.sin(b * length)
        delta = 2 * a * b * (1 - ch * c) + (a**2 - b**2) * sh * s
        both = a**2 + b**2
        ww = a * b * both * (a * sh * c + b * ch * s) / delta
        w12 = -a * b * both * (a * sh + b * s) / delta
        wt = a * b * ((a**2 - b**2) * (ch * c - 1) + 2 * a * b * sh * s) / delta
        wt12 = a * b * both * (ch - c) / delta
        tt = both * (a * ch * s - b * sh * c) / delta
        t12 = both * (b * sh - a * s) / delta
        e = rigidity
        return e * np.array([[ww, wt, w12, wt12], [wt, tt, -wt12, t12], [w12, -wt12, ww, -wt], [wt12, t12, -wt, tt]])


def polynomials(system: StateSpace, frequency: Any) -> Any:
    """A response (f,) by zeros, poles and gain as `scipy.signal.ss2zpk` finds them: roots of the coefficients of two polynomials."""
    from scipy import signal

    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        zeros, poles, gain = signal.ss2zpk(system.a, system.b, system.c, system.d)
        s = 2j * np.pi * np.asarray(frequency)
        value = np.full(s.shape, complex(gain))
        for n in range(max(len(zeros), len(poles))):
            value = value * ((s - zeros[n]) if n < len(zeros) else 1.0) / ((s - poles[n]) if n < len(poles) else 1.0)
    return value


def unbalanced(system: StateSpace, frequency: Any) -> Any:
    """A response (f,) by solving (s - A) x = B in SI units as they come."""
    s = 2j * np.pi * np.asarray(frequency)[:, None, None]
    x = np.linalg.solve(s * np.eye(len(system.a)) - system.a, np.broadcast_to(system.b.astype(complex), (len(s), *system.b.shape)))
    return (system.c @ x + system.d)[:, 0, 0]
