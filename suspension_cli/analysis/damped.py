"""Modes with dampers and losses of any size: the poles s = sigma + i omega of a suspension, at which Z(s) x = 0 has a motion x.

    Z(s) = K + s C + s^2 M + L(omega),

K, C, M symmetric and L what loss angles add to the stiffness, i phi K and its like, at the frequency omega = Im s at which the mode oscillates.  A loss angle
is the lag of an oscillation; a motion that does not oscillate (omega = 0) has none, so L(0) = 0.

In the basis of the modes without losses (omega_j, x_j, of unit modal mass) and of the massless directions e_j of unit stiffness,

    (k_j + s^2 m_j) y_j + sum over k of G_jk(s) y_k = 0,      G = X^T (s C + L) X,    k_j = omega_j^2 or 1,    m_j = 1 or 0,

which is exact, as the basis is complete.  The stiffness is diagonal in it, so nothing of a stiff wire rounds off what a soft mode loses: with the modes S
that losses couple strongly (one alone, or several that lie together) and the others R eliminated,

    -s^2 = an eigenvalue of  k_S + G_SS - G_SR (k_R + s^2 m_R + G_RR)^-1 G_RS,

a Q of 1e12 keeps all its digits.  Where damping is strong the poles come from the eigenvalues of the quadratic problem (Tisseur and Meerbergen, SIAM Review
43, 235 (2001)) and are refined in the same equation, with S the mode that moves most.

A pole that oscillates has a frequency |s| / 2 pi and Q = Im s / (-2 Re s), pi times the oscillations in which its amplitude falls to 1/e, as a ring-down
shows.  With m x'' + k (1 + i phi) x = 0 that is Q = 1 / (2 tan(atan(phi) / 2)), 10.025 for phi = 0.1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analysis import modes as undamped
from suspension_cli.analysis import quality
from suspension_cli.analysis.modes import Modes
from suspension_cli.design.scene import Array, Index
from suspension_cli.mechanics.dispersion import LossTerm
from suspension_cli.mechanics.model import LinearModel

LIGHT = 0.02
"""Share of omega^2 up to which losses change a mode's equation for the mode to be followed from the undamped one."""
WIDE = 0.3
"""Difference of omega^2 of modes that are followed together, over it."""
COUPLED = 0.05
"""Coupling of two modes by losses, over the difference of their equations, above which they are solved together."""
ROUNDING = 1e-10
"""What couples two modes, over what damps them, that is a rounding error: it would mix modes of one frequency."""
TOGETHER = 1e-6
"""Difference of the equations of two modes, over their losses, below which they are solved together."""
NEGLIGIBLE = 1e-18
"""What another mode adds to the losses of one, over these, that is left out."""
MEMORY = 2_000_000
"""Elements of losses that are worked on at once."""
STEPS = 30
"""Of any iteration."""
CONVERGED = 4 * np.finfo(float).eps
"""Relative change at which an iteration ends."""
NOISE = 1e-9
"""Relative change below which an iteration that no longer improves has ended."""
STRAYED = 0.5
"""Relative distance from its start at which a pole is not taken for the one that was looked for."""
ALIKE = 1e-12
"""Relative difference of omega^2 that may be a rounding error."""
UNFELT = 1e-24
"""Share of the largest damping below which a rigid mode feels none of it."""
RESISTED = 1e-12
"""Share of the largest damping of rigid modes below which a combination of them feels none."""
REAL = 1e-13
"""Imaginary part of a pole of the real problem, over its size, that is a rounding error."""


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
        Which of the coordinates of `elastic` these are.
    elastic : callable
        X^T L(omega) X (m, n, n), complex, of omega (m,) above 0, rad/s, and of places (n,).
    """

    stiffness: Array
    inertia: Array
    viscous: Array
    place: Index
    elastic: Callable[[Array, Index], Any]

    def losses(self, s: Any) -> Any:
        """G (m, n, n) at s (m,): no loss angle where s is real."""
        s = np.asarray(s, dtype=complex)
        result = s[:, None, None] * self.viscous
        oscillates = s.imag > 0
        if oscillates.any():
            result[oscillates] = result[oscillates] + self.elastic(s.imag[oscillates], self.place)
        size = np.sqrt(np.abs(np.diagonal(result, axis1=1, axis2=2)))
        return np.where(np.abs(result) > ROUNDING * size[:, :, None] * size[:, None, :], result, 0.0)

    def within(self, some: Index) -> Basis:
        """The same for some of the coordinates, where the others feel no loss."""
        return Basis(self.stiffness[some], self.inertia[some], self.viscous[np.ix_(some, some)], self.place[some], self.elastic)


@dataclass(frozen=True)
class Poles:
    """Poles, one of each conjugate pair, and their motions.

    Attributes
    ----------
    value : (p,) complex array
        rad/s; imaginary part not negative.
    motion : (p, n) complex array
        In the coordinates of the basis.
    """

    value: Any
    motion: Any


def poles(basis: Basis) -> Poles:
    """All poles of a system in the basis of its undamped modes.

    Of a rigid mode 0 is a pole; a mode that grows counts with its growth alone, not with the decaying motion at (about) the opposite pole.
    """
    n = len(basis.stiffness)
    values, motions = [np.zeros(0, dtype=complex)], [np.zeros((0, n), dtype=complex)]
    for own in _components(basis):
        found = _poles(basis.within(own))
        motion = np.zeros((len(found.value), n), dtype=complex)
        motion[:, own] = found.motion
        values.append(found.value)
        motions.append(motion)
    return Poles(np.concatenate(values), np.concatenate(motions))


def _poles(basis: Basis) -> Poles:
    """Poles of modes that losses join."""
    groups, light = _groups(basis)
    values, motions = _followed(basis, [group for group in groups if light[group].all()])
    if light[basis.inertia > 0].all() and not basis.viscous[basis.inertia == 0].any():
        return Poles(values, motions)
    strong, moving = _strong(basis, values)
    return Poles(np.concatenate([values, strong]), np.concatenate([motions, moving]))


def _components(basis: Basis) -> list[Index]:
    """Coordinates that losses join, directly or through others."""
    omega = np.sqrt(np.abs(basis.stiffness[basis.inertia > 0]))
    probes = 1j * np.unique(np.quantile(omega[omega > 0], [0.0, 0.5, 1.0])) if (omega > 0).any() else np.array([1j])
    return _joined((basis.losses(probes) != 0).any(0))


def _joined(linked: Any) -> list[Index]:
    """Groups of numbers that pairs (n, n) link."""
    from scipy.sparse.csgraph import connected_components

    count, member = connected_components(linked, directed=False)
    return [np.flatnonzero(member == number) for number in range(count)]


def _chunks(basis: Basis, count: int) -> list[slice]:
    """Poles in parts whose losses fit into memory together."""
    most = max(1, MEMORY // len(basis.stiffness) ** 2)
    return [slice(start, start + most) for start in range(0, count, most)]


def _groups(basis: Basis) -> tuple[list[Index], Any]:
    """Modes that losses couple strongly, and which modes are light (n,)."""
    massive = np.flatnonzero(basis.inertia > 0)
    n = len(basis.stiffness)
    start = np.where(basis.inertia > 0, 1j * np.sqrt(np.maximum(basis.stiffness, 0.0)), 0.0)
    rows, own = np.zeros((n, n), dtype=complex), np.zeros((n, n), dtype=complex)  # G_jk and G_kk at mode j
    for part in _chunks(basis, n):
        losses = basis.losses(start[part])
        rows[part] = losses[np.arange(len(losses)), np.arange(n)[part]]
        own[part] = np.diagonal(losses, axis1=1, axis2=2)
    here = basis.stiffness + own - np.outer(basis.stiffness, basis.inertia)  # equation k at mode j
    coupling, size, apart = np.abs(rows), np.abs(np.diag(rows)), np.abs(here - np.diag(here)[:, None])
    linked = (coupling > COUPLED * apart) | (apart < TOGETHER * np.add.outer(size, size))
    linked[:, basis.inertia == 0] = linked[basis.inertia == 0] = False
    groups = [group for group in _joined(linked) if np.isin(group, massive).all()]
    light = np.zeros(n, dtype=bool)
    for group in groups:
        others = np.setdiff1d(np.arange(n), group)
        for j in group:
            left_over = coupling[j, others] ** 2 / np.maximum(np.abs(here[j, others]), np.finfo(float).tiny)
            spread = np.abs(basis.stiffness[group] - basis.stiffness[j]).max()
            light[j] = coupling[j, group].sum() + left_over.sum() < LIGHT * basis.stiffness[j] and spread < WIDE * basis.stiffness[j]
    return groups, light


def _effective(basis: Basis, group: Index, s: complex, losses: Any, least: float = 0.0) -> tuple[Any, Any, Index]:
    """G_SS - G_SR (k_R + s^2 m_R + G_RR)^-1 G_RS of some modes, with G (n, n) at s; how the others move with them (r, g), and which these are (r,).

    Those whose part in it is below `least` are left out.
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


def _followed(basis: Basis, groups: list[Index]) -> tuple[Any, Any]:
    """Poles and motions of groups of light modes, from the undamped ones; all pole by pole, but with their losses evaluated together."""
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
                matrix, follow, others = _effective(basis, own, at, losses, NEGLIGIBLE)
                small = np.abs(matrix) < ROUNDING * np.abs(matrix).max()
                every, vectors = np.linalg.eig(np.diag(basis.stiffness[own] - middle[n]) + np.where(small, 0.0, matrix))
                # several may have one eigenvalue: each goes on from its own shape
                which = member[n] if step == 0 else int(np.abs(motions[n, own].conj() @ vectors).argmax())
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


def _strong(basis: Basis, light: Any) -> tuple[Any, Any]:
    """Poles and motions of all modes but those of the poles given."""
    from scipy.optimize import linear_sum_assignment

    starts, motions = _quadratic(basis, np.zeros(basis.viscous.shape))
    kept = ~_at_rest(basis, starts)
    oscillates = np.flatnonzero(kept & (starts.imag > 0))
    kept[oscillates[linear_sum_assignment(np.abs(starts[oscillates] - light[:, None]))[1]]] = False
    starts, motions = starts[kept], motions[kept]
    kept = ~_twins(starts)
    rigid = np.eye(len(basis.stiffness), dtype=complex)[(basis.inertia > 0) & (basis.stiffness == 0)]
    starts, motions = np.concatenate([starts[kept], np.zeros(len(rigid))]), np.concatenate([motions[kept], rigid])
    oscillates = np.flatnonzero(starts.imag > 0)
    if len(oscillates):
        lossy, moving = _quadratic(basis, basis.elastic(starts[oscillates].imag, basis.place).mean(0))
        if len(light):
            other = np.ones(len(lossy), dtype=bool)
            other[linear_sum_assignment(np.abs(lossy - light[:, None]))[1]] = False
            lossy, moving = lossy[other], moving[other]
        rows, columns = linear_sum_assignment(np.abs(lossy - starts[oscillates][:, None]))
        starts[oscillates[rows]], motions[oscillates[rows]] = lossy[columns], moving[columns]
    refined = [_refined(basis, start, motion) for start, motion in zip(starts, motions, strict=True)]
    return np.array([value for value, _ in refined], dtype=complex), np.array([motion for _, motion in refined]).reshape(-1, len(basis.stiffness))


def _quadratic(basis: Basis, loss: Any) -> tuple[Any, Any]:
    """Poles and motions for a constant loss (n, n): imaginary parts not negative (above 0 where there is a loss)."""
    from scipy.linalg import eig

    massive = np.flatnonzero(basis.inertia > 0)
    n, m = len(basis.stiffness), len(massive)
    rate = float(np.sqrt(np.abs(basis.stiffness[massive]).max()) or 1.0)
    select = np.eye(n)[massive]
    left = np.block([[-np.diag(basis.stiffness) - loss, np.zeros((n, m))], [np.zeros((m, n)), np.eye(m) * rate**2]])
    right = np.block([[basis.viscous * rate, select.T * rate**2], [select * rate**2, np.zeros((m, m))]])
    found: Any = eig(left, right, homogeneous_eigvals=True)
    (top, bottom), vectors = found
    finite = np.abs(bottom) > 1e-12 * np.abs(top)
    values = rate * top[finite] / bottom[finite]
    motions = vectors[:n, finite].T
    # real poles of the real problem are exactly real but for those that lie together
    values = np.where(np.abs(values.imag) <= REAL * np.abs(values), values.real, values)
    kept = values.imag > 0 if loss.any() else values.imag >= 0
    return values[kept], motions[kept].astype(complex)


def _at_rest(basis: Basis, values: Any) -> Any:
    """Which poles (p,) are 0 but for rounding: two for each rigid mode, but for those that a damper makes decay."""
    rigid = np.flatnonzero((basis.inertia > 0) & (basis.stiffness == 0))
    out = np.zeros(len(values), dtype=bool)
    if len(rigid):
        damping = basis.viscous[np.ix_(rigid, rigid)]
        left = 2 * len(rigid) - int(np.linalg.matrix_rank(damping, tol=RESISTED * np.abs(damping).max(), hermitian=True))
        for n in np.argsort(np.abs(values), kind="stable"):
            if left <= 0:
                break
            out[n] = True
            left -= 1 + int(values[n].imag > 0)
    return out


def _twins(values: Any) -> Any:
    """Which real poles (p,) are the decaying twins of growing ones."""
    out = np.zeros(len(values), dtype=bool)
    real = values.imag == 0
    for growing in np.flatnonzero(real & (values.real > 0)):
        decaying = np.flatnonzero(real & (values.real < 0) & ~out)
        if len(decaying):
            out[decaying[np.abs(values[decaying] + values[growing]).argmin()]] = True
    return out


def _refined(basis: Basis, start: complex, motion: Any) -> tuple[complex, Any]:
    """A pole near a start, by the secant method in the equation of the mode that moves most, and its motion."""
    lead = np.array([int(np.where(basis.inertia > 0, np.abs(motion), -1.0).argmax())])
    if not np.abs(motion[lead[0]]) > 0 or start == 0:
        return start, motion

    def equation(s: complex) -> tuple[complex, Any]:
        matrix, follow, others = _effective(basis, lead, s, basis.losses(np.array([s]))[0])
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


def refined(dynamic: Callable[[Any, bool], Any], start: complex, motion: Any) -> complex:
    """A pole of any system near a start, by the secant method in 1 / (b^T Z(s)^-1 b), which is 0 at poles.

    Parameters
    ----------
    dynamic : callable
        Z (m, A + t, A + t) at s (m,), with or without loss angles; the support's six coordinates first, forces that serve as coordinates last.
    start : complex
        rad/s; real for a motion that does not oscillate.
    motion : (A,) array or None
        About the pole's motion, which says what b excites; None for all coordinates alike.
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
        if abs(step) <= CONVERGED * abs(now) or (abs(step) < NOISE * abs(now) and 2 * abs(step) >= last):
            break
        last = abs(step)
    return now


def solve(model: LinearModel, found: Modes) -> Modes:
    """Modes with all losses.

    Parameters
    ----------
    model : LinearModel
        Without batch axes; wires without mass.
    found : Modes
        Its modes without losses (`modes.solve`).

    Returns
    -------
    Modes
        Those that do not oscillate first: unstable ones, rigid ones, overdamped ones by their rate.
    """
    shapes = np.pad(found.shape, ((0, 0), (6, 0))) @ model.basis
    values, motions, plain = [], [], np.ones(len(shapes), dtype=bool)
    for number, group in enumerate(model.blocks):
        own = np.flatnonzero(found.block == number)
        basis, moves = _basis(model, group, found.omega_squared[own], shapes[own][:, group])
        felt = _felt(basis)
        if not felt[: len(own)].any() and not basis.viscous.any():
            continue
        plain[own[felt[: len(own)]]] = False
        here = poles(basis.within(np.flatnonzero(felt)))
        motion = np.zeros((len(here.value), model.size), dtype=complex)
        motion[:, group] = here.motion @ moves[felt]
        values.append(here.value)
        motions.append(motion)
    if not values:
        return found
    value, motion = np.concatenate(values), np.concatenate(motions)
    return _listed(model, found, plain, *_sharpened(model, value, motion))


def _basis(model: LinearModel, group: Index, squared: Array, shapes: Array) -> tuple[Basis, Array]:
    """A block in the basis of its modes (m, c) and massless directions; the basis (n, c)."""
    light = group[model.massless[group]]
    own, directions = np.linalg.eigh(model.stiffness[np.ix_(light, light)])
    added = np.zeros((len(light), len(group)))
    added[:, model.massless[group]] = (directions / np.sqrt(np.abs(own))).T
    square = np.ix_(group, group)
    moves = np.concatenate([_apart(squared, shapes, model.stiffness[square]), added])
    elastic = [term for term in model.terms if not isinstance(term, LossTerm) or term.elastic]
    matrices = [moves @ term.all_matrices[:, group[:, None], group] @ moves.T for term in elastic]
    constant = np.zeros((len(moves),) * 2) if model.lossy is None else 1j * (moves @ model.lossy[square].imag @ moves.T)

    def losses(omega: Array, place: Index) -> Any:
        own = constant[np.ix_(place, place)]
        result = np.broadcast_to(own, (len(omega), *own.shape)).astype(complex)
        for term, each in zip(elastic, matrices, strict=True):
            some = each[:, place[:, None], place]
            which = np.flatnonzero(some.any((1, 2)))
            if len(which):
                result += np.tensordot(term.at(omega).all_functions()[which].T, some[which], 1)
        return result

    damping = moves @ dampers(model)[square] @ moves.T
    return Basis(np.concatenate([squared, np.sign(own)]), np.repeat([1.0, 0.0], [len(shapes), len(light)]), damping, np.arange(len(moves)), losses), moves


def _apart(squared: Array, shapes: Array, stiffness: Array) -> Array:
    """Shapes (m, c) of modes that all but agree in omega^2 as those that do not couple: `modes.solve` gives such as move few coordinates."""
    result = shapes.copy()
    for group in np.split(np.arange(len(squared)), np.flatnonzero(np.diff(squared) > undamped.DEGENERATE * np.abs(squared[1:])) + 1):
        if len(group) > 1 and squared[group[-1]] - squared[group[0]] > ALIKE * abs(squared[group[-1]]):
            _, turn = np.linalg.eigh(shapes[group] @ stiffness @ shapes[group].T)
            result[group] = turn.T @ shapes[group]
    return result


def dampers(model: LinearModel) -> Array:
    """C (N, N) of dampers and of gas around bodies."""
    return model.damping + sum((term.matrix for term in model.terms if isinstance(term, LossTerm) and not term.elastic), np.zeros(model.damping.shape))


def _felt(basis: Basis) -> Any:
    """Which coordinates (n,) of a basis losses act on: on rigid modes dampers alone; massless ones always count."""
    size = np.sqrt(np.abs(basis.stiffness))
    losses = np.abs(np.diagonal(basis.losses(1j * np.where(size > 0, size, 1.0)), axis1=1, axis2=2).diagonal())
    resisted = np.abs(basis.viscous.diagonal())
    return (basis.inertia == 0) | np.where(size > 0, losses > quality.NOTHING * size**2, resisted > UNFELT * resisted.max(initial=0.0))


def _sharpened(model: LinearModel, value: Any, motion: Any) -> tuple[Any, Any, Array]:
    """Poles with their decay from what their motions dissipate, the motions with unit modal mass, and twice the energy in what is lossy (p,).

    x^H Z x = 0 has the imaginary part x^H Im(L) x + omega x^H C x + 2 sigma omega x^H M x = 0, in which nothing cancels.
    """
    motion = motion / np.sqrt(np.abs(_form(model.mass, motion)))[:, None]
    lost, elastic = _dissipated(model, value.imag, motion)
    oscillates = value.imag > 0
    omega = np.where(oscillates, value.imag, 1.0)
    sigma = np.where(lost > quality.NOTHING * omega**2, -lost / (2 * omega), 0.0)
    return np.where(oscillates, sigma + 1j * value.imag, value), motion, elastic


def _form(matrix: Array, motion: Any) -> Any:
    """x^H A x (p,) for a real symmetric A."""
    return sum(np.einsum("mi,ij,mj->m", part, matrix, part) for part in (motion.real, motion.imag))


def _dissipated(model: LinearModel, omega: Array, motion: Any) -> tuple[Array, Array]:
    """x^H Im(Z) x and the same with every loss angle 1 rad, for complex motions (p, N)."""
    parts = [quality.dissipated(model, omega, part, quality.ends_of(model, part)) for part in (motion.real, motion.imag)]
    return parts[0][0] + parts[1][0], parts[0][1] + parts[1][1]


def _listed(model: LinearModel, found: Modes, plain: Any, value: Any, motion: Any, elastic: Array) -> Modes:
    """The modes that feel no loss and those of poles, ascending."""
    oscillates = value.imag > 0
    decay = np.where(np.abs(value) > 0, np.maximum(-value.real, 0.0), 0.0)
    squared = np.where(oscillates, np.abs(value) ** 2, np.where(value.real > 0, -(value.real**2), 0.0))
    shape = instant(motion)
    energy, tips = energies(model, motion)
    new = {
        "omega_squared": squared,
        "shape": undamped.signed(shape @ model.basis.T, np.concatenate([energy, tips], axis=1))[:, 6:],
        "energy": energy.reshape(len(shape), -1, 6),
        "tip_energy": tips,
        "block": model.member[np.abs(motion).argmax(1)],
        "q": quality_factor(value),
        "dilution": np.where(oscillates, quality.ratio(np.abs(value) ** 2, elastic), np.nan) if model.terms else np.full(len(value), np.nan),
        "wire_energy": np.zeros((len(value), 0)),
        "order": np.zeros(len(value), dtype=np.intp),
        "decay_rate": decay,
    }
    return merged(found, plain, new)


def energies(model: LinearModel, motion: Any) -> tuple[Array, Array]:
    """Mean kinetic-energy shares of complex motions (p, N): `modes.energies` of both their parts."""
    total, shares = np.zeros(len(motion)), [np.zeros((len(motion), 6 * len(model.body))), np.zeros((len(motion), model.size - 6 * len(model.body) - 6))]
    for part in (motion.real, motion.imag):
        weight = np.einsum("mi,ij,mj->m", part, model.mass, part)
        moves = weight > 0
        total += np.where(moves, weight, 0.0)
        for share, own in zip(shares, undamped.energies(model, part[moves]), strict=True):
            share[moves] += weight[moves, None] * own
    return shares[0] / total[:, None], shares[1] / total[:, None]


def merged(found: Modes, kept: Any, new: dict[str, Any]) -> Modes:
    """Some of the modes found and new ones, in order: by omega^2, then by the decay of overdamped ones, those of one frequency as they stand."""
    both = {name: np.concatenate([getattr(found, name)[kept], values]) for name, values in new.items()}
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


def instant(motion: Any) -> Array:
    """Motions (p, N) at the instant at which they are largest, as real shapes with the size of the complex ones."""
    turn = np.angle((motion**2).sum(1)) / 2
    shape = (motion * np.exp(-1j * turn)[:, None]).real
    size, whole = np.sqrt((shape**2).sum(1)), np.sqrt((np.abs(motion) ** 2).sum(1))
    return shape * (whole / np.where(size > 0, size, 1.0))[:, None]
