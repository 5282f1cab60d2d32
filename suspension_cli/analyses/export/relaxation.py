"""A linear system with losses and wire mass whose matrices do not depend on frequency.

A stiffness with a loss angle, k (1 + i phi(omega)), is replaced by springs with dashpots (Maxwell
elements) beside the spring k,

    k (1 - d) + k sum_j g_j i omega / (i omega + r_j),    g_j >= 0,

and by a dashpot beside it, which has no state. Relaxation also stiffens the element a little with
frequency (Kramers and Kronig); the constant d takes that back where most depends on it. The
elements stay between the bodies where the loss is, so that isolation is right together with Q, and
they can only take energy: the system is passive whatever the g_j, and stable unless d takes too
much (`Candidates.stable`). Which of these are used, and how strong they are, follows from the
responses that are asked for (`state_choice`).

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
POINTS = 16
"""Frequencies of the band at which the size of a loss is taken."""
DENSITY = 3
"""Relaxation rates per decade to choose from."""
DECADES = 20
"""Most decades of a band, in which rates of relaxation are chosen."""
MOST_STATES = 6000
"""Largest number of states that is tried: a matrix has 300 MB, and its eigenvalues take minutes."""
RELAXATION = "relaxation"
WIRE = "wire"
"""First parts of the names of coordinates that are added, and kinds of candidates."""
DASHPOT = "dashpot"
SOFTER = "softer"
"""Kinds of candidates without states."""


@dataclass(frozen=True)
class Lossy:
    """A lossy part of the stiffness, rows^T rows (1 + i angle(omega)) with its elastic part.

    Rows are deformations, sqrt(N/m) per m; `angle` is a function of rad/s, as is `stored`, the
    relative change of the elastic stiffness.
    """

    rows: Float[np.ndarray, "deformation coordinate"]
    angle: Callable[[Array], Array]
    stored: Callable[[Array], Array] = np.zeros_like

    def at(self, omega: Array) -> Complex[np.ndarray, " frequency"]:
        """Change of the stiffness, relative to its elastic part, at frequencies in rad/s."""
        return self.stored(omega) + 1j * self.angle(omega)

    def largest(self, omega: Array) -> float:
        """Largest magnitude of the change at some frequencies in rad/s."""
        return float(np.abs(self.at(omega)).max())


@dataclass(frozen=True)
class Candidate:
    """What may be added to a system: a stiffness f(omega) u^T u along one deformation.

    Attributes
    ----------
    row
        The deformation u of the coordinates of the system, sqrt(N/m) per m; of a mode of a wire
        the motion l that drives it, sqrt(kg).
    kind
        One of `RELAXATION` (a spring behind a dashpot), `DASHPOT`, `SOFTER` and `WIRE`.
    rate
        rad/s, of relaxation; angular frequency of a mode of a wire.
    drag, loss
        Damping of a mode of a wire by gas and by its losses, 1/s.
    stage
        That of the wire.
    """

    row: Float[np.ndarray, " coordinate"]
    kind: str
    rate: float = 1.0
    drag: float = 0.0
    loss: float = 0.0
    stage: str = ""

    @property
    def states(self) -> int:
        """Number of states that it adds."""
        return {RELAXATION: 1, WIRE: 2}.get(self.kind, 0)

    def at(self, omega: Array) -> Complex[np.ndarray, " frequency"]:
        """Evaluate f at frequencies in rad/s."""
        s = 1j * omega
        if self.kind == WIRE:
            pushed = s**2 + s * self.drag
            return -(pushed**2) / (self.rate**2 + s**2 + s * (self.drag + self.loss))
        if self.kind == RELAXATION:
            return s / (s + self.rate)
        if self.kind == DASHPOT:
            return s / self.rate
        return np.full(len(omega), -1.0, dtype=complex)


@dataclass(frozen=True)
class Candidates:
    """A system of bodies without losses, and all that may be added to it.

    Attributes
    ----------
    system
        The system, with the inertia of wires and with dampers.
    groups
        Candidates of each group of coordinates that couple.
    losses
        Losses of all groups.
    lossy_rows
        Deformations of each loss in each group, [group][loss].
    """

    system: LinearSystem
    groups: list[list[Candidate]]
    losses: list[Lossy]
    lossy_rows: list[list[Float[np.ndarray, "deformation coordinate"]]]

    def count_states(self, strengths: list[Array]) -> int:
        """Count the states that candidates of given strengths add."""
        return sum(
            one.states
            for group, strength in zip(self.groups, strengths, strict=True)
            for one, g in zip(group, strength, strict=True)
            if g > 0
        )

    def stable(self, steps: list[list[Array]]) -> list[list[Array]]:
        """Return the choices of strengths that keep the system stable; at least that of none."""
        none = [np.zeros(len(group)) for group in self.groups]
        return [one for one in steps if self._is_stable(one)] or [none]

    def _is_stable(self, strengths: list[Array]) -> bool:
        """Whether candidates of given strengths leave the static stiffness positive where it is."""
        stiffness = self.system.stiffness[6:, 6:]
        scale = np.sqrt(np.maximum(np.abs(np.diag(stiffness)), 1e-300))
        softer = np.zeros(stiffness.shape)
        for group, strength in zip(self.groups, strengths, strict=True):
            for one, g in zip(group, strength, strict=True):
                if one.kind == SOFTER and g > 0:
                    softer += g * np.outer(one.row[6:], one.row[6:])
        both = np.array([stiffness, stiffness - softer]) / np.outer(scale, scale)
        before, after = np.count_nonzero(np.linalg.eigvalsh(both) < -RANK, axis=1)
        return bool(before == after)

    def build(self, strengths: list[Array]) -> LinearSystem:
        """Build the system with candidates of given strengths (0: left out) of each group.

        The coordinates of wires and of relaxation follow those of the bodies.
        """
        chosen = [
            (replace(one, row=np.sqrt(g) * one.row))
            for group, strength in zip(self.groups, strengths, strict=True)
            for one, g in zip(group, strength, strict=True)
            if g > 0
        ]
        size = self.system.size
        change = np.zeros((size, size))
        damping = np.zeros((size, size))
        for one in chosen:
            if one.kind == SOFTER:
                change -= np.outer(one.row, one.row)
            elif one.kind == DASHPOT:
                damping += np.outer(one.row, one.row) / one.rate
        wires = [one for one in chosen if one.kind == WIRE]
        relaxing = [one for one in chosen if one.kind == RELAXATION]
        drives = np.array([one.row for one in wires]).reshape(-1, size)
        follow = np.array([one.row for one in relaxing]).reshape(-1, size)
        count = len(relaxing)
        omega = np.array([one.rate for one in wires])
        drag = np.array([one.drag for one in wires])
        decay = np.array([one.drag + one.loss for one in wires])
        rates = np.array([one.rate for one in relaxing])
        resisted = drag[:, None] * drives
        groups = _groups(self.system)
        change, damping = (_framed(part, groups) for part in (change, damping))
        unit = np.eye(len(wires))
        stiffness = np.block([[change + follow.T @ follow, -follow.T], [-follow, np.eye(count)]])
        first = size + len(wires)
        around = np.r_[:size, first : first + count]
        whole = np.diag(np.concatenate([np.zeros(size), omega**2, np.zeros(count)]))
        whole[np.ix_(around, around)] += stiffness
        mass = np.block([[np.zeros((size, size)), drives.T], [drives, unit]])
        resist = np.block([[damping, resisted.T], [resisted, np.diag(decay)]])
        resist = np.pad(resist, (0, count))
        own = np.arange(first, first + count)
        resist[own, own] = 1 / rates
        names = [f"{WIRE}-{n}.{one.stage}" for n, one in enumerate(wires, 1)]
        names += [f"{RELAXATION}-{n}.{rate:.3g}" for n, rate in enumerate(rates, 1)]
        added = AddedCoordinates(
            name=tuple(names),
            # modes of unit mass; of a relaxation y, y^2 / 2 is its energy
            unit=("m sqrt(kg)",) * len(wires) + ("sqrt(J)",) * count,
            momentum_unit=("m sqrt(kg)/s",) * len(wires) + ("s sqrt(J)",) * count,
            mass=np.pad(mass, (0, count)),
            stiffness=whole,
            damping=resist,
        )
        return self.system.widened(added)


def list_candidates(model: LinearSystem, band: tuple[float, float]) -> Candidates:
    """List what may stand for the losses and the mass of wires of a system in a band, Hz.

    `model` is that of one design, on the beam or violin model. Raises `InputError` if an element
    gives energy instead of taking it, which no relaxation does.
    """
    low = 2 * np.pi * band[0]
    high = 2 * np.pi * band[1]
    system, families, wires = _without_losses(model, ABOVE * high)
    rates = np.geomspace(low / 10, 10 * high, 1 + int(DENSITY * np.log10(100 * high / low)))
    middle = float(np.sqrt(low * high))
    omega = np.geomspace(low, high, POINTS)
    groups = []
    lossy_rows = []
    losses = [one for family in families for one in family]
    sizes = [[one.largest(omega) for one in family] for family in families]
    for columns in _groups(system):
        own = [one for one in wires if one.row[columns].any()]
        for family, size in zip(families, sizes, strict=True):
            rows = [np.sqrt(most) * one.rows for one, most in zip(family, size, strict=True)]
            for row in _within(np.concatenate(rows), columns):
                own += [Candidate(row, RELAXATION, rate) for rate in rates]
                own.append(Candidate(row, SOFTER))
                if not system.massless[row != 0].any():
                    own.append(Candidate(row, DASHPOT, middle))
        groups.append(own)
        lossy_rows.append([_within(one.rows, columns) for one in losses])
    return Candidates(system, groups, losses, lossy_rows)


def _within(
    rows: Float[np.ndarray, "deformation coordinate"], columns: Index
) -> Float[np.ndarray, "independent coordinate"]:
    """Independent deformations of a group of coordinates with the same stiffness there."""
    _, large, directions = np.linalg.svd(rows[:, columns], full_matrices=False)
    some = large > np.sqrt(RANK) * np.abs(rows).max(initial=0.0)
    result = np.zeros((np.count_nonzero(some), rows.shape[1]))
    result[:, columns] = large[some, None] * directions[some]
    result[np.abs(result) < RANK * np.abs(result).max(initial=0.0)] = 0.0
    return result


def check_size(model: LinearSystem, band: tuple[float, float]) -> None:
    """Raise `InputError` if a band (Hz) needs more states than can be computed with."""
    low, high = band
    count = _estimate_states(model, high)
    good = 0.0
    if count > MOST_STATES:
        bad = high
        for _ in range(60):
            middle = (good + bad) / 2
            if _estimate_states(model, middle) <= MOST_STATES:
                good = middle
            else:
                bad = middle
        problem = (
            f"needs about {count:,} states for losses and modes of wires, which take too much"
            f" memory and time (at most {MOST_STATES:,})"
        )
        remedy = f"end it at {float(f'{0.95 * good:.2g}'):g} Hz or below"
    elif np.log10(high) - np.log10(low) > DECADES:
        problem = f"spans more than {DECADES} decades"
        remedy = "begin it at a higher frequency"
    else:
        return
    raise InputError.of("--band", problem, remedy, format_value(f"{low:g}:{high:g}"))


def _estimate_states(model: LinearSystem, highest: float) -> int:
    """Estimate the largest number of states, from that of the modes of wires up to 1.5 `highest`.

    Half of the coordinates' states again are for losses.
    """
    return 3 * (model.size + count_wire_modes(model, ABOVE * highest))


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


def _without_losses(
    model: LinearSystem, highest: float
) -> tuple[LinearSystem, list[list[Lossy]], list[Candidate]]:
    """Return the system with the inertia of wires and dampers alone, its losses, and wire modes.

    Losses are those of each element, of several sections for a wire.
    """
    groups = _groups(model)
    mass = np.zeros((model.size, model.size))
    damping = np.zeros((model.size, model.size))
    families: list[list[Lossy]] = []
    modes: list[Candidate] = []
    if model.is_lossy:
        families.append([Lossy(_deformations(model.loss), np.ones_like)])
    for term in model.terms:
        if isinstance(term, StructuralLoss):
            families.append([Lossy(_deformations(term.matrix), term.angle, term.stored)])
        elif isinstance(term, Damper):
            damping += term.matrix
        if not isinstance(term, WireTerm):
            continue
        for part, forms in term.forms.items():
            wire = _reduce(term.strand, part, highest)
            inertia = np.einsum("wci,cd,wdj->ij", forms, wire.inertia, forms)
            mass = mass + inertia
            damping = damping + wire.drag * inertia
            at = np.array([omega for omega, _ in wire.modes])
            lost = sum((energy * angle(at) for _, energy, angle in wire.losses), np.zeros(len(at)))
            for (omega, drives), own in zip(wire.modes, lost, strict=True):
                about = (WIRE, omega, wire.drag, float(own) / omega, term.stage)
                modes += [Candidate(row, *about) for row in _combinations(drives @ forms, groups)]
            family = [
                Lossy((ends @ forms).reshape(-1, model.size), angle)
                for ends, _, angle in wire.losses
            ]
            if family:
                families.append(family)
    mass, damping = (_framed(part, groups) for part in (mass, damping))
    lossless = replace(model.lossless, terms=model.terms_with_states, ground=None)
    system = replace(
        lossless,
        mass=lossless.mass + mass,
        damping=lossless.damping + damping,
        massless=lossless.massless & ~mass.any(1),
        allowed=lossless.allowed | (mass != 0) | (damping != 0),
    )
    return system, families, modes


def _combinations(
    driven: Float[np.ndarray, "wire coordinate"], groups: list[Index]
) -> Iterator[Float[np.ndarray, " coordinate"]]:
    """Combine equal modes of equal wires, so that each is driven by one group of coordinates."""
    for columns in groups:
        yield from _within(driven, columns)


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
