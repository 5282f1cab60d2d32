"""Modes with dampers and losses of any size, as poles of a suspension.

A pole s = sigma + i omega has a shape x with Z(s) x = 0,

    Z(s) = K + s C + s^2 M + L(omega),

K, C, M symmetric and L the stiffness that loss angles add (i phi K, ...) at the frequency omega =
Im s of the mode. A loss angle is the phase lag of an oscillation, so L(0) = 0.

In the basis of the undamped modes (omega_j, x_j, of unit modal mass) and of the massless directions
e_j of unit stiffness,

    (k_j + s^2 m_j) y_j + sum over k of G_jk(s) y_k = 0,      G = X^T (s C + L) X,    k_j =
    omega_j^2 or 1,    m_j = 1 or 0,

which is exact, as the basis is complete. The stiffness is diagonal in it, so that of a stiff wire
adds no rounding error to the loss of a soft mode. With S the modes that losses couple strongly (one
alone, or several close together) and the others R eliminated,

    -s^2 = an eigenvalue of  k_S + G_SS - G_SR (k_R + s^2 m_R + G_RR)^-1 G_RS,

and a Q of 1e12 keeps all its digits. Where damping is strong the poles start from the eigenvalues
of the quadratic problem (Tisseur and Meerbergen, SIAM Review 43, 235 (2001)) and are refined in the
same equation, with S the mode that moves most.

A pole that oscillates has the frequency |s| / 2 pi and Q = Im s / (-2 Re s), which is pi times the
number of oscillations in which the amplitude of a ring-down falls to 1/e. For m x'' + k (1 + i phi)
x = 0, Q = 1 / (2 tan(atan(phi) / 2)), 10.025 for phi = 0.1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.linear import eigenmodes as undamped
from suspension_cli.linear import quality
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.frequency_terms import LossTerm
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.arrays import Array, Index

LIGHT = 0.02
"""Fraction of omega^2 up to which losses change the equation of a light mode, whose pole is
followed from the undamped one."""
WIDE = 0.3
"""Largest relative difference of omega^2 of modes that are followed together."""
COUPLED = 0.05
"""Coupling of two modes by losses, over the difference of their equations, above which they are
solved together."""
ROUNDING = 1e-10
"""Coupling of two modes by losses, over their own losses, that is a rounding error: it would mix
modes of one frequency."""
TOGETHER = 1e-6
"""Difference of the equations of two modes, over their losses, below which they are solved
together."""
NEGLIGIBLE = 1e-18
"""Relative contribution of another mode to the losses of a mode that is left out."""
MEMORY = 2_000_000
"""Elements of G evaluated at once."""
STEPS = 30
"""Most steps of any iteration."""
CONVERGED = 4 * np.finfo(float).eps
"""Relative change at which an iteration ends."""
NOISE = 1e-9
"""Relative change below which an iteration that no longer improves has ended."""
STRAYED = 0.5
"""Relative distance from its start beyond which a pole counts as another one."""
ALIKE = 1e-12
"""Relative difference of omega^2 that may be a rounding error."""
UNDAMPED = 1e-24
"""Fraction of the largest damping below which a rigid mode counts as undamped."""
RESISTED = 1e-12
"""Fraction of the largest damping of rigid modes below which a combination counts as undamped."""
REAL = 1e-13
"""Imaginary part over modulus of a pole of the real problem that is a rounding error."""


@dataclass(frozen=True)
class Basis:
    """Equations of motion in the basis of undamped modes and massless directions.

    Attributes
    ----------
    stiffness, inertia : (n,) arrays
        k_j and m_j: omega_j^2 and 1 of a mode, 1 (or -1) and 0 of a massless direction.
    viscous : (n, n) array
        X^T C X, 1/s.
    place : (n,) int array
        Numbers of these coordinates among those of `elastic`.
    elastic : callable
        X^T L(omega) X (m, n, n), complex, as a function of omega (m,) above 0, rad/s, and of places
        (n,).
    """

    stiffness: Array
    inertia: Array
    viscous: Array
    place: Index
    elastic: Callable[[Array, Index], Any]

    def losses(self, s: Any) -> Any:
        """G (m, n, n) at s (m,), rad/s; without loss angles where s is real."""
        s = np.asarray(s, dtype=complex)
        result = s[:, None, None] * self.viscous
        oscillates = s.imag > 0
        if oscillates.any():
            result[oscillates] = result[oscillates] + self.elastic(s.imag[oscillates], self.place)
        size = np.sqrt(np.abs(np.diagonal(result, axis1=1, axis2=2)))
        return np.where(
            np.abs(result) > ROUNDING * size[:, :, None] * size[:, None, :], result, 0.0
        )

    def within(self, some: Index) -> Basis:
        """Restrict to coordinates that losses do not couple to the others."""
        return Basis(
            self.stiffness[some],
            self.inertia[some],
            self.viscous[np.ix_(some, some)],
            self.place[some],
            self.elastic,
        )


@dataclass(frozen=True)
class Poles:
    """Poles, one of each conjugate pair, and their shapes.

    Attributes
    ----------
    value : (p,) complex array
        rad/s; imaginary part not negative.
    motion : (p, n) complex array
        In the coordinates of the basis.
    """

    value: Any
    motion: Any


def find_poles(basis: Basis) -> Poles:
    """Find all poles of a system in the basis of its undamped modes.

    A rigid mode has one pole, 0; an unstable mode its growing one, not the decaying one at about
    the opposite value.
    """
    n = len(basis.stiffness)
    values, motions = [np.zeros(0, dtype=complex)], [np.zeros((0, n), dtype=complex)]
    for own in _split_coupled(basis):
        found = _find_coupled_poles(basis.within(own))
        motion = np.zeros((len(found.value), n), dtype=complex)
        motion[:, own] = found.motion
        values.append(found.value)
        motions.append(motion)
    return Poles(np.concatenate(values), np.concatenate(motions))


def _find_coupled_poles(basis: Basis) -> Poles:
    """Find the poles of modes that losses couple."""
    groups, light = _group_modes(basis)
    values, motions = _follow_poles(basis, [group for group in groups if light[group].all()])
    if light[basis.inertia > 0].all() and not basis.viscous[basis.inertia == 0].any():
        return Poles(values, motions)
    strong, moving = _solve_strong(basis, values)
    return Poles(np.concatenate([values, strong]), np.concatenate([motions, moving]))


def _split_coupled(basis: Basis) -> list[Index]:
    """Split coordinates into groups that losses do not couple."""
    omega = np.sqrt(np.abs(basis.stiffness[basis.inertia > 0]))
    probes = (
        1j * np.unique(np.quantile(omega[omega > 0], [0.0, 0.5, 1.0]))
        if (omega > 0).any()
        else np.array([1j])
    )
    return _connected_groups((basis.losses(probes) != 0).any(0))


def _connected_groups(linked: Any) -> list[Index]:
    """Connected groups of a graph, from its adjacency matrix (n, n)."""
    reached = linked | linked.T | np.eye(len(linked), dtype=bool)
    while (further := reached.astype(float) @ reached > 0).sum() > reached.sum():
        reached = further
    first = reached.argmax(1)
    return [np.flatnonzero(first == number) for number in np.unique(first)]


def _chunks(basis: Basis, count: int) -> list[slice]:
    """Split `count` poles into parts whose G fits into memory."""
    most = max(1, MEMORY // len(basis.stiffness) ** 2)
    return [slice(start, start + most) for start in range(0, count, most)]


def _group_modes(basis: Basis) -> tuple[list[Index], Any]:
    """Group modes that losses couple strongly; which modes are light, bool (n,)."""
    massive = np.flatnonzero(basis.inertia > 0)
    n = len(basis.stiffness)
    start = np.where(basis.inertia > 0, 1j * np.sqrt(np.maximum(basis.stiffness, 0.0)), 0.0)
    # G_jk and G_kk at mode j
    rows, own = np.zeros((n, n), dtype=complex), np.zeros((n, n), dtype=complex)
    for part in _chunks(basis, n):
        losses = basis.losses(start[part])
        rows[part] = losses[np.arange(len(losses)), np.arange(n)[part]]
        own[part] = np.diagonal(losses, axis1=1, axis2=2)
    here = basis.stiffness + own - np.outer(basis.stiffness, basis.inertia)  # equation k at mode j
    coupling, size, apart = (
        np.abs(rows),
        np.abs(np.diag(rows)),
        np.abs(here - np.diag(here)[:, None]),
    )
    linked = (coupling > COUPLED * apart) | (apart < TOGETHER * np.add.outer(size, size))
    linked[:, basis.inertia == 0] = linked[basis.inertia == 0] = False
    groups = [group for group in _connected_groups(linked) if np.isin(group, massive).all()]
    light = np.zeros(n, dtype=bool)
    for group in groups:
        others = np.setdiff1d(np.arange(n), group)
        for j in group:
            residual = coupling[j, others] ** 2 / np.maximum(
                np.abs(here[j, others]), np.finfo(float).tiny
            )
            spread = np.abs(basis.stiffness[group] - basis.stiffness[j]).max()
            light[j] = (
                coupling[j, group].sum() + residual.sum() < LIGHT * basis.stiffness[j]
                and spread < WIDE * basis.stiffness[j]
            )
    return groups, light


def _condense(
    basis: Basis, group: Index, s: complex, losses: Any, least: float = 0.0
) -> tuple[Any, Any, Index]:
    """Eliminate all modes but a group: G_SS - G_SR (k_R + s^2 m_R + G_RR)^-1 G_RS.

    Parameters
    ----------
    group : (g,) int array
    s : complex
    losses : (n, n) array
        G at s.
    least : float
        Modes whose relative contribution is below it are left out.

    Returns
    -------
    matrix : (g, g) array
    follow : (r, g) array
        Motion of the eliminated modes with the group.
    others : (r,) int array
        The eliminated modes.
    """
    own, column = losses[np.ix_(group, group)], losses[:, group]
    diagonal = basis.stiffness + s**2 * basis.inertia + np.diagonal(losses)
    part = (np.abs(column) ** 2).max(1) > least * np.abs(diagonal) * np.abs(own).max()
    part[group] = False
    others = np.flatnonzero(part)
    rest = losses[np.ix_(others, others)].copy()
    np.fill_diagonal(rest, diagonal[others])
    follow = -np.linalg.solve(rest, column[others])
    return own + losses[np.ix_(group, others)] @ follow, follow, others


def _follow_poles(basis: Basis, groups: list[Index]) -> tuple[Any, Any]:
    """Follow the poles and shapes of groups of light modes from the undamped ones.

    Pole by pole, with losses evaluated for all of them together.
    """
    group = [own for own in groups for _ in own]
    member = np.array([k for own in groups for k in range(len(own))], dtype=np.intp)
    middle = np.array([basis.stiffness[own].mean() for own in group])
    shift, change = np.zeros(len(group), dtype=complex), np.full(len(group), np.inf)
    motions = np.zeros((len(group), len(basis.stiffness)), dtype=complex)
    running = np.arange(len(group))
    for step in range(STEPS):
        going = []
        for part in _chunks(basis, len(running)):
            s = 1j * np.sqrt(middle[running[part]] + shift[running[part]])
            for n, at, losses in zip(running[part], s, basis.losses(s), strict=True):
                own = group[n]
                matrix, follow, others = _condense(basis, own, at, losses, NEGLIGIBLE)
                small = np.abs(matrix) < ROUNDING * np.abs(matrix).max()
                every, vectors = np.linalg.eig(
                    np.diag(basis.stiffness[own] - middle[n]) + np.where(small, 0.0, matrix)
                )
                # with equal eigenvalues, each mode continues from its own shape
                which = (
                    member[n]
                    if step == 0
                    else int(np.abs(motions[n, own].conj() @ vectors).argmax())
                )
                moved, last = abs(every[which] - shift[n]), change[n]
                shift[n], change[n] = every[which], moved
                motions[n] = 0.0
                motions[n, own], motions[n, others] = vectors[:, which], follow @ vectors[:, which]
                if step == 0 or CONVERGED * abs(shift[n]) < moved < last:
                    going.append(n)
        running = np.array(going, dtype=np.intp)
        if not len(running):
            break
    return 1j * np.sqrt(middle + shift), motions


def _solve_strong(basis: Basis, light: Any) -> tuple[Any, Any]:
    """Solve for poles and shapes of all modes but the light ones, whose poles are given."""
    from scipy.optimize import linear_sum_assignment

    starts, motions = _solve_quadratic(basis, np.zeros(basis.viscous.shape))
    kept = ~_mark_rigid(basis, starts)
    oscillates = np.flatnonzero(kept & (starts.imag > 0))
    kept[oscillates[linear_sum_assignment(np.abs(starts[oscillates] - light[:, None]))[1]]] = False
    starts, motions = starts[kept], motions[kept]
    kept = ~_mark_counterparts(starts)
    rigid = np.eye(len(basis.stiffness), dtype=complex)[
        (basis.inertia > 0) & (basis.stiffness == 0)
    ]
    starts, motions = (
        np.concatenate([starts[kept], np.zeros(len(rigid))]),
        np.concatenate([motions[kept], rigid]),
    )
    oscillates = np.flatnonzero(starts.imag > 0)
    if len(oscillates):
        lossy, moving = _solve_quadratic(
            basis, basis.elastic(starts[oscillates].imag, basis.place).mean(0)
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


def _solve_quadratic(basis: Basis, loss: Any) -> tuple[Any, Any]:
    """Poles and shapes of the quadratic eigenvalue problem with a constant loss L (n, n).

    Those with Im s >= 0; with a loss, Im s > 0.
    """
    from scipy.linalg import eig

    massive = np.flatnonzero(basis.inertia > 0)
    n, m = len(basis.stiffness), len(massive)
    rate = float(np.sqrt(np.abs(basis.stiffness[massive]).max()) or 1.0)
    select = np.eye(n)[massive]
    left = np.block(
        [
            [-np.diag(basis.stiffness) - loss, np.zeros((n, m))],
            [np.zeros((m, n)), np.eye(m) * rate**2],
        ]
    )
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


def _mark_rigid(basis: Basis, values: Any) -> Any:
    """Mark the poles (p,) that are 0 but for rounding.

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
            left -= 1 + int(values[n].imag > 0)
    return out


def _mark_counterparts(values: Any) -> Any:
    """Mark the real poles (p,) that are decaying counterparts of growing ones."""
    out = np.zeros(len(values), dtype=bool)
    real = values.imag == 0
    for growing in np.flatnonzero(real & (values.real > 0)):
        decaying = np.flatnonzero(real & (values.real < 0) & ~out)
        if len(decaying):
            out[decaying[np.abs(values[decaying] + values[growing]).argmin()]] = True
    return out


def _refine_in_basis(basis: Basis, start: complex, motion: Any) -> tuple[complex, Any]:
    """Refine a pole and its shape by the secant method in the equation of the leading mode."""
    lead = np.array([int(np.where(basis.inertia > 0, np.abs(motion), -1.0).argmax())])
    if not np.abs(motion[lead[0]]) > 0 or start == 0:
        return start, motion

    def equation(s: complex) -> tuple[complex, Any]:
        matrix, follow, others = _condense(basis, lead, s, basis.losses(np.array([s]))[0])
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


def refine_pole(dynamic: Callable[[Any, bool], Any], start: complex, motion: Any) -> complex:
    """Refine a pole of any system by the secant method in 1 / (b^T Z(s)^-1 b), which is 0 at poles.

    Parameters
    ----------
    dynamic : callable
        Z (m, A + t, A + t) at s (m,), with or without loss angles; the support's six coordinates
        first, forces that serve as coordinates last.
    start : complex
        rad/s; real for a motion that does not oscillate.
    motion : (A,) array or None
        Approximate shape, used for b; None excites all coordinates alike.

    Returns
    -------
    complex
        rad/s; the start where the iteration leaves its neighbourhood.
    """
    oscillates = start.imag > 0
    size = np.abs(np.diagonal(dynamic(np.array([start * 1.03 + 0j]), oscillates)[0, 6:, 6:]))
    scale = 1 / np.sqrt(np.where(size > 0, size, 1.0))
    push = np.ones(len(scale))
    if motion is not None:
        push = np.pad(motion[6:], (0, len(scale) - len(motion) + 6)) / scale

    def inverse(s: complex) -> complex:
        matrix = dynamic(np.array([s + 0j]), oscillates)[0, 6:, 6:] * scale[:, None] * scale
        result = 1 / (push @ np.linalg.solve(matrix, push))
        return result if oscillates else result.real

    before, now = start * (1 + 1e-6), start
    residual, last = inverse(before), np.inf
    for _ in range(STEPS):
        value = inverse(now)
        if value in (0, residual):
            break
        step = -value * (now - before) / (value - residual)
        before, residual, now = now, value, now + step
        if abs(now - start) > STRAYED * abs(start) or (now.imag > 0) != oscillates:
            return start
        if abs(step) <= CONVERGED * abs(now) or (
            abs(step) < NOISE * abs(now) and 2 * abs(step) >= last
        ):
            break
        last = abs(step)
    return now


def solve(model: LinearSystem, found: Modes) -> Modes:
    """Solve for modes with dampers and losses of any size, from the undamped modes.

    Parameters
    ----------
    model : LinearSystem
        Without batch axes and without wire mass.
    found : Modes
        Its undamped modes (`linear.eigenmodes.solve`).

    Returns
    -------
    Modes
        Those that do not oscillate first: unstable, rigid, then overdamped by decay rate.
    """
    shapes = np.pad(found.shape, ((0, 0), (6, 0))) @ model.basis
    values, motions, plain = [], [], np.ones(len(shapes), dtype=bool)
    for number, group in enumerate(model.blocks):
        own = np.flatnonzero(found.block == number)
        basis, moves = _build_basis(model, group, found.omega_squared[own], shapes[own][:, group])
        lossy = _mark_lossy(basis)
        if not lossy[: len(own)].any() and not basis.viscous.any():
            continue
        plain[own[lossy[: len(own)]]] = False
        here = find_poles(basis.within(np.flatnonzero(lossy)))
        motion = np.zeros((len(here.value), model.size), dtype=complex)
        motion[:, group] = here.motion @ moves[lossy]
        values.append(here.value)
        motions.append(motion)
    if not values:
        return found
    value, motion = np.concatenate(values), np.concatenate(motions)
    return _build_modes(model, found, plain, *_recompute_decay(model, value, motion))


def _build_basis(
    model: LinearSystem, group: Index, squared: Array, shapes: Array
) -> tuple[Basis, Array]:
    """Transform a block to its modes (m, c) and massless directions; with the basis (n, c)."""
    light = group[model.massless[group]]
    own, directions = np.linalg.eigh(model.stiffness[np.ix_(light, light)])
    added = np.zeros((len(light), len(group)))
    added[:, model.massless[group]] = (directions / np.sqrt(np.abs(own))).T
    square = np.ix_(group, group)
    moves = np.concatenate([_decouple(squared, shapes, model.stiffness[square]), added])
    elastic = [term for term in model.terms if not isinstance(term, LossTerm) or term.elastic]
    matrices = [moves @ term.all_matrices[:, group[:, None], group] @ moves.T for term in elastic]
    constant = (
        np.zeros((len(moves),) * 2)
        if model.lossy is None
        else 1j * (moves @ model.lossy[square].imag @ moves.T)
    )

    def losses(omega: Array, place: Index) -> Any:
        own = constant[np.ix_(place, place)]
        result = np.broadcast_to(own, (len(omega), *own.shape)).astype(complex)
        for term, each in zip(elastic, matrices, strict=True):
            some = each[:, place[:, None], place]
            which = np.flatnonzero(some.any((1, 2)))
            if len(which):
                result += np.tensordot(term.at(omega).all_functions()[which].T, some[which], 1)
        return result

    damping = moves @ damping_matrix(model)[square] @ moves.T
    return Basis(
        np.concatenate([squared, np.sign(own)]),
        np.repeat([1.0, 0.0], [len(shapes), len(light)]),
        damping,
        np.arange(len(moves)),
        losses,
    ), moves


def _decouple(squared: Array, shapes: Array, stiffness: Array) -> Array:
    """Decouple shapes (m, c) of modes that are nearly degenerate in omega^2.

    `eigenmodes.solve` gives combinations that move few coordinates, which the stiffness couples.
    """
    result = shapes.copy()
    for group in np.split(
        np.arange(len(squared)),
        np.flatnonzero(np.diff(squared) > undamped.DEGENERATE * np.abs(squared[1:])) + 1,
    ):
        if len(group) > 1 and squared[group[-1]] - squared[group[0]] > ALIKE * abs(
            squared[group[-1]]
        ):
            _, turn = np.linalg.eigh(shapes[group] @ stiffness @ shapes[group].T)
            result[group] = turn.T @ shapes[group]
    return result


def damping_matrix(model: LinearSystem) -> Array:
    """Damping matrix C (N, N) of dampers and of gas around bodies, N s/m."""
    return model.damping + sum(
        (term.matrix for term in model.terms if isinstance(term, LossTerm) and not term.elastic),
        np.zeros(model.damping.shape),
    )


def _mark_lossy(basis: Basis) -> Any:
    """Mark the coordinates (n,) of a basis that losses act on.

    On rigid modes only dampers act; massless coordinates always count.
    """
    size = np.sqrt(np.abs(basis.stiffness))
    losses = np.abs(
        np.diagonal(basis.losses(1j * np.where(size > 0, size, 1.0)), axis1=1, axis2=2).diagonal()
    )
    resisted = np.abs(basis.viscous.diagonal())
    return (basis.inertia == 0) | np.where(
        size > 0,
        losses > quality.NOTHING * size**2,
        resisted > UNDAMPED * resisted.max(initial=0.0),
    )


def _recompute_decay(model: LinearSystem, value: Any, motion: Any) -> tuple[Any, Any, Array]:
    """Recompute the decay of poles (p,) from the dissipation of their shapes (p, N).

    x^H Z x = 0 has the imaginary part x^H Im(L) x + omega x^H C x + 2 sigma omega x^H M x = 0, in
    which nothing cancels.

    Returns
    -------
    value : (p,) complex array
    motion : (p, N) complex array
        Of unit modal mass.
    elastic : (p,) array
        Twice the energy in lossy elements.
    """
    motion = motion / np.sqrt(np.abs(_quadratic_form(model.mass, motion)))[:, None]
    lost, elastic = _dissipated(model, value.imag, motion)
    oscillates = value.imag > 0
    omega = np.where(oscillates, value.imag, 1.0)
    sigma = np.where(lost > quality.NOTHING * omega**2, -lost / (2 * omega), 0.0)
    return np.where(oscillates, sigma + 1j * value.imag, value), motion, elastic


def _quadratic_form(matrix: Array, motion: Any) -> Any:
    """x^H A x (p,) of shapes x (p, N), for a real symmetric A (N, N)."""
    return sum(np.einsum("mi,ij,mj->m", part, matrix, part) for part in (motion.real, motion.imag))


def _dissipated(model: LinearSystem, omega: Array, motion: Any) -> tuple[Array, Array]:
    """x^H Im(Z) x (p,) of complex shapes (p, N), and that with every loss angle 1 rad."""
    parts = [
        quality.dissipation(model, omega, part, quality.end_motions(model, part))
        for part in (motion.real, motion.imag)
    ]
    return parts[0][0] + parts[1][0], parts[0][1] + parts[1][1]


def _build_modes(
    model: LinearSystem, found: Modes, plain: Any, value: Any, motion: Any, elastic: Array
) -> Modes:
    """Build the modes, ascending, from the undamped ones to keep (`plain`) and from poles."""
    oscillates = value.imag > 0
    decay = np.where(np.abs(value) > 0, np.maximum(-value.real, 0.0), 0.0)
    squared = np.where(
        oscillates, np.abs(value) ** 2, np.where(value.real > 0, -(value.real**2), 0.0)
    )
    shape = real_shapes(motion)
    energy, tips = mean_energies(model, motion)
    new = {
        "omega_squared": squared,
        "shape": undamped.fix_signs(shape @ model.basis.T, np.concatenate([energy, tips], axis=1))[
            :, 6:
        ],
        "energy": energy.reshape(len(shape), -1, 6),
        "tip_energy": tips,
        "block": model.member[np.abs(motion).argmax(1)],
        "q": quality_factor(value),
        "dilution": np.where(oscillates, quality.safe_ratio(np.abs(value) ** 2, elastic), np.nan)
        if quality.knows_energy(model)
        else np.full(len(value), np.nan),
        "wire_energy": np.zeros((len(value), 0)),
        "order": np.zeros(len(value), dtype=np.intp),
        "decay_rate": decay,
    }
    return merge_modes(found, plain, new)


def mean_energies(model: LinearSystem, motion: Any) -> tuple[Array, Array]:
    """Fractions of the mean kinetic energy of complex shapes (p, N), as
    `eigenmodes.energy_fractions`.

    Returns
    -------
    bodies : (p, 6 n) array
    tips : (p, N - 6 - 6 n) array
    """
    total, fractions = (
        np.zeros(len(motion)),
        [
            np.zeros((len(motion), 6 * len(model.body))),
            np.zeros((len(motion), model.size - 6 * len(model.body) - 6)),
        ],
    )
    for part in (motion.real, motion.imag):
        weight = np.einsum("mi,ij,mj->m", part, model.mass, part)
        moves = weight > 0
        total += np.where(moves, weight, 0.0)
        for fraction, own in zip(
            fractions, undamped.energy_fractions(model, part[moves]), strict=True
        ):
            fraction[moves] += weight[moves, None] * own
    return fractions[0] / total[:, None], fractions[1] / total[:, None]


def merge_modes(found: Modes, kept: Any, new: dict[str, Any]) -> Modes:
    """Merge some of the modes found with new ones, by omega^2, then by decay if overdamped.

    Modes of one frequency keep their order.

    Parameters
    ----------
    found : Modes
    kept : (m,) bool array
    new : dict of arrays
        Attributes of `Modes` with one entry per new mode.
    """
    both = {
        name: np.concatenate([getattr(found, name)[kept], values]) for name, values in new.items()
    }
    squared = both["omega_squared"]
    order = np.lexsort((np.where(squared == 0, both["decay_rate"], 0.0), squared))
    apart = np.diff(squared[order], prepend=-np.inf) > ALIKE * np.abs(squared[order])
    group = np.empty(len(order), dtype=np.intp)
    group[order] = np.cumsum(apart | (squared[order] == 0))
    order = np.argsort(group, kind="stable")
    return replace(found, **{name: values[order] for name, values in both.items()})


def quality_factor(value: Any) -> Any:
    """Q (p,) of poles: Im s / (-2 Re s); infinite without decay, 0 where nothing oscillates."""
    decays = value.real < 0
    return np.where(decays, value.imag / (-2 * np.where(decays, value.real, -1.0)), np.inf)


def real_shapes(motion: Any) -> Array:
    """Real shapes (p, N): complex ones at the phase of largest displacement, of the same norm."""
    turn = np.angle((motion**2).sum(1)) / 2
    shape = (motion * np.exp(-1j * turn)[:, None]).real
    size, whole = np.sqrt((shape**2).sum(1)), np.sqrt((np.abs(motion) ** 2).sum(1))
    return shape * (whole / np.where(size > 0, size, 1.0))[:, None]
