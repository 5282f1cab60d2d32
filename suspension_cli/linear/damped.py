"""Modes with dampers and losses of any size: poles s = sigma + i omega of a suspension.

Each is a root of the pencil, Z(s) x = 0 (`roots`). Start values are the undamped modes, or with
strong dampers the eigenvalues of K + s C + s^2 M in the basis of these modes. Loss angles, phase
lags of an oscillation, act at its frequency omega alone.

A pole that oscillates has the frequency |s| / 2 pi and Q = Im s / (-2 Re s), which is pi times the
number of oscillations in which the amplitude of a ring-down falls to 1/e. For m x'' + k (1 + i phi)
x = 0, Q = 1 / (2 tan(atan(phi) / 2)), 10.025 for phi = 0.1.

Rounding of the stiffness would hide a Q of 1e10 in sigma. With Z' = dZ/ds, the imaginary part of
x^H Z(s) x = 0 gives it from the dissipation at omega, sums of squares in which nothing cancels:

    sigma Im(x^H Z' x) = -x^H Im(Z(i omega)) x.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear import eigenmodes as undamped
from suspension_cli.linear import quality
from suspension_cli.linear.batch_modes import ascending
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.frequency_terms import LossTerm, is_massive
from suspension_cli.linear.pencil import Block, Pencil
from suspension_cli.linear.poles import ROUNDING
from suspension_cli.linear.roots import Roots, find_roots
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

UNDAMPED = 1e-24
"""Fraction of the largest damping below which a rigid mode counts as undamped."""
LIGHT = 0.02
"""Damping rate over frequency up to which poles start from undamped modes."""
SLOW = 1e-4
"""Decay rate over frequency up to which it follows from the dissipation."""
BODILY = 0.5
"""Fraction of the energy of a mode of bodies that is not in wires."""


def solve(model: LinearSystem, found: Modes) -> Modes:
    """Solve for modes with dampers and losses of any size, from the undamped modes `found`.

    For a system without batch axes. Modes that do not oscillate are first: unstable, rigid, then
    overdamped by decay rate. Of an unstable mode only the growing pole counts, not the decaying one
    at about the opposite value. With wire mass these are the modes of bodies alone if
    `are_of_bodies`, each followed from the one without.
    """
    pencil = Pencil.of(model)
    shapes = np.pad(found.shape, ((0, 0), (6, 0))) @ model.basis
    blocks, plain = [_block(pencil, group) for group in model.blocks], np.ones(len(shapes), bool)
    values, members, motions = [np.zeros(0, dtype=complex)], [np.zeros(0, int)], []
    for number, block in enumerate(blocks):
        own = np.flatnonzero(found.block == number)
        if not (block.terms or block.damping.any() or block.loss.any()):
            continue
        squared, x = found.omega_squared[own], shapes[own][:, block.keep]
        start = _starts_with_dampers(model, block, squared, x)
        if start is None:
            some = squared > 0
            rate = 1 / np.maximum(found.q[own[some]], 1.0)  # to first order
            start = 1j * np.sqrt(squared[some] * (1 + 1j * rate)), x[some].astype(complex)
            own = own[some]
        if not len(start[0]):
            continue
        # a rigid mode has one pole, 0, beside those that dampers give it
        plain[own] = found.omega_squared[own] == 0
        values.append(start[0])
        members.append(np.full(len(start[0]), number))
        motions.append(start[1])
    value, member = np.concatenate(values), np.concatenate(members)
    if not len(value):
        return found
    motion = np.zeros((max(part.shape[1] for part in motions), len(value)), dtype=complex)
    for number, part in zip(dict.fromkeys(member.tolist()), motions, strict=True):
        motion[: part.shape[1], member == number] = part.T
    roots = [
        _refine(pencil, blocks, found, Roots.starts(value[some], member[some], motion[:, some]))
        for some in (np.imag(value) > 0, np.imag(value) == 0)
        if some.any()
    ]
    return _build_modes(model, blocks, found, plain, roots)


def are_of_bodies(model: LinearSystem, found: Modes) -> bool:
    """Whether modes followed from those without wire mass are distinct, and of bodies.

    From a start value far away, a mode of wires may be found instead, or one mode twice.
    """
    share = found.energy.sum((1, 2)) + found.tip_energy.sum(1)
    shapes = np.pad(found.shape, ((0, 0), (6, 0))) @ model.basis
    overlap = shapes @ model.mass @ shapes.T
    size = np.sqrt(overlap.diagonal())
    overlap = np.abs(overlap) / np.outer(size, size) - np.eye(len(size))
    alike = np.isclose(found.omega_squared[:, None], found.omega_squared, rtol=1e-9, atol=0.0)
    return bool((share > BODILY).all() and not (alike & (overlap > 1 - BODILY)).any())


def _block(pencil: Pencil, group: Int[np.ndarray, " own"]) -> Block:
    """Find or make the block of some coordinates."""
    wanted = set(group.tolist())
    for block in pencil.blocks:
        if set(block.keep.tolist()) == wanted:
            return block
    order = np.argsort(pencil.owner[group], kind="stable")
    return Block(pencil, group[order], np.asarray(pencil.coupled[group, :6].any(0)))


def _refine(pencil: Pencil, blocks: list[Block], found: Modes, start: Roots) -> Roots:
    lossy = np.isfinite(found.q) & (found.q > 0) & (found.omega_squared > 0)
    rate = np.array(
        [(1 / found.q[lossy & (found.block == n)]).max(initial=0.0) for n in range(len(blocks))]
    )
    width = np.abs(start.value) * np.minimum(rate[start.block], 1.0) / 2
    loss = "all" if np.imag(start.value[0]) > 0 else "dampers"
    return find_roots(pencil, blocks, start, width, loss)


def damping_matrix(model: LinearSystem) -> Float[np.ndarray, "coordinate coordinate"]:
    """Damping matrix C of dampers and of gas around bodies, N s/m."""
    return model.damping + sum(
        (term.matrix for term in model.terms if isinstance(term, LossTerm) and not term.elastic),
        np.zeros(model.damping.shape),
    )


def _starts_with_dampers(
    model: LinearSystem,
    block: Block,
    squared: Float[np.ndarray, " mode"],
    shapes: Float[np.ndarray, "mode own"],
) -> tuple[Complex[np.ndarray, " pole"], Complex[np.ndarray, "pole own"]] | None:
    """Poles and shapes of K + s C + s^2 M; None if dampers are so light that modes are starts.

    In the basis of the modes q, of unit modal mass and q' = v, and of massless directions e that
    dampers act on, of unit stiffness (Tisseur and Meerbergen, SIAM Review 43, 235 (2001)):

        (w q)' = w v,    v' = -+ w (w q) - C_vv v - C_ve e',    0 = k e + C_ev v + C_ee e',

    with w^2 = |omega^2|, so that rigid modes have one state, v.
    """
    square = np.ix_(block.keep, block.keep)
    damping = damping_matrix(model)[square]
    if not damping.any():
        return None
    massless = model.massless[block.keep]
    light, directions = np.linalg.eigh(model.stiffness[square][np.ix_(massless, massless)])
    directions = (directions / np.sqrt(np.abs(light))).T
    rates, turn = np.linalg.eigh(directions @ damping[np.ix_(massless, massless)] @ directions.T)
    acting = np.abs(rates) > UNDAMPED**0.5 * np.abs(rates).max(initial=0.0)
    basis = np.zeros((len(shapes) + acting.sum(), len(massless)))
    basis[: len(shapes)] = shapes
    basis[len(shapes) :, massless] = (turn.T @ directions)[acting]
    stiffness = turn[:, acting].T @ (np.sign(light)[:, None] * turn[:, acting])
    c, m, w = basis @ damping @ basis.T, len(shapes), np.sqrt(np.abs(squared))
    resisted = np.abs(c.diagonal()[:m])
    resisted = resisted > UNDAMPED * resisted.max(initial=0.0)
    scale = np.sqrt(np.where(squared > 0, w, 1.0))
    if not (
        acting.any()
        or resisted[squared <= 0].any()
        or (np.abs(c[:m, :m]) > LIGHT * scale[:, None] * scale).any()
    ):
        return None
    moving = np.flatnonzero(w)
    rows = w[moving, None] * np.eye(m)[moving]
    follow = -np.linalg.solve(c[m:, m:], np.concatenate([c[m:, :m], stiffness], axis=1))  # of e'
    states = np.block(
        [
            [np.zeros((len(moving),) * 2), rows, np.zeros((len(moving), len(stiffness)))],
            [
                -rows.T * np.sign(squared[moving]),
                -c[:m, :m] - c[:m, m:] @ follow[:, :m],
                -c[:m, m:] @ follow[:, m:],
            ],
            [np.zeros((len(stiffness), len(moving))), follow],
        ]
    )
    value, vectors = np.linalg.eig(states)
    value = value.astype(complex)
    kept = (np.imag(value) >= 0) & ~_mark_rigid(value, c[np.ix_(squared == 0, squared == 0)])
    kept[kept] = ~_mark_counterparts(value[kept], int((squared < 0).sum()))
    value, motion = value[kept], vectors[len(moving) :, kept] + 0j
    motion[:m] /= value  # v = s q
    return value, motion.T @ basis


def _mark_rigid(
    value: Complex[np.ndarray, " pole"], damping: Float[np.ndarray, "rigid rigid"]
) -> Bool[np.ndarray, " pole"]:
    """Mark the poles that are 0 but for rounding: combinations of rigid modes without damping."""
    out = np.zeros(len(value), dtype=bool)
    if len(damping):
        rank = np.linalg.matrix_rank(damping, tol=1e-12 * np.abs(damping).max(), hermitian=True)
        out[np.argsort(np.abs(value), kind="stable")[: len(damping) - int(rank)]] = True
    return out


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


def _build_modes(
    model: LinearSystem,
    blocks: list[Block],
    found: Modes,
    plain: Bool[np.ndarray, " mode"],
    roots: list[Roots],
) -> Modes:
    """Build the modes, ascending, from poles and the undamped modes to keep (`plain`)."""
    motion = np.concatenate([motions(model, blocks, part) for part in roots])
    found_at = np.concatenate([part.value for part in roots])
    member = np.concatenate([part.block for part in roots])
    motion = motion / np.sqrt(np.abs(quality.quadratic_form(model.mass, motion)))[:, None]
    refined = refine_decays(model, found_at, motion)
    value, heavier, oscillates = refined.value, refined.heavier, np.imag(found_at) > 0
    rate = np.real(value)
    steady = oscillates & (rate > 0) & (rate <= ROUNDING * np.imag(value))
    value = np.where(steady, 1j * np.imag(value), value)
    decay = np.where(oscillates, -np.real(value), np.maximum(-np.real(value), 0.0)) + 0.0
    squared = np.where(
        oscillates, np.abs(value) ** 2, np.where(np.real(value) > 0, -(np.real(value) ** 2), 0.0)
    )
    energy, tips = undamped.energy_fractions(model, motion)
    shape = real_shapes(motion) @ model.basis.T
    known = oscillates & quality.knows_energy(model)
    new = {
        "omega_squared": squared,
        "shape": undamped.fix_signs(shape, np.concatenate([energy, tips], axis=1))[:, 6:],
        "energy": (energy / heavier[:, None]).reshape(len(shape), -1, 6),
        "tip_energy": tips / heavier[:, None],
        "block": member,
        "q": quality_factor(value),
        "dilution": np.where(
            known, quality.safe_ratio(np.abs(value) ** 2 * heavier, refined.elastic), np.nan
        ),
        "wire_energy": np.zeros((len(value), 0)),
        "order": np.zeros(len(value), dtype=np.intp),
        "decay_rate": decay,
    }
    both = found.select(plain).followed_by(replace(found, **new))
    # overdamped ones by decay
    order = np.argsort(np.where(both.omega_squared == 0, both.decay_rate, 0.0), kind="stable")
    return both.select(order[ascending(both.omega_squared[order])])


def motions(
    model: LinearSystem, blocks: Sequence[Block], found: Roots
) -> Complex[np.ndarray, "root coordinate"]:
    """Motions of all coordinates in each root."""
    result = np.zeros((len(found.value), model.size), dtype=complex)
    for row, number, column in zip(result, found.block.tolist(), found.motion.T, strict=True):
        keep = blocks[number].keep
        row[keep] = column[: len(keep)]
    return result


@dataclass(frozen=True)
class RefinedDecays:
    """Poles with slow decays from dissipation.

    Attributes
    ----------
    elastic
        See `quality.dissipation`.
    heavier
        Kinetic energy with that of wires over that without.
    """

    value: Complex[np.ndarray, " pole"]
    elastic: Float[np.ndarray, " pole"]
    heavier: Float[np.ndarray, " pole"]


def refine_decays(
    model: LinearSystem,
    value: Complex[np.ndarray, " pole"],
    motion: Complex[np.ndarray, "pole coordinate"],
    power: Float[np.ndarray, " pole"] | float = 0.0,
) -> RefinedDecays:
    """Compute the decays of slowly decaying poles that oscillate from their dissipation.

    `power` is Im x^H f of forces -f on the coordinates beside those of the model.
    """
    oscillates = np.imag(value) > 0
    omega = np.where(oscillates, np.imag(value), 1.0)
    wires = quality.end_motions(model, motion)
    lost, elastic = quality.dissipation(model, omega, motion, wires)
    mass = quality.quadratic_form(model.mass, motion)
    weight = mass.copy()
    massive = any(is_massive(term) for term in model.terms)
    if massive:
        weight = weight + sum(sum(quality.wire_energies(*one, omega).values()) for one in wires)
    lost = lost + power
    some = np.abs(lost) > quality.NOTHING * omega**2 * weight
    sigma = np.where(some, -lost / np.where(some, 2 * omega * weight, 1.0), 0.0)
    slow = oscillates & (np.abs(np.real(value)) <= SLOW * omega)
    fast = massive & oscillates & ~slow & (np.real(value) < 0)
    weight[fast] = -lost[fast] / (2 * omega * np.real(value))[fast]
    return RefinedDecays(
        np.where(slow, sigma + 1j * np.imag(value), value),
        elastic,
        np.where(oscillates, weight / np.where(mass > 0, mass, 1.0), 1.0),
    )


def quality_factor(value: Complex[np.ndarray, " pole"]) -> Float[np.ndarray, " pole"]:
    """Q of poles: Im s / (-2 Re s); infinite without decay, 0 where nothing oscillates."""
    decays = np.real(value) < 0
    return np.where(decays, np.imag(value) / (-2 * np.where(decays, np.real(value), -1.0)), np.inf)


def real_shapes(
    motion: Complex[np.ndarray, "pole coordinate"],
) -> Float[np.ndarray, "pole coordinate"]:
    """Real shapes: complex ones at the phase of largest displacement, of the same norm."""
    turn = np.angle((motion**2).sum(1)) / 2
    shape = (motion * np.exp(-1j * turn)[:, None]).real
    size, whole = np.sqrt((shape**2).sum(1)), np.sqrt((np.abs(motion) ** 2).sum(1))
    return shape * (whole / np.where(size > 0, size, 1.0))[:, None]
