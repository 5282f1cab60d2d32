"""Modes with dampers and losses of any size: poles s = sigma + i omega of a suspension.

Each is a root of the pencil, Z(s) x = 0, that Newton's method finds (`roots`) from a root of its
linear part: of K + s C + s^2 M in the basis of the undamped modes or, without dampers, from an
undamped mode. Loss angles, phase lags of an oscillation, act at its frequency omega alone.

A pole that oscillates has the frequency |s| / 2 pi and Q = Im s / (-2 Re s), which is pi times the
number of oscillations in which the amplitude of a ring-down falls to 1/e. For m x'' + k (1 + i phi)
x = 0, Q = 1 / (2 tan(atan(phi) / 2)), 10.025 for phi = 0.1.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.linear import eigenmodes, quality
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.frequency_terms import LossTerm, quadratic_form
from suspension_cli.linear.pencil import Loss, Pencil
from suspension_cli.linear.roots import Roots, find_roots
from suspension_cli.linear.statespace import ROUNDING
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

UNDAMPED = 1e-12
"""Fraction of the largest damping below which a motion counts as undamped."""


def solve(model: LinearSystem) -> Modes:
    """Solve for modes with dampers and losses of any size, for a system without batch axes.

    Of an unstable mode only the growing pole counts, not the decaying one at about the opposite
    value. With wire mass these are the modes of bodies alone, each followed from the one without:
    from a start far away a mode of wires may be found instead, or one mode twice.
    """
    pencil, still, first = Pencil.of(model), eigenmodes.spectrum(model), eigenmodes.solve(model)
    blocks, damping = [pencil.block(group) for group in model.blocks], damping_matrix(model)
    squared, shapes, plain = still.omega_squared, still.motion, np.ones(len(first.q), dtype=bool)
    loss = np.where(squared > 0, 1 / np.maximum(first.q, 1.0), 0.0)
    starts: list[tuple[np.ndarray, np.ndarray]] = []
    for number, block in enumerate(blocks):
        own = np.flatnonzero(still.block == number)
        if damping[np.ix_(block.keep, block.keep)].any():
            modes = squared[own], shapes[own], loss[own]
            start = _linear_roots(model, block.keep, damping, *modes)
            # a rigid mode has one pole, 0, beside those that dampers give it
            plain[own] = squared[own] == 0
        elif block.terms or block.loss.any():
            own = own[squared[own] > 0]
            start = 1j * np.sqrt(squared[own] * (1 + 1j * loss[own])), shapes[own]
            plain[own] = False
        else:
            start = np.zeros(0, dtype=complex), shapes[:0]
        starts.append(start)
    if plain.all() and not any(len(start[0]) for start in starts):
        return first
    member = np.repeat(np.arange(len(blocks)), [len(start[0]) for start in starts])
    value, motion = (np.concatenate(parts) + 0j for parts in zip(*starts, strict=True))
    start = Roots.starts(blocks, value, member, motion)
    for oscillates in (True, False):
        some = (np.imag(value) > 0) == oscillates
        acting: Loss = "all" if oscillates else "dampers"
        found = find_roots(pencil, blocks, start.select(some), loss=acting)
        value[some], motion[some] = found.value, found.motions(blocks, model.size)
    motion /= np.sqrt(quadratic_form(model.mass, motion.T))[:, None]
    value = np.concatenate([np.sqrt(-squared[plain] + 0j), value])
    motion, member = np.concatenate([shapes[plain], motion]), np.append(still.block[plain], member)
    found = quality.evaluate(model, value, motion)
    rate = np.real(found.value)
    steady = (np.imag(value) > 0) & (rate > 0) & (rate <= ROUNDING * np.imag(value))
    found = replace(found, value=np.where(steady, 1j * np.imag(value), found.value))
    return eigenmodes.build(model, value, motion, member, found).ascending()


def damping_matrix(model: LinearSystem) -> Float[np.ndarray, "coordinate coordinate"]:
    """Damping matrix C of dampers and of gas around bodies, N s/m."""
    return model.damping + sum(
        (term.matrix for term in model.terms if isinstance(term, LossTerm) and not term.elastic),
        np.zeros(model.damping.shape),
    )


def _linear_roots(
    model: LinearSystem,
    keep: Int[np.ndarray, " own"],
    damping: Float[np.ndarray, "coordinate coordinate"],
    squared: Float[np.ndarray, " mode"],
    shapes: Float[np.ndarray, "mode coordinate"],
    loss: Float[np.ndarray, " mode"],
) -> tuple[Complex[np.ndarray, " pole"], Complex[np.ndarray, "pole coordinate"]]:
    """Poles and shapes of K + s C + s^2 M for the coordinates `keep` of one block.

    In the basis of the modes q, of unit modal mass and q' = v, and of massless directions e that
    dampers act on, of unit stiffness (Tisseur and Meerbergen, SIAM Review 43, 235 (2001)):

        (w q)' = w v,    v' = -+ w (w q) - C_vv v - C_ve e',    0 = k e + C_ev v + C_ee e',

    with w^2 = |omega^2|, so that rigid modes have one state, v. Loss angles are damping that gives
    each mode its `loss`, 1/Q to first order.
    """
    massless, m = keep[model.massless[keep]], len(squared)
    light, directions = np.linalg.eigh(model.stiffness[np.ix_(massless, massless)])
    directions = (directions / np.sqrt(np.abs(light))).T
    rates, turn = np.linalg.eigh(directions @ damping[np.ix_(massless, massless)] @ directions.T)
    turn = turn[:, np.abs(rates) > UNDAMPED * np.abs(rates).max(initial=0.0)]
    basis = np.concatenate([shapes, np.zeros((turn.shape[1], model.size))])
    basis[m:, massless] = turn.T @ directions
    stiffness = turn.T @ (np.sign(light)[:, None] * turn)
    c, w = basis @ damping @ basis.T, np.sqrt(np.abs(squared))
    own = np.arange(m)
    c[own, own] += np.where(loss > 0, np.maximum(w * loss - c[own, own], 0.0), 0.0)
    moving = np.flatnonzero(w)
    rows, e = w[moving, None] * np.eye(m)[moving], len(stiffness)
    follow = -np.linalg.solve(c[m:, m:], np.concatenate([c[m:, :m], stiffness], axis=1))  # of e'
    states = np.block(
        [
            [np.zeros((len(moving),) * 2), rows, np.zeros((len(moving), e))],
            [
                -rows.T * np.sign(squared[moving]),
                -c[:m, :m] - c[:m, m:] @ follow[:, :m],
                -c[:m, m:] @ follow[:, m:],
            ],
            [np.zeros((e, len(moving))), follow],
        ]
    )
    found: Any = np.linalg.eig(states)
    value, vectors = found.eigenvalues + 0j, found.eigenvectors
    kept = np.imag(value) >= 0
    rigid = c[:m, :m][np.ix_(squared == 0, squared == 0)]
    if len(rigid):  # combinations of rigid modes without damping: 0 but for rounding
        rank = np.linalg.matrix_rank(rigid, tol=UNDAMPED * np.abs(c).max(), hermitian=True)
        kept[np.argsort(np.abs(value), kind="stable")[: len(rigid) - int(rank)]] = False
    kept[kept] = ~_mark_counterparts(value[kept], int((squared < 0).sum()))
    value, motion = value[kept], vectors[len(moving) :, kept] + 0j
    motion[:m] /= value  # v = s q
    return value, motion.T @ basis


def _mark_counterparts(value: Complex[np.ndarray, " pole"], most: int) -> Bool[np.ndarray, " pole"]:
    """Mark at most so many real poles that are decaying counterparts of growing ones.

    Poles that grow because of negative damping have none.
    """
    out = np.zeros(len(value), dtype=bool)
    real = np.imag(value) == 0
    for growing in np.flatnonzero(real & (np.real(value) > 0))[:most]:
        decaying = np.flatnonzero(real & (np.real(value) < 0) & ~out)
        if len(decaying):
            out[decaying[np.abs(value[decaying] + value[growing]).argmin()]] = True
    return out
