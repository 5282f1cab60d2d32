"""A linear system with losses and wire mass whose matrices do not depend on frequency.

A stiffness with a loss angle, k (1 + i phi(omega)), is replaced by springs with dashpots (Maxwell
elements) beside the spring k,

    k (1 - d) + k sum_j g_j i omega / (i omega + r_j),    g_j >= 0,

so that the loss angle is right at the modes that it damps. Relaxation also stiffens the element a
little with frequency (Kramers and Kronig); the constant d takes that back where most depends on it.
The elements stay between the bodies where the loss is, so that isolation is right together with Q,
and they can only take energy: the system is stable and passive whatever the g_j. All elements share
the rates r_j: one coordinate follows for each rate and each independent deformation of a block.

A wire with mass is reduced to the motion of its ends and its lowest modes with clamped ends (Craig
and Bampton, AIAA J. 6, 1313 (1968)): with the static stiffness S, an inertia M of the ends, and for
each mode the motion l of the ends that drives it,

    F(omega) = S - omega^2 M - sum_j omega^4 l_j l_j^T / (omega_j^2 - omega^2).

All numbers come from the exact dynamic stiffness F of the wire (`elements.dynamic_wire`). Its loss
is that of the wire without mass in the motion of the ends, and one of its own in each mode.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.dynamic_wire import TautWire
from suspension_cli.errors import InputError
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.frequency_terms import LossTerm
from suspension_cli.linear.system import LinearSystem

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

    from suspension_cli.scene.arrays import Array, Index

ABOVE = 1.5
"""Wire modes have losses up to this multiple of the highest frequency of the band; two more are
kept without."""
LOW = 0.005
"""Frequency at which the inertia of a wire is taken, over that of its first mode."""
BESIDE = 1e-4
"""Relative distance from a wire mode at which its residue and losses are taken."""
RANK = 1e-12
"""Relative eigenvalue, in units of the diagonal, below which a deformation does not exist."""
ROUNDED = 1e-13
"""Diagonal element over the largest below which it is a rounding error."""
MINOR = 3e-3
"""Share of the loss of every mode up to which the loss of an element does not matter."""
STABLE = 0.3
"""Largest share of the stiffness of a mode that is taken back at rest."""
OFF = 0.05
"""Weight of a relative change of stiffness over that of a loss angle that is off by as much."""
BETWEEN = 0.1
"""Weight of frequencies of the band over that of a mode whose loss is the element's alone."""
POINTS = 16
"""Number of these frequencies."""
RELAXATION, WIRE = "relaxation", "wire"
"""First parts of the names of coordinates that are added."""


@dataclass(frozen=True)
class Lossy:
    """A lossy part of the stiffness, rows^T rows (1 + i angle(omega)) with its elastic part.

    Attributes
    ----------
    rows
        Deformations, sqrt(N/m) per m.
    angle
        Loss angle (f,) at angular frequencies (f,), rad/s.
    stored
        Relative change of the elastic stiffness with frequency; None if there is none.
    """

    rows: Float[np.ndarray, "deformation coordinate"]
    angle: Callable[[Array], Array]
    stored: Callable[[Array], Array] | None = None


def relax(model: LinearSystem, band: tuple[float, float], density: float) -> LinearSystem:
    """Replace all terms in frequency of a system by relaxation and modes of wires.

    Parameters
    ----------
    model : LinearSystem
        Of one design, on the beam or violin model.
    band
        Lowest and highest frequency in Hz.
    density
        Relaxation rates per decade.

    Returns
    -------
    LinearSystem
        Without terms; its coordinates are those of `model`, then those of wires and relaxation.

    Raises
    ------
    InputError
        If an element gives energy instead of taking it, which no relaxation does.
    """
    low, high = 2 * np.pi * band[0], 2 * np.pi * band[1]
    system, elements = _with_wire_modes(model, ABOVE * high)
    found = eigenmodes.solve(system)
    squared = found.omega_squared
    near = (squared > 0) & (squared < (1.5 * high) ** 2)
    if not elements or not near.any():
        return system
    omega = np.sqrt(squared[near])
    shapes = np.linalg.solve(system.basis, np.pad(found.shape[near], ((0, 0), (6, 0))).T)
    first, last = min(low, omega[0]) / 10, max(high, omega[-1]) * 2
    rates = np.geomspace(first, last, 2 + int(density * np.log10(last / first)))
    return _with_relaxation(system, elements, omega, shapes, rates, (low, high))


@dataclass(frozen=True)
class _ReducedWire:
    """One part (bending in a plane, stretching, twisting) of the motion of a wire.

    Attributes
    ----------
    inertia
        M of the motion of its ends.
    drag
        Damping by gas over inertia, 1/s.
    omega, drives
        Frequency (rad/s) and l of each mode with clamped ends.
    losses
        Of each lossy section the deformations by the motion of the ends, twice the energy in a unit
        of each mode, and the loss angle.
    """

    inertia: Float[np.ndarray, "end end"]
    drag: float
    omega: Float[np.ndarray, " mode"]
    drives: Float[np.ndarray, "mode end"]
    losses: list[tuple[Array, Array, Callable[[Array], Array]]]


def _reduce(strand: TautWire, part: str, highest: float) -> _ReducedWire:
    """Reduce a wire to the motion of its ends and its modes, to the second above a frequency."""
    lossless, size = replace(strand, lossy=False), len(strand.static[part])
    omega, drives, inertia, drag = np.zeros(0), np.zeros((0, size)), np.zeros((size, size)), 0.0
    if strand.massive:
        omega = lossless.held_resonances(part, highest)
        omega = omega[: 2 + np.count_nonzero(omega < highest)]
        below, above = omega * (1 - BESIDE), omega * (1 + BESIDE)
        change = _stiffness(lossless, part, below) - _stiffness(lossless, part, above)
        factor = above**4 / (omega**2 - above**2) - below**4 / (omega**2 - below**2)
        values, vectors = np.linalg.eigh(change / factor[:, None, None])
        drives = vectors[:, :, -1] * np.sqrt(values[:, -1:])
        low = LOW * omega[:1]
        inertia = (strand.static[part] - _stiffness(lossless, part, low)[0]) / low**2
        inertia -= (drives.T * (low**2 / (omega**2 - low**2))) @ drives
        if strand.surrounded is not None:
            damped = np.imag(_stiffness(_with_losses(strand, None), part, low)[0])
            drag = float(np.trace(damped) / (low[0] * np.trace(inertia)))
    losses = []
    for number in range(len(strand.fibre.sections)):
        one = replace(_with_losses(strand, number), surrounded=None)
        rows, angle = _resting_loss(replace(one, massive=False), part)
        if len(rows):
            beside = omega * (1 - BESIDE)
            lost = np.imag(_stiffness(one, part, beside)) / angle(beside)[:, None, None]
            amplitude = beside**2 / (omega**2 - beside**2) * (drives**2).sum(1)  # of the mode
            energy = np.einsum("mi,mij,mj->m", drives, lost, drives) / amplitude**2
            losses.append((rows, np.where(omega < highest, energy, 0.0), angle))
    return _ReducedWire(inertia, drag, omega, drives, losses)


def _stiffness(
    strand: TautWire, part: str, omega: Float[np.ndarray, " frequency"]
) -> Inexact[np.ndarray, "frequency end end"]:
    return np.moveaxis(strand.at(omega)[part].stiffness, -1, 0)


def _with_losses(strand: TautWire, number: int | None) -> TautWire:
    """The wire with the losses of one section, or of none."""
    sections = tuple(
        section if n == number else replace(section, losses=())
        for n, section in enumerate(strand.fibre.sections)
    )
    return replace(strand, fibre=replace(strand.fibre, sections=sections))


def _resting_loss(
    strand: TautWire, part: str
) -> tuple[Float[np.ndarray, "deformation end"], Callable[[Array], Array]]:
    """Deformations of the one lossy section of a wire without mass, and its loss angle."""
    # bending resists slopes relative to the chord alone, other parts the difference of the ends
    length = sum(section.length for section in strand.fibre.sections)
    own = np.array([[0.0, 2.0]])
    if part.startswith("bend"):
        own = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, -2 / length, 1.0]])

    def lost(omega: Array) -> Float[np.ndarray, "own own frequency"]:
        change = np.imag(strand.at(omega)[part].change)
        return change if len(own) > 1 else change[None, :1]

    reference = lost(np.array([2 * np.pi]))[..., 0]
    scale = np.trace(reference)
    return (
        _deformations(reference, rounded=True) @ own,
        lambda omega: np.trace(lost(omega)) * np.ones(len(omega)) / scale,
    )


def _with_wire_modes(model: LinearSystem, highest: float) -> tuple[LinearSystem, list[Lossy]]:
    """Add the inertia and the modes of wires, and viscous terms; also list what is lossy."""
    groups, size = _groups(model), model.size
    mass, damping = np.zeros((size, size)), np.zeros((size, size))
    elements: list[Lossy] = []
    if model.is_lossy:
        elements.append(Lossy(_deformations(model.loss), np.ones_like))
    driven: list[Float[np.ndarray, " coordinate"]] = []  # motions that drive wire modes
    about: list[tuple[float, float, str]] = []  # frequency, drag and stage of each
    for term in model.terms:
        if isinstance(term, LossTerm):
            if term.elastic:
                elements.append(Lossy(_deformations(term.matrix), term.angle, term.storage))
            else:
                damping += term.matrix
            continue
        for part, forms in term.forms.items():
            wire = _reduce(term.strand, part, highest)
            inertia = np.einsum("wci,cd,wdj->ij", forms, wire.inertia, forms)
            mass, damping = mass + inertia, damping + wire.drag * inertia
            first, number = size + len(driven), []
            for n, drives in enumerate(wire.drives):
                for row in _combinations(drives @ forms, groups):
                    number.append(n)
                    driven.append(row)
                    about.append((wire.omega[n], wire.drag, term.stage))
            for ends, energy, angle in wire.losses:
                by_modes = np.eye(len(number), first + len(number), first)
                by_modes *= np.sqrt(energy[number])[:, None]
                rows = (ends @ forms).reshape(-1, size)
                rows = np.pad(rows, ((0, 0), (0, by_modes.shape[1] - size)))
                elements.append(Lossy(np.concatenate([rows, by_modes]), angle))
    drives = np.array(driven).reshape(-1, size)
    omega, drag = (np.array([one[n] for one in about]) for n in (0, 1))
    mass, damping = (_framed(part, groups) for part in (mass, damping))
    unit = np.diag(np.ones(len(drives)))
    names = [f"{WIRE}-{n}.{stage}" for n, (_, _, stage) in enumerate(about, 1)]
    system = replace(model.lossless, ground=None).widened(
        names,
        np.block([[mass, drives.T], [drives, unit]]),
        np.diag(np.append(np.zeros(size), omega**2)),
        np.block([[damping, (drag[:, None] * drives).T], [drag[:, None] * drives, unit * drag]]),
    )
    padded = [
        replace(one, rows=np.pad(one.rows, ((0, 0), (0, system.size - one.rows.shape[1]))))
        for one in elements
    ]
    return system, padded


def _combinations(
    driven: Float[np.ndarray, "wire coordinate"], groups: list[Index]
) -> Iterator[Float[np.ndarray, " coordinate"]]:
    """Combine equal modes of equal wires, so that each is driven by one group of coordinates."""
    for columns in groups:
        _, large, own = np.linalg.svd(driven[:, columns], full_matrices=False)
        for size, form in zip(large, own, strict=True):
            if size > np.sqrt(RANK) * np.abs(driven).max():
                row = np.zeros(driven.shape[1])
                row[columns] = size * form
                yield row


def _with_relaxation(
    system: LinearSystem,
    elements: list[Lossy],
    omega: Float[np.ndarray, " mode"],
    shapes: Float[np.ndarray, "coordinate mode"],
    rates: Float[np.ndarray, " rate"],
    band: tuple[float, float],
) -> LinearSystem:
    """Add the relaxation that gives the elements their losses in a band, rad/s."""
    # elastic energy and loss of each element in each mode
    energy = np.array([((one.rows @ shapes) ** 2).sum(0) for one in elements]) / omega**2
    angle = np.array([np.broadcast_to(one.angle(omega), omega.shape) for one in elements])
    loss = energy * angle
    total = np.maximum(loss.sum(0), 1e-12)
    strength = np.zeros((len(elements), len(rates)))
    shift, stiffer = np.zeros(len(elements)), np.zeros((len(elements), len(omega)))
    step = omega[:, None] ** 2 / (omega[:, None] ** 2 + rates**2)
    for n, one in enumerate(elements):
        if (loss[n] > MINOR * total).any():
            strength[n], shift[n] = _fit(one, omega, energy[n], loss[n] / total, rates, band)
            stored = 0.0 if one.stored is None else one.stored(omega)
            stiffer[n] = step @ strength[n] - shift[n] - stored
    # what is left of the stiffening at the modes is taken back, in all elements together
    unit, root = np.abs(stiffer).max(1), np.sqrt(total)
    parts, wanted = (energy * unit[:, None] / root).T, (energy * stiffer).sum(0) / root
    shift += unit * np.linalg.lstsq(parts, wanted, rcond=1e-2)[0]
    groups, size = _groups(system), system.size
    added = sum(-d * one.rows.T @ one.rows for d, one in zip(shift, elements, strict=True))
    follow, own_rates = _followers(elements, strength, rates, groups)
    softer = _framed(np.asarray(added), groups)
    whole = np.block([[softer + follow.T @ follow, -follow.T], [-follow, np.eye(len(follow))]])
    damping = np.diag(np.append(np.zeros(size), 1 / own_rates))
    names = [f"{RELAXATION}-{n}.{rate:.3g}" for n, rate in enumerate(own_rates, 1)]
    return system.widened(names, np.zeros_like(whole), whole, damping)


def _fit(
    one: Lossy,
    omega: Float[np.ndarray, " mode"],
    energy: Float[np.ndarray, " mode"],
    share: Float[np.ndarray, " mode"],
    rates: Float[np.ndarray, " rate"],
    band: tuple[float, float],
) -> tuple[Float[np.ndarray, " rate"], float]:
    """Fit the strengths g of relaxation, and d, to one element.

    Loss angle and, with less weight, stiffness must be right at the modes in proportion to the
    element's `share` of their loss and, with less weight, in the whole band. `energy` is that
    in the element over that of the mode.
    """
    from scipy.optimize import lsq_linear

    at = np.append(omega, np.geomspace(*band, POINTS))
    angles = np.maximum(one.angle(at), 1e-12)
    stored = np.zeros(len(at)) if one.stored is None else one.stored(at)
    weight = np.append(share, np.full(POINTS, BETWEEN)) / angles
    weight = np.append(weight, OFF * weight)
    step = 1j * at[:, None] / (1j * at[:, None] + rates)
    constant = np.append(np.zeros(len(at)), -np.ones(len(at)))
    parts = np.column_stack([np.concatenate([step.imag, step.real]), constant])
    # what is taken from the stiffness at rest must not make the design unstable
    low = np.append(np.zeros(len(rates)), -np.inf)
    high = np.append(np.full(len(rates), np.inf), STABLE / energy.max())
    wanted = np.append(angles, stored) * weight
    found = lsq_linear(parts * weight[:, None], wanted, (low, high), method="bvls").x
    return np.maximum(found[:-1], 0.0), float(found[-1])


def _followers(
    elements: list[Lossy],
    strength: Float[np.ndarray, "element rate"],
    rates: Float[np.ndarray, " rate"],
    groups: list[Index],
) -> tuple[Float[np.ndarray, "follower coordinate"], Float[np.ndarray, " follower"]]:
    """Deformations that relax, of all elements together: no more than coordinates per rate."""
    rows, own_rates = [np.zeros((0, elements[0].rows.shape[1]))], [np.zeros(0)]
    for number, rate in enumerate(rates):
        stack = np.concatenate(
            [np.sqrt(g[number]) * one.rows for g, one in zip(strength, elements, strict=True)]
        )
        for columns in groups:
            used = columns[stack[:, columns].any(0)]
            own = np.zeros((min(len(used), len(stack)), stack.shape[1]))
            own[:, used] = np.linalg.qr(stack[:, used], mode="r")
            rows.append(own[own.any(1)])
            own_rates.append(np.full(len(rows[-1]), rate))
    return np.concatenate(rows), np.concatenate(own_rates)


def _deformations(
    matrix: Float[np.ndarray, "coordinate coordinate"], *, rounded: bool = False
) -> Float[np.ndarray, "deformation coordinate"]:
    """Rows whose products add up to a positive semidefinite matrix.

    Raises `InputError` if it is not, unless only because its numbers are `rounded`.
    """
    size = np.abs(np.diag(matrix))
    real = size > ROUNDED * size.max()
    scale = np.sqrt(np.where(real, size, 1.0))
    values, vectors = np.linalg.eigh(
        np.where(np.outer(real, real), matrix, 0.0) / np.outer(scale, scale)
    )
    if not rounded and values.min(initial=0.0) < -1e-6 * np.abs(values).max():
        raise InputError.of(
            "--loss",
            "cannot be exported: an element gives energy to the motion",
            "leave --loss out, or make all stiffnesses with a loss_angle positive",
        )
    some = values > RANK * values.max(initial=0.0)
    return (vectors[:, some] * np.sqrt(values[some])).T * scale


def _groups(model: LinearSystem) -> list[Index]:
    """Groups of coordinates that do not couple, each with the support's that drive it."""
    drive = model.allowed[:, :6]
    return [np.append(np.flatnonzero(drive[block].any(0)), block) for block in model.blocks]


def _framed(
    matrix: Float[np.ndarray, "coordinate coordinate"], groups: list[Index]
) -> Float[np.ndarray, "coordinate coordinate"]:
    """A symmetric matrix with exact zeros between groups that do not couple."""
    together = np.zeros(matrix.shape, dtype=bool)
    for group in groups:
        together[np.ix_(group, group)] = True
    return np.where(together, (matrix + matrix.T) / 2, 0.0)
