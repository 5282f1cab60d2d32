"""Poles of strongly damped modes, including overdamped ones.

They start from the eigenvalues of the quadratic problem s^2 M + s C + K (Tisseur and Meerbergen,
SIAM Review 43, 235 (2001)). They are refined in the equation of the mode that moves most, with all
other modes eliminated (`modal_basis`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.linear.modal_basis import CONVERGED, STEPS, Basis, condense

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Inexact, Int

    Dynamic = Callable[[Complex[np.ndarray, " pole"], bool], Complex[np.ndarray, "pole row column"]]
    """Dynamic stiffness (m, A + t, A + t) at s (m,), rad/s, with or without loss angles."""

NOISE = 1e-9
"""Relative change below which an iteration that no longer improves has ended."""
STRAYED = 0.5
"""Relative distance from its start beyond which a pole counts as another one."""
RESISTED = 1e-12
"""Fraction of the largest damping of rigid modes below which a combination counts as undamped."""
AT_ONCE = 8
"""Poles that are refined together."""
REAL = 1e-13
"""Imaginary part over modulus of a pole of the real problem that is a rounding error."""


def solve_strong(
    basis: Basis, light: Complex[np.ndarray, " light"]
) -> tuple[Complex[np.ndarray, " pole"], Complex[np.ndarray, "pole coordinate"]]:
    """Solve for poles and shapes of all modes but the light ones, whose poles are given."""
    from scipy.optimize import linear_sum_assignment

    starts, motions = _solve_quadratic(basis, np.zeros(basis.viscous.shape))
    kept = ~_mark_rigid(basis, starts)
    oscillates = np.flatnonzero(kept & (np.imag(starts) > 0))
    kept[oscillates[linear_sum_assignment(np.abs(starts[oscillates] - light[:, None]))[1]]] = False
    starts, motions = starts[kept], motions[kept]
    saddles = int(((basis.inertia > 0) & (basis.stiffness < 0)).sum())
    kept = ~_mark_counterparts(starts, saddles)
    still = (basis.inertia > 0) & (basis.stiffness == 0)
    starts = np.concatenate([starts[kept], np.zeros(still.sum())])
    motions = np.concatenate([motions[kept], np.eye(len(still))[still]])
    oscillates = np.flatnonzero(starts.imag > 0)
    if len(oscillates):
        lossy, moving = _solve_quadratic(
            basis, basis.elastic.at(starts[oscillates].imag, basis.place).mean(0)
        )
        if len(light):
            other = np.ones(len(lossy), dtype=bool)
            other[linear_sum_assignment(np.abs(lossy - light[:, None]))[1]] = False
            lossy, moving = lossy[other], moving[other]
        rows, columns = linear_sum_assignment(np.abs(lossy - starts[oscillates][:, None]))
        starts[oscillates[rows]], motions[oscillates[rows]] = lossy[columns], moving[columns]
    refined = [
        _refine_in_basis(basis, start, motion)
        for start, motion in zip(starts, motions, strict=True)
    ]
    return np.array([value for value, _ in refined], dtype=complex), np.array(
        [motion for _, motion in refined]
    ).reshape(-1, len(basis.stiffness))


def _solve_quadratic(
    basis: Basis, loss: Inexact[np.ndarray, "coordinate coordinate"]
) -> tuple[Inexact[np.ndarray, " pole"], Complex[np.ndarray, "pole coordinate"]]:
    """Poles and shapes of the quadratic eigenvalue problem with a constant loss L.

    Those with Im s >= 0; with a loss, Im s > 0.
    """
    from scipy.linalg import block_diag, eig

    massive = np.flatnonzero(basis.inertia > 0)
    n, m = len(basis.stiffness), len(massive)
    if n == m and not basis.viscous.any():
        return _solve_undamped(basis, loss)
    rate = float(np.sqrt(np.abs(basis.stiffness[massive]).max()) or 1.0)
    select = np.eye(n)[massive]
    left = block_diag(-np.diag(basis.stiffness) - loss, np.eye(m) * rate**2)
    right = np.block(
        [[basis.viscous * rate, select.T * rate**2], [select * rate**2, np.zeros((m, m))]]
    )
    found: Any = eig(left, right, homogeneous_eigvals=True)
    (top, bottom), vectors = found
    finite = np.abs(bottom) > 1e-12 * np.abs(top)
    values = rate * top[finite] / bottom[finite]
    motions = vectors[:n, finite].T
    # real poles of the real problem are exactly real, except close pairs
    values = np.where(np.abs(values.imag) <= REAL * np.abs(values), values.real, values)
    kept = values.imag > 0 if loss.any() else values.imag >= 0
    return values[kept], motions[kept].astype(complex)


def _solve_undamped(
    basis: Basis, loss: Inexact[np.ndarray, "coordinate coordinate"]
) -> tuple[Inexact[np.ndarray, " pole"], Complex[np.ndarray, "pole coordinate"]]:
    """`_solve_quadratic` without dampers: s^2 is minus an eigenvalue of K + L."""
    squares, vectors = basis.stiffness, np.eye(len(basis.stiffness))
    if loss.any():
        squares, vectors = np.linalg.eig(np.diag(squares) + loss)
    root = np.sqrt(-squares.astype(complex))
    values, motions = np.concatenate([root, -root]), np.concatenate([vectors.T, vectors.T])
    kept = np.imag(values) > 0 if loss.any() else np.imag(values) >= 0
    return values[kept], motions[kept].astype(complex)


def _mark_rigid(basis: Basis, values: Inexact[np.ndarray, " pole"]) -> Bool[np.ndarray, " pole"]:
    """Mark the poles that are 0 but for rounding.

    Two per rigid mode, less one per combination of rigid modes that a damper acts on.
    """
    rigid = np.flatnonzero((basis.inertia > 0) & (basis.stiffness == 0))
    out = np.zeros(len(values), dtype=bool)
    if len(rigid):
        damping = basis.viscous[np.ix_(rigid, rigid)]
        left = 2 * len(rigid) - int(
            np.linalg.matrix_rank(damping, tol=RESISTED * np.abs(damping).max(), hermitian=True)
        )
        for n in np.argsort(np.abs(values), kind="stable"):
            if left <= 0:
                break
            out[n] = True
            left -= 1 + int(np.imag(values[n]) > 0)
    return out


def _mark_counterparts(
    values: Inexact[np.ndarray, " pole"], most: int
) -> Bool[np.ndarray, " pole"]:
    """Mark at most so many real poles that are decaying counterparts of growing ones.

    Poles that grow because of negative damping have none.
    """
    out = np.zeros(len(values), dtype=bool)
    real = np.imag(values) == 0
    for growing in np.flatnonzero(real & (np.real(values) > 0))[:most]:
        decaying = np.flatnonzero(real & (np.real(values) < 0) & ~out)
        if len(decaying):
            out[decaying[np.abs(values[decaying] + values[growing]).argmin()]] = True
    return out


def _refine_in_basis(
    basis: Basis, start: complex, motion: Complex[np.ndarray, " coordinate"]
) -> tuple[complex, Complex[np.ndarray, " coordinate"]]:
    """Refine a pole and its shape by the secant method in the equation of the leading mode."""
    lead = np.array([int(np.where(basis.inertia > 0, np.abs(motion), -1.0).argmax())])
    if not np.abs(motion[lead[0]]) > 0 or start == 0:
        return start, motion

    def equation(s: complex) -> tuple[complex, Complex[np.ndarray, " coordinate"]]:
        matrix, follow, others = condense(basis, lead, s, basis.losses(np.array([s]))[0])
        moving = np.zeros(len(motion), dtype=complex)
        moving[lead], moving[others] = 1.0, follow[:, 0]
        value = basis.stiffness[lead[0]] + s**2 + matrix[0, 0]
        return (value.real if s.imag == 0 else value), moving

    before, now = start * (1 + 1e-6), start
    residual = equation(before)[0]
    for _ in range(STEPS):
        value, _ = equation(now)
        if value in (0, residual):
            break
        step = -value * (now - before) / (value - residual)
        before, residual, now = now, value, now + step
        if abs(now - start) > STRAYED * abs(start) or (now.imag > 0) != (start.imag > 0):
            return start, motion
        if abs(step) <= CONVERGED * abs(now):
            break
    return now, equation(now)[1]


def refine_poles(
    dynamic: Dynamic,
    start: Complex[np.ndarray, " pole"],
    motion: Complex[np.ndarray, "pole coordinate"] | None,
) -> Complex[np.ndarray, " pole"]:
    """Refine poles of any system by the secant method in 1 / (b^T Z(s)^-1 b), which is 0 at poles.

    Parameters
    ----------
    dynamic
        Z (m, A + t, A + t) at s (m,), with or without loss angles; the support's six coordinates
        first, tensions that serve as coordinates last.
    start
        rad/s; all or none real, for motions that do not oscillate. Returned where the iteration
        leaves its neighbourhood.
    motion
        Approximate shapes, used for b; None excites all coordinates alike.
    """
    result = start.copy()
    for first in range(0, len(start), AT_ONCE):
        some = slice(first, first + AT_ONCE)
        result[some] = _refine_some(dynamic, start[some], None if motion is None else motion[some])
    return result


def _refine_some(
    dynamic: Dynamic,
    start: Complex[np.ndarray, " pole"],
    motion: Complex[np.ndarray, "pole coordinate"] | None,
) -> Complex[np.ndarray, " pole"]:
    oscillates = bool((np.imag(start) > 0).all())
    aside = dynamic(start * 1.03, oscillates)[:, 6:, 6:]
    size = np.abs(np.diagonal(aside, axis1=1, axis2=2))
    scale = 1 / np.sqrt(np.where(size > 0, size, 1.0))
    push = np.ones_like(scale, dtype=complex)
    if motion is not None:
        push = np.pad(motion[:, 6:], ((0, 0), (0, scale.shape[1] - motion.shape[1] + 6))) / scale

    def inverse(
        s: Complex[np.ndarray, " moving"], which: Int[np.ndarray, " moving"]
    ) -> Inexact[np.ndarray, " moving"]:
        matrix = dynamic(s, oscillates)[:, 6:, 6:] * scale[which, :, None] * scale[which, None, :]
        answer = np.linalg.solve(matrix, push[which, :, None])[..., 0]
        value = 1 / (push[which] * answer).sum(1)
        return value if oscillates else np.real(value) + 0j

    now, moving, last = start.copy(), np.arange(len(start)), np.full(len(start), np.inf)
    before = start * (1 + 1e-6)
    residual = inverse(before, moving)
    for _ in range(STEPS):
        value = inverse(now[moving], moving)
        still = (value != 0) & (value != residual[moving])
        moving, value = moving[still], value[still]
        step = -value * (now - before)[moving] / (value - residual[moving])
        before[moving], residual[moving] = now[moving], value
        now[moving] += step
        strayed = np.abs(now - start) > STRAYED * np.abs(start)
        strayed |= (np.imag(now) > 0) != oscillates
        now[strayed] = start[strayed]
        size, done = np.abs(step), CONVERGED * np.abs(now[moving])
        noise = (size < NOISE * np.abs(now[moving])) & (2 * size >= last[moving])
        last[moving] = size
        moving = moving[~(strayed[moving] | (size <= done) | noise)]
        if not len(moving):
            break
    return now
