"""Modes with dampers and losses of any size, as poles of a suspension.

A pole s = sigma + i omega has a shape x with Z(s) x = 0, Z the dynamic stiffness (`modal_basis`).
Weakly damped modes are followed from the undamped ones (`weak_damping`); the others start from a
quadratic eigenvalue problem (`strong_damping`).

A pole that oscillates has the frequency |s| / 2 pi and Q = Im s / (-2 Re s), which is pi times the
number of oscillations in which the amplitude of a ring-down falls to 1/e. For m x'' + k (1 + i phi)
x = 0, Q = 1 / (2 tan(atan(phi) / 2)), 10.025 for phi = 0.1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.linear import eigenmodes as undamped
from suspension_cli.linear import quality, strong_damping, weak_damping
from suspension_cli.linear.connected_groups import connected_groups
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.elastic_losses import ElasticLosses, transform
from suspension_cli.linear.frequency_terms import LossTerm, is_massive
from suspension_cli.linear.modal_basis import Basis
from suspension_cli.linear.poles import ROUNDING
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

ALIKE = 1e-12
"""Relative difference of omega^2 that may be a rounding error."""
ROUNDED = 1e-3
"""Rounding error of the bodies' share of energy, of modes of the highest Q."""
UNDAMPED = 1e-24
"""Fraction of the largest damping below which a rigid mode counts as undamped."""


@dataclass(frozen=True)
class Poles:
    """Poles (rad/s), one of each conjugate pair, and their shapes in coordinates of the basis."""

    value: Complex[np.ndarray, " pole"]
    motion: Complex[np.ndarray, "pole coordinate"]


def find_poles(basis: Basis) -> Poles:
    """Find all poles of a system in the basis of its undamped modes.

    A rigid mode has one pole, 0. Of an unstable mode only the growing pole counts, not the decaying
    one at about the opposite value.
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
    groups, light = weak_damping.group_modes(basis)
    values, motions = weak_damping.follow_poles(
        basis, [group for group in groups if light[group].all()]
    )
    if light[basis.inertia > 0].all() and not basis.viscous[basis.inertia == 0].any():
        return Poles(values, motions)
    strong, moving = strong_damping.solve_strong(basis, values)
    return Poles(np.concatenate([values, strong]), np.concatenate([motions, moving]))


def _split_coupled(basis: Basis) -> list[Int[np.ndarray, " _"]]:
    """Split coordinates into groups that losses do not couple."""
    omega = np.sort(np.sqrt(np.abs(basis.stiffness[basis.inertia > 0])))
    omega = omega[omega > 0]
    probes = 1j * (omega[[0, len(omega) // 2, -1]] if len(omega) else np.ones(1))
    return connected_groups((basis.losses(probes) != 0).any(0))


def solve(model: LinearSystem, found: Modes) -> Modes:
    """Solve for modes with dampers and losses of any size, from the undamped modes `found`.

    For a system without batch axes. Modes that do not oscillate are first: unstable, rigid, then
    overdamped by decay rate. With wire mass these are the modes of bodies alone, each followed from
    the one without, if `are_poles`; a wire's mass acts on the stretching of its even and odd motion
    apart.
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


def are_poles(found: Modes) -> bool:
    """Whether poles of bodies on wires with mass are ones: the bodies' share of energy is below 1.

    An iteration that has lost its pole ends where this share is anything.
    """
    share = found.energy.sum((1, 2)) + found.tip_energy.sum(1)
    return bool((share < 1 + ROUNDED).all())


def _build_basis(
    model: LinearSystem,
    group: Int[np.ndarray, " own"],
    squared: Float[np.ndarray, " mode"],
    shapes: Float[np.ndarray, "mode own"],
) -> tuple[Basis, Float[np.ndarray, "all own"]]:
    """Transform a block to its modes and massless directions; also return the basis."""
    light = group[model.massless[group]]
    own, directions = np.linalg.eigh(model.stiffness[np.ix_(light, light)])
    added = np.zeros((len(light), len(group)))
    added[:, model.massless[group]] = (directions / np.sqrt(np.abs(own))).T
    square = np.ix_(group, group)
    moves = np.concatenate([_decouple(squared, shapes, model.stiffness[square]), added])
    elastic = [term for term in model.terms if not isinstance(term, LossTerm) or term.elastic]
    constant = (
        np.zeros((len(moves),) * 2, dtype=complex)
        if model.lossy is None
        else 1j * (moves @ np.imag(model.lossy[square]) @ moves.T)
    )
    parts = [(term, transform(term.all_matrices, moves, group)) for term in elastic]
    damping = moves @ damping_matrix(model)[square] @ moves.T
    return Basis(
        np.concatenate([squared, np.sign(own)]),
        np.repeat([1.0, 0.0], [len(shapes), len(light)]),
        damping,
        np.arange(len(moves)),
        ElasticLosses(constant, np.sqrt(squared[squared > 0]), parts),
    ), moves


def _decouple(
    squared: Float[np.ndarray, " mode"],
    shapes: Float[np.ndarray, "mode own"],
    stiffness: Float[np.ndarray, "own own"],
) -> Float[np.ndarray, "mode own"]:
    """Decouple shapes of modes that are nearly degenerate in omega^2.

    `eigenmodes.solve` gives combinations that move few coordinates, which the stiffness couples.
    """
    result = shapes.copy()
    apart = np.diff(squared) > undamped.DEGENERATE * np.abs(squared[1:])
    for group in np.split(np.arange(len(squared)), np.flatnonzero(apart) + 1):
        values = squared[group]
        if len(group) > 1 and values[-1] - values[0] > ALIKE * abs(values[-1]):
            _, turn = np.linalg.eigh(shapes[group] @ stiffness @ shapes[group].T)
            result[group] = turn.T @ shapes[group]
    return result


def damping_matrix(model: LinearSystem) -> Float[np.ndarray, "coordinate coordinate"]:
    """Damping matrix C of dampers and of gas around bodies, N s/m."""
    return model.damping + sum(
        (term.matrix for term in model.terms if isinstance(term, LossTerm) and not term.elastic),
        np.zeros(model.damping.shape),
    )


def _mark_lossy(basis: Basis) -> Bool[np.ndarray, " coordinate"]:
    """Mark the coordinates of a basis that losses act on.

    On rigid modes only dampers act; massless coordinates always count.
    """
    size = np.sqrt(np.abs(basis.stiffness))
    losses = np.abs(basis.own_losses(1j * np.where(size > 0, size, 1.0)).diagonal())
    resisted = np.abs(basis.viscous.diagonal())
    return (basis.inertia == 0) | np.where(
        size > 0,
        losses > quality.NOTHING * size**2,
        resisted > UNDAMPED * resisted.max(initial=0.0),
    )


def _recompute_decay(
    model: LinearSystem,
    value: Complex[np.ndarray, " pole"],
    motion: Complex[np.ndarray, "pole coordinate"],
) -> tuple[
    Complex[np.ndarray, " pole"],
    Complex[np.ndarray, "pole coordinate"],
    Float[np.ndarray, " pole"],
    Float[np.ndarray, " pole"],
]:
    """Recompute the decay of poles from the dissipation of their shapes.

    x^H Z x = 0 has the imaginary part x^H Im(L) x + omega x^H C x + 2 sigma omega x^H M x = 0, in
    which nothing cancels. Also returns the shapes, of unit modal mass, twice the energy in lossy
    elements, and the fraction of the kinetic energy that is not in wires, which M lacks: x^H M x
    over -x^H Im(L + omega C) x / 2 sigma omega.
    """
    mass = sum(quality.quadratic_form(model.mass, part) for part in _parts(motion))
    motion = motion / np.sqrt(np.abs(mass))[:, None]
    found = [
        quality.dissipation(model, np.imag(value), part, quality.end_motions(model, part))
        for part in _parts(motion)
    ]
    lost, elastic = (np.sum(both, axis=0) for both in zip(*found, strict=True))
    oscillates = np.imag(value) > 0
    omega = np.where(oscillates, np.imag(value), 1.0)
    sigma = np.where(np.abs(lost) > quality.NOTHING * omega**2, -lost / (2 * omega), 0.0)
    sigma = np.where(sigma > ROUNDING * omega, sigma, np.minimum(sigma, 0.0))
    share = np.ones(len(value))
    if any(is_massive(term) for term in model.terms):
        share[oscillates] = (
            np.real(value[oscillates]) / np.where(sigma == 0, np.nan, sigma)[oscillates]
        )
    pole = np.where(oscillates, share * sigma + 1j * np.imag(value), value)
    return pole, motion, elastic * share, share


def _parts(
    motion: Complex[np.ndarray, "pole coordinate"],
) -> tuple[Float[np.ndarray, "pole coordinate"], Float[np.ndarray, "pole coordinate"]]:
    """Real and imaginary part: x^H A x with real A is the sum of its values for both."""
    return np.real(motion), np.imag(motion)


def _build_modes(
    model: LinearSystem,
    found: Modes,
    plain: Bool[np.ndarray, " mode"],
    value: Complex[np.ndarray, " pole"],
    motion: Complex[np.ndarray, "pole coordinate"],
    elastic: Float[np.ndarray, " pole"],
    share: Float[np.ndarray, " pole"],
) -> Modes:
    """Build the modes, ascending, from poles and the undamped modes to keep (`plain`)."""
    oscillates = np.imag(value) > 0
    decay = np.where(oscillates, -np.real(value), np.maximum(-np.real(value), 0.0)) + 0.0
    squared = np.where(
        oscillates, np.abs(value) ** 2, np.where(np.real(value) > 0, -(np.real(value) ** 2), 0.0)
    )
    energy, tips = mean_energies(model, motion)
    shape = real_shapes(motion) @ model.basis.T
    known = oscillates & quality.knows_energy(model)
    new = {
        "omega_squared": squared,
        "shape": undamped.fix_signs(shape, np.concatenate([energy, tips], axis=1))[:, 6:],
        "energy": (share[:, None] * energy).reshape(len(shape), -1, 6),
        "tip_energy": share[:, None] * tips,
        "block": model.member[np.abs(motion).argmax(1)],
        "q": quality_factor(value),
        "dilution": np.where(known, quality.safe_ratio(np.abs(value) ** 2, elastic), np.nan),
        "wire_energy": np.zeros((len(value), 0)),
        "order": np.zeros(len(value), dtype=np.intp),
        "decay_rate": decay,
    }
    return merge_modes(found, plain, new)


def mean_energies(
    model: LinearSystem, motion: Complex[np.ndarray, "pole coordinate"]
) -> tuple[Float[np.ndarray, "pole moving"], Float[np.ndarray, "pole tip"]]:
    """Fractions of the mean kinetic energy, as `eigenmodes.energy_fractions`, of complex shapes."""
    bodies = 6 * len(model.body)
    total, energy = np.zeros(len(motion)), np.zeros((len(motion), model.size - 6))
    for part in _parts(motion):
        weight = quality.quadratic_form(model.mass, part)
        moves = weight > 0
        total[moves] += weight[moves]
        own = np.concatenate(undamped.energy_fractions(model, part[moves]), axis=1)
        energy[moves] += weight[moves, None] * own
    energy /= total[:, None]
    return energy[:, :bodies], energy[:, bodies:]


def merge_modes(found: Modes, kept: Bool[np.ndarray, " mode"], new: dict[str, np.ndarray]) -> Modes:
    """Merge kept modes with new ones, by omega^2, then by decay if overdamped.

    `new` has attributes of `Modes` with one entry per new mode. Modes of one frequency keep their
    order.
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
