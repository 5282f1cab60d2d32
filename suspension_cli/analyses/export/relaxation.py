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

All numbers come from the exact dynamic stiffness F of the wire (`elements.dynamic_wire`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.dynamic_wire import TautWire
from suspension_cli.errors import InputError, format_value
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.coordinates import AddedCoordinates
from suspension_cli.linear.matrix_terms import Damper, StructuralLoss
from suspension_cli.linear.structure import Structure
from suspension_cli.linear.system import LinearSystem
from suspension_cli.linear.wire_term import WireTerm

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

    from suspension_cli.scene.arrays import Array, Index

ABOVE = 1.5
"""Wire modes are kept up to this multiple of the highest frequency of the band; beyond, one stands
for all."""
LOW = 0.005
"""Frequency at which the inertia of a wire is taken, over that of its first mode."""
BESIDE = 1e-4
"""Relative distance from a wire mode at which its residue and losses are taken."""
RANK = 1e-12
"""Relative eigenvalue, in units of the diagonal, below which a deformation does not exist."""
ROUNDED = 1e-13
"""Diagonal element over the largest below which it is a rounding error."""
MINOR = 3e-3
"""Share of the loss of a mode below which an element's loss angle there does not matter."""
STABLE = 0.3
"""Largest share of the stiffness of a mode that is taken back at rest."""
BETWEEN = 0.1
"""Weight of a loss angle between modes, over that at a mode which loses all its energy by it."""
BESIDE_BAND = 1.3
"""Decades of rates below and above the band, see `relax`."""
MOST_STATES = 6000
"""Largest number of states that is tried: a matrix has 300 MB, and its eigenvalues take minutes."""
POINTS = 16
"""Frequencies of the band at which the loss angle of an element must be right."""
RELAXATION = "relaxation"
WIRE = "wire"
"""First parts of the names of coordinates that are added."""


@dataclass(frozen=True)
class Lossy:
    """A lossy part of the stiffness, rows^T rows (1 + i angle(omega)) with its elastic part.

    Rows are deformations, sqrt(N/m) per m; `angle` is a function of rad/s, as is `stored`, the
    relative change of the elastic stiffness.
    """

    rows: Float[np.ndarray, "deformation coordinate"]
    angle: Callable[[Array], Array]
    stored: Callable[[Array], Array] = np.zeros_like


def relax(model: LinearSystem, band: tuple[float, float], density: float) -> LinearSystem:
    """Replace all terms in frequency of a system by relaxation and modes of wires.

    `model` is that of one design, on the beam or violin model, `band` in Hz, `density` in rates per
    decade. The coordinates of wires and of relaxation follow those of the model. Raises
    `InputError` if an element gives energy instead of taking it, which no relaxation does.
    """
    low = 2 * np.pi * band[0]
    high = 2 * np.pi * band[1]
    system, elements = _with_wire_modes(model, ABOVE * high)
    found = eigenmodes.solve(system)
    squared = found.omega_squared
    near = (squared > 0) & (squared < (1.5 * high) ** 2)
    if not elements or not near.any():
        return system
    omega = np.sqrt(squared[near])
    shapes = np.linalg.solve(system.basis, np.pad(found.shape[near], ((0, 0), (6, 0))).T)
    first = min(low, omega[0]) / 10
    last = max(high, omega[-1]) * 2
    rates = np.geomspace(first, last, 2 + int(density * np.log10(last / first)))
    return _with_relaxation(system, elements, omega, shapes, rates, (low, high))


def check_size(model: LinearSystem, band: tuple[float, float], density: float) -> None:
    """Raise `InputError` if a band (Hz) needs more states than can be computed with."""

    def fits(low: float, high: float) -> bool:
        return _estimate_states(model, (low, high), density) <= MOST_STATES

    if fits(*band):
        return
    low, high = band
    count = _estimate_states(model, band, density)
    if fits(max(low, high / 10), high):
        remedy = "begin it at a higher frequency"
    else:
        good = low
        bad = high
        for _ in range(30):
            middle = float(np.sqrt(good) * np.sqrt(bad))
            good, bad = (middle, bad) if fits(low, middle) else (good, middle)
        remedy = f"end it at {float(f'{0.95 * good:.2g}'):g} Hz or below"
    problem = (
        f"needs about {count:,} states for losses and modes of wires, which take too much memory"
        f" and time (at most {MOST_STATES:,})"
    )
    raise InputError.of("--band", problem, remedy, format_value(f"{low:g}:{high:g}"))


def _estimate_states(model: LinearSystem, band: tuple[float, float], density: float) -> int:
    """Estimate the number of states, from that of the modes of wires and of relaxation rates.

    All coordinates have two, and one more for each rate.
    """
    coordinates = model.size + count_wire_modes(model, ABOVE * band[1])
    decades = np.log10(band[1]) - np.log10(band[0]) + BESIDE_BAND
    return int(coordinates * (2 + 2 + density * decades))


def count_wire_modes(model: LinearSystem, highest: float) -> int:
    """Count the modes of all wires with clamped ends below a frequency, Hz."""
    omega = np.array([2 * np.pi * highest])
    count = 0
    for term in model.terms:
        if isinstance(term, WireTerm) and term.strand.massive:
            for part, forms in term.forms.items():
                count += len(forms) * int(term.strand.resonances_below(omega, (part,))[0])
    return count


@dataclass(frozen=True)
class _ReducedWire:
    """One part (bending in a plane, stretching, twisting) of the motion of a wire.

    It has the inertia M of its ends; the damping by gas over inertia, 1/s; frequency (rad/s) and l
    of each mode with clamped ends; and of each lossy section deformations by the motion of the
    ends, the energy of the modes in it, and its loss angle.
    """

    inertia: Float[np.ndarray, "end end"]
    drag: float
    modes: list[tuple[float, Float[np.ndarray, " end"]]]
    losses: list[tuple[Array, Array, Callable[[Array], Array]]]


def _reduce(strand: TautWire, part: str, highest: float) -> _ReducedWire:
    """Reduce a wire to the motion of its ends and its modes up to a frequency, rad/s."""
    size = len(strand.static[part])
    inertia = np.zeros((size, size))
    modes = []
    first = 0.0
    beyond_modes: list[tuple[float, Float[np.ndarray, " end"]]] = []
    lossless = replace(strand, lossy=False)

    def stiffness(wire: TautWire, omega: list[float]) -> Complex[np.ndarray, "frequency end end"]:
        return np.moveaxis(wire.at(np.array(omega))[part].stiffness, -1, 0)

    def inertia_without_modes(at: float) -> Float[np.ndarray, "end end"]:
        rest = (strand.static[part] - np.real(stiffness(lossless, [at])[0])) / at**2
        for omega, drives in modes:
            rest -= at**2 * np.outer(drives, drives) / (omega**2 - at**2)
        return rest

    if strand.massive:
        first, *_ = found = lossless.held_resonances(part, highest)
        *kept, beyond = found[: 1 + np.count_nonzero(found < highest)]
        for omega in kept:
            beside = [omega * (1 - BESIDE), omega * (1 + BESIDE)]
            low, high = stiffness(lossless, beside)
            share = [-(w**4) / (omega**2 - w**2) for w in beside]
            values, vectors = np.linalg.eigh((low - high) / (share[0] - share[1]))
            modes.append((omega, vectors[:, -1] * np.sqrt(values[-1])))
        inertia = inertia_without_modes(LOW * first)
        top = highest / ABOVE  # one mode stands for all beyond, right there
        rest = (inertia_without_modes(top) - inertia) * (beyond**2 / top**2 - 1)
        values, vectors = np.linalg.eigh(rest)
        for value, vector in zip(values, vectors.T, strict=True):
            if value > 1e-3 * values[-1]:
                beyond_modes.append((beyond, vector * np.sqrt(value)))
    drag = 0.0
    losses = []
    if strand.massive and strand.surrounded is not None:
        at = modes[0][0] if modes else first
        elastic = _with_loss_of(strand, None)
        damped = np.imag(stiffness(elastic, [LOW * at])[0])
        drag = float(np.trace(damped) / (LOW * at * np.trace(inertia)))
    for number in range(len(strand.fibre.sections)):
        one = replace(_with_loss_of(strand, number), surrounded=None)
        rows, angle = _section_loss(one, part)
        if not len(rows):
            continue
        energy = np.zeros(len(modes) + len(beyond_modes))
        for n, (omega, drives) in enumerate(modes):
            # beside its resonance a mode moves by a = omega^2 / (omega_j^2 - omega^2) times l . x
            sides = omega * (1 + BESIDE * np.array([-1, 1]))
            a = sides**2 / (omega**2 - sides**2)
            lost = np.imag(stiffness(one, [*sides]) @ drives) @ drives / angle(sides)
            energy[n] = max((lost / (a * (drives @ drives)) ** 2).mean(), 0.0)
        losses.append((rows, energy, angle))
    return _ReducedWire(inertia, drag, modes + beyond_modes, losses)


def _with_loss_of(strand: TautWire, number: int | None) -> TautWire:
    """The wire with the losses of one section of its fibre, or of none."""
    sections = tuple(
        section if n == number else replace(section, losses=())
        for n, section in enumerate(strand.fibre.sections)
    )
    return replace(strand, fibre=replace(strand.fibre, sections=sections))


def _section_loss(
    strand: TautWire, part: str
) -> tuple[Float[np.ndarray, "deformation end"], Callable[[Array], Array]]:
    """Deformations of the one section of a wire that is lossy, and its loss angle."""
    still = replace(strand, massive=False)
    to_own = np.eye(len(strand.static[part]))
    length = sum(section.length for section in strand.fibre.sections)
    bends = len(to_own) == 4
    if bends:  # it resists slopes relative to the chord alone
        to_own = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, -2 / length, 1.0]])

    def loss(omega: Array) -> Float[np.ndarray, "own own frequency"]:
        here = still.at(omega)[part]
        return np.imag(here.change if bends else here.stiffness)

    reference = loss(np.array([2 * np.pi]))[..., 0]
    scale = float(np.trace(reference))

    def angle(omega: Array) -> Array:
        return np.trace(loss(omega)) * np.ones(len(omega)) / scale

    if not scale > 0:
        return np.zeros((0, to_own.shape[1])), angle
    return _deformations(reference, rounded=True) @ to_own, angle


def _with_wire_modes(model: LinearSystem, highest: float) -> tuple[LinearSystem, list[Lossy]]:
    """Add the inertia and the modes of wires, and viscous terms; also list what is lossy."""
    groups = _groups(model)
    size = model.size
    mass = np.zeros((size, size))
    damping = np.zeros((size, size))
    elements: list[Lossy] = []
    if model.is_lossy:
        elements.append(Lossy(_deformations(model.loss), np.ones_like))
    driven: list[Float[np.ndarray, " coordinate"]] = []  # motions that drive wire modes
    about: list[tuple[float, float, str]] = []  # frequency, drag and stage of each
    for term in model.terms:
        if isinstance(term, StructuralLoss):
            elements.append(Lossy(_deformations(term.matrix), term.angle, term.stored))
        elif isinstance(term, Damper):
            damping += term.matrix
        if not isinstance(term, WireTerm):
            continue
        for part, forms in term.forms.items():
            wire = _reduce(term.strand, part, highest)
            inertia = np.einsum("wci,cd,wdj->ij", forms, wire.inertia, forms)
            mass = mass + inertia
            damping = damping + wire.drag * inertia
            own: list[tuple[int, int, Array]] = []  # coordinate, mode, share of each wire
            for number, (omega, drives) in enumerate(wire.modes):
                for share, row in _combinations(drives @ forms, groups):
                    own.append((size + len(driven), number, share))
                    driven.append(row)
                    about.append((omega, wire.drag, term.stage))
            for ends, energy, angle in wire.losses:
                count = len(ends)
                rows = np.zeros((len(forms), count + len(energy), size + len(driven)))
                rows[:, :count, :size] = ends @ forms
                for place, number, share in own:
                    rows[:, count + number, place] = np.sqrt(energy[number]) * share
                elements.append(Lossy(rows.reshape(-1, rows.shape[-1]), angle))
    drives = np.array(driven).reshape(-1, size)
    omega, drag = (np.array([one[n] for one in about]) for n in (0, 1))
    mass, damping = (_framed(part, groups) for part in (mass, damping))
    unit = np.diag(np.ones(len(drives)))
    resisted = drag[:, None] * drives
    modes = AddedCoordinates(
        name=tuple(f"{WIRE}-{n}.{stage}" for n, (_, _, stage) in enumerate(about, 1)),
        unit=("m sqrt(kg)",) * len(about),  # of unit mass
        momentum_unit=("m sqrt(kg)/s",) * len(about),
        mass=np.block([[mass, drives.T], [drives, unit]]),
        stiffness=np.diag(np.append(np.zeros(size), omega**2)),
        damping=np.block([[damping, resisted.T], [resisted, unit * drag]]),
    )
    lossless = replace(model.lossless, terms=model.terms_with_states, ground=None)
    system = lossless.widened(modes)
    padded = [
        replace(one, rows=np.pad(one.rows, ((0, 0), (0, system.size - one.rows.shape[1]))))
        for one in elements
    ]
    return system, padded


def _combinations(
    driven: Float[np.ndarray, "wire coordinate"], groups: list[Index]
) -> Iterator[tuple[Float[np.ndarray, " wire"], Float[np.ndarray, " coordinate"]]]:
    """Combine equal modes of equal wires, so that each is driven by one group of coordinates."""
    for columns in groups:
        own, large, _ = np.linalg.svd(driven[:, columns], full_matrices=False)
        for share in own.T[large > np.sqrt(RANK) * np.abs(driven).max()]:
            row = np.zeros(driven.shape[1])
            row[columns] = share @ driven[:, columns]
            yield share, row


def _with_relaxation(
    system: LinearSystem,
    elements: list[Lossy],
    omega: Float[np.ndarray, " mode"],
    shapes: Float[np.ndarray, "coordinate mode"],
    rates: Float[np.ndarray, " rate"],
    band: tuple[float, float],
) -> LinearSystem:
    """Add the relaxation that gives the elements their losses in a band, rad/s."""
    from scipy.optimize import nnls

    # elastic energy and loss of each element in each mode
    energy = np.array([((one.rows @ shapes) ** 2).sum(0) for one in elements]) / omega**2
    angle = np.array([np.broadcast_to(one.angle(omega), omega.shape) for one in elements])
    loss = energy * angle
    total = np.maximum(loss.sum(0), 1e-12)
    every = np.append(omega, np.geomspace(*band, POINTS))
    lag = every[:, None] * rates / (every[:, None] ** 2 + rates**2)
    near = np.clip(omega, *band)  # what a mode beside the band does in it matters at its end
    step = near[:, None] ** 2 / (near[:, None] ** 2 + rates**2)
    strength = np.zeros((len(elements), len(rates)))
    stiffer = np.zeros(energy.shape)
    for n, one in enumerate(elements):
        if (loss[n] > MINOR * total).any():
            weight = np.append(loss[n] / total, np.full(POINTS, BETWEEN))
            weight /= np.maximum(one.angle(every), 1e-12)
            strength[n] = nnls(lag * weight[:, None], one.angle(every) * weight)[0]
            stiffer[n] = step @ strength[n] - one.stored(near)
    # take back what the modes have become stiffer by: each element where it stores most energy,
    # the rest in all together, but not so much that the design becomes unstable
    shift = (energy**2 * stiffer).sum(1) / np.maximum((energy**2).sum(1), 1e-300)
    stiffer -= shift[:, None]
    unit = np.abs(stiffer).max(1)
    root = np.sqrt(total)
    parts = (energy * unit[:, None] / root).T
    wanted = (energy * stiffer).sum(0) / root
    shift += unit * np.linalg.lstsq(parts, wanted, rcond=1e-2)[0]
    shift = np.minimum(shift, STABLE / np.maximum(energy.max(1), 1e-300))
    groups = _groups(system)
    size = system.size
    added = sum(-d * one.rows.T @ one.rows for d, one in zip(shift, elements, strict=True))
    follow, own_rates = _followers(elements, strength, rates, groups)
    softer = _framed(np.asarray(added), groups)
    whole = np.block([[softer + follow.T @ follow, -follow.T], [-follow, np.eye(len(follow))]])
    damping = np.diag(np.append(np.zeros(size), 1 / own_rates))
    relaxing = AddedCoordinates(
        name=tuple(f"{RELAXATION}-{n}.{rate:.3g}" for n, rate in enumerate(own_rates, 1)),
        unit=("sqrt(J)",) * len(own_rates),  # y^2 / 2 is their energy
        momentum_unit=("s sqrt(J)",) * len(own_rates),
        mass=np.zeros_like(whole),
        stiffness=whole,
        damping=damping,
    )
    return system.widened(relaxing)


def _followers(
    elements: list[Lossy],
    strength: Float[np.ndarray, "element rate"],
    rates: Float[np.ndarray, " rate"],
    groups: list[Index],
) -> tuple[Float[np.ndarray, "follower coordinate"], Float[np.ndarray, " follower"]]:
    """Deformations that relax, of all elements together: no more than coordinates per rate."""
    rows = [np.zeros((0, elements[0].rows.shape[1]))]
    own_rates = [np.zeros(0)]
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
    return [
        np.append(np.flatnonzero(drive[block].any(0)), block) for block in Structure(model).blocks
    ]


def _framed(
    matrix: Float[np.ndarray, "coordinate coordinate"], groups: list[Index]
) -> Float[np.ndarray, "coordinate coordinate"]:
    """A symmetric matrix with exact zeros between groups that do not couple."""
    together = np.zeros(matrix.shape, dtype=bool)
    for group in groups:
        together[np.ix_(group, group)] = True
    return np.where(together, (matrix + matrix.T) / 2, 0.0)
